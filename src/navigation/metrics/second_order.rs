//! What a linear filter leaves out, and a covariance analysis in part: errors of attitude to second order.
//!
//! A tilt ψ turns the specific force −g of level motion into a horizontal acceleration gψ, which the filter knows, and
//! shortens what is left upright to g cos ψ: the vehicle seems to accelerate downwards with g(ψ_n² + ψ_e²)/2, whatever the
//! sign of the tilt. A covariance analysis contains this up to the end of the outage (`lincov/vertical.rs`), where the filters of
//! runs state as much more themselves. The first fixes then take the shift for a bias of the vertical accelerometer, and that is
//! in neither.
//!
//! A heading error ψ_d turns the horizontal acceleration gψ out of the direction in which the filter expects it: ½ψ×(ψ×f), the
//! second order of the rotation by ψ, has the horizontal parts ½gψ_dψ_n and ½gψ_dψ_e. Its mean is 0, and it is small beside the
//! velocity's standard deviation; but the filter knows the velocity's error much better than that once the tilt is given,
//! since both have one cause. What it does is therefore measured by the NEES.
//!
//! The product explains what the heading adds, and that alone: an IMU so quiet that all follows from the attitude of the start has
//! a NEES of 92 ± 6 after two minutes at rest with 0.5° of tilt and 2° of heading, of 9 that are expected; 77 of the 83 more are
//! predicted here, 7 are there with a known heading too and come from the tilts' downward shift. It is an approximation: of small
//! angles (with 20° of heading, and 0.05° of tilt, it has 167 of 308), of a product that stands still, so that its effects add
//! (tilts that grow in the outage, and turns, make it less), and the largest over the epochs, which need not be the end.

use super::epoch::EpochMetrics;
use super::outage::within;
use super::summary::Summary;
use super::verdict::{StateName, TOLERANCE, number};
use crate::sensors::baro::BaroSettings;
use crate::simulation::lincov::Consistency;
use crate::simulation::{NEES_DOF, REPORTED, REPORTED_NAMES};
use crate::units::{DEG, STANDARD_GRAVITY};
use nalgebra::{SMatrix, SVector};
use serde::{Deserialize, Serialize};

/// Roll, pitch among the reported states.
const TILT: [usize; 2] = [6, 7];
/// Yaw among the reported states.
const YAW: usize = 8;
/// Velocity down among the reported states.
pub(super) const VELOCITY_DOWN: usize = 5;
/// Position and velocity down among them.
pub(super) const DOWN: [usize; 2] = [2, VELOCITY_DOWN];

/// What attitude errors do to second order in an outage; NaN where nobody says it.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct OutageSecondOrder {
    /// Mean shift of the velocity down (m/s) just before the first fix after the outage, which no linear filter contains and
    /// covariance analysis contains up to there (null where the epochs were not kept, or a barometer sees the height).
    #[serde(rename = "second_order_vel_d_m_s", deserialize_with = "number")]
    pub vel_d_m_s: f64,
    /// Standard deviation of the velocity down (m/s) at the same instant that linear theory gives it in the filter. What the
    /// filters of runs state, and covariance analysis with them, grows with the shift and is no measure of it.
    #[serde(rename = "linear_asee_vel_d_m_s", default = "unknown", deserialize_with = "number")]
    pub linear_vel_d_m_s: f64,
    /// What heading error times tilt adds to the expected NEES in the outage at most; of a covariance analysis, for which runs
    /// keep too little.
    #[serde(rename = "second_order_nees", default = "unknown", deserialize_with = "number")]
    pub nees: f64,
    /// What position and velocity down have of second order in their mean squares (m², (m/s)²) just before the first fix after the
    /// outage, by covariance analysis; 0 where it says nothing.
    #[serde(skip)]
    pub mean_squares: [f64; 2],
}

