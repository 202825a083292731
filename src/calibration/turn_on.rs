//! Turn-on bias: the scatter of the means of recordings about their own mean.
//!
//! Between recordings of one fixed mounting gravity and Earth rate are the same; what differs is the bias of the switching-on
//! and what the noise adds. A turn-on bias is seen where both of two tests refuse that the noise alone made the scatter:
//! - chi-square: Σ (m_k − m)²/v_k over recordings and axes, v_k the variance of a mean by the fitted model;
//! - F: the same scatter over that of the recordings' trends (later half less earlier half). A fit knows the slowest part of the
//!   noise badly, and the trend of a random walk has the variance of its mean, that of white noise four times it, that of a
//!   process correlated over the length of a recording 0.63 times it, which is allowed for: the test keeps its level whatever was
//!   fitted. What is slower still hardly moves within a recording: it is a bias of that recording.

use crate::curve::{Estimator, Group, Replicate};
use crate::imu::{Axis, Channel, Sensor};
use crate::outcome::Outcome;
use statrs::distribution::{ChiSquared, ContinuousCDF, FisherSnedecor};

/// Probability at most that noise alone passes for a turn-on bias of a sensor.
pub const TURN_ON_LEVEL: f64 = 0.01;
/// Variance of the mean over that of the trend of a Gauss-Markov process whose correlation time is the length of the recording,
/// of which x = 1 in 2 (x − 1 + e^−x)/x²: 0.736/0.466.
const SLOWEST: f64 = 1.58;
/// Means of the accelerometers that differ by more (m/s², 5° of tilt) tell of another mounting: no unit's bias changes so.
const OTHER_TILT_M_S2: f64 = 0.85;
/// Difference of gyroscope means that shows a turned sensor (rad/s, 11 °/s).
const TURNING_RAD_S: f64 = 0.2;
/// Share of the standard deviation by the noise below which all means are taken to have been removed before.
const REMOVED: f64 = 1e-3;

/// Scatter of the means of one axis.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct MeansOfAxis {
    /// The axis.
    pub axis: Axis,
    /// Recordings.
    pub recordings: usize,
    /// Standard deviation of their means about their own mean (m/s² or rad/s), which holds what the noise adds.
    pub spread: f64,
    /// The standard deviation that the fitted noise alone gives (m/s² or rad/s).
    pub noise: f64,
    /// Largest less smallest mean (m/s² or rad/s).
    pub range: f64,
}

/// Finding about the means of a sensor.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum TurnOnFinding {
    /// The means scatter by more than noise explains.
    Seen,
    /// They agree within their noise.
    WithinNoise,
    /// The mounting changed between recordings.
    Moved,
    /// The means were removed before.
    Removed,
}

nav_sim_signal::named!(
    TurnOnFinding {
        Seen = "seen",
        WithinNoise = "within_noise",
        Moved = "moved",
        Removed = "removed",
    }, in files
);

/// Scatter of the means of a sensor, and the finding.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct TurnOnSpread {
    /// The sensor.
    pub sensor: Sensor,
    /// Estimator whose model gives the contribution of the noise.
    pub estimator: Estimator,
    /// Axis by axis.
    pub axes: Vec<MeansOfAxis>,
    /// Probability that the fitted noise makes means scatter as much.
    pub p_noise: f64,
    /// Probability that noise which moves the recordings themselves as much as they move makes means scatter as much.
    pub p_drift: f64,
    /// The finding.
    pub finding: TurnOnFinding,
}

impl TurnOnSpread {
    /// The standard deviations of the turn-on bias, where one is seen: of each axis, or of all where some have no recording.
    pub fn sigmas(&self) -> Option<[f64; 3]> {
        let seen = self.finding == TurnOnFinding::Seen;
        let spread_of_axis = |axis: Axis| {
            self.axes
                .iter()
                .find(|a| a.axis == axis)
                .map_or(self.spread(), |a| a.spread)
        };
        seen.then(|| Axis::ALL.map(spread_of_axis))
    }

    /// Root mean square over the axes of the spread of the means (m/s² or rad/s).
    pub fn spread(&self) -> f64 {
        self.root_mean_square(|a| a.spread)
    }

    /// Root mean square over the axes of the part that the noise makes (m/s² or rad/s).
    pub fn noise(&self) -> f64 {
        self.root_mean_square(|a| a.noise)
    }

    /// Fewest recordings of an axis.
    pub fn recordings(&self) -> usize {
        self.axes.iter().map(|a| a.recordings).min().unwrap_or(0)
    }

    /// Relative standard error of the spread of an axis, of Gaussian biases: 1/√(2(n − 1)).
    pub fn relative_error(&self) -> f64 {
        1.0 / (2.0 * (self.recordings().max(2) - 1) as f64).sqrt()
    }

    fn root_mean_square(&self, value: impl Fn(&MeansOfAxis) -> f64) -> f64 {
        let sum: f64 = self.axes.iter().map(|a| value(a) * value(a)).sum();
        (sum / self.axes.len().max(1) as f64).sqrt()
    }
}

