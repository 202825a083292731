//! A command is a struct of options with inputs and an answer. Words of a command line and requests by name (Python,
//! studies) become it by the same parser, so that both are refused in the same words.

use super::outputs::each_file;
use super::{Context, Failure, Front, Refuse, Result};
use crate::io::atomic::Written;
use crate::io::suggest;
use crate::parse;
use clap::builder::ValueParser;
use clap::{Arg, ArgAction, ArgMatches, FromArgMatches};
use nav_sim_document::Document;
use serde::Serialize;
use serde_json::{Map, Value, json};
use std::any::TypeId;
use std::borrow::Cow;
use std::collections::BTreeMap;
use std::ffi::OsString;
use std::path::{Path, PathBuf};

/// Where a command writes.
#[derive(Debug, Clone, Copy)]
pub enum Out {
    /// To stdout alone.
    Nothing,
    /// To a file, and files with other endings beside it.
    File {
        /// Kind of the file.
        kind: Written,
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
pub type Inputs = Vec<(&'static str, PathBuf)>;

/// A command: options, inputs, answer.
pub trait Command: clap::Args + Send + Sync + 'static {
    /// Its answer.
    type Answer: Answer;
    /// Its name on the command line.
    const NAME: &'static str;
    /// Where it writes.
    const OUT: Out = Out::Nothing;
    /// True if its document can be written as a page or a picture.
    const PLOT: bool = true;
    /// True if a page stands in its directory.
    const PAGE: bool = true;
    /// True if the file goes to stdout where `--out` is not given.
    const PRINTS_FILE: bool = false;
    /// Options that do not change the result, such as `--require`.
    const JUDGES: &'static [&'static str] = &[];

    /// Every file that is read, by its role.
    ///
    /// # Errors
    /// When a directory cannot be listed or options do not fit together.
    fn inputs(&self) -> Result<Inputs>;

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
    /// Why nothing can be written.
    fn check_out(&self) -> Result<()> {
        Ok(())
    }

    /// Names of the files of [`Out::Directory`].
    fn output_names(&self) -> Vec<Cow<'static, str>> {
        match Self::OUT {
            Out::Directory { files, .. } => files.iter().map(|name| (*name).into()).collect(),
            _ => Vec::new(),
        }
    }

