//! The IMU that a limit needs: white noise and bias instability of each sensor, each with a quarter of the budget.

use super::{Course, Limit, RequireError, Worst};
use crate::ekf::BeliefError;
use crate::imu::Sensor;
use crate::noise::{Composite, Flicker, Kind, Model, Process, White, continuous};
use crate::scenario::Scenario;
use crate::simulation::lincov::{Crossing, NamedSource};
use crate::units::{DEG, DEG_PER_HOUR, STANDARD_GRAVITY};
use serde::Serialize;

/// How many intensities an IMU has here.
pub const IMU_PARAMETERS: usize = 4;

/// Intensities of an IMU, all axes alike.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ImuParameters {
    /// Velocity random walk (m/s/√s), bias instability of the accelerometer (m/s²), angle random walk (rad/√s), bias
    /// instability of the gyroscope (rad/s).
    pub values: [f64; IMU_PARAMETERS],
    /// Longest correlation time of the biases (s).
    pub t_corr_s: f64,
}

const HOUR_S: f64 = 3600.0;

/// A consumer IMU, from which searches start.
const START: [f64; IMU_PARAMETERS] = [1e-3, 3e-4, 5e-5, 1e-5];
/// The poorest IMU that is sought has this times the intensities of the start (18 m/s/√h, 9.2 mg, 52 deg/√h, 620 deg/h):
/// poorer than any that is sold. Beyond, errors are no longer small and the linear analysis means nothing.
const POOREST: f64 = 300.0;
/// An intensity times this is as good as none.
const NONE: f64 = 1e-5;
/// How far from the start an intensity is sought, as a logarithm: beyond, any will do.
const RANGE: f64 = 9.0;
/// A logarithm of limit over error that is left: the search ends on either side of what it aims at, within [`EXACT`], its
/// steps of up to a second leave up to 0.12 % less than those of `run` (biases, in outages of 5 s; 0.01 % from 10 s on, in the
/// drive of `tests/truth/require.rs`), and the IMU that is named is to keep the limit in both.
const RESERVE: f64 = 1.5e-3;
/// A logarithm of limit over error this close to the one sought counts as it.
const EXACT: f64 = 1e-4;
/// Rounds of the allocation, the share of a correction that is applied, and when it is done.
const ROUNDS: usize = 25;
const DAMPING: f64 = 0.35;
const EVEN: f64 = 0.02;

impl ImuParameters {
    /// The processes.
    const PROCESSES: [(Sensor, Kind); IMU_PARAMETERS] = [
        (Sensor::Accel, Kind::White),
        (Sensor::Accel, Kind::GaussMarkov),
        (Sensor::Gyro, Kind::White),
        (Sensor::Gyro, Kind::GaussMarkov),
    ];

    /// The noise model.
    pub fn model(&self, rate_hz: f64) -> Model {
        let [accel_white, accel_bias, gyro_white, gyro_bias] = self.values;
        let axis = |density: f64, bias: f64| {
            let white = White::new(continuous::white_sigma2(density, rate_hz));
            let bias = Flicker {
                floor: bias,
                t_corr_s: self.t_corr_s,
            }
            .processes(rate_hz);
            let mut processes = vec![Process::White(white.expect("a finite variance"))];
            processes.extend(
                bias.expect("finite variances")
                    .into_iter()
                    .map(Process::GaussMarkov),
            );
            Composite::new(processes)
        };
        Model::pooled(
            rate_hz,
            &axis(accel_white, accel_bias),
            &axis(gyro_white, gyro_bias),
        )
    }

    /// Between which averaging times the Allan deviation of a bias is nowhere below its bias instability (s).
    pub fn floor_s(&self) -> (f64, f64) {
        Flicker {
            floor: 1.0,
            t_corr_s: self.t_corr_s,
        }
        .range_s()
    }

    /// An intensity in the unit of datasheets.
    pub fn in_datasheets(which: usize, value: f64) -> f64 {
        match which {
            0 => value * HOUR_S.sqrt(),
            1 => value / STANDARD_GRAVITY * 1e6,
            2 => value / DEG * HOUR_S.sqrt(),
            _ => value / DEG_PER_HOUR,
        }
    }

    /// Names and units of the intensities.
    pub const NAMES: [&'static str; IMU_PARAMETERS] = [
        "velocity random walk (m/s/√h)",
        "accelerometer bias instability (µg)",
        "angle random walk (deg/√h)",
        "gyroscope bias instability (deg/h)",
    ];

