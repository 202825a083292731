//! Studies: runs whose values may be lists, in cells that survive kills and spread over machines.
//!
//! A cell is one request of `run`, and its directory a run directory. It is done when its manifest has its key: options and
//! contents of inputs. Cells that differ in the filter alone share a pass of noise, and many runs are cut into blocks.

mod results;

pub use results::StudyAnswer;

use crate::app::inputs::merge;
use crate::app::{
    Answer, Command, Context, Failure, Input, IntoFailure, Invocation, Manifest, Reporter, Result,
    argument, is_path, is_repeated, refused,
};
use crate::commands::run::{PreparedRun, Run, TrackCache, block_of, columns};
use crate::io::file_kind::{self, FileKind};
use crate::io::toml_file::TomlSource;
use crate::io::{atomic, input, source};
use crate::report::{first_names, in_order};
use clap::Args;
use indexmap::IndexMap;
use nav_sim_document::{Importance, Note, counted};
use nav_sim_navigation::scenario::{Method, Scenario};
use nav_sim_navigation::simulation::RunResult;
use rayon::prelude::*;
use results::{guard, withdraw};
use schemars::JsonSchema;
use serde::Deserialize;
use serde_json::Map;
use std::collections::{HashMap, HashSet};
use std::fs::{self, File};
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use toml::{Table, Value};

/// Run a study: a run whose values may be lists
///
/// STUDY (TOML) has the options of `run` as keys of [run], and sections of a scenario. A list is an axis where a single run
/// would not take it; [vary] names axes, and {NAME} stands for a label. Every cell becomes a run directory in DIR/cells; then
/// all are compared (results.csv, summary.json, report.html). Computes what is missing: kill and repeat at will, on any
/// number of processes and machines that share the directory. Stopped by SIGTERM or the time limit the exit code is 75.
#[derive(clap::Args, Debug, Clone, Default)]
pub struct BatchRequest {
    /// The study (TOML)
    #[arg(value_name = "STUDY")]
    pub study: PathBuf,
    /// Directory of the study (default: out/ and the study's name)
    #[arg(long, short, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Share of the work, from 0/N to N−1/N (default: from HQ_TASK_ID, SLURM_ARRAY_TASK_ID, PBS_ARRAY_INDEX or
    /// JOB_COMPLETION_INDEX, else what no other process has)
    #[arg(long, value_name = "K/N", value_parser = parse_shard)]
    pub shard: Option<(u64, u64)>,
    /// Number of shards, if only the index comes from the scheduler
    #[arg(long, value_name = "N", conflicts_with = "shard", value_parser = clap::value_parser!(u64).range(1..))]
    pub shards: Option<u64>,
    /// Say what there is to do, and compute nothing
    #[arg(long)]
    pub dry_run: bool,
    /// Compute nothing, merge the cells that are there
    #[arg(long, conflicts_with = "dry_run")]
    pub merge: bool,
    /// A key of [run] over that of the study, such as runs=10000 (repeatable)
    #[arg(long, value_name = "KEY=VALUE")]
    pub set: Vec<String>,
    /// Compute cells again whose request has changed
    #[arg(skip)]
    pub force: bool,
}

/// Result of a `batch` command.
#[derive(Debug)]
pub enum BatchOutcome {
    /// Merged: what is there is compared.
    Merged(Box<StudyAnswer>),
    /// Own share done; cells are missing.
    Partial(Vec<String>),
    /// The estimate of a dry run.
    Estimate(String),
    /// Stopped before the own share was done.
    Stopped {
        /// True if the same command goes on: something was finished, or a signal came.
        is_resumable: bool,
        /// Units left.
        left: usize,
    },
}

impl BatchRequest {
    /// Directory of the study.
    pub fn directory(&self) -> PathBuf {
        self.out
            .clone()
            .unwrap_or_else(|| Path::new("out").join(self.study.file_stem().unwrap_or_default()))
    }

    /// Computes the cells that are missing, and merges when none is.
    ///
    /// # Errors
    /// What is wrong with the study, before anything is computed; cells that cannot be computed (exit code 1); stopped early
    /// (75).
    pub fn run(
        &self,
        variable: &dyn Fn(&str) -> Option<String>,
        context: &Context<'_>,
    ) -> Result<BatchOutcome> {
        self.run_study(&Study::read(&self.study, &self.set)?, variable, context)
            .map_err(|e| match e.code() {
                2 if e.file().is_none() => e.within(&self.study.display().to_string()),
                _ => e,
            })
    }

