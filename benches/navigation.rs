//! What an epoch costs: noise, filter and fix, beside references that do the same another way.
//!
//! `cargo bench --bench navigation` prints the time of a round of [`SAMPLES`] IMU samples (of eight runs for
//! the lane kernels, of one for the references) and run-epochs a second. The references are a dense
//! 15-state covariance step in nalgebra, without strapdown, and kinavis-ins, a public 15-state filter in
//! f64, strapdown and covariance.

use criterion::measurement::WallTime;
use criterion::{
    BatchSize, BenchmarkGroup, Criterion, Throughput, criterion_group, criterion_main,
};
use kinavis_ins::{ImuNoise, ImuSample, InsFilter, InsPriors, Quaternion, gravity_down};
use kinavis_kernel::{
    Angle, Distance, GeodeticPoint, Height, Instant, Position, Speed, TrueCourse, Utc, Vector3,
};
use nalgebra::SMatrix;
use nav_sim::io::trajectory_file;
use nav_sim::navigation::ekf::{FilterModel, FilterStates};
use nav_sim::navigation::scenario::Scenario;
use nav_sim::navigation::sensors::imu::Truth;
use nav_sim::navigation::sensors::outage::Outage;
use nav_sim::navigation::trajectory::ideal_imu::ideal_imu;
use nav_sim_navigation::metrics::Budget;
use nav_sim_navigation::simulation::lincov::{FilterPass, TruthModel};
use nav_sim_signal::lanes::Level;
mod throughput;
use std::hint::black_box;
use std::path::Path;
use std::time::Duration;
use throughput::{Load, RUN_EPOCHS, SAMPLES, model};

const VALID: &str = "the parameters are in their domains";

fn run_epochs(c: &mut Criterion) {
    let model = model().expect(VALID);
    let mut group = c.benchmark_group("run-epoch");
    group.throughput(Throughput::Elements(RUN_EPOCHS as u64));
    let load = |states, level| Load::new(&model, states, level).expect(VALID);
    let (reduced, full) = (FilterStates::Reduced15, FilterStates::Full);
    for (name, states, level) in [
        ("filter-15", reduced, Level::best()),
        ("filter-15-avx2", reduced, Level::Avx2),
        ("filter-15-portable", reduced, Level::Portable),
        ("filter-27", full, Level::best()),
    ] {
        let mut load = load(states, level);
        load.noise();
        let second = |load: &mut Load<'_>| black_box(load).filter();
        group.bench_function(name, |b| {
            b.iter_batched_ref(|| load.clone(), second, BatchSize::SmallInput)
        });
    }
    let mut whole = load(reduced, Level::best());
    group.bench_function("noise-n2-six-axes", |b| {
        b.iter(|| black_box(&mut whole).noise())
    });
    group.bench_function("fix", |b| b.iter(|| black_box(&mut whole).fix()));
    group.bench_function("second", |b| {
        b.iter(|| {
            whole.noise();
            whole.filter();
            whole.fix()
        });
    });
    group.throughput(Throughput::Elements(SAMPLES as u64));
    dense_reference(&mut group);
    public_filter(&mut group);
    group.finish();
}

/// A quarter of an hour at 100 Hz with two outages: the reference linearised, a filter's gains, its true errors,
/// and what they are made of.
fn covariance_analysis(c: &mut Criterion) {
    let model = model().expect(VALID);
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("trajectories/land_vehicle.toml");
    let (path, _) = trajectory_file::load(&file, None).expect(VALID);
    let (scenario, outages) = (Scenario::default(), Outage::PAPER);
    let track = scenario.track(&path, &model, &outages).expect(VALID);
    let filter_models =
        [FilterModel::new(&model, FilterStates::Reduced15, 1.0, 800.0).expect(VALID)];
    let experiment = scenario.experiment(&path, Truth::Model(&model), &filter_models, &outages, 1);
    let sources = TruthModel::sources(&experiment, &model);
    let (filter, truth) = (
        FilterPass::new(&track, &filter_models[0]),
        TruthModel::together(&sources),
    );
    let mut group = c.benchmark_group("lincov-900-s");
    group.sample_size(10);
    group.bench_function("ideal-imu", |b| {
        b.iter(|| ideal_imu(black_box(&path), 100.0, scenario.filter.gravity))
    });
    group.bench_function("track", |b| {
        b.iter(|| scenario.track(black_box(&path), &model, &outages))
    });
    group.bench_function("reduction", |b| {
        b.iter(|| scenario.filter_model(black_box(&model), &outages, &track))
    });
    group.bench_function("gains-15", |b| {
        b.iter(|| FilterPass::new(black_box(&track), &filter_models[0]))
    });
    group.bench_function("true-errors", |b| {
        b.iter(|| black_box(&filter).errors(&truth))
    });
    group.bench_function("budget", |b| {
        b.iter(|| Budget::at_outage_ends(black_box(&filter), &sources))
    });
    group.finish();
}

/// P ← Phi P Phiᵀ + Q, 15 × 15, as one would write it first.
fn dense_reference(group: &mut BenchmarkGroup<'_, WallTime>) {
    let mut p = SMatrix::<f64, 15, 15>::identity();
    let q = SMatrix::<f64, 15, 15>::identity() * 1e-9;
    let phi =
        SMatrix::<f64, 15, 15>::from_fn(|i, j| f64::from(u8::from(i == j)) + 1e-4 * (i + j) as f64);
    group.bench_function("dense-covariance-15", |b| {
        b.iter(|| {
            for _ in 0..SAMPLES {
                p = black_box(phi) * p * phi.transpose() * 0.5 + q;
            }
            p
        });
    });
}

/// A public filter of the same states on the same second: at rest, 100 Hz.
fn public_filter(group: &mut BenchmarkGroup<'_, WallTime>) {
    let start = Instant::<Utc>::from_unix_seconds(1_789_000_000);
    let place = Position::from_degrees(45.8, 5.7).expect(VALID);
    let point = GeodeticPoint::new(
        place,
        Height::above_ellipsoid(Distance::from_metres(400.0).expect(VALID)),
    );
    let still = Vector3::new(Speed::ZERO, Speed::ZERO, Speed::ZERO);
    let level =
        Quaternion::from_euler(Angle::ZERO, Angle::ZERO, TrueCourse::new(0.0).expect(VALID));
    let nominal = kinavis_ins::Strapdown::new(start, point, still, level).expect(VALID);
    let mut filter = InsFilter::new(nominal, ImuNoise::mems(), &InsPriors::standard());
    let gravity = gravity_down(45.8_f64.to_radians().sin(), 400.0);
    let sample =
        ImuSample::new([0.0; 3], [0.0, 0.0, -gravity], Duration::from_millis(10)).expect(VALID);
    group.bench_function("kinavis-ins-15", |b| {
        b.iter(|| {
            for _ in 0..SAMPLES {
                black_box(&mut filter).predict(&sample).expect("at rest");
            }
        });
    });
}

criterion_group!(benches, run_epochs, covariance_analysis);
criterion_main!(benches);
