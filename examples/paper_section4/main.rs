//! Section IV of Minaretzis et al. 2024: how accurate the estimators are (Figure 2), and how far one disturbance moves them
//! (influence functions, equations (9) to (13)).
//!
//!     cargo run --release --example paper_section4 -- [--sets 500] [--samples 524284] [--seed 1] [--weighting edof]
//!         [--avlr] [--scaled] [--sensitivity] [-o paper_section4]
//!
//! Writes results.csv and figure2.svg, with `--sensitivity` sensitivity.csv. `--avlr` studies the cost of reading white noise
//! and random walk off the slopes of the Allan deviation instead (Guerrier, Molinari, Stebler 2016). `--scaled` makes the step
//! as large beside the random walk of a shorter record as it is in the paper.
#![expect(clippy::print_stdout, reason = "an example shows its results")]

use nav_sim::calibration::{Estimator, Trim, Weighting};
use nav_sim::document::{Chart, ChartAxis, Colour, Mark, Panel, PointInterval, Series, svg};
use nav_sim::io::contamination_file;
use nav_sim::prelude::*;
use nav_sim::signal::noise::ProcessKind;
use nav_sim::signal::noise::contamination::{Contamination, Operation};
use nav_sim::signal::wavelet::{Tuning, default_levels};
use rayon::prelude::*;
use std::error::Error;
use std::fs;
use std::path::{Path, PathBuf};
use study::{
    Accuracy, Design, Estimate, Movement, Target, abnormal_curve, accuracy, outlier_curve, target,
};

#[allow(unreachable_pub, reason = "shared with the tests")]
pub(crate) mod study;

type Failure = Box<dyn Error + Send + Sync>;

/// The paper's design: K = 8 replicates of N1 whose parameters vary, clean (I), corrupted (II), one of them abnormal too (III).
pub(crate) fn section4(samples: usize) -> Result<Design, Failure> {
    let estimators = vec![Estimator::Awv, Estimator::SrAwv, Estimator::DrAwv];
    let scenarios = ["section4-I", "section4-II", "section4-III"];
    design(
        "accelerometer_n1.toml",
        "N1",
        samples,
        8,
        estimators,
        &scenarios,
    )
}

/// White noise and random walk of one clean recording at a time.
fn avlr(samples: usize) -> Result<Design, Failure> {
    let estimators = vec![Estimator::Awv, Estimator::SrAwv, Estimator::Avlr];
    design(
        "white_and_walk.toml",
        "WN+RW",
        samples,
        1,
        estimators,
        &["section4-I"],
    )
}

fn design(
    model: &str,
    fit: &str,
    samples: usize,
    replicates: u64,
    estimators: Vec<Estimator>,
    scenarios: &[&str],
) -> Result<Design, Failure> {
    let examples = Path::new(env!("CARGO_MANIFEST_DIR")).join("examples");
    let file = read_model(&examples.join(model))?;
    let contamination = |name: &&str| -> Result<Contamination, Failure> {
        Ok(contamination_file::find(name, file.model.rate_hz)?)
    };
    Ok(Design {
        seed: 1,
        channel: Channel {
            sensor: Sensor::Accel,
            axis: nav_sim::prelude::Axis::X,
        },
        replicates,
        samples,
        levels: default_levels(samples),
        scenarios: scenarios
            .iter()
            .map(contamination)
            .collect::<Result<_, _>>()?,
        estimators,
        spec: fit.parse()?,
        trim: Trim::Count(2),
        tuning: Tuning::default(),
        weighting: Weighting::Edof,
        spread: file.spread.unwrap_or_default(),
        model: file.model,
    })
}

/// Accuracy of one estimator in one parameter and scenario.
pub(crate) struct Row {
    scenario: String,
    estimator: &'static str,
    parameter: String,
    target: f64,
    pub(crate) accuracy: Accuracy,
    /// RMSE over that of the first estimator in the same scenario, on the same sets, and its standard error.
    ratio: (f64, f64),
    /// Sets in which the estimate is 0: not identifiable.
    zeros: usize,
    /// Share of robust wavelet variances without an admissible root.
    without_root: f64,
}

