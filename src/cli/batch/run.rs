//! `nav-sim batch run`: the units of a shard that are not done yet.

use super::Place;
use super::shard;
use super::watch::Watch;
use crate::app::Context;
use crate::cli::{Failure, Session};
use crate::study::{self, RunOptions, Shard};
use serde_json::json;
use signal_hook::consts::{SIGINT, SIGTERM};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// Compute the units of work that are not done yet, all or those of one shard
///
/// Each unit file appears whole, by rename, with a checksum. Intact units are skipped, damaged ones are computed
/// again. On SIGTERM, or at the time limit, the current unit is dropped (with method = "lincov" it is finished) and the
/// exit code is 75: run again to continue (exit code 1 if the time limit was too short for a single unit). Any number
/// of processes may work at once; two on the same shard waste time but do no harm.
#[derive(clap::Args, Debug)]
#[command(before_help = "\
Examples:
  nav-sim batch plan examples/quick_study.toml --seed 1 \\
      && nav-sim batch run examples/quick_study.toml
  nav-sim batch run examples/quick_study.toml --shard 0/2 --time-limit 50m
  nav-sim batch run examples/quick_study.toml --shard 1/2 -j 1")]
pub(crate) struct Args {
    #[command(flatten)]
    place: Place,
    /// Which shard of how many, from 0/n to n−1/n (default: from HQ_TASK_ID, SLURM_ARRAY_TASK_ID,
    /// PBS_ARRAY_INDEX or JOB_COMPLETION_INDEX, else everything)
    #[arg(long, value_name = "I/N", value_parser = shard::parse)]
    shard: Option<Shard>,
    /// Number of shards, if only the index comes from the scheduler
    #[arg(long, value_name = "N", conflicts_with = "shard", value_parser = clap::value_parser!(u64).range(1..))]
    shards: Option<u64>,
    /// Stop after this time (exit code 75; 1 if no unit was finished): seconds, or with s, m, h
    #[arg(long, value_name = "TIME", value_parser = time)]
    time_limit: Option<Duration>,
}

/// `90`, `90s`, `1.5m`, `2h`.
pub(super) fn time(text: &str) -> Result<Duration, String> {
    let (number, unit) = match text.char_indices().last() {
        Some((i, 's')) => (&text[..i], 1.0),
        Some((i, 'm')) => (&text[..i], 60.0),
        Some((i, 'h')) => (&text[..i], 3600.0),
        _ => (text, 1.0),
    };
    let seconds = number
        .parse::<f64>()
        .ok()
        .map(|x| x * unit)
        .and_then(|s| Duration::try_from_secs_f64(s).ok());
    seconds.ok_or_else(|| "expected a time such as 3000, 50m or 1.5h".to_owned())
}

/// Why to stop.
struct Stop {
    terminated: Arc<AtomicBool>,
    interrupted: Arc<AtomicBool>,
    deadline: Option<Instant>,
}

impl Stop {
    fn new(limit: Option<Duration>) -> Result<Self, Failure> {
        let flag = |signal| -> Result<Arc<AtomicBool>, Failure> {
            let flag = Arc::new(AtomicBool::new(false));
            // A second signal of the kind ends the process at once: every unit file is whole anyway.
            signal_hook::flag::register_conditional_default(signal, Arc::clone(&flag))
                .and_then(|_| signal_hook::flag::register(signal, Arc::clone(&flag)))
                .map_err(Failure::could_not)?;
            Ok(flag)
        };
        let deadline = limit.and_then(|limit| Instant::now().checked_add(limit));
        Ok(Self {
            terminated: flag(SIGTERM)?,
            interrupted: flag(SIGINT)?,
            deadline,
        })
    }

    fn go_on(&self) -> bool {
        let signal =
            self.terminated.load(Ordering::Relaxed) || self.interrupted.load(Ordering::Relaxed);
        !signal && self.deadline.is_none_or(|d| Instant::now() < d)
    }

    fn failure(&self, left: usize, finished: usize) -> Option<Failure> {
        let why = if self.interrupted.load(Ordering::Relaxed) {
            return Some(Failure::interrupted(format!(
                "interrupted; {left} units left"
            )));
        } else if self.terminated.load(Ordering::Relaxed) {
            "SIGTERM"
        } else if self.go_on() {
            return None;
        } else if finished == 0 {
            // the same command would end the same way: no code for "to be resumed"
            let message =
                format!("the time limit is too short for a single unit; {left} units left");
            let hint = "a longer --time-limit, or a study with fewer unit_runs";
            return Some(Failure::could_not(message).hint(hint));
        } else {
            "the time limit"
        };
        let failure = Failure::stopped(format!("stopped by {why}; {left} units left"));
        Some(failure.hint("the same command goes on where this one stopped"))
    }
}

pub(crate) fn run(args: &Args, session: &Session) -> Result<(), Failure> {
    let stop = Stop::new(args.time_limit)?;
    let planned = args.place.planned(session.asked_seed())?;
    let variable = |name: &str| std::env::var(name).ok();
    let (shard, from) = shard::find(args.shard, args.shards, &variable)?;
    let (index, count) = shard.parts();
    session.say(format!("shard {index}/{count} ({from})"));
    let options = RunOptions {
        shard,
        threads: session.threads(),
    };
    let ran = study::run(
        &planned,
        &options,
        &Context::new(&Watch(session, || stop.go_on()), None),
    )?;
    match (ran.left, stop.failure(ran.left, ran.finished)) {
        (1.., Some(failure)) => Err(failure),
        _ => {
            let done = ran.finished + ran.left;
            if session.json() {
                session.result(json!({ "schema_version": 1, "units_done": done, "units_left": 0 }));
            }
            session.say(format!("{done} units done, none left in this shard"));
            Ok(())
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_are_understood() {
        let seconds = ["90", "90s", "1.5m", "2h"].map(|t| time(t).unwrap().as_secs());
        assert_eq!(seconds, [90, 90, 90, 7200]);
        assert!(
            ["", "m", "-1", "1d", "nan"]
                .iter()
                .all(|t| time(t).is_err())
        );
    }
}