    fn run_study(
        &self,
        study: &Study,
        variable: &dyn Fn(&str) -> Option<String>,
        context: &Context<'_>,
    ) -> Result<BatchOutcome> {
        let directory = self.directory();
        let place = StudyDirectory {
            path: &directory,
            force: self.force,
        };
        let cells = study.cells(self.study.parent().unwrap_or(Path::new("")))?;
        let merged = || {
            // of workers that were killed as they wrote results, or where another had just written the same cell
            atomic::remove_abandoned(&directory.join(atomic::INSIDE));
            let answer = results::merge(study, &cells, &place, context)?;
            answer.write(&place)?;
            let done = cells.iter().filter(|cell| place.is_done(cell));
            done.for_each(|cell| atomic::remove_abandoned(&place.cell(&cell.name)));
            Ok(BatchOutcome::Merged(Box::new(answer)))
        };
        guard(&place)?;
        let changed = adopt(&place, &cells, self.dry_run, context);
        if let (Some((name, what)), false) = (changed.first(), self.force || self.dry_run) {
            return refused(
                format!("cell {name} {what}"),
                "choose another --out, or recompute with --force",
            );
        }
        if self.merge {
            return merged();
        }
        let share = find_shard(self.shard, self.shards, variable)?;
        let units = units(&cells, context)?;
        if self.dry_run {
            return estimate(&cells, &units, &place, changed.len(), context)
                .map(BatchOutcome::Estimate);
        }
        if cells.iter().any(|cell| !place.is_done(cell)) {
            withdraw(&place);
        }
        let own = match share {
            Some(share) => {
                context.remark(format!("shard {}/{}", share.0, share.1));
                shard(&units, share)
            }
            None => units.iter().collect(),
        };
        let left = || own.iter().filter(|unit| !place.has_unit(unit)).count();
        let todo = left();
        let failures = work(&place, &own, context)?;
        for cell in &cells {
            let spans: Vec<(u64, u64)> = units
                .iter()
                .filter(|unit| unit.cells.iter().any(|own| own.name == cell.name))
                .map(RunBlock::span)
                .collect();
            if spans.len() > 1 {
                assemble(&place, cell, &spans, context)?;
            }
        }
        // Cells of the same content have their parts in common.
        for cell in cells.iter().filter(|cell| place.is_done(cell)) {
            drop(fs::remove_dir_all(place.parts(cell)));
        }
        // empty after the last
        drop(fs::remove_dir(directory.join("parts")));
        if let Some((name, failure)) = failures.first() {
            let more = match failures.len() - 1 {
                0 => String::new(),
                n => format!(" (and {} more)", counted(n, "cell")),
            };
            return Err(Failure::failed(format!("cell {name}: {failure}{more}"))
                .or_hint_if(failure.advice()));
        }
        let left = left();
        if left > 0 && !context.should_continue() {
            let is_resumable = left < todo;
            return Ok(BatchOutcome::Stopped { is_resumable, left });
        }
        let missing = cells.iter().filter(|cell| !place.is_done(cell));
        let missing: Vec<String> = missing.map(|cell| cell.name.clone()).collect();
        if missing.is_empty() {
            let locks = units
                .iter()
                .map(RunBlock::lock)
                .chain(cells.iter().map(StudyCell::lock));
            locks.for_each(|name| drop(fs::remove_file(place.path.join("locks").join(name))));
            // a directory of that name may hold other files
            drop(fs::remove_dir(place.path.join("locks")));
            return merged();
        }
        context.remark(format!(
            "{} of {} missing: {}",
            missing.len(),
            counted(cells.len(), "cell"),
            first_names(&missing)
        ));
        Ok(BatchOutcome::Partial(missing))
    }
}

/// Renames cells that have another name than they had; names and reasons of those whose request has changed.
fn adopt(
    place: &StudyDirectory<'_>,
    cells: &[StudyCell],
    is_dry: bool,
    context: &Context<'_>,
) -> Vec<(String, String)> {
    let keyed = fs::read_dir(place.path.join("cells"))
        .into_iter()
        .flatten()
        .flatten()
        .map(|entry| entry.file_name().to_string_lossy().into_owned())
        // what another worker is writing has a manifest before it has its name
        .filter(|name| !name.ends_with(".damaged") && !name.ends_with(atomic::PARTIAL))
        .filter_map(|name| Some((place.manifest(&name)?.key, name)));
    let there: HashMap<String, String> = keyed.collect();
    let named = |name: &str| cells.iter().find(|cell| cell.name == name);
    for cell in cells.iter().filter(|_| !is_dry) {
        if let Some(name) = there.get(&cell.manifest.key)
            && !named(name).is_some_and(|own| place.is_done(own))
            && !place.cell(&cell.name).exists()
        {
            drop(fs::rename(place.cell(name), place.cell(&cell.name)));
        }
    }
    let others = there
        .values()
        .filter(|name| place.cell(name).exists() && named(name).is_none());
    let mut others: Vec<&String> = others.collect();
    others.sort();
    if !others.is_empty() {
        context.remark(format!(
            "cells of another study are left out: {}, such as {}",
            others.len(),
            others[0]
        ));
    }
    let changed = |cell: &StudyCell| {
        let manifest = place.manifest(&cell.name)?;
        (manifest.key != cell.manifest.key)
            .then(|| (cell.name.clone(), difference(&manifest, &cell.manifest)))
    };
    cells.iter().filter_map(changed).collect()
}

/// Describes the first setting or input by which a computed cell differs from the requested one.
fn difference(there: &Manifest, wanted: &Manifest) -> String {
    let keys = there.options.keys().chain(wanted.options.keys());
    let shown =
        |values: Option<&Vec<String>>| values.map_or("the default".to_owned(), |v| v.join(" "));
    for key in keys {
        let [old, new] = [there, wanted].map(|manifest| manifest.options.get(key));
        if old != new {
            let (old, new) = (shown(old), shown(new));
            return format!("is of another study: \"{key}\" is {old}, not {new}");
        }
    }
    let differs = |input: &&crate::app::Input| {
        !there
            .inputs
            .iter()
            .any(|old| old.role == input.role && old.blake3 == input.blake3)
    };
    match wanted.inputs.iter().find(differs) {
        Some(input) => format!("is of another study: {} has changed", input.path),
        None => format!(
            "was made by version {}, whose figures differ",
            there.version
        ),
    }
}

/// Cells, passes, what is done, and the processor time of the runs that are left, from eight of them.
fn estimate(
    cells: &[StudyCell],
    units: &[RunBlock<'_>],
    place: &StudyDirectory<'_>,
    changed: usize,
    context: &Context<'_>,
) -> Result<String> {
    let done = cells.iter().filter(|cell| place.is_done(cell)).count();
    let left: Vec<&RunBlock<'_>> = units.iter().filter(|unit| !place.has_unit(unit)).collect();
    let passes = units.iter().filter(|unit| unit.first == 0).count();
    let mut text = format!(
        "{} in {}: {done} done, {} to do, {changed} changed",
        counted(cells.len(), "cell"),
        if passes == 1 {
            "1 pass".to_owned()
        } else {
            format!("{passes} passes")
        },
        cells.len() - done
    );
    // analyses are not timed
    let sampled = |unit: &&&RunBlock<'_>| {
        let scenario = unit.cells[0].asked.request.scenario();
        scenario.is_ok_and(|scenario| scenario.run.method != Method::Lincov)
    };
    let left: Vec<_> = left.iter().filter(sampled).collect();
    if let Some(unit) = left.first() {
        let cell = unit.cells[0];
        let quiet = Context::new(&(), Some(cell.seed));
        let prepared = cell.asked.request.prepare(&TrackCache::default(), &quiet)?;
        let runs = unit.runs.min(8);
        quiet.begin("runs", runs);
        columns(&[&prepared], 0, runs, &quiet)?;
        quiet.end();
        let per_run = quiet.runs_s() / runs as f64 * quiet.threads() as f64;
        let cost: u64 = left.iter().map(|unit| unit.cost()).sum();
        let time = nav_sim_calibration::duration(per_run * cost as f64);
        text += &format!("\n{time} of processor time");
    }
    for cell in cells {
        context.detail(&cell.name);
    }
    Ok(text)
}