/// Errors of the estimates of so many sets, by scenario, estimator and parameter.
pub(crate) fn study(design: &Design, sets: u64) -> Result<Vec<Row>, Failure> {
    design.check()?;
    let Target { fit, .. } = target(design)?;
    let (names, targets) = (
        Design::parameters(&fit.composite),
        Design::values(&fit.composite),
    );
    let sets: Vec<Vec<Estimate>> = (0..sets)
        .into_par_iter()
        .map(|set| design.set(set))
        .collect::<Result<_, _>>()?;
    let width = design.estimators.len();
    let mut rows: Vec<Row> = Vec::new();
    for (s, scenario) in design.scenarios.iter().enumerate() {
        let first = rows.len();
        for (e, estimator) in design.estimators.iter().enumerate() {
            let estimates = || sets.iter().map(|set| &set[s * width + e]);
            let roots: usize = estimates().map(|estimate| estimate.without_root).sum();
            let variances = sets.len() as f64 * design.replicates as f64 * f64::from(design.levels);
            for (p, (name, target)) in names.iter().zip(&targets).enumerate() {
                let values: Vec<f64> = estimates().map(|estimate| estimate.theta[p]).collect();
                let accuracy = accuracy(&values, *target, design.seed);
                let of_first = rows.get(first + p).map_or(&accuracy, |row| &row.accuracy);
                rows.push(Row {
                    ratio: accuracy.ratio_to(of_first),
                    scenario: scenario.name.clone(),
                    estimator: estimator.name(),
                    parameter: name.clone(),
                    target: *target,
                    accuracy,
                    zeros: values.iter().filter(|v| **v <= 0.0).count(),
                    without_root: roots as f64 / variances,
                });
            }
        }
    }
    Ok(rows)
}

fn csv(rows: &[Row]) -> String {
    let head = "scenario,estimator,parameter,target,bias,bias_se,spread,rmse,rmse_se,ratio,ratio_se,zeros,without_root\n";
    let line = |r: &Row| {
        let (a, ratio) = (&r.accuracy, r.ratio);
        let numbers = [
            r.target, a.bias, a.bias_se, a.spread, a.rmse, a.rmse_se, ratio.0, ratio.1,
        ];
        let numbers = numbers.map(|v| format!("{v:e}")).join(",");
        let (scenario, estimator, parameter) = (&r.scenario, r.estimator, &r.parameter);
        format!(
            "{scenario},{estimator},{parameter},{numbers},{},{:e}\n",
            r.zeros, r.without_root
        )
    };
    rows.iter()
        .fold(head.to_owned(), |text, row| text + &line(row))
}

/// Robust RMSE (eq. 15 of the paper) in % ± its Monte-Carlo standard error, median error in brackets.
fn print(rows: &[Row]) {
    println!("robust RMSE in % of theta_0 ± its standard error (median relative error)");
    for Row {
        scenario,
        estimator,
        parameter,
        target,
        accuracy: a,
        ..
    } in rows
    {
        let [rmse, error, bias] = [a.rmse, a.rmse_se, a.bias].map(|v| 100.0 * v);
        println!(
            "{scenario:13} {estimator:7} {parameter:10} {target:.6e}  {rmse:.3} ± {error:.4} ({bias:+.3})"
        );
    }
}

/// Figure 2: a chart a parameter, scenarios side by side, estimators beside one another in each; bars are 95 % intervals.
fn figure2(design: &Design, rows: &[Row]) -> String {
    let scenarios = design.scenarios.iter().enumerate();
    let scenarios: Vec<String> = scenarios.map(|(k, s)| format!("{k} {}", s.name)).collect();
    let width = design.estimators.len();
    let chart = |parameter: &String| {
        let series = |(k, estimator): (usize, &Estimator)| {
            let beside = 0.6 * ((k as f64 + 0.5) / width as f64 - 0.5);
            let own = rows
                .iter()
                .filter(|r| r.parameter == *parameter && r.estimator == estimator.name());
            let point = |(s, r): (usize, &Row)| {
                let (y, half) = (100.0 * r.accuracy.rmse, 196.0 * r.accuracy.rmse_se);
                PointInterval {
                    x: s as f64 + beside,
                    y,
                    low: (y - half).max(0.1 * y),
                    high: y + half,
                }
            };
            let points = own.enumerate().map(point).collect();
            Series::new(estimator.name(), Colour::Hue(k), Mark::Points(points))
        };
        let panel = Panel::new(
            ChartAxis::log("robust RMSE (% of θ₀)"),
            design.estimators.iter().enumerate().map(series).collect(),
        );
        Chart::new(
            &format!("Accuracy of {parameter}"),
            ChartAxis::linear(&scenarios.join(", ")),
            vec![panel],
        )
    };
    let count = rows.len() / (scenarios.len() * width);
    let charts: Vec<Chart> = rows[..count]
        .iter()
        .map(|row| chart(&row.parameter))
        .collect();
    svg("Fig. 2: accuracy of the estimators", &charts)
}

