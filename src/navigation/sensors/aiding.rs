//! What a vehicle knows of its own motion: the non-holonomic constraint, a wheel, standstill, a heading.
//!
//! Each is believed by the filter as white noise, and its lasting errors as states where a deviation of theirs is
//! given. What is truly wrong with it stands apart in a table `truth`, so that a filter that leaves it out is seen.
//!
//! The vehicle's axes are forward, right, down, those of the reference. Models of the errors:
//! [Groves](crate::bibliography::Groves13), sec. 15.3 (constraints) and 16.3 (odometers).

use super::gnss::MAX_LEVER_ARM_M;
use crate::rng::{Generator, StreamKey};
use crate::units::{DEG, NonNegative, Positive, SettingError};
use crate::units::{require_finite, require_non_negative, require_positive};
use glam::DVec3;
use rand_distr::{Distribution, StandardNormal};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// `[aiding]`: measurements of the vehicle by itself, which outages do not concern.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct AidingSettings {
    /// Non-holonomic constraint: a road vehicle moves neither sideways nor up.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub nhc: Option<NhcSettings>,
    /// Forward speed of a wheel.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub odometer: Option<OdometerSettings>,
    /// Zero velocity where the reference stands.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub zupt: Option<ZuptSettings>,
    /// Heading of two antennas or of a compass.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub heading: Option<HeadingSettings>,
}

/// `[aiding.nhc]`: lateral and vertical velocity of a point of the vehicle are zero.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct NhcSettings {
    /// Measurements per second.
    #[schemars(with = "Positive")]
    pub rate_hz: f64,
    /// Standard deviation of one measurement, white, as the filter believes (m/s).
    #[schemars(with = "Positive")]
    pub sigma_m_s: f64,
    /// The point that moves neither sideways nor up, with respect to the IMU: front, right, down (m).
    #[schemars(inner(range(min = -MAX_LEVER_ARM_M, max = MAX_LEVER_ARM_M)))]
    pub lever_arm_m: [f64; 3],
    /// Pitch and yaw of the vehicle's axes in those of the IMU, as the filter expects them (1 σ, degrees): two states;
    /// 0: none.
    #[schemars(with = "NonNegative")]
    pub mounting_sigma_deg: f64,
    /// What is truly wrong with it.
    pub truth: NhcErrors,
}

/// `[aiding.nhc.truth]`: without it, the white noise is as the filter believes, and there is nothing else.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct NhcErrors {
    /// White noise of one measurement (m/s); unless given, what the filter believes.
    #[schemars(with = "Option<NonNegative>")]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub noise_m_s: Option<f64>,
    /// Pitch and yaw of the vehicle's axes in those of the IMU (1 σ, degrees), constant in a run.
    #[schemars(with = "NonNegative")]
    pub mounting_deg: f64,
    /// Sideslip angle per lateral acceleration (rad s²/m), the same in every run.
    #[schemars(with = "NonNegative")]
    pub slip_s2_m: f64,
    /// Lateral and vertical velocity of the body on its suspension (1 σ, m/s), a Gauss-Markov process.
    #[schemars(with = "NonNegative")]
    pub suspension_m_s: f64,
    /// Correlation time of that velocity (s).
    #[schemars(with = "Positive")]
    pub suspension_s: f64,
}

/// `[aiding.odometer]`: forward velocity of a point of the vehicle, by a wheel.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct OdometerSettings {
    /// Measurements per second.
    #[schemars(with = "Positive")]
    pub rate_hz: f64,
    /// Standard deviation of one measurement, white, as the filter believes (m/s).
    #[schemars(with = "Positive")]
    pub sigma_m_s: f64,
    /// The wheel, or the middle of its axle, with respect to the IMU: front, right, down (m).
    #[schemars(inner(range(min = -MAX_LEVER_ARM_M, max = MAX_LEVER_ARM_M)))]
    pub lever_arm_m: [f64; 3],
    /// Scale factor of the wheel, as the filter expects it (1 σ): a state; 0: none.
    #[schemars(with = "NonNegative")]
    pub scale_sigma: f64,
    /// What is truly wrong with it.
    pub truth: OdometerErrors,
}

/// `[aiding.odometer.truth]`: without it, the white noise is as the filter believes, and there is nothing else.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct OdometerErrors {
    /// White noise of one measurement (m/s); unless given, what the filter believes.
    #[schemars(with = "Option<NonNegative>")]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub noise_m_s: Option<f64>,
    /// Scale-factor error (1 σ), constant in a run: the tyre.
    #[schemars(with = "NonNegative")]
    pub scale: f64,
    /// Slip of the wheel: share of the speed per forward acceleration (s²/m), the same in every run.
    #[schemars(with = "NonNegative")]
    pub slip_s2_m: f64,
}

