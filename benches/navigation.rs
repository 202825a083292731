//! What an epoch costs: filter with and without noise, beside a dense filter of the same states.
//!
//! `cargo bench --bench navigation` prints, for one IMU epoch of one run: the strapdown and covariance of
//! the lane filter (15 and 27 states), the noise of six N2 axes, and a dense 15-state covariance step.

use criterion::{BatchSize, Criterion, Throughput, criterion_group, criterion_main};
use glam::DVec3;
use nalgebra::SMatrix;
use nav_sim::earth::GravityModel;
use nav_sim::ekf::{Belief, Ekf, FilterStates, InitialSettings, advance};
use nav_sim::frames::{NavState, RollPitchYaw};
use nav_sim::imu::{Channel, ImuSample};
use nav_sim::lanes::{LANES, Vec3};
use nav_sim::noise::{Ar1, Composite, Model, Process, Quantization, RandomWalk, White};
use nav_sim::rng::StreamKey;
use nav_sim::sensors::imu::{ImuErrors, Truth};
use nav_sim::strapdown::Strapdown;
use std::hint::black_box;

const EPOCHS: usize = 100;

fn n2(scale: f64) -> Composite {
    let new = "parameters are in their domains";
    Composite::new(vec![
        Process::White(White::new(scale * 5e-5).expect(new)),
        Process::Quantization(Quantization::new(scale * 1e-7).expect(new)),
        Process::Ar1(Ar1::new(0.9835, scale * 1.3e-8).expect(new)),
        Process::Ar1(Ar1::new(0.9999, scale * 1e-11).expect(new)),
        Process::RandomWalk(RandomWalk::new(scale * 2.9e-11).expect(new)),
    ])
}

fn filter(model: &Model, states: FilterStates) -> Ekf {
    let belief = Belief::new(model, states, 1.0, 800.0).expect("N2 can be reduced");
    let attitude = RollPitchYaw { roll: 0.02, pitch: 0.03, yaw: 1.0 };
    let v_n = DVec3::new(10.0, 5.0, 0.0);
    let start = NavState { lat: 0.8, lon: 0.1, h: 400.0, v_n, q_b_n: attitude.to_quat() };
    Ekf::new(Strapdown::new(&start, GravityModel::Wgs84), &belief, &start, &InitialSettings::default())
}

fn epochs(c: &mut Criterion) {
    let model = Model::pooled(100.0, &n2(1.0), &n2(1e-2));
    let sample = ImuSample { omega_ib_b: DVec3::new(0.01, 0.02, 0.1), f_ib_b: DVec3::new(0.5, 1.0, -9.8) };
    let (samples, errors) = (vec![sample; EPOCHS], vec![[Vec3::ZERO; 2]; EPOCHS]);
    let mut group = c.benchmark_group("run-epoch");
    for (name, states) in [("filter-15", FilterStates::Reduced15), ("filter-27", FilterStates::Full)] {
        group.throughput(Throughput::Elements((EPOCHS * LANES) as u64));
        let start = filter(&model, states);
        group.bench_function(name, |b| {
            b.iter_batched_ref(
                || start.clone(),
                |ekf| advance(black_box(ekf), black_box(&samples), black_box(&errors)),
                BatchSize::SmallInput,
            );
        });
    }
    group.throughput(Throughput::Elements(EPOCHS as u64));
    group.bench_function("noise-n2-six-axes", |b| {
        let key = StreamKey { seed: 1, scenario: "", run: 0, source: "", process: "" };
        let mut noise = ImuErrors::new(Truth::Model(&model), key, EPOCHS);
        let mut out = vec![0.0; EPOCHS];
        b.iter(|| Channel::ALL.into_iter().for_each(|c| noise.fill(c, black_box(&mut out))));
    });
    group.bench_function("dense-15-reference", |b| {
        let mut p = SMatrix::<f64, 15, 15>::identity();
        let q = SMatrix::<f64, 15, 15>::identity() * 1e-9;
        let phi = SMatrix::<f64, 15, 15>::from_fn(|i, j| f64::from(u8::from(i == j)) + 1e-4 * (i + j) as f64);
        b.iter(|| {
            for _ in 0..EPOCHS {
                p = black_box(phi) * p * phi.transpose() * 0.5 + q;
            }
            p
        });
    });
    group.finish();
}

criterion_group!(benches, epochs);
criterion_main!(benches);
