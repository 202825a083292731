//! The IMU that a limit needs.

use super::given::{Aided, GivenImu, Longest};
use super::ranking::{RankedUnit, Ranking};
use super::{BeyondLinear, CHECKED, CURVE_S, LONGEST_S, Question};
use crate::app::inputs;
use crate::io::model_file::{ModelFile, PROGRAM, TurnOn};
use nav_sim_document::{Cell, Document, Importance, Table, Tone, readable};
use nav_sim_navigation::ekf::BeliefError;
use nav_sim_navigation::metrics::Expected;
use nav_sim_navigation::require::{
    Answer, Answer as Bound, Course, Drift, IMU_PARAMETERS, ImuParameters, Limit, Margins, Need,
    Quantity, RequireError, Worst, evenly,
};
use nav_sim_navigation::scenario::Scenario;
use nav_sim_navigation::sensors::aiding::AidingSettings;
use nav_sim_navigation::sensors::imu::Truth;
use nav_sim_navigation::sensors::outage::Outage;
use nav_sim_navigation::simulation::ExperimentError;
use nav_sim_navigation::trajectory::Trajectory;
use nav_sim_signal::imu::Sensor;
use nav_sim_signal::noise::Model;
use rayon::prelude::*;
use serde::{Serialize, Serializer};
use serde_json::{Value, json};

/// The IMU that a limit needs.
#[derive(Debug, Clone)]
pub(crate) struct NeededImu {
    /// What was asked.
    pub question: Question,
    /// With equal shares.
    pub imu: ImuParameters,
    /// The hardest limit, and where.
    pub worst: Worst,
    /// What each intensity may be if there were no other.
    pub alone: [Bound; IMU_PARAMETERS],
    /// What each may be if the others are ten times better.
    pub others_better: [Bound; IMU_PARAMETERS],
    /// Turn-on biases that it has: accelerometer (m/s²), gyroscope (rad/s).
    pub turn_on: [f64; 2],
    /// Where the answer is beyond linear theory.
    pub beyond_linear: Option<BeyondLinear>,
}

impl NeededImu {
    /// The turn-on biases that the answer takes for granted.
    pub(super) fn turn_on_in_words(&self) -> String {
        if self.turn_on == [0.0; 2] {
            return "without turn-on bias ([imu] of --scenario states one)".to_owned();
        }
        let [accel, gyro] = self.turn_on.map(readable);
        format!("with turn-on biases of {accel} m/s² (accel) and {gyro} rad/s (gyro)")
    }

    fn figures(&self) -> Table {
        let mut table = Table::new([
            "figure",
            "at most, equal shares",
            "if alone",
            "others 10 × better",
        ]);
        for i in 0..IMU_PARAMETERS {
            let pointer = |key: &str| format!("/figures/{i}/{key}");
            table.row([
                ImuParameters::NAMES[i].into(),
                bound(i, &Bound::AtMost(self.imu.values[i]), &pointer("allocated")),
                bound(i, &self.alone[i], &pointer("alone")),
                bound(
                    i,
                    &self.others_better[i],
                    &pointer("others_10_times_better"),
                ),
            ]);
        }
        table
    }
}

impl NeededImu {
    /// Verdict, tables and charts.
    pub(super) fn document(&self) -> Document {
        let lines = [
            format!("needed for {}", self.question.in_words()),
            format!("an IMU {}", self.turn_on_in_words()),
            format!("hardest: {}", self.question.worst(&self.worst)),
        ];
        let mut document = Document::new("The IMU that a limit needs", Tone::Good, lines);
        BeyondLinear::note(self.beyond_linear.as_ref(), &mut document);
        let (from_s, to_s) = self.imu.floor_s();
        let floor = format!(
            "bias instability: floor of the Allan deviation, here {} to {} s",
            readable(from_s),
            readable(to_s)
        );
        document.note(Importance::Detail, floor);
        document.section("Figures, at most");
        document.text("If alone: without any other error of the IMU. Others 10 × better: every other figure ten times smaller.");
        document.lead(self.figures());
        document.checked(CHECKED);
        document
    }
}

impl Serialize for NeededImu {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let figure = |i: usize| {
            json!({
                "figure": ImuParameters::NAMES[i],
                "allocated": ImuParameters::in_datasheets(i, self.imu.values[i]),
                "alone": bound_json(i, &self.alone[i]),
                "others_10_times_better": bound_json(i, &self.others_better[i]),
            })
        };
        let file = json!({
            "schema_version": 1,
            "question": self.question.json(),
            "t_corr_s": self.imu.t_corr_s,
            "turn_on_bias": { "accel_m_s2": self.turn_on[0], "gyro_rad_s": self.turn_on[1] },
            "figures": (0..IMU_PARAMETERS).map(figure).collect::<Vec<_>>(),
            "place": self.worst.place,
            "beyond_linear": self.beyond_linear,
        });
        file.serialize(serializer)
    }
}

