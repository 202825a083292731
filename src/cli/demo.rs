//! `nav-sim demo`: the case study of the paper, command by command.

use super::{Cli, Common, Failure, Session};
use crate::app::{Answer, Reporter};
use crate::commands::batch::{BatchOutcome, BatchRequest};
use crate::io::atomic;
use clap::{Parser, value_parser};
use std::path::{Component, Path};

/// Run the case study of Minaretzis et al. 2024, Section V, on a virtual IMU: calibrate with three estimators
/// on clean and corrupted recordings, navigate with each model, compare (their Table I)
///
/// Runs other commands of nav-sim one after the other (--print lists them, to be pasted, changed and run again): eight static
/// recordings of a virtual consumer IMU (scenario I), the same with replaced points, vibrations and steps (II), and with two
/// abnormal recordings of each sensor (III); AWV, SR-AWV and DR-AWV on each; a study of Monte-Carlo navigation with errors from
/// windows of one more clean recording and two outages of 90 s, the filter with a state for each AR1 and random walk as in the
/// paper; the ASEE of each filter relative to AWV in scenario I. If interrupted, the same command makes recordings and models anew
/// and goes on with the study.
#[derive(clap::Args)]
pub(crate) struct DemoArgs {
    /// Samples of each recording, at least the 900 s of the drive (default: 87 minutes, as in the paper; short ones do not
    /// show its ordering)
    #[arg(long, value_name = "T", default_value_t = 524_284, value_parser = value_parser!(u64).range(90_000..=1_000_000_000))]
    samples: u64,
    /// Monte-Carlo runs with each model
    #[arg(long, value_name = "N", default_value_t = 100, value_parser = value_parser!(u64).range(1..=1_000_000))]
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
/// Beginning of its study.
const HEAD: &str = "# nav-sim demo --samples";
const SCENARIOS: [&str; 3] = ["I", "II", "III"];
const ESTIMATORS: [&str; 3] = ["awv", "sr-awv", "dr-awv"];

pub(crate) fn run(args: &DemoArgs, session: &Session) -> Result<(), Failure> {
    let out = Path::new(&args.out);
    let (study, seed) = (out.join("study.toml"), session.context().seed_or(None));
    let (text, commands) = (study_text(args, seed)?, commands(args, seed));
    if args.print {
        let mut lines: Vec<String> = commands.iter().map(|c| typed(c)).collect();
        let quoted = shell_quoted(&study.display().to_string());
        lines.push(format!(
            "cat > {quoted} <<'END'\n{text}END\nnav-sim batch {quoted} -o {}",
            shell_quoted(&args.out)
        ));
        session.result(lines.join("\n"));
        return Ok(());
    }
    let force = session.common.force;
    let page = out.join("report.html");
    let _page = atomic::claim_file(&page, ".html", [])?;
    // The study at the end would refuse another command's directory, after minutes.
    if !study.exists() {
        atomic::guard_others(&out.join("manifest.json"), "manifest.json")?;
    }
    let there = std::fs::read_to_string(&study).unwrap_or_else(|_| text.clone());
    if there != text && !(force && there.starts_with(HEAD)) {
        let message = format!("{} belongs to another demo", study.display());
        let hint = "name another place, or replace it with --force";
        return Err(Failure::input(message).hint(hint));
    }
    atomic::write(&study, text)?;
    session.begin("commands", commands.len() as u64);
    for command in &commands {
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
        session.advance(1);
    }
    session.end();
    let request = BatchRequest {
        study,
        out: Some(out.to_owned()),
        force,
        ..BatchRequest::default()
    };
    let BatchOutcome::Merged(found) = request.run(&|_| None, &session.context())? else {
        return Err(Failure::stopped("cells are being computed elsewhere")
            .hint("the same command continues"));
    };
    if let Some(found) = found.comparisons.first() {
        session.show(found, &found.document(), None);
    }
    session.say(format!("all results: {}", page.display()));
    Ok(())
}

/// The study of the demo; its paths are relative to the directory of results where that is.
fn study_text(args: &DemoArgs, seed: u64) -> Result<String, Failure> {
    let out = Path::new(&args.out);
    let is_below = out.is_relative()
        && out
            .components()
            .all(|part| matches!(part, Component::Normal(_)));
    let trajectory = match is_below {
        true => Path::new(&"../".repeat(out.components().count())).join(TRAJECTORY),
        false => std::path::absolute(TRAJECTORY).map_err(Failure::failed)?,
    };
    let (trajectory, runs) = (
        toml::Value::from(trajectory.display().to_string()),
        args.runs,
    );
    let samples = args.samples;
    Ok(format!(
        "{HEAD} {samples}
[run]
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

/// The commands, as words.
fn commands(args: &DemoArgs, seed: u64) -> Vec<Vec<String>> {
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
