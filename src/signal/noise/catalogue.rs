//! The processes by name: what files and command lines may write.

use super::{Ar1, Drift, GaussMarkov, Ma1, ParameterError, Process, Quantization, RandomWalk, White};

/// Code of each process and the names of its parameters, in the order of [`Process::parameters`].
pub const CATALOGUE: [(&str, &[&str]); 7] = [
    (White::CODE, &["sigma2"]),
    (Quantization::CODE, &["q2"]),
    (Ar1::CODE, &["phi", "sigma2"]),
    (RandomWalk::CODE, &["gamma2"]),
    (Drift::CODE, &["slope"]),
    (GaussMarkov::CODE, &["beta", "s2"]),
    (Ma1::CODE, &["theta", "sigma2"]),
];

impl Process {
    /// From its code and the values of its parameters in the order of [`CATALOGUE`]; none if there is no
    /// such process or the number of values is another. The rate (Hz) is what a GM is sampled at.
    ///
    /// # Errors
    /// When a value is outside its domain.
    #[must_use]
    pub fn from_values(code: &str, values: &[f64], rate_hz: f64) -> Option<Result<Self, ParameterError>> {
        Some(match (code, values) {
            (White::CODE, &[sigma2]) => White::new(sigma2).map(Self::White),
            (Quantization::CODE, &[q2]) => Quantization::new(q2).map(Self::Quantization),
            (Ar1::CODE, &[phi, sigma2]) => Ar1::new(phi, sigma2).map(Self::Ar1),
            (RandomWalk::CODE, &[gamma2]) => RandomWalk::new(gamma2).map(Self::RandomWalk),
            (Drift::CODE, &[slope]) => Drift::new(slope).map(Self::Drift),
            (GaussMarkov::CODE, &[beta, s2]) => GaussMarkov::new(beta, s2, rate_hz).map(Self::GaussMarkov),
            (Ma1::CODE, &[theta, sigma2]) => Ma1::new(theta, sigma2).map(Self::Ma1),
            _ => return None,
        })
    }

    /// The same process with one parameter changed; none if it has no parameter of that name.
    ///
    /// # Errors
    /// When the value is outside its domain.
    #[must_use]
    pub fn with_parameter(
        &self,
        name: &str,
        value: f64,
        rate_hz: f64,
    ) -> Option<Result<Self, ParameterError>> {
        let mut values = self.parameters();
        values.iter_mut().find(|(n, _)| *n == name)?.1 = value;
        let values: Vec<f64> = values.into_iter().map(|(_, v)| v).collect();
        Self::from_values(self.code(), &values, rate_hz)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_process_comes_back_from_its_parameters() {
        for (code, names) in CATALOGUE {
            let values: Vec<f64> = (1..=names.len()).map(|i| 0.25 * i as f64).collect();
            let process = Process::from_values(code, &values, 100.0).unwrap().unwrap();
            assert_eq!(process.code(), code);
            let expected: Vec<(&str, f64)> = names.iter().copied().zip(values).collect();
            assert_eq!(process.parameters(), expected);
        }
        assert!(Process::from_values("XX", &[1.0], 100.0).is_none());
        assert!(Process::from_values("WN", &[1.0, 2.0], 100.0).is_none());
    }

    #[test]
    fn one_parameter_changes() {
        let ar1 = Process::from_values("AR1", &[0.5, 2.0], 100.0).unwrap().unwrap();
        let changed = ar1.with_parameter("phi", 0.75, 100.0).unwrap().unwrap();
        assert_eq!(changed.parameters(), [("phi", 0.75), ("sigma2", 2.0)]);
        assert!(ar1.with_parameter("gamma2", 1.0, 100.0).is_none());
        assert!(ar1.with_parameter("phi", 1.0, 100.0).unwrap().is_err());
    }
}
