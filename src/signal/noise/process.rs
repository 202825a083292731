//! Noise processes: their kinds, and what of them depends on the kind.
//!
//! A process is its kind, its amplitude and, of some kinds, a shape. All that a simulator, a filter or a fit asks of one is
//! answered here; longer derivations stand in `ar1` and `flicker_noise`.

use super::ar1::{self, half_scale};
use super::flicker_noise::{self, Ar1Bank};
use crate::units::Refused;
use serde::ser::{Serialize, SerializeMap, Serializer};

/// A kind of process.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum ProcessKind {
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
struct KindRow {
    code: &'static str,
    /// In the order of files: the shape, if it has one, before the amplitude.
    parameters: &'static [Parameter],
    /// Units of the parameters; `{u}` is that of the signal.
    units: &'static str,
    /// Power of the amplitude in which the wavelet variance is linear: 1 of a variance, 2 of its root.
    power: i32,
}

/// One row a kind, in the order of [`ProcessKind::ALL`].
const TABLE: [KindRow; 8] = [
    KindRow {
        code: "WN",
        parameters: &[Parameter::Sigma2],
        units: "({u})², per sample",
        power: 1,
    },
    KindRow {
        code: "QN",
        parameters: &[Parameter::Q2],
        units: "({u})²",
        power: 1,
    },
    KindRow {
        code: "AR1",
        parameters: &[Parameter::Phi, Parameter::Sigma2],
        units: "({u})², innovation variance per sample",
        power: 1,
    },
    KindRow {
        code: "GM",
        parameters: &[Parameter::Beta, Parameter::S2],
        units: "1/s, ({u})²",
        power: 1,
    },
    KindRow {
        code: "MA1",
        parameters: &[Parameter::Theta, Parameter::Sigma2],
        units: "({u})², innovation variance per sample",
        power: 1,
    },
    KindRow {
        code: "FN",
        parameters: &[Parameter::B2],
        units: "({u})²",
        power: 1,
    },
    KindRow {
        code: "RW",
        parameters: &[Parameter::Gamma2],
        units: "({u})², increment variance per sample",
        power: 1,
    },
    KindRow {
        code: "DR",
        parameters: &[Parameter::Slope],
        units: "{u} per sample",
        power: 2,
    },
];

impl ProcessKind {
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

    const fn row(self) -> &'static KindRow {
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

    /// Power of the amplitude in which its wavelet variance is linear: 1 of a variance, 2 of a drift's slope.
    pub const fn power(self) -> i32 {
        self.row().power
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

    /// Theoretical Haar wavelet variance at a level per unit of the amplitude to its power, and the derivative of
    /// that with respect to the shape. The shape of a GM is here kappa = beta/f, the inverse correlation time in samples.
    pub fn haar_shape(self, shape: f64, level: u32) -> (f64, f64) {
        let m = half_scale(level);
        let value = match self {
            Self::White => 0.5 / m,
            Self::Quantization => 1.5 / (m * m),
            Self::RandomWalk => (4.0 * m * m + 2.0) / (24.0 * m),
            Self::Drift => 0.25 * m * m,
            Self::Flicker => flicker_noise::haar_shape(level),
            Self::Ar1 => return ar1::haar_shape(shape, level),
            Self::GaussMarkov => return ar1::markov_haar_shape(shape, level),
            Self::Ma1 => {
                let sum = 1.0 + shape;
                return (
                    (m * sum * sum - 3.0 * shape) / (2.0 * m * m),
                    (2.0 * m * sum - 3.0) / (2.0 * m * m),
                );
            }
        };
        (value, 0.0)
    }

    /// [`Self::haar_shape`] of an AR1 or GM in kappa, the inverse correlation time in samples: keeps the digits of a kappa too
    /// small to be told from 0 in phi.
    pub fn haar_shape_of_kappa(self, kappa: f64, level: u32) -> (f64, f64) {
        match self {
            Self::Ar1 => ar1::haar_shape_of_kappa(kappa, level),
            _ => self.haar_shape(kappa, level),
        }
    }

    /// True if its shape is a correlation time.
    pub const fn is_correlated(self) -> bool {
        matches!(self, Self::Ar1 | Self::GaussMarkov)
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

    /// True if it gives the shape of a wavelet variance rather than its size.
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
            _ => (0.0, f64::INFINITY),
        }
    }