/// Relative change of each estimate of the first set by one outlier, and by replicates with an abnormal random walk.
pub(crate) fn sensitivity(design: &Design) -> Result<String, Failure> {
    let names = Design::parameters(&target(design)?.fit.composite);
    let noise = design.model.axis(design.channel);
    let mut white = noise
        .processes
        .iter()
        .filter(|p| p.kind() == ProcessKind::White);
    let white = white.next().map(Process::amplitude);
    // An outlier's unit: the standard deviation of the white noise, or of what the first scale sees.
    let unit = white.unwrap_or_else(|| 2.0 * noise.haar_wv(1)).sqrt();
    let outliers: Vec<f64> = (0..=9).map(|k| 10_f64.powi(k)).collect();
    let factors: Vec<f64> = (0..=10).map(|k| 4_f64.powi(k)).collect();
    let mut curves = vec![(
        "outlier_in_sigmas".to_owned(),
        outlier_curve(design, unit, &outliers)?,
    )];
    // DR-AWV breaks down with one more than it drops.
    for count in 1..=design.trim.count(design.replicates as usize) as u64 + 1 {
        let name = format!("random_walk_variance_factor_of_{count}");
        curves.push((name, abnormal_curve(design, count, &factors)?));
    }
    let mut text = "disturbance,size,estimator,parameter,relative_change\n".to_owned();
    for (disturbance, curve) in &curves {
        for Movement { size, changes } in curve {
            for (estimator, changes) in design.estimators.iter().zip(changes) {
                for (name, change) in names.iter().zip(changes) {
                    text += &format!(
                        "{disturbance},{size},{},{name},{change:e}\n",
                        estimator.name()
                    );
                }
            }
        }
    }
    Ok(text)
}

pub(crate) fn main() -> Result<(), Failure> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let has = |name: &str| arguments.iter().any(|a| a == name);
    let value = |name: &str| {
        let place = arguments.iter().position(|a| a == name);
        place.and_then(|i| arguments.get(i + 1))
    };
    let number = |name: &str| value(name).map(|text| text.parse::<u64>()).transpose();
    let samples =
        number("--samples")?.unwrap_or(if has("--avlr") { 262_144 } else { 524_284 }) as usize;
    let mut design = if has("--avlr") {
        avlr(samples)?
    } else {
        section4(samples)?
    };
    design.seed = number("--seed")?.unwrap_or(design.seed);
    if value("--weighting").is_some_and(|name| name == "model") {
        design.weighting = Weighting::Model;
    }
    if has("--scaled") {
        let rules = design.scenarios.iter_mut().flat_map(|c| &mut c.rules);
        for rule in rules {
            if let Operation::Step { amplitude, .. } = &mut rule.operation {
                *amplitude *= (samples as f64 / 524_284.0).sqrt();
            }
        }
    }
    let rows = study(
        &design,
        number("--sets")?.unwrap_or(if has("--avlr") { 200 } else { 500 }),
    )?;
    print(&rows);
    let out = value("-o").map_or_else(|| PathBuf::from("paper_section4"), PathBuf::from);
    fs::create_dir_all(&out)?;
    fs::write(out.join("results.csv"), csv(&rows))?;
    fs::write(out.join("figure2.svg"), figure2(&design, &rows))?;
    if has("--sensitivity") {
        fs::write(out.join("sensitivity.csv"), sensitivity(&design)?)?;
    }
    println!("wrote {}", out.display());
    Ok(())
}