    /// `velocity random walk (m/s/√h) 18.0, …`
    pub(super) fn in_words(&self) -> String {
        let figure = |i: usize| {
            let value = Self::in_datasheets(i, self.values[i]);
            // Three digits: the figures are bounds of a search, not measurements.
            let decimals = (2.0 - value.log10().floor()).max(0.0) as usize;
            format!("{} {value:.decimals$}", Self::NAMES[i])
        };
        (0..IMU_PARAMETERS)
            .map(figure)
            .collect::<Vec<_>>()
            .join(", ")
    }

    /// As good as without noise.
    pub(super) fn perfect(t_corr_s: f64) -> Self {
        // 1e-5 of a consumer IMU, not zero: intensities are sought as logarithms.
        Self {
            values: START,
            t_corr_s,
        }
        .times([NONE; IMU_PARAMETERS])
    }

    fn times(&self, factors: [f64; IMU_PARAMETERS]) -> Self {
        Self {
            values: std::array::from_fn(|i| self.values[i] * factors[i]),
            ..*self
        }
    }
}

/// An intensity that keeps the limits, or none that matters.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Answer {
    /// At most this.
    AtMost(f64),
    /// Any value will do.
    Any,
    /// Not even zero is enough.
    Never,
}

/// What is asked of an IMU.
pub struct Need<'a> {
    /// The trajectory and the places of the outage.
    pub course: &'a Course<'a>,
    /// Receiver, start and IMU rate.
    pub scenario: &'a Scenario,
    /// At least one.
    pub limits: &'a [Limit],
    /// Longest correlation time of the biases (s).
    pub t_corr_s: f64,
}

impl Need<'_> {
    /// The IMU that meets the limits with 1.5 thousandths in reserve, its four intensities with equal shares in the
    /// variance that GNSS and start leave.
    ///
    /// # Errors
    /// When not even a perfect IMU meets them, or the poorest that is sought does.
    pub fn allocated(&self) -> Result<ImuParameters, RequireError> {
        let start = ImuParameters {
            values: START,
            t_corr_s: self.t_corr_s,
        };
        let perfect = self.worst(&ImuParameters::perfect(self.t_corr_s))?;
        if perfect.margin() <= RESERVE {
            return Err(RequireError::Floor {
                limit: perfect.limit,
                value: perfect.value,
            });
        }
        let poorest = start.times([POOREST; IMU_PARAMETERS]);
        let worst = self.worst(&poorest)?;
        if worst.margin() >= RESERVE {
            return Err(RequireError::Loose {
                limit: worst.limit,
                value: worst.value,
                poorest,
            });
        }
        let mut imu = self.at_limit(&start, [1.0; IMU_PARAMETERS])?.1;
        for _ in 0..ROUNDS {
            let (worst, squares) = self.squares(&imu)?;
            let total: f64 = squares.iter().sum();
            // what the limit leaves when GNSS and start have taken their part
            // The margin is ln(limit/error): squared, exp(2 margin) is what the mean square may grow by.
            let allowed =
                total * (2.0 * (worst.margin() - RESERVE)).exp() - squares[IMU_PARAMETERS];
            // Where GNSS and start alone exceed the limit at this iterate the rest is negative: five per cent
            // keep the logarithm finite until it is not.
            let quarter = allowed.max(0.05 * total) / IMU_PARAMETERS as f64;
            let off: [f64; IMU_PARAMETERS] = std::array::from_fn(|i| (quarter / squares[i]).ln());
            if off.iter().all(|x| x.abs() < EVEN) {
                break;
            }
            // Half of the logarithm of the squares would be the exact step of a source alone; less, since the
            // filter's gains, and with them all four parts, change with every intensity.
            imu = imu.times(off.map(|x| (DAMPING * x).clamp(-1.0, 1.0).exp()));
        }
        // The rounds end near the limit; one factor common to all then meets it exactly and leaves the shares
        // as they are.
        Ok(self.at_limit(&imu, [1.0; IMU_PARAMETERS])?.1)
    }

    /// What an intensity may be where the others are multiplied by `others`.
    ///
    /// # Errors
    /// When the model has no filter.
    pub fn alone(
        &self,
        imu: &ImuParameters,
        which: usize,
        others: f64,
    ) -> Result<Answer, BeliefError> {
        let base = imu.times(std::array::from_fn(
            |i| if i == which { 1.0 } else { others },
        ));
        let mut varied = [0.0; IMU_PARAMETERS];
        varied[which] = 1.0;
        let (margin, found) = self.at_limit(&base, varied)?;
        Ok(match margin {
            // Regula falsi may end at a bracket without the last digit: ten times the tolerance is still a
            // crossing.
            m if m.abs() <= 10.0 * EXACT => Answer::AtMost(found.values[which]),
            m if m > 0.0 => Answer::Any,
            _ => Answer::Never,
        })
    }

    /// As [`Self::alone`], the others as good as none.
    ///
    /// # Errors
    /// When the model has no filter.
    pub fn quite_alone(&self, imu: &ImuParameters, which: usize) -> Result<Answer, BeliefError> {
        self.alone(imu, which, NONE)
    }

    fn worst(&self, imu: &ImuParameters) -> Result<Worst, BeliefError> {
        self.course.worst(
            self.scenario,
            &imu.model(self.scenario.imu.rate_hz),
            self.limits,
        )
    }

    /// The IMU whose intensities with a weight are multiplied until the hardest limit is met with its reserve, and the
    /// margin beyond that which is left: not zero where no factor within the range meets it.
    fn at_limit(
        &self,
        imu: &ImuParameters,
        weights: [f64; IMU_PARAMETERS],
    ) -> Result<(f64, ImuParameters), BeliefError> {
        let scaled = |ln: f64| imu.times(weights.map(|w| (w * ln).exp()));
        let crossing = Crossing {
            bounds: (-RANGE, RANGE),
            step: 0.7,
            exact: EXACT,
        };
        let imu_at = |ln: f64| {
            (
                self.scenario.clone(),
                scaled(ln).model(self.scenario.imu.rate_hz),
            )
        };
        let (ln, margin) = self
            .course
            .crossing(self.limits, (&crossing, RESERVE), imu_at)?;
        Ok((margin, scaled(ln)))
    }

    /// Mean squares of the four sources and of everything else in what is limited the hardest.
    fn squares(
        &self,
        imu: &ImuParameters,
    ) -> Result<(Worst, [f64; IMU_PARAMETERS + 1]), BeliefError> {
        let worst = self.worst(imu)?;
        let model = imu.model(self.scenario.imu.rate_hz);
        let group = |source: &NamedSource| {
            let own = ImuParameters::PROCESSES
                .iter()
                .position(|process| source.process == Some(*process));
            own.unwrap_or(IMU_PARAMETERS)
        };
        let parts = self.course.parts(
            worst.place,
            self.scenario,
            &model,
            &group,
            IMU_PARAMETERS + 1,
        )?;
        Ok((
            worst,
            std::array::from_fn(|i| parts[i].square(worst.limit.quantity)),
        ))
    }
}

