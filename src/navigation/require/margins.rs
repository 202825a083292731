//! By how much a given IMU keeps a limit or misses it, and what decides.

use super::{Course, ImuParameters, Limit, Worst};
use crate::ekf::BeliefError;
use crate::imu::{Channel, Sensor};
use crate::noise::{Kind, Model};
use crate::scenario::Scenario;
use crate::simulation::lincov::{Crossing, DRIFT, NamedSource, times};

/// A part of the errors at the end of an outage.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Part {
    /// Noise of a sensor that is new in every sample.
    White(Sensor),
    /// Its correlated noise.
    Correlated(Sensor),
    /// Its turn-on bias.
    TurnOn(Sensor),
    /// The drifts of both sensors: the same in every run.
    Drift,
    /// Scale factors, misalignment and other constants of both sensors.
    Scale,
    /// Receiver and barometer.
    Fixes,
    /// What the vehicle measures of itself.
    Aiding,
    /// Position, velocity and attitude at the start.
    Start,
}

impl Part {
    /// All of them.
    const ALL: [Self; 11] = [
        Self::White(Sensor::Accel),
        Self::Correlated(Sensor::Accel),
        Self::TurnOn(Sensor::Accel),
        Self::White(Sensor::Gyro),
        Self::Correlated(Sensor::Gyro),
        Self::TurnOn(Sensor::Gyro),
        Self::Drift,
        Self::Scale,
        Self::Fixes,
        Self::Aiding,
        Self::Start,
    ];

    /// `gyro, correlated`
    #[must_use]
    pub fn name(self) -> String {
        match self {
            Self::White(sensor) => format!("{}, white", sensor.name()),
            Self::Correlated(sensor) => format!("{}, correlated", sensor.name()),
            Self::TurnOn(sensor) => format!("{}, turn-on bias", sensor.name()),
            Self::Drift => "drift".to_owned(),
            Self::Scale => "scale factors, misalignment, g, temperature".to_owned(),
            Self::Fixes => "GNSS".to_owned(),
            Self::Aiding => "aiding".to_owned(),
            Self::Start => "start".to_owned(),
        }
    }

    /// Whether a better IMU makes it smaller.
    #[must_use]
    pub const fn is_of_imu(self) -> bool {
        !matches!(self, Self::Fixes | Self::Aiding | Self::Start)
    }

    fn of(source: &NamedSource) -> Self {
        if let Some((sensor, kind)) = source.process {
            return Self::of_process(sensor, kind);
        }
        let name = source.name.as_str();
        let turn_on = |sensor: &Sensor| name == format!("{}.turn_on_bias", sensor.name());
        match name {
            DRIFT => Self::Drift,
            "initial" => Self::Start,
            fixes if fixes.starts_with("gnss.") || fixes == "baro" => Self::Fixes,
            aiding if aiding.starts_with("aiding.") => Self::Aiding,
            _ => Sensor::ALL
                .into_iter()
                .find(turn_on)
                .map_or(Self::Scale, Self::TurnOn),
        }
    }

    const fn of_process(sensor: Sensor, kind: Kind) -> Self {
        match kind {
            Kind::Ar1 | Kind::GaussMarkov | Kind::Flicker | Kind::RandomWalk => {
                Self::Correlated(sensor)
            }
            Kind::White | Kind::Quantization | Kind::Ma1 => Self::White(sensor),
            Kind::Drift => Self::Drift,
        }
    }

    /// An IMU and the filter that knows it with this part's standard deviations multiplied; GNSS and start stay.
    fn multiplied(self, (scenario, model): &(Scenario, Model), factor: f64) -> (Scenario, Model) {
        let (mut scenario, mut model) = (scenario.clone(), model.clone());
        let (imu, initial) = (&mut scenario.imu, &mut scenario.initial);
        let scaled = |sigma: &mut Option<f64>| *sigma = sigma.map(|sigma| factor * sigma);
        match self {
            Self::TurnOn(Sensor::Accel) => {
                scaled(&mut imu.turn_on_bias_accel_m_s2);
                scaled(&mut initial.accel_bias_sigma_m_s2);
            }
            Self::TurnOn(Sensor::Gyro) => {
                scaled(&mut imu.turn_on_bias_gyro_rad_s);
                scaled(&mut initial.gyro_bias_sigma_rad_s);
            }
            Self::Scale => {
                imu.scale_ppm_accel *= factor;
                imu.scale_ppm_gyro *= factor;
                imu.misalignment_rad *= factor;
                imu.g_sensitivity_rad_s_per_m_s2 *= factor;
                imu.vibration
                    .iter_mut()
                    .for_each(|v| v.rectification_s2_m *= factor);
                imu.temperature.iter_mut().for_each(|t| t.multiply(factor));
                scaled(&mut initial.accel_scale_sigma_ppm);
                scaled(&mut initial.gyro_scale_sigma_ppm);
            }
            Self::White(_) | Self::Correlated(_) | Self::Drift => {
                for channel in Channel::ALL {
                    for process in &mut model.axes[channel.index()].processes {
                        if Self::of_process(channel.sensor, process.kind()) == self {
                            // The factor is on standard deviations, the parameter a variance.
                            *process = times(process, factor * factor, model.rate_hz);
                        }
                    }
                }
            }
            Self::Fixes | Self::Aiding | Self::Start => (),
        }
        (scenario, model)
    }
}

