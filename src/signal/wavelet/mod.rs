//! Haar wavelet variance of recordings: classical, robust, intervals.
//!
//! Level j = 1, 2, … has scale tau = 2^j samples. Vectors over levels hold level j at index j − 1.
//!
//! ```
//! use nav_sim_signal::wavelet::classical;
//!
//! // Samples of ±1 in turn: neighbours differ by 2, the means of neighbouring pairs not at all.
//! let signal: Vec<f64> = (0..64).map(|k| if k % 2 == 0 { 1.0 } else { -1.0 }).collect();
//! assert_eq!(classical(&signal, 2)?, [1.0, 0.0]);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod gappy;
pub mod haar;
pub mod interval;
pub mod robust;

pub use gappy::{GappyVariances, gappy};
pub use haar::{Curve, classical};
pub use robust::{QuantizationResponse, RobustVariance, RootStatus, Tuning, classical_and_robust};

/// Reason that there is no wavelet variance.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum WaveletError {
    /// The last level has no coefficient.
    #[error(
        "{samples} samples are too few for {levels} scales: scale 2^{levels} needs {} samples (at most {} scales here)",
        1_u64.checked_shl(*levels).unwrap_or(u64::MAX), max_levels(*samples)
    )]
    TooShort {
        /// Samples in the signal.
        samples: usize,
        /// Levels requested.
        levels: u32,
    },
    /// No level requested.
    #[error("at least one scale is needed")]
    NoLevels,
    /// A sample is not a finite number.
    #[error("sample {index} is {value}")]
    NotFinite {
        /// Position, from 0.
        index: usize,
        /// The value.
        value: f64,
    },
    /// An efficiency without a tuning.
    #[error("efficiency {0} is out of range: between {low} and {high}", low = Tuning::EFFICIENCIES.0, high = Tuning::EFFICIENCIES.1)]
    Efficiency(f64),
}

/// The most levels that have a coefficient: floor(log2 T).
fn max_levels(samples: usize) -> u32 {
    samples.checked_ilog2().unwrap_or(0)
}

/// The usual number of levels: floor(log2 T) − 1, at least 1.
pub fn default_levels(samples: usize) -> u32 {
    // At the last level of all the record holds less than two lengths of the scale.
    max_levels(samples).saturating_sub(1).max(1)
}

/// M_j = T − 2^j + 1, the number of coefficients of a level (0 when the signal is too short).
pub fn coefficient_count(samples: usize, level: u32) -> usize {
    1_usize
        .checked_shl(level)
        .map_or(0, |tau| (samples + 1).saturating_sub(tau))
}

fn check_levels(signal: &[f64], levels: u32) -> Result<(), WaveletError> {
    if levels == 0 {
        return Err(WaveletError::NoLevels);
    }
    if coefficient_count(signal.len(), levels) == 0 {
        return Err(WaveletError::TooShort {
            samples: signal.len(),
            levels,
        });
    }
    match signal.iter().position(|x| !x.is_finite()) {
        None => Ok(()),
        Some(index) => Err(WaveletError::NotFinite {
            index,
            value: signal[index],
        }),
    }
}
