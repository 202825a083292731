//! What is truly wrong with a vehicle's own measurements, and how it goes on.

use super::{Aid, AidingSettings, HeadingSettings, NhcSettings, OdometerSettings, ZuptSettings};
use crate::rng::{Generator, StreamKey};
use crate::units::DEG;
use glam::DVec3;
use rand_distr::{Distribution, StandardNormal};

/// Acceleration times speed of a brisk drive (m²/s³): 2 m/s² at 10 m/s.
const BRISK: f64 = 20.0;
/// A constant is felt where the mean of a hundred measurements would show it.
const LASTING_FIXES: f64 = 10.0;

impl AidingSettings {
    /// Errors that last, felt beside the white noise that the filter expects, of which it has no states: their names in
    /// a budget, and the key that makes it expect them.
    pub(crate) fn unexpected(&self) -> impl Iterator<Item = (&'static str, &'static str)> {
        // As for the errors of positions: a filter averages white noise over the time that the error lasts.
        let felt = |error: f64, time_s: f64, rate_hz: f64, sigma: f64| {
            error > 0.5 * sigma / (rate_hz * time_s).max(1.0).sqrt()
        };
        let (nhc, odometer) = (self.nhc.as_ref(), self.odometer.as_ref());
        let (zupt, heading) = (self.zupt.as_ref(), self.heading.as_ref());
        let slips = |slip: f64, sigma: f64| slip * BRISK > 0.5 * sigma;
        let all = [
            (
                nhc.is_some_and(|s| {
                    s.truth
                        .noise_sigma_m_s
                        .is_some_and(|noise| noise > s.sigma_m_s)
                }),
                ("aiding.nhc", "aiding.nhc.sigma_m_s"),
            ),
            (
                nhc.is_some_and(|s| slips(s.truth.sideslip_s2_m, s.sigma_m_s)),
                ("aiding.nhc.slip", "aiding.nhc.sigma_m_s"),
            ),
            (
                odometer.is_some_and(|s| {
                    s.truth
                        .noise_sigma_m_s
                        .is_some_and(|noise| noise > s.sigma_m_s)
                }),
                ("aiding.odometer", "aiding.odometer.sigma_m_s"),
            ),
            (
                odometer.is_some_and(|s| slips(s.truth.slip_s2_m, s.sigma_m_s)),
                ("aiding.odometer.slip", "aiding.odometer.sigma_m_s"),
            ),
            (
                nhc.is_some_and(|s| s.mounting_sigma_deg < 0.5 * s.truth.mounting_sigma_deg),
                ("aiding.nhc.mounting", "aiding.nhc.mounting_sigma_deg"),
            ),
            (
                nhc.is_some_and(|s| {
                    felt(
                        s.truth.walk_sigma_m_s,
                        s.truth.correlation_time_s,
                        s.rate_hz,
                        s.sigma_m_s,
                    )
                }),
                ("aiding.nhc.suspension", "aiding.nhc.sigma_m_s"),
            ),
            (
                odometer.is_some_and(|s| s.scale_sigma < 0.5 * s.truth.scale_sigma),
                ("aiding.odometer.scale", "aiding.odometer.scale_sigma"),
            ),
            (
                zupt.is_some_and(|s| {
                    felt(
                        s.truth.walk_sigma_m_s,
                        s.truth.correlation_time_s,
                        s.rate_hz,
                        s.sigma_m_s,
                    )
                }),
                ("aiding.zupt.creep", "aiding.zupt.sigma_m_s"),
            ),
            (
                heading
                    .is_some_and(|s| s.truth.offset_sigma_deg > 0.5 * s.sigma_deg / LASTING_FIXES),
                ("aiding.heading.offset", "aiding.heading.sigma_deg"),
            ),
            (
                heading.is_some_and(|s| {
                    felt(
                        s.truth.walk_sigma_deg,
                        s.truth.correlation_time_s,
                        s.rate_hz,
                        s.sigma_deg,
                    )
                }),
                ("aiding.heading.correlated", "aiding.heading.sigma_deg"),
            ),
        ];
        all.into_iter()
            .filter_map(|(is_there, found)| is_there.then_some(found))
    }

    /// What is truly wrong with them beside white noise (m/s, rad, 1).
    pub(crate) fn errors(&self) -> Vec<AidError> {
        let mut all = Vec::new();
        let mut push = |aid, part, law: Law| {
            all.extend((law.size() > 0.0).then_some(AidError { aid, part, law }))
        };
        if let Some(NhcSettings { truth, .. }) = &self.nhc {
            let mounting = Law::Constant(truth.mounting_sigma_deg * DEG);
            push(Aid::Nhc, AidPart::MountingPitch, mounting);
            push(Aid::Nhc, AidPart::MountingYaw, mounting);
            push(Aid::Nhc, AidPart::Slip, Law::Known(truth.sideslip_s2_m));
            let moving = Law::GaussMarkov {
                sigma: truth.walk_sigma_m_s,
                time_s: truth.correlation_time_s,
            };
            push(Aid::Nhc, AidPart::SuspensionLateral, moving);
            push(Aid::Nhc, AidPart::SuspensionVertical, moving);
        }
        if let Some(OdometerSettings { truth, .. }) = &self.odometer {
            push(
                Aid::Odometer,
                AidPart::WheelScale,
                Law::Constant(truth.scale_sigma),
            );
            push(
                Aid::Odometer,
                AidPart::WheelSlip,
                Law::Known(truth.slip_s2_m),
            );
        }
        if let Some(ZuptSettings { truth, .. }) = &self.zupt {
            let creeping = Law::GaussMarkov {
                sigma: truth.walk_sigma_m_s,
                time_s: truth.correlation_time_s,
            };
            push(Aid::Zupt, AidPart::Creep, creeping);
        }
        if let Some(HeadingSettings { truth, .. }) = &self.heading {
            push(
                Aid::Heading,
                AidPart::HeadingOffset,
                Law::Constant(truth.offset_sigma_deg * DEG),
            );
            let sigma = truth.walk_sigma_deg * DEG;
            let lasting = Law::GaussMarkov {
                sigma,
                time_s: truth.correlation_time_s,
            };
            push(Aid::Heading, AidPart::HeadingCorrelated, lasting);
        }
        all
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

    /// Its stream of random numbers: its name, and the axis where a name has two.
    const fn stream(self) -> &'static str {
        match self {
            Self::MountingPitch => "mounting_pitch",
            Self::MountingYaw => "mounting_yaw",
            Self::SuspensionLateral => "suspension_lateral",
            Self::SuspensionVertical => "suspension_vertical",
            other => other.name(),
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
            Self::Known(size) | Self::Constant(size) | Self::GaussMarkov { sigma: size, .. } => {
                size
            }
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
        let walk = |error: AidError| {
            let process = error.part.stream();
            let mut stream = StreamKey {
                source: error.aid.name(),
                process,
                ..key
            }
            .generator();
            let value = match error.law {
                Law::Known(value) => value,
                // a Gauss-Markov process is stationary from the start
                Law::Constant(sigma) | Law::GaussMarkov { sigma, .. } => {
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
            let stream = |process| {
                StreamKey {
                    source: aid.name(),
                    process,
                    ..key
                }
                .generator()
            };
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
            .filter(|(error, _)| error.aid == aid)
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
