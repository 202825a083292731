//! Allan-variance linear regression, what most practitioners do: each noise term is read off the stretch of the
//! Allan deviation that has its slope ([IEEE 952](crate::bibliography::Ieee952)), as if the others were not
//! there. Inconsistent for that reason ([Guerrier](crate::bibliography::Guerrier16)): here to show what it
//! costs.
//!
//! | process | slope of ln adev over ln m | adev²(m) |
//! |---|---|---|
//! | QN | −1 | 3 Q²/m² |
//! | WN | −½ | sigma2/m |
//! | FN | 0 | (2 ln 2/π) B² |
//! | RW | +½ | gamma2·m/3 |
//! | DR | +1 | slope²·m²/2 |
//!
//! QN falls fastest of all: where it is more than the others it is at the first scales. A slope of −1 further on is noise of
//! the curve; unless the curve begins with one QN is zero, no such slope found.
//!
//! m = tau/2 samples are averaged. The stretch is the longest run of neighbouring scales around the
//! one where the local slope is nearest to the term's in which the slope is within 0.15 of it; the line of that slope
//! through them, by least squares, is the term. AR1 and GM have no slope of their own.

use super::least_squares::{Fit, outside, too_few_scales};
use super::search::Termination;
use crate::curve::{CalibrationError, CalibrationFault};
use crate::model::ModelSpec;
use crate::noise::{Composite, Process, ProcessKind};
use crate::wavelet::Curve;
use std::f64::consts::{LN_2, PI, SQRT_2};

/// Slopes this near to a term's are taken as its own.
const NEAR: f64 = 0.15;

/// Reads the terms of a model off a curve.
///
/// # Errors
/// When a process has no slope of its own, or the curve has fewer than two scales.
pub(crate) fn avlr(curve: &Curve, spec: &ModelSpec) -> Result<Fit, CalibrationError> {
    let points: Vec<(f64, f64)> = curve
        .levels
        .iter()
        .zip(&curve.wv)
        // ln m with m = 2^(level − 1), and ln adev with adev² = 2 nu.
        .map(|(level, nu)| ((f64::from(*level) - 1.0) * LN_2, 0.5 * (2.0 * nu).ln()))
        .collect();
    if points.len() < 2 {
        return Err(too_few_scales(spec, spec.parameters().max(2), points.len()));
    }
    let processes = spec
        .kinds()
        .iter()
        .map(|kind| term(*kind, &points))
        .collect::<Result<Vec<_>, _>>()?;
    let composite = Composite::new(processes);
    let not_found = |i: &usize| {
        composite.processes[*i]
            .values()
            .iter()
            .all(|value| *value <= 0.0)
    };
    let zero = (0..composite.processes.len()).filter(not_found).collect();
    let residual = |((level, nu), edof): ((&u32, &f64), &f64)| {
        // The distance with the weights `edof`, for comparison with other estimators; nothing minimised it.
        (0.5 * edof).sqrt() * (1.0 - composite.haar_wv(*level) / nu)
    };
    let residuals: Vec<f64> = curve
        .levels
        .iter()
        .zip(&curve.wv)
        .zip(&curve.edof)
        .map(residual)
        .collect();
    Ok(Fit {
        objective: residuals.iter().map(|r| r * r).sum(),
        residuals,
        termination: Termination::Regression,
        combinations: 1,
        starts: 1,
        agreeing: 1,
        runner_up: None,
        zero,
        at_end: Vec::new(),
        minima: Vec::new(),
        weighted_for: Vec::new(),
        lack_of_fit: 0.0,
        composite,
    })
}

fn term(kind: ProcessKind, points: &[(f64, f64)]) -> Result<Process, CalibrationError> {
    // adev at m = 1 on the line of a slope.
    let at_one = |slope: f64| {
        let stretch = &points[stretch(points, slope)];
        // The least-squares intercept of a line of given slope is the mean of y − slope·x.
        (stretch.iter().map(|(x, y)| y - slope * x).sum::<f64>() / stretch.len() as f64).exp()
    };
    let value = match kind {
        ProcessKind::White => at_one(-0.5).powi(2),
        ProcessKind::Quantization if !begins(points, -1.0) => 0.0,
        ProcessKind::Quantization => at_one(-1.0).powi(2) / 3.0,
        ProcessKind::Flicker => at_one(0.0).powi(2) / (2.0 * LN_2 / PI),
        ProcessKind::RandomWalk => 3.0 * at_one(0.5).powi(2),
        ProcessKind::Drift => SQRT_2 * at_one(1.0),
        ProcessKind::Ar1 | ProcessKind::GaussMarkov | ProcessKind::Ma1 => {
            let code = kind.code();
            let message = format!("{code} has no slope of its own in the Allan deviation");
            return Err(CalibrationError::new(CalibrationFault::NoSlope, message));
        }
    };
    Process::new(kind, 0.0, value, 1.0).map_err(outside)
}

/// Returns true if the first two points have this slope (in log-log).
fn begins(points: &[(f64, f64)], slope: f64) -> bool {
    let ((x0, y0), (x1, y1)) = (points[0], points[1]);
    ((y1 - y0) / (x1 - x0) - slope).abs() <= NEAR
}