    /// Accepts a value of its domain.
    fn checked(self, kind: ProcessKind, value: f64) -> Result<f64, ParameterError> {
        let (is_inside, domain) = match self {
            Self::Phi => (value.abs() < 1.0, "between −1 and 1 (exclusive)"),
            Self::Theta => (value.abs() <= 1.0, "between −1 and 1"),
            Self::Beta => (value > 0.0, "a finite number > 0"),
            Self::Slope => (true, "a finite number"),
            _ => (value >= 0.0, "a finite number ≥ 0"),
        };
        if is_inside && value.is_finite() {
            return Ok(value);
        }
        Err(ParameterError {
            process: kind.code(),
            parameter: self.name(),
            value,
            domain,
        })
    }
}

/// A parameter outside its domain.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error("{process}: {parameter} = {value} is not {domain}")]
pub struct ParameterError {
    /// Process code, as in model files.
    pub process: &'static str,
    /// Parameter name, as in model files.
    pub parameter: &'static str,
    /// The value refused.
    pub value: f64,
    /// Domain, in words.
    pub domain: &'static str,
}

/// One latent process.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Process {
    kind: ProcessKind,
    /// 0 of a kind without a shape.
    shape: f64,
    amplitude: f64,
    /// Samples per unit of time of the shape: the rate of a GM, 1 of all others.
    rate_hz: f64,
}

/// Serialises as in model files: the process code as `type`, and the parameters.
impl Serialize for Process {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        let parameters = self.parameters();
        let mut map = to.serialize_map(Some(1 + parameters.len()))?;
        map.serialize_entry("type", self.code())?;
        parameters
            .iter()
            .try_for_each(|(name, value)| map.serialize_entry(name, value))?;
        map.end()
    }
}

impl Process {
    /// A process of a kind; the shape of a kind without one is not read. The rate (Hz) is what a GM is sampled at.
    ///
    /// # Errors
    /// When a parameter is outside its domain, or the rate of a GM is not positive.
    pub fn new(
        kind: ProcessKind,
        shape: f64,
        amplitude: f64,
        rate_hz: f64,
    ) -> Result<Self, ParameterError> {
        let is_timed = kind == ProcessKind::GaussMarkov;
        if is_timed && !(rate_hz > 0.0 && rate_hz.is_finite()) {
            return Err(ParameterError {
                process: kind.code(),
                parameter: "rate_hz",
                value: rate_hz,
                domain: "a finite number > 0",
            });
        }
        Ok(Self {
            kind,
            shape: match kind.shape() {
                Some(parameter) => parameter.checked(kind, shape)?,
                None => 0.0,
            },
            amplitude: kind.amplitude().checked(kind, amplitude)?,
            rate_hz: if is_timed { rate_hz } else { 1.0 },
        })
    }

    /// From the values of its parameters in the order of [`ProcessKind::parameters`]; a wrong number of values is refused.
    ///
    /// # Errors
    /// As [`Self::new`].
    pub fn of_values(
        kind: ProcessKind,
        values: &[f64],
        rate_hz: f64,
    ) -> Result<Self, ParameterError> {
        let (shape, amplitude) = match (kind.shape(), values) {
            (None, &[amplitude]) => (0.0, amplitude),
            (Some(_), &[shape, amplitude]) => (shape, amplitude),
            _ => (f64::NAN, f64::NAN),
        };
        Self::new(kind, shape, amplitude, rate_hz)
    }

    /// White noise from the variance of a sample (units²).
    ///
    /// # Errors
    /// When it is negative or not finite.
    pub fn white(sigma2: f64) -> Result<Self, ParameterError> {
        Self::new(ProcessKind::White, 0.0, sigma2, 1.0)
    }

    /// Quantization noise X_t = √(12 Q²) (U_t − U_{t−1}), U uniform on (0, 1), from Q² (units²).
    ///
    /// # Errors
    /// When it is negative or not finite.
    pub fn quantization(q2: f64) -> Result<Self, ParameterError> {
        Self::new(ProcessKind::Quantization, 0.0, q2, 1.0)
    }

