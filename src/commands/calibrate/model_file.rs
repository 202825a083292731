//! The model file of a calibration.

use super::document::{ShownCalibration, turn_on_remark};
use super::fits::fit_record;
use crate::app::Input;
use crate::io::model_file::{Interval, ModelFile, PROGRAM, SCHEMA, TurnOn, known};
use nav_sim_calibration::{Estimator, Outcome, ParameterSpread, Settings, model_of};
use nav_sim_signal::imu::{Axis, Channel, Sensor};
use nav_sim_signal::noise::{Law, LognormalIntervals, Spread, Variation};
use nav_sim_signal::wavelet::Convention;
use serde_json::json;
use toml::Table;

/// The facts of a calibration for its model files.
#[derive(Debug, Clone, Default, PartialEq)]
pub(crate) struct CalibrationNote {
    /// Seed of the bootstrap, if there was one.
    pub seed: Option<u64>,
    /// How the recordings were read and grouped, key by key: what was left out at their beginning, gaps, axes, scales, pool.
    pub reading: Table,
    /// The recordings or the curve, and the parameters file.
    pub inputs: Vec<Input>,
}

impl CalibrationNote {
    /// The model file of one estimator. Channels of no group are missing in it. `curves`: BLAKE3, in hexadecimal, of the
    /// file of curves that goes beside it.
    pub(crate) fn model_file(&self, shown: &ShownCalibration<'_>, curves: &str) -> ModelFile {
        let (outcomes, settings) = (&shown.outcomes, shown.settings);
        let mut file = ModelFile::new(model_of(outcomes.iter().copied(), settings.rate_hz));
        file.missing = Channel::ALL.to_vec();
        for outcome in outcomes {
            for channel in outcome.scope.channels() {
                file.missing.retain(|c| *c != channel);
                file.intervals.extend(intervals(outcome, channel));
            }
        }
        file.spread = spread(outcomes, settings.rate_hz);
        let mut provenance = self.provenance(outcomes, settings, curves);
        let mut remarks = Table::new();
        let mut turn_on = TurnOn::default();
        for found in &shown.turn_on {
            let sensor = found.sensor;
            remarks.insert(sensor.name().to_owned(), turn_on_remark(found).into());
            let sigmas = found.sigmas().map(|sigmas| {
                Axis::ALL.map(
                    |axis| match file.missing.contains(&Channel { sensor, axis }) {
                        true => 0.0,
                        false => sigmas[axis as usize],
                    },
                )
            });
            match sensor {
                Sensor::Accel => turn_on.accel_m_s2 = sigmas,
                Sensor::Gyro => turn_on.gyro_rad_s = sigmas,
            }
        }
        file.turn_on = (turn_on != TurnOn::default()).then_some(turn_on);
        if !remarks.is_empty() {
            provenance.insert("turn_on".to_owned(), remarks.into());
        }
        file.provenance = Some(provenance);
        file
    }

    fn provenance(&self, outcomes: &[&Outcome], settings: &Settings, curves: &str) -> Table {
        let estimator = outcomes.first().map_or(Estimator::Given, |o| o.estimator);
        let is_robust = estimator.is_robust();
        let fit = |outcome: &&Outcome| known(fit_record(outcome, settings));
        // TOML integers are signed; larger seeds go as text.
        let seed =
            |seed: u64| i64::try_from(seed).map_or_else(|_| json!(seed.to_string()), Into::into);
        let mut table = known(json!({
            "program": PROGRAM,
            "schema": SCHEMA,
            "estimator": estimator,
            "model": settings.model.to_string(),
            "weighting": settings.weighting.name(),
            "fit_range_s": settings.fit_range.map(|range| [range.from_s, range.to_s]),
            "seed": self.seed.map(seed),
            "efficiency": is_robust.then(|| settings.tuning.efficiency()),
            "efficiency_convention": is_robust.then(|| Convention::Exact.name()),
            "fits": outcomes.iter().map(fit).collect::<Vec<_>>(),
            "inputs": self.inputs,
            "curves_blake3": curves,
        }));
        table.extend(self.reading.clone());
        table
    }
}

/// The laws by which the parameters of recordings differ; none where none is known to.
fn spread(outcomes: &[&Outcome], rate_hz: f64) -> Option<Spread> {
    let mut spread = Spread::default();
    for outcome in outcomes {
        let (composite, labels) = (&outcome.fit.composite, outcome.fit.composite.labels());
        let variation = |found: &ParameterSpread| {
            let ci95 = Some(LognormalIntervals {
                median: found.median_ci95,
                sd: found.sd_ci95,
            });
            let law = Law::Lognormal {
                median: found.median,
                sd: found.sd,
                ci95,
            };
            let (process, parameter) = (&labels[found.of.process], found.of.parameter.name());
            Variation::new(composite, rate_hz, process, parameter, law).ok()
        };
        let laws: Vec<Variation> = outcome
            .inference
            .iter()
            .flat_map(|i| &i.varying)
            .filter_map(variation)
            .collect();
        outcome
            .scope
            .channels()
            .iter()
            .for_each(|c| spread.axes[c.index()].clone_from(&laws));
    }
    (spread != Spread::default()).then_some(spread)
}

fn intervals(outcome: &Outcome, channel: Channel) -> impl Iterator<Item = Interval> {
    let labels = outcome.fit.composite.labels();
    super::fits::intervals(outcome)
        .iter()
        .filter(|i| i.low.is_finite())
        .map(move |i| Interval {
            channel,
            process: labels[i.of.process].clone(),
            parameter: i.of.parameter.name().to_owned(),
            low: i.low,
            high: i.high,
        })
}
