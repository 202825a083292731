//! Jobs that leave Python free: other threads run, Ctrl-C ends them, progress is reported.

use crate::error;
use nav_sim::app::Reporter;
use nav_sim::document::{Importance, Note};
use pyo3::prelude::*;
use std::any::Any;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::sync::{Arc, Mutex, MutexGuard, OnceLock, PoisonError};
use std::time::{Duration, Instant};

/// Interval at which Python is polled for interrupts and told the progress.
const SLICE: Duration = Duration::from_millis(50);

/// Counts what a job has done, takes down what it warns of, and stops it.
///
/// Threads that work never touch Python: they count here, and the calling thread looks.
#[derive(Debug, Default)]
pub(crate) struct JobMonitor {
    done: AtomicU64,
    total: AtomicU64,
    is_stopped: AtomicBool,
    warnings: Mutex<Vec<String>>,
    /// When a job that can be resumed is to stop.
    pub(crate) deadline: OnceLock<Instant>,
}

/// Panic payload of a stopped job.
struct Stopped;

impl Reporter for JobMonitor {
    fn note(&self, note: Note) {
        if note.importance == Importance::Warning {
            self.noted().push(note.text);
        }
    }

    fn begin(&self, _: &str, steps: u64) {
        self.done.store(0, Ordering::Relaxed);
        self.total.store(steps, Ordering::Relaxed);
    }

    /// Counts. Unwinds where the job is to stop, as it has no other way out: its unfinished files go with it.
    fn advance(&self, steps: u64) {
        if self.is_stopped.load(Ordering::Relaxed) {
            resume_unwind(Box::new(Stopped));
        }
        self.done.fetch_add(steps, Ordering::Relaxed);
    }

    fn should_continue(&self) -> bool {
        let is_early = self.deadline.get().is_none_or(|end| Instant::now() < *end);
        is_early && !self.is_stopped.load(Ordering::Relaxed)
    }
}

impl JobMonitor {
    fn noted(&self) -> MutexGuard<'_, Vec<String>> {
        self.warnings.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Warnings of the job.
    pub(crate) fn warnings(&self) -> Vec<String> {
        std::mem::take(&mut self.noted())
    }

    fn reached(&self) -> (u64, u64) {
        let total = self.total.load(Ordering::Relaxed);
        // a step that is counted between the two is reported next time
        (self.done.load(Ordering::Relaxed).min(total), total)
    }
}

/// Does a job on a thread of its own and waits for it without Python's lock.
///
/// It computes on so many `threads`, by default one a core. A job that nobody waits for any longer ends at its next step, in the background.
pub(crate) fn work<T: Send + 'static>(
    py: Python<'_>,
    progress: Option<&Bound<'_, PyAny>>,
    threads: Option<usize>,
    job: impl FnOnce(&JobMonitor) -> T + Send + 'static,
) -> PyResult<T> {
    in_this_process(py)?;
    let meter = Arc::new(JobMonitor::default());
    let counted = Arc::clone(&meter);
    let (sender, receiver) = channel();
    std::thread::spawn(move || {
        let pool =
            threads.and_then(|n| rayon::ThreadPoolBuilder::new().num_threads(n).build().ok());
        let outcome = catch_unwind(AssertUnwindSafe(|| match pool {
            Some(pool) => pool.install(|| job(&counted)),
            None => job(&counted),
        }));
        // nobody waits after Ctrl-C
        drop(sender.send(outcome));
    });
    // a receiver is of one thread at a time, and `detach` asks for more
    let receiver = Mutex::new(receiver);
    let next = || {
        receiver
            .lock()
            .map_or(Err(RecvTimeoutError::Disconnected), |r| {
                r.recv_timeout(SLICE)
            })
    };
    let mut told = (0, 0);
    loop {
        match py.detach(next) {
            Ok(Ok(outcome)) => {
                report_progress(progress, &meter, &mut told)?;
                return Ok(outcome);
            }
            Ok(Err(panic)) => return Err(defect(py, panic.as_ref())),
            Err(RecvTimeoutError::Disconnected) => return Err(defect(py, &())),
            Err(RecvTimeoutError::Timeout) => {
                let heard = py
                    .check_signals()
                    .and_then(|()| report_progress(progress, &meter, &mut told));
                heard.inspect_err(|_| meter.is_stopped.store(true, Ordering::Relaxed))?;
            }
        }
    }
}

fn report_progress(
    progress: Option<&Bound<'_, PyAny>>,
    meter: &JobMonitor,
    told: &mut (u64, u64),
) -> PyResult<()> {
    let reached = meter.reached();
    if let Some(progress) = progress.filter(|_| reached != *told && reached.1 > 0) {
        progress.call1(reached)?;
    }
    *told = reached;
    Ok(())
}

/// A panic, which is never of the user's making.
fn defect(py: Python<'_>, panic: &(dyn Any + Send)) -> PyErr {
    let text = panic.downcast_ref::<String>().map(String::as_str);
    let text = text
        .or_else(|| panic.downcast_ref::<&str>().copied())
        .unwrap_or("no message");
    error::refused(py, &format!("internal error, please report it: {text}"))
}

/// Refuses to work in a fork: the threads that work stayed with the parent, and a job would wait for them for ever.
fn in_this_process(py: Python<'_>) -> PyResult<()> {
    static FIRST: OnceLock<u32> = OnceLock::new();
    if *FIRST.get_or_init(std::process::id) == std::process::id() {
        return Ok(());
    }
    let hint = "use multiprocessing.get_context(\"spawn\"), or import nav_sim only in the workers";
    let message = "nav_sim cannot run in a fork of a process that used it";
    Err(error::raise(py, message, None, None, Some(hint)))
}
