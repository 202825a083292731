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

    /// Theoretical Haar wavelet variance at a level (units²): the sum over the processes, which are
    /// independent. Level j has scale tau = 2^j samples.
    #[must_use]
    pub fn haar_wv(&self, level: u32) -> f64 {
        self.processes.iter().map(|p| p.haar_wv(level)).sum()
    }

    /// Its gradient with respect to the parameters of all processes, concatenated (see
    /// [`Process::haar_wv_gradient`]).
    #[must_use]
    pub fn haar_wv_gradient(&self, level: u32) -> Vec<f64> {
        self.processes.iter().flat_map(|p| p.haar_wv_gradient(level)).collect()
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