fn bound(which: usize, found: &Bound, pointer: &str) -> Cell {
    match found {
        Bound::AtMost(value) => Cell::number(ImuParameters::in_datasheets(which, *value), pointer),
        Bound::Any => Cell::figures("any"),
        Bound::Never => Cell::figures("–"),
    }
}

fn bound_json(which: usize, found: &Bound) -> Value {
    match found {
        Bound::AtMost(value) => json!(ImuParameters::in_datasheets(which, *value)),
        Bound::Any => json!("any"),
        Bound::Never => Value::Null,
    }
}

// Which IMU a limit on the errors after an outage needs, what a given one makes of it, and a ranking.

/// The outage that is asked for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Ask {
    /// One of this length (s), from every second on.
    Length(f64),
    /// This one.
    Window(Outage),
    /// The longest within the limits.
    Longest,
}

impl Ask {
    /// How long it lasts at least (s).
    fn length_s(self) -> f64 {
        match self {
            Self::Length(length_s) => length_s,
            Self::Window(outage) => outage.end_s - outage.start_s,
            Self::Longest => 1.0,
        }
    }
}

/// Correlation time of the biases of an IMU that is sought (s).
const CORRELATION_TIME_S: f64 = 300.0;

/// Earliest start of an outage where nothing else is said (s): by then a filter has aligned itself.
const SETTLED_S: f64 = 300.0;
/// An outage of which only the length is given begins at every whole second, at fewer where all of them together would
/// last longer than this (s): the time that an answer takes is in proportion.
const TOGETHER_S: f64 = 60_000.0;
/// Beginnings at least.
const BEGINNINGS: f64 = 16.0;

/// An outage that does not lie on the trajectory.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[error("an outage of {length_s} s from {begins_s} s on is not on the trajectory, which lasts from {} to {} s", .span_s.0, .span_s.1)]
pub(crate) struct Misplaced {
    /// How long it lasts (s).
    pub length_s: f64,
    /// When it begins (s).
    pub begins_s: f64,
    /// Of the trajectory (s).
    pub span_s: (f64, f64),
}

/// What is asked of an IMU, and where.
#[derive(Debug)]
pub(crate) struct Requirements {
    /// Receiver, start and rate.
    pub scenario: Scenario,
    /// The reference.
    pub trajectory: Trajectory,
    /// What the errors at the outage's end may be.
    pub limits: Vec<Limit>,
    ask: Ask,
    first_s: f64,
}

impl Requirements {
    /// `first_s`: the earliest start of an outage of which only the length is given (none: 300 s, less where the
    /// trajectory is short).
    ///
    /// # Errors
    /// When the outage does not lie on the trajectory.
    pub(crate) fn new(
        scenario: Scenario,
        trajectory: Trajectory,
        limits: Vec<Limit>,
        ask: Ask,
        first_s: Option<f64>,
    ) -> Result<Self, Misplaced> {
        let span_s = (trajectory.start_s(), trajectory.end_s());
        let (lasts_s, length_s) = (span_s.1 - span_s.0, ask.length_s());
        let settled_s = span_s.0 + SETTLED_S.min(0.5 * (lasts_s - length_s)).max(0.0);
        let first_s = first_s.unwrap_or(settled_s);
        let begins_s = if let Ask::Window(outage) = ask {
            outage.start_s
        } else {
            first_s
        };
        if begins_s < span_s.0 || begins_s + length_s > span_s.1 {
            return Err(Misplaced {
                length_s,
                begins_s,
                span_s,
            });
        }
        Ok(Self {
            scenario,
            trajectory,
            limits,
            ask,
            first_s,
        })
    }

