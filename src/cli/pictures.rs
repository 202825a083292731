//! Pictures and pages that commands write beside their results.

use super::{Failure, Session};
use crate::formats::atomic;
use crate::report::page::{self, Page};
use std::path::{Path, PathBuf};

/// The figures as a file.
#[derive(clap::Args, Debug)]
pub(super) struct PlotArgs {
    /// Also write the figures as a picture (.svg; a page saves each as PNG too)
    #[arg(long, value_name = "FILE.svg")]
    plot: Option<PathBuf>,
}

impl PlotArgs {
    /// Refuses a picture that is an input or cannot be made, or of another form.
    pub(super) fn guard(&self, inputs: &[PathBuf]) -> Result<(), Failure> {
        let Some(path) = &self.plot else { return Ok(()) };
        let svg = path.with_extension("svg");
        let form = path.extension().unwrap_or_default().to_string_lossy().to_lowercase();
        if form != "svg" {
            let message = format!("--plot {}: pictures are written as SVG", path.display());
            let (name, svg) = (path.display(), svg.display());
            return Err(Failure::input(message).hint(match form.as_str() {
                "png" | "pdf" => {
                    format!("--plot {svg}, then: rsvg-convert --format {form} --output {name} {svg}")
                }
                _ => "name a file that ends in .svg".to_owned(),
            }));
        }
        writable(path, inputs)
    }

    /// Writes the picture, if one is asked for.
    pub(super) fn write(&self, picture: impl FnOnce() -> String, session: &Session) -> Result<(), Failure> {
        write_asked(self.plot.as_deref(), picture, session)
    }
}

/// A page, and its figures as a file.
#[derive(clap::Args, Debug)]
pub(super) struct PageArgs {
    /// Write a page with figures
    #[arg(long, value_name = "FILE.html")]
    page: Option<PathBuf>,
    #[command(flatten)]
    plot: PlotArgs,
}

impl PageArgs {
    /// Refuses a page or a picture that is an input or cannot be made, and a picture of another form.
    pub(super) fn guard(&self, inputs: &[PathBuf]) -> Result<(), Failure> {
        self.page.iter().try_for_each(|page| writable(page, inputs))?;
        self.plot.guard(inputs)
    }

    /// Writes what is asked for.
    pub(super) fn write(&self, page: impl FnOnce() -> Page, session: &Session) -> Result<(), Failure> {
        if self.page.is_none() && self.plot.plot.is_none() {
            return Ok(());
        }
        let page = page();
        write_asked(self.page.as_deref(), || page.html(), session)?;
        self.plot.write(|| page.svg(), session)
    }
}

/// Whether a file can be made, found out before the work.
fn writable(path: &Path, inputs: &[PathBuf]) -> Result<(), Failure> {
    atomic::guard_inputs(path, inputs.iter().map(PathBuf::as_path))?;
    drop(atomic::AtomicFile::create(path)?);
    Ok(())
}

fn write_asked(
    path: Option<&Path>,
    contents: impl FnOnce() -> String,
    session: &Session,
) -> Result<(), Failure> {
    let Some(path) = path else { return Ok(()) };
    atomic::write_result(path, contents(), session.existing())?;
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
