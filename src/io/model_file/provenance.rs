//! Remarks of a calibration in the provenance of its model.

use super::ModelFile;
use crate::report::readable;
use nav_sim_calibration::duration;
use std::fmt;
use toml::{Table, Value};

/// What is known of a JSON object, as a table: TOML has no null.
pub(crate) fn known(json: serde_json::Value) -> Table {
    let mut fields = json.as_object().cloned().unwrap_or_default();
    fields.retain(|_, value| !value.is_null());
    Table::try_from(fields).expect("texts and numbers are always TOML")
}

/// Disagreement of a model with the recordings that it was fitted to, as its provenance has it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Misfit {
    /// Probability of the J-test, if it was made.
    pub p_value: Option<f64>,
    /// Wavelet variance of the data over that of the model where it is furthest from 1, and that scale (s).
    pub worst: Option<(f64, f64)>,
}

impl fmt::Display for Misfit {
    /// `does not fit its recordings (p = 0.005, data/model 0.33 at 0.02 s)`
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let p = self.p_value.map(|p| format!("p = {p:.3}"));
        let worst = self
            .worst
            .map(|(ratio, tau_s)| format!("data/model {} at {}", readable(ratio), duration(tau_s)));
        let figures: Vec<String> = p.into_iter().chain(worst).collect();
        write!(f, "does not fit its recordings ({})", figures.join(", "))
    }
}

impl ModelFile {
    /// The estimator that made the model, if known.
    pub(crate) fn estimator(&self) -> Option<String> {
        let estimator = self.provenance.as_ref()?.get("estimator")?;
        estimator.as_str().map(str::to_owned)
    }

    /// The worst disagreement of the model with its recordings, where a fit of it does not describe them.
    #[must_use]
    pub fn misfit(&self) -> Option<Misfit> {
        let fits = self.provenance.as_ref()?.get("fits")?.as_array()?;
        let of_fit = |fit: &Value| {
            let number = |key| fit.get(key).and_then(Value::as_float);
            let (p_value, ratio) = (number("j_p_value"), number("worst_ratio"));
            let is_missed = ratio.is_some() || p_value.is_some_and(|p| p < 0.05);
            is_missed.then(|| Misfit {
                p_value,
                worst: ratio.zip(number("worst_tau_s")),
            })
        };
        let size = |m: &Misfit| m.worst.map_or(0.0, |(ratio, _)| ratio.ln().abs());
        fits.iter()
            .filter_map(of_fit)
            .max_by(|a, b| size(a).total_cmp(&size(b)))
    }

    /// The largest whole number of that name that the provenance has of a fit.
    fn most_of_fits(&self, key: &str) -> Option<i64> {
        let fits = self.provenance.as_ref()?.get("fits")?.as_array()?;
        fits.iter()
            .filter_map(|fit| fit.get(key)?.as_integer())
            .max()
    }

    /// The longest averaging time (s) that the calibration saw: half its longest scale.
    pub(crate) fn observed_s(&self) -> Option<f64> {
        let scales = self
            .most_of_fits("scales")
            .filter(|n| (1..63).contains(n))?;
        Some((scales as f64 - 1.0).exp2() / self.model.rate_hz)
    }
}
