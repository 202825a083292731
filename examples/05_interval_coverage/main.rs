//! How often the 95 % intervals of a calibration contain the truth, and the mean error of the estimates: sets of
//! eight replicates of the paper's Section IV (clean, parameters drawn for each), theta_0 by quadrature.
//!
//! `cargo run --release --example 05_interval_coverage -- SETS SAMPLES DRAWS CASE LOST BURST` (default 200 65536 199 paper
//! 0 1: LOST per cent of the samples are missing, BURST at a time). Other cases, six replicates of one noise: `qn32`, `qn50`, `qn66`, `qn86` (white noise, random walk, and quantization noise that
//! is so many per cent of the first scale), `n2` (two AR1, 64 %); `single`: white noise and random walk, one recording.
#![expect(clippy::print_stdout, reason = "an example shows its results")]

mod cases;
#[path = "../paper_section4/main.rs"]
#[allow(dead_code, reason = "the design alone is used")]
mod paper_section4;

use cases::case;
use nav_sim::calibration::{
    Bootstrap, CalibrationSettings, ModelChoice, Outcome, Pool, add_intervals, calibrate, grouped,
    replicates,
};
use nav_sim::signal::imu::{Recording, Signal};
use nav_sim::signal::noise::Synthesizer;
use nav_sim::signal::rng::{Generator, StreamKey};
use paper_section4::study::{Design, target};
use rand::RngExt;
use rayon::prelude::*;
use std::error::Error;

type Failure = Box<dyn Error + Send + Sync>;

/// Missing samples: their share, and how many are lost at a time.
#[derive(Clone, Copy)]
struct Holes {
    share: f64,
    burst: usize,
}

fn lose(signal: &mut [f64], Holes { share, burst }: Holes, generator: &mut Generator) {
    let mut lost = 0;
    while (lost as f64) < share * signal.len() as f64 {
        let start = generator.random_range(0..signal.len() - burst);
        for x in &mut signal[start..start + burst] {
            lost += usize::from(!x.is_nan());
            *x = f64::NAN;
        }
    }
}

/// The fits of one set, with their intervals.
fn set(design: &Design, set: u64, draws: usize, holes: Holes) -> Result<Vec<Outcome>, Failure> {
    let mut measured = Vec::new();
    for run in 0..design.replicates {
        let drawn = design.spread.draw(&design.model, set, run);
        let key = StreamKey {
            seed: set,
            scenario: "coverage",
            run,
            source: "",
            process: "",
        };
        let mut signal = vec![0.0; design.samples];
        Synthesizer::new(drawn.axis(design.channel), key).fill(&mut signal);
        lose(
            &mut signal,
            holes,
            &mut StreamKey {
                process: "holes",
                ..key
            }
            .generator(),
        );
        let signals = vec![Signal {
            channel: design.channel,
            mean: 0.0,
            samples: signal,
        }];
        let recording = Recording {
            name: run.to_string(),
            rate_hz: design.model.rate_hz,
            signals,
        };
        measured.extend(replicates(&recording, Some(design.levels), &design.tuning)?);
    }
    let settings = CalibrationSettings {
        estimators: design.estimators.clone(),
        model: ModelChoice::Given(design.spec.clone()),
        trim: design.trim,
        tuning: design.tuning,
        weighting: design.weighting,
        fit_range: None,
        rate_hz: design.model.rate_hz,
    };
    let groups = grouped(measured, Pool::Axes);
    let mut outcomes = calibrate(&groups, &settings)?;
    add_intervals(
        &groups,
        &mut outcomes,
        &settings,
        Bootstrap { draws, seed: set },
    );
    Ok(outcomes)
}

fn main() -> Result<(), Failure> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let number =
        |i: usize, default: usize| arguments.get(i).map_or(Ok(default), |a| a.parse::<usize>());
    let (sets, samples, draws) = (number(0, 200)?, number(1, 1 << 16)?, number(2, 199)?);
    let share = arguments.get(4).map_or(Ok(0.0), |a| a.parse::<f64>())? / 100.0;
    let holes = Holes {
        share,
        burst: number(5, 1)?,
    };
    let name = arguments.get(3).map_or("paper", String::as_str);
    let design = case(name, paper_section4::section4(samples)?)?;
    let aim = target(&design)?;
    let (names, truth) = (
        Design::parameters(&aim.fit.composite),
        Design::values(&aim.fit.composite),
    );
    let all: Vec<Vec<Outcome>> = (0..sets as u64)
        .into_par_iter()
        .map(|s| set(&design, s, draws, holes))
        .collect::<Result<_, _>>()?;
    println!(
        "{name}: {sets} sets, {samples} samples, {draws} draws; mean of estimate over truth, and its standard error; truth in \
         the 95 % interval (below it, above it, no interval)"
    );
    for (e, estimator) in design.estimators.iter().enumerate() {
        let rejected = all.iter().filter(|o| {
            o[e].inference
                .as_ref()
                .and_then(|i| i.goodness)
                .is_some_and(|g| g.p_value <= 0.05)
        });
        println!(
            "{}: J-test rejects {:.1} % at 5 %",
            estimator.name(),
            percent(rejected.count(), sets)
        );
        for (p, (name, truth)) in names.iter().zip(&truth).enumerate() {
            let (mean, error) = mean_ratio(
                all.iter().map(|o| Design::values(&o[e].fit.composite)[p]),
                *truth,
            );
            let ends = || {
                all.iter()
                    .filter_map(|o| Some(&o[e].inference.as_ref()?.intervals[p]))
            };
            let (above, below) = (
                ends().filter(|i| i.low > *truth).count(),
                ends().filter(|i| i.high < *truth).count(),
            );
            let none = ends().filter(|i| i.low.is_nan()).count();
            let inside = percent(sets - above - below - none, sets - none);
            let [above, below, none] = [above, below, none].map(|n| percent(n, sets));
            println!(
                "  {name:13} {mean:.4} ± {error:.4}  {inside:5.1} % ({above:.1}, {below:.1}, {none:.1})"
            );
        }
    }
    Ok(())
}

/// Mean of estimate over truth, and its standard error.
fn mean_ratio(values: impl Iterator<Item = f64>, truth: f64) -> (f64, f64) {
    let ratios: Vec<f64> = values.map(|v| v / truth).collect();
    let count = ratios.len() as f64;
    let mean = ratios.iter().sum::<f64>() / count;
    let variance = ratios.iter().map(|r| (r - mean).powi(2)).sum::<f64>() / (count - 1.0);
    (mean, (variance / count).sqrt())
}

fn percent(some: usize, all: usize) -> f64 {
    100.0 * some as f64 / all as f64
}
