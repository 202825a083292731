//! The kinds of process and their parameters: what files, specifications and fits call them, in one table.

use super::{
    Ar1, Drift, FlickerNoise, GaussMarkov, Ma1, ParameterError, Process, Quantization, RandomWalk,
    White,
};

/// A kind of process.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Kind {
    /// White noise.
    White,
    /// Quantization noise.
    Quantization,
    /// First-order autoregression.
    Ar1,
    /// First-order Gauss-Markov process.
    GaussMarkov,
    /// First-order moving average.
    Ma1,
    /// Flicker noise.
    Flicker,
    /// Random walk.
    RandomWalk,
    /// Drift.
    Drift,
}

/// A parameter of a process.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Parameter {
    /// Coefficient of an AR1.
    Phi,
    /// Inverse correlation time of a GM (1/s).
    Beta,
    /// Coefficient of an MA1.
    Theta,
    /// White or innovation variance per sample.
    Sigma2,
    /// Stationary variance of a GM.
    S2,
    /// Quantization Q².
    Q2,
    /// Flicker noise B².
    B2,
    /// Increment variance of a random walk.
    Gamma2,
    /// Drift per sample.
    Slope,
}

/// A parameter of one process of a sum.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct ParameterRef {
    /// Position of the process in the sum.
    pub process: usize,
    /// The parameter.
    pub parameter: Parameter,
}

/// Row of the table of kinds.
struct Row {
    code: &'static str,
    /// In the order of files: the shape, if it has one, before the amplitude.
    parameters: &'static [Parameter],
    /// Units of the parameters; `{u}` is that of the signal.
    units: &'static str,
}

/// One row a kind, in the order of [`Kind::ALL`].
const TABLE: [Row; 8] = [
    Row {
        code: "WN",
        parameters: &[Parameter::Sigma2],
        units: "({u})², per sample",
    },
    Row {
        code: "QN",
        parameters: &[Parameter::Q2],
        units: "({u})²",
    },
    Row {
        code: "AR1",
        parameters: &[Parameter::Phi, Parameter::Sigma2],
        units: "({u})², innovation variance per sample",
    },
    Row {
        code: "GM",
        parameters: &[Parameter::Beta, Parameter::S2],
        units: "1/s, ({u})²",
    },
    Row {
        code: "MA1",
        parameters: &[Parameter::Theta, Parameter::Sigma2],
        units: "({u})², innovation variance per sample",
    },
    Row {
        code: "FN",
        parameters: &[Parameter::B2],
        units: "({u})²",
    },
    Row {
        code: "RW",
        parameters: &[Parameter::Gamma2],
        units: "({u})², increment variance per sample",
    },
    Row {
        code: "DR",
        parameters: &[Parameter::Slope],
        units: "{u} per sample",
    },
];

impl Kind {
    /// All kinds, in the order in which models list them.
    pub const ALL: [Self; 8] = [
        Self::White,
        Self::Quantization,
        Self::Ar1,
        Self::GaussMarkov,
        Self::Ma1,
        Self::Flicker,
        Self::RandomWalk,
        Self::Drift,
    ];

    const fn row(self) -> &'static Row {
        &TABLE[self as usize]
    }

    /// The kind of that code.
    pub fn named(code: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|kind| kind.code() == code)
    }

    /// Code in model files and specifications.
    pub const fn code(self) -> &'static str {
        self.row().code
    }

    /// Its parameters in the order of [`Process::parameters`].
    pub const fn parameters(self) -> &'static [Parameter] {
        self.row().parameters
    }

    /// The parameter its wavelet variance grows with.
    pub const fn amplitude(self) -> Parameter {
        let parameters = self.parameters();
        parameters[parameters.len() - 1]
    }

    /// The parameter that gives its shape, if its wavelet variance depends on more than an amplitude.
    pub const fn shape(self) -> Option<Parameter> {
        match self.parameters() {
            [shape, _] => Some(*shape),
            _ => None,
        }
    }

    /// Units of its parameters, where those of the signal are `unit`.
    pub fn units(self, unit: &str) -> String {
        self.row().units.replace("{u}", unit)
    }

    /// A process of this kind from the values of its parameters, in their order; none if their number is another.
    /// The rate (Hz) is what a GM is sampled at.
    ///
    /// # Errors
    /// When a value is outside its domain.
    pub fn process(self, values: &[f64], rate_hz: f64) -> Option<Result<Process, ParameterError>> {
        Some(match (self, values) {
            (Self::White, &[sigma2]) => White::new(sigma2).map(Process::White),
            (Self::Quantization, &[q2]) => Quantization::new(q2).map(Process::Quantization),
            (Self::Ar1, &[phi, sigma2]) => Ar1::new(phi, sigma2).map(Process::Ar1),
            (Self::GaussMarkov, &[beta, s2]) => {
                GaussMarkov::new(beta, s2, rate_hz).map(Process::GaussMarkov)
            }
            (Self::Ma1, &[theta, sigma2]) => Ma1::new(theta, sigma2).map(Process::Ma1),
            (Self::Flicker, &[b2]) => FlickerNoise::new(b2).map(Process::Flicker),
            (Self::RandomWalk, &[gamma2]) => RandomWalk::new(gamma2).map(Process::RandomWalk),
            (Self::Drift, &[slope]) => Drift::new(slope).map(Process::Drift),
            _ => return None,
        })
    }
}

