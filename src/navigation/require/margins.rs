//! By how much a given IMU keeps a limit or misses it, and what of it decides.

use super::{Course, Limit, Worst};
use crate::ekf::BeliefError;
use crate::imu::{Channel, Sensor};
use crate::noise::{Kind, Model};
use crate::scenario::Scenario;
use crate::simulation::lincov::{Crossing, DRIFT, NamedSource, times};

/// A part of an IMU's noise.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Group {
    /// The sensor.
    pub sensor: Sensor,
    /// Whether it is the correlated noise, or the noise that is new in every sample.
    pub correlated: bool,
}

impl Group {
    /// All four.
    pub(crate) const ALL: [Self; 4] = [
        Self { sensor: Sensor::Accel, correlated: false },
        Self { sensor: Sensor::Accel, correlated: true },
        Self { sensor: Sensor::Gyro, correlated: false },
        Self { sensor: Sensor::Gyro, correlated: true },
    ];

    /// `gyro, correlated`
    #[must_use]
    pub fn name(self) -> String {
        format!("{}, {}", self.sensor.name(), if self.correlated { "correlated" } else { "white" })
    }

    /// Whether a process of a sensor belongs to it. A drift belongs to none: it is the same in every run.
    fn includes(self, sensor: Sensor, kind: Kind) -> bool {
        let correlated = match kind {
            Kind::Ar1 | Kind::GaussMarkov | Kind::RandomWalk => true,
            Kind::White | Kind::Quantization | Kind::Ma1 => false,
            Kind::Drift => return false,
        };
        sensor == self.sensor && correlated == self.correlated
    }

    /// The model with this part's standard deviations multiplied.
    fn multiplied(self, model: &Model, factor: f64) -> Model {
        let mut changed = model.clone();
        for channel in Channel::ALL.into_iter().filter(|c| c.sensor == self.sensor) {
            for process in &mut changed.axes[channel.index()].processes {
                if self.includes(self.sensor, process.kind()) {
                    // The factor is on standard deviations, the parameter a variance.
                    *process = times(process, factor * factor, model.rate_hz);
                }
            }
        }
        changed
    }
}

/// The effect of a part of an IMU's noise on a limit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GroupMargin {
    /// The part.
    pub group: Group,
    /// Its share in the mean square of what is limited.
    pub share: f64,
    /// The factor on its standard deviations that alone meets the limit exactly; none where none does: too little or
    /// too much whatever it is.
    pub factor: Option<f64>,
}

/// How an IMU stands to its limits.
#[derive(Debug, Clone, PartialEq)]
pub struct Margins {
    /// The hardest limit.
    pub worst: Worst,
    /// The parts of the IMU that it has.
    pub groups: Vec<GroupMargin>,
    /// Share of the drifts of the noise model.
    pub drift: f64,
    /// Share of GNSS, start and what the noise model does not have (turn-on biases).
    pub rest: f64,
}

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
        let [drift, rest] = [Group::ALL.len(), Group::ALL.len() + 1];
        let part = |source: &NamedSource| match source.process {
            Some((sensor, kind)) => Group::ALL.iter().position(|g| g.includes(sensor, kind)).unwrap_or(rest),
            None if source.name == DRIFT => drift,
            None => rest,
        };
        let parts = course.parts(worst.place, scenario, model, &part, rest + 1)?;
        let squares: Vec<f64> = parts.iter().map(|part| part.square(worst.limit.quantity)).collect();
        let total: f64 = squares.iter().sum();
        let mut groups = Vec::new();
        for (group, square) in Group::ALL.into_iter().zip(&squares).filter(|(_, square)| **square > 0.0) {
            let crossing = Crossing { bounds: (-RANGE, RANGE), step: 0.7, exact: 1e-3 };
            let model_at = |ln: f64| group.multiplied(model, ln.exp());
            let (ln, left) = course.crossing(scenario, limits, (&crossing, 0.0), model_at)?;
            // A value left at a bound is no crossing: with this part without noise, or with any, the limit
            // stays where it is.
            let factor = (left.abs() <= 1e-2).then(|| ln.exp());
            groups.push(GroupMargin { group, share: square / total, factor });
        }
        Ok(Self { worst, groups, drift: squares[drift] / total, rest: squares[rest] / total })
    }

    /// Whether the limits are kept.
    #[must_use]
    pub fn met(&self) -> bool {
        self.worst.margin() >= 0.0
    }
}
