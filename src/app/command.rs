//! A command is a struct of options with inputs and an answer. Words of a command line and requests by name (Python,
//! studies) become it by the same parser, so that both are refused in the same words.

use super::{Context, Failure, Input, IntoFailure, Reporter, Result, refused};
use crate::io::atomic::{AtomicDir, DirectoryState, OutputClaim, claim_directory, claim_file};
use crate::io::{atomic, beside, input, suggest};
use crate::parse;
use crate::report::json;
use clap::builder::ValueParser;
use clap::parser::ValueSource;
use clap::{Arg, ArgAction, ArgMatches, FromArgMatches};
use flate2::Compression;
use flate2::write::GzEncoder;
use nav_sim_document::{Document, FORMS, encode};
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value, json};
use std::any::TypeId;
use std::borrow::Cow;
use std::collections::BTreeMap;
use std::ffi::{OsStr, OsString};
use std::io::Write;
use std::path::{Path, PathBuf};

/// Output of a command: none, a file or a directory.
#[derive(Debug, Clone, Copy)]
pub enum OutputKind {
    /// To stdout alone.
    Nothing,
    /// To a file, and files with other endings beside it.
    File {
        /// Its name where none is given.
        name: &'static str,
        /// Help of `--out`.
        help: &'static str,
    },
    /// To a directory with a page and a manifest.
    Directory {
        /// Its path where none is given.
        path: &'static str,
        /// Names of the files that may be written, without page and manifest.
        files: &'static [&'static str],
    },
}

/// Files that a command reads, by their roles.
pub type Inputs = Vec<(String, PathBuf)>;

/// A command: options, inputs, answer.
pub trait Command: clap::Args + Send + Sync + 'static {
    /// Its answer.
    type Answer: Answer;
    /// Its name on the command line.
    const NAME: &'static str;
    /// Its output.
    const OUT: OutputKind = OutputKind::Nothing;
    /// True if its document can be written as a page or a picture.
    const PLOT: bool = true;
    /// True if a page stands in its directory.
    const PAGE: bool = true;
    /// True if the file goes to stdout where `--out` is not given.
    const PRINTS_FILE: bool = false;
    /// Options that do not change the result, such as `--require`.
    const JUDGES: &'static [&'static str] = &[];

    /// Every file that is read, by its role: those of its path arguments, which have the role of their names.
    ///
    /// # Errors
    /// When options do not fit together.
    fn inputs(&self, given: Inputs) -> Result<Inputs> {
        Ok(given)
    }

    /// Reads the files and answers; writes nothing.
    ///
    /// # Errors
    /// A file or a setting is wrong, or there is no answer.
    fn run(&self, context: &Context<'_>) -> Result<Self::Answer>;

    /// True if a file is written where `--out` is not given.
    fn writes_by_default(&self) -> bool {
        false
    }

    /// Refuses `--out` where the request has nothing to write.
    ///
    /// # Errors
    /// Refusal to write.
    fn check_out(&self) -> Result<()> {
        Ok(())
    }

    /// Names of the files of [`OutputKind::Directory`].
    fn output_names(&self) -> Vec<Cow<'static, str>> {
        match Self::OUT {
            OutputKind::Directory { files, .. } => {
                files.iter().map(|name| (*name).into()).collect()
            }
            _ => Vec::new(),
        }
    }

    /// Endings of the files beside [`OutputKind::File`], itself included: "" is the file itself.
    fn endings(&self) -> Vec<Cow<'static, str>> {
        vec!["".into()]
    }
}

/// The answer of a command. As JSON it is itself.
pub trait Answer: Serialize {
    /// Verdict, tables, charts and notes.
    fn document(&self) -> Document;

    /// The text for stdout, where it is not the document.
    fn text(&self) -> Option<String> {
        None
    }

    /// The files to be written; of [`OutputKind::File`] their names are endings.
    fn files(&self) -> Vec<OutputFile<'_>> {
        Vec::new()
    }

    /// Facts for the manifest beside options and inputs.
    fn record(&self) -> Value {
        json!({})
    }

    /// The bound that is not met (exit code 3), if there is one.
    fn unmet(&self) -> Option<Failure> {
        None
    }
}

