//! A wavelet-variance curve: what a model is fitted to.

use super::QuantizationResponse;

/// Wavelet variance over scales, with its degrees of freedom.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Curve {
    /// Levels, ascending; level j has scale 2^j samples.
    pub levels: Vec<u32>,
    /// Wavelet variance (units²).
    pub wv: Vec<f64>,
    /// Equivalent degrees of freedom.
    pub edof: Vec<f64>,
    /// Response of robust variances to quantization noise; none for classical ones, which read it as it is.
    pub quantization: Option<QuantizationResponse>,
    /// Variance of ln nu, at all scales alike, by which the curve of other recordings would differ beyond the degrees of
    /// freedom; 0 where it is not known.
    pub differing: f64,
    /// Levels of a robust curve whose variance is the classical one, which reads quantization noise as it is.
    pub classical: Vec<u32>,
    /// Levels without weight in a fit.
    pub ignored: Vec<u32>,
}

impl Curve {
    /// Variances that can be fitted (units²): their squares and quotients are numbers.
    pub const WV_RANGE: (f64, f64) = (1e-100, 1e100);
    /// Degrees of freedom that are accepted.
    pub const EDOF_RANGE: (f64, f64) = (1e-15, 1e15);

    /// Response to quantization noise at a level; none where it is read as it is.
    #[must_use]
    pub fn response(&self, level: u32) -> Option<&QuantizationResponse> {
        self.quantization
            .as_ref()
            .filter(|_| !self.classical.contains(&level))
    }
}
