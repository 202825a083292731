//! Noise model of the filter: inertial noise in the form of filter states.
//!
//! ```
//! use nav_sim_navigation::ekf::{FilterModel, FilterStates};
//! use nav_sim_signal::imu::Sensor;
//! use nav_sim_signal::noise::{Composite, Model, Process};
//!
//! // A bias of 1e-4 rad/s with a correlation time of 100 s at 100 Hz.
//! let bias = Process::ar1(0.9999, 1e-8 * (1.0 - 0.9999 * 0.9999))?;
//! let axis = Composite::new(vec![Process::white(1e-6)?, bias]);
//! let belief = FilterModel::new(&Model::pooled(100.0, &axis, &axis), FilterStates::Full, 1.0, 800.0)?;
//! // Position, velocity, attitude, and a bias for each of six axes.
//! assert_eq!(belief.states, 15);
//! assert!((belief.initial_bias_sigma(Sensor::Gyro) / 1e-4 - 1.0).abs() < 1e-9);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

use super::filter::{CoefficientKind, ErrorCoefficient, KINDS};
use crate::frames::RollPitchYaw;
use crate::imu::{Axis, Channel, Sensor};
use crate::noise::{Ar1Bank, Composite, Model, Process, ProcessKind, reduction};
use crate::sensors::check_bounds;
use crate::units::{NonNegative, Positive, SettingError};
use glam::{DQuat, DVec3};
use nalgebra::Matrix3;
use nav_sim_signal::names::UnknownName;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Most bias states an axis.
const MAX_GROUPS: usize = 8;
/// Most blocks of a sensor: bias groups of the model, an unknown constant, and what is multiplied.
pub(super) const MAX_BLOCKS: usize = MAX_GROUPS + 1 + KINDS;

/// A model that cannot be made into filter states.
#[derive(Debug, Clone, thiserror::Error)]
pub enum FilterModelError {
    /// More bias states than the filter carries.
    #[error("{channel}: more than {MAX_GROUPS} correlated processes; use the 15-state filter")]
    TooManyStates {
        /// The axis that carries them.
        channel: Channel,
    },
    /// Reduction failed.
    #[error("{channel}: {source}")]
    Reduction {
        /// The axis.
        channel: Channel,
        /// Reason of the refusal.
        source: reduction::ReductionError,
    },
    /// A setting that leaves the model no such filter: nothing is wrong with the model.
    #[error(transparent)]
    Setting(#[from] SettingError),
}

/// One bias state an axis of one sensor: b_{k+1} = phi b_k + w.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct BiasGroup {
    /// Coefficients of the three axes.
    pub phi: DVec3,
    /// Innovation variances (units² per sample).
    pub innovation: DVec3,
    /// Initial variances (units²).
    pub initial: DVec3,
}

impl BiasGroup {
    /// A constant that is not known: the same for all time, with this standard deviation on each axis.
    pub(crate) const fn constant(sigma: f64) -> Self {
        Self {
            phi: DVec3::ONE,
            innovation: DVec3::ZERO,
            initial: DVec3::splat(sigma * sigma),
        }
    }

    /// Returns true if it is zero for all time.
    fn is_empty(&self) -> bool {
        self.innovation == DVec3::ZERO && self.initial == DVec3::ZERO
    }

    /// Returns true for an unknown constant.
    pub fn is_constant(&self) -> bool {
        self.innovation == DVec3::ZERO && self.phi == DVec3::ONE
    }

