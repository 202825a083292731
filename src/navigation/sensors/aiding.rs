//! Aiding by the vehicle's motion: the non-holonomic constraint, an odometer, zero velocity, a
//! heading.
//!
//! The filter models each with white noise, and with states for lasting errors where their standard
//! deviation is given. The true errors stand apart in a table `truth`, so that a filter that leaves
//! them out is detected.
//!
//! The vehicle's axes are forward, right, down, those of the reference. Models of the errors:
//! [Groves](crate::bibliography::Groves13), sec. 15.3 (constraints) and 16.3 (odometers).

use super::gnss::MAX_LEVER_ARM_M;
use super::normal;
use crate::rng::{Generator, StreamKey};
use crate::units::{Amount, DEG, Measurable};
use glam::DVec3;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// `[aiding]`: measurements of the vehicle by itself, which outages do not concern but for a heading of two antennas.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct AidingSettings {
    /// Non-holonomic constraint: a road vehicle moves neither sideways nor up.
    pub nhc: Option<NhcSettings>,
    /// Forward speed of a wheel.
    pub odometer: Option<OdometerSettings>,
    /// Zero velocity where the reference stands.
    pub zupt: Option<ZuptSettings>,
    /// Heading of a compass or of two antennas.
    pub heading: Option<HeadingSettings>,
}

impl AidingSettings {
    /// Returns true if no aid is set.
    pub fn is_none(&self) -> bool {
        self.rates().next().is_none()
    }

    /// Aids that are set, and their rates (Hz).
    pub fn rates(&self) -> impl Iterator<Item = (Aid, f64)> {
        let rate = |aid| Some((aid, self.common(aid)?.0));
        Aid::ALL.into_iter().filter_map(rate)
    }

    /// Rate (Hz) of an aid that is set, white noise of a measurement as in the filter's model and in truth (m/s or rad), and
    /// the point whose velocity it measures, from the IMU, in b (m).
    fn common(&self, aid: Aid) -> Option<(f64, f64, Option<f64>, [f64; 3])> {
        Some(match aid {
            Aid::Nhc => {
                let s = self.nhc.as_ref()?;
                (
                    s.rate_hz,
                    s.sigma_m_s,
                    s.truth.noise_sigma_m_s,
                    s.lever_arm_m,
                )
            }
            Aid::Odometer => {
                let s = self.odometer.as_ref()?;
                (
                    s.rate_hz,
                    s.sigma_m_s,
                    s.truth.noise_sigma_m_s,
                    s.lever_arm_m,
                )
            }
            Aid::Zupt => {
                let s = self.zupt.as_ref()?;
                (s.rate_hz, s.sigma_m_s, s.truth.noise_sigma_m_s, [0.0; 3])
            }
            Aid::Heading => {
                let s = self.heading.as_ref()?;
                let noise = s.truth.noise_sigma_deg.map(|n| n * DEG);
                (s.rate_hz, s.sigma_deg * DEG, noise, [0.0; 3])
            }
        })
    }

    /// Returns true for an aid that is part of the receiver and so measures nothing in outages.
    pub(crate) fn is_of_gnss(&self, aid: Aid) -> bool {
        let heading = self.heading.as_ref().filter(|_| aid == Aid::Heading);
        heading.is_some_and(|heading| heading.source == HeadingSource::Antennas)
    }

    /// The point of which an aid measures the velocity, with respect to the IMU, in b (m).
    pub(crate) fn lever_arm_b(&self, aid: Aid) -> DVec3 {
        self.common(aid).map_or(DVec3::ZERO, |(.., arm)| arm.into())
    }

    /// Standard deviations of one measurement's white noise, as in the filter's model and in truth (m/s or rad).
    pub fn sigmas(&self, aid: Aid) -> [f64; 2] {
        let (_, sigma, noise, _) = self.common(aid).unwrap_or_default();
        [sigma, noise.unwrap_or(sigma)]
    }

