//! Flags of the wavelet variances and their robust tuning.

use super::Failure;
use nav_sim_calibration::FitRange;
use nav_sim_signal::wavelet::{Convention, Tuning};

/// How wavelet variances are taken.
#[derive(clap::Args, Debug)]
#[command(next_help_heading = "Wavelet variance")]
pub(crate) struct TuningArgs {
    /// Efficiency of the robust wavelet variance at the Gaussian model, 0.3 to 0.99
    #[arg(long, value_name = "E", default_value_t = Tuning::DEFAULT_EFFICIENCY)]
    efficiency: f64,
    /// Number of scales, 2, 4, 8, … samples (default: of each signal one less than its length allows); or those that are
    /// fitted, such as 1s:1000s
    #[arg(long, value_name = "J|FROM:TO", value_parser = scales)]
    scales: Option<Scales>,
}

/// Scales that are asked for.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Scales {
    /// The first ones.
    Count(u32),
    /// All, of which these are fitted.
    Fitted(FitRange),
}

fn scales(text: &str) -> Result<Scales, String> {
    if !text.contains(':') {
        let count = text.parse().ok().filter(|count| (1..=62).contains(count));
        return count
            .map(Scales::Count)
            .ok_or_else(|| "not a number from 1 to 62, nor a range such as 1s:1000s".into());
    }
    let (from_s, to_s) = super::parse::seconds_range(text)?;
    if from_s >= to_s {
        return Err("the shorter scale comes first".into());
    }
    Ok(Scales::Fitted(FitRange { from_s, to_s }))
}

impl TuningArgs {
    pub(crate) fn tuning(&self) -> Result<Tuning, Failure> {
        Tuning::new(self.efficiency, Convention::Exact)
            .map_err(|e| Failure::input(format!("--efficiency: {e}")))
    }

    /// Number of scales, if it is given.
    pub(crate) fn levels(&self) -> Option<u32> {
        if let Some(Scales::Count(count)) = self.scales { Some(count) } else { None }
    }

    /// The scales that are fitted, if they are given.
    pub(crate) fn fitted(&self) -> Option<FitRange> {
        if let Some(Scales::Fitted(range)) = self.scales { Some(range) } else { None }
    }
}