/// An answer whose JSON, document and files are made with it.
#[derive(Debug, Serialize)]
#[serde(transparent)]
pub struct PlainAnswer {
    json: Value,
    #[serde(skip)]
    document: Document,
    #[serde(skip)]
    files: Vec<(String, String)>,
    #[serde(skip)]
    text: Option<String>,
    #[serde(skip)]
    unmet: Option<Failure>,
}

impl PlainAnswer {
    pub(crate) fn new(json: Value, document: Document) -> Self {
        Self {
            json,
            document,
            files: Vec::new(),
            text: None,
            unmet: None,
        }
    }

    /// The answer with its JSON as its file and a page beside it; `text` for stdout, where it is not the document.
    pub(crate) fn with_page(self, text: Option<String>) -> Self {
        let files = [("", json(&self)), (".html", self.document.html())];
        Self {
            text,
            ..self.with(files)
        }
    }

    /// The answer with files: names or endings, and texts.
    pub(crate) fn with<N: Into<String>>(
        self,
        files: impl IntoIterator<Item = (N, String)>,
    ) -> Self {
        let files = files.into_iter().map(|(name, text)| (name.into(), text));
        Self {
            files: files.collect(),
            ..self
        }
    }

    /// The answer with a limit that is not met, if there is one.
    pub(crate) fn with_unmet(self, unmet: Option<Failure>) -> Self {
        Self { unmet, ..self }
    }
}

impl Answer for PlainAnswer {
    fn document(&self) -> Document {
        self.document.clone()
    }

    fn text(&self) -> Option<String> {
        self.text.clone()
    }

    fn files(&self) -> Vec<OutputFile<'_>> {
        let files = self.files.iter();
        files
            .map(|(name, text)| OutputFile::whole(name, text.clone()))
            .collect()
    }

    fn unmet(&self) -> Option<Failure> {
        self.unmet.clone()
    }
}

/// A file to be written.
pub struct OutputFile<'a> {
    /// Name in the directory, or ending.
    pub name: Cow<'a, str>,
    /// Its text, part by part: the table of many runs is never whole in memory.
    pub parts: Box<dyn Iterator<Item = String> + 'a>,
}

impl<'a> OutputFile<'a> {
    /// A small file.
    pub(crate) fn whole(name: impl Into<Cow<'a, str>>, text: String) -> Self {
        Self {
            name: name.into(),
            parts: Box::new(std::iter::once(text)),
        }
    }
}

/// A command with the options of its outputs.
#[derive(Debug, Clone)]
pub struct Invocation<C> {
    /// The command.
    pub request: C,
    /// `--out`, or its default.
    pub(crate) out: Option<PathBuf>,
    /// `--plot`.
    plots: Vec<PathBuf>,
    /// Options that decide the result, without paths of files.
    pub(crate) options: BTreeMap<String, Vec<String>>,
    paths: Vec<(String, PathBuf)>,
}

const OUT: &str = "out";
const PLOT: &str = "plot";

impl<C: Command> clap::Args for Invocation<C> {
    fn augment_args(command: clap::Command) -> clap::Command {
        let mut command = C::augment_args(command);
        let path = || {
            Arg::new(OUT)
                .long(OUT)
                .short('o')
                .value_parser(ValueParser::path_buf())
        };
        match C::OUT {
            OutputKind::Nothing => {}
            OutputKind::File { help, .. } => {
                command = command.arg(path().value_name("FILE").help(help))
            }
            OutputKind::Directory { path: default, .. } => {
                let out = path().value_name("DIR").default_value(default);
                command = command.arg(out.help("Directory to make"));
            }
        }
        if C::PLOT {
            let plot = Arg::new(PLOT)
                .long(PLOT)
                .value_name("FILE")
                .action(ArgAction::Append);
            let plot = plot.value_parser(ValueParser::path_buf());
            command = command.arg(plot.help(
                "Also write a page (.html) or its figures (.svg; .png with feature `pictures`) (repeatable)",
            ));
        }
        command
    }

