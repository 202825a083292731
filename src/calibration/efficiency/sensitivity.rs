//! Sensitivity curves: how far an estimate moves when one thing goes wrong, against how wrong it goes.
//!
//! Proposition 1 of [Minaretzis](crate::bibliography::Minaretzis24) says that the influence on SR-AWV of
//! outliers, and on DR-AWV of abnormal replicates too, is bounded. It holds for a fixed number of scales and
//! long records. A single sample takes part in 2^j of the T − 2^j + 1 coefficients of level j: with the usual
//! floor(log2 T) − 1 levels that is more at the last ones than the robust wavelet variance withstands
//! ([`crate::wavelet::Tuning::breakdown`]), whose values there are unbounded in one outlier. What keeps the
//! parameters of SR-AWV bounded all the same are the weights of the fit, which fall with the square of the
//! wavelet variance; DR-AWV drops the values themselves.

use super::design::{Design, Estimate, StudyError};
use crate::Replicate;
use crate::noise::Process;

/// Effect of a disturbance of one size.
#[derive(Debug, Clone, PartialEq)]
pub struct Movement {
    /// The size: of an outlier in standard deviations of the signal's white part, or the factor of an
    /// abnormal variance.
    pub size: f64,
    /// For each estimator of the design, the relative change of each parameter.
    pub changes: Vec<Vec<f64>>,
}

/// Adds one outlier of each of the sizes (multiples of `unit`, m/s² or rad/s) to the sample in the middle of
/// the first replicate of set 0, clean otherwise.
///
/// # Errors
/// As [`StudyError`].
pub fn outlier_curve(
    design: &Design,
    unit: f64,
    sizes: &[f64],
) -> Result<Vec<Movement>, StudyError> {
    // Set 0 is one realisation: a sensitivity curve is of a sample, the influence function of its limit.
    let mut samples = design.synthesized(0, 1, &design.drawn(0, 1)?);
    let middle = samples.len() / 2;
    let clean = samples[middle];
    curve(design, &[1], sizes, |_, size| {
        samples[middle] = clean + size * unit;
        design.measure(&samples)
    })
}

/// Multiplies the random-walk variance of the last `count` replicates of set 0, clean otherwise, by each of
/// the factors.
///
/// # Errors
/// As [`StudyError`]; when the model has no random walk.
pub fn abnormal_curve(
    design: &Design,
    count: u64,
    factors: &[f64],
) -> Result<Vec<Movement>, StudyError> {
    let abnormal: Vec<u64> =
        (1 + design.replicates.saturating_sub(count)..=design.replicates).collect();
    curve(design, &abnormal, factors, |replicate, factor| {
        let mut model = design.drawn(0, replicate)?;
        let rate_hz = model.rate_hz;
        let processes = &mut model.axes[design.channel.index()].processes;
        let walk = processes.iter_mut().find_map(|p| match p {
            Process::RandomWalk(walk) => Some((walk.gamma2(), p)),
            _ => None,
        });
        let none = StudyError::NoRandomWalk {
            channel: design.channel,
        };
        let (gamma2, walk) = walk.ok_or(none)?;
        if let Some(scaled) = walk.with_parameter("gamma2", factor * gamma2, rate_hz) {
            *walk = scaled.map_err(crate::noise::SpreadError::Reaches)?;
        }
        design.measure(&design.synthesized(0, replicate, &model))
    })
}

/// The movements when the replicates listed (counted from 1) are replaced by what `disturbed` makes of them.
fn curve(
    design: &Design,
    touched: &[u64],
    sizes: &[f64],
    mut disturbed: impl FnMut(u64, f64) -> Result<Replicate, StudyError>,
) -> Result<Vec<Movement>, StudyError> {
    let clean = |r| design.measure(&design.synthesized(0, r, &design.drawn(0, r)?));
    let mut replicates = (1..=design.replicates)
        .map(clean)
        .collect::<Result<Vec<_>, _>>()?;
    let reference = design.estimate_all(&replicates)?;
    let mut changes_at = |size: &f64| {
        // Overwritten at every size, so each starts from the clean ones and not from the size before.
        for replicate in touched {
            replicates[*replicate as usize - 1] = disturbed(*replicate, *size)?;
        }
        let moved = design.estimate_all(&replicates)?;
        let changes = moved
            .iter()
            .zip(&reference)
            .map(|(m, r)| relative(m, r))
            .collect();
        Ok(Movement {
            size: *size,
            changes,
        })
    };
    sizes.iter().map(&mut changes_at).collect()
}