    /// The IMU that is needed.
    ///
    /// # Errors
    /// When no IMU keeps the limits, or trajectory and rates do not fit together.
    pub(crate) fn needed(&self) -> Result<NeededImu, RequireError> {
        let outages = self.outages();
        let course = self.course(&outages)?;
        let scenario = &self.with_stated_turn_on();
        let need = Need {
            course: &course,
            scenario,
            limits: &self.limits,
            t_corr_s: CORRELATION_TIME_S,
        };
        let imu = need.allocated()?;
        let model = imu.model(self.scenario.imu.rate_hz);
        let ends = course.drifts(scenario, &model)?;
        let worst = Worst::of(&self.limits, &ends).expect("at least one limit and one place");
        let mut needed = NeededImu {
            question: self.question(outages.clone()),
            imu,
            worst,
            alone: [Answer::Any; IMU_PARAMETERS],
            others_better: [Answer::Any; IMU_PARAMETERS],
            turn_on: Sensor::ALL.map(|sensor| scenario.imu.turn_on_bias(sensor).unwrap_or(0.0)),
            beyond_linear: self.beyond_linear(scenario, &model, outages[worst.place])?,
        };
        for i in 0..IMU_PARAMETERS {
            needed.alone[i] = need.quite_alone(&imu, i)?;
            needed.others_better[i] = need.alone(&imu, i, 0.1)?;
        }
        Ok(needed)
    }

    /// The scenario with a filter that expects the turn-on biases that `[imu]` states, as it expects those of a model file.
    fn with_stated_turn_on(&self) -> Scenario {
        let mut scenario = self.scenario.clone();
        inputs::expected_turn_on(&mut scenario.initial, &self.stated_turn_on());
        scenario
    }

    fn stated_turn_on(&self) -> TurnOn {
        let sigma = |sensor| {
            self.scenario
                .imu
                .turn_on_bias(sensor)
                .map(|sigma| [sigma; 3])
        };
        TurnOn {
            accel_m_s2: sigma(Sensor::Accel),
            gyro_rad_s: sigma(Sensor::Gyro),
        }
    }

    /// What a model makes of the limits, and the longest outage that it bridges within them: at the places that the outage
    /// asked for has, each as far as the trajectory goes. `scenario` is that of the unit, with its turn-on biases.
    ///
    /// # Errors
    /// When the model has no filter.
    pub(crate) fn judged(
        &self,
        scenario: &Scenario,
        model: &Model,
    ) -> Result<GivenImu, RequireError> {
        let long = self.long_outages();
        let course = self.course(&long)?;
        let curves = course.curves(scenario, model)?;
        let longest = self.longest_of(&course, (scenario, model), &curves)?;
        let of_limit = |limit: &Limit| CURVE_S.map(|s| worst_after(&curves, s, limit.quantity));
        let curve_of_limit = self.limits.iter().map(of_limit).collect();
        let (margins, outages, judged) = if self.ask == Ask::Longest {
            let length_s = longest.length_s();
            let worst = Worst::of(&self.limits, &after(&curves, length_s));
            let judged = worst.map(|worst| Outage {
                end_s: long[worst.place].start_s + length_s,
                ..long[worst.place]
            });
            (None, long, judged)
        } else {
            let outages = self.outages();
            let margins = Margins::of(&self.course(&outages)?, scenario, model, &self.limits)?;
            let judged = outages[margins.worst.place];
            (Some(margins), outages, Some(judged))
        };
        let beyond_linear = match judged {
            Some(outage) => self.beyond_linear(scenario, model, outage)?,
            None => None,
        };
        Ok(GivenImu {
            margins,
            question: self.question(outages),
            longest,
            curves: curve_of_limit,
            aidings: Vec::new(),
            beyond_linear,
        })
    }

    /// The same limits without aiding, with what every car has, and with its wheel.
    ///
    /// # Errors
    /// When the model has no filter.
    pub(super) fn aidings(
        &self,
        scenario: &Scenario,
        model: &Model,
    ) -> Result<Vec<Aided>, RequireError> {
        let all = [
            ("none", AidingSettings::default()),
            ("nhc", AidingSettings::car()),
            ("nhc, odometer", AidingSettings::car_with_odometer()),
        ];
        let aided = |(name, aiding): (&'static str, AidingSettings)| {
            let scenario = Scenario {
                aiding,
                ..scenario.clone()
            };
            let long = self.long_outages();
            let course = Course::new(&scenario, &self.trajectory, &long)?;
            let curves = course.curves(&scenario, model)?;
            let longest = self.longest_of(&course, (&scenario, model), &curves)?;
            let length_s = if self.ask == Ask::Longest {
                longest.length_s()
            } else {
                self.ask.length_s()
            };
            Ok(Aided {
                name,
                worst: Worst::of(&self.limits, &after(&curves, length_s)),
                longest,
            })
        };
        all.into_par_iter().map(aided).collect()
    }