    fn augment_args_for_update(command: clap::Command) -> clap::Command {
        Self::augment_args(command)
    }
}

impl<C: Command> FromArgMatches for Invocation<C> {
    fn from_arg_matches(matches: &ArgMatches) -> std::result::Result<Self, clap::Error> {
        let paths = |id| {
            let found = matches.try_get_many::<PathBuf>(id).ok().flatten();
            found.into_iter().flatten().cloned().collect::<Vec<_>>()
        };
        let request = C::from_arg_matches(matches)?;
        let arguments = C::augment_args(clap::Command::new(C::NAME));
        let own = arguments.get_arguments().filter(|arg| is_path(arg));
        let named = own.map(|arg| arg.get_id().as_str());
        let of_argument = |id| {
            paths(id)
                .into_iter()
                .map(move |path| (str::to_owned(id), path))
        };
        let by_default = match C::OUT {
            OutputKind::File { name, .. } if request.writes_by_default() => Some(name.into()),
            _ => None,
        };
        Ok(Self {
            out: paths(OUT).pop().or(by_default),
            plots: paths(PLOT),
            options: options::<C>(matches),
            paths: named.flat_map(of_argument).collect(),
            request,
        })
    }

    fn update_from_arg_matches(
        &mut self,
        matches: &ArgMatches,
    ) -> std::result::Result<(), clap::Error> {
        *self = Self::from_arg_matches(matches)?;
        Ok(())
    }
}

/// Options that decide the result, without those that are files, and without defaults: a later version that knows one option
/// more recognises the results of this one.
fn options<C: Command>(matches: &ArgMatches) -> BTreeMap<String, Vec<String>> {
    let command = C::augment_args(clap::Command::new(C::NAME));
    let deciding = command
        .get_arguments()
        .filter(|arg| !is_path(arg) && !C::JUDGES.contains(&arg.get_id().as_str()));
    let values = |arg: &Arg| {
        let id = arg.get_id().as_str();
        let raw = matches.try_get_raw(id).ok().flatten()?;
        let canonical = |value: &OsStr| canonical(&value.to_string_lossy());
        let given: Vec<String> = raw.map(canonical).collect();
        let defaults = arg.get_default_values().iter();
        let is_given = matches.value_source(id) == Some(ValueSource::CommandLine)
            && !defaults.map(|value| canonical(value)).eq(given.clone());
        is_given.then(|| (id.to_owned(), given))
    };
    deciding.filter_map(values).collect()
}

/// The argument of a key, with `_` for `-`.
pub(crate) fn argument<'a>(command: &'a clap::Command, key: &str) -> Option<&'a Arg> {
    let long = key.replace('_', "-");
    let is_meant = |arg: &&Arg| arg.get_long() == Some(&long) || arg.get_id() == key;
    command.get_arguments().find(is_meant)
}

/// True of an argument that is the path of a file.
pub(crate) fn is_path(arg: &Arg) -> bool {
    arg.get_value_parser().type_id() == TypeId::of::<PathBuf>()
}

/// True of an argument that has several values.
pub(crate) fn is_repeated(arg: &Arg) -> bool {
    arg.get_num_args().is_some_and(|n| n.max_values() > 1)
        || matches!(arg.get_action(), ArgAction::Append)
}

/// Numbers in their shortest form: `8.0:11` is `8:11`, `x2.0` is `x2`.
fn canonical(value: &str) -> String {
    // `300:+30` is a length, and no 300:30
    let shortest = |part: &str| {
        let start = part.find(|c: char| c.is_ascii_digit() || "+-.".contains(c));
        let (word, number) = part.split_at(start.unwrap_or(part.len()));
        let number = number
            .parse::<f64>()
            .ok()
            .filter(|_| !number.starts_with('+'));
        number.map_or(part.to_owned(), |x| format!("{word}{x}"))
    };
    let part = |part: &str| {
        let end = part.trim_end_matches([',', ':', '=']).len();
        shortest(&part[..end]) + &part[end..]
    };
    value.split_inclusive([',', ':', '=']).map(part).collect()
}