impl BatchOutcome {
    /// Failure to report: missed bounds, or cells that are still to be computed.
    pub fn unmet(&self) -> Option<Failure> {
        match self {
            Self::Merged(answer) => answer.incomplete().or_else(|| answer.unmet()),
            Self::Partial(_) | Self::Estimate(_) => None,
            Self::Stopped {
                is_resumable: true,
                left,
            } => Some(
                Failure::stopped(format!("stopped; {} left", counted(*left, "unit")))
                    .hint("the same command continues"),
            ),
            // the same command would end the same way: no code for "to be resumed"
            Self::Stopped { left, .. } => Some(
                Failure::failed(format!("stopped; {} left", counted(*left, "unit")))
                    .hint("a longer --time-limit"),
            ),
        }
    }
}

// From a study to its cells: each a request of `run` without lists.

/// Longest name of a cell (bytes): file systems take 255, of which parts that are being written need some.
const LONGEST_NAME: usize = 200;
/// More cells than this are a mistake.
const MOST: usize = 100_000;

fn few_enough(cells: usize) -> Result<()> {
    if cells > MOST {
        return Err(Failure::input(format!("more than {MOST} cells")));
    }
    Ok(())
}

/// A run whose values may be lists: nav-sim batch
#[derive(Default, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
#[schemars(title = "Study")]
pub(crate) struct Study {
    /// Options of `run` as keys, and sections of a scenario; a list is an axis where a single run would not take it
    #[schemars(with = "Map<String, serde_json::Value>")]
    run: Table,
    /// Axes by name: a list of labels, each in the place of `{NAME}`, or a table of a label's keys of `run`
    #[schemars(with = "Map<String, serde_json::Value>")]
    vary: Table,
    /// Labels of the reference, by axis (default: the first model)
    #[schemars(with = "Map<String, serde_json::Value>")]
    reference: Table,
    /// Its file, where a refusal stands in one of its lines.
    #[serde(skip)]
    source: Option<TomlSource>,
}

/// Axis and label, `[vary]` first, then lists, as written.
type Labels = Vec<(String, String)>;

/// One request.
pub(crate) struct StudyCell {
    /// Name of its run directory.
    name: String,
    /// Its place on each axis.
    labels: Labels,
    /// The command.
    asked: Invocation<Run>,
    /// Seed of all random numbers.
    seed: u64,
    /// The manifest before the run: what its key is made of.
    manifest: Manifest,
    /// Monte-Carlo runs; 1 of a covariance analysis.
    runs: u64,
    /// All that the noise depends on: cells that share it differ in the filter alone.
    noise: String,
}

impl StudyCell {
    /// Name of its lock.
    fn lock(&self) -> String {
        self.manifest.key[..32].to_owned()
    }
}

impl Study {
    /// Reads a study; `set` are keys of `[run]` over its own, as `KEY=VALUE`.
    pub(crate) fn read(path: &Path, set: &[String]) -> Result<Self> {
        let mut study: Self = if path.extension().is_some_and(|ending| ending == "json") {
            let text = source::text(path).map_err(|e| Failure::io(path, e))?;
            serde_json::from_str(&text).refuse_within(path.display())?
        } else {
            let source = TomlSource::read(path)?;
            let kinds = [FileKind::Study, FileKind::Scenario];
            let refused = |e| file_kind::or_wrong_kind(&kinds, path, e);
            let study: Self = source.get().map_err(refused)?;
            Self {
                source: Some(source).filter(|_| set.is_empty()),
                ..study
            }
        };
        for assignment in set {
            let Some((key, value)) = assignment.split_once('=') else {
                let message = format!("--set='{assignment}': expected KEY=VALUE, such as runs=8");
                return Err(Failure::input(message));
            };
            // a word without quotes is a text
            let parsed = format!("{key} = {value}").parse::<Table>();
            let quoted = || format!("{key} = {}", Value::from(value)).parse::<Table>();
            merge(
                &mut study.run,
                parsed.or_else(|_| quoted()).refuse_within("--set")?,
            );
        }
        Ok(study)
    }

