//! Nothing is allocated inside the time loop: twice as long a drive makes as many allocations.

#![allow(clippy::unwrap_used, reason = "a test")]
#![allow(unsafe_code, reason = "an allocator that counts")]

use nav_sim::io::trajectory_file::load;
use nav_sim::navigation::ekf::{FilterModel, FilterStates};
use nav_sim::navigation::scenario::Scenario;
use nav_sim::navigation::sensors::imu::Truth;
use nav_sim::navigation::sensors::outage::Outage;
use nav_sim::navigation::simulation::Plan;
use nav_sim_navigation::simulation::{Gains, run_batch};
#[path = "../benches/throughput/mod.rs"]
#[allow(dead_code, reason = "its model alone is used")]
mod throughput;

use std::alloc::{GlobalAlloc, Layout, System};
use std::sync::atomic::{AtomicU64, Ordering};

struct Counting;

static ALLOCATIONS: AtomicU64 = AtomicU64::new(0);

unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        ALLOCATIONS.fetch_add(1, Ordering::Relaxed);
        unsafe { System.alloc(layout) }
    }
    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        unsafe { System.dealloc(pointer, layout) }
    }
    unsafe fn realloc(&self, pointer: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        ALLOCATIONS.fetch_add(1, Ordering::Relaxed);
        unsafe { System.realloc(pointer, layout, size) }
    }
}

#[global_allocator]
static COUNTING: Counting = Counting;

/// Allocations of a batch of eight runs along a profile that drives straight for `duration_s`.
fn allocations(duration_s: u32, gains: Gains) -> u64 {
    let directory = tempfile::tempdir().unwrap();
    let file = directory.path().join("straight.toml");
    let profile = format!(
        "start = {{ lat_deg = 46.5, lon_deg = 6.6, h_m = 400, heading_deg = 40 }}\n\
         segment = [{{ kind = \"straight\", duration_s = {duration_s} }}]\n"
    );
    std::fs::write(&file, profile).unwrap();
    let (trajectory, _) = load(&file, None).unwrap();
    let model = throughput::model().unwrap();
    let filter_models = [FilterStates::Reduced15, FilterStates::Full]
        .map(|states| FilterModel::new(&model, states, 1.0, 800.0).unwrap());
    let (scenario, outages) = (
        Scenario::default(),
        [Outage {
            start_s: 20.0,
            end_s: 30.0,
        }],
    );
    let mut experiment = scenario.experiment(
        &trajectory,
        Truth::Model(&model),
        &filter_models,
        &outages,
        1,
    );
    experiment.gains = gains;
    let plan = Plan::new(&experiment).unwrap();
    let runs_from = |first| assert_eq!(run_batch(&plan, first, 8)[0].runs.len(), 8);
    runs_from(0); // shared gains are computed once
    let before = ALLOCATIONS.load(Ordering::Relaxed);
    runs_from(8);
    ALLOCATIONS.load(Ordering::Relaxed) - before
}

#[test]
fn the_time_loop_allocates_nothing() {
    for gains in [Gains::Own, Gains::Shared] {
        let (short, long) = (allocations(60, gains), allocations(120, gains));
        assert_eq!(short, long);
        // the parts of a batch: eight runs of six axes of five processes, and records
        assert!(short > 0, "the allocator counts");
    }
}
