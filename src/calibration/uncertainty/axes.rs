//! Whether the axes of a sensor that is pooled differ: one model is then none of theirs.
//!
//! At each scale ln nu of all recordings and axes as a two-way layout: the mean square between axes over that of what
//! neither axis nor recording explains, F with A − 1 and (K − 1)(A − 1) degrees of freedom; what remains is taken to be at
//! least the noise of the wavelet variance. Of one recording the noise alone is known, and the sum of squares between
//! axes is a chi-square. The least probability of all scales, times their number (Bonferroni), is the answer.

use super::alike::LEVEL;
use crate::curve::shape::variance_of_log;
use crate::curve::{Estimator, Replicate};
use crate::imu::Axis;
use crate::outcome::AxesDiffer;
use crate::wavelet::Tuning;
use crate::wavelet::interval::edof_robust;
use statrs::distribution::{ChiSquared, ContinuousCDF, FisherSnedecor};

/// Degrees of freedom from which on ln nu is near enough to Gaussian.
const LEAST: f64 = 30.0;
/// Largest over smallest axis, in wavelet variance, from which on a model an axis is worth while.
const NOTABLE: f64 = 1.1;

/// Difference of the axes of pooled replicates; none where they agree, or where a recording lacks an axis.
pub(crate) fn axes_differ(
    replicates: &[Replicate],
    estimator: Estimator,
    tuning: &Tuning,
) -> Option<AxesDiffer> {
    let axes: Vec<Axis> = Axis::ALL
        .into_iter()
        .filter(|axis| replicates.iter().any(|r| r.axis == Some(*axis)))
        .collect();
    let table = layout(replicates, &axes)?;
    let degrees = |r: &Replicate, level: u32| match r.edof_eta3(level) {
        edof if r.is_robust(estimator, level as usize - 1) => {
            edof_robust(edof, tuning.efficiency())
        }
        edof => edof,
    };
    let is_usable =
        |r: &Replicate, level: u32| r.levels() >= level as usize && degrees(r, level) >= LEAST;
    let long_enough = |level: u32| -> Vec<&Vec<&Replicate>> {
        table
            .iter()
            .filter(|row| row.iter().all(|r| is_usable(r, level)))
            .collect()
    };
    // Up to the scale that more than half of the recordings have, as the average of them.
    let usable: Vec<(u32, Vec<&Vec<&Replicate>>)> = (1..)
        .map(|level| (level, long_enough(level)))
        .take_while(|(_, rows)| 2 * rows.len() > table.len())
        .collect();
    let count = usable.len() as f64;
    let of_level = |(level, rows): &(u32, Vec<&Vec<&Replicate>>)| {
        let level = *level;
        let logs = |row: &&Vec<&Replicate>| -> Vec<f64> {
            row.iter()
                .map(|r| r.value(estimator, level as usize - 1).ln())
                .collect()
        };
        // The largest, that of the shortest recording: too much noise makes the test cautious, too little
        // bold.
        let variances = rows
            .iter()
            .copied()
            .flatten()
            .map(|r| variance_of_log(degrees(r, level)));
        let noise = variances.fold(0.0, f64::max);
        let (p_value, means) = between_axes(&rows.iter().map(logs).collect::<Vec<_>>(), noise)?;
        let by_mean = |a: &(f64, Axis), b: &(f64, Axis)| a.0.total_cmp(&b.0);
        let means_of_axes = || means.iter().copied().zip(axes.iter().copied());
        let (smallest, largest) = (
            means_of_axes().min_by(by_mean)?,
            means_of_axes().max_by(by_mean)?,
        );
        Some(AxesDiffer {
            level,
            p_value: (p_value * count).min(1.0),
            largest: largest.1,
            smallest: smallest.1,
            ratio: (largest.0 - smallest.0).exp(),
        })
    };
    let all = usable.iter().filter_map(of_level);
    let told: Vec<AxesDiffer> = all
        .filter(|d| d.p_value <= LEVEL && d.ratio >= NOTABLE)
        .collect();
    told.into_iter().max_by(|a, b| a.ratio.total_cmp(&b.ratio))
}

/// One row a recording, one column an axis.
fn layout<'a>(replicates: &'a [Replicate], axes: &[Axis]) -> Option<Vec<Vec<&'a Replicate>>> {
    let mut names: Vec<&str> = replicates.iter().map(|r| r.name.as_str()).collect();
    names.sort_unstable();
    names.dedup();
    let whole = axes.len() >= 2 && names.len() * axes.len() == replicates.len();
    let cell = |name: &str, axis: Axis| {
        replicates
            .iter()
            .find(|r| r.name == name && r.axis == Some(axis))
    };
    let rows = names
        .iter()
        .map(|name| axes.iter().map(|axis| cell(name, *axis)).collect());
    if whole { rows.collect() } else { None }
}

