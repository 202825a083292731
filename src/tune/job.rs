//! Smallest factors on a model that make its filter consistent with another truth.

use super::result::{FactorEntry, TuneResult};
use crate::app::Input;
use crate::formats::model_file::{ModelFile, PROGRAM};
use nav_sim_calibration::derived_interval;
use nav_sim_navigation::ekf::{BeliefError, FilterStates};
use nav_sim_navigation::scenario::Scenario;
use nav_sim_navigation::sensors::defects::ImuSettings;
use nav_sim_navigation::sensors::outage::Outage;
use nav_sim_navigation::simulation::lincov::{
    Aim, Factor, Task, Track, TrueErrors, UpperEnd, aiding_factor, scaled,
};
use nav_sim_signal::imu::Sensor;
use nav_sim_signal::noise::Model;

/// What is tuned, for what, and where. Models are at the rate of the IMU.
pub(crate) struct TuneInputs<'a> {
    /// Receiver, start, and the filter that `run` would have.
    pub scenario: &'a Scenario,
    /// The model to be tuned.
    pub model: &'a Model,
    /// What may be true.
    pub truths: Truths,
    /// The way of the analysis.
    pub track: &'a Track,
    /// Its outages.
    pub outages: &'a [Outage],
    /// The filter that is made consistent.
    pub states: FilterStates,
    /// Condition under which the filter is consistent.
    pub aim: Aim,
}

/// What may be true of an IMU: some models, or one and the draws of its calibration.
pub(crate) struct Truths {
    /// The names of the models; of draws one for all.
    pub names: Vec<String>,
    /// What they are; the model first, where the others are its draws.
    pub errors: Vec<TrueErrors>,
    /// Of draws, what distances from their median are multiplied by.
    pub stretch: Option<f64>,
}

/// The factors, and the filter before and after them.
///
/// # Errors
/// When a model has no filter.
pub(crate) fn tune(inputs: &TuneInputs<'_>) -> Result<TuneResult, BeliefError> {
    let TuneInputs {
        model,
        truths,
        track,
        outages,
        states,
        aim,
        ..
    } = inputs;
    // Draws are many: within 1.2e-3 the analysis is the same with one step from fix to fix, which `run` takes for them too.
    let merged = truths.stretch.map(|_| track.merged());
    let analysed = merged.as_ref().unwrap_or(track);
    // The interval that `run` states for an error: the filter and its standard deviation are the same in all draws.
    let upper_end = |stretch| {
        move |estimate: f64, draws: Vec<f64>| derived_interval(estimate, draws, stretch)[1]
    };
    let upper_end = truths.stretch.map(upper_end);
    let mut scenario = inputs.scenario.clone();
    match states {
        // what goes with the filter of 21 states beside the model stays
        FilterStates::Full => scenario = scenario.with_full_noise(),
        reduced => scenario.filter.states = *reduced,
    }
    let filter_of_run = inputs.scenario.filter.states;
    // What is wrong with the vehicle's own measurements no noise of the IMU stands for: their sigmas come first.
    let aiding = &inputs.scenario.aiding;
    let belief = scenario
        .with_full_noise()
        .belief(model, outages, analysed)?;
    let known = TrueErrors {
        aiding: aiding.clone(),
        ..TrueErrors::from((*model).clone())
    };
    let aiding_sigmas =
        (!aiding.is_none()).then(|| aiding_factor(analysed, &belief, &known).unwrap_or(f64::NAN));
    let widened = aiding_sigmas
        .filter(|factor| *factor > 1.0)
        .map(|factor| analysed.with_aiding_sigmas(factor));
    let believed = analysed;
    let analysed = widened.as_ref().unwrap_or(analysed);
    let full = scenario.with_full_noise();
    let full = |model: &Model| full.belief(model, outages, analysed);
    let tuned = |model: &Model| scenario.belief(model, outages, analysed);
    let of_run = |model: &Model| inputs.scenario.belief(model, outages, analysed);
    let task = Task {
        model,
        truths: &truths.errors,
        drawn: upper_end.as_ref().map(|end| end as &UpperEnd<'_>),
        track: analysed,
        full: &full,
        filter: &tuned,
        aim: *aim,
        allow_smaller: false,
    };
    let factors = task.factors()?;
    let ones: Vec<Factor> = factors
        .iter()
        .map(|f| Factor {
            on_variance: 1.0,
            ..*f
        })
        .collect();
    let after = task.consistency(task.filter, &factors)?;
    Ok(TuneResult {
        filter: *states,
        filter_of_run,
        before: Task {
            track: believed,
            ..task
        }
        .consistency(task.filter, &ones)?,
        aiding_sigmas,
        after,
        of_run: (*states != filter_of_run)
            .then(|| task.consistency(&of_run, &factors))
            .transpose()?,
        informed: truths
            .errors
            .iter()
            .all(|truth| truth.imu.without_states().next().is_none())
            .then(|| {
                task.informed(|truth| {
                    knowing(&scenario, &truth.imu).belief(&truth.model, outages, analysed)
                })
            })
            .transpose()?,
        factors,
        truths: truths.names.clone(),
        is_drawn: truths.stretch.is_some(),
        aim: *aim,
        without_factor: task.without_factor(),
    })
}

/// The scenario with the filter that has states for what the true IMU is stated to have beside its noise.
fn knowing(scenario: &Scenario, imu: &ImuSettings) -> Scenario {
    let mut knowing = scenario.with_full_noise();
    for sensor in Sensor::ALL {
        let (_, ppm) = imu.deviations(sensor);
        let known = (imu.turn_on_bias(sensor), Some(ppm).filter(|ppm| *ppm > 0.0));
        let initial = &mut knowing.initial;
        let (bias, scale) = match sensor {
            Sensor::Accel => (
                &mut initial.accel_bias_sigma_m_s2,
                &mut initial.accel_scale_sigma_ppm,
            ),
            Sensor::Gyro => (
                &mut initial.gyro_bias_sigma_rad_s,
                &mut initial.gyro_scale_sigma_ppm,
            ),
        };
        (*bias, *scale) = (known.0.or(*bias), known.1.or(*scale));
    }
    knowing
}

/// The tuned model, and where it came from; `goal`: the aim and what was taken for true.
pub(crate) fn tuned(
    file: &ModelFile,
    factors: &[Factor],
    goal: &str,
    inputs: &[Input],
) -> ModelFile {
    let mut provenance = toml::Table::new();
    let mut put = |key: &str, value: toml::Value| provenance.insert(key.to_owned(), value);
    put("program", PROGRAM.into());
    put("made_by", "tune".into());
    put("honest_for", goal.into());
    let table = |t: Result<toml::Table, toml::ser::Error>| toml::Value::from(t.unwrap_or_default());
    let entries = factors
        .iter()
        .map(|f| table(toml::Table::try_from(FactorEntry::of(f))));
    put("factors", entries.collect::<Vec<_>>().into());
    put(
        "inputs",
        inputs
            .iter()
            .map(|i| table(toml::Table::try_from(i)))
            .collect::<Vec<_>>()
            .into(),
    );
    let (missing, turn_on) = (file.missing.clone(), file.turn_on);
    ModelFile {
        missing,
        turn_on,
        provenance: Some(provenance),
        ..ModelFile::new(scaled(&file.model, factors))
    }
}
