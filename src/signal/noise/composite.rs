//! The sum of processes that one axis carries.

use super::{ParameterRef, Process, labels};

/// A sum of independent processes, in the order given.
#[derive(Debug, Clone, PartialEq, Default, serde::Serialize)]
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
        self.processes
            .iter()
            .flat_map(|p| p.haar_wv_gradient(level))
            .collect()
    }

    /// A label for each summand, unique within the sum (see [`labels`]).
    #[must_use]
    pub fn labels(&self) -> Vec<String> {
        labels(&self.processes.iter().map(Process::kind).collect::<Vec<_>>())
    }

    /// A parameter as it is printed: "AR1_1 phi".
    ///
    /// # Panics
    /// When there is no such process.
    #[must_use]
    pub fn name_of(&self, of: ParameterRef) -> String {
        format!("{} {}", self.labels()[of.process], of.parameter.name())
    }

    /// All parameters with their values, process by process.
    pub fn parameters(&self) -> impl Iterator<Item = (ParameterRef, f64)> + '_ {
        self.processes.iter().enumerate().flat_map(|(process, p)| {
            let refs = p
                .kind()
                .parameters()
                .iter()
                .map(move |parameter| ParameterRef {
                    process,
                    parameter: *parameter,
                });
            refs.zip(p.values())
        })
    }
}