    /// First-order autoregression X_t = phi X_{t−1} + W_t, stationary, from phi and the variance of W (units²).
    ///
    /// # Errors
    /// When |phi| ≥ 1, the variance is negative, or either is not finite.
    pub fn ar1(phi: f64, sigma2: f64) -> Result<Self, ParameterError> {
        Self::new(ProcessKind::Ar1, phi, sigma2, 1.0)
    }

    /// Gauss-Markov process of autocovariance s2·exp(−beta·|t|), from beta (1/s), s2 (units²) and the rate (Hz): sampled, an AR1
    /// with phi = exp(−beta/f).
    ///
    /// # Errors
    /// When beta or the rate is not positive, s2 is negative, or one is not finite.
    pub fn gauss_markov(beta: f64, s2: f64, rate_hz: f64) -> Result<Self, ParameterError> {
        Self::new(ProcessKind::GaussMarkov, beta, s2, rate_hz)
    }

    /// First-order moving average X_t = W_t + theta W_{t−1}, invertible, from theta and the variance of W (units²).
    ///
    /// # Errors
    /// When |theta| > 1, the variance is negative, or either is not finite.
    pub fn ma1(theta: f64, sigma2: f64) -> Result<Self, ParameterError> {
        Self::new(ProcessKind::Ma1, theta, sigma2, 1.0)
    }

    /// Flicker noise from B² (units²).
    ///
    /// # Errors
    /// When it is negative or not finite.
    pub fn flicker(b2: f64) -> Result<Self, ParameterError> {
        Self::new(ProcessKind::Flicker, 0.0, b2, 1.0)
    }

    /// Random walk, the running sum of white increments, from their variance (units²).
    ///
    /// # Errors
    /// When it is negative or not finite.
    pub fn random_walk(gamma2: f64) -> Result<Self, ParameterError> {
        Self::new(ProcessKind::RandomWalk, 0.0, gamma2, 1.0)
    }

    /// Drift X_t = slope · t, t in samples, from the slope (units per sample).
    ///
    /// # Errors
    /// When it is not finite.
    pub fn drift(slope: f64) -> Result<Self, ParameterError> {
        Self::new(ProcessKind::Drift, 0.0, slope, 1.0)
    }

    /// Its kind.
    pub const fn kind(&self) -> ProcessKind {
        self.kind
    }

