//! `nav-sim batch` on a terminal: signals, the time limit, what is shown.

use super::{Failure, Session, drive};
use crate::app::{Answer, Context, Front};
use crate::commands::batch::{BatchRequest, Outcome};
use crate::parse;
use crate::report::{WIDTH, json as to_json};
use nav_sim_document::Note;
use serde_json::json;
use signal_hook::consts::{SIGINT, SIGTERM};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

#[derive(clap::Args, Debug)]
pub(crate) struct Args {
    #[command(flatten)]
    request: BatchRequest,
    /// Stop after this time (exit code 75; 1 if nothing was finished): seconds, or with s, m, h
    #[arg(long, value_name = "TIME", value_parser = parse::seconds)]
    time_limit: Option<f64>,
}

/// A session that stops at a signal or a time.
struct Watch<'a> {
    session: &'a Session,
    terminated: Arc<AtomicBool>,
    interrupted: Arc<AtomicBool>,
    deadline: Option<Instant>,
}

impl Front for Watch<'_> {
    fn note(&self, note: Note) {
        self.session.note(note);
    }

    fn begin(&self, unit: &str, steps: u64) {
        self.session.begin(unit, steps);
    }

    fn advance(&self, steps: u64) {
        self.session.advance(steps);
    }

    fn end(&self) {
        self.session.end();
    }

    fn go_on(&self) -> bool {
        let signal = [&self.terminated, &self.interrupted]
            .iter()
            .any(|flag| flag.load(Ordering::Relaxed));
        !signal && self.deadline.is_none_or(|d| Instant::now() < d)
    }
}

pub(crate) fn run(args: &Args, session: &Session) -> Result<(), Failure> {
    let flag = |signal| -> Result<Arc<AtomicBool>, Failure> {
        let flag = Arc::new(AtomicBool::new(false));
        // A second signal of the kind ends the process at once: whatever is there is whole.
        signal_hook::flag::register_conditional_default(signal, Arc::clone(&flag))
            .and_then(|_| signal_hook::flag::register(signal, Arc::clone(&flag)))
            .map_err(Failure::could_not)?;
        Ok(flag)
    };
    let watch = Watch {
        session,
        terminated: flag(SIGTERM)?,
        interrupted: flag(SIGINT)?,
        deadline: args
            .time_limit
            .and_then(|limit| Duration::try_from_secs_f64(limit).ok())
            .and_then(|limit| Instant::now().checked_add(limit)),
    };
    let mut request = args.request.clone();
    request.force = session.force();
    request
        .set
        .extend(session.asked_seed().map(|seed| format!("seed={seed}")));
    let variable = |name: &str| std::env::var(name).ok();
    let mut outcome = request.run(&variable, &Context::new(&watch, None));
    if let Ok(Outcome::Stopped { is_resumable, .. }) = &mut outcome {
        *is_resumable |= watch.terminated.load(Ordering::Relaxed);
    }
    if matches!(outcome, Err(_) | Ok(Outcome::Stopped { .. }))
        && watch.interrupted.load(Ordering::Relaxed)
    {
        return Err(Failure::interrupted("interrupted")
            .hint("the same command goes on where this one stopped"));
    }
    let outcome = outcome?;
    match &outcome {
        Outcome::Merged(answer) => {
            let document = answer.document();
            let shown = match session.verbose() {
                _ if session.json() => to_json(&**answer),
                true => document.verbose(WIDTH),
                false => document.terminal(WIDTH),
            };
            drive::tell(&document, &shown, session);
            session.say(format!("wrote {}", request.directory().display()));
        }
        Outcome::Partial(missing) if session.json() => {
            session.result(json!({ "schema_version": 1, "complete": false, "missing": missing }));
        }
        Outcome::Partial(_) => session.say("own share done"),
        Outcome::Estimate(text) => session.result(text),
        Outcome::Stopped { .. } => {}
    }
    outcome.unmet().map_or(Ok(()), Err)
}
