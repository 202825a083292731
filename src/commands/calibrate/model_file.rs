//! The model file of a calibration.

use super::{all_notes, turn_on_remark};
use crate::app::Input;
use crate::io::model_file::{Interval, ModelFile, PROGRAM, SCHEMA, TurnOn};
use nav_sim_calibration::{
    Estimator, MeansOfAxis, Outcome, ParameterSpread, Settings, TURN_ON_LEVEL, TurnOnSpread, tau_s,
};
use nav_sim_signal::imu::{Axis, Channel, Sensor};
use nav_sim_signal::noise::{Law, LognormalIntervals, Model, Spread, Variation};
use nav_sim_signal::wavelet::Convention;
use serde::Serialize;
use toml::{Table, Value};

/// What a calibration leaves in the file beside the model.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct CalibrationNote {
    /// How the tuning constant follows from the efficiency.
    pub efficiency_convention: Convention,
    /// Seed of the bootstrap, if there was one.
    pub seed: Option<u64>,
    /// How the recordings were read and grouped, key by key: what was left out at their beginning, gaps, axes, scales, pool.
    pub reading: Table,
    /// The recordings or the curve, and the parameters file.
    pub inputs: Vec<Input>,
}

impl CalibrationNote {
    /// The model file of the outcomes of one estimator. Channels of no group are missing in it. `curves`: BLAKE3, in
    /// hexadecimal, of the file of curves that goes beside it.
    pub(crate) fn model_file(
        &self,
        outcomes: &[&Outcome],
        settings: &Settings,
        curves: Option<&str>,
    ) -> ModelFile {
        let mut file = ModelFile::new(Model {
            rate_hz: settings.rate_hz,
            axes: Default::default(),
        });
        file.missing = Channel::ALL.to_vec();
        for outcome in outcomes {
            for channel in outcome.scope.channels() {
                file.model.axes[channel.index()] = outcome.fit.composite.clone();
                file.missing.retain(|c| *c != channel);
                file.intervals.extend(intervals(outcome, channel));
            }
        }
        file.spread = spread(outcomes, settings.rate_hz);
        let mut provenance = self.provenance(outcomes, settings);
        if let Some(blake3) = curves {
            provenance.insert("curves_blake3".to_owned(), blake3.into());
        }
        file.provenance = Some(provenance);
        file
    }

    fn provenance(&self, outcomes: &[&Outcome], settings: &Settings) -> Table {
        let mut table = Table::new();
        let mut put = |key: &str, value: Value| table.insert(key.to_owned(), value);
        let estimator = outcomes.first().map_or(Estimator::Given, |o| o.estimator);
        put("program", PROGRAM.into());
        put("schema", (SCHEMA as i64).into());
        put("estimator", estimator.name().into());
        put("model", settings.model.to_string().into());
        put("weighting", settings.weighting.name().into());
        if let Some(range) = settings.fit_range {
            put("fit_range_s", vec![range.from_s, range.to_s].into());
        }
        if let Some(seed) = self.seed {
            // TOML integers are signed; larger seeds go as text.
            put(
                "seed",
                i64::try_from(seed).map_or_else(|_| seed.to_string().into(), Value::from),
            );
        }
        if estimator.is_robust() {
            put("efficiency", settings.tuning.efficiency().into());
            put(
                "efficiency_convention",
                self.efficiency_convention.name().into(),
            );
        }
        for (key, value) in &self.reading {
            put(key, value.clone());
        }
        put(
            "fits",
            outcomes
                .iter()
                .map(|o| fit(o, settings))
                .collect::<Vec<_>>()
                .into(),
        );
        put(
            "inputs",
            self.inputs.iter().map(input).collect::<Vec<_>>().into(),
        );
        table
    }
}

/// A model file with the turn-on biases that the recordings' means show; why or why not stands in the provenance.
pub(super) fn with_turn_on<'a>(
    mut file: ModelFile,
    means: impl Iterator<Item = &'a TurnOnSpread>,
) -> ModelFile {
    let mut turn_on = TurnOn::default();
    let mut remarks = Table::new();
    for found in means {
        remarks.insert(found.sensor.name().to_owned(), turn_on_remark(found).into());
        let Some(sigmas) = found.sigmas() else {
            continue;
        };
        let of_axis = |axis: Axis| {
            let channel = Channel {
                sensor: found.sensor,
                axis,
            };
            if file.missing.contains(&channel) {
                0.0
            } else {
                sigmas[axis as usize]
            }
        };
        let sigmas = Some(Axis::ALL.map(of_axis));
        match found.sensor {
            Sensor::Accel => turn_on.accel_m_s2 = sigmas,
            Sensor::Gyro => turn_on.gyro_rad_s = sigmas,
        }
    }
    file.turn_on = (turn_on != TurnOn::default()).then_some(turn_on);
    if let Some(provenance) = file.provenance.as_mut().filter(|_| !remarks.is_empty()) {
        provenance.insert("turn_on".to_owned(), remarks.into());
    }
    file
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
        let varying = outcome.inference.iter().flat_map(|i| &i.varying);
        let laws: Vec<Variation> = varying.filter_map(variation).collect();
        outcome
            .scope
            .channels()
            .iter()
            .for_each(|c| spread.axes[c.index()].clone_from(&laws));
    }
    (spread != Spread::default()).then_some(spread)
}

