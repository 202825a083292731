//! The effect of each disturbance of the paper's scenarios II and III on the error after an outage, and its prediction
//! from the influence of the clean curve's scales: first order, d ln(error) = Σ influence · d ln(wavelet variance), and in
//! steps, with the influence computed anew at the middle of each.
//!
//! `cargo run --release --example 09_influence_on_table1 -- SAMPLES STEPS DISTURBANCE` (default 524284 4, every disturbance)
#![expect(clippy::print_stdout, reason = "an example shows its results")]

use nav_sim::calibration::{
    Estimator, Group, Outcome, Pool, Settings, calibrate, fit_curve, grouped, model_of, replicates,
};
use nav_sim::choose::{Drive, Laboratory};
use nav_sim::formats::{contamination_file, model_file};
use nav_sim::prelude::*;
use nav_sim::signal::imu::{Axis, Channel, Sensor};
use nav_sim::signal::noise::VirtualImu;
use nav_sim::signal::noise::contamination::{Contamination, Operation};
use nav_sim::signal::wavelet::Curve;
use std::error::Error;

const REPLICATES: u64 = 8;
/// A step of the way that the influence misses by more than this (percent) is one where the fit jumps.
const JUMP: f64 = 1.0;

/// The disturbances, each alone.
fn disturbances(rate_hz: f64) -> Result<Vec<(&'static str, Contamination)>, Box<dyn Error>> {
    type Is = fn(&Operation) -> bool;
    let alone = |name: &str, is: Is| -> Result<Contamination, Box<dyn Error>> {
        let mut all = contamination_file::find(name, rate_hz)?;
        all.rules.retain(|rule| is(&rule.operation));
        Ok(all)
    };
    Ok(vec![
        (
            "steps",
            alone("section5-II", |o| matches!(o, Operation::Step { .. }))?,
        ),
        (
            "replaced points",
            alone("section5-II", |o| matches!(o, Operation::Replace { .. }))?,
        ),
        (
            "vibration",
            alone("section5-II", |o| matches!(o, Operation::Bursts { .. }))?,
        ),
        (
            "abnormal replicates",
            alone("section5-III", |o| matches!(o, Operation::Ar1 { .. }))?,
        ),
        (
            "scenario II",
            contamination_file::find("section5-II", rate_hz)?,
        ),
        (
            "scenario III",
            contamination_file::find("section5-III", rate_hz)?,
        ),
    ])
}

/// A curve part of the way from one to another, on a logarithmic scale.
fn between(from: &Curve, to: &Curve, part: f64) -> Curve {
    let wv = from
        .wv
        .iter()
        .zip(&to.wv)
        .map(|(a, b)| a * (b / a).powf(part))
        .collect();
    Curve { wv, ..from.clone() }
}

struct Study<'a> {
    imu: VirtualImu<'a>,
    samples: usize,
    drive: Drive,
    laboratory: Laboratory,
    settings: Settings,
}

