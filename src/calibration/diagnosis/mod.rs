//! "My six recordings disagree: which do I use?" Each recording is compared with the others, over neighbouring scales
//! and the axes of a sensor, by the sampling distribution of the fitted model.
//!
//! There are three statistics: ln of the robust wavelet variance (does its noise differ?), ln of the ratio of the
//! classical to the robust one (are there outliers within it?), and the change of the level from the earlier to the
//! later half, in standard deviations of the fitted model (does it drift as no other does?). In the second the real
//! differences between recordings cancel, and what noise alone contributes is small: a classical variance of eta degrees of freedom being
//! efficient, its covariance with a robust one of efficiency e is its variance, so that of the ratio is
//! (1/e − 1) times it. Scales of which a drift of the fitted model makes more than 2 % are no evidence: there these laws do not hold.

mod comparison;
mod contrasts;
mod diagnose;

pub use contrasts::FEWEST as FEWEST_TO_COMPARE;
pub use diagnose::{Alarm, CommonCause, CommonFinding, Diagnosis, RecordingVerdict, diagnose};

#[cfg(test)]
mod tests;
