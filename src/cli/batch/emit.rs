//! `nav-sim batch emit`: scripts for schedulers.

use super::{Place, duration};
use crate::cli::{Failure, Session};
use crate::study::{file, plan_in};
use std::path::Path;

/// Print a script that runs a planned study on a cluster or here
///
/// Paths are as seen from the directory in which the script is submitted; it must be shared by all machines.
/// A script may be submitted any number of times: what is done is skipped. If the study is planned already, a
/// --time too short for a unit is refused.
#[derive(clap::Args, Debug)]
#[command(before_help = "\
Examples:
  nav-sim batch emit slurm examples/quick_study.toml --shards 16 --time 4h > study.sh
  nav-sim batch emit hyperqueue examples/quick_study.toml --shards 64 > study.py
  nav-sim batch emit local examples/quick_study.toml --shards 2 > study.sh && bash -n study.sh")]
pub(crate) struct Args {
    /// Scheduler
    #[arg(value_enum)]
    target: Target,
    #[command(flatten)]
    place: Place,
    /// Number of tasks
    #[arg(long, value_name = "N", default_value_t = 16, value_parser = clap::value_parser!(u64).range(1..=1_000_000))]
    shards: u64,
    /// Processors per task
    #[arg(long, value_name = "C", default_value_t = 2, value_parser = clap::value_parser!(u16).range(1..))]
    cpus: u16,
    /// Longest time of a task: seconds, or with s, m, h
    #[arg(long, value_name = "TIME", default_value = "1h", value_parser = super::run::time)]
    time: std::time::Duration,
}

#[derive(clap::ValueEnum, Clone, Copy, Debug, PartialEq, Eq)]
enum Target {
    /// HyperQueue, by its Python package: server and workers here, or a server that runs already
    Hyperqueue,
    /// A Slurm job array
    Slurm,
    /// A PBS job array
    Pbs,
    /// A Kubernetes Indexed Job
    K8s,
    /// Processes on this machine
    Local,
}

pub(crate) fn run(args: &Args, session: &Session) -> Result<(), Failure> {
    file::read(&args.place.study)?;
    let script = Script::of(args, session.asked_seed());
    let is_planned = plan_in(&args.place.directory())?.is_some();
    if is_planned && args.target != Target::Local {
        let planned = args.place.planned(session.asked_seed())?;
        long_enough(script.limit_s() as f64, planned.longest_unit_s(u64::from(args.cpus)), session)?;
    }
    session.result(script.text(args.target).trim_end());
    Ok(())
}

/// A task must be able to finish a unit, or it would be started again for ever.
fn long_enough(limit_s: f64, unit_s: f64, session: &Session) -> Result<(), Failure> {
    let unit = format!("a unit takes about {} by the plan", duration(unit_s));
    if limit_s < unit_s {
        let message = format!("--time: a task works for {}, but {unit}", duration(limit_s));
        return Err(Failure::input(message).hint("a longer --time, or a study with fewer unit_runs"));
    }
    if limit_s < 3.0 * unit_s {
        session.warn(format!("a task works for {}, and {unit}", duration(limit_s)));
    }
    Ok(())
}

/// What goes into every script.
struct Script {
    seed: Option<u64>,
    study: String,
    directory: String,
    name: String,
    shards: u64,
    cpus: u16,
    seconds: u64,
}

impl Script {
    fn of(args: &Args, seed: Option<u64>) -> Self {
        let text = |path: &Path| path.to_string_lossy().into_owned();
        let stem = args.place.study.file_stem().unwrap_or_default().to_string_lossy();
        let tame = |c: char| if c.is_ascii_alphanumeric() { c.to_ascii_lowercase() } else { '-' };
        Self {
            seed,
            study: text(&args.place.study),
            directory: text(&args.place.directory()),
            name: stem.chars().map(tame).collect::<String>().trim_matches('-').to_owned(),
            shards: args.shards,
            cpus: args.cpus,
            seconds: args.time.as_secs().max(1),
        }
    }