/// `[aiding.zupt]`: the velocity is zero, wherever the reference stands (below 0.01 m/s and 0.01 deg/s).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct ZuptSettings {
    /// Measurements per second.
    #[schemars(with = "Positive")]
    pub rate_hz: f64,
    /// Standard deviation of one measurement, white, as the filter believes (m/s).
    #[schemars(with = "Positive")]
    pub sigma_m_s: f64,
    /// What is truly wrong with it.
    pub truth: ZuptErrors,
}

/// `[aiding.zupt.truth]`: without it, the white noise is as the filter believes, and there is nothing else.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct ZuptErrors {
    /// White noise of one measurement (m/s); unless given, what the filter believes.
    #[schemars(with = "Option<NonNegative>")]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub noise_m_s: Option<f64>,
    /// Forward velocity that is taken for standstill (1 σ, m/s), a Gauss-Markov process.
    #[schemars(with = "NonNegative")]
    pub creep_m_s: f64,
    /// Correlation time of that velocity (s).
    #[schemars(with = "Positive")]
    pub creep_s: f64,
}

/// `[aiding.heading]`: yaw of the vehicle.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct HeadingSettings {
    /// Measurements per second.
    #[schemars(with = "Positive")]
    pub rate_hz: f64,
    /// Standard deviation of one measurement, white, as the filter believes (degrees).
    #[schemars(with = "Positive")]
    pub sigma_deg: f64,
    /// What is truly wrong with it.
    pub truth: HeadingErrors,
}

/// `[aiding.heading.truth]`: without it, the white noise is as the filter believes, and there is nothing else.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct HeadingErrors {
    /// White noise of one measurement (degrees); unless given, what the filter believes.
    #[schemars(with = "Option<NonNegative>")]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub noise_deg: Option<f64>,
    /// Offset (1 σ, degrees), constant in a run.
    #[schemars(with = "NonNegative")]
    pub offset_deg: f64,
    /// Error that lasts (1 σ, degrees), a Gauss-Markov process: multipath, the iron of a compass.
    #[schemars(with = "NonNegative")]
    pub correlated_deg: f64,
    /// Correlation time of that error (s).
    #[schemars(with = "Positive")]
    pub correlation_time_s: f64,
}

impl Default for NhcSettings {
    fn default() -> Self {
        Self {
            rate_hz: 1.0,
            sigma_m_s: 0.1,
            lever_arm_m: [0.0; 3],
            mounting_sigma_deg: 0.0,
            truth: NhcErrors::default(),
        }
    }
}

impl Default for NhcErrors {
    fn default() -> Self {
        Self { noise_m_s: None, mounting_deg: 0.0, slip_s2_m: 0.0, suspension_m_s: 0.0, suspension_s: 1.0 }
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
        Self { rate_hz: 1.0, sigma_m_s: 0.02, truth: ZuptErrors::default() }
    }
}

impl Default for ZuptErrors {
    fn default() -> Self {
        Self { noise_m_s: None, creep_m_s: 0.0, creep_s: 10.0 }
    }
}

impl Default for HeadingSettings {
    fn default() -> Self {
        Self { rate_hz: 1.0, sigma_deg: 0.5, truth: HeadingErrors::default() }
    }
}

impl Default for HeadingErrors {
    fn default() -> Self {
        Self { noise_deg: None, offset_deg: 0.0, correlated_deg: 0.0, correlation_time_s: 60.0 }
    }
}

/// Standard deviations that are 0 or more, by their keys.
fn deviations(all: &[(&str, f64)]) -> Result<(), SettingError> {
    all.iter().try_for_each(|(key, sigma)| require_non_negative(key, &[*sigma]))
}

fn arm(lever_arm_m: &[f64; 3]) -> Result<(), SettingError> {
    require_finite("lever_arm_m", lever_arm_m)?;
    let long = lever_arm_m.iter().find(|x| x.abs() > MAX_LEVER_ARM_M);
    long.map_or(Ok(()), |long| {
        let requirement = format!("metres from the IMU, at most {MAX_LEVER_ARM_M}");
        Err(SettingError::new("lever_arm_m", long, requirement))
    })
}

