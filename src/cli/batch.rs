//! `nav-sim batch` on a terminal: signals, the time limit, what is shown.

use super::{Failure, Session};
use crate::app::{Answer, Context};
use crate::commands::batch::{BatchOutcome, BatchRequest};
use crate::parse;
use serde_json::json;
use signal_hook::consts::{SIGINT, SIGTERM};
use signal_hook::flag;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::time::{Duration, Instant};

#[derive(clap::Args)]
pub(crate) struct BatchArgs {
    #[command(flatten)]
    request: BatchRequest,
    /// Stop after this time (exit code 75; 1 if nothing was finished): seconds, or with s, m, h
    #[arg(long, value_name = "TIME", value_parser = parse::seconds)]
    time_limit: Option<f64>,
}

/// Runs a study, of a session that it makes stop at a signal or a time.
pub(crate) fn run(args: &BatchArgs, mut session: Session) -> Result<(), Failure> {
    let (is_stopped, signal) = (
        Arc::new(AtomicBool::new(false)),
        Arc::new(AtomicUsize::new(0)),
    );
    for number in [SIGTERM, SIGINT] {
        // A second signal ends the process at once: whatever is there is whole.
        flag::register_conditional_default(number, Arc::clone(&is_stopped))
            .and_then(|_| flag::register(number, Arc::clone(&is_stopped)))
            .and_then(|_| flag::register_usize(number, Arc::clone(&signal), number as usize))
            .map_err(Failure::failed)?;
    }
    let limit = args.time_limit.map(Duration::try_from_secs_f64);
    let deadline = limit.and_then(|limit| Instant::now().checked_add(limit.ok()?));
    session.go_on = Some(Box::new(move || {
        !is_stopped.load(Ordering::Relaxed) && deadline.is_none_or(|d| Instant::now() < d)
    }));
    let mut request = args.request.clone();
    request.force = session.common.force;
    let seed = session.common.seed.map(|seed| format!("seed={seed}"));
    request.set.extend(seed);
    let variable = |name: &str| std::env::var(name).ok();
    let mut outcome = request.run(&variable, &Context::new(&session, None));
    let signal = signal.load(Ordering::Relaxed) as i32;
    if let Ok(BatchOutcome::Stopped { is_resumable, .. }) = &mut outcome {
        *is_resumable |= signal == SIGTERM;
    }
    if matches!(outcome, Err(_) | Ok(BatchOutcome::Stopped { .. })) && signal == SIGINT {
        return Err(Failure::interrupted("interrupted").hint("the same command continues"));
    }
    let outcome = outcome?;
    match &outcome {
        BatchOutcome::Merged(answer) => {
            session.show(&**answer, &answer.document(), None);
            session.say(format!("wrote {}", request.directory().display()));
        }
        BatchOutcome::Partial(missing) if session.is_json() => {
            session.result(json!({ "schema_version": 1, "complete": false, "missing": missing }));
        }
        BatchOutcome::Partial(_) => session.say("own share done"),
        BatchOutcome::Estimate(text) if session.is_json() => {
            session.result(json!({ "schema_version": 1, "estimate": text }));
        }
        BatchOutcome::Estimate(text) => session.result(text),
        BatchOutcome::Stopped { .. } => {}
    }
    outcome.unmet().map_or(Ok(()), Err)
}
