//! The observer of a long job: progress, and a request to stop.

/// Receives remarks of type `R` and the progress of a job, and may stop it. Every method has a default that does
/// nothing; `()` is the observer that ignores everything and never stops.
pub trait Observer<R>: Sync {
    /// A remark.
    fn remark(&self, _remark: &R) {}

    /// A number of runs begins.
    fn begin(&self, _runs: u64) {}

    /// Some more of the runs are done; called from any thread.
    fn advance(&self, _runs: u64) {}

    /// The runs have ended.
    fn end(&self) {}

    /// Whether to continue; called from any thread, several times a second, by jobs that can be continued.
    fn go_on(&self) -> bool {
        true
    }
}

impl<R> Observer<R> for () {}
