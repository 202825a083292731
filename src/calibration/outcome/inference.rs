//! Uncertainty of a fit: the results.

use crate::imu::Axis;
use crate::model::ModelSpec;
use crate::noise::practical::AxisParameters;
use crate::noise::{Composite, ParameterRef};

/// Settings of the bootstrap.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Bootstrap {
    /// Number of draws.
    pub draws: usize,
    /// Seed of all of them.
    pub seed: u64,
}

impl Bootstrap {
    /// Draws, usually: the ends of a 95 % interval are the fifth of them at either side.
    pub const DRAWS: usize = 200;
}

impl Default for Bootstrap {
    fn default() -> Self {
        Self {
            draws: Self::DRAWS,
            seed: 1,
        }
    }
}

/// Uncertainty of a fit by the bootstrap.
#[derive(Debug, Clone, PartialEq)]
pub struct Inference {
    /// Draws made.
    pub draws: usize,
    /// Draws that had a fit.
    pub fitted: usize,
    /// The models of these draws: what other recordings of the same IMU would have given.
    pub drawn: Vec<Composite>,
    /// Factor of the distances of the quantiles of the draws from their median, for the few replicates from
    /// which their scatter is known: Student's quantile over the normal one.
    pub stretch: f64,
    /// One interval a parameter that is not fixed, in the order of the model.
    pub intervals: Vec<ParameterInterval>,
    /// Whether the model describes the curve; of slopes (AVLR), which are not fitted to it, nothing is known.
    pub goodness: Option<Goodness>,
    /// Spread of the replicates at each level of the curve. Empty for a curve from elsewhere.
    pub spread: Vec<LevelSpread>,
    /// Probability that replicates of one noise differ as much at some scale (see [`ALIKE_LEVEL`](crate::ALIKE_LEVEL)); none of a
    /// single signal.
    pub alike: Option<f64>,
    /// Parameters that are known to differ between recordings; none where [`alike`](Self::alike) does not say that these differ.
    pub varying: Vec<ParameterSpread>,
    /// Alike processes that cannot be told apart, and the simpler model.
    pub indistinct: Option<Indistinct>,
    /// Intervals of N, K and B.
    pub practical: PracticalIntervals,
}

/// Practitioners' parameters of a fit.
#[derive(Debug, Clone, PartialEq)]
pub struct Practical {
    /// N, K, B and T, of the policy "matched" over the default horizon.
    pub parameters: AxisParameters,
    /// 95 % intervals of N, K and B.
    pub intervals: PracticalIntervals,
    /// Longest averaging time that was observed (s): how far a minimum was looked for.
    pub range_s: f64,
    /// First of these averaging times (s) at which the pair of N and K has more than [`Practical::BESIDE`] times the Allan
    /// deviation of the model, if there is one: K is no random walk beyond.
    pub walk_until_s: Option<f64>,
}

impl Practical {
    /// Ratio of Allan deviations from which on a random walk does not stand for a model: over an octave of averaging times a
    /// random walk and a floor part by √2, over two by this.
    pub const BESIDE: f64 = 2.0;

    /// Whether the data hold averages so long that the random walk is the larger part of them, and the model has it over an
    /// octave of these: where they do not, K is what the pair says of times that nobody saw, or that were seen to be otherwise.
    #[must_use]
    pub fn walk_is_observed(&self) -> bool {
        let lasts = |from: f64| self.walk_until_s.is_none_or(|until| until >= 2.0 * from);
        self.parameters
            .walk
            .crossover_s()
            .is_some_and(|from| from <= self.range_s && lasts(from))
    }
}

/// 95 % intervals (units of the parameter); none where the draws do not determine it.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct PracticalIntervals {
    /// White noise density N (units/√Hz).
    pub density: Option<[f64; 2]>,
    /// Random-walk density K (units/s/√Hz).
    pub walk: Option<[f64; 2]>,
    /// Bias instability B (units).
    pub instability: Option<[f64; 2]>,
}