    /// All cells, `[vary]` outermost; paths are relative to `beside`.
    pub(crate) fn cells(&self, beside: &Path) -> Result<Vec<StudyCell>> {
        let mut requests = vec![(Labels::new(), self.run.clone())];
        for (axis, values) in &self.vary {
            let values = named(axis, values).and_then(|values| {
                let places = self.run.values().chain(self.vary.values());
                let is_named = places.into_iter().any(|value| uses(value, axis));
                match is_named || values.iter().any(|(_, keys)| !keys.is_empty()) {
                    true if ["cell", "state"].contains(&axis.as_str()) => refused(
                        format!("\"vary.{axis}\": results.csv has a column of this name"),
                        "give the axis another name",
                    ),
                    true => Ok(values),
                    false => refused(
                        format!("\"vary.{axis}\" changes nothing"),
                        format!("write {{{axis}}} in a value of [run], or the list as run.{axis}"),
                    ),
                }
            });
            let values = values.map_err(|e| self.at(&format!("vary.{axis}"), e))?;
            few_enough(requests.len() * values.len())?;
            let product = |(labels, run): &(Labels, Table)| -> Vec<(Labels, Table)> {
                let with = |(label, keys): &(String, Table)| {
                    let mut run = run.clone();
                    merge(&mut run, keys.clone());
                    (plus(labels, axis, label), run)
                };
                values.iter().map(with).collect()
            };
            requests = requests.iter().flat_map(product).collect();
        }
        let mut door = RunValidator::new(beside);
        let mut all = Vec::new();
        for (labels, mut run) in requests {
            for value in run.iter_mut().map(|(_, value)| value) {
                fill(value, &labels)?;
            }
            door.expand(run, labels, &mut all)?;
        }
        self.check_reference(&all)?;
        let mut names = HashSet::new();
        let cells = all.into_iter().map(|(labels, run)| {
            let name = name_of(&labels);
            if name.len() > LONGEST_NAME {
                return refused(
                    format!("the name {name} is too long for a directory"),
                    "name the values under [vary]",
                );
            }
            if !names.insert(name.to_lowercase()) {
                return refused(
                    format!("two cells have the name {name}"),
                    "name the values under [vary]",
                );
            }
            door.cell(name.clone(), labels, run.clone()).map_err(|e| {
                let leaves = leaves(&run, "");
                let is_refused = |(path, value): &(String, &Value)| {
                    ["out", "plot"].contains(&path.as_str())
                        || value.is_table()
                        || !is_finite(value)
                        || !door.accepts(path, value)
                };
                let refused = leaves.into_iter().find(is_refused);
                let e = e.within(&format!("cell {name}"));
                refused.map_or(e.clone(), |(path, _)| self.at(&format!("run.{path}"), e))
            })
        });
        cells.collect()
    }

    /// A refusal in the line of a key.
    fn at(&self, key: &str, failure: Failure) -> Failure {
        match &self.source {
            Some(source) if failure.file().is_none() => {
                failure.at(source.path(), source.line_of(key) as u64)
            }
            _ => failure,
        }
    }

    /// The labels that references have: those of the study, else the first model.
    fn fixed(&self, cells: &[StudyCell]) -> HashMap<String, String> {
        let given = self.reference.iter();
        if self.reference.is_empty() {
            let mut labels = cells.iter().flat_map(|cell| &cell.labels);
            return labels
                .find(|(axis, _)| axis == "model")
                .cloned()
                .into_iter()
                .collect();
        }
        given
            .map(|(axis, label)| (axis.clone(), text(label)))
            .collect()
    }

    fn check_reference(&self, all: &[(Labels, Table)]) -> Result<()> {
        for (axis, label) in &self.reference {
            let label = text(label);
            let known = in_order(
                all.iter()
                    .flat_map(|(labels, _)| labels)
                    .filter(|(other, _)| other == axis)
                    .map(|(_, label)| label.as_str()),
            );
            if !known.contains(&label.as_str()) {
                let message = format!("\"reference.{axis}\" = \"{label}\" is not a label");
                let hint = match known.is_empty() {
                    true => format!("there is no axis {axis}"),
                    false => format!("labels: {}", known.join(", ")),
                };
                let failure = Failure::input(message).hint(hint);
                return Err(self.at(&format!("reference.{axis}"), failure));
            }
        }
        Ok(())
    }
}

/// Validator of values against a single run: the parser of its options and the reader of its
/// scenario.
struct RunValidator {
    command: clap::Command,
    beside: PathBuf,
    taken: HashMap<String, bool>,
    inputs: HashMap<PathBuf, Input>,
}

impl RunValidator {
    fn new(beside: &Path) -> Self {
        Self {
            command: Invocation::<Run>::augment_args(clap::Command::new(Run::NAME)),
            beside: beside.to_owned(),
            taken: HashMap::new(),
            inputs: HashMap::new(),
        }
    }

    fn is_path(&self, key: &str) -> bool {
        argument(&self.command, key).is_some_and(is_path)
    }

    /// Expands the first list that a single run would not take as it is.
    fn expand(&mut self, run: Table, labels: Labels, all: &mut Vec<(Labels, Table)>) -> Result<()> {
        few_enough(all.len())?;
        let is_new = |path: &str| !labels.iter().any(|(axis, _)| axis == path);
        let mut leaves = leaves(&run, "").into_iter();
        let Some((path, list)) = leaves.find_map(|(path, value)| {
            let list = value.as_array()?;
            let is_axis = is_new(&path)
                && !self.accepts(&path, value)
                && list.iter().any(|one| self.accepts(&path, one));
            is_axis.then(|| (path, list.clone()))
        }) else {
            all.push((labels, run));
            return Ok(());
        };
        for value in list {
            let label = self.label(&path, &value)?;
            let mut run = run.clone();
            merge(&mut run, nested(&path, value));
            self.expand(run, plus(&labels, &path, &label), all)?;
        }
        Ok(())
    }

    /// Returns true if a single run accepts this value of a key: then a list is one value, not an axis of the grid.
    fn accepts(&mut self, path: &str, value: &Value) -> bool {
        let memory = format!("{path}={value}");
        if let Some(known) = self.taken.get(&memory) {
            return *known;
        }
        let takes = match argument(&self.command, path) {
            _ if path == "seed" => value.as_integer().is_some_and(|seed| seed >= 0),
            Some(arg) => {
                let list = value.as_array();
                // any text parses as a path: refuse lists for a single path, and lists of lists
                let is_nested = list.is_some_and(|list| list.iter().any(Value::is_array));
                let is_one_path = is_path(arg) && !is_repeated(arg);
                let mut request = Table::from_iter(
                    [("trajectory", "t"), ("model", "m"), ("static", "s")]
                        .map(|(k, v)| (k.to_owned(), v.into())),
                );
                if path != "rate_hz" {
                    request.remove("static");
                }
                request.insert(path.to_owned(), value.clone());
                !(is_nested || is_one_path && list.is_some())
                    && named_request(&request).is_ok_and(|r| Invocation::<Run>::named(&r).is_ok())
            }
            None => nested(path, value.clone()).try_into::<Scenario>().is_ok(),
        };
        self.taken.insert(memory, takes);
        takes
    }