impl<C: Command> Invocation<C> {
    /// The command of these words, without its name.
    ///
    /// # Errors
    /// The words that are refused, as on the command line.
    pub fn of<W: Into<OsString> + Clone>(words: impl IntoIterator<Item = W>) -> Result<Self> {
        let command =
            <Self as clap::Args>::augment_args(clap::Command::new(C::NAME)).no_binary_name(true);
        let matches = command
            .try_get_matches_from(words)
            .map_err(|e| Failure::usage(&e))?;
        Self::from_arg_matches(&matches).map_err(|e| Failure::usage(&e))
    }

    /// The command of a request by name: keys are options, with `_` for `-`. True gives the option, false and null
    /// nothing, a list repeats it where it may be repeated, a table (of a scenario) becomes `--set` of its keys.
    ///
    /// # Errors
    /// Keys that are no options, and values that are refused, as on the command line.
    pub fn named(request: &Map<String, Value>) -> Result<Self> {
        let mut command = <Self as clap::Args>::augment_args(clap::Command::new(C::NAME));
        // gives positional arguments their places
        command.build();
        let (mut words, mut positional) = (Vec::new(), BTreeMap::new());
        for (key, value) in request {
            // settings: a scenario, or one of its sections
            if let Value::Object(settings) = value {
                let section = format!("{key}.");
                let place = if key == "scenario" { "" } else { &section };
                words.extend(set(settings, place)?);
                continue;
            }
            let Some(arg) = argument(&command, key) else {
                let known = command.get_arguments().map(|arg| arg.get_id().as_str());
                let message = format!("{}: there is no option {key}", C::NAME);
                return Err(Failure::input(message).or_hint_if(
                    suggest::nearest(key, known).map(|meant| format!("did you mean \"{meant}\"?")),
                ));
            };
            let option = arg.get_long().unwrap_or(key);
            let values = values(arg, value);
            match arg.get_index() {
                Some(index) => _ = positional.insert(index, values),
                None if value == &Value::Bool(true) && is_flag(arg) => {
                    words.push(format!("--{option}"));
                }
                None => words.extend(values.iter().map(|value| format!("--{option}={value}"))),
            }
        }
        words.push("--".to_owned());
        words.extend(positional.into_values().flatten());
        Self::of(words)
    }
}

/// The words of a table of settings: `--set gnss.rate_hz=5`.
fn set(settings: &Map<String, Value>, place: &str) -> Result<Vec<String>> {
    let mut words = Vec::new();
    for (key, value) in settings {
        let is_bare = |c: char| c.is_ascii_alphanumeric() || c == '_' || c == '-';
        let key = match !key.is_empty() && key.chars().all(is_bare) {
            true => format!("{place}{key}"),
            false => format!("{place}{}", Value::from(key.as_str())),
        };
        match value {
            Value::Null => {}
            Value::Object(inner) if !inner.is_empty() => {
                words.extend(set(inner, &format!("{key}."))?)
            }
            value => {
                let value = toml::Value::try_from(value).refuse_within(&key)?;
                words.push(format!("--set={key}={value}"));
            }
        }
    }
    Ok(words)
}

/// True of an option that may stand without a value.
fn is_flag(arg: &Arg) -> bool {
    arg.get_num_args()
        .is_none_or(|count| count.min_values() == 0)
}

/// The values of an option; none where it is not given.
fn values(arg: &Arg, value: &Value) -> Vec<String> {
    let text = |value: &Value| match value {
        Value::String(text) => text.clone(),
        other => other.to_string(),
    };
    match value {
        Value::Null | Value::Bool(false) => Vec::new(),
        Value::Array(list) if is_repeated(arg) => list.iter().map(text).collect(),
        Value::Array(list) => vec![list.iter().map(text).collect::<Vec<_>>().join(",")],
        other => vec![text(other)],
    }
}

