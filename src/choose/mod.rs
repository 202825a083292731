//! The choice of the noise model for a filter, by the recordings themselves.
//!
//! One recording at a time is left out. Every [`Candidate`] is calibrated on the others and navigates on windows of the
//! one left out, whose errors are new to it; all candidates have the same windows and fixes. Candidates are judged by
//! the [`Score`] at the ends of outages, above all the mean log density of the true error under the filter's belief:
//! a proper score ([Gneiting and Raftery 2007](https://doi.org/10.1198/016214506000001437)), which a filter cannot
//! raise by claiming more, or less, than it knows. The recording is the unit of every interval, not the window:
//! windows of one recording share its noise. [`Ranking`] compares candidates pair by pair, recording by recording.

mod candidate;
mod document;
mod drive;
mod job;
mod laboratory;
mod ranking;
mod request;
mod score;

pub use candidate::{Candidate, Inflation};
pub use drive::{Drive, Fold};
pub use job::{ChoiceDrive, Chosen, choose};
pub use laboratory::{Laboratory, Unit};
pub use ranking::{Contender, Difference, FoldScore, Mean, Placed, Ranking};
pub use request::{ChoiceMade, Choose};
pub use score::{EndScore, Score};