/// What filters of runs state less (or more) than linear theory while the attitude of the start settles, where that is more than verdicts let pass:
/// they take attitude errors for accelerations, and believe to learn from them what they do not.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct SettlingSecondOrder {
    /// State of which it is the most.
    pub state: StateName,
    /// Share of the standard deviation that linear theory gives the filter.
    pub share: f64,
    /// The last report (s on the trajectory) at which it is more than verdicts let pass, in any state.
    pub until_s: f64,
}

impl SettlingSecondOrder {
    /// Of reports in time order: the time, and what standard deviations are of those of linear theory.
    pub(super) fn among(reports: impl Iterator<Item = (f64, [f64; REPORTED])>) -> Option<Self> {
        let mut found: Option<Self> = None;
        for (t_s, ratios) in reports {
            for (ratio, state) in ratios.into_iter().zip(REPORTED_NAMES) {
                let share = 1.0 - ratio;
                if share.abs() > TOLERANCE {
                    let most = found.filter(|most| most.share.abs() >= share.abs());
                    found =
                        Some(Self { until_s: t_s, ..most.unwrap_or(Self { state, share, until_s: t_s }) });
                }
            }
        }
        found
    }
}

/// Mean shift of the velocity down (m/s) that the tilt makes to second order over an outage: ∫ g (ψ_roll² + ψ_pitch²)/2 dt
/// with the mean squares of the errors, by the trapezoidal rule over the reporting epochs. NaN where no epochs were kept.
pub(super) fn velocity_down_m_s(window: (f64, f64), epochs: &[EpochMetrics]) -> f64 {
    let acceleration = |epoch: &EpochMetrics| {
        // 1 − cos ψ ≈ ψ²/2 for each of the two tilts; in mean squares, so that no draw is needed.
        STANDARD_GRAVITY / 2.0 * TILT.map(|i| (epoch.rmse.0[i].value * DEG).powi(2)).iter().sum::<f64>()
    };
    let inside = within(window, epochs);
    let points: Vec<(f64, f64)> = inside.map(|e| (e.t_s, acceleration(e))).collect();
    let Some(&(_, last)) = points.last() else { return f64::NAN };
    // from the last epoch on as there: the fix that ends the outage is not inside
    let end = (window.1, last);
    let ends = points.iter().zip(points.iter().skip(1).chain([&end]));
    ends.map(|(a, b)| (b.0 - a.0) * (a.1 + b.1) / 2.0).sum()
}

/// What the horizontal errors of second order add to the expected NEES in an outage at most: Σ uᵀP⁻¹u over north and east, u the
/// root mean squares of velocity ∫ ½gψ_dψ dt and position (its integral), P what the filter states at each epoch.
pub(super) fn horizontal_nees<'a>(
    window: (f64, f64),
    epochs: &[EpochMetrics],
    believed: impl Fn(&EpochMetrics) -> Option<&'a [[f64; NEES_DOF]; NEES_DOF]>,
) -> f64 {
    let acceleration = |epoch: &EpochMetrics| {
        let square = |state: usize| (epoch.rmse.0[state].value * DEG).powi(2);
        // of two tilts the mean square of one; heading and tilt are taken as independent, as they are at the start
        let tilt = TILT.map(square).iter().sum::<f64>() / 2.0;
        STANDARD_GRAVITY / 2.0 * (square(YAW) * tilt).sqrt()
    };
    let (mut velocity, mut position, mut most) = (0.0, 0.0, 0.0_f64);
    let mut inside = within(window, epochs).peekable();
    while let Some(epoch) = inside.next() {
        let believed = believed(epoch).map(|p| SMatrix::<f64, NEES_DOF, NEES_DOF>::from_fn(|i, j| p[j][i]));
        let Some(believed) = believed.and_then(SMatrix::cholesky) else { return f64::NAN };
        let added = |axis: usize| {
            let mut u = SVector::<f64, NEES_DOF>::zeros();
            (u[axis], u[3 + axis]) = (position, velocity);
            believed.solve(&u).dot(&u)
        };
        // the filter comes to know less and less in a long outage: the largest need not be at its end
        most = most.max(added(0) + added(1));
        let dt = inside.peek().map_or(window.1, |next| next.t_s) - epoch.t_s;
        // one product of errors that hardly change within a step: its effects add, they do not average out
        position += velocity * dt + acceleration(epoch) * dt * dt / 2.0;
        velocity += acceleration(epoch) * dt;
    }
    most
}

