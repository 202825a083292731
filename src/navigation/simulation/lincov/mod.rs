//! Linear covariance analysis: what a filter believes of its errors, and what they are, without random numbers.
//!
//! A filter's gains do not depend on the random numbers, except for the small effect of linearising about its own
//! estimate. One pass along the reference therefore gives its own covariance, and beside it the covariance
//! of the *true* error under the same gains: that of \[navigation error; the filter's bias estimates\] jointly
//! with the states of whatever makes the inertial errors ([Maybeck](crate::bibliography::Maybeck79), sec. 6.8).
//!
//! The trajectory is reduced once to a [`Track`]: exact maps of the navigation error over steps of a fraction
//! of a second. Any number of beliefs and truths are then assessed along it, in milliseconds each.

mod branch;
mod column;
mod descent;
mod errors;
mod heading;
mod honesty;
mod input;
mod joint;
mod mean;
mod pass;
mod reduce;
mod root;
mod sides;
mod track;
mod truth;
mod tune;

pub(crate) use branch::{Moments, errors_in_outages};
pub use heading::{HeadingDoubt, weak_heading};
pub use honesty::{Departure, DrawFactors, Honesty, UpperEnd};
pub use pass::{Assessment, Consistency, ErrorLaw, FilterPass, Instant, Judged, assess};
pub use reduce::{Alike, drive, reduced_belief};
pub(crate) use root::Crossing;
pub use track::Track;
pub use truth::{DRIFT, NamedSource, TrueErrors, TruthSide};
pub(crate) use tune::times;
pub use tune::{Aim, Factor, Filter, Per, Task, scaled};