/// The axes of a pooled sensor, where they differ.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AxesDiffer {
    /// Level at which they differ by the largest ratio.
    pub level: u32,
    /// Probability that alike axes differ so at some scale.
    pub p_value: f64,
    /// The axis with the largest wavelet variance there.
    pub largest: Axis,
    /// The one with the smallest.
    pub smallest: Axis,
    /// The one over the other.
    pub ratio: f64,
}

/// Spread of replicates at one scale: standard deviations of ln nu of a replicate.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct LevelSpread {
    /// Scale (s).
    pub tau_s: f64,
    /// Standard deviation by the law of the noise alone.
    pub within: f64,
    /// Standard deviation of the differences beyond that.
    pub between: f64,
}

/// How a parameter differs between recordings: its logarithm (of phi and beta that of the correlation time) is normal.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ParameterSpread {
    /// The parameter.
    pub of: ParameterRef,
    /// Its median (units of the parameter).
    pub median: f64,
    /// 95 % interval of that.
    pub median_ci95: [f64; 2],
    /// Standard deviation of the logarithm.
    pub sd: f64,
    /// 95 % interval of that.
    pub sd_ci95: [f64; 2],
}

/// The 95 % interval of one parameter.
#[derive(Debug, Clone, PartialEq)]
pub struct ParameterInterval {
    /// The parameter.
    pub of: ParameterRef,
    /// Lower end (units of the parameter); NaN where the draws do not determine it.
    pub low: f64,
    /// Upper end (units of the parameter); NaN where the draws do not determine it.
    pub high: f64,
    /// Share of the draws in which its process has vanished: is zero, or has its correlation time at the end of what can be
    /// searched, where it is another process by name only.
    pub lost: f64,
    /// Why there is no interval, if there is none.
    pub absent: Option<Undetermined>,
    /// Standard error by the sandwich (units of the parameter); NaN where it stands at a bound.
    pub standard_error: f64,
}

/// Why a parameter has no interval.
#[derive(Debug, Clone, PartialEq)]
pub enum Undetermined {
    /// Its process is zero at the optimum.
    Zero,
    /// Its process vanishes in more of the draws than the quantile leaves out.
    Vanishes,
    /// The draws lie to one side of the estimate.
    OneSided,
    /// The interval of the correlation time ends beyond what can be searched.
    BeyondSearch,
    /// The draws leave the amplitude of its process open by more than a factor of 100: in some of them it all but vanishes.
    Open,
    /// These processes, which are alike, cannot be told apart.
    Indistinct(Vec<usize>),
}

/// The test of over-identifying restrictions. Its statistic is the least Σ Omega_j (nu_j − nu_j(theta))²; what it
/// is when the model holds is known from the bootstrap, which repeats the whole estimation, so no weighting and
/// no trim makes the probability wrong, and the replicates' differences are allowed for.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct Goodness {
    /// J, the objective.
    pub statistic: f64,
    /// Scales less free parameters of processes that are there.
    pub dof: usize,
    /// Median of J when the model holds.
    pub expected: f64,
    /// Probability of a J at least this large when the model holds: (1 + draws that have one) / (1 + draws).
    pub p_value: f64,
}

/// Probability below which the model is said not to describe the curve.
pub(super) const LEVEL: f64 = 0.05;

impl Goodness {
    /// Whether so large a J has a probability below 5 % when the model holds.
    #[must_use]
    pub fn is_rejected(&self) -> bool {
        self.p_value < LEVEL
    }
}

/// Processes of one kind that cannot be told apart.
#[derive(Debug, Clone, PartialEq)]
pub struct Indistinct {
    /// Their positions in the model.
    pub processes: Vec<usize>,
    /// The model with one of them less, which describes the curve as well.
    pub spec: ModelSpec,
    /// Its parameters.
    pub composite: Composite,
    /// Probability of so large a gain by the further process if the simpler model is true.
    pub p_value: f64,
    /// Intervals of the simpler model's parameters.
    pub intervals: Vec<ParameterInterval>,
}