/// The points whose stretch has a slope: at least the two between which it is nearest.
fn stretch(points: &[(f64, f64)], slope: f64) -> std::ops::Range<usize> {
    let off = |i: usize| {
        let ((x0, y0), (x1, y1)) = (points[i], points[i + 1]);
        ((y1 - y0) / (x1 - x0) - slope).abs()
    };
    let segments = points.len() - 1;
    let best = (0..segments)
        .min_by(|a, b| off(*a).total_cmp(&off(*b)))
        .unwrap_or(0);
    let first = (0..best)
        .rev()
        .take_while(|i| off(*i) <= NEAR)
        .last()
        .unwrap_or(best);
    let last = (best + 1..segments)
        .take_while(|i| off(*i) <= NEAR)
        .last()
        .unwrap_or(best);
    first..last + 2
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::noise::Process;
    use approx::assert_relative_eq;

    fn curve(model: &Composite) -> Curve {
        crate::tests::exact(model, 16, |level| 1e6 / f64::from(level).exp2())
    }

    fn read(processes: Vec<Process>) -> Vec<f64> {
        let spec: Vec<&str> = processes.iter().map(Process::code).collect();
        let fit = avlr(
            &curve(&Composite::new(processes)),
            &spec.join("+").parse().unwrap(),
        )
        .unwrap();
        fit.composite
            .processes
            .iter()
            .map(|p| p.parameters()[0].1)
            .collect()
    }

    /// Alone, every term is read exactly; but for RW, whose adev² = gamma2 (4m² + 2)/(12 m) lies 1/(2m²) above its
    /// line. From m = 1 to 2 its slope is 0.29, too far off; over m = 2 … 2^15 the mean of ln(1 + 1/(2m²)) is
    /// (0.1178 + 0.0308 + 0.0078 + 0.0026)/15 = 1.06 %.
    #[test]
    fn a_term_alone_is_read_off() {
        assert_relative_eq!(
            read(vec![Process::white(3.0).unwrap()])[0],
            3.0,
            max_relative = 1e-12
        );
        let qn = Process::quantization(2.0).unwrap();
        assert_relative_eq!(read(vec![qn])[0], 2.0, max_relative = 1e-12);
        let flicker = Process::flicker(4.0).unwrap();
        // The first scales lie above the line, of which nu = ln 2/π·B²; from m = 1 to 2 the slope is −0.16, too far off.
        let above = (2..=16)
            .map(|level| (ProcessKind::Flicker.haar_shape(0.0, level).0 * PI / LN_2).ln())
            .sum::<f64>()
            / 15.0;
        assert_relative_eq!(
            read(vec![flicker])[0],
            4.0 * above.exp(),
            max_relative = 1e-12
        );
        assert!(above < 0.015);
        let drift = Process::drift(0.1).unwrap();
        assert_relative_eq!(read(vec![drift])[0], 0.1, max_relative = 1e-12);
        let walk = Process::random_walk(0.5).unwrap();
        assert_relative_eq!(read(vec![walk])[0], 0.5, max_relative = 0.011);
    }

    /// The distance with the weights `edof`: a curve twice as high at one scale is half a variance off there, in deviations
    /// of √(2/eta).
    #[test]
    fn residuals_are_in_standard_deviations() {
        let mut off = curve(&Composite::new(vec![Process::white(3.0).unwrap()]));
        off.wv[15] *= 2.0;
        let fit = avlr(&off, &"WN".parse().unwrap()).unwrap();
        assert_relative_eq!(
            fit.residuals[15],
            0.5 / (2.0 / off.edof[15]).sqrt(),
            max_relative = 1e-12
        );
        assert!(
            fit.residuals[..15].iter().all(|r| r.abs() < 1e-9),
            "{:?}",
            fit.residuals
        );
    }

    /// White noise and a random walk that meet at m = 64 (sigma2/m = gamma2·m/3): where either has its slope
    /// to 0.15 the other is still (0.15/(1 − 0.15)) of it or less, and adds to it. So both are read high, by up
    /// to a tenth: the estimator is inconsistent, whatever the length.
    #[test]
    fn terms_together_are_read_high() {
        let gamma2 = 3.0 / 4096.0;
        let together = read(vec![
            Process::white(1.0).unwrap(),
            Process::random_walk(gamma2).unwrap(),
        ]);
        for (value, truth) in together.iter().zip([1.0, gamma2]) {
            let high = value / truth - 1.0;
            assert!(high > 0.005 && high < 0.176, "{high}");
        }
    }

    /// White noise with a dip at the tenth scale, to the slope −1 and back: no quantization noise. With enough of it
    /// (three parts in four of the first scale are 3Q²) there is.
    #[test]
    fn a_slope_further_on_is_no_quantization_noise() {
        let white = || Process::white(1.0).unwrap();
        let mut dipped = curve(&Composite::new(vec![white()]));
        dipped.wv[10] *= 0.5;
        let fit = avlr(&dipped, &"WN+QN".parse().unwrap()).unwrap();
        assert_eq!(fit.zero, [1]);
        let led = read(vec![white(), Process::quantization(40.0).unwrap()]);
        assert_relative_eq!(led[1], 40.0, max_relative = 0.15);
    }

    #[test]
    fn correlated_noise_has_no_slope() {
        let one = curve(&Composite::new(vec![Process::white(3.0).unwrap()]));
        let error = avlr(&one, &"WN+AR1".parse().unwrap()).unwrap_err();
        assert!(
            error.to_string().starts_with("AR1 has no slope of its own"),
            "{error}"
        );
    }
}
