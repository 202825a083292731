//! The reduction of a model, in words.

use super::reduction::{AxisReduction, ReductionSummary};
use crate::imu::Sensor;

/// From so many windows of correlation time on a bias is called a random walk: over a window `w` its variance grows by
/// `1 − exp(−w/T)`, which is linear to `w/2T`, half a per mille.
const WALK: f64 = 1000.0;

/// What a large departure of the wavelet variance means.
const WEIGHED_ELSEWHERE: &str = "a wavelet variance that is off matters only as far as the errors of navigation depend on that scale: what it costs, the \
     covariance analysis of the reduced filter says";

impl ReductionSummary {
    /// A line for the axes of a sensor that are reduced alike.
    #[must_use]
    pub fn lines(&self) -> Vec<String> {
        let describe = |name: &str, unit: &str, a: &AxisReduction| {
            let white = a.white_sigma2.sqrt();
            let (bias, departure) = (a.bias(unit, self.window_s), a.departure());
            format!("{name} reduced to white noise of {white:.3e} {unit} per sample and {bias} ({departure})")
        };
        let mut lines = Vec::new();
        for (sensor, axes) in Sensor::ALL.into_iter().zip(self.axes.chunks(3)) {
            let alike = |a: &AxisReduction, b: &AxisReduction| {
                (a.white_sigma2, a.bias_phi, a.bias_sigma2) == (b.white_sigma2, b.bias_phi, b.bias_sigma2)
            };
            for shown in axes.chunk_by(alike) {
                let names: Vec<&str> = shown.iter().map(|a| a.axis.as_str()).collect();
                let name = if names.len() == 3 { sensor.name().to_owned() } else { names.join(", ") };
                lines.push(describe(&name, sensor.unit(), &shown[0]));
            }
        }
        if self.axes.iter().any(AxisReduction::is_far) {
            lines.push(WEIGHED_ELSEWHERE.to_owned());
        }
        lines
    }
}

impl AxisReduction {
    /// The bias in words.
    fn bias(&self, unit: &str, window_s: f64) -> String {
        if self.bias_sigma == 0.0 {
            return "no bias".to_owned();
        }
        // A bias that keeps its value far beyond the window is known there by its steps alone.
        if self.bias_t_corr_s > WALK * window_s {
            let steps = self.bias_sigma * (2.0 / self.bias_t_corr_s).sqrt();
            return format!("one bias that is a random walk of {steps:.3e} {unit}/√s");
        }
        format!(
            "one bias of {:.3e} {unit}, correlation time {} s",
            self.bias_sigma,
            two_digits(self.bias_t_corr_s)
        )
    }

    /// How far the wavelet variance is from that of the model at most, and at which scale.
    fn departure(&self) -> String {
        let left_out = if self.quantization_left_out { "; quantization noise left out" } else { "" };
        if self.misfit == 0.0 {
            return format!("its wavelet variance is that of the model{left_out}");
        }
        let off = |(model, reduced): (&f64, &f64)| (reduced / model).ln().abs();
        let curves = self.tau_s.iter().zip(self.model_wv.iter().zip(&self.reduced_wv));
        let at_worst = |(tau_s, wv): (&f64, (&f64, &f64))| {
            (off(wv) == self.misfit).then(|| format!(", at a scale of {} s", two_digits(*tau_s)))
        };
        let place = curves.into_iter().find_map(at_worst).unwrap_or_default();
        let size = if self.is_far() {
            format!("up to {:.1} times off that of the model", self.misfit.exp())
        } else {
            format!("within {:.0} % of that of the model", 100.0 * self.misfit.exp_m1())
        };
        format!("its wavelet variance is {size}{place}{left_out}")
    }

    /// Beyond a factor of two a percentage says little, since it has no counterpart below.
    fn is_far(&self) -> bool {
        self.misfit > 2.0_f64.ln()
    }
}

/// A time (s): whole from ten seconds on, two digits below.
fn two_digits(t_s: f64) -> String {
    let decimals = if t_s < 9.95 && t_s > 0.0 { (1.0 - t_s.log10().floor()).max(0.0) as usize } else { 0 };
    format!("{t_s:.decimals$}")
}

#[cfg(test)]
mod tests {
    use super::super::reduction::tests::{model, summary};
    use super::*;
    use crate::noise::{Composite, Model, Process, RandomWalk, White};

    /// The steps of a walk of density K after one second are K.
    #[test]
    fn a_bias_beyond_any_window_is_said_to_be_a_random_walk() {
        let walk = RandomWalk::new(1e-12).unwrap();
        let axis = Composite::new(vec![Process::White(White::new(5e-5).unwrap()), Process::RandomWalk(walk)]);
        let lines = summary(&Model::pooled(100.0, &axis, &axis)).lines();
        assert!(lines[0].contains("one bias that is a random walk of 1.000e-5 m/s²/√s ("), "{lines:?}");
        let lines = summary(&model(0.0)).lines();
        assert!(lines[0].contains(", correlation time 20 s ("), "{lines:?}");
    }

    /// A wavelet variance of 8 where the model has 2 is off by a factor of 4, one of 3 by 50 %; a correlation time of a quarter
    /// of a second is not one of 0 s.
    #[test]
    fn departures_are_told_by_their_factor_and_short_times_by_two_digits() {
        let mut summary = summary(&model(0.0));
        let a = &mut summary.axes[0];
        (a.tau_s, a.model_wv, a.reduced_wv) = (vec![0.02, 40.96], vec![1.0, 2.0], vec![1.0, 8.0]);
        a.misfit = 4.0_f64.ln();
        a.bias_t_corr_s = 0.25;
        let lines = summary.lines();
        let words = [
            "correlation time 0.25 s (its wavelet variance is up to 4.0 times off that of the model, at a scale of 41 s; quant",
        ];
        assert!(words.iter().all(|words| lines[0].contains(words)), "{lines:?}");
        assert!(
            lines.last().unwrap().contains("matters only as far as the errors of navigation depend on"),
            "{lines:?}"
        );
        summary.axes[0].misfit = 1.5_f64.ln();
        summary.axes[0].reduced_wv[1] = 3.0;
        let lines = summary.lines();
        assert!(lines[0].contains("within 50 % of that of the model, at a scale of 41 s"), "{lines:?}");
        assert_eq!(lines.len(), 2);
        assert_eq!(
            [0.002_f64, 0.25, 1.0, 9.94, 9.96, 37.4].map(two_digits),
            ["0.0020", "0.25", "1.0", "9.9", "10", "37"]
        );
    }
}