impl Parameter {
    /// Name in files.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Phi => "phi",
            Self::Beta => "beta",
            Self::Theta => "theta",
            Self::Sigma2 => "sigma2",
            Self::S2 => "s2",
            Self::Q2 => "q2",
            Self::B2 => "b2",
            Self::Gamma2 => "gamma2",
            Self::Slope => "slope",
        }
    }

    /// Whether it gives the shape of a wavelet variance rather than its size.
    pub const fn is_shape(self) -> bool {
        matches!(self, Self::Phi | Self::Beta | Self::Theta)
    }

    /// A value on the scale on which the law of an estimate does not depend on it, and on which recordings differ: the logarithm,
    /// of phi that of κ = −ln phi = 1/(T·rate), the correlation time but for sign and rate; theta as it is.
    pub fn scaled(self, value: f64) -> f64 {
        match self {
            Self::Phi => (-value.ln()).ln(),
            Self::Theta => value,
            _ => value.ln(),
        }
    }

    /// The value that is there on that scale.
    pub fn unscaled(self, scaled: f64) -> f64 {
        match self {
            Self::Phi => (-scaled.exp()).exp(),
            Self::Theta => scaled.clamp(-1.0, 1.0),
            _ => scaled.exp(),
        }
    }

    /// Ends of its domain, (low, high).
    pub const fn domain(self) -> (f64, f64) {
        match self {
            Self::Phi | Self::Theta => (-1.0, 1.0),
            Self::Slope => (f64::NEG_INFINITY, f64::INFINITY),
            Self::Beta | Self::Sigma2 | Self::S2 | Self::Q2 | Self::B2 | Self::Gamma2 => {
                (0.0, f64::INFINITY)
            }
        }
    }
}

impl Process {
    /// From its code and the values of its parameters in the order of [`Kind::parameters`]; none if there is no
    /// such process or the number of values is another. The rate (Hz) is what a GM is sampled at.
    ///
    /// # Errors
    /// When a value is outside its domain.
    pub fn from_values(
        code: &str,
        values: &[f64],
        rate_hz: f64,
    ) -> Option<Result<Self, ParameterError>> {
        Kind::named(code)?.process(values, rate_hz)
    }

    /// Code in model files and specifications.
    pub const fn code(&self) -> &'static str {
        self.kind().code()
    }

    /// The parameter that its size grows with, [`Kind::amplitude`].
    pub fn amplitude(&self) -> f64 {
        self.values().last().copied().unwrap_or(0.0)
    }

    /// With its amplitude times a factor. The rate (Hz) is what a GM is sampled at.
    ///
    /// # Errors
    /// When that is outside its domain.
    pub fn times(&self, factor: f64, rate_hz: f64) -> Result<Self, ParameterError> {
        let mut values = self.values();
        if let Some(amplitude) = values.last_mut() {
            *amplitude *= factor;
        }
        self.kind().process(&values, rate_hz).unwrap_or(Ok(*self))
    }

    /// The parameters as (name in model files, value).
    pub fn parameters(&self) -> Vec<(&'static str, f64)> {
        self.kind()
            .parameters()
            .iter()
            .map(|p| p.name())
            .zip(self.values())
            .collect()
    }
}

/// A label for each process of a sum, unique within it: "WN", "AR1_1", "AR1_2", … (numbered only where a kind occurs
/// more than once, in order of appearance).
pub fn labels(kinds: &[Kind]) -> Vec<String> {
    let count = |kinds: &[Kind], kind: Kind| kinds.iter().filter(|k| **k == kind).count();
    let label = |(i, kind): (usize, &Kind)| match count(kinds, *kind) {
        1 => kind.code().to_owned(),
        _ => format!("{}_{}", kind.code(), count(&kinds[..=i], *kind)),
    };
    kinds.iter().enumerate().map(label).collect()
}

