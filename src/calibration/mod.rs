//! From replicate recordings to one noise model: AWV, SR-AWV, DR-AWV, GMWM.
//!
//! [`average()`] makes one curve of the replicates' wavelet variances, [`fit()`] finds the model whose
//! theoretical wavelet variance is nearest to it.

mod average;
mod bounded;
mod fit;
mod objective;
mod optimise;
mod search;
mod spec;

pub use average::{AverageError, Estimator, Replicate, Trim, average};
pub use fit::{Fit, FitError, fit};
pub use objective::Weighting;
pub use optimise::Termination;
pub use spec::{Kind, ModelSpec, SpecError};