    fn text(&self, target: Target) -> String {
        let template = match target {
            Target::Hyperqueue => include_str!("templates/hyperqueue.py"),
            Target::Slurm => include_str!("templates/slurm.sh"),
            Target::Pbs => include_str!("templates/pbs.sh"),
            Target::K8s => include_str!("templates/k8s.yaml"),
            Target::Local => include_str!("templates/local.sh"),
        };
        filled(template, &self.values())
    }

    /// What stands for each name in the templates.
    fn values(&self) -> Vec<(&'static str, String)> {
        let quoted = |words: &[String]| words.iter().map(|w| json_quoted(w)).collect::<Vec<_>>().join(", ");
        // an array of one is no array to PBS
        let is_array = self.shards > 1;
        let last = self.shards - 1;
        vec![
            ("name", self.name.clone()),
            ("short_name", self.name.chars().take(15).collect()),
            ("shards", self.shards.to_string()),
            ("last", last.to_string()),
            ("cpus", self.cpus.to_string()),
            ("clock", self.clock()),
            ("array", if is_array { format!("#PBS -J 0-{last}\n") } else { String::new() }),
            ("index", if is_array { String::new() } else { "export PBS_ARRAY_INDEX=0\n".to_owned() }),
            ("plan", shell_words(&self.words("plan"))),
            ("run", shell_words(&self.words("run"))),
            ("merge", shell_words(&self.words("merge"))),
            ("task", shell_words(&self.task())),
            ("command", quoted(&["sh".into(), "-c".into(), format!("exec {}", shell_words(&self.task()))])),
            ("run_words", quoted(&self.task())),
            ("plan_words", quoted(&self.words("plan"))),
            ("merge_words", quoted(&self.words("merge"))),
        ]
    }

    /// Words of a command of the study.
    fn words(&self, command: &str) -> Vec<String> {
        let words = ["nav-sim", "batch", command, &self.study, "--out", &self.directory].map(str::to_owned);
        let seed = self.seed.map(|seed| ["--seed".to_owned(), seed.to_string()]);
        words.into_iter().chain(seed.into_iter().flatten()).collect()
    }

    /// How long a task works (s): it stops in time to be counted.
    fn limit_s(&self) -> u64 {
        self.seconds - (self.seconds / 10).min(120)
    }

    /// Words of the working command of a task whose index the scheduler gives.
    fn task(&self) -> Vec<String> {
        let mut words = self.words("run");
        let (shards, cpus, limit) =
            (self.shards.to_string(), self.cpus.to_string(), format!("{}s", self.limit_s()));
        let options = ["--shards", &shards, "-j", &cpus, "--time-limit", &limit, "--no-progress"];
        words.extend(options.map(str::to_owned));
        words
    }

    fn clock(&self) -> String {
        format!("{:02}:{:02}:{:02}", self.seconds / 3600, self.seconds / 60 % 60, self.seconds % 60)
    }
}

/// A template with values in place of `{{name}}`. Values are not searched: a study's path may hold anything.
fn filled(template: &str, values: &[(&str, String)]) -> String {
    let mut text = String::new();
    let mut rest = template;
    while let Some((before, after)) = rest.split_once("{{") {
        let (name, after) = after.split_once("}}").unwrap_or((after, ""));
        text += before;
        text += values.iter().find(|(known, _)| *known == name).map_or("", |(_, value)| value);
        rest = after;
    }
    text + rest
}

/// Words as a shell reads them.
pub(in crate::cli) fn shell_words(words: &[String]) -> String {
    words.iter().map(|w| shell_quoted(w)).collect::<Vec<_>>().join(" ")
}

fn shell_quoted(word: &str) -> String {
    let plain = |c: char| c.is_ascii_alphanumeric() || "-_./:,+=".contains(c);
    if !word.is_empty() && word.chars().all(plain) {
        word.to_owned()
    } else {
        format!("'{}'", word.replace('\'', "'\\''"))
    }
}

/// Also a Python and a YAML text.
fn json_quoted(word: &str) -> String {
    serde_json::Value::from(word).to_string()
}