    /// The bias with a step of `ratio` samples, which need not be whole: a Gauss-Markov process keeps its
    /// correlation time and variance, a random walk its growth. A coefficient ≤ 0 belongs to no process in
    /// continuous time and is left as it is.
    pub(crate) fn over(&self, ratio: f64) -> Self {
        let axis = |i: usize| match self.phi[i] {
            phi if phi >= 1.0 => (phi, self.innovation[i] * ratio),
            phi if phi > 0.0 => {
                // κ = dt/T of one sample. exp_m1 below, since at κ = 1e-8 the difference 1 − exp(−2κ) keeps
                // half of its digits only.
                let kappa = -(phi - 1.0).ln_1p();
                // Variance σ²/(1 − phi²) is kept, hence innovation ∝ 1 − phi^(2·ratio).
                let share = (-2.0 * kappa * ratio).exp_m1() / (-2.0 * kappa).exp_m1();
                ((-kappa * ratio).exp(), self.innovation[i] * share)
            }
            phi => (phi, self.innovation[i]),
        };
        let [x, y, z] = [0, 1, 2].map(axis);
        Self {
            phi: DVec3::new(x.0, y.0, z.0),
            innovation: DVec3::new(x.1, y.1, z.1),
            ..*self
        }
    }
}

/// Noise model of the filter: white noise of a sample, bias states and unknown constants, for each
/// sensor.
#[derive(Debug, Clone, PartialEq)]
pub struct FilterModel {
    /// Rate the parameters belong to (Hz).
    pub rate_hz: f64,
    /// White variance of a sample on the three axes, accelerometer ((m/s²)²) and gyroscope ((rad/s)²).
    pub white: [DVec3; 2],
    /// Bias groups of the accelerometer and of the gyroscope, at least one each.
    pub groups: [Vec<BiasGroup>; 2],
    /// Unknown constants that act on the samples of each sensor multiplied, each kind at most once, in order.
    pub(super) unknowns: [Vec<ErrorCoefficient>; 2],
    /// Standard deviations of a wheel's scale (1), and of pitch and yaw of the vehicle's axes in those of the IMU (rad).
    pub(crate) vehicle: DVec3,
    /// Stochastic states carried, navigation included (15 for the reduced filter).
    pub states: usize,
}

impl FilterModel {
    /// The filter's states for a model.
    ///
    /// The reduction is made for a GNSS interval and a longest time scale (s; [`reduction::window_s`]).
    /// Quantization noise is left out of the filter: its integral is bounded, so it is not white noise to a
    /// filter that integrates. A drift has a state of its own in any filter, [`CoefficientKind::Drift`]. What is
    /// expected beside the model comes by [`FilterModel::with_initial`].
    ///
    /// # Errors
    /// When the model has too many processes for the full filter, or the reduction fails.
    pub fn new(
        model: &Model,
        states: FilterStates,
        interval_s: f64,
        window_s: f64,
    ) -> Result<Self, FilterModelError> {
        let mut filter_model = Self {
            rate_hz: model.rate_hz,
            white: [DVec3::ZERO; 2],
            groups: [vec![], vec![]],
            unknowns: [vec![], vec![]],
            vehicle: DVec3::ZERO,
            states: 9,
        };
        for channel in Channel::ALL {
            let axis = if states.is_reduced() {
                AxisBelief::reduced(model, channel, interval_s, window_s)?
            } else {
                AxisBelief::full(model.axis(channel))
            };
            if axis.biases.len() > MAX_GROUPS {
                return Err(FilterModelError::TooManyStates { channel });
            }
            filter_model.add(channel, &axis);
        }
        for groups in &mut filter_model.groups {
            if groups.is_empty() {
                // The step of the covariance expects a bias block for each sensor: one that is zero for all
                // time costs nothing else.
                groups.push(BiasGroup::default());
            }
        }
        for sensor in Sensor::ALL {
            // A drift is deterministic in the truth. Believed as an unknown slope, its sign need not be known
            // to the filter.
            filter_model.set_unknown(sensor, CoefficientKind::Drift, drift(model, sensor));
            filter_model.set_unknown(
                sensor,
                CoefficientKind::ScaleFactor,
                DVec3::splat(states.scale_sigma()),
            );
        }
        Ok(filter_model)
    }