impl NhcSettings {
    fn validate(&self) -> Result<(), SettingError> {
        require_positive("rate_hz", &[self.rate_hz])?;
        require_positive("sigma_m_s", &[self.sigma_m_s])?;
        arm(&self.lever_arm_m)?;
        deviations(&[("mounting_sigma_deg", self.mounting_sigma_deg)])?;
        let NhcErrors { noise_m_s, mounting_deg, slip_s2_m, suspension_m_s, suspension_s } = self.truth;
        let all = [
            ("noise_m_s", noise_m_s.unwrap_or(0.0)),
            ("mounting_deg", mounting_deg),
            ("slip_s2_m", slip_s2_m),
            ("suspension_m_s", suspension_m_s),
        ];
        deviations(&all)
            .and_then(|()| require_positive("suspension_s", &[suspension_s]))
            .map_err(|e| e.in_section("truth"))
    }
}

impl OdometerSettings {
    fn validate(&self) -> Result<(), SettingError> {
        require_positive("rate_hz", &[self.rate_hz])?;
        require_positive("sigma_m_s", &[self.sigma_m_s])?;
        arm(&self.lever_arm_m)?;
        deviations(&[("scale_sigma", self.scale_sigma)])?;
        let OdometerErrors { noise_m_s, scale, slip_s2_m } = self.truth;
        let all = [("noise_m_s", noise_m_s.unwrap_or(0.0)), ("scale", scale), ("slip_s2_m", slip_s2_m)];
        deviations(&all).map_err(|e| e.in_section("truth"))
    }
}

impl ZuptSettings {
    fn validate(&self) -> Result<(), SettingError> {
        require_positive("rate_hz", &[self.rate_hz])?;
        require_positive("sigma_m_s", &[self.sigma_m_s])?;
        let ZuptErrors { noise_m_s, creep_m_s, creep_s } = self.truth;
        deviations(&[("noise_m_s", noise_m_s.unwrap_or(0.0)), ("creep_m_s", creep_m_s)])
            .and_then(|()| require_positive("creep_s", &[creep_s]))
            .map_err(|e| e.in_section("truth"))
    }
}

impl HeadingSettings {
    fn validate(&self) -> Result<(), SettingError> {
        require_positive("rate_hz", &[self.rate_hz])?;
        require_positive("sigma_deg", &[self.sigma_deg])?;
        let HeadingErrors { noise_deg, offset_deg, correlated_deg, correlation_time_s } = self.truth;
        let noise = noise_deg.unwrap_or(0.0);
        deviations(&[("noise_deg", noise), ("offset_deg", offset_deg), ("correlated_deg", correlated_deg)])
            .and_then(|()| require_positive("correlation_time_s", &[correlation_time_s]))
            .map_err(|e| e.in_section("truth"))
    }
}

impl AidingSettings {
    /// Checks every value.
    ///
    /// # Errors
    /// The first key whose value is refused, with its table within `aiding`.
    pub fn validate(&self) -> Result<(), SettingError> {
        let all = [
            self.nhc.as_ref().map(NhcSettings::validate),
            self.odometer.as_ref().map(OdometerSettings::validate),
            self.zupt.as_ref().map(ZuptSettings::validate),
            self.heading.as_ref().map(HeadingSettings::validate),
        ];
        for (aid, checked) in Aid::ALL.into_iter().zip(all) {
            checked.transpose().map_err(|e| e.in_section(aid.name()))?;
        }
        Ok(())
    }

    /// Whether there is none.
    #[must_use]
    pub fn is_none(&self) -> bool {
        self.rates().next().is_none()
    }

    /// Those that are there, and their rates (Hz).
    pub(crate) fn rates(&self) -> impl Iterator<Item = (Aid, f64)> {
        let rates = [
            self.nhc.as_ref().map(|s| s.rate_hz),
            self.odometer.as_ref().map(|s| s.rate_hz),
            self.zupt.as_ref().map(|s| s.rate_hz),
            self.heading.as_ref().map(|s| s.rate_hz),
        ];
        Aid::ALL.into_iter().zip(rates).filter_map(|(aid, rate)| rate.map(|rate| (aid, rate)))
    }

    /// The point of which an aid measures the velocity, with respect to the IMU, in b (m).
    pub(crate) fn lever_arm_b(&self, aid: Aid) -> DVec3 {
        let arm = match aid {
            Aid::Nhc => self.nhc.as_ref().map(|s| s.lever_arm_m),
            Aid::Odometer => self.odometer.as_ref().map(|s| s.lever_arm_m),
            Aid::Zupt | Aid::Heading => None,
        };
        arm.map_or(DVec3::ZERO, DVec3::from)
    }

