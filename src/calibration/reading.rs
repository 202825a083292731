//! N, B and K of a curve that its model does not describe: slopes fitted to the scales where they are read.
//!
//! A vibration, a low-pass filter or rows that are repeated spoil some scales, and the others read N and K as well as ever.

use crate::curve::implied;
use crate::fit::{Weighting, fit};
use crate::model::ModelSpec;
use crate::noise::practical::Horizon;
use crate::outcome::{Outcome, tau_s};

/// A model describes scales where ln nu is off by less than this beyond chance: 2.5 % in N.
const DESCRIBED: f64 = 0.05;

fn is_described(outcome: &Outcome) -> bool {
    outcome.fit.lack_of_fit < DESCRIBED.powi(2)
}

/// White noise, quantization noise, flicker noise and random walk fitted to the scales that these describe. None where the model
/// describes the curve, or is nearer to it at the averaging times that navigation sees.
pub(crate) fn reading(outcome: &Outcome, rate_hz: f64) -> Option<Outcome> {
    if is_described(outcome) {
        return None;
    }
    let read = slopes(outcome, rate_hz)?;
    let distance = |model: &Outcome| -> f64 {
        let curve = &outcome.curve;
        let data = curve.wv.iter().zip(&curve.edof);
        let scales = curve
            .levels
            .iter()
            .zip(data)
            .zip(implied(&model.fit.composite, curve));
        let squares = scales.filter(|((level, _), _)| {
            averaging_s(**level, rate_hz) >= Horizon::default().from_s
                && !curve.ignored.contains(level)
        });
        let square = |((_, (wv, edof)), nu): ((&u32, (&f64, &f64)), f64)| {
            (wv / nu).ln().powi(2) / (2.0 / edof + curve.differing + DESCRIBED.powi(2))
        };
        squares.map(square).sum()
    };
    (distance(&read) < distance(outcome)).then_some(read)
}

/// A scale is two averages long.
fn averaging_s(level: u32, rate_hz: f64) -> f64 {
    0.5 * tau_s(level, rate_hz)
}

/// The widest band of scales in which N is read and the widest with the longest scale, or all scales where there is no such band.
fn slopes(outcome: &Outcome, rate_hz: f64) -> Option<Outcome> {
    let spec: ModelSpec = "WN+QN+FN+RW".parse().ok()?;
    let counted = outcome.curve.counted_levels();
    let fitted = |scales: &[u32]| {
        let mut curve = outcome.curve.clone();
        curve.ignored = curve.levels.clone();
        curve.ignored.retain(|level| !scales.contains(level));
        let fit = fit(&curve, &spec, rate_hz, Weighting::Model).ok()?;
        Some(Outcome {
            spec: spec.clone(),
            curve,
            fit,
            ..outcome.clone()
        })
    };
    let all = fitted(&counted)?;
    if is_described(&all) {
        return Some(all);
    }
    let far = |level: &u32| {
        (averaging_s(*level, rate_hz) / Horizon::default().from_s)
            .ln()
            .abs()
    };
    let of_density = counted.iter().min_by(|a, b| far(a).total_cmp(&far(b)))?;
    // The shortest scales if several bands are as wide, and more scales than it takes to tell.
    let widest_with = |level: &u32| {
        let widths = (spec.parameters() + 2..counted.len()).rev();
        let bands = widths.flat_map(|width| counted.windows(width));
        let mut of_level = bands.filter(|band| band.contains(level));
        of_level.find(|band| fitted(band).as_ref().is_some_and(is_described))
    };
    let Some(band) = widest_with(of_density) else {
        return Some(all);
    };
    let longest = widest_with(counted.last()?).unwrap_or_default();
    let is_read = |level: &&u32| band.contains(*level) || longest.contains(*level);
    fitted(&counted.iter().filter(is_read).copied().collect::<Vec<_>>())
}

#[cfg(test)]
mod tests {
    use crate::outcome::Outcome;
    use crate::pipeline::fit_given;
    use crate::tests::*;

    /// White noise and random walk, exact but for a vibration at these levels.
    fn outcome(vibrating: &[u32]) -> Outcome {
        let noise = white_and_walk(1.0, 1e-5);
        let mut curve = exact(&noise, 16, |level| 1e6 / f64::from(level).exp2());
        vibrating
            .iter()
            .for_each(|level| curve.wv[*level as usize - 1] *= 50.0);
        fit_given(curve, "WN+RW", 100.0)
    }

    /// The scales beside a vibration are exact, and so is what is read there: both amplitudes, and no other noise.
    #[test]
    fn the_scales_that_a_vibration_leaves_give_the_noise() {
        let vibrating = outcome(&[3, 4, 5]);
        let read = vibrating.for_navigation();
        assert_eq!(read.curve.counted_levels(), (6..=16).collect::<Vec<_>>());
        let amplitudes = read.fit.composite.processes.iter().map(Process::amplitude);
        for (found, exact) in amplitudes.zip([1.0_f64, 0.0, 0.0, 1e-5]) {
            assert_abs_diff_eq!(found, exact, epsilon = 1e-3 * exact.max(1e-6));
        }
        assert_eq!(outcome(&[]).reading, None);
    }
}
