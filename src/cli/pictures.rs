//! Pictures and pages that commands write beside their results.

use super::{Failure, Session};
use crate::formats::atomic::{self, Claim, Written};
use crate::report::page::{self, Form};
use nav_sim_document::Document;
use std::path::{Path, PathBuf};

/// Files that show a result.
#[derive(clap::Args, Debug)]
pub(super) struct PlotArgs {
    /// Also write the page (.html) or its figures (.svg; .png with the feature `pictures`) (repeatable)
    #[arg(long = "plot", value_name = "FILE")]
    plots: Vec<PathBuf>,
}

impl PlotArgs {
    /// Claims the files; refuses what is an input or cannot be made, or has another ending.
    pub(super) fn claim(
        &self,
        inputs: impl IntoIterator<Item: AsRef<Path>> + Clone,
        session: &Session,
    ) -> Result<Vec<Claim>, Failure> {
        self.plots
            .iter()
            .map(|path| claim_picture(path, inputs.clone(), session))
            .collect()
    }

    /// Writes what is asked for of a document.
    pub(super) fn draw(&self, document: &Document, session: &Session) -> Result<(), Failure> {
        self.write(document, || document.svg(), session)
    }

    /// The same with figures of its own.
    pub(super) fn write(
        &self,
        document: &Document,
        figures: impl Fn() -> String,
        session: &Session,
    ) -> Result<(), Failure> {
        self.plots.iter().try_for_each(|path| {
            match is_page(path) {
                true => atomic::write(path, document.html())?,
                false => write_picture(path, figures())?,
            }
            session.wrote(path);
            Ok(())
        })
    }
}

fn is_page(path: &Path) -> bool {
    path.extension()
        .is_some_and(|ending| ending.eq_ignore_ascii_case("html"))
}

/// Claims a page or a picture before the work; refuses one of another form.
fn claim_picture(
    path: &Path,
    inputs: impl IntoIterator<Item: AsRef<Path>>,
    session: &Session,
) -> Result<Claim, Failure> {
    let kind = match is_page(path) {
        true => Written::Page,
        false if form(path)? == Form::Svg => Written::Svg,
        false => Written::Png,
    };
    claim_own(path, inputs, kind, session)
}

fn claim_own(
    path: &Path,
    inputs: impl IntoIterator<Item: AsRef<Path>>,
    kind: Written,
    session: &Session,
) -> Result<Claim, Failure> {
    let inputs: Vec<_> = inputs.into_iter().collect();
    Ok(atomic::claim_result(
        path,
        inputs.iter().map(AsRef::as_ref),
        kind,
        session.existing(),
    )?)
}

/// Claims an output of that kind, if one is asked for.
pub(super) fn claim_output(
    path: Option<&Path>,
    inputs: impl IntoIterator<Item: AsRef<Path>>,
    kind: Written,
    session: &Session,
) -> Result<Option<Claim>, Failure> {
    path.map(|path| claim_own(path, inputs, kind, session))
        .transpose()
}

/// The form of a picture, by its name.
fn form(path: &Path) -> Result<Form, Failure> {
    let (forms, hint) = if cfg!(feature = "pictures") {
        ("SVG or PNG", "name a file that ends in .svg or .png")
    } else {
        (
            "SVG",
            "name a file that ends in .svg; PNG needs a build with --features pictures",
        )
    };
    let refused = || {
        Failure::input(format!(
            "{}: a picture is written as {forms}",
            path.display()
        ))
    };
    Form::of(path).ok_or_else(|| refused().hint(hint))
}

/// Writes a picture in the form that its name says.
fn write_picture(path: &Path, svg: String) -> Result<(), Failure> {
    let picture = page::encode(svg, form(path)?).map_err(Failure::could_not)?;
    Ok(atomic::write(path, picture)?)
}
