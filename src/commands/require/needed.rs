//! The IMU that a limit needs.

use super::given::{Aided, GivenImu, LimitCurve, Longest};
use super::ranking::{RankedUnit, Ranking, stated_in_words};
use super::{CHECKED, CURVE_S, DriftPoint, LONGEST_S, Question, note_beyond};
use crate::app::{Failure, Refuse, inputs};
use crate::io::model_file::{ModelFile, PROGRAM, TurnOn};
use nav_sim_document::{Document, Importance, Table, Tone, readable, seconds};
use nav_sim_navigation::metrics::Expected;
use nav_sim_navigation::require::{
    Answer as Bound, Course, Drift, IMU_PARAMETERS, ImuParameters, Limit, Margins, Need, Quantity,
    RequireError, Worst, evenly,
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
use serde::Serialize;
use serde_json::{Value, json};

/// The IMU that a limit needs.
#[derive(Debug, Clone, Serialize)]
pub(crate) struct NeededImu {
    schema_version: u32,
    question: Question,
    t_corr_s: f64,
    turn_on_bias: TurnOnBias,
    figures: Vec<NeededFigure>,
    /// The hardest limit, and where.
    #[serde(flatten)]
    worst: Worst,
    /// The outage of the answer, where it is beyond linear theory.
    beyond_linear: Option<Outage>,
    /// With equal shares.
    #[serde(skip)]
    imu: ImuParameters,
}

/// Turn-on biases that it has.
#[derive(Debug, Clone, Copy, Serialize)]
struct TurnOnBias {
    accel_m_s2: f64,
    gyro_rad_s: f64,
}

#[derive(Debug, Clone, Serialize)]
struct NeededFigure {
    figure: &'static str,
    /// With equal shares.
    allocated: f64,
    /// If there were no other; `any`, or null where none will do.
    alone: Value,
    /// If the others are ten times better.
    others_10_times_better: Value,
}

impl NeededImu {
    /// The turn-on biases that the answer takes for granted.
    fn turn_on_in_words(&self) -> String {
        let TurnOnBias {
            accel_m_s2,
            gyro_rad_s,
        } = self.turn_on_bias;
        if accel_m_s2 == 0.0 && gyro_rad_s == 0.0 {
            return "without turn-on bias ([imu] of --scenario states one)".to_owned();
        }
        let [accel, gyro] = [accel_m_s2, gyro_rad_s].map(readable);
        format!("with turn-on biases of {accel} m/s² (accel) and {gyro} rad/s (gyro)")
    }

    /// Verdict, tables and charts.
    pub(super) fn document(&self) -> Document {
        let lines = [
            format!("needed for {}", self.question.in_words()),
            format!("an IMU {}", self.turn_on_in_words()),
            format!("hardest: {}", self.question.worst(&self.worst)),
        ];
        let mut document = Document::new("The IMU that a limit needs", Tone::Good, lines);
        note_beyond(self.beyond_linear, &mut document);
        let (from_s, to_s) = self.imu.floor_s();
        let floor = format!(
            "bias instability: floor of the Allan deviation, here {} to {} s",
            readable(from_s),
            readable(to_s)
        );
        document.note(Importance::Detail, floor);
        document.section("Figures, at most");
        document.text("If alone: without any other error of the IMU. Others 10 × better: every other figure ten times smaller.");
        let columns = [
            ("figure", "figure"),
            ("at most, equal shares", "allocated"),
            ("if alone", "alone"),
            ("others 10 × better", "others_10_times_better"),
        ];
        document.lead(Table::of(self, "/figures/*", &columns));
        document.checked(CHECKED);
        document
    }
}

fn bound(which: usize, found: &Bound) -> Value {
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
    ) -> Result<Self, Failure> {
        let span_s = (trajectory.start_s(), trajectory.end_s());
        let (lasts_s, length_s) = (span_s.1 - span_s.0, ask.length_s());
        let settled_s = span_s.0 + SETTLED_S.min(0.5 * (lasts_s - length_s)).max(0.0);
        let earlier = first_s.map_or("", |_| ", or an earlier --start");
        let first_s = first_s.unwrap_or(settled_s);
        let begins_s = match ask {
            Ask::Window(outage) => outage.start_s,
            _ => first_s,
        };
        if begins_s < span_s.0 || begins_s + length_s > span_s.1 {
            let message = format!(
                "an outage of {length_s} s from {begins_s} s on is not on the trajectory, which lasts from {} to {} s",
                span_s.0, span_s.1
            );
            return Err(Failure::input(message).hint(format!("a shorter --outage{earlier}")));
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
        let figure = |i: usize| {
            Ok::<_, RequireError>(NeededFigure {
                figure: ImuParameters::NAMES[i],
                allocated: ImuParameters::in_datasheets(i, imu.values[i]),
                alone: bound(i, &need.quite_alone(&imu, i)?),
                others_10_times_better: bound(i, &need.alone(&imu, i, 0.1)?),
            })
        };
        let turn_on = |sensor| scenario.imu.turn_on_bias(sensor).unwrap_or(0.0);
        Ok(NeededImu {
            schema_version: 1,
            t_corr_s: imu.t_corr_s,
            turn_on_bias: TurnOnBias {
                accel_m_s2: turn_on(Sensor::Accel),
                gyro_rad_s: turn_on(Sensor::Gyro),
            },
            figures: (0..IMU_PARAMETERS).map(figure).collect::<Result<_, _>>()?,
            beyond_linear: self.beyond_linear(scenario, &model, outages[worst.place])?,
            question: self.question(outages),
            worst,
            imu,
        })
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
        let longest = self.longest_of(&curves);
        let of_limit = |limit: &Limit| LimitCurve {
            quantity: limit.quantity,
            points: drift_curve(&curves, limit.quantity),
        };
        let curve_of_limit = self.limits.iter().map(of_limit).collect();
        let (judged, outages, shown) = if self.ask == Ask::Longest {
            let length_s = longest.length_s();
            let worst = Worst::of(&self.limits, &after(&curves, length_s));
            let shown = worst.map(|worst| Outage {
                end_s: long[worst.place].start_s + length_s,
                ..long[worst.place]
            });
            (None, long, shown)
        } else {
            let outages = self.outages();
            let margins = Margins::of(&self.course(&outages)?, scenario, model, &self.limits)?;
            let shown = outages[margins.worst.place];
            (Some(margins), outages, Some(shown))
        };
        let beyond_linear = shown.map(|outage| self.beyond_linear(scenario, model, outage));
        Ok(GivenImu {
            schema_version: 1,
            question: self.question(outages),
            outage: longest,
            curves: curve_of_limit,
            beyond_linear: beyond_linear.transpose()?.flatten(),
            aidings: Vec::new(),
            judged,
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
            let longest = self.longest_of(&curves);
            let length_s = if self.ask == Ask::Longest {
                longest.length_s()
            } else {
                self.ask.length_s()
            };
            Ok(Aided {
                aiding: name,
                worst: Worst::of(&self.limits, &after(&curves, length_s)),
                outage: longest,
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
    ) -> Result<Option<Outage>, RequireError> {
        let (scenario, outages) = (scenario.with_full_noise(), [outage]);
        let track = scenario.track(&self.trajectory, model, &outages)?;
        let belief = scenario.belief(model, &outages, &track)?;
        let experiment =
            scenario.experiment(&self.trajectory, Truth::Model(model), &[], &outages, 0);
        let expected = Expected::along(&track, &experiment, &belief, model);
        let is_beyond = expected.is_some_and(|expected| expected.summary.outages[0].beyond_linear);
        Ok(is_beyond.then_some(outage))
    }

    /// Units after the outage and after those of `CURVE_S`: those whose figures are all stated, the best first, then the others
    /// by name.
    ///
    /// # Errors
    /// When a model has no filter, with its name, or the length is not a whole number of seconds.
    pub(crate) fn ranked(&self, units: &[CatalogueUnit]) -> Result<Ranking, Failure> {
        let outages = self.long_outages();
        let course = self.course(&outages)?;
        let ranked = |unit: &CatalogueUnit| {
            let ranked = self.rank(&course, unit);
            ranked.map_err(|e| e.within(&unit.name))
        };
        let ranked: Vec<Result<RankedUnit, Failure>> = units.par_iter().map(ranked).collect();
        let mut units = ranked.into_iter().collect::<Result<Vec<_>, _>>()?;
        units.sort_by(|a, b| match [a, b].map(|unit| unit.not_stated.is_empty()) {
            [true, true] => b.worst.margin().total_cmp(&a.worst.margin()),
            [false, false] => a.unit.cmp(&b.unit),
            [a, b] => b.cmp(&a),
        });
        Ok(Ranking {
            schema_version: 1,
            question: self.question(self.outages()),
            curve_quantity: self.limits[0].quantity,
            units,
        })
    }

    fn rank(&self, course: &Course<'_>, unit: &CatalogueUnit) -> Result<RankedUnit, Failure> {
        let curves = course.curves(&unit.scenario, &unit.model).refuse()?;
        let length_s = self.ask.length_s();
        let worst = Worst::of(&self.limits, &after(&curves, length_s));
        let worst = worst.ok_or_else(|| {
            Failure::input(format!("{length_s} s is not a whole number of seconds"))
        })?;
        let is_complete = unit.not_stated.is_empty();
        let kept = match worst.margin() >= 0.0 {
            true if is_complete => "met",
            true => "open",
            false => "not met",
        };
        let outage = self.outages()[worst.place];
        Ok(RankedUnit {
            unit: unit.name.clone(),
            met: kept == "met",
            kept,
            missing: stated_in_words(&unit.not_stated),
            not_stated: unit.not_stated.clone(),
            worst,
            curve: drift_curve(&curves, self.limits[0].quantity),
            outage: self.longest_of(&curves),
            beyond_linear: self
                .beyond_linear(&unit.scenario, &unit.model, outage)
                .refuse()?,
        })
    }

    /// The longest outage of which all places are within the limits, in whole seconds. The first place holds the longest.
    fn longest_of(&self, curves: &[Vec<Drift>]) -> Longest {
        let first = curves.first().map_or(&[][..], Vec::as_slice);
        let lengths: Vec<f64> = first.iter().map(|d| d.after_s).collect();
        let is_missed = |length_s: &f64| {
            after(curves, *length_s)
                .iter()
                .any(|drift| self.limits.iter().any(|l| drift.exceeds(l)))
        };
        let missed = lengths.iter().position(is_missed);
        let longest_s = missed.map(|first| first.checked_sub(1).map_or(0.0, |last| lengths[last]));
        let at_least_s = lengths.last().copied().unwrap_or(0.0);
        let text = match longest_s {
            // curves begin with the first second: what is not kept then may be kept for a part of it
            Some(s) if s < 1.0 => "less than 1 s".to_owned(),
            Some(s) => format!("{} s", seconds(s)),
            None => format!("≥ {} s", seconds(at_least_s)),
        };
        Longest {
            longest_s,
            at_least_s: longest_s.is_none().then_some(at_least_s),
            text,
        }
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

/// The largest value of a quantity after each of [`CURVE_S`] without fixes.
fn drift_curve(curves: &[Vec<Drift>], quantity: Quantity) -> Vec<DriftPoint> {
    let point = |outage_s: u32| DriftPoint {
        outage_s,
        value: Drift::largest(&after(curves, f64::from(outage_s)), quantity).map(|(_, x)| x),
    };
    CURVE_S.map(point).to_vec()
}

#[cfg(test)]
#[path = "needed_tests.rs"]
mod tests;
