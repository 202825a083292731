//! Pictures and pages that commands write beside their results.

use super::{Failure, Session};
use crate::formats::atomic;
use crate::report::page;
use std::path::{Path, PathBuf};

/// The main figure as a file.
#[derive(clap::Args, Debug)]
pub(super) struct PlotArgs {
    /// Also write the main figure as a picture (.svg; a page saves its figures as PNG too)
    #[arg(long, value_name = "FILE.svg", value_parser = svg_path)]
    plot: Option<PathBuf>,
}

fn svg_path(text: &str) -> Result<PathBuf, String> {
    let path = PathBuf::from(text);
    let is_svg = path.extension().is_some_and(|e| e.eq_ignore_ascii_case("svg"));
    if is_svg { Ok(path) } else { Err("pictures are SVG: name a file that ends in .svg".to_owned()) }
}

impl PlotArgs {
    /// Refuses a picture that is an input.
    pub(super) fn guard(&self, inputs: &[PathBuf]) -> Result<(), Failure> {
        let guarded = |path: &PathBuf| atomic::guard_inputs(path, inputs.iter().map(PathBuf::as_path));
        Ok(self.plot.iter().try_for_each(guarded)?)
    }

    /// Writes the picture, if one is asked for.
    pub(super) fn write(&self, picture: impl FnOnce() -> String, session: &Session) -> Result<(), Failure> {
        let Some(path) = &self.plot else { return Ok(()) };
        atomic::write_result(path, picture(), session.existing())?;
        session.wrote(path);
        Ok(())
    }
}

/// Writes a page, if one is asked for.
pub(super) fn page(
    path: Option<&Path>,
    html: impl FnOnce() -> String,
    session: &Session,
) -> Result<(), Failure> {
    let Some(path) = path else { return Ok(()) };
    atomic::write_result(path, html(), session.existing())?;
    session.wrote(path);
    Ok(())
}

/// Refuses to replace a page of somebody else by one that nobody named.
pub(super) fn replaceable(path: &Path) -> Result<(), Failure> {
    match std::fs::read_to_string(path) {
        Ok(text) if !page::is_own(&text) => {
            let message =
                format!("{} is there and is no page of nav-sim: it is not replaced", path.display());
            Err(Failure::input(message).hint("move it away, or name another output"))
        }
        _ => Ok(()),
    }
}