    /// Standard deviations of what a filter may have as states: scale of the wheel (1), pitch and yaw of the vehicle's
    /// axes (rad); 0 where it has none.
    pub fn state_sigmas(&self) -> DVec3 {
        let scale = self.odometer.as_ref().map_or(0.0, |s| s.scale_sigma);
        let mounting = self
            .nhc
            .as_ref()
            .map_or(0.0, |s| s.mounting_sigma_deg * DEG);
        DVec3::new(scale, mounting, mounting)
    }

    /// A car: the constraint at the rear axle with states of its mounting, and what is truly wrong with it: 0.5° of
    /// mounting, sideslip of 0.003 rad s²/m, 0.05 m/s of the suspension over a second.
    pub fn car() -> Self {
        let truth = NhcErrors {
            noise_sigma_m_s: Some(0.02),
            mounting_sigma_deg: 0.5,
            sideslip_s2_m: 0.003,
            walk_sigma_m_s: 0.05,
            correlation_time_s: 1.0,
        };
        let nhc = NhcSettings {
            mounting_sigma_deg: 0.5,
            truth,
            ..NhcSettings::default()
        };
        Self {
            nhc: Some(nhc),
            ..Self::default()
        }
    }

    /// Aiding of a car with a wheel whose scale is off by one per cent, of which the filter has a state.
    pub fn car_with_odometer() -> Self {
        let truth = OdometerErrors {
            scale_sigma: 0.01,
            noise_sigma_m_s: None,
            slip_s2_m: 0.002,
        };
        let odometer = OdometerSettings {
            sigma_m_s: 0.1,
            scale_sigma: 0.01,
            truth,
            ..OdometerSettings::default()
        };
        Self {
            odometer: Some(odometer),
            ..Self::car()
        }
    }
}

/// A kind of aiding.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Aid {
    /// Non-holonomic constraint.
    Nhc,
    /// Speed of a wheel.
    Odometer,
    /// Zero velocity.
    Zupt,
    /// Yaw.
    Heading,
}

impl Aid {
    /// All, in the order of their use at one instant.
    pub(crate) const ALL: [Self; 4] = [Self::Nhc, Self::Odometer, Self::Zupt, Self::Heading];

    /// Name of its table.
    pub const fn name(self) -> &'static str {
        ["nhc", "odometer", "zupt", "heading"][self as usize]
    }

    /// The axes of the vehicle along which it measures the velocity; none of a heading.
    pub(crate) const fn axes(self) -> &'static [usize] {
        match self {
            Self::Nhc => &[1, 2],
            Self::Odometer => &[0],
            Self::Zupt => &[0, 1, 2],
            Self::Heading => &[],
        }
    }
}

// What is truly wrong with a vehicle's own measurements, and how it goes on.

/// Acceleration times speed of a brisk drive (m²/s³): 2 m/s² at 10 m/s.
const BRISK: f64 = 20.0;
/// A constant is felt where the mean of a hundred measurements would show it.
const LASTING_FIXES: f64 = 10.0;

impl AidingSettings {
    /// Sources of error that a filter feels and does not expect: their names in a budget, and the key that makes it expect
    /// them.
    pub(crate) fn unexpected(&self) -> Vec<(String, String)> {
        let is_noisier = |(aid, _): &(Aid, f64)| {
            let [believed, true_sigma] = self.sigmas(*aid);
            true_sigma > believed
        };
        let noise = self.rates().filter(is_noisier).map(|(aid, _)| {
            let name = aid.name();
            let unit = if aid == Aid::Heading { "deg" } else { "m_s" };
            (
                format!("aiding.{name}"),
                format!("aiding.{name}.sigma_{unit}"),
            )
        });
        let lasting = self.errors().into_iter().filter(|error| error.is_felt);
        let lasting = lasting.map(|error| error.part.names());
        let lasting = lasting.map(|(name, key)| (name.to_owned(), key.to_owned()));
        let mut found: Vec<_> = noise.chain(lasting).collect();
        // Two parts of one name stand together.
        found.dedup();
        found
    }

