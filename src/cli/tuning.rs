//! Flags of the robust wavelet variance.

use super::Failure;
use super::parse::words;
use nav_sim_signal::wavelet::{Convention, Tuning};

/// How the robust wavelet variance is tuned.
#[derive(clap::Args, Debug)]
#[command(next_help_heading = "Wavelet variance")]
pub(crate) struct TuningArgs {
    /// Efficiency of the robust wavelet variance at the Gaussian model, 0.3 to 0.99
    #[arg(long, value_name = "E", default_value_t = Tuning::DEFAULT_EFFICIENCY)]
    efficiency: f64,
    /// How the tuning constant follows from the efficiency
    #[arg(long, value_parser = words::<Convention>(CONVENTIONS), default_value_t)]
    efficiency_convention: Convention,
    /// Number of scales, 2, 4, 8, … samples (default: of each signal one less than its length allows)
    #[arg(long, value_name = "J", value_parser = clap::value_parser!(u32).range(1..=62))]
    pub(crate) scales: Option<u32>,
}

const CONVENTIONS: &[(&str, &str)] = &[
    ("exact", "From the definition"),
    (
        "wv",
        "As the R packages wv, gmwm and simts do (a sign error: their 0.6 is 0.727), to reproduce their numbers",
    ),
];

impl TuningArgs {
    pub(crate) fn tuning(&self) -> Result<Tuning, Failure> {
        Tuning::new(self.efficiency, self.efficiency_convention)
            .map_err(|e| Failure::input(format!("--efficiency: {e}")))
    }

    /// Name of the convention in files.
    pub(crate) const fn convention(&self) -> &'static str {
        self.efficiency_convention.name()
    }
}
