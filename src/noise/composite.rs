//! The sum of processes that one axis carries.

use super::Process;

/// A sum of independent processes, in the order given.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Composite {
    /// The summands.
    pub processes: Vec<Process>,
}

impl Composite {
    /// The sum of the given processes.
    #[must_use]
    pub const fn new(processes: Vec<Process>) -> Self {
        Self { processes }
    }

    /// A label for each summand, unique within the sum: "WN", "AR1_1", "AR1_2", … (numbered only where a
    /// code occurs more than once, in order of appearance).
    #[must_use]
    pub fn labels(&self) -> Vec<String> {
        let codes: Vec<&str> = self.processes.iter().map(Process::code).collect();
        let count = |slice: &[&str], code: &str| slice.iter().filter(|c| **c == code).count();
        let label = |(i, code): (usize, &&str)| match count(&codes, code) {
            1 => (*code).to_owned(),
            _ => format!("{code}_{}", count(&codes[..=i], code)),
        };
        codes.iter().enumerate().map(label).collect()
    }
}