fn relative(moved: &Estimate, reference: &Estimate) -> Vec<f64> {
    moved
        .theta
        .iter()
        .zip(&reference.theta)
        .map(|(m, r)| (m - r) / r)
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Trim;
    use crate::efficiency::design::tests::design;

    const AWV: usize = 0;
    const SR: usize = 1;
    const DR: usize = 2;
    const WHITE: usize = 0;
    const WALK: usize = 3;

    fn largest(changes: &[f64]) -> f64 {
        changes.iter().fold(0.0, |most, c| c.abs().max(most))
    }

    /// An outlier of z adds z²/(2·2^j)/(M_j·K) to AWV's level j, as much as white noise of variance z²/(T·K)
    /// does: sigma2 grows by that, 1e6²/(16384·5) at the second size and a hundred times as much at the
    /// third. The robust estimators stay where they were at the first.
    #[test]
    fn one_outlier_moves_awv_without_bound_and_the_robust_estimators_boundedly() {
        let design = design(1 << 14);
        let moves = outlier_curve(&design, 1.0, &[1e2, 1e6, 1e7, 1e9]).unwrap();
        let awv = |i: usize| moves[i].changes[AWV][WHITE];
        let expected = 1e12 / (16_384.0 * 5.0);
        assert!(
            (awv(1) / expected - 1.0).abs() < 0.3,
            "{} {expected}",
            awv(1)
        );
        assert!((awv(2) / awv(1) - 100.0).abs() < 1.0, "{}", awv(2) / awv(1));
        for m in &moves {
            assert!(largest(&m.changes[SR]) < 1.0, "{m:?}");
            assert!(largest(&m.changes[DR]) < 1.0, "{m:?}");
        }
        let moved = |i: usize, e: usize| &moves[i].changes[e];
        for e in [SR, DR] {
            // Redescending: past some size an outlier does nothing more.
            for (a, b) in moved(2, e).iter().zip(moved(3, e)) {
                assert!((a - b).abs() < 1e-3, "{a} {b}");
            }
        }
    }

    /// One replicate with f times the random walk: the mean variance grows by (f − 1)/K of one replicate's,
    /// and AWV and SR-AWV with it (past some factor the walk drowns the rest, and its scales that are in view
    /// are taken for an AR1); DR-AWV drops the replicate at every scale.
    #[test]
    fn an_abnormal_replicate_moves_all_but_dr_awv_without_bound() {
        let design = design(1 << 14);
        let moves = abnormal_curve(&design, 1, &[1e2, 1e4, 1e6, 1e8]).unwrap();
        for e in [AWV, SR] {
            assert!(moves[1].changes[e][WALK] > 100.0, "{moves:?}");
            let (third, fourth) = (largest(&moves[2].changes[e]), largest(&moves[3].changes[e]));
            assert!(third > 100.0 && fourth > 50.0 * third, "{moves:?}");
        }
        for m in &moves {
            assert!(largest(&m.changes[DR]) < 1.0, "{m:?}");
        }
        assert_eq!(moves[2].changes[DR], moves[3].changes[DR]);
    }

    /// The breakdown point of DR-AWV between replicates is its trim: a abnormal ones of K are borne,
    /// a + 1 are not.
    #[test]
    fn dr_awv_withstands_as_many_abnormal_replicates_as_it_trims() {
        for trim in [1, 2] {
            let design = Design {
                trim: Trim::Count(trim),
                ..design(1 << 13)
            };
            let change =
                |count| largest(&abnormal_curve(&design, count, &[1e8]).unwrap()[0].changes[DR]);
            let borne = trim as u64;
            assert!(change(borne) < 5.0, "{trim}: {}", change(borne));
            assert!(change(borne + 1) > 1e4, "{trim}: {}", change(borne + 1));
        }
    }

    #[test]
    fn without_a_random_walk_nothing_can_be_abnormal() {
        let mut design = design(1 << 12);
        design.model.axes[0].processes.pop();
        let e = abnormal_curve(&design, 1, &[2.0]).unwrap_err();
        assert_eq!(
            e.to_string(),
            "accel.x has no random walk whose variance could be made abnormal"
        );
    }
}