    /// Label of a list's value: the stem of a file, else its text.
    fn label(&self, path: &str, value: &Value) -> Result<String> {
        let stem = |text: String| {
            if self.is_path(path) {
                Path::new(&text)
                    .file_stem()
                    .map_or(text.clone(), |stem| stem.to_string_lossy().into_owned())
            } else {
                text
            }
        };
        match value {
            Value::Array(list) => Ok(list
                .iter()
                .map(|one| stem(text(one)))
                .collect::<Vec<_>>()
                .join("+")),
            Value::Table(_) => refused(
                format!("\"run.{path}\" is a list of tables"),
                format!("name them: [vary.{path}] LABEL = {{ {path} = … }}"),
            ),
            one => Ok(stem(text(one))),
        }
    }

    /// The command of a request.
    fn cell(&mut self, name: String, labels: Labels, mut run: Table) -> Result<StudyCell> {
        for key in ["out", "plot"] {
            if run.contains_key(key) {
                return refused(
                    format!("\"run.{key}\": a study has its own directory"),
                    "name it with -o",
                );
            }
        }
        let stated = run.remove("seed").map(|seed| {
            seed.as_integer()
                .and_then(|seed| u64::try_from(seed).ok())
                .ok_or_else(|| {
                    Failure::input(format!("\"run.seed\" = {seed} is not a whole number ≥ 0"))
                })
        });
        let keys: Vec<String> = run.keys().cloned().collect();
        for key in keys.iter().filter(|key| self.is_path(key)) {
            let resolve = |value: &mut Value| {
                if let Value::String(path) = value {
                    *path = self.beside.join(&*path).display().to_string();
                }
            };
            match run.get_mut(key.as_str()) {
                Some(Value::Array(list)) => list.iter_mut().for_each(resolve),
                Some(value) => resolve(value),
                None => {}
            }
        }
        let asked = Invocation::<Run>::named(&named_request(&run)?)?;
        let scenario = asked.request.scenario()?;
        let stated = stated.transpose()?.or(scenario.run.seed);
        let seed = stated.unwrap_or(crate::app::DEFAULT_SEED);
        let mut inputs = Vec::new();
        for (role, path) in asked.inputs()? {
            if !self.inputs.contains_key(&path) {
                self.inputs.insert(
                    path.clone(),
                    input::input(&role, &path)
                        .map_err(|e| e.hint("paths are relative to the study's file"))?,
                );
            }
            inputs.push(Input {
                role,
                ..self.inputs[&path].clone()
            });
        }
        let mut options = asked.options.clone();
        options.insert("seed".to_owned(), vec![seed.to_string()]);
        // settings have no order
        options.entry("set".to_owned()).and_modify(|set| set.sort());
        // Its summary states whether the limits are kept, so they are part of the key of a cell.
        let limits = run.get("require").map(ToString::to_string);
        options.extend(limits.map(|limits| ("require".to_owned(), vec![limits])));
        let manifest = Manifest::new(Run::NAME, options.clone(), inputs.clone());
        // What the filter states: its states, and its model where something else makes the errors.
        options.remove("states");
        options.remove("require");
        if let Some(set) = options.get_mut("set") {
            set.retain(|setting| !setting.starts_with("filter.states="));
        }
        if asked.request.truth.is_some() || !asked.request.recordings.is_empty() {
            inputs.retain(|input| input.role != "model");
        }
        let noise = Manifest::new(Run::NAME, options, inputs).key;
        let is_sampled = scenario.run.method != Method::Lincov;
        let runs = if is_sampled { scenario.run.runs } else { 1 };
        Ok(StudyCell {
            name,
            labels,
            asked,
            seed,
            manifest,
            runs,
            noise,
        })
    }
}

/// Labels and their keys of an axis of `[vary]`.
fn named(axis: &str, values: &Value) -> Result<Vec<(String, Table)>> {
    let refused = |what: &str| {
        Failure::input(format!("\"vary.{axis}\" {what}"))
            .hint("a list of labels, or a table: LABEL = { keys of run }")
    };
    let values: Vec<(String, Table)> = match values {
        Value::Array(labels) if !labels.iter().any(|l| l.is_array() || l.is_table()) => labels
            .iter()
            .map(|label| (text(label), Table::new()))
            .collect(),
        Value::Table(labels) => {
            let keys = |(label, keys): (&String, &Value)| {
                Ok((
                    label.clone(),
                    keys.as_table()
                        .ok_or_else(|| refused("has a label without keys"))?
                        .clone(),
                ))
            };
            labels.iter().map(keys).collect::<Result<_>>()?
        }
        _ => return Err(refused("is neither a list of labels nor a table")),
    };
    if values.is_empty() {
        Err(refused("is empty"))
    } else {
        Ok(values)
    }
}

/// True if a value holds `{axis}`.
fn uses(value: &Value, axis: &str) -> bool {
    match value {
        Value::String(text) => text.contains(&format!("{{{axis}}}")),
        Value::Array(list) => list.iter().any(|one| uses(one, axis)),
        Value::Table(table) => table.values().any(|one| uses(one, axis)),
        _ => false,
    }
}

/// Puts labels in the place of `{NAME}`.
fn fill(value: &mut Value, labels: &Labels) -> Result<()> {
    match value {
        Value::String(text) => {
            for (axis, label) in labels {
                *text = text.replace(&format!("{{{axis}}}"), label);
            }
            match text
                .split_once('{')
                .and_then(|(_, rest)| rest.split_once('}'))
            {
                Some((unknown, _)) => refused(
                    format!("\"{text}\": there is no axis {unknown}"),
                    "name it under [vary]",
                ),
                None => Ok(()),
            }
        }
        Value::Array(list) => list.iter_mut().try_for_each(|one| fill(one, labels)),
        Value::Table(table) => table.iter_mut().try_for_each(|(_, one)| fill(one, labels)),
        _ => Ok(()),
    }
}

/// Values that are no tables, with their paths: `gnss.rate_hz`.
fn leaves<'a>(table: &'a Table, prefix: &str) -> Vec<(String, &'a Value)> {
    let of_key = |(key, value): (&String, &'a Value)| match value {
        Value::Table(inner) if !inner.is_empty() => leaves(inner, &format!("{prefix}{key}.")),
        value => vec![(format!("{prefix}{key}"), value)],
    };
    table.iter().flat_map(of_key).collect()
}

