//! `nav-sim datasheet`: a datasheet's figures → a model file.

use super::pictures::claim_output;
use super::{Failure, Session};
use crate::datasheet::{DatasheetRequest, catalogue_json, catalogue_text};
use crate::formats::atomic::Written;
use crate::formats::model_file;
use std::path::PathBuf;

/// Make a noise model from the figures of a data sheet, in their own units: an assumption, not a calibration
///
/// The model has white noise of the given density, Gauss-Markov processes whose Allan deviation has the bias
/// instability as its minimum, and a random walk. [provenance] of the model file holds every figure as given and the
/// parameters that follow from it. Flags override the entry of the catalogue.
#[derive(clap::Args, Debug)]
#[command(before_help = "\
Examples:
  nav-sim datasheet --unit stim300 --rate-hz 100 -o stim300.toml
  nav-sim datasheet calib_data/catalogue/adis16470.toml --corr-time 100s -o adis16470.toml
  nav-sim datasheet --list")]
pub(crate) struct Args {
    #[command(flatten)]
    request: DatasheetRequest,
    /// List the catalogue
    #[arg(long)]
    list: bool,
    /// Model file to write (default: to stdout)
    #[arg(long, short, value_name = "FILE")]
    out: Option<PathBuf>,
}

pub(crate) fn run(args: &Args, session: &Session) -> Result<(), Failure> {
    if args.list {
        let listed = if session.json() {
            catalogue_json()?
        } else {
            catalogue_text()?
        };
        session.result(listed.trim_end());
        return Ok(());
    }
    let _own = claim_output(
        args.out.as_deref(),
        &args.request.entry,
        Written::Datasheet,
        session,
    )?;
    let made = args.request.model()?;
    session.warn_all(&made.doubts);
    made.notes.iter().for_each(|note| session.say(note));
    let Some(out) = &args.out else {
        let toml = model_file::to_toml(&made.file);
        session.result(&if session.json() {
            as_json(&toml)?
        } else {
            toml.trim_end().to_owned()
        });
        return Ok(());
    };
    model_file::write(out, &made.file)?;
    if session.json() {
        session.result(&as_json(&model_file::to_toml(&made.file))?);
    }
    session.say(format!(
        "wrote {}: an assumption, not a calibration",
        out.display()
    ));
    Ok(())
}

/// A model file with the same keys as JSON.
fn as_json(toml: &str) -> Result<String, Failure> {
    let table: toml::Table = toml.parse().map_err(Failure::could_not)?;
    serde_json::to_string_pretty(&table).map_err(Failure::could_not)
}
