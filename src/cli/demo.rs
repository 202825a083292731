//! `nav-sim demo`: the case study of the paper, command by command.

use super::{Cli, Common, Failure, Session};
use crate::app::{Answer, Front, inputs};
use crate::commands::batch::{BatchRequest, Outcome};
use crate::failure::refused;
use crate::io::atomic::Written;
use crate::io::{atomic, model_file};
use crate::report;
use clap::Parser;
use serde::{Deserialize, Serialize};
use std::path::{Component, Path};

/// Run the case study of Minaretzis et al. 2024, Section V, on a virtual IMU: calibrate with three estimators
/// on clean and corrupted recordings, navigate with each model, compare (their Table I)
///
/// Runs other commands of nav-sim one after the other (--print lists them, to be pasted, changed and run again): eight static
/// recordings of a virtual consumer IMU (scenario I), the same with replaced points, vibrations and steps (II), and with two
/// abnormal recordings of each sensor (III); AWV, SR-AWV and DR-AWV on each; a study of Monte-Carlo navigation with errors from
/// windows of one more clean recording and two outages of 90 s, the filter with a state for each AR1 and random walk as in the
/// paper; the ASEE of each filter relative to AWV in scenario I. If interrupted, the same command continues: demo.json in the
/// directory says how far it is.
#[derive(clap::Args)]
#[command(before_help = "\
Examples:
  nav-sim demo --seed 1 --samples 100000 --runs 8
  nav-sim demo --seed 1 --print -o study
  nav-sim demo --seed 1 --print > paper_section5.sh")]
pub(crate) struct Args {
    /// Samples of each recording (default: 87 minutes, as in the paper; short ones do not show its ordering)
    #[arg(long, value_name = "T", default_value_t = 524_284)]
    samples: u64,
    /// Monte-Carlo runs with each model
    #[arg(long, value_name = "N", default_value_t = 100)]
    runs: u64,
    /// Print the commands, run nothing
    #[arg(long)]
    print: bool,
    /// Directory to write to
    #[arg(long, short, value_name = "DIR", default_value = "out/demo")]
    out: String,
}

const IMU: &str = "calib_data/consumer_mems.toml";
const TRAJECTORY: &str = "trajectories/land_vehicle.toml";
const SCENARIOS: [&str; 3] = ["I", "II", "III"];
const ESTIMATORS: [&str; 3] = ["awv", "sr-awv", "dr-awv"];

/// How far a demo is: demo.json of its directory.
#[derive(PartialEq, Serialize, Deserialize)]
struct Progress {
    version: String,
    seed: u64,
    samples: u64,
    runs: u64,
    commands_done: usize,
}

fn foreign(path: &Path) -> Failure {
    let message = format!(
        "{} is not of this command: it is not replaced",
        path.display()
    );
    Failure::input(message).hint("choose another directory with --out, or move it away")
}

impl Progress {
    /// What is there to go on with, or a beginning.
    fn of(args: &Args, path: &Path, session: &Session) -> Result<Self, Failure> {
        let there = std::fs::read_to_string(path).ok();
        let there = there.map(|text| serde_json::from_str::<Self>(&text));
        let begun = there.transpose().map_err(|_| foreign(path))?;
        let mut new = Self {
            version: env!("CARGO_PKG_VERSION").to_owned(),
            seed: session.context().seed_or(begun.as_ref().map(|b| b.seed)),
            samples: args.samples,
            runs: args.runs,
            commands_done: begun.as_ref().map_or(0, |begun| begun.commands_done),
        };
        if begun.is_some_and(|begun| begun != new) {
            if !session.common.force {
                let path = path.display();
                let message = format!("{path} is of a demo of another seed, size or version");
                let hint = "name another directory with --out, or replace it with --force";
                return refused(message, hint);
            }
            new.commands_done = 0;
        }
        Ok(new)
    }
}

pub(crate) fn run(args: &Args, session: &Session) -> Result<(), Failure> {
    let out = Path::new(&args.out);
    let study = out.join("study.toml");
    if args.print {
        let seed = session.context().seed_or(None);
        let mut lines: Vec<String> = commands(args, seed).iter().map(|c| typed(c)).collect();
        let quoted = shell_quoted(&study.display().to_string());
        lines.push(format!(
            "cat > {quoted} <<'END'\n{}END\nnav-sim batch {quoted} -o {}",
            study_text(args, seed)?,
            shell_quoted(&args.out)
        ));
        session.result(lines.join("\n"));
        return Ok(());
    }
    refuse_the_impossible(args, session)?;
    let path = out.join("demo.json");
    let _own = atomic::claim_file(&path, [])?;
    let page = out.join("report.html");
    let _page = atomic::claim_result(&page, [], Written::Page, session.common.force)?;
    let mut progress = Progress::of(args, &path, session)?;
    let commands = commands(args, progress.seed);
    if study.exists() && !path.exists() {
        return Err(foreign(&study));
    }
    let done = progress.commands_done;
    if done > 0 {
        let (out, count, seed) = (&args.out, commands.len(), progress.seed);
        session.say(format!(
            "{out}: {done} of {count} commands are done, seed {seed}"
        ));
    }
    atomic::write(&path, report::json(&progress))?;
    session.begin("commands", (commands.len() - done) as u64);
    for (i, command) in commands.iter().enumerate().skip(done) {
        session.context().detail(format!("$ {}", typed(command)));
        let words = std::iter::once("nav-sim").chain(command.iter().map(String::as_str));
        let cli = Cli::try_parse_from(words).map_err(Failure::input)?;
        // its results and remarks are kept back
        cli.command.run(Session {
            common: Common {
                seed: cli.common.seed,
                quiet: !session.common.verbose,
                ..session.common.clone()
            },
            given: session.given.clone(),
            is_muted: true,
            ..Session::default()
        })?;
        progress.commands_done = i + 1;
        atomic::write(&path, report::json(&progress))?;
        session.advance(1);
    }
    session.end();
    atomic::write(&study, study_text(args, progress.seed)?)?;
    let request = BatchRequest {
        study,
        out: Some(out.to_owned()),
        states: ["pos_e_m", "roll_deg"].map(str::to_owned).to_vec(),
        force: session.common.force,
        ..BatchRequest::default()
    };
    let Outcome::Merged(found) = request.run(&|_| None, &session.context())? else {
        return Err(Failure::stopped("cells are in work elsewhere")
            .hint("the same command goes on where it was"));
    };
    let found = found.comparisons.into_iter().next();
    let found = found.ok_or_else(|| Failure::could_not("there is nothing to compare"))?;
    session.show(&found, &found.document(), None);
    session.say(format!("all results: {}", page.display()));
    Ok(())
}