/// An answer as it is printed and written, for callers that have no terminal.
#[derive(Debug)]
pub struct RenderedAnswer {
    /// The answer in JSON.
    pub json: String,
    /// Verdict, tables, charts and notes.
    pub document: Document,
    /// The files that the command writes: name and contents.
    pub files: Vec<(String, String)>,
    /// The bound that is not met, if there is one.
    pub unmet: Option<Failure>,
}

/// Answers a request by name without writing files.
///
/// # Errors
/// As [`Invocation::named`] and [`Command::run`].
pub fn answered<C: Command>(
    mut request: Map<String, Value>,
    front: &dyn Reporter,
) -> Result<RenderedAnswer> {
    let seed = request.remove("seed").filter(|seed| !seed.is_null());
    let seed = seed
        .map(|seed| parse::seed(&seed.to_string()).refuse_within(format!("--seed='{seed}'")))
        .transpose()?;
    let asked = Invocation::<C>::named(&request)?;
    let mut manifest = asked.manifest(seed)?;
    let context = Context::new(front, seed).untimed();
    let context = context.reading(manifest.inputs.clone());
    let answer = asked.request.run(&context)?;
    let document = answer.document();
    let name = |ending: &str| match C::OUT {
        OutputKind::File { name, .. } => beside(Path::new(name), ending).display().to_string(),
        _ => ending.to_owned(),
    };
    let mut files = Vec::new();
    let mut keep = |file: OutputFile<'_>| {
        files.push((name(&file.name), file.parts.collect()));
        Ok(())
    };
    match C::OUT {
        OutputKind::Directory { .. } => {
            let page = C::PAGE.then_some(&document);
            each_file(&answer, page, &mut manifest, &context, keep)?;
        }
        _ => {
            answer.files().into_iter().try_for_each(&mut keep)?;
        }
    }
    Ok(RenderedAnswer {
        json: crate::report::json(&answer),
        document,
        files,
        unmet: answer.unmet(),
    })
}

// Outputs of a command: claimed before its work, written whole after it.

/// Claims on all outputs of a command. Directories that were made for them and are empty go when this is dropped.
#[derive(Default)]
#[must_use = "released when dropped"]
pub(crate) struct OutputClaims {
    own: Vec<OutputClaim>,
    missing: Vec<PathBuf>,
}

impl OutputClaims {
    /// Notes directories of outputs that are not there yet, the outer ones first.
    fn note_missing<'a>(&mut self, outputs: impl Iterator<Item = &'a PathBuf>) {
        let above = |output: &'a PathBuf| output.ancestors().skip(1);
        let missing = outputs.flat_map(above).filter(|path| !path.exists());
        self.missing.extend(missing.map(Path::to_owned));
        self.missing.sort();
    }

    /// A warning where nothing keeps another nav-sim from writing the same.
    pub(crate) fn warning(&self) -> Option<&'static str> {
        let is_shared = self.own.iter().any(OutputClaim::is_shared);
        is_shared.then_some("this disk has no locks: run no other nav-sim on this output")
    }
}

impl Drop for OutputClaims {
    fn drop(&mut self) {
        self.own.clear();
        // those with results in them stay
        let inner_first = self.missing.iter().rev();
        inner_first.for_each(|path| drop(std::fs::remove_dir(path)));
    }
}

const PAGE: &str = "report.html";
const MANIFEST: &str = "manifest.json";

impl<C: Command> Invocation<C> {
    /// Every file that is read, by its role; those of directories in name order.
    pub(crate) fn inputs(&self) -> Result<Inputs> {
        let mut all = Inputs::new();
        for (role, path) in self.request.inputs(self.paths.clone())? {
            let is_recording = ["recording", "static"].contains(&role.as_str());
            let files = match is_recording {
                true => input::listed(&[path])?,
                false => vec![path],
            };
            all.extend(files.into_iter().map(|file| (role.clone(), file)));
        }
        Ok(all)
    }