fn nested(path: &str, value: Value) -> Table {
    match path.split_once('.') {
        Some((key, rest)) => Table::from_iter([(key.to_owned(), nested(rest, value).into())]),
        None => Table::from_iter([(path.to_owned(), value)]),
    }
}

fn named_request(run: &Table) -> Result<Map<String, serde_json::Value>> {
    // in JSON it would be null: not given
    if let Some((key, value)) = run.iter().find(|(_, value)| !is_finite(value)) {
        let message = format!("\"run.{key}\" = {value} is not a finite number");
        return Err(Failure::input(message));
    }
    if let Some((path, _)) = leaves(run, "").iter().find(|(_, value)| value.is_table()) {
        return Err(Failure::input(format!(
            "\"run.{path}\" = {{}} has no value"
        )));
    }
    serde_json::to_value(run)
        .and_then(serde_json::from_value)
        .refuse_within("[run]")
}

fn is_finite(value: &Value) -> bool {
    match value {
        Value::Float(x) => x.is_finite(),
        Value::Array(list) => list.iter().all(is_finite),
        Value::Table(table) => table.values().all(is_finite),
        _ => true,
    }
}

fn plus(labels: &Labels, axis: &str, label: &str) -> Labels {
    labels
        .iter()
        .cloned()
        .chain([(axis.to_owned(), label.to_owned())])
        .collect()
}

/// A label as text.
fn text(value: &Value) -> String {
    value
        .as_str()
        .map_or_else(|| value.to_string(), str::to_owned)
}

/// `I_dr-awv_length_s=5`: labels as written, numbers with their axis.
fn name_of(labels: &Labels) -> String {
    let part = |(axis, label): &(String, String)| match label.parse::<f64>() {
        Ok(_) => format!("{}={label}", axis.rsplit('.').next().unwrap_or(axis)),
        Err(_) => label.clone(),
    };
    let name = labels.iter().map(part).collect::<Vec<_>>().join("_");
    let kept = |c: char| {
        if c.is_alphanumeric() || "._+=-".contains(c) {
            c
        } else {
            '-'
        }
    };
    let name: String = name.chars().map(kept).collect();
    if name.trim_matches('.').is_empty() {
        "run".to_owned()
    } else {
        name
    }
}

// Units of work: a block of runs of the cells that share their noise. Each is written whole, by rename, so that processes
// may be killed, repeated and run beside one another.

/// A block of runs of cells that share a pass.
struct RunBlock<'a> {
    cells: Vec<&'a StudyCell>,
    first: u64,
    runs: u64,
    /// Runs of a cell: of one block, or of several.
    whole: bool,
}

impl RunBlock<'_> {
    /// Its size, for shards and the estimate of time.
    fn cost(&self) -> u64 {
        self.runs * self.cells.len() as u64
    }

    /// Name of its lock.
    fn lock(&self) -> String {
        format!("{}-{}", &self.cells[0].noise[..32], self.first)
    }

    /// Its first run and their number.
    const fn span(&self) -> (u64, u64) {
        (self.first, self.runs)
    }
}

/// The directory of a study.
struct StudyDirectory<'a> {
    path: &'a Path,
    /// True if cells of another request are replaced.
    force: bool,
}

impl StudyDirectory<'_> {
    fn cell(&self, name: &str) -> PathBuf {
        self.path.join("cells").join(name)
    }

    /// The manifest of a cell that is there.
    fn manifest(&self, name: &str) -> Option<Manifest> {
        serde_json::from_str(&fs::read_to_string(self.cell(name).join("manifest.json")).ok()?).ok()
    }

    fn is_done(&self, cell: &StudyCell) -> bool {
        self.manifest(&cell.name)
            .is_some_and(|there| there.key == cell.manifest.key)
    }

    fn parts(&self, cell: &StudyCell) -> PathBuf {
        self.path.join("parts").join(&cell.manifest.key[..32])
    }

    fn part(&self, cell: &StudyCell, (first, runs): (u64, u64)) -> PathBuf {
        self.parts(cell).join(format!("{first}+{runs}.part"))
    }

    fn has(&self, unit: &RunBlock<'_>, cell: &StudyCell) -> bool {
        self.is_done(cell) || (!unit.whole && read_part(&self.part(cell, unit.span())).is_some())
    }

    /// Returns true if every cell of a unit is computed.
    fn has_unit(&self, unit: &RunBlock<'_>) -> bool {
        unit.cells.iter().all(|cell| self.has(unit, cell))
    }

    /// The lock of a unit or cell, which the kernel frees when its process ends; none where another process works on it.
    /// Without locks (some shared disks) both compute the same bytes.
    fn lock(&self, name: &str) -> Result<Option<File>> {
        let locks = self.path.join("locks");
        let path = locks.join(name);
        let create = || fs::create_dir_all(&locks).and_then(|()| File::create(&path));
        // a process that finds all done removes the directory
        let file = create()
            .or_else(|_| create())
            .map_err(|e| Failure::unwritable(&path, e))?;
        Ok(match file.try_lock() {
            Err(fs::TryLockError::WouldBlock) => None,
            _ => Some(file),
        })
    }
}

/// All units, passes in the order of their first cells.
fn units<'a>(cells: &'a [StudyCell], context: &Context<'_>) -> Result<Vec<RunBlock<'a>>> {
    let mut passes: IndexMap<&str, Vec<&StudyCell>> = IndexMap::new();
    for cell in cells {
        passes.entry(&cell.noise).or_default().push(cell);
    }
    let shared = TrackCache::default();
    let mut units = Vec::new();
    for pass in passes.into_values() {
        let (request, runs) = (&pass[0].asked.request, pass[0].runs);
        let block = block_of(request, &shared, context)?;
        let unit = |first| RunBlock {
            cells: pass.clone(),
            first,
            runs: block.min(runs - first),
            whole: runs <= block,
        };
        units.extend((0..runs.max(1)).step_by(block as usize).map(unit));
    }
    Ok(units)
}