    /// Variances of one measurement's white noise, as the filter believes and in truth ((m/s)² or rad²).
    pub(crate) fn variances(&self, aid: Aid) -> [f64; 2] {
        let (sigma, noise) = match aid {
            Aid::Nhc => self.nhc.as_ref().map(|s| (s.sigma_m_s, s.truth.noise_m_s)),
            Aid::Odometer => self.odometer.as_ref().map(|s| (s.sigma_m_s, s.truth.noise_m_s)),
            Aid::Zupt => self.zupt.as_ref().map(|s| (s.sigma_m_s, s.truth.noise_m_s)),
            Aid::Heading => {
                let radians = |s: &HeadingSettings| (s.sigma_deg * DEG, s.truth.noise_deg.map(|n| n * DEG));
                self.heading.as_ref().map(radians)
            }
        }
        .unwrap_or_default();
        [sigma, noise.unwrap_or(sigma)].map(|s| s * s)
    }

    /// Standard deviations of what a filter may have as states: scale of the wheel (1), pitch and yaw of the vehicle's
    /// axes (rad); 0 where it has none.
    #[must_use]
    pub fn state_sigmas(&self) -> DVec3 {
        let scale = self.odometer.as_ref().map_or(0.0, |s| s.scale_sigma);
        let mounting = self.nhc.as_ref().map_or(0.0, |s| s.mounting_sigma_deg * DEG);
        DVec3::new(scale, mounting, mounting)
    }

    /// What is truly wrong with them beside white noise (m/s, rad, 1).
    pub(crate) fn errors(&self) -> Vec<AidError> {
        let mut all = Vec::new();
        let mut push =
            |aid, part, law: Law| all.extend((law.size() > 0.0).then_some(AidError { aid, part, law }));
        if let Some(NhcSettings { truth, .. }) = &self.nhc {
            let mounting = Law::Constant(truth.mounting_deg * DEG);
            push(Aid::Nhc, AidPart::MountingPitch, mounting);
            push(Aid::Nhc, AidPart::MountingYaw, mounting);
            push(Aid::Nhc, AidPart::Slip, Law::Known(truth.slip_s2_m));
            let moving = Law::GaussMarkov { sigma: truth.suspension_m_s, time_s: truth.suspension_s };
            push(Aid::Nhc, AidPart::SuspensionLateral, moving);
            push(Aid::Nhc, AidPart::SuspensionVertical, moving);
        }
        if let Some(OdometerSettings { truth, .. }) = &self.odometer {
            push(Aid::Odometer, AidPart::WheelScale, Law::Constant(truth.scale));
            push(Aid::Odometer, AidPart::WheelSlip, Law::Known(truth.slip_s2_m));
        }
        if let Some(ZuptSettings { truth, .. }) = &self.zupt {
            let creeping = Law::GaussMarkov { sigma: truth.creep_m_s, time_s: truth.creep_s };
            push(Aid::Zupt, AidPart::Creep, creeping);
        }
        if let Some(HeadingSettings { truth, .. }) = &self.heading {
            push(Aid::Heading, AidPart::HeadingOffset, Law::Constant(truth.offset_deg * DEG));
            let sigma = truth.correlated_deg * DEG;
            let lasting = Law::GaussMarkov { sigma, time_s: truth.correlation_time_s };
            push(Aid::Heading, AidPart::HeadingCorrelated, lasting);
        }
        all
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

    /// As its table is called.
    #[must_use]
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

/// An error of an aid that lasts.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct AidError {
    pub(crate) aid: Aid,
    pub(crate) part: AidPart,
    pub(crate) law: Law,
}

/// Which of them.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
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
    /// As a budget calls it; parts of one name are one source.
    pub(crate) const fn name(self) -> &'static str {
        match self {
            Self::MountingPitch | Self::MountingYaw => "mounting",
            Self::Slip | Self::WheelSlip => "slip",
            Self::SuspensionLateral | Self::SuspensionVertical => "suspension",
            Self::WheelScale => "scale",
            Self::Creep => "creep",
            Self::HeadingOffset => "offset",
            Self::HeadingCorrelated => "correlated",
        }
    }

    /// The aid that it is part of.
    pub(crate) const fn aid(self) -> Aid {
        match self {
            Self::MountingPitch
            | Self::MountingYaw
            | Self::Slip
            | Self::SuspensionLateral
            | Self::SuspensionVertical => Aid::Nhc,
            Self::WheelScale | Self::WheelSlip => Aid::Odometer,
            Self::Creep => Aid::Zupt,
            Self::HeadingOffset | Self::HeadingCorrelated => Aid::Heading,
        }
    }

    /// What a unit of it adds to the measurement along an axis of the vehicle (a heading has one, 0), which moves with
    /// this velocity (m/s) and acceleration (m/s²), both in the vehicle's axes.
    ///
    /// The axes of the vehicle are those of the IMU turned by the small angles m: its velocity there is v − m × v.
    pub(crate) fn coefficient(self, axis: usize, v_b: DVec3, a_b: DVec3) -> f64 {
        match (self, axis) {
            (Self::MountingYaw, 1) => -v_b.x,
            (Self::MountingPitch, 2) | (Self::WheelScale, 0) => v_b.x,
            // Tyres slip outwards: against the acceleration. sin(angle) is the angle.
            (Self::Slip, 1) => -a_b.y * v_b.x,
            (Self::WheelSlip, 0) => a_b.x * v_b.x,
            (Self::SuspensionLateral, 1) | (Self::SuspensionVertical, 2) => 1.0,
            (Self::Creep | Self::HeadingOffset | Self::HeadingCorrelated, 0) => 1.0,
            _ => 0.0,
        }
    }
}