    /// With the turn-on biases and scale factors that the settings of the start expect; the attitude, position
    /// and velocity of the start are the filter's own affair ([`super::Ekf::new`]).
    pub fn with_initial(mut self, initial: &InitialSettings) -> Self {
        for sensor in Sensor::ALL {
            self.add_constant(sensor, initial.bias_sigma(sensor).unwrap_or(0.0));
            if let Some(ppm) = initial.scale_sigma_ppm(sensor) {
                self.set_unknown(
                    sensor,
                    CoefficientKind::ScaleFactor,
                    DVec3::splat(ppm * 1e-6),
                );
            }
        }
        self
    }

    /// With states of a vehicle's own measurements, of these deviations: scale of the wheel (1), pitch and yaw of the
    /// vehicle's axes in those of the IMU (rad).
    pub fn with_vehicle(mut self, sigmas: DVec3) -> Self {
        self.vehicle = sigmas;
        self.states += self
            .vehicle
            .to_array()
            .iter()
            .filter(|sigma| **sigma > 0.0)
            .count();
        self
    }

    fn add(&mut self, channel: Channel, axis: &AxisBelief) {
        let (sensor, i) = (channel.sensor as usize, channel.axis as usize);
        self.white[sensor][i] = axis.white;
        self.states += axis.biases.len();
        for (g, bias) in axis.biases.iter().enumerate() {
            if self.groups[sensor].len() == g {
                self.groups[sensor].push(BiasGroup::default());
            }
            let group = &mut self.groups[sensor][g];
            [group.phi[i], group.innovation[i], group.initial[i]] = *bias;
        }
    }

    /// The unknown constants of a sensor that are multiplied.
    pub(crate) fn unknowns(&self, sensor: Sensor) -> &[ErrorCoefficient] {
        &self.unknowns[sensor as usize]
    }

    /// Blocks of the covariance: R, V, PSI, the bias groups, the unknowns, and one of the vehicle.
    pub(crate) fn blocks(&self) -> usize {
        3 + Sensor::ALL
            .map(|s| self.groups[s as usize].len() + self.unknowns[s as usize].len())
            .iter()
            .sum::<usize>()
            + usize::from(self.vehicle != DVec3::ZERO)
    }

    /// Adds an unknown constant to the biases of a sensor (a turn-on bias), the same deviation on each axis
    /// (m/s² or rad/s); nothing where sigma is 0. With another one before, it is one of both variances.
    pub fn add_constant(&mut self, sensor: Sensor, sigma: f64) {
        if sigma <= 0.0 {
            return;
        }
        let groups = &mut self.groups[sensor as usize];
        if let Some(before) = groups.iter_mut().find(|g| g.is_constant()) {
            // The sum of two independent unknown constants cannot be separated by any measurement: one state
            // for both.
            before.initial += DVec3::splat(sigma * sigma);
            return;
        }
        // The placeholder of a model without biases makes room for the constant: a block without variance is
        // only cost.
        groups.retain(|g| !g.is_empty());
        groups.push(BiasGroup::constant(sigma));
        self.states += 3;
    }

    /// Sets the deviations of an unknown on the three axes; without any, it has no states.
    pub(crate) fn set_unknown(&mut self, sensor: Sensor, kind: CoefficientKind, sigma: DVec3) {
        let unknowns = &mut self.unknowns[sensor as usize];
        let axes = |sigma: DVec3| sigma.to_array().iter().filter(|s| **s > 0.0).count();
        self.states -= unknowns
            .iter()
            .filter(|u| u.kind == kind)
            .map(|u| axes(u.sigma))
            .sum::<usize>();
        unknowns.retain(|u| u.kind != kind);
        if sigma != DVec3::ZERO {
            self.states += axes(sigma);
            unknowns.push(ErrorCoefficient { kind, sigma });
            unknowns.sort_by_key(|u| u.kind);
        }
    }

    /// Standard deviation of the biases of a sensor at the start: the largest of the three axes.
    pub fn initial_bias_sigma(&self, sensor: Sensor) -> f64 {
        let groups = self.groups[sensor as usize].iter();
        groups
            .map(|g| g.initial)
            .sum::<DVec3>()
            .max_element()
            .sqrt()
    }
}