fn intervals(outcome: &Outcome, channel: Channel) -> Vec<Interval> {
    let labels = outcome.fit.composite.labels();
    let all = outcome
        .inference
        .iter()
        .flat_map(|i| &i.intervals)
        .filter(|i| i.low.is_finite());
    all.map(|i| Interval {
        channel,
        process: labels[i.of.process].clone(),
        parameter: i.of.parameter.name().to_owned(),
        low: i.low,
        high: i.high,
    })
    .collect()
}

fn fit(outcome: &Outcome, settings: &Settings) -> Table {
    let fit = &outcome.fit;
    let mut table = Table::new();
    let mut put = |key: &str, value: Value| table.insert(key.to_owned(), value);
    let count = |n: usize| Value::from(n as i64);
    put("signals", outcome.scope.name().into());
    put("model", outcome.spec.to_string().into());
    put("replicates", count(outcome.replicates));
    put("recordings", count(outcome.recordings));
    if outcome.estimator == Estimator::DrAwv {
        put("trim", count(settings.trim.count(outcome.replicates)));
    }
    put("scales", count(outcome.curve.levels.len()));
    put("objective", fit.objective.into());
    put("termination", fit.termination.name().into());
    put("combinations", count(fit.combinations));
    put("starts", count(fit.starts));
    put("agreeing", count(fit.agreeing));
    if let Some(runner_up) = fit.runner_up {
        put("runner_up", runner_up.into());
    }
    if let Some(inference) = &outcome.inference {
        put("bootstrap", count(inference.draws));
        if let Some(goodness) = inference.goodness {
            put("j_dof", count(goodness.dof));
            put("j_p_value", goodness.p_value.into());
        }
    }
    if let Some(misfit) = outcome.misfit() {
        put("worst_ratio", misfit.worst.ratio.into());
        put(
            "worst_tau_s",
            tau_s(misfit.worst.level, settings.rate_hz).into(),
        );
    }
    put("notes", all_notes(outcome, settings).into());
    table
}

fn input(input: &Input) -> Table {
    Table::try_from(input).expect("three words")
}

// What the means of recordings say of a turn-on bias, as JSON.

/// What the means of one sensor say, by the model of one estimator.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(crate) struct TurnOnEntry {
    /// `accel` or `gyro`.
    pub sensor: &'static str,
    /// Whose model says what the noise makes.
    pub estimator: &'static str,
    /// `seen`, `within_noise`, `moved` or `removed`.
    pub finding: &'static str,
    /// What goes into `[turn_on]`: the standard deviations of x, y, z (m/s² or rad/s).
    pub sigmas: Option<[f64; 3]>,
    /// Root mean square over the axes of the spread of the means (m/s² or rad/s).
    pub spread: f64,
    /// The same of what the fitted noise alone would make.
    pub noise: f64,
    /// Relative standard error of the spread of an axis.
    pub relative_error: f64,
    /// Probability that the fitted noise makes means scatter as much.
    pub p_noise: f64,
    /// Probability that noise which moves the recordings as much as they move makes means scatter as much.
    pub p_drift: f64,
    /// Below it both have to be for a bias to be seen.
    pub level: f64,
    /// Axis by axis.
    pub axes: Vec<MeansOfAxis>,
    /// The same in words.
    pub remark: String,
}

impl TurnOnEntry {
    /// The entry of a sensor.
    pub(crate) fn new(found: &TurnOnSpread) -> Self {
        Self {
            sensor: found.sensor.name(),
            estimator: found.estimator.name(),
            finding: found.finding.name(),
            sigmas: found.sigmas(),
            spread: found.spread(),
            noise: found.noise(),
            relative_error: found.relative_error(),
            p_noise: found.p_noise,
            p_drift: found.p_drift,
            level: TURN_ON_LEVEL,
            axes: found.axes.clone(),
            remark: turn_on_remark(found),
        }
    }
}