// How far a given IMU is from its limits, and what one without errors would leave.

/// How an IMU stands to its limits.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Margins {
    /// Whether the limits are kept.
    pub met: bool,
    /// The hardest limit.
    #[serde(flatten)]
    pub worst: Worst,
    /// The same for an IMU without errors: what GNSS and start leave.
    pub without_imu_errors: Worst,
}

/// Correlation time of the biases of an IMU that has next to none (s): any would do.
const SLOW_S: f64 = 300.0;

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
        let perfect = ImuParameters::perfect(SLOW_S).model(model.rate_hz);
        let worst = course.worst(scenario, model, limits)?;
        Ok(Self {
            met: worst.margin() >= 0.0,
            worst,
            without_imu_errors: course.worst(&without_imu_errors(scenario), &perfect, limits)?,
        })
    }
}

/// A scenario whose IMU has no constant errors, and whose filter knows it.
fn without_imu_errors(scenario: &Scenario) -> Scenario {
    let mut scenario = scenario.clone();
    let (imu, initial) = (&mut scenario.imu, &mut scenario.initial);
    for sigma in [
        &mut imu.turn_on_bias_accel_m_s2,
        &mut imu.turn_on_bias_gyro_rad_s,
        &mut initial.accel_bias_sigma_m_s2,
        &mut initial.gyro_bias_sigma_rad_s,
        &mut initial.accel_scale_sigma_ppm,
        &mut initial.gyro_scale_sigma_ppm,
    ] {
        *sigma = sigma.map(|_| 0.0);
    }
    for size in [
        &mut imu.scale_ppm_accel,
        &mut imu.scale_ppm_gyro,
        &mut imu.misalignment_rad,
        &mut imu.g_sensitivity_rad_s_per_m_s2,
    ] {
        *size = 0.0;
    }
    imu.vibration
        .iter_mut()
        .for_each(|v| v.rectification_s2_m = 0.0);
    imu.temperature.iter_mut().for_each(|t| t.multiply(0.0));
    scenario
}
