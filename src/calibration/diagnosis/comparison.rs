//! All recordings against one another, by one test.

use super::contrasts::{AbnormalFile, LogVarianceTable, NullScatter, alarms};
use super::diagnose::Alarm;
use crate::curve::sampling::{SamplingDistribution, drift_share};
use crate::curve::{Estimator, Group, Replicate};
use crate::imu::{Axis, Sensor};
use crate::noise::Composite;
use crate::outcome::{Outcome, tau_s};
use crate::wavelet::interval::edof_robust;

/// All recordings against one another by one test.
pub(super) struct RecordingComparison {
    axes: Vec<Axis>,
    table: LogVarianceTable,
    noise: Vec<NullScatter>,
    found: Vec<AbnormalFile>,
}

impl RecordingComparison {
    pub(super) fn new(
        pieces: &[AxisReplicates<'_>],
        sensor: Sensor,
        test: ComparedQuantity,
        efficiency: f64,
    ) -> Self {
        let levels = test.most_levels(pieces);
        let of_piece = |p: &AxisReplicates<'_>| {
            let logs = |r: &Replicate| {
                (0..test.levels(p, r))
                    .map(|j| test.value(p, r, j))
                    .collect()
            };
            p.replicates.iter().map(|r| r.map(logs)).collect()
        };
        let noise = |p: &AxisReplicates<'_>| {
            let longest = p
                .replicates
                .iter()
                .flatten()
                .map(|r| r.samples)
                .max()
                .unwrap_or(1);
            let edof = |r: &Option<&Replicate>| {
                let all = p.law.edof(r.map_or(longest, |r| r.samples)).into_iter();
                all.take(levels).map(|e| test.edof(e, efficiency)).collect()
            };
            NullScatter::new(p.law.first(levels), p.replicates.iter().map(edof).collect())
        };
        let table = LogVarianceTable {
            logs: pieces.iter().map(of_piece).collect(),
            above_only: test == ComparedQuantity::Outliers,
        };
        let noise = pieces.iter().map(noise).collect();
        let name = match test {
            ComparedQuantity::Noise => "noise",
            ComparedQuantity::Outliers => "outliers",
        };
        Self::of(pieces, table, noise, sensor, name)
    }

    fn of(
        pieces: &[AxisReplicates<'_>],
        table: LogVarianceTable,
        noise: Vec<NullScatter>,
        sensor: Sensor,
        name: &str,
    ) -> Self {
        Self {
            axes: pieces.iter().map(|p| p.axis).collect(),
            found: alarms(&table, &noise, sensor.name(), name),
            table,
            noise,
        }
    }

    /// The change of the level within each recording, in standard deviations of the fitted model; their strengths may differ as
    /// those of the noise at the longest scales do.
    pub(super) fn drift(pieces: &[AxisReplicates<'_>], sensor: Sensor, noise: &Self) -> Self {
        let deviations = |p: &AxisReplicates<'_>| {
            // The Haar coefficient of a scale as long as the record is half the trend, and its variance is nu
            // there.
            let deviation =
                |r: &Replicate| vec![0.5 * r.trend / wv_of_length(p.model, r.samples).sqrt()];
            p.replicates.iter().map(|r| r.map(deviation)).collect()
        };
        let table = LogVarianceTable {
            logs: pieces.iter().map(deviations).collect::<Vec<Vec<_>>>(),
            above_only: false,
        };
        let files = pieces.first().map_or(0, |p| p.replicates.len());
        // A recording that drifts is also louder at the longest scales: it is not to hide itself.
        let size = |file: usize| -> f64 {
            table
                .logs
                .iter()
                .filter_map(|axis| axis[file].as_ref())
                .map(|z| z[0] * z[0])
                .sum()
        };
        let largest = (0..files).max_by(|a, b| size(*a).total_cmp(&size(*b)));
        let others: Vec<bool> = (0..files).map(|file| Some(file) != largest).collect();
        let between = noise.table.between(&noise.noise, &others);
        let last = &between[between.len().saturating_sub(LONGEST_SCALES)..];
        let mean = last.iter().map(|b| b * b).sum::<f64>() / last.len().max(1) as f64;
        // Of the standard deviation, whose logarithm is half that of the variance.
        let own = vec![NullScatter::normal(files, 0.5 * mean.sqrt()); pieces.len()];
        Self::of(pieces, table, own, sensor, "drift")
    }

    pub(super) fn alarm(&self, file: usize, rate_hz: f64) -> Option<Alarm> {
        let found = self.found.iter().find(|f| f.file == file)?;
        let first = found.window.first as u32 + 1;
        let scales = [first, first + found.window.width as u32 - 1];
        let deviations = found.distance.deviations.iter();
        Some(Alarm {
            p_value: found.p_value,
            tau_s: scales.map(|level| tau_s(level, rate_hz)).to_vec(),
            change: Vec::new(),
            deviations: deviations.map(|(axis, z)| (self.axes[*axis], *z)).collect(),
        })
    }
}

