//! Gating: a fix whose NIS is too large to be believed is not used.

use super::filter::Ekf;
use super::update::{Fix, update};
use crate::lanes::{LANES, Lanes};
use statrs::distribution::{ChiSquared, ContinuousCDF};

/// The NIS above which a fix of `components` is refused: the chi-square quantile of a probability
/// ([Bar-Shalom](crate::bibliography::BarShalom01), sec. 5.4).
#[must_use]
pub(crate) fn nis_limit(probability: f64, components: usize) -> f64 {
    ChiSquared::new(components as f64).map_or(f64::INFINITY, |chi2| chi2.inverse_cdf(probability))
}

/// Uses a fix in the runs where its NIS is at most `limit`; the others stay as they were. Returns the NIS
/// and which runs refused it. (A NIS that is not a number is not refused: such a run has diverged.)
pub(crate) fn update_within(ekf: &mut Ekf, fix: &Fix, limit: f64) -> (Lanes, [bool; LANES]) {
    // Before the copy: the age of the Earth terms is common to all lanes, and the update sets it to zero. A
    // run put back to a copy made before would never get them.
    super::settle(ekf);
    let before = ekf.clone();
    // The NIS comes out of the update itself; refusals are rare, and one lane cannot stop while seven go on.
    let nis = update(ekf, fix);
    let refused: [bool; LANES] = std::array::from_fn(|lane| nis[lane] > limit);
    for lane in (0..LANES).filter(|lane| refused[*lane]) {
        ekf.copy_lane(&before, lane);
    }
    (nis, refused)
}

impl Ekf {
    /// Takes state, biases and covariance of one run from another filter of the same form.
    fn copy_lane(&mut self, other: &Self, lane: usize) {
        let (to, from) = (&mut self.nominal, &other.nominal);
        for (to, from) in [
            (&mut to.lat, &from.lat),
            (&mut to.lon, &from.lon),
            (&mut to.h, &from.h),
        ] {
            to[lane] = from[lane];
        }
        to.v_n.set_lane(lane, from.v_n.lane(lane));
        to.q_b_n.set_lane(lane, from.q_b_n.lane(lane));
        for (to, from) in self.estimates.iter_mut().zip(&other.estimates) {
            to.set_lane(lane, from.lane(lane));
        }
        self.p.copy_lane(&other.p, lane);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::earth::GravityModel;
    use crate::ekf::{Belief, FilterStates, InitialSettings};
    use crate::frames::NavState;
    use crate::noise::Model;
    use crate::strapdown::Strapdown;
    use glam::{DQuat, DVec3};

    #[test]
    fn the_run_that_refuses_stays_as_it_was_and_the_others_are_updated() {
        let state = NavState {
            lat: 0.8,
            lon: 0.1,
            h: 300.0,
            v_n: DVec3::ZERO,
            q_b_n: DQuat::IDENTITY,
        };
        let model = Model {
            rate_hz: 100.0,
            axes: Default::default(),
        };
        let belief = Belief::new(&model, FilterStates::Full, 1.0, 800.0).unwrap();
        let start = Strapdown::new(&state, GravityModel::Wgs84);
        let before = Ekf::new(start, &belief, &state, &InitialSettings::default());
        let mut fix = Fix {
            lat: Lanes::splat(0.8 + 3e-7),
            lon: Lanes::splat(0.1),
            h: Lanes::splat(300.0),
            v_n: None,
            pos_sigma_m: DVec3::splat(2.0),
            vel_sigma_m_s: DVec3::ONE,
            lever_arm_b: DVec3::ZERO,
        };
        fix.lat[5] += 1e-4; // 640 m
        let (mut gated, mut plain) = (before.clone(), before.clone());
        let (nis, refused) = update_within(&mut gated, &fix, nis_limit(0.999, 3));
        assert_eq!(refused, std::array::from_fn(|lane| lane == 5));
        assert!(nis[5] > 1e4 && nis[0] < 1.0);
        let _ = update(&mut plain, &fix);
        for lane in 0..LANES {
            let expected = if lane == 5 { &before } else { &plain };
            assert_eq!(
                gated.nominal.lane(lane),
                expected.nominal.lane(lane),
                "lane {lane}"
            );
            assert_eq!(gated.p.lane(lane), expected.p.lane(lane), "lane {lane}");
        }
    }

    /// 95 % and 99.9 % of chi-square with 3 and 6 degrees of freedom, as tables have them.
    #[test]
    fn limits_are_chi_square_quantiles() {
        assert!(
            (nis_limit(0.95, 3) - 7.8147).abs() < 1e-4
                && (nis_limit(0.999, 6) - 22.4577).abs() < 1e-4
        );
    }
}
