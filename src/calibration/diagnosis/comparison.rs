//! All recordings against one another, by one test.

use super::alarm::{Found, alarms};
use super::contrasts::{Table, scores};
use super::noise::Noise;
use super::piece::{Piece, Test};
use super::result::{Alarm, DriftAlarm};
use crate::curve::Replicate;
use crate::imu::{Axis, Sensor};
use crate::noise::Composite;
use crate::outcome::tau_s;

/// All recordings against one another by one test.
pub(super) struct Comparison {
    axes: Vec<Axis>,
    table: Table,
    noise: Vec<Noise>,
    found: Vec<Found>,
}

impl Comparison {
    pub(super) fn new(pieces: &[Piece<'_>], sensor: Sensor, test: Test, efficiency: f64) -> Self {
        let levels = test.most_levels(pieces);
        let of_piece = |p: &Piece<'_>| {
            let logs = |r: &Replicate| {
                (0..test.levels(p, r))
                    .map(|j| test.value(p, r, j))
                    .collect()
            };
            p.replicates.iter().map(|r| r.map(logs)).collect()
        };
        let noise = |p: &Piece<'_>| {
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
            Noise::new(p.law.first(levels), p.replicates.iter().map(edof).collect())
        };
        let above_only = test == Test::Outliers;
        let table = Table {
            logs: pieces.iter().map(of_piece).collect(),
            above_only,
        };
        let noise: Vec<Noise> = pieces.iter().map(noise).collect();
        let found = alarms(&table, &noise, sensor.name(), test.name());
        Self {
            axes: pieces.iter().map(|p| p.axis).collect(),
            table,
            noise,
            found,
        }
    }

    /// The change of the level within each recording, in standard deviations of the fitted model; their strengths may differ as
    /// those of the noise at the longest scales do.
    pub(super) fn drift(pieces: &[Piece<'_>], sensor: Sensor, noise: &Self) -> Self {
        let deviations = |p: &Piece<'_>| {
            // The Haar coefficient of a scale as long as the record is half the trend, and its variance is nu
            // there.
            let deviation =
                |r: &Replicate| vec![0.5 * r.trend / wv_of_length(p.model, r.samples).sqrt()];
            p.replicates.iter().map(|r| r.map(deviation)).collect()
        };
        let table = Table {
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
        let own = pieces
            .iter()
            .map(|_| Noise::normal(files, 0.5 * mean.sqrt()))
            .collect::<Vec<_>>();
        let found = alarms(&table, &own, sensor.name(), "drift");
        Self {
            axes: pieces.iter().map(|p| p.axis).collect(),
            table,
            noise: own,
            found,
        }
    }

    pub(super) fn drift_alarm(&self, file: usize, pieces: &[Piece<'_>]) -> Option<DriftAlarm> {
        let found = self.found.iter().find(|f| f.file == file)?;
        let deviations = found
            .distance
            .deviations
            .iter()
            .map(|(axis, z)| (self.axes[*axis], *z))
            .collect();
        let change = pieces
            .iter()
            .filter_map(|p| Some((p.axis, p.replicates[file]?.trend)))
            .collect();
        Some(DriftAlarm {
            p_value: found.p_value,
            change,
            deviations,
        })
    }

    pub(super) fn alarm(&self, file: usize, rate_hz: f64) -> Option<Alarm> {
        let found = self.found.iter().find(|f| f.file == file)?;
        let first = found.window.first as u32 + 1;
        let named = found
            .distance
            .deviations
            .iter()
            .map(|(axis, z)| (self.axes[*axis], *z));
        Some(Alarm {
            p_value: found.p_value,
            tau_s: [first, first + found.window.width as u32 - 1]
                .map(|level| tau_s(level, rate_hz)),
            deviations: named.collect(),
        })
    }

    /// Against the files that are not abnormal.
    pub(super) fn scores(&self, file: usize) -> Vec<Vec<f64>> {
        let files = self.table.logs.first().map_or(0, Vec::len);
        let normal = |k: usize| k == file || self.found.iter().all(|f| f.file != k);
        scores(
            &self.table,
            &self.noise,
            &(0..files).map(normal).collect::<Vec<_>>(),
            file,
        )
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