    /// True errors beside white noise (m/s, rad, 1).
    pub(crate) fn errors(&self) -> Vec<AidError> {
        use AidPart::*;
        let mut all = Vec::new();
        let mut push = |part, law: ErrorProcess, unfelt: f64| {
            let size = law.size();
            let is_felt = size > unfelt;
            all.extend((size > 0.0).then_some(AidError { part, law, is_felt }));
        };
        // As for the errors of positions: a filter averages white noise over the time that the error lasts.
        let averaged = |sigma: f64, measurements: f64| 0.5 * sigma / measurements.max(1.0).sqrt();
        if let Some(nhc) = &self.nhc {
            let (truth, time_s) = (&nhc.truth, nhc.truth.correlation_time_s);
            for part in [MountingPitch, MountingYaw] {
                let law = ErrorProcess::Constant(truth.mounting_sigma_deg * DEG);
                push(part, law, 2.0 * nhc.mounting_sigma_deg * DEG);
            }
            push(
                Slip,
                ErrorProcess::Known(truth.sideslip_s2_m),
                0.5 * nhc.sigma_m_s / BRISK,
            );
            for part in [SuspensionLateral, SuspensionVertical] {
                let sigma = truth.walk_sigma_m_s;
                let law = ErrorProcess::GaussMarkov { sigma, time_s };
                push(part, law, averaged(nhc.sigma_m_s, nhc.rate_hz * time_s));
            }
        }
        if let Some(wheel) = &self.odometer {
            let truth = &wheel.truth;
            push(
                WheelScale,
                ErrorProcess::Constant(truth.scale_sigma),
                2.0 * wheel.scale_sigma,
            );
            push(
                WheelSlip,
                ErrorProcess::Known(truth.slip_s2_m),
                0.5 * wheel.sigma_m_s / BRISK,
            );
        }
        if let Some(zupt) = &self.zupt {
            let (sigma, time_s) = (zupt.truth.walk_sigma_m_s, zupt.truth.correlation_time_s);
            let law = ErrorProcess::GaussMarkov { sigma, time_s };
            push(Creep, law, averaged(zupt.sigma_m_s, zupt.rate_hz * time_s));
        }
        if let Some(heading) = &self.heading {
            let (truth, time_s) = (&heading.truth, heading.truth.correlation_time_s);
            let white = heading.sigma_deg * DEG;
            let offset = ErrorProcess::Constant(truth.offset_sigma_deg * DEG);
            push(HeadingOffset, offset, averaged(white, LASTING_FIXES));
            let sigma = truth.walk_sigma_deg * DEG;
            let law = ErrorProcess::GaussMarkov { sigma, time_s };
            push(
                HeadingCorrelated,
                law,
                averaged(white, heading.rate_hz * time_s),
            );
        }
        all
    }
}

/// An error of an aid that lasts.
#[derive(Clone, Copy)]
pub(crate) struct AidError {
    pub part: AidPart,
    pub law: ErrorProcess,
    /// True if the filter, with the states that it has, does not expect so large a one.
    is_felt: bool,
}

/// Part of an aiding error.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum AidPart {
    MountingPitch,
    MountingYaw,
    Slip,
    SuspensionLateral,
    SuspensionVertical,
    WheelScale,
    WheelSlip,
    Creep,
    HeadingOffset,
    HeadingCorrelated,
}

