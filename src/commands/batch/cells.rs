//! From a study to its cells: each a request of `run` without lists.

use crate::app::inputs::merge;
use crate::app::{
    Asked, Command, Failure, Input, Manifest, OrHelp, Refuse, Result, argument, is_path,
    is_repeated,
};
use crate::commands::run::Run;
use crate::io::{input, source};
use crate::report::comparison_table::in_order;
use clap::Args;
use nav_sim_navigation::scenario::{Method, Scenario};
use schemars::JsonSchema;
use serde::Deserialize;
use serde_json::Map;
use std::collections::{HashMap, HashSet};
use std::path::{Path, PathBuf};
use toml::{Table, Value};

/// More cells than this are a mistake.
const MOST: usize = 100_000;

/// A run whose values may be lists: nav-sim batch
#[derive(Debug, Clone, Default, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
#[schemars(title = "Study")]
pub(crate) struct Study {
    /// Options of `run` as keys, and sections of a scenario; a list is an axis where a single run would not take it
    #[schemars(with = "Map<String, serde_json::Value>")]
    pub run: Table,
    /// Axes by name: a list of labels, each in the place of `{NAME}`, or a table of a label's keys of `run`
    #[schemars(with = "Map<String, serde_json::Value>")]
    pub vary: Table,
    /// Labels of the reference, by axis (default: the first model)
    #[schemars(with = "Map<String, serde_json::Value>")]
    pub reference: Table,
}

/// Axis and label, `[vary]` first, then lists, as written.
pub(crate) type Labels = Vec<(String, String)>;

/// One request.
pub(crate) struct Cell {
    /// Name of its run directory.
    pub name: String,
    /// Its place on each axis.
    pub labels: Labels,
    /// The command.
    pub asked: Asked<Run>,
    /// Seed of all random numbers.
    pub seed: u64,
    /// The manifest before the run: what its key is made of.
    pub manifest: Manifest,
    /// Monte-Carlo runs; 1 of a covariance analysis.
    pub runs: u64,
    /// All that the noise depends on: cells that share it differ in the filter alone.
    pub noise: String,
}

impl Study {
    /// Reads a study; `set` are keys of `[run]` over its own, as `KEY=VALUE`.
    pub(crate) fn read(path: &Path, set: &[String]) -> Result<Self> {
        let text = source::text(path).map_err(|e| crate::io::Failure::io(path, e))?;
        let is_json = path.extension().is_some_and(|ending| ending == "json");
        let mut study: Self = match is_json {
            true => serde_json::from_str(&text).refuse_within(path.display())?,
            false => toml::from_str(&text).refuse_within(path.display())?,
        };
        for assignment in set {
            let (key, value) = assignment.split_once('=').unwrap_or((assignment, ""));
            // a word without quotes is a text
            let parsed = format!("{key} = {value}").parse::<Table>();
            let quoted = || format!("{key} = {}", Value::from(value)).parse::<Table>();
            let over = parsed.or_else(|_| quoted()).refuse_within("--set")?;
            merge(&mut study.run, over);
        }
        Ok(study)
    }

    /// All cells, `[vary]` outermost; paths are relative to `beside`.
    pub(crate) fn cells(&self, beside: &Path) -> Result<Vec<Cell>> {
        let mut requests = vec![(Labels::new(), self.run.clone())];
        for (axis, values) in &self.vary {
            let values = named(axis, values)?;
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
        let mut door = Door::new(beside);
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
            if !names.insert(name.to_lowercase()) {
                return Err(Failure::input(format!("two cells have the name {name}"))
                    .hint("name the values under [vary], a table of keys each"));
            }
            door.cell(name.clone(), labels, run)
                .map_err(|e| e.within(&format!("cell {name}")))
        });
        cells.collect()
    }

    /// The labels that references have: those of the study, else the first model.
    pub(crate) fn fixed(&self, cells: &[Cell]) -> Labels {
        let given = self.reference.iter();
        let given: Labels = given
            .map(|(axis, label)| (axis.clone(), text(label)))
            .collect();
        if !given.is_empty() {
            return given;
        }
        let mut labels = cells.iter().flat_map(|cell| &cell.labels);
        let model = labels.find(|(axis, _)| axis == "model");
        model.cloned().into_iter().collect()
    }

    fn check_reference(&self, all: &[(Labels, Table)]) -> Result<()> {
        for (axis, label) in &self.reference {
            let label = text(label);
            let labels = all.iter().flat_map(|(labels, _)| labels);
            let on_axis = labels.filter(|(other, _)| other == axis);
            let known = in_order(on_axis.map(|(_, label)| label.as_str()));
            if !known.contains(&label.as_str()) {
                let message = format!("\"reference.{axis}\" = \"{label}\" is no label of an axis");
                return Err(Failure::input(message).hint(format!("labels: {}", known.join(", "))));
            }
        }
        Ok(())
    }
}

