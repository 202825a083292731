//! The surroundings of a command: where its notes and its progress go, and the seed.

use super::Input;
use nav_sim_document::{Importance, Note};
use std::fmt::Display;
use std::path::PathBuf;
use std::sync::{Mutex, PoisonError};
use std::time::Instant;

/// Receives notes and progress: a terminal, Python, a test. `()` ignores them.
pub trait Reporter: Sync {
    /// A note.
    fn note(&self, note: Note);

    /// A number of steps begins, such as 100 runs.
    fn begin(&self, _unit: &str, _steps: u64) {}

    /// Some more of the steps are done; called from any thread.
    fn advance(&self, _steps: u64) {}

    /// The steps have ended.
    fn end(&self) {}

    /// False to stop; called from any thread, several times a second, by jobs that can be resumed.
    fn should_continue(&self) -> bool {
        true
    }
}

impl Reporter for () {
    fn note(&self, _: Note) {}
}

/// The surroundings of a command: where notes and progress go, the seed that was given, and the time of its runs.
pub struct Context<'a> {
    front: &'a dyn Reporter,
    seed: Option<u64>,
    is_timed: bool,
    started: Mutex<Option<Instant>>,
    runs_s: Mutex<f64>,
    used_seed: Mutex<Option<u64>>,
    inputs: Vec<Input>,
    out: Option<PathBuf>,
}

/// Seed where none is given: the same command gives the same result.
pub const DEFAULT_SEED: u64 = 1;

impl<'a> Context<'a> {
    /// A context with the seed of `--seed`, if it is given.
    pub fn new(front: &'a dyn Reporter, seed: Option<u64>) -> Self {
        Self {
            front,
            seed,
            is_timed: true,
            started: Mutex::default(),
            runs_s: Mutex::default(),
            used_seed: Mutex::default(),
            inputs: Vec::new(),
            out: None,
        }
    }

    /// The context without a clock, for answers that do not depend on it.
    pub(crate) fn untimed(self) -> Self {
        let is_timed = false;
        Self { is_timed, ..self }
    }

    /// The context with the files that the command reads.
    #[must_use]
    pub fn reading(self, inputs: Vec<Input>) -> Self {
        Self { inputs, ..self }
    }

    /// The context with `--out`.
    pub(crate) fn writing(self, out: Option<PathBuf>) -> Self {
        Self { out, ..self }
    }

    /// True if `--out` has this ending, packed or not.
    pub(crate) fn writes(&self, ending: &str) -> bool {
        let name = |out: &PathBuf| out.to_string_lossy().to_lowercase();
        let mut names = self.out.iter().map(name);
        names.any(|name| name.trim_end_matches(".gz").ends_with(ending))
    }

    /// The files that the command reads.
    pub fn inputs(&self) -> &[Input] {
        &self.inputs
    }

    /// Warns of what changes the conclusion.
    pub fn warn(&self, text: impl Display) {
        self.note(Importance::Warning, text);
    }

    /// Warns of each.
    pub(crate) fn warn_each(&self, texts: impl IntoIterator<Item: Display>) {
        texts.into_iter().for_each(|text| self.warn(text));
    }

    /// Remarks what is worth knowing at once.
    pub fn remark(&self, text: impl Display) {
        self.note(Importance::Remark, text);
    }

    /// Notes what is for `--verbose` alone.
    pub fn detail(&self, text: impl Display) {
        self.note(Importance::Detail, text);
    }

    /// A note of an importance.
    pub fn note(&self, importance: Importance, text: impl Display) {
        let text = text.to_string();
        self.front.note(Note { importance, text });
    }

    /// Begins a number of steps, and their time.
    pub fn begin(&self, unit: &str, steps: u64) {
        *lock(&self.started) = self.is_timed.then(Instant::now);
        self.front.begin(unit, steps);
    }

    /// Counts steps that are done; from any thread.
    pub fn advance(&self, steps: u64) {
        self.front.advance(steps);
    }

    /// Ends the steps.
    pub fn end(&self) {
        if let Some(start) = lock(&self.started).take() {
            *lock(&self.runs_s) = start.elapsed().as_secs_f64();
        }
        self.front.end();
    }

    /// Time from the last [`Self::begin`] to its [`Self::end`] (s).
    pub fn runs_s(&self) -> f64 {
        *lock(&self.runs_s)
    }

    /// Worker threads.
    pub fn threads(&self) -> usize {
        rayon::current_num_threads()
    }

    /// False to stop.
    pub fn should_continue(&self) -> bool {
        self.front.should_continue()
    }

    /// The seed of `--seed`, if it is given.
    #[must_use]
    pub const fn given_seed(&self) -> Option<u64> {
        self.seed
    }

    /// The seed: that of `--seed`, else the one of a file, else 1.
    pub fn seed_or(&self, of_file: Option<u64>) -> u64 {
        let seed = self.seed.or(of_file).unwrap_or(DEFAULT_SEED);
        *lock(&self.used_seed) = Some(seed);
        seed
    }

    /// The seed that [`Self::seed_or`] gave, for the manifest; none where nothing was drawn.
    pub(crate) fn used_seed(&self) -> Option<u64> {
        *lock(&self.used_seed)
    }
}

/// A context that shows nothing, with the default seed.
impl Default for Context<'_> {
    fn default() -> Self {
        Self::new(&(), None)
    }
}

fn lock<T>(mutex: &Mutex<T>) -> std::sync::MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}
