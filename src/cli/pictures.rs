//! Pictures and pages that commands write beside their results.

use super::{Failure, Session};
use crate::formats::atomic::{self, Claim, Written};
use crate::report::page::{self, Form};
use nav_sim_document::Document;
use std::path::{Path, PathBuf};

/// The figures as a file.
#[derive(clap::Args, Debug)]
pub(super) struct PlotArgs {
    /// Also write the figures as a picture: .svg (.png with the feature `pictures`)
    #[arg(long, value_name = "FILE")]
    plot: Option<PathBuf>,
}

impl PlotArgs {
    /// Claims the picture; refuses one that is an input or cannot be made, or of another form.
    pub(super) fn claim(
        &self,
        inputs: impl IntoIterator<Item: AsRef<Path>>,
        session: &Session,
    ) -> Result<Option<Claim>, Failure> {
        self.plot.as_deref().map(|path| claim_picture(path, inputs, session)).transpose()
    }

    /// Writes the picture, if one is asked for.
    pub(super) fn write(&self, picture: impl FnOnce() -> String, session: &Session) -> Result<(), Failure> {
        if let Some(path) = &self.plot {
            write_picture(path, picture())?;
            session.wrote(path);
        }
        Ok(())
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
    /// Claims page and picture; refuses what is an input or cannot be made, and a picture of another form.
    pub(super) fn claim(
        &self,
        inputs: impl IntoIterator<Item: AsRef<Path>> + Clone,
        session: &Session,
    ) -> Result<[Option<Claim>; 2], Failure> {
        let page = claim_output(self.page.as_deref(), inputs.clone(), Written::Page, session)?;
        Ok([page, self.plot.claim(inputs, session)?])
    }

    /// Writes what is asked for of a document.
    pub(super) fn draw(&self, document: &Document, session: &Session) -> Result<(), Failure> {
        let written = self.page.iter().try_for_each(|path| session.write(path, document.html()));
        self.plot.write(|| document.svg(), session).and(written)
    }
}

/// Claims a picture before the work; refuses one of another form.
pub(super) fn claim_picture(
    path: &Path,
    inputs: impl IntoIterator<Item: AsRef<Path>>,
    session: &Session,
) -> Result<Claim, Failure> {
    let kind = if form(path)? == Form::Svg { Written::Svg } else { Written::Png };
    claim_own(path, inputs, kind, session)
}

fn claim_own(
    path: &Path,
    inputs: impl IntoIterator<Item: AsRef<Path>>,
    kind: Written,
    session: &Session,
) -> Result<Claim, Failure> {
    let inputs: Vec<_> = inputs.into_iter().collect();
    Ok(atomic::claim_result(path, inputs.iter().map(AsRef::as_ref), kind, session.existing())?)
}

/// Claims an output of that kind, if one is asked for.
pub(super) fn claim_output(
    path: Option<&Path>,
    inputs: impl IntoIterator<Item: AsRef<Path>>,
    kind: Written,
    session: &Session,
) -> Result<Option<Claim>, Failure> {
    path.map(|path| claim_own(path, inputs, kind, session)).transpose()
}

/// The form of a picture, by its name.
fn form(path: &Path) -> Result<Form, Failure> {
    let (forms, hint) = if cfg!(feature = "pictures") {
        ("SVG or PNG", "name a file that ends in .svg or .png")
    } else {
        ("SVG", "name a file that ends in .svg; PNG needs a build with --features pictures")
    };
    let refused = || Failure::input(format!("{}: a picture is written as {forms}", path.display()));
    Form::of(path).ok_or_else(|| refused().hint(hint))
}

/// Writes a picture in the form that its name says.
pub(super) fn write_picture(path: &Path, svg: String) -> Result<(), Failure> {
    let picture = page::encode(svg, form(path)?).map_err(Failure::could_not)?;
    Ok(atomic::write(path, picture)?)
}