    /// Code in model files and specifications.
    pub const fn code(&self) -> &'static str {
        self.kind.code()
    }

    /// The parameter that gives its shape ([`ProcessKind::shape`]); 0 of a kind without one.
    pub const fn shape(&self) -> f64 {
        self.shape
    }

    /// The parameter that its size grows with ([`ProcessKind::amplitude`]).
    pub const fn amplitude(&self) -> f64 {
        self.amplitude
    }

    /// The values of its parameters, in the order of [`ProcessKind::parameters`].
    pub fn values(&self) -> Vec<f64> {
        let shape = self.kind.shape().map(|_| self.shape);
        shape.into_iter().chain([self.amplitude]).collect()
    }

    /// The parameters as (name in model files, value).
    pub fn parameters(&self) -> Vec<(&'static str, f64)> {
        let names = self.kind.parameters().iter().map(|p| p.name());
        names.zip(self.values()).collect()
    }

    /// With another value of a parameter; as it is if it has no such parameter.
    ///
    /// # Errors
    /// When the value is outside its domain.
    pub fn with(&self, parameter: Parameter, value: f64) -> Result<Self, ParameterError> {
        let own = |p: Parameter, old| if p == parameter { value } else { old };
        let shape = self.kind.shape().map_or(0.0, |p| own(p, self.shape));
        let amplitude = own(self.kind.amplitude(), self.amplitude);
        Self::new(self.kind, shape, amplitude, self.rate_hz)
    }

    /// With its variance times a factor.
    ///
    /// # Errors
    /// When its amplitude is then outside its domain.
    pub fn times(&self, factor: f64) -> Result<Self, ParameterError> {
        let factor = match self.kind.power() {
            1 => factor,
            _ => factor.sqrt(),
        };
        self.with(self.kind.amplitude(), self.amplitude * factor)
    }

    /// Inverse correlation time in samples: −ln phi of an AR1 with phi > 0, beta/f of a GM; none of the others.
    pub fn kappa(&self) -> Option<f64> {
        match self.kind {
            // phi − 1 is exact for phi ≥ ½: kappa keeps its digits where phi is next to 1.
            ProcessKind::Ar1 if self.shape > 0.0 => Some(-(self.shape - 1.0).ln_1p()),
            ProcessKind::GaussMarkov => Some(self.shape / self.rate_hz),
            _ => None,
        }
    }

    /// Coefficients of the recursion b_k = phi b_{k−1} + w_k: phi, the variance of w, and the
    /// variance of b at the start (units²). A random walk has no stationary variance and starts at
    /// 0. None for other kinds.
    pub fn recursion(&self) -> Option<[f64; 3]> {
        let (shape, amplitude) = (self.shape, self.amplitude);
        match self.kind {
            // Factorised: 1 − phi is exact for phi ≥ ½, whereas phi² would be rounded before the subtraction.
            ProcessKind::Ar1 => Some([
                shape,
                amplitude,
                amplitude / ((1.0 - shape) * (1.0 + shape)),
            ]),
            // s2 (1 − phi²) by expm1: of a slow process phi² is next to 1 and the difference would lose its digits.
            ProcessKind::GaussMarkov => {
                let kappa = shape / self.rate_hz;
                let innovation = amplitude * -(-2.0 * kappa).exp_m1();
                Some([(-kappa).exp(), innovation, amplitude])
            }
            ProcessKind::RandomWalk => Some([1.0, amplitude, 0.0]),
            ProcessKind::White
            | ProcessKind::Quantization
            | ProcessKind::Ma1
            | ProcessKind::Flicker
            | ProcessKind::Drift => None,
        }
    }

    /// Coefficients of the moving average X_t = W_t + theta W_{t−1}: theta and the variance of W
    /// (units²). None for other kinds.
    pub fn moving_average(&self) -> Option<[f64; 2]> {
        match self.kind {
            ProcessKind::Quantization => Some([-1.0, self.amplitude]),
            ProcessKind::Ma1 => Some([self.shape, self.amplitude]),
            ProcessKind::White | ProcessKind::Flicker | ProcessKind::Drift => None,
            ProcessKind::Ar1 | ProcessKind::GaussMarkov | ProcessKind::RandomWalk => None,
        }
    }

    /// Variance at the start of what varies slowly (units²): the stationary one of an AR1 or GM, and of flicker noise that of all
    /// that is slower than a filter's fastest state.
    pub fn initial_variance(&self) -> f64 {
        match self.kind {
            ProcessKind::Flicker => flicker_noise::initial_variance(self.amplitude),
            _ => self.recursion().map_or(0.0, |[.., initial]| initial),
        }
    }

    /// Variance of the white noise in the integral (units²): of an MA1 its long-run variance.
    pub fn white_variance(&self) -> f64 {
        match self.kind {
            ProcessKind::White => self.amplitude,
            ProcessKind::Ma1 => (1.0 + self.shape).powi(2) * self.amplitude,
            // its integral is bounded
            ProcessKind::Quantization => 0.0,
            ProcessKind::Ar1
            | ProcessKind::GaussMarkov
            | ProcessKind::RandomWalk
            | ProcessKind::Flicker
            | ProcessKind::Drift => 0.0,
        }
    }

    /// Two-sided spectral density per sample (units²), at the frequency f (cycles a sample) whose sin²(πf) is given; 0 of a drift.
    pub fn spectrum(&self, sin2: f64) -> f64 {
        // |1 − r e^(−2πif)|²
        let distance = |r: f64| (1.0 - r) * (1.0 - r) + 4.0 * r * sin2;
        let amplitude = self.amplitude;
        match self.kind {
            ProcessKind::White => amplitude,
            ProcessKind::Quantization => 4.0 * amplitude * sin2,
            ProcessKind::Ma1 => amplitude * distance(-self.shape),
            ProcessKind::Flicker => amplitude / (2.0 * sin2.sqrt()),
            ProcessKind::Ar1 | ProcessKind::GaussMarkov | ProcessKind::RandomWalk => self
                .recursion()
                .map_or(0.0, |[phi, innovation, _]| innovation / distance(phi)),
            ProcessKind::Drift => 0.0,
        }
    }

    /// Theoretical Haar wavelet variance (MODWT, scale tau = 2^level samples) of the process (units²);
    /// level ≥ 1. Half the Allan variance of averages over tau/2 samples
    /// ([Guerrier](crate::bibliography::Guerrier13), [Percival](crate::bibliography::Percival95)).
    pub fn haar_wv(&self, level: u32) -> f64 {
        let size = self.amplitude.powi(self.kind.power());
        size * self.kind.haar_shape(self.shape / self.rate_hz, level).0
    }

    /// Derivatives of [`Self::haar_wv`] with respect to the parameters, in the order of [`Self::parameters`].
    pub fn haar_wv_gradient(&self, level: u32) -> Vec<f64> {
        let (shape, slope) = self.kind.haar_shape(self.shape / self.rate_hz, level);
        let power = self.kind.power();
        let of_amplitude = f64::from(power) * self.amplitude.powi(power - 1) * shape;
        let of_shape = self.amplitude.powi(power) * slope / self.rate_hz;
        let of_shape = self.kind.shape().map(|_| of_shape);
        of_shape.into_iter().chain([of_amplitude]).collect()
    }

    /// Theoretical Allan variance (units²) of averages over m ≥ 1 samples; for a drift the square of its deterministic
    /// contribution ([IEEE 952](crate::bibliography::Ieee952), annex C).
    pub(crate) fn allan_variance(&self, samples: u32) -> f64 {
        let m = f64::from(samples.max(1));
        let amplitude = self.amplitude;
        match self.kind {
            ProcessKind::White => amplitude / m,
            ProcessKind::Quantization => 3.0 * amplitude / (m * m),
            ProcessKind::RandomWalk => amplitude * (2.0 * m * m + 1.0) / (6.0 * m),
            ProcessKind::Drift => 0.5 * amplitude * amplitude * m * m,
            ProcessKind::Ma1 => {
                let sum = 1.0 + self.shape;
                amplitude * (m * sum * sum - 3.0 * self.shape) / (m * m)
            }
            ProcessKind::Flicker => amplitude * flicker_noise::allan_shape(samples),
            ProcessKind::Ar1 => ar1::allan_variance(self.shape, amplitude, samples.max(1)),
            ProcessKind::GaussMarkov => {
                amplitude * ar1::unit_markov(self.shape / self.rate_hz, samples.max(1))
            }
        }
    }

    /// Variance of the mean of the first n samples after a switching-on (units²), as [`super::Synthesizer`] makes them. A ramp
    /// is the same each time and adds nothing.
    pub(crate) fn mean_variance(&self, n: f64) -> f64 {
        let amplitude = self.amplitude;
        match self.kind {
            ProcessKind::White => amplitude / n,
            // The sum telescopes to √(12 Q²) (U_n − U_0).
            ProcessKind::Quantization => 2.0 * amplitude / (n * n),
            // Step i is in n + 1 − i of the samples: γ² Σ i²/n².
            ProcessKind::RandomWalk => amplitude * (n + 1.0) * (2.0 * n + 1.0) / (6.0 * n),
            ProcessKind::Flicker => {
                let parts = self.parts(Ar1Bank::FINE);
                parts.iter().map(|part| part.mean_variance(n)).sum()
            }
            ProcessKind::Drift => 0.0,
            ProcessKind::Ma1 => {
                // W_1 … W_(n−1) occur in two samples, with 1 and theta; W_n in one with 1, W_0 in one with theta.
                let theta = self.shape;
                let inner = (1.0 + theta) * (1.0 + theta);
                amplitude * ((n - 1.0) * inner + 1.0 + theta * theta) / (n * n)
            }
            ProcessKind::Ar1 | ProcessKind::GaussMarkov => {
                let [phi, _, variance] = self.recursion().expect("recursion");
                variance * ar1::mean_shape(phi, n)
            }
        }
    }

    /// The processes by which a simulator or filter represents it: of flicker noise white noise and AR1, the fastest first; any other
    /// process itself.
    pub fn parts(&self, ladder: Ar1Bank) -> Vec<Self> {
        match self.kind {
            ProcessKind::Flicker => ladder.parts(self.amplitude),
            _ => vec![*self],
        }
    }

    /// The process sampled at another rate: white noise keeps its density, a random walk its growth per second, a
    /// Gauss-Markov process its correlation time and variance.
    ///
    /// # Errors
    /// When it is tied to its own rate: QN, MA1, an AR1 with phi ≤ 0.
    pub fn at_rate(&self, from_hz: f64, to_hz: f64) -> Result<Self, Refused> {
        let ratio = to_hz / from_hz;
        let (shape, amplitude) = (self.shape, self.amplitude);
        let (shape, amplitude) = match self.kind {
            // What is kept: N² = sigma2/f, K² = gamma2·f, and the slope per second.
            ProcessKind::White => (shape, amplitude * ratio),
            ProcessKind::RandomWalk | ProcessKind::Drift => (shape, amplitude / ratio),
            // B² is that of every rate.
            ProcessKind::Flicker | ProcessKind::GaussMarkov => (shape, amplitude),
            ProcessKind::Ar1 | ProcessKind::Ma1 | ProcessKind::Quantization => {
                let (Some(kappa), Some([.., variance])) = (self.kappa(), self.recursion()) else {
                    let why = match self.kind {
                        ProcessKind::Ar1 => "phi ≤ 0 has no continuous counterpart",
                        ProcessKind::Ma1 => "it has no continuous counterpart",
                        _ => "quantization belongs to the quantiser's own rate",
                    };
                    let code = self.code();
                    return Err(Refused(format!(
                        "{code} at {from_hz} Hz cannot be converted to {to_hz} Hz: {why}"
                    )));
                };
                // T and the stationary variance are kept: kappa = dt/T goes with dt, and sigma2 = variance·(1 − phi²).
                let kappa = kappa / ratio;
                ((-kappa).exp(), variance * -(-2.0 * kappa).exp_m1())
            }
        };
        Self::new(self.kind, shape, amplitude, to_hz).map_err(|e| Refused(e.to_string()))
    }
}