/// What a single run takes: the parser of its options, and the reader of its scenario.
struct Door {
    command: clap::Command,
    beside: PathBuf,
    taken: HashMap<String, bool>,
    inputs: HashMap<PathBuf, Input>,
}

impl Door {
    fn new(beside: &Path) -> Self {
        Self {
            command: Asked::<Run>::augment_args(clap::Command::new(Run::NAME)),
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
        if all.len() > MOST {
            return Err(Failure::input(format!("more than {MOST} cells")));
        }
        let is_new = |path: &str| !labels.iter().any(|(axis, _)| axis == path);
        let mut leaves = leaves(&run, "").into_iter();
        let Some((path, list)) = leaves.find_map(|(path, value)| {
            let list = value.as_array()?;
            let is_axis = is_new(&path)
                && !self.takes(&path, value)
                && list.iter().any(|one| self.takes(&path, one));
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

    /// Whether a single run takes this value of a key.
    fn takes(&mut self, path: &str, value: &Value) -> bool {
        let memory = format!("{path}={value}");
        if let Some(known) = self.taken.get(&memory) {
            return *known;
        }
        let takes = match argument(&self.command, path) {
            _ if path == "seed" => value.as_integer().is_some_and(|seed| seed >= 0),
            Some(arg) => {
                let list = value.as_array();
                // any text is a path: a list is none, and a list of lists is no list of paths
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
                    && named_request(&request).is_ok_and(|r| Asked::<Run>::named(&r).is_ok())
            }
            None => nested(path, value.clone()).try_into::<Scenario>().is_ok(),
        };
        self.taken.insert(memory, takes);
        takes
    }

    /// Label of a list's value: the stem of a file, else its text.
    fn label(&self, path: &str, value: &Value) -> Result<String> {
        let stem = |text: String| match self.is_path(path) {
            true => Path::new(&text)
                .file_stem()
                .map_or(text.clone(), |stem| stem.to_string_lossy().into_owned()),
            false => text,
        };
        match value {
            Value::Array(list) => Ok(list
                .iter()
                .map(|one| stem(text(one)))
                .collect::<Vec<_>>()
                .join("+")),
            Value::Table(_) => Err(
                Failure::input(format!("\"run.{path}\" is a list of tables"))
                    .hint(format!("name them: [vary.{path}] LABEL = {{ {path} = … }}")),
            ),
            one => Ok(stem(text(one))),
        }
    }

    /// The command of a request.
    fn cell(&mut self, name: String, labels: Labels, mut run: Table) -> Result<Cell> {
        for key in ["out", "plot"] {
            if run.contains_key(key) {
                return Err(Failure::input(format!(
                    "\"run.{key}\": a study has its own directory"
                ))
                .hint("name it with -o"));
            }
        }
        let seed = match run.remove("seed") {
            None => crate::app::DEFAULT_SEED,
            Some(seed) => seed
                .as_integer()
                .and_then(|seed| u64::try_from(seed).ok())
                .ok_or_else(|| {
                    Failure::input(format!("\"run.seed\" = {seed} is not a whole number ≥ 0"))
                })?,
        };
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
        let asked = Asked::<Run>::named(&named_request(&run)?)?;
        let scenario = asked.request.scenario()?;
        let mut inputs = Vec::new();
        for (role, path) in asked.request.inputs()? {
            if !self.inputs.contains_key(&path) {
                let read =
                    input::input(role, &path).or_help("paths are relative to the study's file")?;
                self.inputs.insert(path.clone(), read);
            }
            inputs.push(Input {
                role: role.to_owned(),
                ..self.inputs[&path].clone()
            });
        }
        let mut options = asked.options.clone();
        options.insert("seed".to_owned(), vec![seed.to_string()]);
        let manifest = Manifest::new(Run::NAME, options.clone(), inputs.clone());
        // What the filter believes: its states, and its model where something else makes the errors.
        options.remove("states");
        if let Some(set) = options.get_mut("set") {
            set.retain(|setting| !setting.starts_with("filter.states="));
        }
        if asked.request.truth.is_some() || !asked.request.recordings.is_empty() {
            inputs.retain(|input| input.role != "model");
        }
        let noise = Manifest::new(Run::NAME, options, inputs).key;
        let is_sampled = scenario.run.method != Method::Lincov;
        let runs = if is_sampled { scenario.run.runs } else { 1 };
        Ok(Cell {
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
                let keys = keys
                    .as_table()
                    .ok_or_else(|| refused("has a label without keys"))?;
                Ok((label.clone(), keys.clone()))
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
                Some((unknown, _)) => Err(Failure::input(format!(
                    "\"{text}\": there is no axis {unknown}"
                ))
                .hint("name it under [vary]")),
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
        Value::Table(inner) => leaves(inner, &format!("{prefix}{key}.")),
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
    serde_json::to_value(run)
        .and_then(serde_json::from_value)
        .refuse_within("[run]")
}

fn plus(labels: &Labels, axis: &str, label: &str) -> Labels {
    let own = [(axis.to_owned(), label.to_owned())];
    labels.iter().cloned().chain(own).collect()
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