impl AidPart {
    /// The aid, its source in a budget (parts of one name are one source), its stream of random numbers, and the key that makes
    /// a filter expect it.
    const fn row(self) -> (Aid, &'static str, &'static str, &'static str) {
        const NHC: (&str, &str) = ("aiding.nhc.sigma_m_s", "aiding.nhc.mounting_sigma_deg");
        const HEADING: &str = "aiding.heading.sigma_deg";
        let (wheel, scale) = ("aiding.odometer.sigma_m_s", "aiding.odometer.scale_sigma");
        match self {
            Self::MountingPitch => (Aid::Nhc, "aiding.nhc.mounting", "mounting_pitch", NHC.1),
            Self::MountingYaw => (Aid::Nhc, "aiding.nhc.mounting", "mounting_yaw", NHC.1),
            Self::Slip => (Aid::Nhc, "aiding.nhc.slip", "slip", NHC.0),
            Self::SuspensionLateral => (
                Aid::Nhc,
                "aiding.nhc.suspension",
                "suspension_lateral",
                NHC.0,
            ),
            Self::SuspensionVertical => (
                Aid::Nhc,
                "aiding.nhc.suspension",
                "suspension_vertical",
                NHC.0,
            ),
            Self::WheelScale => (Aid::Odometer, "aiding.odometer.scale", "scale", scale),
            Self::WheelSlip => (Aid::Odometer, "aiding.odometer.slip", "slip", wheel),
            Self::Creep => (
                Aid::Zupt,
                "aiding.zupt.creep",
                "creep",
                "aiding.zupt.sigma_m_s",
            ),
            Self::HeadingOffset => (Aid::Heading, "aiding.heading.offset", "offset", HEADING),
            Self::HeadingCorrelated => (
                Aid::Heading,
                "aiding.heading.correlated",
                "correlated",
                HEADING,
            ),
        }
    }

    /// The aid that it is part of.
    pub(crate) const fn aid(self) -> Aid {
        self.row().0
    }

    /// Its source in a budget, and the key that makes a filter expect it.
    pub(crate) const fn names(self) -> (&'static str, &'static str) {
        let (_, source, _, key) = self.row();
        (source, key)
    }

    /// Derivative of the measurement along an axis of the vehicle (0 for a heading) with respect to
    /// it. The vehicle moves with this velocity (m/s) and acceleration (m/s²), both in its own
    /// axes.
    ///
    /// The axes of the vehicle are those of the IMU turned by the small angles m: its velocity
    /// there is v − m × v.
    pub(crate) fn coefficient(self, axis: usize, v_b: DVec3, a_b: DVec3) -> f64 {
        match (self, axis) {
            (Self::MountingYaw, 1) => -v_b.x,
            (Self::MountingPitch, 2) | (Self::WheelScale, 0) => v_b.x,
            // Tyres slip outwards, against the acceleration, and the constraint says that they do not; a driven wheel turns
            // more than the way. Both in either direction of travel.
            (Self::Slip, 1) => a_b.y * v_b.x.abs(),
            (Self::WheelSlip, 0) => a_b.x * v_b.x.abs(),
            (Self::SuspensionLateral, 1) | (Self::SuspensionVertical, 2) => 1.0,
            (Self::Creep | Self::HeadingOffset | Self::HeadingCorrelated, 0) => 1.0,
            _ => 0.0,
        }
    }
}

/// Time behaviour of an error.
#[derive(Clone, Copy)]
pub(crate) enum ErrorProcess {
    /// One value in every run.
    Known(f64),
    /// A constant of each run, of this standard deviation.
    Constant(f64),
    /// A Gauss-Markov process.
    GaussMarkov { sigma: f64, time_s: f64 },
}

impl ErrorProcess {
    const fn size(self) -> f64 {
        match self {
            Self::Known(size) | Self::Constant(size) | Self::GaussMarkov { sigma: size, .. } => {
                size
            }
        }
    }
}

/// The errors of the aids in one run. Each has a stream of its own.
pub(crate) struct AidNoise {
    lasting: Vec<(AidError, Walk)>,
    /// White noise of each aid along each of its axes: deviation and streams.
    white: [(f64, [Generator; 3]); 4],
}

/// A lasting error as it goes on.
struct Walk {
    stream: Generator,
    value: f64,
    /// When it had that value (s).
    at_s: f64,
}

