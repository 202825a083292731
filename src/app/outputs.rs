//! Outputs of a command: claimed before its work, written whole after it.

use super::command::{Answer, Asked, Command, Out, OutputFile, beside};
use super::{Context, Failure, Input, Manifest, Result};
use crate::io::atomic::{self, AtomicDir, Claim, Found, claim_directory, claim_file};
use crate::io::input;
use crate::report::json;
use flate2::{Compression, write::GzEncoder};
use nav_sim_document::{Document, Form, encode};
use std::borrow::Cow;
use std::ffi::OsStr;
use std::io::Write;
use std::path::{Path, PathBuf};

/// Claims on all outputs of a command. Directories that were made for them and are empty go when this is dropped.
#[derive(Default)]
#[must_use = "another command may write there as soon as this is dropped"]
pub(crate) struct Claims {
    own: Vec<Claim>,
    missing: Vec<PathBuf>,
}

impl Claims {
    /// Notes directories of outputs that are not there yet, the outer ones first.
    fn note_missing<'a>(&mut self, outputs: impl Iterator<Item = &'a PathBuf>) {
        let above = |output: &'a PathBuf| output.ancestors().skip(1);
        let missing = outputs.flat_map(above).filter(|path| !path.exists());
        self.missing.extend(missing.map(Path::to_owned));
        self.missing.sort();
    }
}

impl Drop for Claims {
    fn drop(&mut self) {
        self.own.clear();
        // those with results in them stay
        let inner_first = self.missing.iter().rev();
        inner_first.for_each(|path| drop(std::fs::remove_dir(path)));
    }
}

const PAGE: &str = "report.html";
const MANIFEST: &str = "manifest.json";