    /// The manifest before the run: options, seed, contents of inputs.
    pub(crate) fn manifest(&self, seed: Option<u64>) -> Result<Manifest> {
        let fingerprint = |(role, path): &(String, PathBuf)| input::input(role, path);
        let inputs = self.inputs()?;
        let inputs: Result<Vec<Input>> = inputs.iter().map(fingerprint).collect();
        let mut options = self.options.clone();
        options.extend(seed.map(|seed| ("seed".to_owned(), vec![seed.to_string()])));
        Ok(Manifest::new(C::NAME, options, inputs?))
    }

    /// Claims all outputs: none is an input, nothing is replaced that is not of this command, and nobody else writes
    /// there.
    pub(crate) fn claim(&self, manifest: &Manifest, force: bool) -> Result<OutputClaims> {
        let inputs = || manifest.inputs.iter().map(|input| Path::new(&input.path));
        let mut claims = OutputClaims::default();
        claims.note_missing(self.out.iter().chain(&self.plots));
        match (C::OUT, &self.out) {
            (OutputKind::Directory { .. }, Some(out)) => {
                let names = self.request.output_names();
                let present = |text: &str| serde_json::from_str::<Manifest>(text).ok();
                let recognise = |text: &str| {
                    let there = present(text).filter(|there| there.name == C::NAME);
                    let Some(there) = there else {
                        return DirectoryState::Foreign;
                    };
                    let is_own = |name: &str| there.outputs.contains_key(name);
                    let mut others = names.iter().filter(|name| !is_own(name));
                    match others.any(|name| out.join(name.as_ref()).exists()) {
                        true => DirectoryState::Foreign,
                        false if there.key == manifest.key => DirectoryState::Same,
                        false => DirectoryState::Other,
                    }
                };
                let own = [PAGE, MANIFEST].map(Cow::Borrowed);
                let names = [&names[..], &own].concat();
                let claim = claim_directory(out, &names, inputs(), force, recognise)?;
                claims.own.push(claim);
            }
            (OutputKind::File { name, .. }, Some(out)) => {
                self.request.check_out()?;
                let endings = self.request.endings();
                let is_new = !out.exists() && !out.to_string_lossy().ends_with('/');
                if endings.len() > 1 && (!is_new && !out.is_file() || out.as_os_str() == "-") {
                    let failure = Failure::input(format!("{} is not a file", out.display()));
                    return Err(failure.hint(format!("name a file, such as {name}")));
                }
                for ending in endings {
                    let kind = if ending.is_empty() { name } else { &ending };
                    let claim = claim_file(&beside(out, &ending), kind, inputs())?;
                    claims.own.push(claim);
                }
            }
            _ => {}
        }
        for path in &self.plots {
            let (kind, form) = (path.to_string_lossy().to_lowercase(), ending(path));
            if form != PAGE_ENDING && !FORMS.contains(&form.as_str()) {
                return refused(
                    format!("{}: neither page nor picture", path.display()),
                    "end the name in .html or .svg (.png with feature `pictures`)",
                );
            }
            claims.own.push(claim_file(path, &kind, inputs())?);
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
        // all are on the disk before any has its name
        let (mut written, mut filled) = (Vec::new(), Vec::new());
        match (C::OUT, &self.out) {
            (OutputKind::Directory { .. }, Some(out)) => {
                let before = std::fs::read_to_string(out.join(MANIFEST)).unwrap_or_default();
                let before = serde_json::from_str::<Manifest>(&before).ok();
                let mut directory = AtomicDir::create(out)?;
                let give = |file: OutputFile<'_>| directory.write(&file.name, file.parts);
                let page = C::PAGE.then_some(document);
                each_file(answer, page, &mut manifest, context, give)?;
                directory.commit()?;
                // files of an earlier result that this one does not have
                for old in before.iter().flat_map(|before| before.outputs.keys()) {
                    let is_within = Path::new(old).file_name() == Some(OsStr::new(old));
                    if is_within && !manifest.outputs.contains_key(old) {
                        drop(std::fs::remove_file(out.join(old)));
                    }
                }
                written.push(out.clone());
            }
            (OutputKind::File { .. }, Some(out)) => {
                for file in answer.files() {
                    let path = beside(out, &file.name);
                    let text: String = file.parts.collect();
                    let bytes = packed(&path, text).map_err(|e| Failure::unwritable(&path, e))?;
                    filled.push(atomic::filled(&path, &bytes)?);
                    written.push(path);
                }
            }
            _ => {}
        }
        for path in &self.plots {
            let form = ending(path);
            let bytes = match form == PAGE_ENDING {
                true => document.html().into(),
                false => encode(document.svg(), &form).map_err(Failure::failed)?,
            };
            filled.push(atomic::filled(path, &bytes)?);
            written.push(path.clone());
        }
        atomic::commit(filled)?;
        Ok(written)
    }
}

/// Gives the files of a directory: those of the answer, the page, and the manifest, with the hashes of the first, last.
fn each_file(
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
    if ending(path) != "gz" {
        return Ok(text.into_bytes());
    }
    let mut packed = GzEncoder::new(Vec::new(), Compression::default());
    packed.write_all(text.as_bytes())?;
    packed.finish()
}

/// Endings of the names of pages and pictures.
const PAGE_ENDING: &str = "html";

/// The ending of a file's name.
fn ending(path: &Path) -> String {
    path.extension()
        .unwrap_or_default()
        .to_string_lossy()
        .to_lowercase()
}

// `manifest.json`: where a result directory came from, and whether another command makes the same.

/// Provenance of a result directory: `manifest.json`.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Manifest {
    /// Layout version.
    pub schema_version: u32,
    /// The command, such as "run".
    pub name: String,
    /// Version of nav-sim.
    pub version: String,
    /// The command line as given.
    pub command: Vec<String>,
    /// Options that decide the result, without files: their contents are among the inputs.
    pub options: BTreeMap<String, Vec<String>>,
    /// Seed of all random numbers; none where there are none.
    pub seed: Option<u64>,
    /// Every file that is read.
    pub inputs: Vec<Input>,
    /// BLAKE3 of every file that is written beside the page and this file.
    pub outputs: BTreeMap<String, String>,
    /// BLAKE3 of what decides the result: command, options, contents of inputs, numerics.
    pub key: String,
    /// Worker threads.
    pub threads: usize,
    /// Time of the runs (s).
    pub wall_s: f64,
    /// Facts that the command records, such as the resolved configuration of a run.
    #[serde(flatten)]
    pub record: Map<String, Value>,
}