/// The spread of the recordings' means, sensor by sensor; nothing of a sensor without two recordings whose means are known.
/// `outcomes`: those of one estimator.
pub fn turn_on(groups: &[Group], outcomes: &[&Outcome]) -> Vec<TurnOnSpread> {
    let mut found: Vec<TurnOnSpread> = Sensor::ALL
        .into_iter()
        .filter_map(|sensor| of_sensor(groups, outcomes, sensor))
        .collect();
    // A mounting is that of both sensors.
    if found.iter().any(|f| f.finding == TurnOnFinding::Moved) {
        found
            .iter_mut()
            .for_each(|f| f.finding = TurnOnFinding::Moved);
    }
    found
}

fn of_sensor(groups: &[Group], outcomes: &[&Outcome], sensor: Sensor) -> Option<TurnOnSpread> {
    let axes: Vec<Means<'_>> = Axis::ALL
        .into_iter()
        .filter_map(|axis| Means::new(groups, outcomes, Channel { sensor, axis }))
        .collect();
    let estimator = outcomes.first()?.estimator;
    if axes.is_empty() {
        return None;
    }
    let trends = axes.iter().map(|m| m.replicates.len() as f64).sum::<f64>();
    // One mean is estimated on each axis; a trend is about 0 and costs none.
    let dof = trends - axes.len() as f64;
    let scatter = axes.iter().map(Means::chi_square).sum::<f64>();
    // Both sums are over the variance of a mean by the fit: an error common to all of these cancels in the
    // quotient.
    let f = (scatter / dof) / (axes.iter().map(Means::trends).sum::<f64>() / trends);
    let p_noise = ChiSquared::new(dof).map_or(f64::NAN, |law| law.sf(scatter));
    // Scaled as for the slowest process that counts as noise: for a faster one the probability is too large,
    // never too small.
    let p_drift = FisherSnedecor::new(dof, trends).map_or(f64::NAN, |law| law.sf(f / SLOWEST));
    let limit = if sensor == Sensor::Accel {
        OTHER_TILT_M_S2
    } else {
        TURNING_RAD_S
    };
    let finding = if axes.iter().any(|m| m.of_axis().range > limit) {
        TurnOnFinding::Moved
    } else if axes.iter().all(Means::are_removed) {
        TurnOnFinding::Removed
    } else if p_noise < TURN_ON_LEVEL && p_drift < TURN_ON_LEVEL {
        TurnOnFinding::Seen
    } else {
        TurnOnFinding::WithinNoise
    };
    let axes = axes.iter().map(Means::of_axis).collect();
    Some(TurnOnSpread {
        sensor,
        estimator,
        axes,
        p_noise,
        p_drift,
        finding,
    })
}

/// The recordings of one axis, each with the variance of its mean by the fitted noise (units²).
struct Means<'a> {
    axis: Axis,
    replicates: Vec<(&'a Replicate, f64)>,
}

impl<'a> Means<'a> {
    fn new(groups: &'a [Group], outcomes: &[&Outcome], channel: Channel) -> Option<Self> {
        let outcome = outcomes
            .iter()
            .find(|o| o.scope.channels().contains(&channel))?;
        let group = groups.iter().find(|g| g.scope == outcome.scope)?;
        let known = |r: &&Replicate| {
            r.axis == Some(channel.axis)
                && r.mean.is_finite()
                && r.trend.is_finite()
                && r.samples > 1
        };
        let with_variance = |r: &'a Replicate| (r, outcome.fit.composite.mean_variance(r.samples));
        let replicates: Vec<_> = group
            .replicates
            .iter()
            .filter(known)
            .map(with_variance)
            .collect();
        let enough = replicates.len() > 1 && replicates.iter().all(|(_, variance)| *variance > 0.0);
        enough.then_some(Self {
            axis: channel.axis,
            replicates,
        })
    }

    /// Σ (m_k − m)²/v_k about the weighted mean m.
    fn chi_square(&self) -> f64 {
        let first = self.replicates[0].0.mean;
        let weights: f64 = self.replicates.iter().map(|(_, v)| 1.0 / v).sum();
        // About the first one, so that gravity costs no digits.
        let mean = self
            .replicates
            .iter()
            .map(|(r, v)| (r.mean - first) / v)
            .sum::<f64>()
            / weights;
        self.replicates
            .iter()
            .map(|(r, v)| (r.mean - first - mean).powi(2) / v)
            .sum()
    }

    /// Σ trend²/v_k
    fn trends(&self) -> f64 {
        self.replicates
            .iter()
            .map(|(r, v)| r.trend * r.trend / v)
            .sum()
    }

    fn are_removed(&self) -> bool {
        self.replicates
            .iter()
            .all(|(r, v)| r.mean.abs() < REMOVED * v.sqrt())
    }

    fn of_axis(&self) -> MeansOfAxis {
        let recordings = self.replicates.len();
        let first = self.replicates[0].0.mean;
        let means: Vec<f64> = self
            .replicates
            .iter()
            .map(|(r, _)| r.mean - first)
            .collect();
        let mean = means.iter().sum::<f64>() / recordings as f64;
        let squares: f64 = means.iter().map(|m| (m - mean) * (m - mean)).sum();
        let noise = self.replicates.iter().map(|(_, v)| v).sum::<f64>() / recordings as f64;
        let (low, high) = means
            .iter()
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), m| {
                (a.min(*m), b.max(*m))
            });
        MeansOfAxis {
            axis: self.axis,
            recordings,
            spread: (squares / (recordings - 1) as f64).sqrt(),
            noise: noise.sqrt(),
            range: high - low,
        }
    }
}

#[cfg(test)]
#[path = "turn_on_tests.rs"]
mod tests;
