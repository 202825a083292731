//! A drift that all recordings share, which comparing one recording with the others does not show.
//!
//! The mean slope of the recordings on an axis, over its standard deviation by their scatter, is Student's t with K − 1 degrees of
//! freedom if recordings drift by chance. The fitted model is not asked: a random walk fitted to the drift would explain it.
//! Where recordings scatter unequally (one is shorter), t exceeds its limit for 2.5 % the more rarely
//! ([Ibragimov and Müller](crate::bibliography::IbragimovMuller10)).

use super::alarm::FALSE_ALARM;
use super::piece::Piece;
use super::result::CommonDrift;
use crate::imu::Axis;
use crate::noise::Process;
use statrs::distribution::{ContinuousCDF, StudentsT};

/// Fewest recordings that say what they have in common: of two, t exceeds 25 in one set of 40 by chance.
const FEWEST: usize = 3;

/// The drift that the recordings of a sensor share; none where the model has one.
pub(super) fn common_drift(pieces: &[Piece<'_>], rate_hz: f64) -> Option<CommonDrift> {
    let has_drift = |p: &Piece<'_>| {
        p.model
            .processes
            .iter()
            .any(|p| matches!(p, Process::Drift(_)))
    };
    if pieces.iter().any(has_drift) {
        return None;
    }
    let slopes = |p: &Piece<'_>| {
        // The two halves are half a record apart.
        let all = p
            .replicates
            .iter()
            .flatten()
            .map(|r| r.trend * rate_hz * 3600.0 / (0.5 * r.samples as f64));
        (p.axis, all.filter(|slope| slope.is_finite()).collect())
    };
    shared(&pieces.iter().map(slopes).collect::<Vec<_>>())
}

/// The axes whose slopes (units per hour) have a mean that chance does not explain.
fn shared(slopes: &[(Axis, Vec<f64>)]) -> Option<CommonDrift> {
    let tested: Vec<(Axis, f64, f64, f64)> = slopes
        .iter()
        .filter_map(|(axis, all)| student(all).map(|(mean, t, p)| (*axis, mean, t, p)))
        .collect();
    // Bonferroni: any axis may be the one.
    let limit = FALSE_ALARM / tested.len() as f64;
    let p_value = tested
        .iter()
        .map(|(.., p)| *p)
        .fold(f64::INFINITY, f64::min)
        * tested.len() as f64;
    let seen = || tested.iter().filter(|(.., p)| *p <= limit);
    (seen().count() > 0).then(|| CommonDrift {
        p_value,
        per_hour: seen().map(|(axis, mean, ..)| (*axis, *mean)).collect(),
        t: seen().map(|(axis, _, t, _)| (*axis, *t)).collect(),
    })
}

/// Mean, Student's t and the probability of one as far from 0 on either side; none of too few, or of equal numbers.
fn student(values: &[f64]) -> Option<(f64, f64, f64)> {
    let count = values.len() as f64;
    let mean = values.iter().sum::<f64>() / count;
    let squares = values.iter().map(|v| (v - mean).powi(2)).sum::<f64>();
    let t = mean / (squares / (count * (count - 1.0))).sqrt();
    let is_known = values.len() >= FEWEST && t.is_finite();
    let law = StudentsT::new(0.0, 1.0, count - 1.0)
        .ok()
        .filter(|_| is_known)?;
    Some((mean, t, 2.0 * law.sf(t.abs())))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rng::Generator;
    use rand::{RngExt, SeedableRng};
    use rand_distr::StandardNormal;

    /// By hand: 1, 2, 3 have the mean 2 and the standard error √(1/3), t = 2√3; for two degrees of freedom P(|T| > t) =
    /// 1 − t/√(2 + t²) = 1 − √12/√14.
    #[test]
    fn student_by_hand() {
        let (mean, t, p) = student(&[1.0, 2.0, 3.0]).unwrap();
        approx::assert_relative_eq!(mean, 2.0);
        approx::assert_relative_eq!(t, 12.0_f64.sqrt(), max_relative = 1e-14);
        approx::assert_relative_eq!(p, 1.0 - (12.0_f64 / 14.0).sqrt(), max_relative = 1e-9);
        assert_eq!((student(&[1.0, 2.0]), student(&[2.0; 3])), (None, None));
    }

    /// 4000 sets of three axes know a rate of 2.5 % to √(0.025·0.975/4000) = 0.25 %, of which four are allowed: no more of recordings
    /// that scatter alike or not, and no fewer than the 2.48 % that Bonferroni leaves of independent axes, if they scatter alike.
    #[test]
    fn chance_is_as_rare_as_said() {
        let mut generator = Generator::seed_from_u64(8);
        for (count, widest) in [(3, 1.0), (6, 1.0), (3, 5.0), (6, 5.0)] {
            let mut slopes = || {
                let deviation = |k: usize| if k == 0 { widest } else { 1.0 };
                (0..count)
                    .map(|k| deviation(k) * generator.sample::<f64, _>(StandardNormal))
                    .collect()
            };
            let mut told = || shared(&Axis::ALL.map(|axis| (axis, slopes()))).is_some();
            let rate = (0..4000).filter(|_| told()).count() as f64 / 4000.0;
            assert!(
                rate < 0.025 + 0.01 && (widest > 1.0 || rate > 0.0248 - 0.01),
                "{count} {widest}: {rate}"
            );
        }
    }
}