impl Study<'_> {
    fn groups(&self, contamination: Option<&Contamination>) -> Result<Vec<Group>, Box<dyn Error>> {
        let imu = VirtualImu {
            contamination,
            ..self.imu
        };
        let channels = Sensor::ALL.map(|sensor| Channel {
            sensor,
            axis: Axis::X,
        });
        let mut all = Vec::new();
        for k in 1..=REPLICATES {
            all.extend(replicates(
                &imu.recording(k, &channels, self.samples)?,
                None,
                &self.settings.tuning,
            )?);
        }
        Ok(grouped(all, Pool::Sensor))
    }

    fn settings(&self, estimator: Estimator) -> Settings {
        Settings {
            estimators: vec![estimator],
            ..self.settings.clone()
        }
    }

    /// The way from one set of curves to another in so many steps: of each, ln of the error's growth that the
    /// influence predicts, and that of the models fitted at its ends.
    fn way(
        &self,
        estimator: Estimator,
        groups: &[Group],
        (from, to): (&[Outcome], &[Outcome]),
        steps: u32,
    ) -> Result<Vec<[f64; 2]>, Box<dyn Error>> {
        let settings = self.settings(estimator);
        let fitted = |part: f64| {
            let fit = |((group, from), to): ((&Group, &Outcome), &Outcome)| {
                fit_curve(
                    group,
                    estimator,
                    between(&from.curve, &to.curve, part),
                    &settings,
                )
            };
            groups
                .iter()
                .zip(from)
                .zip(to)
                .map(fit)
                .collect::<Result<Vec<_>, _>>()
        };
        let ratios = from.iter().zip(to).flat_map(|(from, to)| {
            from.curve
                .wv
                .iter()
                .zip(&to.curve.wv)
                .map(|(a, b)| (b / a).ln())
                .collect::<Vec<_>>()
        });
        let ratios: Vec<f64> = ratios.collect();
        let mut before = self.ln_error(&fitted(0.0)?)?;
        let mut way = Vec::new();
        for step in 0..steps {
            // one step is of first order, from the beginning; of several each is taken from its middle
            let part = if steps == 1 {
                0.0
            } else {
                (f64::from(step) + 0.5) / f64::from(steps)
            };
            let influence =
                self.drive
                    .influence(&self.laboratory, groups, &fitted(part)?, &settings)?;
            let predicted = influence
                .scales
                .iter()
                .zip(&ratios)
                .map(|(s, ln)| s.on_error * ln)
                .sum::<f64>();
            let after = self.ln_error(&fitted(f64::from(step + 1) / f64::from(steps))?)?;
            way.push([predicted / f64::from(steps), after - before]);
            before = after;
        }
        Ok(way)
    }

    /// ln of the horizontal error after the outage, of the filter that believes what was fitted.
    fn ln_error(&self, outcomes: &[Outcome]) -> Result<f64, Box<dyn Error>> {
        Ok(self
            .drive
            .horizontal_rmse(&model_of(outcomes, self.settings.rate_hz))
            .map(f64::ln)?)
    }
}

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let samples = arguments
        .first()
        .map_or(Ok(524_284), |a| a.parse::<usize>())?;
    let steps = arguments.get(1).map_or(Ok(4), |a| a.parse::<u32>())?;
    let file = model_file::read("calib_data/consumer_mems.toml".as_ref())?;
    let rate_hz = file.model.rate_hz;
    let (trajectory, _) = load_trajectory(
        "trajectories/land_vehicle.toml".as_ref(),
        &TrajectoryOptions::default(),
    )?;
    let outage = Outage {
        start_s: 300.0,
        end_s: 390.0,
    };
    let settings = Settings {
        rate_hz,
        ..Settings::default()
    };
    let study = Study {
        imu: VirtualImu {
            model: &file.model,
            spread: file.spread.as_ref(),
            contamination: None,
            seed: 1,
        },
        samples,
        drive: Drive::new(&trajectory, Scenario::default(), vec![outage], rate_hz, 1)?,
        laboratory: Laboratory::new(Vec::new(), settings.clone(), None),
        settings,
    };
    let clean = study.groups(None)?;
    println!(
        "disturbance, estimator: error after {steps} steps, first order, refitted (%); steps that are not foreseen"
    );
    let percent = |ln: f64| 100.0 * ln.exp_m1();
    for (name, contamination) in disturbances(rate_hz)? {
        if arguments.get(2).is_some_and(|only| only != name) {
            continue;
        }
        let disturbed = study.groups(Some(&contamination))?;
        for estimator in [Estimator::Awv, Estimator::SrAwv, Estimator::DrAwv] {
            let settings = study.settings(estimator);
            let (from, to) = (
                calibrate(&clean, &settings)?,
                calibrate(&disturbed, &settings)?,
            );
            let first = study.way(estimator, &clean, (&from, &to), 1)?;
            let way = study.way(estimator, &clean, (&from, &to), steps)?;
            let sum =
                |way: &[[f64; 2]], which: usize| percent(way.iter().map(|step| step[which]).sum());
            let unforeseen = way
                .iter()
                .enumerate()
                .map(|(at, step)| (at, step.map(percent)));
            let unforeseen =
                unforeseen.filter(|(_, [predicted, found])| (predicted - found).abs() > JUMP);
            let jumps = unforeseen.map(|(at, [predicted, found])| {
                format!(
                    "; step {} is {predicted:.1} predicted, {found:.1} refitted",
                    at + 1
                )
            });
            let [in_steps, first, found] = [
                sum(&way, 0),
                sum(&first, 0),
                percent(study.ln_error(&to)? - study.ln_error(&from)?),
            ];
            println!(
                "{name}, {estimator}: {in_steps:.1}, {first:.1}, {found:.1}{}",
                jumps.collect::<String>()
            );
        }
    }
    Ok(())
}
