//! Synthesis of noise: each process alone, and the six axes of an IMU of N2 (30 processes), in blocks of a
//! size the simulation uses. Throughput is samples, so that its inverse is the cost of one.

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use nav_sim::signal::noise::{Composite, Process, ProcessKind, Synthesizer};
use nav_sim::signal::rng::StreamKey;
use std::hint::black_box;

const BLOCK: usize = 1024;

fn synthesizer(processes: Vec<Process>, source: &str) -> Synthesizer {
    let key = StreamKey {
        seed: 1,
        scenario: "bench",
        run: 0,
        source,
        process: "",
    };
    Synthesizer::new(&Composite::new(processes), key)
}

fn process(code: &str, values: &[f64]) -> Process {
    Process::of_values(ProcessKind::named(code).expect("known"), values, 100.0).expect("sound")
}

fn single_processes(c: &mut Criterion) {
    let mut group = c.benchmark_group("one process, per sample");
    group.throughput(Throughput::Elements(BLOCK as u64));
    for kind in ProcessKind::ALL {
        let mut source = synthesizer(
            vec![process(kind.code(), &[0.5, 0.5][..kind.parameters().len()])],
            "accel.x",
        );
        let mut block = [0.0; BLOCK];
        group.bench_function(kind.code(), |b| {
            b.iter(|| source.fill(black_box(&mut block)))
        });
    }
    group.finish();
}

fn six_axes_of_n2(c: &mut Criterion) {
    let n2 = vec![
        process("WN", &[5.2e-5]),
        process("QN", &[1e-7]),
        process("AR1", &[0.9835, 1.3e-8]),
        process("AR1", &[0.9999, 1e-11]),
        process("RW", &[2.9e-11]),
    ];
    let axes = [
        "accel.x", "accel.y", "accel.z", "gyro.x", "gyro.y", "gyro.z",
    ];
    let mut sources: Vec<Synthesizer> = axes.iter().map(|a| synthesizer(n2.clone(), a)).collect();
    let mut block = [0.0; BLOCK];
    let mut group = c.benchmark_group("six axes of N2");
    group.throughput(Throughput::Elements(BLOCK as u64 * 30));
    group.bench_function("per draw (30 an epoch)", |b| {
        b.iter(|| {
            sources
                .iter_mut()
                .for_each(|s| s.fill(black_box(&mut block)))
        });
    });
    group.finish();
}

criterion_group!(benches, single_processes, six_axes_of_n2);
criterion_main!(benches);
