//! What the means of recordings say of a turn-on bias, in words and as JSON.

use super::number::readable;
use nav_sim_calibration::{MeansOfAxis, TURN_ON_LEVEL, TurnOnFinding, TurnOnSpread};
use serde::Serialize;

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

/// What follows from the means of one sensor, without its name.
pub(crate) fn turn_on_remark(found: &TurnOnSpread) -> String {
    let unit = found.sensor.unit();
    let (spread, noise) = (readable(found.spread()), readable(found.noise()));
    match found.finding {
        TurnOnFinding::Seen => format!(
            "turn-on bias: the means of {} recordings scatter by {spread} {unit} ± {:.0} % (noise alone: {noise}); stored as \
             [turn_on], for one fixed mounting switched off in between, with what the random walk adds",
            found.recordings(),
            100.0 * found.relative_error()
        ),
        TurnOnFinding::WithinNoise if found.p_noise < TURN_ON_LEVEL => format!(
            "the recordings' means scatter by {spread} {unit}, no more than recordings drift within themselves: no turn-on bias seen"
        ),
        TurnOnFinding::WithinNoise => {
            "the recordings' means agree within their noise: no turn-on bias seen".to_owned()
        }
        TurnOnFinding::Moved => {
            let range = found.axes.iter().map(|a| a.range).fold(0.0, f64::max);
            format!(
                "the recordings are not of one mounting (means differ by up to {} {unit}; more than 0.85 m/s² or 0.2 rad/s \
                 is no bias): no turn-on bias is stored",
                readable(range)
            )
        }
        TurnOnFinding::Removed => {
            "the recordings' means were removed before: they tell nothing of a turn-on bias".to_owned()
        }
    }
}

/// A line a sensor; with the name of the estimator where the models of several disagree.
pub(crate) fn turn_on_lines(found: &[TurnOnSpread]) -> Vec<String> {
    let mut lines: Vec<String> = Vec::new();
    for one in found {
        let same = |other: &&TurnOnSpread| other.sensor == one.sensor;
        let alike = found.iter().filter(same).all(|other| other.finding == one.finding);
        let first = found.iter().find(same).is_some_and(|other| other.estimator == one.estimator);
        let (sensor, remark) = (one.sensor.name(), turn_on_remark(one));
        if alike && first {
            lines.push(format!("{sensor}: {remark}"));
        } else if !alike {
            lines.push(format!("{sensor}, {}: {remark}", one.estimator.name()));
        }
    }
    lines
}
