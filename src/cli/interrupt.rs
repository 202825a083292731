//! Ctrl-C, SIGTERM and a closed terminal: what is being written is removed before the process ends.

use super::{Failure, Session};
use crate::io::atomic;
use std::sync::atomic::{AtomicBool, Ordering};

static INTERRUPTED: AtomicBool = AtomicBool::new(false);

/// From now on a signal removes what is being written and ends the process: exit code 128 + signal, 130 for
/// Ctrl-C, with advice. A signal that this process was started to ignore (by `nohup`, say) is still ignored.
pub(super) fn watch(session: Session, advice: Option<String>) {
    system::on_signal(move |signal| {
        INTERRUPTED.store(true, Ordering::SeqCst);
        atomic::remove_unfinished();
        let failure = Failure::interrupted("interrupted; unfinished files are removed");
        session.failure(&failure.or_hint_if(advice.clone()));
        std::process::exit(128 + signal);
    });
}

/// Waits for the end if the process is being interrupted: a failure that comes of that is not told.
pub(super) fn settle() {
    while INTERRUPTED.load(Ordering::SeqCst) {
        std::thread::park();
    }
}

#[cfg(unix)]
mod system {
    use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM};
    use signal_hook::iterator::Signals;

    /// Calls `end` with the first signal that asks the process to end.
    pub(super) fn on_signal(end: impl FnOnce(i32) + Send + 'static) {
        let ignored = ignored();
        let wanted = [SIGINT, SIGTERM, SIGHUP]
            .into_iter()
            .filter(|signal| ignored >> (signal - 1) & 1 == 0);
        let Ok(mut signals) = Signals::new(wanted) else {
            return;
        };
        std::thread::spawn(move || signals.forever().next().map(end));
    }

    /// The signals that this process ignores, a bit each from the lowest on. Where that cannot be known: none.
    fn ignored() -> u64 {
        let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
        let mask = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
        mask.and_then(|hex| u64::from_str_radix(hex.trim(), 16).ok())
            .unwrap_or(0)
    }
}

#[cfg(windows)]
mod system {
    /// Signal number of Ctrl-C in the C library.
    const SIGINT: i32 = 2;

    /// Calls `end` at Ctrl-C, Ctrl-Break or when the console is closed: a console has no other signals.
    pub(super) fn on_signal(end: impl Fn(i32) + Send + 'static) {
        // where there is no console there is nobody to interrupt
        let _ = ctrlc::set_handler(move || end(SIGINT));
    }
}