// The sum of processes that one axis carries.

/// A sum of independent processes, in the order given.
#[derive(Debug, Clone, PartialEq, Default, serde::Serialize)]
pub struct Composite {
    /// The summands.
    pub processes: Vec<Process>,
}

impl Composite {
    /// The sum of the given processes.
    pub const fn new(processes: Vec<Process>) -> Self {
        Self { processes }
    }

    /// Theoretical Haar wavelet variance at a level (units²): the sum over the processes, which are
    /// independent. Level j has scale tau = 2^j samples.
    pub fn haar_wv(&self, level: u32) -> f64 {
        self.processes.iter().map(|p| p.haar_wv(level)).sum()
    }

    /// Its gradient with respect to the parameters of all processes, concatenated (see
    /// [`Process::haar_wv_gradient`]).
    pub fn haar_wv_gradient(&self, level: u32) -> Vec<f64> {
        self.processes
            .iter()
            .flat_map(|p| p.haar_wv_gradient(level))
            .collect()
    }

    /// Sum of the amplitudes ([`Kind::amplitude`]) of the processes of a kind.
    pub fn amplitude_of(&self, kind: Kind) -> f64 {
        let own = self.processes.iter().filter(|p| p.kind() == kind);
        own.map(Process::amplitude).sum()
    }

    /// A label for each summand, unique within the sum (see [`labels`]).
    pub fn labels(&self) -> Vec<String> {
        labels(&self.processes.iter().map(Process::kind).collect::<Vec<_>>())
    }

    /// A parameter as it is printed: "AR1_1 phi".
    ///
    /// # Panics
    /// When there is no such process.
    pub fn name_of(&self, of: ParameterRef) -> String {
        format!("{} {}", self.labels()[of.process], of.parameter.name())
    }

    /// The value of a parameter; NaN of one that is not there.
    pub fn value(&self, of: ParameterRef) -> f64 {
        let mut own = self.parameters().filter(|(other, _)| *other == of);
        own.next().map_or(f64::NAN, |(_, value)| value)
    }

    /// Changes a parameter, if it is there. The rate (Hz) is what a GM is sampled at.
    ///
    /// # Errors
    /// When the value is outside its domain.
    pub fn set(
        &mut self,
        of: ParameterRef,
        value: f64,
        rate_hz: f64,
    ) -> Result<(), ParameterError> {
        let Some(process) = self.processes.get_mut(of.process) else {
            return Ok(());
        };
        let parameters = process.kind().parameters().iter();
        let values = parameters.zip(process.values());
        let values: Vec<f64> = values
            .map(|(p, old)| if *p == of.parameter { value } else { old })
            .collect();
        if let Some(changed) = process.kind().process(&values, rate_hz) {
            *process = changed?;
        }
        Ok(())
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_process_comes_back_from_its_parameters() {
        for kind in Kind::ALL {
            let names: Vec<&str> = kind.parameters().iter().map(|p| p.name()).collect();
            let values: Vec<f64> = (1..=names.len()).map(|i| 0.25 * i as f64).collect();
            let process = Process::from_values(kind.code(), &values, 100.0)
                .unwrap()
                .unwrap();
            assert_eq!((process.code(), process.kind()), (kind.code(), kind));
            let expected: Vec<(&str, f64)> = names.into_iter().zip(values).collect();
            assert_eq!(process.parameters(), expected);
            assert!(!kind.amplitude().is_shape() && kind.shape().is_none_or(Parameter::is_shape));
        }
        assert!(Process::from_values("XX", &[1.0], 100.0).is_none());
        assert!(Process::from_values("WN", &[1.0, 2.0], 100.0).is_none());
    }

    #[test]
    fn one_parameter_changes() {
        let ar1 = Process::from_values("AR1", &[0.5, 2.0], 100.0);
        let mut noise = Composite::new(vec![ar1.unwrap().unwrap()]);
        let of = noise.parameters().next().unwrap().0;
        noise.set(of, 0.75, 100.0).unwrap();
        assert_eq!(noise.processes[0].values(), [0.75, 2.0]);
        assert!(noise.set(of, 1.0, 100.0).is_err() && noise.value(of) == 0.75);
    }
}
