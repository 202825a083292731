//! What a linear filter, and a covariance analysis, leave out: errors of attitude to second order.
//!
//! A tilt ψ turns the specific force −g of level motion into a horizontal acceleration gψ, which the filter knows, and
//! shortens what is left upright to g cos ψ: the vehicle seems to accelerate downwards with g(ψ_n² + ψ_e²)/2, whatever the
//! sign of the tilt. The mean of this grows with the square of the attitude's standard deviation and is in no linear
//! error model (that of [Groves](crate::bibliography::Groves13), chapter 14, is its first order). After an
//! outage of minutes it is taken for a bias of the vertical accelerometer.

use super::epoch::EpochMetrics;
use super::outage::{OutageMetrics, within};
use super::summary::{OutageSummary, Summary};
use crate::units::{DEG, STANDARD_GRAVITY};

/// Roll, pitch among the reported states.
const TILT: [usize; 2] = [6, 7];
/// Velocity down among the reported states.
const VELOCITY_DOWN: usize = 5;

/// Mean shift of the velocity down (m/s) that the tilt makes to second order over an outage: ∫ g (ψ_roll² + ψ_pitch²)/2 dt
/// with the mean squares of the errors, by the trapezoidal rule over the reporting epochs. NaN where no epochs were kept.
pub(super) fn velocity_down_m_s(outage: &OutageMetrics, epochs: &[EpochMetrics]) -> f64 {
    let acceleration = |epoch: &EpochMetrics| {
        // 1 − cos ψ ≈ ψ²/2 for each of the two tilts; in mean squares, so that no draw is needed.
        STANDARD_GRAVITY / 2.0 * TILT.map(|i| (epoch.rmse.0[i].value * DEG).powi(2)).iter().sum::<f64>()
    };
    let inside = within((outage.start_s, outage.end_s), epochs);
    let points: Vec<(f64, f64)> = inside.map(|e| (e.t_s, acceleration(e))).collect();
    let Some(&(_, last)) = points.last() else { return f64::NAN };
    // from the last epoch on as there: the fix that ends the outage is not inside
    let end = (outage.end_s, last);
    let ends = points.iter().zip(points.iter().skip(1).chain([&end]));
    ends.map(|(a, b)| (b.0 - a.0) * (a.1 + b.1) / 2.0).sum()
}

impl Summary {
    /// A barometer sees the vertical channel: no shift grows there without being corrected, and none is stated.
    pub fn see_height(&mut self) {
        for outage in &mut self.outages {
            outage.second_order_vel_d_m_s = f64::NAN;
        }
        if let Some(expected) = &mut self.lincov {
            expected.see_height();
        }
    }
}

impl OutageSummary {
    /// The share of the filter's own standard deviation that the second order shifts the velocity down by at the end,
    /// where the filter's linear model ends: where it is above `SECOND_ORDER_LIMIT`.
    #[must_use]
    pub fn beyond_linear(&self) -> Option<f64> {
        let share = self.second_order_vel_d_m_s / self.asee_end.0[VELOCITY_DOWN];
        (share > Self::SECOND_ORDER_LIMIT).then_some(share)
    }

    /// See [`Self::beyond_linear`]: with equal tilts about two axes the mean square of the shift is twice its mean squared, and
    /// √(1 + 2·0.3²) is 1.09, just within what verdicts let pass at the end; after it, runs were up to 1.13 times off.
    pub(crate) const SECOND_ORDER_LIMIT: f64 = 0.3;
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::metrics::{Estimate, PerState};
    use crate::simulation::{EpochSums, REPORTED, RunResult};

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
        let result = RunResult {
            runs: vec![crate::simulation::RunRecord {
                outages: vec![crate::simulation::OutageRecord::default()],
                ..Default::default()
            }],
            outages: vec![(100.0, 200.0)],
            ..result
        };
        let outage = &crate::metrics::outages(&result)[0];
        let c = rate * DEG;
        // 100 to 199 s, and a second at the tilt of 99 s
        let to_last = STANDARD_GRAVITY * c * c * (99.0_f64.powi(3) / 6.0 + 99.0 / 12.0);
        let closed = to_last + STANDARD_GRAVITY / 2.0 * (99.0 * c).powi(2);
        assert!((velocity_down_m_s(outage, &epochs) / closed - 1.0).abs() < 1e-12);
        assert!(velocity_down_m_s(outage, &[]).is_nan());
    }
}
