//! What a calibration that is not made yet would tell: so many recordings of an IMU, so long each.

use super::{Design, DesignedParameter, DesignedQuantile};
use crate::app::Context;
use crate::commands::run::{NavigateInputs, navigate};
use crate::formats::draws_file::DrawsFile;
use crate::formats::model_file::ModelFile;
use crate::jobs::JobError;
use nav_sim_calibration::{
    Anticipated, Bootstrap, Estimator, Outcome, ParameterInterval, Scattering, Settings,
};
use nav_sim_navigation::metrics::OutageSummary;
use nav_sim_navigation::scenario::Scenario;
use nav_sim_navigation::sensors::outage::Outage;
use nav_sim_signal::noise::Parameter;

/// What is planned with.
pub(crate) struct DesignInputs<'a> {
    /// The IMU as it is believed to be, with its spread where recordings differ.
    pub file: &'a ModelFile,
    /// How it will be calibrated.
    pub estimator: Estimator,
    /// Trim, tuning and weighting of it.
    pub settings: &'a Settings,
    /// Draws and their seed.
    pub bootstrap: Bootstrap,
    /// A navigation to which the calibration leads, if there is one.
    pub navigation: Option<Destination<'a>>,
}

/// A navigation with the model that will be calibrated.
pub(crate) struct Destination<'a> {
    /// Trajectory and model.
    pub inputs: &'a mut NavigateInputs,
    /// Filter and receiver; the method is covariance analysis.
    pub scenario: &'a Scenario,
    /// The outages.
    pub outages: &'a [Outage],
}

/// What `recordings` of `hours` each would tell.
///
/// # Errors
/// When the recordings are too few or too short, or the navigation cannot be analysed.
pub(crate) fn design(
    inputs: &mut DesignInputs<'_>,
    recordings: usize,
    hours: f64,
) -> Result<Design, JobError> {
    let model = &inputs.file.model;
    let samples = (hours * 3600.0 * model.rate_hz).round() as usize;
    let anticipated = Anticipated {
        model,
        spread: inputs.file.spread.as_ref(),
        recordings,
        samples,
    };
    let outcomes = |scattering| {
        anticipated.outcomes(
            inputs.estimator,
            inputs.settings,
            scattering,
            inputs.bootstrap,
        )
    };
    let all = outcomes(Scattering::All)?;
    let mut parameters: Vec<DesignedParameter> = all
        .iter()
        .flat_map(|o| designed(o, model.rate_hz))
        .collect();
    if inputs.file.spread.is_some() {
        let endless = outcomes(Scattering::BetweenRecordings)?;
        for (parameter, endless) in parameters
            .iter_mut()
            .zip(endless.iter().flat_map(|o| designed(o, model.rate_hz)))
        {
            parameter.endless_half_width_pct = endless.half_width_pct;
        }
    }
    let horizontal_p95 = match &mut inputs.navigation {
        Some(destination) => quantiles(destination, &all, model.rate_hz)?,
        None => Vec::new(),
    };
    Ok(Design {
        recordings,
        hours,
        parameters,
        horizontal_p95,
    })
}

/// The parameters of an outcome; correlation times in the place of phi and beta, of which a per cent says nothing.
fn designed(outcome: &Outcome, rate_hz: f64) -> Vec<DesignedParameter> {
    let composite = &outcome.fit.composite;
    let values: Vec<_> = composite.parameters().collect();
    let parameter_of_interval = |interval: &ParameterInterval| {
        let (_, value) = *values
            .iter()
            .find(|(parameter, _)| *parameter == interval.of)?;
        let (name, label) = (
            composite.name_of(interval.of),
            &composite.labels()[interval.of.process],
        );
        let (parameter, shown): (String, &dyn Fn(f64) -> f64) = match interval.of.parameter {
            Parameter::Phi => (format!("{label} correlation_time_s"), &|phi| {
                -1.0 / (rate_hz * phi.ln())
            }),
            Parameter::Beta => (format!("{label} correlation_time_s"), &|beta| 1.0 / beta),
            _ => (name, &|value| value),
        };
        let value = shown(value);
        let ci95 = interval.absent.is_none().then(|| {
            let (a, b) = (shown(interval.low), shown(interval.high));
            [a.min(b), a.max(b)]
        });
        Some(DesignedParameter {
            signals: outcome.scope.name(),
            parameter,
            value,
            ci95,
            half_width_pct: ci95.map(|ends| half_width_pct(value, ends)),
            endless_half_width_pct: None,
        })
    };
    outcome
        .inference
        .iter()
        .flat_map(|i| &i.intervals)
        .filter_map(parameter_of_interval)
        .collect()
}

fn half_width_pct(value: f64, [low, high]: [f64; 2]) -> f64 {
    50.0 * (high - low) / value.abs()
}

/// The draws of the calibration, taken through the analysis.
fn quantiles(
    destination: &mut Destination<'_>,
    outcomes: &[Outcome],
    rate_hz: f64,
) -> Result<Vec<DesignedQuantile>, JobError> {
    let mut model = destination.inputs.model.clone();
    outcomes
        .iter()
        .for_each(|outcome| outcome.put_into(&mut model));
    let draws = DrawsFile::of(&outcomes.iter().collect::<Vec<_>>(), rate_hz);
    destination.inputs.model_draws = draws.and_then(|draws| draws.draws(&model));
    destination.inputs.model = model;
    let found = navigate(
        destination.inputs,
        destination.scenario,
        destination.outages,
        0,
        &Context::default(),
    )?;
    let quantile = |o: &OutageSummary| {
        let h = &o.horizontal_error_end_m;
        let ci95: [f64; 2] = h.p95_ci95.0.zip(h.p95_ci95.1)?.into();
        let half_width_pct = half_width_pct(h.p95, ci95);
        Some(DesignedQuantile {
            start_s: o.start_s,
            end_s: o.end_s,
            p95_m: h.p95,
            ci95,
            half_width_pct,
        })
    };
    Ok(found.summary.outages.iter().filter_map(quantile).collect())
}