/// Version of the figures: it rises when a golden number moves by more than 1e-9.
const NUMERICS: u32 = 4;

impl Manifest {
    /// Version of the layout.
    pub const SCHEMA_VERSION: u32 = 3;

    /// The manifest of a command before it runs.
    pub fn new(name: &str, options: BTreeMap<String, Vec<String>>, inputs: Vec<Input>) -> Self {
        let mut manifest = Self {
            schema_version: Self::SCHEMA_VERSION,
            name: name.to_owned(),
            version: env!("CARGO_PKG_VERSION").to_owned(),
            options,
            inputs,
            ..Self::default()
        };
        let decides = (
            name,
            &manifest.options,
            contents(&manifest.inputs),
            NUMERICS,
        );
        let text = serde_json::to_string(&decides).expect("serialises");
        manifest.key = input::hash_of(text.as_bytes());
        manifest
    }

    /// The hashes of the inputs of a role, in the order given.
    pub(crate) fn hashes(&self, role: &str) -> Vec<&str> {
        let of_role = self.inputs.iter().filter(|input| input.role == role);
        of_role.map(|input| input.blake3.as_str()).collect()
    }
}

/// Roles and contents of files, without their paths.
fn contents(inputs: &[Input]) -> Vec<(&str, &str)> {
    let content = |input| {
        let Input { role, blake3, .. }: &Input = input;
        (role.as_str(), blake3.as_str())
    };
    inputs.iter().map(content).collect()
}