/// Units of shard `index` of `count`: contiguous, of equal cost.
fn shard<'a, 'b>(units: &'b [RunBlock<'a>], (index, count): (u64, u64)) -> Vec<&'b RunBlock<'a>> {
    let total: u64 = units.iter().map(RunBlock::cost).sum();
    let mut before = 0;
    let mut own = Vec::new();
    for unit in units {
        if u128::from(2 * before + unit.cost()) * u128::from(count) / u128::from(2 * total.max(1))
            == u128::from(index)
        {
            own.push(unit);
        }
        before += unit.cost();
    }
    own
}

/// Cells that cannot be computed, by their names.
type Failures = Vec<(String, Failure)>;

/// Computes the units that are not there and not in work elsewhere, small ones at once, until the context says stop.
fn work(
    place: &StudyDirectory<'_>,
    own: &[&RunBlock<'_>],
    context: &Context<'_>,
) -> Result<Failures> {
    let (mut failures, front) = (Failures::new(), CellReporter(context, Mutex::default()));
    let shared = TrackCache::default();
    let todo: Vec<&&RunBlock<'_>> = own.iter().filter(|unit| !place.has_unit(unit)).collect();
    context.begin("runs", todo.iter().map(|unit| unit.cost()).sum());
    let at_once = |unit: &RunBlock<'_>| (128 * context.threads() as u64 / unit.runs.max(8)).max(1);
    let mut rest = todo.as_slice();
    while let (Some(first), true) = (rest.first(), context.should_continue()) {
        let (now, later) = rest.split_at(rest.len().min(at_once(first) as usize));
        let computed = now
            .par_iter()
            .map(|unit| compute(place, unit, &shared, context, &front));
        let computed: Vec<Failures> = computed.collect::<Result<_>>()?;
        failures.extend(computed.into_iter().flatten());
        rest = later;
    }
    context.end();
    Ok(failures)
}

/// Computes what is missing of a unit. A cell that cannot be computed is named; others go on.
fn compute(
    place: &StudyDirectory<'_>,
    unit: &RunBlock<'_>,
    shared: &TrackCache,
    context: &Context<'_>,
    front: &CellReporter<'_>,
) -> Result<Failures> {
    let mut failures = Failures::new();
    let Some(_lock) = place.lock(&unit.lock())? else {
        return Ok(failures);
    };
    let missing = unit.cells.iter().filter(|cell| !place.has(unit, cell));
    let missing: Vec<&&StudyCell> = missing.collect();
    let mut failed = |cell: &StudyCell, failure| failures.push((cell.name.clone(), failure));
    let contexts: Vec<Context<'_>> = missing.iter().map(|cell| context_of(cell, front)).collect();
    let mut prepared = Vec::new();
    for (cell, context) in missing.iter().zip(&contexts) {
        match cell.asked.request.prepare(shared, context) {
            Ok(run) => prepared.push((*cell, run, context)),
            Err(failure) => failed(cell, failure),
        }
    }
    while !prepared.is_empty() {
        // turn-on biases that models state make other noise of cells that requested the same
        let first = prepared.remove(0);
        let (mut pass, rest): (Vec<_>, Vec<_>) = prepared
            .into_iter()
            .partition(|(_, run, _)| run.shares_noise_with(&first.1));
        prepared = rest;
        pass.insert(0, first);
        let runs: Vec<&PreparedRun<'_>> = pass.iter().map(|(_, run, _)| run).collect();
        let results = match columns(&runs, unit.first, unit.runs, context) {
            Ok(Some(results)) => results,
            Ok(None) => break,
            Err(failure) => {
                pass.iter()
                    .for_each(|(cell, _, _)| failed(cell, failure.clone()));
                continue;
            }
        };
        for ((cell, run, context), result) in pass.into_iter().zip(results) {
            if unit.whole {
                if let Err(failure) = write_cell(place, cell, run, result, context) {
                    if failure.code() == 1 && failure.file().is_some() {
                        return Err(failure);
                    }
                    failed(cell, failure);
                }
            } else if let Some(result) = result {
                write_part(&place.part(cell, unit.span()), &result)?;
            }
        }
    }
    Ok(failures)
}

/// Passes each warning of the cells on once; what they remark is for `--verbose`.
struct CellReporter<'a>(pub &'a Context<'a>, pub Mutex<HashSet<String>>);

impl Reporter for CellReporter<'_> {
    fn note(&self, note: Note) {
        let Note { importance, text } = note;
        if importance != Importance::Warning {
            self.0.detail(text);
        } else if self
            .1
            .lock()
            .is_ok_and(|mut seen| seen.insert(text.clone()))
        {
            self.0.warn(text);
        }
    }
}

fn context_of<'a>(cell: &StudyCell, front: &'a CellReporter<'_>) -> Context<'a> {
    Context::new(front, Some(cell.seed)).reading(cell.manifest.inputs.clone())
}

/// Finishes a cell whose runs are all there and writes its directory.
fn write_cell(
    place: &StudyDirectory<'_>,
    cell: &StudyCell,
    run: PreparedRun<'_>,
    result: Option<RunResult>,
    context: &Context<'_>,
) -> Result<()> {
    let answer = run.navigate(result, context)?;
    // looked at once more: a study that was edited may have been computed meanwhile
    if let Some(there) = place.manifest(&cell.name)
        && there.key != cell.manifest.key
        && !place.force
    {
        return Err(Failure::failed(difference(&there, &cell.manifest)));
    }
    let mut asked = cell.asked.clone();
    asked.out = Some(place.cell(&cell.name));
    let written = asked.write(&answer, &answer.document(), cell.manifest.clone(), context);
    match written {
        // another process has written the same meanwhile
        Err(_) if place.is_done(cell) => Ok(()),
        written => written.map(drop),
    }
}