/// Magnitudes of the drifts of a sensor's axes (units per sample).
fn drift(model: &Model, sensor: Sensor) -> DVec3 {
    let of_axis = |axis| {
        let noise = model.axis(Channel { sensor, axis });
        noise.amplitude_of(ProcessKind::Drift).abs()
    };
    DVec3::from_array(Axis::ALL.map(of_axis))
}

struct AxisBelief {
    white: f64,
    biases: Vec<BiasState>,
}

/// phi, innovation and initial variance of a bias of an axis.
type BiasState = [f64; 3];

impl AxisBelief {
    fn full(noise: &Composite) -> Self {
        let mut axis = Self {
            white: 0.0,
            biases: vec![],
        };
        for process in &noise.processes {
            // quantization is left out, a drift has a state of its own
            let parts = process.parts(Ar1Bank::FILTER);
            axis.white += parts.iter().map(Process::white_variance).sum::<f64>();
            let mut biases: Vec<_> = parts.iter().filter_map(Process::recursion).collect();
            // what is slower still of flicker noise is as constant as the slowest
            let stationary: f64 = biases.iter().map(|[.., initial]| initial).sum();
            if let Some([.., slowest]) = biases.last_mut() {
                *slowest += (process.initial_variance() - stationary).max(0.0);
            }
            axis.biases.extend(biases);
        }
        axis
    }

    /// White noise and one bias: those of the model where it has no more, else its reduction.
    fn reduced(
        model: &Model,
        channel: Channel,
        interval_s: f64,
        window_s: f64,
    ) -> Result<Self, FilterModelError> {
        let noise = model.axis(channel);
        if reduction::is_exact(noise) {
            let mut axis = Self::full(noise);
            if axis.biases.is_empty() {
                axis.biases.push([0.0; 3]);
            }
            return Ok(axis);
        }
        let reduced = reduction::reduce(noise, model.rate_hz, interval_s, window_s)
            .map_err(|source| FilterModelError::Reduction { channel, source })?;
        let bias = [
            reduced.bias.shape(),
            reduced.bias.amplitude(),
            reduced.initial_variance,
        ];
        Ok(Self {
            white: reduced.white,
            biases: vec![bias],
        })
    }
}

// How a noise model becomes states of the filter, and how people write that.

/// Scale-factor error that the filter of 21 states expects (1): 300 ppm, that of KF-GINS's demonstration.
const SCALE_SIGMA: f64 = 300e-6;

/// Representation of the noise model in the filter. Unknown constants (turn-on bias, scale factors)
/// and drifts (DR) of the model add three states each to any of them.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(try_from = "WrittenStates")]
#[schemars(!try_from)]
pub enum FilterStates {
    /// 15 states: one first-order Gauss-Markov bias an axis, the reduction of the model.
    #[default]
    #[serde(rename = "15")]
    Reduced15,
    /// 21 states: those 15 and a constant scale factor of each axis of both sensors (300 ppm unless said).
    #[serde(rename = "21")]
    Reduced21,
    /// One state for each AR1 and random walk of each axis.
    #[serde(rename = "full")]
    Full,
}

nav_sim_signal::named!(FilterStates { Reduced15 = "15", Reduced21 = "21", Full = "full" });

impl FilterStates {
    /// Scale-factor error that the filter expects of both sensors where nothing else is said (1).
    pub const fn scale_sigma(self) -> f64 {
        match self {
            Self::Reduced21 => SCALE_SIGMA,
            Self::Reduced15 | Self::Full => 0.0,
        }
    }

    /// Returns true if the model's processes are reduced to one bias per axis.
    pub const fn is_reduced(self) -> bool {
        !matches!(self, Self::Full)
    }
}

/// In a file: a word, or a number for those that are one.
#[derive(Deserialize)]
#[serde(untagged, expecting = "\"15\", \"21\" or \"full\"")]
enum WrittenStates {
    Number(u64),
    Word(String),
}

impl TryFrom<WrittenStates> for FilterStates {
    type Error = UnknownName;

