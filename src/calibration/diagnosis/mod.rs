//! "My six recordings disagree: which do I use?" Each recording against the others, over neighbouring scales
//! and the axes of a sensor, by the sampling law of the model that was fitted; and what leaving it out does.
//!
//! Three things are looked at: ln of the robust wavelet variance (is its noise another?), and ln of the
//! classical over the robust one (are there outliers within it?), and the change of the level from its earlier to its later
//! half, in standard deviations of the fitted model (does it drift as no other does?). In the second what recordings honestly differ by
//! cancels, and what noise alone makes is small: a classical variance of eta degrees of freedom being
//! efficient, its covariance with a robust one of efficiency e is its variance, so that of the ratio is
//! (1/e − 1) times it.

mod alarm;
mod common;
mod comparison;
mod contrasts;
mod diagnose;
mod leave_out;
mod piece;
mod result;

pub use common::{CommonOutliers, GaussianQuantization};
pub use diagnose::diagnose;
pub use leave_out::{LeftOut, Movement};
pub use result::{Alarm, AxisScores, Diagnosis, Differing, DriftAlarm, Misfit, Verdict};

#[cfg(test)]
mod tests;