/// Probability of such means of the columns where they are equal, and the means. `noise`: variance of a value.
fn between_axes(rows: &[Vec<f64>], noise: f64) -> Option<(f64, Vec<f64>)> {
    let (count, axes) = (rows.len() as f64, rows[0].len() as f64);
    let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len() as f64;
    let columns: Vec<f64> = (0..rows[0].len())
        .map(|axis| mean(&rows.iter().map(|row| row[axis]).collect::<Vec<_>>()))
        .collect();
    let all = mean(&columns);
    // Recordings differ as a whole too, but that is in every column alike and drops out of the means'
    // differences.
    let between = count * columns.iter().map(|m| (m - all).powi(2)).sum::<f64>();
    // One recording leaves no remainder to compare with: the noise is taken as known, and F becomes a
    // chi-square.
    if rows.len() == 1 {
        return Some((
            ChiSquared::new(axes - 1.0).ok()?.sf(between / noise),
            columns,
        ));
    }
    let remains = |row: &Vec<f64>| -> f64 {
        let own = mean(row);
        row.iter()
            .zip(&columns)
            .map(|(value, column)| (value - own - column + all).powi(2))
            .sum()
    };
    let degrees = (count - 1.0) * (axes - 1.0);
    // By few recordings the remainder may come out small by chance, and F large; it cannot truly be less than
    // the noise.
    let remaining = (rows.iter().map(remains).sum::<f64>() / degrees).max(noise);
    let law = FisherSnedecor::new(axes - 1.0, degrees).ok()?;
    Some((law.sf(between / (axes - 1.0) / remaining), columns))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rng::StreamKey;
    use crate::wavelet::both;
    use rand::RngExt;
    use rand_distr::StandardNormal;

    /// White noise of three axes, the second with so many times the variance of the others.
    fn set(seed: u64, recordings: usize, factor: f64) -> Vec<Replicate> {
        let recording = |k: usize| {
            let (run, axis) = (k as u64, Axis::ALL[k % 3]);
            let key = StreamKey {
                seed,
                scenario: "",
                run,
                source: "",
                process: "",
            };
            let mut generator = key.generator();
            let sigma = if axis == Axis::Y { factor.sqrt() } else { 1.0 };
            let mut normal = || sigma * generator.sample::<f64, _>(StandardNormal);
            let signal: Vec<f64> = (0..2048).map(|_| normal()).collect();
            let (classical, robust) = both(&signal, 8, &Tuning::default()).unwrap();
            let (name, trend) = (format!("run{}", k / 3), f64::NAN);
            Replicate {
                name,
                axis: Some(axis),
                samples: 2048,
                classical,
                robust,
                coverage: Vec::new(),
                trend,
                mean: f64::NAN,
            }
        };
        (0..3 * recordings).map(recording).collect()
    }

    /// By Bonferroni at most 2.5 % of sets of alike axes: of 100 at most 8 (2.5 and four standard deviations of 1.6), whatever the
    /// number of recordings. Axes of which one has 1.4 times the variance (7 deviations of one recording's first scale, of
    /// 1024 degrees: √(2·2/1024) = 0.0625 of 0.34) are told.
    #[test]
    fn axes_are_told_apart_where_they_differ() {
        for (recordings, estimator) in [
            (1, Estimator::Awv),
            (2, Estimator::Awv),
            (6, Estimator::DrAwv),
        ] {
            let told = |seed: &u64| {
                axes_differ(&set(*seed, recordings, 1.0), estimator, &Tuning::default()).is_some()
            };
            let alarms = (0..100).filter(told).count();
            assert!(alarms <= 8, "{recordings} {}: {alarms}", estimator.name());
        }
        for recordings in [1, 6] {
            let found = axes_differ(&set(1, recordings, 1.4), Estimator::Awv, &Tuning::default())
                .expect("told");
            assert!(
                (found.ratio - 1.4).abs() < 0.4 && found.largest == Axis::Y,
                "{found:?}"
            );
        }
    }

    #[test]
    fn an_incomplete_layout_says_nothing() {
        let mut some = set(1, 2, 4.0);
        some.pop();
        assert_eq!(axes_differ(&some, Estimator::Awv, &Tuning::default()), None);
    }
}