    fn try_from(written: WrittenStates) -> Result<Self, UnknownName> {
        match written {
            WrittenStates::Number(number) => number.to_string().parse(),
            WrittenStates::Word(word) => word.parse(),
        }
    }
}

// What the filter knows at the start, and how far the nominal start is drawn from the truth.

/// Standard deviations of the initial state. The nominal start is drawn from them, so that the filter's
/// own covariance is true at the first epoch. The defaults are a vehicle that has just been aligned with
/// the help of GNSS: position and velocity as good as one fix of the paper's receiver, half a degree of
/// roll and pitch (a consumer accelerometer's bias of 0.09 m/s² tilts a levelling by as much), two
/// degrees of heading. Biases and scale factors are not drawn from here: those of the true IMU are its own.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct InitialSettings {
    /// Position north, east, down (m).
    #[schemars(with = "[Positive; 3]", inner(range(max = 1e5)))]
    pub pos_sigma_m: [f64; 3],
    /// Velocity north, east, down (m/s).
    #[schemars(with = "[Positive; 3]", inner(range(max = 1000.0)))]
    pub vel_sigma_m_s: [f64; 3],
    /// Roll, pitch, yaw (degrees).
    #[schemars(with = "[Positive; 3]", inner(range(max = 30.0)))]
    pub att_sigma_deg: [f64; 3],
    /// Turn-on bias of the accelerometers that the filter expects beside the model's processes (m/s²): an
    /// unknown constant, one state an axis; without it, none.
    #[schemars(with = "Option<NonNegative>", range(max = 10.0))]
    pub accel_bias_sigma_m_s2: Option<f64>,
    /// Turn-on bias of the gyroscopes that the filter expects beside the model's processes (rad/s): an unknown
    /// constant, one state an axis; without it, none.
    #[schemars(with = "Option<NonNegative>", range(max = 1.0))]
    pub gyro_bias_sigma_rad_s: Option<f64>,
    /// Scale-factor error of the accelerometers that the filter expects (parts per million): an unknown
    /// constant, one state an axis; without it, 300 in the filter of 21 states and none in the others.
    #[schemars(with = "Option<NonNegative>", range(max = 1e5))]
    pub accel_scale_sigma_ppm: Option<f64>,
    /// Scale-factor error of the gyroscopes that the filter expects (parts per million), as that of the
    /// accelerometers.
    #[schemars(with = "Option<NonNegative>", range(max = 1e5))]
    pub gyro_scale_sigma_ppm: Option<f64>,
    /// Start exactly at the truth; the filter's covariance stays as given above.
    pub perfect: bool,
}

impl Default for InitialSettings {
    fn default() -> Self {
        Self {
            pos_sigma_m: [2.0, 2.0, 4.0],
            vel_sigma_m_s: [0.04, 0.04, 0.06],
            att_sigma_deg: [0.5, 0.5, 2.0],
            accel_bias_sigma_m_s2: None,
            gyro_bias_sigma_rad_s: None,
            accel_scale_sigma_ppm: None,
            gyro_scale_sigma_ppm: None,
            perfect: false,
        }
    }
}

impl InitialSettings {
    /// The turn-on bias that the filter expects of a sensor (m/s² or rad/s).
    pub const fn bias_sigma(&self, sensor: Sensor) -> Option<f64> {
        [self.accel_bias_sigma_m_s2, self.gyro_bias_sigma_rad_s][sensor as usize]
    }

    /// The scale-factor error that the filter expects of a sensor (parts per million).
    pub const fn scale_sigma_ppm(&self, sensor: Sensor) -> Option<f64> {
        [self.accel_scale_sigma_ppm, self.gyro_scale_sigma_ppm][sensor as usize]
    }