impl AidNoise {
    /// The errors of run `key.run`.
    pub(crate) fn new(settings: &AidingSettings, key: StreamKey<'_>) -> Self {
        let walk = |error: AidError| {
            let (aid, _, process, _) = error.part.row();
            let source = aid.name();
            let mut stream = key.stream(source, process);
            let value = match error.law {
                ErrorProcess::Known(value) => value,
                // a Gauss-Markov process is stationary from the start
                ErrorProcess::Constant(sigma) | ErrorProcess::GaussMarkov { sigma, .. } => {
                    sigma * normal(&mut stream)
                }
            };
            (
                error,
                Walk {
                    stream,
                    value,
                    at_s: 0.0,
                },
            )
        };
        let white = Aid::ALL.map(|aid| {
            let stream = |process| key.stream(aid.name(), process);
            (
                settings.sigmas(aid)[1],
                ["white_x", "white_y", "white_z"].map(stream),
            )
        });
        Self {
            lasting: settings.errors().into_iter().map(walk).collect(),
            white,
        }
    }

    /// The error of a measurement along an axis, `after_s` seconds from the start, where the vehicle moves so.
    pub(crate) fn draw(
        &mut self,
        aid: Aid,
        axis: usize,
        after_s: f64,
        v_b: DVec3,
        a_b: DVec3,
    ) -> f64 {
        let (sigma, streams) = &mut self.white[aid as usize];
        let mut sum = *sigma * normal(&mut streams[axis]);
        for (error, walk) in self
            .lasting
            .iter_mut()
            .filter(|(error, _)| error.part.aid() == aid)
        {
            let coefficient = error.part.coefficient(axis, v_b, a_b);
            if coefficient != 0.0 {
                sum += coefficient * walk.at(error.law, after_s);
            }
        }
        sum
    }
}

impl Walk {
    fn at(&mut self, law: ErrorProcess, after_s: f64) -> f64 {
        if let ErrorProcess::GaussMarkov { sigma, time_s } = law {
            let kappa = (after_s - self.at_s) / time_s;
            // phi e + √(1 − phi²) σ w keeps the variance; expm1 keeps the digits of a short step.
            self.value = (-kappa).exp() * self.value
                + (-(-2.0 * kappa).exp_m1()).sqrt() * sigma * normal(&mut self.stream);
            self.at_s = after_s;
        }
        self.value
    }
}

// The settings of each kind of aiding: what a filter states, and what is true.

/// `[aiding.nhc]`: lateral and vertical velocity of a point of the vehicle are zero.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct NhcSettings {
    /// Measurements per second.
    #[schemars(with = "Measurable")]
    pub rate_hz: f64,
    /// Standard deviation of one measurement, white, as in the filter's model (m/s).
    #[schemars(with = "Measurable")]
    pub sigma_m_s: f64,
    /// The point that moves neither sideways nor up, with respect to the IMU: front, right, down (m).
    #[schemars(inner(range(min = -MAX_LEVER_ARM_M, max = MAX_LEVER_ARM_M)))]
    pub lever_arm_m: [f64; 3],
    /// Pitch and yaw of the vehicle's axes in those of the IMU, as the filter expects them (1 σ, degrees): two states;
    /// 0: none.
    #[schemars(with = "Amount")]
    pub mounting_sigma_deg: f64,
    /// Its true errors.
    pub truth: NhcErrors,
}

/// `[aiding.nhc.truth]`: without it, the white noise is as in the filter's model, and there is nothing else.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct NhcErrors {
    /// White noise of one measurement (m/s); unless given, what the filter states.
    #[schemars(with = "Option<Amount>")]
    pub noise_sigma_m_s: Option<f64>,
    /// Pitch and yaw of the vehicle's axes in those of the IMU (1 σ, degrees), constant in a run.
    #[schemars(with = "Amount")]
    pub mounting_sigma_deg: f64,
    /// Sideslip angle per lateral acceleration (rad s²/m), the same in every run.
    #[schemars(with = "Amount")]
    pub sideslip_s2_m: f64,
    /// Lateral and vertical velocity of the body on its suspension (1 σ, m/s), a Gauss-Markov process.
    #[schemars(with = "Amount")]
    pub walk_sigma_m_s: f64,
    /// Correlation time of that velocity (s).
    #[schemars(with = "Measurable")]
    pub correlation_time_s: f64,
}

