//! Remarks to the caller of the engine.

/// How much a remark matters.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Importance {
    /// For who wants to know all.
    Detail,
    /// What is done.
    Note,
    /// A doubt.
    Warning,
}

/// Something to know about a study, in one line.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Remark {
    /// How much it matters.
    pub importance: Importance,
    /// The line.
    pub text: String,
}

impl Remark {
    pub(super) fn detail(text: impl ToString) -> Self {
        Self {
            importance: Importance::Detail,
            text: text.to_string(),
        }
    }

    pub(super) fn note(text: impl ToString) -> Self {
        Self {
            importance: Importance::Note,
            text: text.to_string(),
        }
    }

    pub(super) fn warning(text: impl ToString) -> Self {
        Self {
            importance: Importance::Warning,
            text: text.to_string(),
        }
    }
}
