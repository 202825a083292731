//! A wavelet-variance curve: what a model is fitted to.

/// Wavelet variance over scales, and how well it is known.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Curve {
    /// Levels, ascending; level j has scale 2^j samples.
    pub levels: Vec<u32>,
    /// Wavelet variance (units²).
    pub wv: Vec<f64>,
    /// Equivalent degrees of freedom.
    pub edof: Vec<f64>,
}