// The sum of processes that one axis carries.

/// A label for each process of a sum, unique within it: "WN", "AR1_1", "AR1_2", … (numbered only where a kind occurs
/// more than once, in order of appearance).
pub fn labels(kinds: &[ProcessKind]) -> Vec<String> {
    let count =
        |kinds: &[ProcessKind], kind: ProcessKind| kinds.iter().filter(|k| **k == kind).count();
    let label = |(i, kind): (usize, &ProcessKind)| match count(kinds, *kind) {
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

    /// Theoretical Allan variance (units²) of averages over m ≥ 1 samples: the sum over the processes.
    pub fn allan_variance(&self, samples: u32) -> f64 {
        let of_each = self.processes.iter().map(|p| p.allan_variance(samples));
        of_each.sum()
    }

    /// Variance of the mean of the first N samples after a switching-on (units²), as [`super::Synthesizer`] makes them: a
    /// random walk begins at zero, an AR1 in its stationary law. A ramp is the same each time and adds nothing.
    pub fn mean_variance(&self, samples: usize) -> f64 {
        let of_each = self.processes.iter();
        of_each.map(|p| p.mean_variance(samples as f64)).sum()
    }

    /// Its gradient with respect to the parameters of all processes, concatenated (see
    /// [`Process::haar_wv_gradient`]).
    pub fn haar_wv_gradient(&self, level: u32) -> Vec<f64> {
        self.processes
            .iter()
            .flat_map(|p| p.haar_wv_gradient(level))
            .collect()
    }

    /// Sum of the amplitudes ([`ProcessKind::amplitude`]) of the processes of a kind.
    pub fn amplitude_of(&self, kind: ProcessKind) -> f64 {
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

    /// Changes a parameter, if it is there.
    ///
    /// # Errors
    /// When the value is outside its domain.
    pub fn set(&mut self, of: ParameterRef, value: f64) -> Result<(), ParameterError> {
        if let Some(process) = self.processes.get_mut(of.process) {
            *process = process.with(of.parameter, value)?;
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
    use approx::assert_relative_eq;
    use std::f64::consts::PI;

    #[test]
    fn every_process_comes_back_from_its_parameters() {
        for kind in ProcessKind::ALL {
            let names: Vec<&str> = kind.parameters().iter().map(|p| p.name()).collect();
            let values: Vec<f64> = (1..=names.len()).map(|i| 0.25 * i as f64).collect();
            let process = Process::of_values(kind, &values, 100.0).unwrap();
            assert_eq!((process.code(), process.kind()), (kind.code(), kind));
            let expected: Vec<(&str, f64)> = names.into_iter().zip(values).collect();
            assert_eq!(process.parameters(), expected);
            assert!(!kind.amplitude().is_shape() && kind.shape().is_none_or(Parameter::is_shape));
        }
        assert_eq!(ProcessKind::named("XX"), None);
        let missing = Process::of_values(ProcessKind::Ar1, &[1.0], 100.0).unwrap_err();
        assert_eq!(missing.parameter, "phi");
        assert!(Process::of_values(ProcessKind::White, &[1.0, 2.0], 100.0).is_err());
    }

    /// One of each kind, sampled at 100 Hz.
    fn each() -> [Process; 8] {
        let shape = |kind: ProcessKind| match kind.shape() {
            Some(Parameter::Beta) => 10.0,
            _ => 0.5,
        };
        ProcessKind::ALL.map(|kind| Process::new(kind, shape(kind), 0.3, 100.0).unwrap())
    }

    /// Central differences: their error is of the order of the square of the step, 1e-8, and their rounding 1e-16 of the variance over
    /// the step.
    #[test]
    fn gradients_agree_with_central_differences() {
        for process in each() {
            for level in [1, 2, 5, 9] {
                let gradient = process.haar_wv_gradient(level);
                let parameters = process.kind().parameters().iter().zip(process.values());
                assert_eq!(gradient.len(), parameters.len());
                for ((parameter, value), slope) in parameters.zip(gradient) {
                    let step = 1e-4 * value;
                    let at = |x| process.with(*parameter, x).unwrap().haar_wv(level);
                    let difference = (at(value + step) - at(value - step)) / (2.0 * step);
                    assert_relative_eq!(slope, difference, max_relative = 1e-6, epsilon = 1e-11);
                }
            }
        }
    }

    /// ∫ |H_j|² S df = nu_j, by the midpoint rule: exact to rounding for a periodic function without a kink, to 6e-7 for the
    /// spectrum of flicker noise, which has one at 0. A ramp has no spectrum.
    #[test]
    fn spectra_integrate_to_the_wavelet_variance() {
        let half = 1 << 14;
        for process in each() {
            let is_flicker = process.kind() == ProcessKind::Flicker;
            for level in (1..=6).filter(|_| process.kind() != ProcessKind::Drift) {
                let m = f64::from(level - 1).exp2();
                let term = |k: usize| {
                    let x = 0.5 * PI * (k as f64 + 0.5) / half as f64;
                    let gain = (m * x).sin().powi(4) / (m * x.sin()).powi(2);
                    process.spectrum(x.sin().powi(2)) * gain
                };
                let integral = (0..half).map(term).sum::<f64>() / half as f64;
                let tolerance = if is_flicker { 1e-6 } else { 1e-9 };
                assert_relative_eq!(integral, process.haar_wv(level), max_relative = tolerance);
            }
        }
    }

    /// Without a slow part, the spectrum at 0 is the white noise of a filter. The parts have the wavelet variance of the process; those
    /// of flicker noise to 5e-4.
    #[test]
    fn parts_and_white_noise_are_those_of_the_process() {
        for process in each() {
            let is_slow = process.recursion().is_some() || process.kind() == ProcessKind::Flicker;
            let white = if is_slow { 0.0 } else { process.spectrum(0.0) };
            assert_relative_eq!(process.white_variance(), white);
            let parts = Composite::new(process.parts(Ar1Bank::FINE));
            for level in [1, 6, 12] {
                let (own, sum) = (process.haar_wv(level), parts.haar_wv(level));
                assert_relative_eq!(sum, own, max_relative = 1e-3);
            }
        }
    }

    #[test]
    fn one_parameter_changes() {
        let mut noise = Composite::new(vec![Process::ar1(0.5, 2.0).unwrap()]);
        let of = noise.parameters().next().unwrap().0;
        noise.set(of, 0.75).unwrap();
        assert_eq!(noise.processes[0].values(), [0.75, 2.0]);
        assert!(noise.set(of, 1.0).is_err() && noise.value(of) == 0.75);
    }
}