/// Scales of which the differences between recordings are those of their level's changes too.
const LONGEST_SCALES: usize = 5;

/// Haar wavelet variance of a model at a scale as long as a record, by the power law between the neighbouring powers of two.
fn wv_of_length(model: &Composite, samples: usize) -> f64 {
    let level = samples.max(2).ilog2();
    let (below, above) = (model.haar_wv(level), model.haar_wv(level + 1));
    // A record is rarely a power of two long; between two levels ln nu is nearly linear in ln tau.
    let part = (samples as f64).log2() - f64::from(level);
    below * (above / below).powf(part)
}

// The replicates of one axis, and the two tests of them.

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
pub(super) struct AxisReplicates<'a> {
    pub(super) axis: Axis,
    pub(super) model: &'a Composite,
    pub(super) law: SamplingDistribution,
    pub(super) replicates: Vec<Option<&'a Replicate>>,
}

impl AxisReplicates<'_> {
    /// Returns true if drift dominates the wavelet variance at a level (index), so that its scatter
    /// is not known.
    pub(super) fn drifts(&self, level: usize) -> bool {
        drift_share(self.model, level as u32 + 1) > MOST_DRIFT
    }
}

/// The pieces of a sensor's groups.
pub(super) fn axes<'a>(
    own: &[&'a Group],
    names: &[&str],
    outcomes: &'a [Outcome],
) -> Vec<AxisReplicates<'a>> {
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
        let law = SamplingDistribution::new(model, levels);
        Some(AxisReplicates {
            axis,
            model,
            law,
            replicates: names.iter().map(replicate_of).collect(),
        })
    };
    Axis::ALL.into_iter().filter_map(piece).collect()
}

/// Quantity in which recordings are compared.
#[derive(Clone, Copy, PartialEq)]
pub(super) enum ComparedQuantity {
    /// ln robust wavelet variance.
    Noise,
    /// ln (classical / robust): only more than in the others is suspect.
    Outliers,
}

/// ln (classical / robust) at a level.
pub(super) fn excess_of_classical(r: &Replicate, level: usize) -> f64 {
    (r.classical[level] / r.robust[level].value).ln()
}

impl ComparedQuantity {
    /// The quantity at a level; NaN where it is no evidence.
    pub(super) fn value(self, piece: &AxisReplicates<'_>, r: &Replicate, level: usize) -> f64 {
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
    pub(super) fn levels(self, piece: &AxisReplicates<'_>, replicate: &Replicate) -> usize {
        let edof = piece
            .law
            .edof(replicate.samples)
            .into_iter()
            .take(replicate.levels());
        edof.take_while(|e| self == Self::Noise || *e >= LARGE_SAMPLE)
            .count()
    }

    /// The most levels at which any can be.
    pub(super) fn most_levels(self, pieces: &[AxisReplicates<'_>]) -> usize {
        let of_piece = |p: &AxisReplicates<'_>| {
            p.replicates
                .iter()
                .flatten()
                .map(|r| self.levels(p, r))
                .max()
        };
        pieces.iter().filter_map(of_piece).max().unwrap_or(0)
    }
}