    /// Endings and kinds of the files beside [`Out::File`], itself included: "" is the file itself.
    fn endings(&self) -> Vec<(Cow<'static, str>, Written)> {
        match Self::OUT {
            Out::File { kind, .. } => vec![("".into(), kind)],
            _ => Vec::new(),
        }
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

    /// All of it as a table for `--format csv`.
    fn csv(&self) -> Option<String> {
        None
    }

    /// The figures of `--plot FILE.svg`.
    fn svg(&self, document: &Document) -> String {
        document.svg()
    }

    /// The files to be written; of [`Out::File`] their names are endings.
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
pub struct Asked<C> {
    /// The command.
    pub request: C,
    /// `--out`, or its default.
    pub(crate) out: Option<PathBuf>,
    /// `--plot`.
    pub(crate) plots: Vec<PathBuf>,
    /// Options that decide the result, without paths of files.
    pub(crate) options: BTreeMap<String, Vec<String>>,
}

const OUT: &str = "out";
const PLOT: &str = "plot";

impl<C: Command> clap::Args for Asked<C> {
    fn augment_args(command: clap::Command) -> clap::Command {
        let mut command = C::augment_args(command);
        let path = || {
            Arg::new(OUT)
                .long(OUT)
                .short('o')
                .value_parser(ValueParser::path_buf())
        };
        match C::OUT {
            Out::Nothing => {}
            Out::File { help, .. } => command = command.arg(path().value_name("FILE").help(help)),
            Out::Directory { path: default, .. } => {
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
                "Also write the page (.html) or its figures (.svg; .png with the feature `pictures`) (repeatable)",
            ));
        }
        command
    }

    fn augment_args_for_update(command: clap::Command) -> clap::Command {
        Self::augment_args(command)
    }
}

impl<C: Command> FromArgMatches for Asked<C> {
    fn from_arg_matches(matches: &ArgMatches) -> std::result::Result<Self, clap::Error> {
        let paths = |id| {
            let found = matches.try_get_many::<PathBuf>(id).ok().flatten();
            found.into_iter().flatten().cloned().collect::<Vec<_>>()
        };
        let request = C::from_arg_matches(matches)?;
        let by_default = match C::OUT {
            Out::File { name, .. } if request.writes_by_default() => Some(name.into()),
            _ => None,
        };
        Ok(Self {
            out: paths(OUT).pop().or(by_default),
            plots: paths(PLOT),
            options: options::<C>(matches),
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

/// Options that decide the result, defaults included, without those that are files.
fn options<C: Command>(matches: &ArgMatches) -> BTreeMap<String, Vec<String>> {
    let command = C::augment_args(clap::Command::new(C::NAME));
    let deciding = command
        .get_arguments()
        .filter(|arg| !is_path(arg) && !C::JUDGES.contains(&arg.get_id().as_str()));
    let values = |arg: &Arg| {
        let id = arg.get_id().as_str();
        let raw = matches.try_get_raw(id).ok().flatten()?;
        Some((
            id.to_owned(),
            raw.map(|value| canonical(&value.to_string_lossy()))
                .collect(),
        ))
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

impl<C: Command> Asked<C> {
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
                    suggest::nearest(key, known).map(|name| format!("did you mean {name}?")),
                ));
            };
            let option = arg.get_long().unwrap_or(key);
            let values = values(arg, value);
            match arg.get_index() {
                Some(index) => _ = positional.insert(index, values),
                None if value == &Value::Bool(true) => words.push(format!("--{option}")),
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
            false => format!("{place}{}", toml::Value::from(key.as_str())),
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

/// The values of an option; none where it is not given.
fn values(arg: &Arg, value: &Value) -> Vec<String> {
    let text = |value: &Value| match value {
        Value::String(text) => text.clone(),
        other => other.to_string(),
    };
    match value {
        Value::Null | Value::Bool(_) => Vec::new(),
        Value::Array(list) if is_repeated(arg) => list.iter().map(text).collect(),
        Value::Array(list) => vec![list.iter().map(text).collect::<Vec<_>>().join(",")],
        other => vec![text(other)],
    }
}

/// An answer as it is printed and written, for callers that have no terminal.
#[derive(Debug)]
pub struct Answered {
    /// As JSON.
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
/// As [`Asked::named`] and [`Command::run`].
pub fn answered<C: Command>(
    mut request: Map<String, Value>,
    front: &dyn Front,
) -> Result<Answered> {
    let seed = request.remove("seed").filter(|seed| !seed.is_null());
    let seed = seed
        .map(|seed| parse::seed(&seed.to_string()).refuse_within(format!("--seed='{seed}'")))
        .transpose()?;
    let asked = Asked::<C>::named(&request)?;
    let mut manifest = asked.manifest(seed)?;
    let context = Context::new(front, seed).untimed();
    let context = context.reading(manifest.inputs.clone());
    let answer = asked.request.run(&context)?;
    let document = answer.document();
    let name = |ending: &str| match C::OUT {
        Out::File { name, .. } => beside(Path::new(name), ending).display().to_string(),
        _ => ending.to_owned(),
    };
    let mut files = Vec::new();
    let mut keep = |file: OutputFile<'_>| {
        files.push((name(&file.name), file.parts.collect()));
        Ok(())
    };
    match C::OUT {
        Out::Directory { .. } => {
            let page = C::PAGE.then_some(&document);
            each_file(&answer, page, &mut manifest, &context, keep)?;
        }
        _ => {
            let table = answer.csv().map(|text| OutputFile::whole(".csv", text));
            answer
                .files()
                .into_iter()
                .chain(table)
                .try_for_each(&mut keep)?;
        }
    }
    Ok(Answered {
        json: crate::report::json(&answer),
        document,
        files,
        unmet: answer.unmet(),
    })
}

/// The file beside another that has its stem and this ending; with none itself.
pub(crate) fn beside(path: &Path, ending: &str) -> PathBuf {
    if ending.is_empty() {
        return path.to_owned();
    }
    let mut name = path.file_stem().unwrap_or_default().to_owned();
    name.push(ending);
    path.with_file_name(name)
}