impl<C: Command> Asked<C> {
    /// The manifest before the run: options, seed, contents of inputs.
    pub(crate) fn manifest(&self, seed: Option<u64>) -> Result<Manifest> {
        let fingerprint = |(role, path): &(&'static str, PathBuf)| input::input(role, path);
        let inputs = self.request.inputs()?;
        let inputs: Result<Vec<Input>> = inputs.iter().map(fingerprint).collect();
        let mut options = self.options.clone();
        options.extend(seed.map(|seed| ("seed".to_owned(), vec![seed.to_string()])));
        Ok(Manifest::new(C::NAME, options, inputs?))
    }

    /// Claims all outputs: none is an input, nothing is replaced that is not of this command, and nobody else writes
    /// there.
    pub(crate) fn claim(&self, manifest: &Manifest, force: bool) -> Result<Claims> {
        let inputs = || manifest.inputs.iter().map(|input| Path::new(&input.path));
        let mut claims = Claims::default();
        claims.note_missing(self.out.iter().chain(&self.plots));
        match (C::OUT, &self.out) {
            (Out::Directory { .. }, Some(out)) => {
                let names = self.request.output_names();
                let present = |text: &str| serde_json::from_str::<Manifest>(text).ok();
                let recognise = |text: &str| {
                    let there = present(text).filter(|there| there.name == C::NAME);
                    let Some(there) = there else {
                        return Found::Foreign;
                    };
                    let is_own = |name: &str| there.outputs.contains_key(name);
                    let mut others = names.iter().filter(|name| !is_own(name));
                    match others.any(|name| out.join(name.as_ref()).exists()) {
                        true => Found::Foreign,
                        false if there.key == manifest.key => Found::Same,
                        false => Found::Other,
                    }
                };
                let own = [PAGE, MANIFEST].map(Cow::Borrowed);
                let names = [&names[..], &own].concat();
                let claim = claim_directory(out, &names, inputs(), force, recognise)?;
                claims.own.push(claim);
            }
            (Out::File { .. }, Some(out)) => {
                self.request.check_out()?;
                let endings = self.request.endings();
                let is_new = !out.exists() && !out.to_string_lossy().ends_with('/');
                if endings.len() > 1 && (!is_new && !out.is_file() || out.as_os_str() == "-") {
                    let failure = Failure::input(format!("{} is not a file", out.display()));
                    return Err(failure.hint("name a file, such as model.toml"));
                }
                for ending in endings {
                    let claim = claim_file(&beside(out, &ending), inputs())?;
                    claims.own.push(claim);
                }
            }
            _ => {}
        }
        for path in &self.plots {
            if !is_page(path) {
                form(path)?;
            }
            claims.own.push(claim_file(path, inputs())?);
        }
        Ok(claims)
    }

    /// Writes files, pages and pictures; the manifest last. Returns what was written.
    pub(crate) fn write(
        &self,
        answer: &C::Answer,
        document: &Document,
        mut manifest: Manifest,
        context: &Context<'_>,
    ) -> Result<Vec<PathBuf>> {
        let mut written = Vec::new();
        match (C::OUT, &self.out) {
            (Out::Directory { .. }, Some(out)) => {
                let before = std::fs::read_to_string(out.join(MANIFEST)).unwrap_or_default();
                let before = serde_json::from_str::<Manifest>(&before).ok();
                let mut directory = AtomicDir::create(out)?;
                let give = |file: OutputFile<'_>| directory.write_parts(&file.name, file.parts);
                let page = C::PAGE.then_some(document);
                each_file(answer, page, &mut manifest, context, give)?;
                directory.commit()?;
                // files of an earlier result that this one does not have
                for old in before.iter().flat_map(|before| before.outputs.keys()) {
                    if !manifest.outputs.contains_key(old) {
                        drop(std::fs::remove_file(out.join(old)));
                    }
                }
                written.push(out.clone());
            }
            (Out::File { .. }, Some(out)) => {
                // All are on the disk before any has its name.
                let filled = answer.files().into_iter().map(|file| {
                    let path = beside(out, &file.name);
                    let text: String = file.parts.collect();
                    let bytes = packed(&path, text).map_err(|e| Failure::io(&path, e))?;
                    Ok((atomic::filled(&path, &bytes)?, path))
                });
                for (file, path) in filled.collect::<Result<Vec<_>>>()? {
                    file.commit()?;
                    written.push(path);
                }
            }
            _ => {}
        }
        for path in &self.plots {
            write_plot(path, document, answer.svg(document))?;
            written.push(path.clone());
        }
        Ok(written)
    }
}

/// Gives the files of a directory: those of the answer, the page, and the manifest, with the hashes of the first, last.
pub(super) fn each_file(
    answer: &impl Answer,
    page: Option<&Document>,
    manifest: &mut Manifest,
    context: &Context<'_>,
    mut give: impl FnMut(OutputFile<'_>) -> Result<()>,
) -> Result<()> {
    for OutputFile { name, parts } in answer.files() {
        let mut hasher = blake3::Hasher::new();
        let parts = parts.inspect(|part| _ = hasher.update(part.as_bytes()));
        give(OutputFile {
            name: name.as_ref().into(),
            parts: Box::new(parts),
        })?;
        let hash = hasher.finalize().to_hex().to_string();
        manifest.outputs.insert(name.into_owned(), hash);
    }
    manifest.seed = context.used_seed();
    manifest.wall_s = context.runs_s();
    manifest.threads = context.threads();
    if let serde_json::Value::Object(record) = answer.record() {
        manifest.record = record;
    }
    if let Some(page) = page {
        give(OutputFile::whole(PAGE, page.html()))?;
    }
    give(OutputFile::whole(MANIFEST, json(manifest)))
}

/// The bytes of a file: packed where its name ends in `.gz`.
fn packed(path: &Path, text: String) -> std::io::Result<Vec<u8>> {
    let is_packed = |ending: &OsStr| ending.eq_ignore_ascii_case("gz");
    if !path.extension().is_some_and(is_packed) {
        return Ok(text.into_bytes());
    }
    let mut packed = GzEncoder::new(Vec::new(), Compression::default());
    packed.write_all(text.as_bytes())?;
    packed.finish()
}

fn is_page(path: &Path) -> bool {
    path.extension()
        .is_some_and(|ending| ending.eq_ignore_ascii_case("html"))
}

/// The form of a picture, by its name.
fn form(path: &Path) -> Result<Form> {
    let (forms, hint) = match cfg!(feature = "pictures") {
        true => ("SVG or PNG", "name a file that ends in .svg or .png"),
        false => (
            "SVG",
            "name a file that ends in .svg; PNG needs a build with --features pictures",
        ),
    };
    let refused = || {
        Failure::input(format!(
            "{}: a picture is written as {forms}",
            path.display()
        ))
    };
    Form::of(path).ok_or_else(|| refused().hint(hint))
}

/// Writes a page, or figures in the form that the name says.
fn write_plot(path: &Path, document: &Document, svg: String) -> Result<()> {
    if is_page(path) {
        return atomic::write(path, document.html());
    }
    let picture = encode(svg, form(path)?).map_err(Failure::could_not)?;
    atomic::write(path, picture)
}
