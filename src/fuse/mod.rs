//! `nav-sim fuse`: the filter on recorded data.

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

pub use drive::FuseAnswer;
pub use error::FuseError;
pub use request::{Fuse, GnssSigma, LoggerAxes, MountingChoice};
pub use start::{StartChoice, TopicChoice};
pub use summary::{Cause, FuseSummary};
pub use vehicle::VehicleSummary;

use crate::app::{Answer, Command, Context, Failure, Out, OutputFile, Result};
use drive::Drive;
use nav_sim_document::Document;
use nav_sim_navigation::metrics::VerdictKind;
use serde_json::json;
use std::path::PathBuf;

impl Command for Fuse {
    type Answer = FuseAnswer;
    const NAME: &'static str = "fuse";
    const OUT: Out = Out::Directory {
        path: "out/fuse",
        files: &files::FILES,
    };
    const PLOT: bool = false;

    fn inputs(&self) -> Result<Vec<(&'static str, PathBuf)>> {
        Ok(self
            .files()
            .map(|(role, path)| (role, path.clone()))
            .collect())
    }

    fn run(&self, context: &Context<'_>) -> Result<FuseAnswer> {
        let inputs = context.inputs().to_vec();
        Ok(Drive::read(self)?.fuse(inputs)?)
    }
}

impl Answer for FuseAnswer {
    fn document(&self) -> Document {
        self.page()
    }

    fn files(&self) -> Vec<OutputFile<'_>> {
        files::directory(self)
    }

    fn record(&self) -> serde_json::Value {
        json!({ "kind": "fusion", "configuration": self.configuration })
    }

    /// A filter that is not overconfident.
    fn unmet(&self) -> Option<Failure> {
        let is_overconfident = self.summary.verdict.kind == VerdictKind::Overconfident;
        is_overconfident
            .then(|| Failure::bound("the solution is overconfident").hint(self.advice()))
    }
}