    /// Whether `run` would say that the errors in an outage are beyond linear theory: by the covariance analysis that it
    /// makes.
    fn beyond_linear(
        &self,
        scenario: &Scenario,
        model: &Model,
        outage: Outage,
    ) -> Result<Option<BeyondLinear>, RequireError> {
        let (scenario, outages) = (scenario.with_full_noise(), [outage]);
        let track = scenario.track(&self.trajectory, model, &outages)?;
        let belief = scenario.belief(model, &outages, &track)?;
        let experiment =
            scenario.experiment(&self.trajectory, Truth::Model(model), &[], &outages, 0);
        let Some(expected) = Expected::along(&track, &experiment, &belief, model) else {
            return Ok(None);
        };
        Ok(expected.summary.outages.first().and_then(BeyondLinear::of))
    }

    /// Units after the outage and after those of `CURVE_S`: those whose figures are all stated, the best first, then the others
    /// by name.
    ///
    /// # Errors
    /// When a model has no filter, with its name, or the length is not a whole number of seconds.
    pub(crate) fn ranked(&self, units: &[CatalogueUnit]) -> Result<Ranking, RequireError> {
        let outages = self.long_outages();
        let course = self.course(&outages)?;
        let named = |name: &str, e| RequireError::Unit {
            name: name.to_owned(),
            source: Box::new(e),
        };
        let ranked =
            |unit: &CatalogueUnit| self.rank(&course, unit).map_err(|e| named(&unit.name, e));
        let ranked: Vec<Result<RankedUnit, RequireError>> = units.par_iter().map(ranked).collect();
        let mut units = ranked.into_iter().collect::<Result<Vec<_>, _>>()?;
        units.sort_by(|a, b| match (a.is_complete(), b.is_complete()) {
            (true, true) => b.worst.margin().total_cmp(&a.worst.margin()),
            (false, false) => a.name.cmp(&b.name),
            (a, b) => b.cmp(&a),
        });
        Ok(Ranking {
            units,
            question: self.question(self.outages()),
        })
    }

    fn rank(&self, course: &Course<'_>, unit: &CatalogueUnit) -> Result<RankedUnit, RequireError> {
        let curves = course.curves(&unit.scenario, &unit.model)?;
        let length_s = self.ask.length_s();
        let worst = Worst::of(&self.limits, &after(&curves, length_s));
        let worst = worst.ok_or(RequireError::PartOfASecond { length_s })?;
        Ok(RankedUnit {
            name: unit.name.clone(),
            not_stated: unit.not_stated.clone(),
            worst,
            curve: CURVE_S.map(|s| worst_after(&curves, s, self.limits[0].quantity)),
            longest: self.longest_of(course, (&unit.scenario, &unit.model), &curves)?,
            beyond_linear: self.beyond_linear(
                &unit.scenario,
                &unit.model,
                self.outages()[worst.place],
            )?,
        })
    }

    /// The longest outage of which all places are within the limits, in whole seconds. The first place holds the longest.
    fn longest_of(
        &self,
        course: &Course<'_>,
        (scenario, model): (&Scenario, &Model),
        curves: &[Vec<Drift>],
    ) -> Result<Longest, BeliefError> {
        let first = curves.first().map_or(&[][..], Vec::as_slice);
        let lengths: Vec<f64> = first.iter().map(|d| d.after_s).collect();
        let is_missed = |length_s: &f64| {
            after(curves, *length_s)
                .iter()
                .any(|drift| self.limits.iter().any(|l| drift.exceeds(l)))
        };
        Ok(match lengths.iter().position(is_missed) {
            Some(0) => {
                let worst = Worst::of(&self.limits, &course.with_all_fixes(scenario, model)?);
                worst
                    .filter(|worst| worst.margin() < 0.0)
                    .map_or(Longest::Seconds(0.0), Longest::Never)
            }
            Some(first) => Longest::Seconds(lengths[first - 1]),
            None => Longest::AtLeast(lengths.last().copied().unwrap_or(0.0)),
        })
    }

    /// A unit whose turn-on biases are there and expected; `model` is at the rate of the IMU.
    #[must_use]
    pub(crate) fn unit(&self, name: String, file: &ModelFile, model: Model) -> CatalogueUnit {
        let mut scenario = self.scenario.clone();
        let stated = file.turn_on.unwrap_or_default();
        inputs::expected_turn_on(&mut scenario.initial, &stated);
        inputs::made_turn_on(&mut scenario.imu, &stated);
        CatalogueUnit {
            name,
            model,
            scenario,
            not_stated: file.not_stated(),
        }
    }