impl Summary {
    /// With what the covariance analysis of the same filter finds of the horizontal second order, for which runs keep too
    /// little.
    pub(super) fn take_second_order(&mut self, expected: &Self) {
        self.settling = expected.settling;
        for (own, expected) in self.outages.iter_mut().zip(&expected.outages) {
            let OutageSecondOrder { nees, mean_squares, .. } = expected.second_order;
            (own.second_order.nees, own.second_order.mean_squares) = (nees, mean_squares);
        }
    }

    /// With what linear theory gives the filter at the end of each outage, as [`assess`](crate::simulation::lincov::assess) finds
    /// it beside any runs.
    pub fn measure_second_order(&mut self, ends: &[Consistency]) {
        for (outage, end) in self.outages.iter_mut().zip(ends) {
            outage.second_order.linear_vel_d_m_s = end.sigma[VELOCITY_DOWN];
        }
    }

    /// With the heights of a barometer, of which runs keep nothing.
    pub fn see_height(&mut self, baro: &BaroSettings) {
        for outage in &mut self.outages {
            outage.second_order.see_height((outage.start_s, outage.end_s), baro);
        }
    }
}

/// What a run directory of an earlier build does not have.
const fn unknown() -> f64 {
    f64::NAN
}

impl OutageSecondOrder {
    /// Nothing is known yet.
    pub const UNKNOWN: Self =
        Self { vel_d_m_s: f64::NAN, linear_vel_d_m_s: f64::NAN, nees: f64::NAN, mean_squares: [0.0; 2] };

    /// A barometer sees the vertical channel: in an outage that has a height no shift grows without being corrected, and none is
    /// stated.
    pub(super) fn see_height(&mut self, (start_s, end_s): (f64, f64), baro: &BaroSettings) {
        if (end_s - start_s) * baro.rate_hz >= 1.0 {
            self.vel_d_m_s = f64::NAN;
        }
    }

    /// By which share the RMSE of position and velocity down are smaller in linear theory, where that has these mean squares of the
    /// reported states.
    #[must_use]
    pub fn shares_of_rmse(&self, linear: &[f64; REPORTED]) -> [f64; 2] {
        let share = |k: usize| 1.0 - (linear[DOWN[k]] / (linear[DOWN[k]] + self.mean_squares[k])).sqrt();
        [share(0), share(1)]
    }

    /// Whether errors in the outage are beyond linear theory.
    pub(super) fn is_beyond_linear(&self) -> bool {
        self.beyond_linear().or(self.beyond_linear_horizontally()).is_some()
    }

    /// By how many standard deviations of linear theory the velocity down is shifted at the end, where linear theory ends:
    /// where it is above `SECOND_ORDER_LIMIT`.
    #[must_use]
    pub fn beyond_linear(&self) -> Option<f64> {
        let sigmas = self.vel_d_m_s / self.linear_vel_d_m_s;
        (sigmas > Self::SECOND_ORDER_LIMIT).then_some(sigmas)
    }

    /// What heading error times tilt adds to the expected NEES at most, where that makes the errors of all states together larger
    /// by more than verdicts let pass.
    #[must_use]
    pub fn beyond_linear_horizontally(&self) -> Option<f64> {
        (Self::ratio_of_nees(self.nees) > 1.0 + TOLERANCE).then_some(self.nees)
    }

    /// How much larger so much more NEES makes the errors of all states together.
    #[must_use]
    pub fn ratio_of_nees(nees: f64) -> f64 {
        (1.0 + nees / NEES_DOF as f64).sqrt()
    }

    /// See [`Self::beyond_linear`]: with equal tilts about two axes the mean square of the shift is twice its mean squared, and
    /// √(1 + 2·0.3²) is 1.09, just within what verdicts let pass at the end; after it, runs were up to 1.13 times off.
    pub const SECOND_ORDER_LIMIT: f64 = 0.3;
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::metrics::{Estimate, PerState};
    use crate::simulation::{EpochSums, REPORTED, RunResult};

