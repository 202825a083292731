//! Who follows a long job.

/// Is told remarks of type `R` and progress, and asked whether to go on. Every method has a default that does nothing,
/// and `()` is the observer that says nothing and never stops.
pub trait Observer<R>: Sync {
    /// Something to know.
    fn remark(&self, _remark: &R) {}

    /// So many runs begin.
    fn begin(&self, _runs: u64) {}

    /// So many more of them are done; called from any thread.
    fn advance(&self, _runs: u64) {}

    /// The runs have ended.
    fn end(&self) {}

    /// Whether to go on; asked from any thread, several times a second, by jobs that can be continued.
    fn go_on(&self) -> bool {
        true
    }
}

impl<R> Observer<R> for () {}
