//! Fusion of recorded IMU and GNSS: request, solution, document.
//!
//! ```
//! use nav_sim::fuse::FuseRequest;
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! # let files = ["imu.csv", "gnss.csv", "model.toml"];
//! let request = FuseRequest { turn_on_bias: Some([0.3, 0.01]), ..FuseRequest::new(files[0], files[1], files[2]) };
//! match request.answer() {
//!     Ok(answer) => println!("{}", answer.document.verdict.lines[0]),
//!     Err(e) => println!("{e}"),
//! }
//! # Ok(())
//! # }
//! ```

mod charts;
mod document;
mod drive;
mod error;
mod failure;
mod files;
mod filter;
mod manifest;
mod request;
mod start;
mod summary;
mod vehicle;

use crate::answered::contents;
use crate::app::Answered;
use crate::app::Failure;

pub(crate) use drive::Drive;
pub use drive::{FuseAnswer, FuseNote};
pub use error::FuseError;
pub(crate) use files::{FILES, directory};
pub(crate) use manifest::FuseManifest;
pub use request::{FuseRequest, GnssSigma, LoggerAxes, MountingChoice};
pub use start::{StartChoice, TopicChoice};
pub use summary::{Cause, FuseSummary};
pub use vehicle::VehicleSummary;

/// Reads the files of a request and fuses them.
///
/// # Errors
/// A setting out of range, a file that cannot be used, data and settings that do not fit together.
pub fn fuse(request: &FuseRequest) -> Result<FuseAnswer, FuseError> {
    Drive::read(request)?.fuse()
}

impl FuseRequest {
    /// As `nav-sim fuse` prints and writes it.
    ///
    /// # Errors
    /// As [`fuse()`].
    pub fn answer(&self) -> Result<Answered, Failure> {
        let drive = Drive::read(self)?;
        let manifest = drive.manifest.clone();
        let answer = drive.fuse()?;
        let files = contents(directory(&answer, &manifest));
        Ok(Answered {
            files,
            unmet: answer.unmet(),
            ..Answered::of(&answer)
        })
    }
}
