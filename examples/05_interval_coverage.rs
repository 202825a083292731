//! How often the 95 % intervals of a calibration hold the truth, and how far the estimates are off in the mean: sets of
//! eight replicates of the paper's Section IV (clean, parameters drawn for each), theta_0 by quadrature.
//!
//! `cargo run --release --example 05_interval_coverage -- SETS SAMPLES DRAWS CASE` (default 200 65536 199 paper). Other
//! cases, six replicates of one noise: `qn32`, `qn50`, `qn66`, `qn86` (white noise, random walk, and quantization noise that
//! is so many per cent of the first scale), `n2` (two AR1, 64 %); `single`: white noise and random walk, one recording.
#![expect(clippy::print_stdout, reason = "an example shows its results")]

use nav_sim::calibration::{
    Bootstrap, Estimator, ModelChoice, Outcome, Pool, Replicate, Settings, calibrate, grouped, infer,
};
use nav_sim::data::study_file;
use nav_sim::noise::{Composite, Model, Process, Spread, Synthesizer};
use nav_sim::rng::StreamKey;
use nav_sim::study::{Design, target};
use nav_sim::wavelet::both;
use rayon::prelude::*;
use std::error::Error;
use std::path::Path;

type Failure = Box<dyn Error + Send + Sync>;

/// The fits of one set, with their intervals.
fn set(design: &Design, set: u64, draws: usize) -> Result<Vec<Outcome>, Failure> {
    let mut measured = Vec::new();
    for run in 0..design.replicates {
        let drawn = design.spread.draw(&design.model, set, run)?;
        let key = StreamKey { seed: set, scenario: "coverage", run, source: "", process: "" };
        let mut signal = vec![0.0; design.samples];
        Synthesizer::new(drawn.axis(design.channel), key).fill(&mut signal);
        let (classical, robust) = both(&signal, design.levels, &design.tuning)?;
        let (name, axis) = (run.to_string(), Some(design.channel.axis));
        measured.push((
            design.channel,
            Replicate { name, axis, samples: design.samples, classical, robust, trend: f64::NAN },
        ));
    }
    let settings = Settings {
        estimators: design.estimators.clone(),
        model: ModelChoice::Given(design.spec.clone()),
        limits: Vec::new(),
        trim: design.trim,
        tuning: design.tuning,
        weighting: design.weighting,
        rate_hz: design.model.rate_hz,
    };
    let groups = grouped(measured, Pool::Axes);
    let mut outcomes = calibrate(&groups, &settings)?;
    infer(&groups, &mut outcomes, &settings, Bootstrap { draws, seed: set });
    Ok(outcomes)
}

/// A case by its name.
fn case(name: &str, paper: Design) -> Result<Design, Failure> {
    let of_parts = |parts: &[(&str, &[f64])], replicates: u64| -> Result<Design, Failure> {
        let mut processes = Vec::new();
        for (code, values) in parts {
            processes
                .push(Process::from_values(code, values, paper.model.rate_hz).ok_or("no such process")??);
        }
        let noise = Composite::new(processes);
        let model = Model::pooled(paper.model.rate_hz, &noise, &noise);
        let spec = parts.iter().map(|(code, _)| *code).collect::<Vec<_>>().join("+").parse()?;
        let estimators = match replicates {
            1 => vec![Estimator::Gmwm, Estimator::Rgmwm],
            _ => vec![Estimator::Awv, Estimator::SrAwv, Estimator::DrAwv],
        };
        Ok(Design { model, spread: Spread::default(), replicates, spec, estimators, ..paper.clone() })
    };
    // Of the first scale QN is 1.5 q2, WN sigma2/2.
    let q2 = |share: f64, sigma2: f64| sigma2 * share / (1.0 - share) / 3.0;
    let three = |share: f64| of_parts(&[("WN", &[1.0]), ("QN", &[q2(share, 1.0)]), ("RW", &[1e-6])], 6);
    match name {
        "paper" => Ok(paper),
        "qn32" => three(0.32),
        "qn50" => three(0.5),
        "qn66" => three(0.66),
        "qn86" => three(0.86),
        "n2" => {
            let slow: [(&str, &[f64]); 3] =
                [("AR1", &[0.98, 2e-7]), ("AR1", &[0.9995, 1e-9]), ("RW", &[1e-10])];
            of_parts(&[&[("WN", &[5e-5][..]), ("QN", &[q2(0.64, 5e-5)])], &slow[..]].concat(), 6)
        }
        "single" => of_parts(&[("WN", &[1.0]), ("RW", &[1e-6])], 1),
        other => Err(format!("no case \"{other}\"").into()),
    }
}

fn main() -> Result<(), Failure> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let number = |i: usize, default: usize| arguments.get(i).map_or(Ok(default), |a| a.parse::<usize>());
    let (sets, samples, draws) = (number(0, 200)?, number(1, 1 << 16)?, number(2, 199)?);
    let name = arguments.get(3).map_or("paper", String::as_str);
    let study = Path::new(env!("CARGO_MANIFEST_DIR")).join("examples/paper_fig2.toml");
    let design = case(name, study_file::read(&study)?.design.with_samples(samples))?;
    let aim = target(&design)?;
    let (names, truth) = (Design::parameters(&aim.fit.composite), Design::values(&aim.fit.composite));
    let all: Vec<Vec<Outcome>> =
        (0..sets as u64).into_par_iter().map(|s| set(&design, s, draws)).collect::<Result<_, _>>()?;
    println!(
        "{name}: {sets} sets, {samples} samples, {draws} draws; mean of estimate over truth, and its standard error; truth in \
         the 95 % interval (below it, above it, no interval)"
    );
    for (e, estimator) in design.estimators.iter().enumerate() {
        let rejected = all
            .iter()
            .filter(|o| o[e].inference.as_ref().and_then(|i| i.goodness).is_some_and(|g| g.p_value <= 0.05));
        println!("{}: J-test rejects {:.1} % at 5 %", estimator.name(), percent(rejected.count(), sets));
        for (p, (name, truth)) in names.iter().zip(&truth).enumerate() {
            let (mean, error) =
                mean_ratio(all.iter().map(|o| Design::values(&o[e].fit.composite)[p]), *truth);
            let ends = || all.iter().filter_map(|o| Some(&o[e].inference.as_ref()?.intervals[p]));
            let (above, below) =
                (ends().filter(|i| i.low > *truth).count(), ends().filter(|i| i.high < *truth).count());
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