    /// The key of [`Self::bias_sigma`].
    pub const fn bias_key(sensor: Sensor) -> &'static str {
        ["accel_bias_sigma_m_s2", "gyro_bias_sigma_rad_s"][sensor as usize]
    }

    /// The key of [`Self::scale_sigma_ppm`].
    pub const fn scale_key(sensor: Sensor) -> &'static str {
        ["accel_scale_sigma_ppm", "gyro_scale_sigma_ppm"][sensor as usize]
    }

    /// Checks every value.
    ///
    /// # Errors
    /// The first key whose value is refused.
    pub fn validate(&self) -> Result<(), SettingError> {
        check_bounds(self)
    }
}

/// The rotation vector psi_n of small roll, pitch and yaw errors at an attitude: the inverse of
/// [`RollPitchYaw::jacobian_of_psi_n`]. At pitch ±90° roll and yaw are not separate: the errors are then
/// taken about the axes of n.
pub(crate) fn psi_of_angles(q_b_n: DQuat) -> Matrix3<f64> {
    // Inverted numerically: one formula for the Jacobian, in one place.
    let j = RollPitchYaw::from_quat(q_b_n).jacobian_of_psi_n();
    Matrix3::from_fn(|row, column| j[row][column])
        .try_inverse()
        .unwrap_or_else(Matrix3::identity)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::noise::Process;

    /// The filter of 15 states of a model with one bias an axis, whichever it is, is the filter with all states.
    #[test]
    fn a_model_that_fits_15_states_is_taken_as_it_is() {
        let white = Process::white(5e-5).unwrap();
        let biases = [
            Process::random_walk(3.3e-11).unwrap(),
            Process::ar1(0.9999, 1e-11).unwrap(),
            Process::gauss_markov(0.01, 1e-6, 100.0).unwrap(),
        ];
        let quantization = Process::quantization(1e-7).unwrap();
        for axes in [[0, 0, 0], [1, 1, 1], [2, 2, 2], [0, 1, 2]] {
            let axis = |i: usize| Composite::new(vec![white, biases[axes[i]], quantization]);
            let mut model = Model::pooled(100.0, &axis(0), &axis(0));
            for channel in Channel::ALL {
                model.axes[channel.index()] = axis(channel.axis as usize);
            }
            let made = |states| FilterModel::new(&model, states, 1.0, 800.0).unwrap();
            assert_eq!(made(FilterStates::Reduced15), made(FilterStates::Full));
        }
    }

    /// Two steps of half a sample and of one and a half are two whole ones: b_{k+1} = phi b_k + w twice.
    #[test]
    fn parts_of_a_sample_compose() {
        let phi = DVec3::new(0.9, 1.0, 0.0);
        let group = BiasGroup {
            phi,
            innovation: DVec3::new(0.2, 0.3, 0.4),
            initial: DVec3::ONE,
        };
        let (a, b) = (group.over(0.5), group.over(1.5));
        for i in 0..2 {
            let (phi, q) = (
                a.phi[i] * b.phi[i],
                b.phi[i].powi(2) * a.innovation[i] + b.innovation[i],
            );
            let whole = (
                phi_squared(group.phi[i]),
                (1.0 + phi_squared(group.phi[i])) * group.innovation[i],
            );
            assert!(
                (phi - whole.0).abs() < 1e-14 && (q - whole.1).abs() < 1e-14,
                "axis {i}"
            );
        }
        assert_eq!((a.phi.z, a.innovation.z), (0.0, 0.4));
    }

    fn phi_squared(phi: f64) -> f64 {
        phi * phi
    }
}

#[cfg(test)]
mod states_tests {
    use super::*;

    #[test]
    fn a_filter_is_read_as_it_is_written() {
        for states in FilterStates::ALL {
            assert_eq!(states.to_string().parse(), Ok(states));
            assert_eq!(serde_json::to_value(states).unwrap(), states.name());
            assert_eq!(
                serde_json::from_value::<FilterStates>(states.name().into()).unwrap(),
                states
            );
        }
        assert_eq!(
            serde_json::from_str::<FilterStates>("21").unwrap(),
            FilterStates::Reduced21
        );
        assert!(
            "16".parse::<FilterStates>().is_err()
                && serde_json::from_str::<FilterStates>("27").is_err()
        );
    }
}