    /// Nothing up to a tenth; beyond, the state and the share where it is most, until the last report beyond it, whichever state's.
    #[test]
    fn the_most_and_the_last_of_a_start_are_told() {
        let report = |t_s: f64, roll: f64, yaw: f64| {
            let mut ratios = [1.0; REPORTED];
            (ratios[6], ratios[8]) = (roll, yaw);
            (t_s, ratios)
        };
        assert_eq!(SettlingSecondOrder::among([report(1.0, 0.91, 1.09)].into_iter()), None);
        let reports =
            [report(1.0, 1.0, 0.8), report(2.0, 1.0, 0.5), report(3.0, 1.2, 0.95), report(4.0, 1.0, 1.0)];
        let most = SettlingSecondOrder { state: "yaw_deg", share: 0.5, until_s: 3.0 };
        assert_eq!(SettlingSecondOrder::among(reports.into_iter()), Some(most));
    }

    /// A heading error of 2° and tilts of 0.5° for 100 s: ½gψ_dψ is 1.5 mm/s², hence 0.15 m/s and 7.5 m, each measured by what the filter
    /// states of it alone, north and east.
    #[test]
    fn a_heading_error_times_a_tilt_in_closed_form() {
        let sums = |t: u32| EpochSums { t_s: f64::from(t), count: 1, ..EpochSums::default() };
        let result = RunResult { epochs: (0..=100).map(sums).collect(), ..RunResult::default() };
        let mut epochs = crate::metrics::epochs(&result);
        for epoch in &mut epochs {
            let degrees = [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.5, 0.5, 2.0];
            epoch.rmse = PerState(degrees.map(|value| Estimate { value, std_error: 0.0 }));
        }
        let mut believed = [[0.0; NEES_DOF]; NEES_DOF];
        for (i, row) in believed.iter_mut().enumerate() {
            row[i] = [25.0, 0.01, 1e-6][i / 3];
        }
        let velocity = 9.80665 / 2.0 * (2.0 * DEG) * (0.5 * DEG) * 100.0;
        let closed = 2.0 * ((50.0 * velocity).powi(2) / 25.0 + velocity * velocity / 0.01);
        let added = horizontal_nees((0.0, 101.0), &epochs, |_| Some(&believed));
        assert!((added / closed - 1.0).abs() < 1e-12, "{added} {closed}");
    }

    /// A tilt that grows as t in roll, 1° after 100 s: ∫ g (ct)²/2 dt = g c² T³/6, which the trapezoidal rule overstates by
    /// g c² T h²/12, of epochs h apart; up to the last epoch, from where on the tilt stands still.
    #[test]
    fn a_growing_tilt_in_closed_form() {
        let rate = 0.01;
        let sums = |t: u32| EpochSums { t_s: f64::from(t), count: 1, ..EpochSums::default() };
        let result = RunResult { epochs: (0..=300).map(sums).collect(), ..RunResult::default() };
        let mut epochs = crate::metrics::epochs(&result);
        for epoch in &mut epochs {
            let mut tilt = [Estimate { value: 0.0, std_error: 0.0 }; REPORTED];
            tilt[TILT[0]].value = rate * (epoch.t_s - 100.0).max(0.0);
            epoch.rmse = PerState(tilt);
        }
        let c = rate * DEG;
        // 100 to 199 s, and a second at the tilt of 99 s
        let to_last = STANDARD_GRAVITY * c * c * (99.0_f64.powi(3) / 6.0 + 99.0 / 12.0);
        let closed = to_last + STANDARD_GRAVITY / 2.0 * (99.0 * c).powi(2);
        assert!((velocity_down_m_s((100.0, 200.0), &epochs) / closed - 1.0).abs() < 1e-12);
        assert!(velocity_down_m_s((100.0, 200.0), &[]).is_nan());
    }
}
