//! Remedies as values: who calls the engine has the words for them.

/// What to do about a failure.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) enum Remedy {
    /// Advice of the reader of a file.
    Advice(String),
    /// Plan the study first.
    Plan,
    /// Plan into another directory, or remove this one.
    PlanElsewhere,
    /// Put the input back, or plan into another directory.
    PutBack,
    /// Plan again: it makes the model anew.
    PlanAgain,
    /// Use the build that planned, or plan into another directory.
    UsePlanningBuild,
    /// Use one build on machines of one kind, or plan anew.
    UseOneBuild,
    /// Run the units first.
    Run,
}