/// `[aiding.odometer]`: forward velocity of a point of the vehicle, by a wheel.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct OdometerSettings {
    /// Measurements per second.
    #[schemars(with = "Measurable")]
    pub rate_hz: f64,
    /// Standard deviation of one measurement, white, as in the filter's model (m/s).
    #[schemars(with = "Measurable")]
    pub sigma_m_s: f64,
    /// The wheel, or the middle of its axle, with respect to the IMU: front, right, down (m).
    #[schemars(inner(range(min = -MAX_LEVER_ARM_M, max = MAX_LEVER_ARM_M)))]
    pub lever_arm_m: [f64; 3],
    /// Scale factor of the wheel, as the filter expects it (1 σ): a state; 0: none.
    #[schemars(with = "Amount")]
    pub scale_sigma: f64,
    /// Its true errors.
    pub truth: OdometerErrors,
}

/// `[aiding.odometer.truth]`: without it, the white noise is as in the filter's model, and there is nothing else.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct OdometerErrors {
    /// White noise of one measurement (m/s); unless given, what the filter states.
    #[schemars(with = "Option<Amount>")]
    pub noise_sigma_m_s: Option<f64>,
    /// Scale-factor error (1 σ), constant in a run: the tyre.
    #[schemars(with = "Amount")]
    pub scale_sigma: f64,
    /// Slip of the wheel: share of the speed per forward acceleration (s²/m), the same in every run.
    #[schemars(with = "Amount")]
    pub slip_s2_m: f64,
}

/// `[aiding.zupt]`: the velocity is zero, wherever the reference stands (below 0.01 m/s and 0.01 deg/s).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct ZuptSettings {
    /// Measurements per second.
    #[schemars(with = "Measurable")]
    pub rate_hz: f64,
    /// Standard deviation of one measurement, white, as in the filter's model (m/s).
    #[schemars(with = "Measurable")]
    pub sigma_m_s: f64,
    /// Its true errors.
    pub truth: ZuptErrors,
}

/// `[aiding.zupt.truth]`: without it, the white noise is as in the filter's model, and there is nothing else.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct ZuptErrors {
    /// White noise of one measurement (m/s); unless given, what the filter states.
    #[schemars(with = "Option<Amount>")]
    pub noise_sigma_m_s: Option<f64>,
    /// Forward velocity that is taken for standstill (1 σ, m/s), a Gauss-Markov process.
    #[schemars(with = "Amount")]
    pub walk_sigma_m_s: f64,
    /// Correlation time of that velocity (s).
    #[schemars(with = "Measurable")]
    pub correlation_time_s: f64,
}

/// `[aiding.heading]`: yaw of the vehicle.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct HeadingSettings {
    /// Measurements per second.
    #[schemars(with = "Measurable")]
    pub rate_hz: f64,
    /// Standard deviation of one measurement, white, as in the filter's model (degrees).
    #[schemars(with = "Measurable")]
    pub sigma_deg: f64,
    /// Sensor of the heading.
    pub source: HeadingSource,
    /// Its true errors.
    pub truth: HeadingErrors,
}

/// Sensor of a heading.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum HeadingSource {
    /// A compass, which outages of GNSS do not concern.
    #[default]
    Compass,
    /// Two antennas of GNSS: no heading in its outages.
    Antennas,
}