    /// The model file of an IMU that is needed.
    #[must_use]
    pub(crate) fn model_file(&self, needed: &NeededImu) -> ModelFile {
        let imu = &needed.imu;
        let mut provenance = toml::Table::new();
        let mut put = |key: &str, value: toml::Value| provenance.insert(key.to_owned(), value);
        put("program", PROGRAM.into());
        put("made_by", "require".into());
        put("label", "what a limit needs: not a calibration".into());
        put("question", needed.question.in_words().into());
        put("turn_on_bias", needed.turn_on_in_words().into());
        for (i, name) in ImuParameters::NAMES.iter().enumerate() {
            put(name, ImuParameters::in_datasheets(i, imu.values[i]).into());
        }
        let stated = self.stated_turn_on();
        let turn_on = (stated != TurnOn::default()).then_some(stated);
        let model = imu.model(self.scenario.imu.rate_hz);
        ModelFile {
            provenance: Some(provenance),
            turn_on,
            ..ModelFile::new(model)
        }
    }

    /// The places of the outage; those of one second where the longest is sought.
    fn outages(&self) -> Vec<Outage> {
        match self.ask {
            Ask::Window(outage) => vec![outage],
            ask => self.places(ask.length_s(), ask.length_s()),
        }
    }

    /// An outage of this length at all its beginnings; fewer where outages of `mean_s` would together last too long.
    fn places(&self, length_s: f64, mean_s: f64) -> Vec<Outage> {
        let end_s = self.trajectory.end_s();
        let seconds = (end_s - length_s - self.first_s).floor().max(0.0) + 1.0;
        let count = seconds.min((TOGETHER_S / mean_s).max(BEGINNINGS));
        evenly(self.first_s, end_s, length_s, count as u32)
    }

    /// The outage at the places that it is asked for, each as long as the trajectory allows.
    fn long_outages(&self) -> Vec<Outage> {
        let end_s = self.trajectory.end_s();
        // The same places whatever is made of them: a unit is judged alike alone and in a ranking.
        let lasting = |o: Outage| Outage {
            end_s: end_s.min(o.start_s + LONGEST_S).max(o.end_s),
            ..o
        };
        let places = match self.ask {
            // Where the longest is sought every length is, at all places that leave room for it.
            Ask::Longest => self.places(self.ask.length_s(), self.mean_length_s()),
            _ => self.outages(),
        };
        places.into_iter().map(lasting).collect()
    }

    /// Mean length of outages that begin anywhere, each as long as the trajectory allows (s).
    fn mean_length_s(&self) -> f64 {
        let left_s = self.trajectory.end_s() - self.first_s;
        let longest_s = left_s.min(LONGEST_S);
        // All are the longest but those that begin later than that before the end, half as long in the mean.
        longest_s * (1.0 - 0.5 * longest_s / left_s)
    }

    fn course(&self, outages: &[Outage]) -> Result<Course<'_>, ExperimentError> {
        Course::new(&self.scenario, &self.trajectory, outages)
    }

    fn question(&self, outages: Vec<Outage>) -> Question {
        Question {
            limits: self.limits.clone(),
            outages,
        }
    }
}

/// A unit to be ranked.
#[derive(Debug, Clone)]
pub(crate) struct CatalogueUnit {
    /// Its name.
    pub name: String,
    /// At the rate of the IMU.
    pub model: Model,
    /// The scenario with its turn-on biases.
    pub scenario: Scenario,
    /// Figures that its datasheet does not state, and the model therefore has not.
    pub not_stated: Vec<String>,
}

/// The errors after a time without fixes at every place where the outage lasts so long.
fn after(curves: &[Vec<Drift>], length_s: f64) -> Vec<Drift> {
    // Times come from samples: within a millisecond they are the same.
    const SAME_S: f64 = 1e-3;
    let drift_of_curve = |curve: &Vec<Drift>| {
        let first = curve.partition_point(|d| d.after_s < length_s - SAME_S);
        curve
            .get(first)
            .filter(|d| d.after_s < length_s + SAME_S)
            .copied()
    };
    curves.iter().filter_map(drift_of_curve).collect()
}

/// The largest value of a quantity after a time without fixes.
fn worst_after(curves: &[Vec<Drift>], length_s: u32, quantity: Quantity) -> Option<f64> {
    Drift::largest(&after(curves, f64::from(length_s)), quantity).map(|(_, value)| value)
}

#[cfg(test)]
#[path = "needed_tests.rs"]
mod tests;
