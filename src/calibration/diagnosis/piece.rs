//! The replicates of one axis, and the two tests of them.

use crate::curve::implied::drift_share;
use crate::curve::sampling::SamplingLaw;
use crate::curve::{Estimator, Group, Replicate};
use crate::imu::Axis;
use crate::noise::Composite;
use crate::outcome::Outcome;
use crate::wavelet::interval::edof_robust;

/// Degrees of freedom from which the scatter of classical over robust follows its large-sample law.
const LARGE_SAMPLE: f64 = 30.0;

/// Share of drift in the wavelet variance up to which its coefficients are noise, for which alone the sampling law holds.
///
/// A drift adds the same d to each coefficient W, so that Σ(d + W)² scatters by 2d ΣW more, which the law leaves out: with n
/// independent coefficients and a share s, 4s(1 − s)/n beside its own 2(1 − s)²/n. Of axes pooled in one model one may have all
/// the drift, three times the share of the model: at 6 % the variance of ln nu is 13 % larger than the law's, its
/// standard deviation 6 %. The fourth cumulant −2s² that parts the robust from the classical variance is 0.007 there.
const MOST_DRIFT: f64 = 0.02;

/// The replicates of one axis, by recording.
pub(super) struct Piece<'a> {
    pub(super) axis: Axis,
    pub(super) model: &'a Composite,
    pub(super) law: SamplingLaw,
    pub(super) replicates: Vec<Option<&'a Replicate>>,
}

impl Piece<'_> {
    /// Whether drift makes so much of the wavelet variance at a level (index) that its scatter is not known.
    pub(super) fn drifts(&self, level: usize) -> bool {
        drift_share(self.model, level as u32 + 1) > MOST_DRIFT
    }
}

/// The pieces of a sensor's groups.
pub(super) fn axes<'a>(
    own: &[&'a Group],
    names: &[&str],
    outcomes: &'a [Outcome],
) -> Vec<Piece<'a>> {
    let levels = own
        .iter()
        .flat_map(|g| &g.replicates)
        .map(Replicate::levels)
        .max()
        .unwrap_or(0);
    let piece = |axis: Axis| {
        let group = own
            .iter()
            .find(|g| g.replicates.iter().any(|r| r.axis == Some(axis)))?;
        // The last estimator is the most robust.
        let model = &outcomes
            .iter()
            .rfind(|o| o.scope == group.scope)?
            .fit
            .composite;
        let replicate_of = |name: &&str| {
            group
                .replicates
                .iter()
                .find(|r| r.name == **name && r.axis == Some(axis))
        };
        let law = SamplingLaw::new(model, levels);
        Some(Piece {
            axis,
            model,
            law,
            replicates: names.iter().map(replicate_of).collect(),
        })
    };
    Axis::ALL.into_iter().filter_map(piece).collect()
}

/// Quantity in which recordings are compared.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Test {
    /// ln robust wavelet variance.
    Noise,
    /// ln (classical / robust): only more than in the others is suspect.
    Outliers,
}

/// ln (classical / robust) at a level.
pub(super) fn excess_of_classical(r: &Replicate, level: usize) -> f64 {
    (r.classical[level] / r.robust[level].value).ln()
}

impl Test {
    /// The quantity at a level; NaN where it is no evidence.
    pub(super) fn value(self, piece: &Piece<'_>, r: &Replicate, level: usize) -> f64 {
        match self {
            _ if piece.drifts(level) => f64::NAN,
            Self::Noise => r.value(Estimator::SrAwv, level).ln(),
            // On coarse steps it is their position under the bias of the switching-on that makes the two differ.
            Self::Outliers if r.robust[level].is_stepped() => f64::NAN,
            Self::Outliers => excess_of_classical(r, level),
        }
    }

    /// Degrees of freedom of a chi-square that scatters as much, given those of the classical variance.
    pub(super) fn edof(self, classical: f64, efficiency: f64) -> f64 {
        match self {
            Self::Noise => edof_robust(classical, efficiency),
            // (1/e − 1)·2/eta = 2/(eta e/(1 − e)).
            Self::Outliers => classical * efficiency / (1.0 - efficiency),
        }
    }

    /// Number of levels at which a replicate can be compared with others.
    pub(super) fn levels(self, piece: &Piece<'_>, replicate: &Replicate) -> usize {
        let edof = piece
            .law
            .edof(replicate.samples)
            .into_iter()
            .take(replicate.levels());
        edof.take_while(|e| self == Self::Noise || *e >= LARGE_SAMPLE)
            .count()
    }

    /// The most levels at which any can be.
    pub(super) fn most_levels(self, pieces: &[Piece<'_>]) -> usize {
        let of_piece = |p: &Piece<'_>| {
            p.replicates
                .iter()
                .flatten()
                .map(|r| self.levels(p, r))
                .max()
        };
        pieces.iter().filter_map(of_piece).max().unwrap_or(0)
    }

    pub(super) const fn name(self) -> &'static str {
        match self {
            Self::Noise => "noise",
            Self::Outliers => "outliers",
        }
    }
}