/// `[aiding.heading.truth]`: without it, the white noise is as in the filter's model, and there is nothing else.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct HeadingErrors {
    /// White noise of one measurement (degrees); unless given, what the filter states.
    #[schemars(with = "Option<Amount>")]
    pub noise_sigma_deg: Option<f64>,
    /// Offset (1 σ, degrees), constant in a run.
    #[schemars(with = "Amount")]
    pub offset_sigma_deg: f64,
    /// Error that lasts (1 σ, degrees), a Gauss-Markov process: iron about a compass.
    #[schemars(with = "Amount")]
    pub walk_sigma_deg: f64,
    /// Correlation time of that error (s).
    #[schemars(with = "Measurable")]
    pub correlation_time_s: f64,
}

impl Default for NhcSettings {
    fn default() -> Self {
        Self {
            rate_hz: 1.0,
            // Sideslip and suspension last: 0.1 is overconfident by a third with those of a car.
            sigma_m_s: 0.2,
            lever_arm_m: [0.0; 3],
            mounting_sigma_deg: 0.0,
            truth: NhcErrors::default(),
        }
    }
}

impl Default for NhcErrors {
    fn default() -> Self {
        Self {
            noise_sigma_m_s: None,
            mounting_sigma_deg: 0.0,
            sideslip_s2_m: 0.0,
            walk_sigma_m_s: 0.0,
            correlation_time_s: 1.0,
        }
    }
}

impl Default for OdometerSettings {
    fn default() -> Self {
        Self {
            rate_hz: 1.0,
            sigma_m_s: 0.05,
            lever_arm_m: [0.0; 3],
            scale_sigma: 0.0,
            truth: OdometerErrors::default(),
        }
    }
}

impl Default for ZuptSettings {
    fn default() -> Self {
        Self {
            rate_hz: 1.0,
            sigma_m_s: 0.02,
            truth: ZuptErrors::default(),
        }
    }
}

impl Default for ZuptErrors {
    fn default() -> Self {
        Self {
            noise_sigma_m_s: None,
            walk_sigma_m_s: 0.0,
            correlation_time_s: 10.0,
        }
    }
}

impl Default for HeadingSettings {
    fn default() -> Self {
        Self {
            rate_hz: 1.0,
            sigma_deg: 0.5,
            source: HeadingSource::default(),
            truth: HeadingErrors::default(),
        }
    }
}

impl Default for HeadingErrors {
    fn default() -> Self {
        Self {
            noise_sigma_deg: None,
            offset_sigma_deg: 0.0,
            walk_sigma_deg: 0.0,
            correlation_time_s: 60.0,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tests::*;

    /// A Gauss-Markov error after t has the autocorrelation e^(−t/τ); that of n steps has a deviation of √((1 − ρ²)/n).
    #[test]
    fn an_error_lasts_its_correlation_time() {
        let (n, time_s, step_s) = (20_000, 20.0, 5.0);
        let law = ErrorProcess::GaussMarkov { sigma: 1.0, time_s };
        let mut stream = key(1).generator();
        let value = normal(&mut stream);
        let mut walk = Walk {
            stream,
            value,
            at_s: 0.0,
        };
        let values: Vec<f64> = (0..n)
            .map(|k| walk.at(law, f64::from(k) * step_s))
            .collect();
        let squares: f64 = values.iter().map(|x| x * x).sum();
        let found = values.windows(2).map(|x| x[0] * x[1]).sum::<f64>() / squares;
        let rho = (-step_s / time_s).exp();
        assert_abs_diff_eq!(
            found,
            rho,
            epsilon = 4.0 * ((1.0 - rho * rho) / f64::from(n)).sqrt()
        );
    }

    /// Tyres slip outwards in reverse too, and a driven wheel turns more than the way.
    #[test]
    fn slip_has_one_sign_forwards_and_in_reverse() {
        let (forwards, a_b) = (DVec3::new(8.0, 0.0, 0.0), DVec3::new(1.5, -2.0, 0.0));
        for v_b in [forwards, -forwards] {
            assert_eq!(AidPart::Slip.coefficient(1, v_b, a_b), -16.0);
            assert_eq!(AidPart::WheelSlip.coefficient(0, v_b, a_b), 12.0);
        }
    }
}