/// The study of the demo; its paths are relative to the directory of results where that is.
fn study_text(args: &Args, seed: u64) -> Result<String, Failure> {
    let out = Path::new(&args.out);
    let is_below = out.is_relative()
        && out
            .components()
            .all(|part| matches!(part, Component::Normal(_)));
    let trajectory = match is_below {
        true => Path::new(&"../".repeat(out.components().count())).join(TRAJECTORY),
        false => Path::new(TRAJECTORY)
            .canonicalize()
            .map_err(Failure::could_not)?,
    };
    let (trajectory, runs) = (
        toml::Value::from(trajectory.display().to_string()),
        args.runs,
    );
    Ok(format!(
        "[run]
trajectory = {trajectory}
static = [\"ninth\"] # windows of one more clean recording are the errors of the simulated INS
model = \"models/{{scenario}}_{{estimator}}.toml\"
filter = \"full\" # a state for each AR1 and random walk, as in the paper
runs = {runs}
seed = {seed}

[vary]
scenario = {SCENARIOS:?}
estimator = {ESTIMATORS:?}

[reference]
scenario = \"I\"
estimator = \"awv\"
"
    ))
}

/// Refuses no runs, and recordings in which no window is as long as the trajectory, before anything is made.
fn refuse_the_impossible(args: &Args, session: &Session) -> Result<(), Failure> {
    if args.runs == 0 {
        return refused("--runs 0: there is nothing to compare", "at least --runs 1");
    }
    let of_repository = |e: Failure| {
        e.hint("the demo takes its IMU and its trajectory from the top of the repository: run it there")
    };
    let trajectory =
        inputs::trajectory(Path::new(TRAJECTORY), &session.context()).map_err(of_repository)?;
    let rate_hz = model_file::read(Path::new(IMU))
        .map_err(of_repository)?
        .model
        .rate_hz;
    let needed = ((trajectory.end_s() - trajectory.start_s()) * rate_hz).ceil();
    if args.samples as f64 >= needed {
        return Ok(());
    }
    refused(
        format!(
            "--samples {}: the INS errors are windows of a recording, as long as the trajectory",
            args.samples
        ),
        format!("at least --samples {needed}"),
    )
}

/// The commands, as words.
fn commands(args: &Args, seed: u64) -> Vec<Vec<String>> {
    let synthesize = |rest: String| {
        format!(
            "synthesize {IMU} --samples {} --spread {rest}",
            args.samples
        )
    };
    let mut lines = Vec::new();
    for scenario in SCENARIOS {
        let corrupted = if scenario == "I" {
            String::new()
        } else {
            format!("--contaminate section5-{scenario}")
        };
        lines.push(synthesize(format!(
            "--replicates 8 --axes x {corrupted} --seed {seed} -o @/{scenario}"
        )));
    }
    lines.push(synthesize(format!(
        "--seed {} -o @/ninth",
        seed.wrapping_add(1)
    )));
    for scenario in SCENARIOS {
        lines.push(format!(
            "calibrate @/{scenario} --estimator all --seed {seed} -o @/models/{scenario}.toml"
        ));
    }
    // The directory takes its place after the words are apart: its name may hold blanks.
    let words = |line: &String| {
        line.split_whitespace()
            .map(|word| word.replace('@', &args.out))
            .collect()
    };
    lines.iter().map(words).collect()
}

/// A command as it would be typed.
fn typed(command: &[String]) -> String {
    let words: Vec<String> = command.iter().map(|word| shell_quoted(word)).collect();
    format!("nav-sim {}", words.join(" "))
}

/// A word as a shell reads it.
fn shell_quoted(word: &str) -> String {
    let plain = |c: char| c.is_ascii_alphanumeric() || "-_./:,+=".contains(c);
    if !word.is_empty() && word.chars().all(plain) {
        word.to_owned()
    } else {
        format!("'{}'", word.replace('\'', "'\\''"))
    }
}
