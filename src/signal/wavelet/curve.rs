//! A wavelet-variance curve: what a model is fitted to.

use super::QuantizationResponse;

/// Wavelet variance over scales, and how well it is known.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Curve {
    /// Levels, ascending; level j has scale 2^j samples.
    pub levels: Vec<u32>,
    /// Wavelet variance (units²).
    pub wv: Vec<f64>,
    /// Equivalent degrees of freedom.
    pub edof: Vec<f64>,
    /// How its variances read quantization noise, where they are robust; classical ones read it as it is.
    pub quantization: Option<QuantizationResponse>,
    /// Levels that count nothing in a fit: robust variances without an admissible root.
    pub ignored: Vec<u32>,
}

impl Curve {
    /// Variances that can be fitted (units²): their squares and quotients are numbers.
    pub const WV_RANGE: (f64, f64) = (1e-100, 1e100);
    /// Degrees of freedom that mean something.
    pub const EDOF_RANGE: (f64, f64) = (1e-15, 1e15);
}