/// The effect of a part on a limit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PartMargin {
    /// The part.
    pub part: Part,
    /// Its share in the mean square of what is limited.
    pub share: f64,
    /// The factor on its standard deviations that alone meets the limit exactly; none where none does (too little or too
    /// much whatever it is), and of GNSS and start, which are no choice of an IMU.
    pub factor: Option<f64>,
}

/// How an IMU stands to its limits.
#[derive(Debug, Clone, PartialEq)]
pub struct Margins {
    /// The hardest limit.
    pub worst: Worst,
    /// The same for an IMU without errors: what GNSS and start leave.
    pub without_imu: Worst,
    /// The parts that there are; their shares sum to 1.
    pub parts: Vec<PartMargin>,
}

/// Correlation time of the biases of an IMU that has next to none (s): any would do.
const SLOW_S: f64 = 300.0;
/// How far a factor is sought, as a logarithm.
const RANGE: f64 = 9.0;

impl Margins {
    /// The margins of the filter that knows the model.
    ///
    /// # Errors
    /// When the model has no such filter.
    pub fn of(
        course: &Course<'_>,
        scenario: &Scenario,
        model: &Model,
        limits: &[Limit],
    ) -> Result<Self, BeliefError> {
        let worst = course.worst(scenario, model, limits)?;
        let part_of = |source: &NamedSource| {
            Part::ALL
                .iter()
                .position(|part| *part == Part::of(source))
                .expect("one of all")
        };
        let alone = course.parts(worst.place, scenario, model, &part_of, Part::ALL.len())?;
        let squares: Vec<f64> = alone
            .iter()
            .map(|drift| drift.square(worst.limit.quantity))
            .collect();
        let total: f64 = squares.iter().sum();
        let given = (scenario.clone(), model.clone());
        let mut parts = Vec::new();
        for (part, square) in Part::ALL
            .into_iter()
            .zip(&squares)
            .filter(|(_, square)| **square > 0.0)
        {
            let mut factor = None;
            if part.is_of_imu() {
                let crossing = Crossing {
                    bounds: (-RANGE, RANGE),
                    step: 0.7,
                    exact: 1e-3,
                };
                let imu_at = |ln: f64| part.multiplied(&given, ln.exp());
                let (ln, left) = course.crossing(limits, (&crossing, 0.0), imu_at)?;
                // A value left at a bound is no crossing: with this part without noise, or with any, the limit
                // stays where it is.
                factor = (left.abs() <= 1e-2).then(|| ln.exp());
            }
            parts.push(PartMargin {
                part,
                share: square / total,
                factor,
            });
        }
        let without = |imu, part: Part| part.multiplied(&imu, 0.0);
        let beside_noise = [
            Part::TurnOn(Sensor::Accel),
            Part::TurnOn(Sensor::Gyro),
            Part::Scale,
        ];
        let (scenario, _) = beside_noise.into_iter().fold(given, without);
        let perfect = ImuParameters::perfect(SLOW_S).model(model.rate_hz);
        Ok(Self {
            worst,
            without_imu: course.worst(&scenario, &perfect, limits)?,
            parts,
        })
    }

    /// Whether the limits are kept.
    #[must_use]
    pub fn met(&self) -> bool {
        self.worst.margin() >= 0.0
    }

    /// Whether any IMU keeps the limits.
    #[must_use]
    pub fn an_imu_helps(&self) -> bool {
        self.without_imu.margin() >= 0.0
    }

    /// The largest part.
    #[must_use]
    pub fn binding(&self) -> Option<&PartMargin> {
        self.parts.iter().max_by(|a, b| a.share.total_cmp(&b.share))
    }

    /// The share of all that a better IMU makes smaller.
    #[must_use]
    pub fn share_of_imu(&self) -> f64 {
        self.parts
            .iter()
            .filter(|p| p.part.is_of_imu())
            .map(|p| p.share)
            .sum()
    }
}