/// Puts the parts of a cell together, where all are there.
fn assemble(
    place: &StudyDirectory<'_>,
    cell: &StudyCell,
    spans: &[(u64, u64)],
    context: &Context<'_>,
) -> Result<()> {
    let lock = place.lock(&cell.lock())?;
    if lock.is_none() || place.is_done(cell) {
        return Ok(());
    }
    let mut whole: Option<RunResult> = None;
    for span in spans {
        let Some(part) = read_part(&place.part(cell, *span)) else {
            return Ok(());
        };
        match &mut whole {
            Some(whole) => whole.append(part),
            None => whole = Some(part),
        }
    }
    let front = CellReporter(context, Mutex::default());
    let context = context_of(cell, &front);
    let run = cell
        .asked
        .request
        .prepare(&TrackCache::default(), &context)?;
    write_cell(place, cell, run, whole, &context)?;
    Ok(())
}

/// The runs of a part: postcard of the result, BLAKE3 of that.
fn write_part(path: &Path, result: &RunResult) -> Result<()> {
    let mut bytes = postcard::to_allocvec(result).map_err(Failure::failed)?;
    bytes.extend(blake3::hash(&bytes).as_bytes());
    match atomic::write(path, bytes) {
        Err(_) if read_part(path).is_some() => Ok(()),
        written => Ok(written?),
    }
}

/// The runs of a part, if it is there and whole.
fn read_part(path: &Path) -> Option<RunResult> {
    part_of(&fs::read(path).ok()?)
}

/// A part from its bytes, if they are whole.
pub(crate) fn part_of(bytes: &[u8]) -> Option<RunResult> {
    let (content, hash) = bytes.split_at_checked(bytes.len().checked_sub(blake3::OUT_LEN)?)?;
    let is_whole = blake3::hash(content).as_bytes() == hash;
    is_whole
        .then(|| postcard::from_bytes(content).ok())
        .flatten()
}

// Which part of a plan a process does: by flag, or by what the scheduler says.

/// `i/n`, i from 0.
fn parse_shard(text: &str) -> Result<(u64, u64), String> {
    text.split_once('/')
        .and_then(|(i, n)| Some((i.parse().ok()?, n.parse().ok()?)))
        .filter(|(index, count)| index < count)
        .ok_or_else(|| "expected i/n with i from 0 to n − 1, such as 0/4".to_owned())
}

/// Variables of schedulers: the index, and the first one, the step and how many there are, where the array says them.
const SCHEDULERS: [[&str; 4]; 4] = [
    ["HQ_TASK_ID", "", "", ""],
    [
        "SLURM_ARRAY_TASK_ID",
        "SLURM_ARRAY_TASK_MIN",
        "SLURM_ARRAY_TASK_STEP",
        "SLURM_ARRAY_TASK_COUNT",
    ],
    ["PBS_ARRAY_INDEX", "", "", ""],
    ["JOB_COMPLETION_INDEX", "", "", ""],
];

/// The shard of this process; none without a flag and a scheduler. `shards` is how many there are,
/// where the scheduler does not say.
fn find_shard(
    flag: Option<(u64, u64)>,
    shards: Option<u64>,
    variable: &dyn Fn(&str) -> Option<String>,
) -> Result<Option<(u64, u64)>> {
    if flag.is_some() {
        return Ok(flag);
    }
    let number = |name: &str| -> Result<Option<u64>> {
        let parsed = |text: String| {
            let number = text.trim().parse();
            number.map_err(|_| Failure::input(format!("{name}={text} is not a number")))
        };
        variable(name).map(parsed).transpose()
    };
    for [name, first, step, count] in SCHEDULERS {
        let Some(id) = number(name)? else { continue };
        // With --shards, tasks count from 0 whatever part of an array was submitted; without, the array says.
        let [first, step, count] = match shards {
            Some(_) => [None, None, shards],
            None => [number(first)?, number(step)?, number(count)?],
        };
        let Some(count) = count else {
            return refused(
                format!("{name}={id} names a shard, but not their number"),
                "add --shards N",
            );
        };
        let index = id.checked_sub(first.unwrap_or(0));
        let index = index.map(|i| i / step.unwrap_or(1).max(1));
        return match index.filter(|index| *index < count) {
            Some(index) => Ok(Some((index, count))),
            None => refused(
                format!("{name}={id} is not one of {count} shards"),
                format!("number the tasks from 0 to {}", count.saturating_sub(1)),
            ),
        };
    }
    match shards {
        None | Some(1) => Ok(None),
        Some(n) => refused(
            format!("--shards {n}: no scheduler names this shard"),
            "give --shard i/n",
        ),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::HashMap;

    fn found(flag: Option<&str>, shards: Option<u64>, set: &[(&str, &str)]) -> (u64, u64) {
        let set: HashMap<&str, &str> = set.iter().copied().collect();
        let variable = |name: &str| set.get(name).map(|v| (*v).to_owned());
        let flag = flag.map(|f| parse_shard(f).unwrap());
        find_shard(flag, shards, &variable)
            .unwrap()
            .unwrap_or((0, 1))
    }

    #[test]
    fn schedulers_are_understood() {
        let slurm = [
            ("SLURM_ARRAY_TASK_ID", "14"),
            ("SLURM_ARRAY_TASK_MIN", "10"),
            ("SLURM_ARRAY_TASK_STEP", "2"),
            ("SLURM_ARRAY_TASK_COUNT", "4"),
        ];
        let (hq, pbs) = (("HQ_TASK_ID", "7"), ("PBS_ARRAY_INDEX", "0"));
        let kubernetes = ("JOB_COMPLETION_INDEX", "4");
        assert_eq!(found(None, None, &[]), (0, 1));
        assert_eq!(found(Some("2/3"), None, &[hq]), (2, 3));
        assert_eq!(found(None, Some(8), &[hq]), (7, 8));
        assert_eq!(found(None, None, &slurm), (2, 4));
        assert_eq!(found(None, Some(20), &slurm), (14, 20));
        assert_eq!(found(None, Some(5), &[pbs]), (0, 5));
        assert_eq!(found(None, Some(5), &[kubernetes]), (4, 5));
    }
}