/// How an error goes on.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Law {
    /// The same value in every run.
    Known(f64),
    /// A constant of each run, of this standard deviation.
    Constant(f64),
    /// A Gauss-Markov process.
    GaussMarkov { sigma: f64, time_s: f64 },
}

impl Law {
    pub(crate) const fn size(self) -> f64 {
        match self {
            Self::Known(size) | Self::Constant(size) | Self::GaussMarkov { sigma: size, .. } => size,
        }
    }
}

/// The errors of the aids in one run. Each has a stream of its own.
#[derive(Debug, Clone)]
pub(crate) struct AidNoise {
    lasting: Vec<(AidError, Walk)>,
    /// White noise of each aid along each of its axes: deviation and streams.
    white: [(f64, [Generator; 3]); 4],
}

/// A lasting error as it goes on.
#[derive(Debug, Clone)]
struct Walk {
    stream: Generator,
    value: f64,
    /// When it had that value (s).
    at_s: f64,
}

impl AidNoise {
    /// The errors of run `key.run`.
    pub(crate) fn new(settings: &AidingSettings, key: StreamKey<'_>) -> Self {
        const PARTS: [&str; 10] = [
            "pitch",
            "yaw",
            "slip",
            "lateral",
            "vertical",
            "scale",
            "wheel_slip",
            "creep",
            "offset",
            "correlated",
        ];
        let walk = |error: AidError| {
            let process = PARTS[error.part as usize];
            let mut stream = StreamKey { source: error.aid.name(), process, ..key }.generator();
            let value = match error.law {
                Law::Known(value) => value,
                // a Gauss-Markov process is stationary from the start
                Law::Constant(sigma) | Law::GaussMarkov { sigma, .. } => sigma * normal(&mut stream),
            };
            (error, Walk { stream, value, at_s: 0.0 })
        };
        let white = Aid::ALL.map(|aid| {
            let stream = |process| StreamKey { source: aid.name(), process, ..key }.generator();
            (settings.variances(aid)[1].sqrt(), ["white_x", "white_y", "white_z"].map(stream))
        });
        Self { lasting: settings.errors().into_iter().map(walk).collect(), white }
    }

    /// The error of a measurement along an axis, `after_s` seconds from the start, where the vehicle moves so.
    pub(crate) fn draw(&mut self, aid: Aid, axis: usize, after_s: f64, v_b: DVec3, a_b: DVec3) -> f64 {
        let (sigma, streams) = &mut self.white[aid as usize];
        let mut sum = *sigma * normal(&mut streams[axis]);
        for (error, walk) in self.lasting.iter_mut().filter(|(error, _)| error.aid == aid) {
            let coefficient = error.part.coefficient(axis, v_b, a_b);
            if coefficient != 0.0 {
                sum += coefficient * walk.at(error.law, after_s);
            }
        }
        sum
    }
}

impl Walk {
    fn at(&mut self, law: Law, after_s: f64) -> f64 {
        if let Law::GaussMarkov { sigma, time_s } = law {
            let kappa = (after_s - self.at_s) / time_s;
            // phi e + √(1 − phi²) σ w keeps the variance; expm1 keeps the digits of a short step.
            self.value = (-kappa).exp() * self.value
                + (-(-2.0 * kappa).exp_m1()).sqrt() * sigma * normal(&mut self.stream);
            self.at_s = after_s;
        }
        self.value
    }
}

fn normal(generator: &mut Generator) -> f64 {
    StandardNormal.sample(generator)
}
