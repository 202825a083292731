//! The choice of the noise model for a filter, by the recordings themselves.
//!
//! One recording at a time is left out. Every [`Candidate`] is calibrated on the others and navigates on windows of the
//! one left out, whose errors are new to it; all candidates have the same windows and fixes. Candidates are judged by
//! the [`Score`] at the ends of outages, above all the mean log density of the true error under the filter's belief:
//! a proper score ([Gneiting and Raftery 2007](https://doi.org/10.1198/016214506000001437)), which a filter cannot
//! raise by claiming more, or less, than it knows. The recording is the unit of every interval, not the window:
//! windows of one recording share its noise. [`Ranking`] compares candidates pair by pair, recording by recording.
//!
//! ```
//! use nav_sim::choose::{Candidate, Drive, Laboratory, Unit};
//! use nav_sim::calibration::{Settings, replicates};
//! use nav_sim::signal::imu::Channel;
//! use nav_sim::signal::noise::{Composite, Model, Process, VirtualImu, White};
//! use nav_sim::prelude::*;
//!
//! let white = Composite::new(vec![Process::White(White::new(1e-6)?)]);
//! let model = Model::pooled(100.0, &white, &white);
//! let imu = VirtualImu { model: &model, spread: None, contamination: None, seed: 1 };
//! let recordings =
//!     (1..=4).map(|k| imu.recording(k, &Channel::ALL, 20_000)).collect::<Result<Vec<_>, _>>()?;
//! let settings = Settings { rate_hz: 100.0, ..Settings::default() };
//! let unit = |r: &nav_sim::signal::imu::Recording| {
//!     Ok::<_, Box<dyn std::error::Error>>(Unit { name: r.name.clone(), replicates: replicates(r, Some(10), &settings.tuning)? })
//! };
//! let units = recordings.iter().map(unit).collect::<Result<Vec<_>, _>>()?;
//! let laboratory = Laboratory::new(units, settings, None);
//!
//! let (trajectory, _) = load_trajectory("trajectories/figure_eight.toml".as_ref(), &TrajectoryOptions::default())?;
//! let drive = Drive::new(&trajectory, Scenario::default(), vec![Outage { start_s: 60.0, end_s: 90.0 }], 100.0, 1)?;
//! let candidates = [Candidate::new(Estimator::Awv, "WN".parse()?), Candidate::new(Estimator::Awv, "WN+RW".parse()?)];
//! let fold = drive.leave_out(&laboratory, 0, &recordings[..1], &candidates, 8, &|_| ())?;
//! assert!(fold.scores[0].rmse_m < 5.0);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod candidate;
mod document;
mod drive;
mod failure;
mod files;
mod influence;
mod job;
mod laboratory;
mod ranking;
mod request;
mod score;

pub use candidate::{Candidate, Inflation};
pub(crate) use document::{ChoiceReport, RankedPlace};
pub use drive::{ChoiceError, Drive, Fold};
pub(crate) use files::claim_choice;
pub use influence::{Influence, RecordingInfluence, ScaleInfluence};
pub use job::{ChoiceDrive, Chosen, choose};
pub use laboratory::{Laboratory, Unit};
pub use ranking::{Contender, Difference, FoldScore, Mean, Placed, Ranking};
pub use request::ChoiceRequest;
pub use score::{EndScore, Score};
