//! The IMU that a limit needs, what a given one makes of it, and a ranking of several.

use crate::app::inputs::{self, ScenarioArgs};
use crate::app::{
    Command, Context, Failure, Inputs, IntoFailure, OutputKind, PlainAnswer, Result, refused,
};
use crate::io::datasheet::{self, CATALOGUE, Datasheet};
use crate::io::file_kind::{self, FileKind};
use crate::io::input::listed;
use crate::io::model_file::{self, ModelFile, PROGRAM, TurnOn, known};
use crate::parse;
use crate::report::csv::merged;
use nav_sim_document::{Document, Importance, Table, Tone, counted, readable, seconds, window};
use nav_sim_navigation::ekf::FilterModelError;
use nav_sim_navigation::metrics::ExpectedRun;
use nav_sim_navigation::require::{
    Drift, HardestLimit, ImuParameters, ImuSearch, IntensityBound as Bound, Limit, LimitQuantity,
    Margins, OutagePlacements, RequireError, evenly, worst_without_imu_errors,
};
use nav_sim_navigation::scenario::Scenario;
use nav_sim_navigation::sensors::aiding::AidingSettings;
use nav_sim_navigation::sensors::imu::Truth;
use nav_sim_navigation::sensors::outage::Outage;
use nav_sim_navigation::simulation::lincov::Track;
use nav_sim_navigation::trajectory::Trajectory;
use nav_sim_signal::imu::Sensor;
use nav_sim_signal::noise::Model;
use rayon::prelude::*;
use serde::Serialize;
use serde_json::{Value, json};
use std::path::{Path, PathBuf};
use std::str::FromStr;

// `nav-sim require`: which IMU a limit needs, and what a given one makes of it.

/// Find the IMU that keeps the errors at the end of an outage within limits, or judge MODEL by them
///
/// Uses linear covariance analysis along TRAJECTORY of a filter that knows its IMU. Without MODEL it finds the white noise
/// and bias instability that each sensor may have beside the turn-on biases of [imu] in --scenario. With MODEL it says
/// whether the limits are kept (exit code 3: they are not), and the longest outage that it bridges.
#[derive(clap::Args, Debug, Clone)]
pub struct Require {
    /// Trajectory: motion profile (.toml) or table (.csv)
    pub trajectory: PathBuf,
    /// Noise model of an IMU
    model: Option<PathBuf>,
    /// Outage: a length in seconds (tried from every second on), START:END, or "longest" (needs MODEL)
    #[arg(long, value_name = "SECONDS")]
    outage: OutageRequest,
    /// Earliest start of the outage in seconds [default: 300, less if the trajectory is short]
    #[arg(long, value_name = "SECONDS", value_parser = parse::non_negative)]
    start: Option<f64>,
    /// Limit at the end of the outage, as NAME<=LIMIT (repeatable): p50_m, p95_m, rmse_m (horizontal), roll_deg, pitch_deg,
    /// yaw_deg
    #[arg(id = "require", long = "require", value_name = "NAME<=LIMIT")]
    limits: Vec<Limit>,
    /// Receiver, start, IMU rate, aiding.
    #[command(flatten)]
    settings: ScenarioArgs,
    /// Motion constraints of the vehicle: a car moves neither sideways nor up; with MODEL, a table
    /// with and without
    #[arg(long, value_name = "KIND", value_parser = ["car"])]
    vehicle: Option<String>,
    /// Rank the catalogued IMUs (`nav-sim datasheet --list`), or those of a directory of entries and model files
    #[arg(long, value_name = "DIR", num_args = 0..=1, default_missing_value = BUILT_IN, conflicts_with = "model")]
    catalogue: Option<PathBuf>,
}

/// Stands for the units that are known by name.
const BUILT_IN: &str = "built-in";

impl FromStr for OutageRequest {
    type Err = String;

    fn from_str(text: &str) -> std::result::Result<Self, String> {
        match text {
            "longest" => Ok(Self::Longest),
            window if window.contains(':') => {
                window.parse().map(Self::Window).map_err(|e| e.to_string())
            }
            length => parse::positive(length)
                .map(Self::Length)
                .map_err(|_| "expected a length in seconds, START:END or longest".to_owned()),
        }
    }
}

impl Command for Require {
    type Answer = PlainAnswer;
    const NAME: &'static str = "require";
    const OUT: OutputKind = OutputKind::File {
        name: "needed.toml",
        help: "Model file of the required IMU",
    };

    fn check_out(&self) -> Result<()> {
        if self.model.is_none() && self.catalogue.is_none() {
            return Ok(());
        }
        refused(
            "--out is for the required IMU, not for MODEL or --catalogue",
            "--plot FILE.html writes the page",
        )
    }

    fn inputs(&self, mut given: Inputs) -> Result<Inputs> {
        if let (OutageRequest::Window(outage), Some(start_s)) = (self.outage, self.start) {
            let Outage {
                start_s: from,
                end_s: to,
            } = outage;
            return refused(
                format!("--start {start_s} beside --outage {from}:{to}"),
                "only an outage given by its length has an earliest start",
            );
        }
        if self.model.is_none() && self.outage == OutageRequest::Longest {
            return refused(
                "--outage longest needs a MODEL",
                "without one, give a length in seconds",
            );
        }
        given.retain(|(role, _)| role != "catalogue");
        Ok(given)
    }

    fn run(&self, context: &Context<'_>) -> Result<PlainAnswer> {
        let asked = self.requirements(context)?;
        match (&self.model, &self.catalogue) {
            (Some(path), _) => asked.judge_imu(path, self.vehicle.is_some(), context),
            (None, Some(directory)) => asked.ranked(&match directory.as_os_str() == BUILT_IN {
                true => asked.catalogue()?,
                false => asked.units_of(directory, context)?,
            }),
            (None, None) => asked.required_imu().map_err(|e| {
                let hint = match e {
                    RequireError::Loose { .. } => "a smaller limit, or a longer outage",
                    _ => "a larger limit, a shorter outage, or a better receiver ([gnss] of --scenario)",
                };
                Failure::input(e).hint(hint)
            }),
        }
    }
}

/// Verdict on units of which none keeps the limits.
const NONE: &str = "no unit keeps the limits with all figures stated";

impl Require {
    /// Reads the files and assembles the requirements.
    fn requirements(&self, context: &Context<'_>) -> Result<Requirements> {
        if self.limits.is_empty() {
            return refused(
                "no limit given",
                "give one, such as --require 'p95_m<=5' or --require 'yaw_deg<=1'",
            );
        }
        let mut scenario = self.settings.read()?;
        if self.vehicle.is_some() {
            if !scenario.aiding.is_none() {
                return refused(
                    "--vehicle car with [aiding] of --scenario",
                    "give one of them",
                );
            }
            scenario.aiding = AidingSettings::car();
        }
        scenario.validate().map_err(Failure::input)?;
        Requirements::new(
            scenario,
            inputs::trajectory(&self.trajectory, context)?,
            self.limits.clone(),
            self.outage,
            self.start,
        )
    }
}

impl Requirements {
    /// Judges a given IMU against the limits.
    fn judge_imu(
        &self,
        path: &Path,
        has_vehicle: bool,
        context: &Context<'_>,
    ) -> Result<PlainAnswer> {
        let unusable = |e: RequireError| Failure::input(format!("{}: {e}", path.display()));
        let file = inputs::model(path, context)?;
        let mut scenario = self.scenario.clone();
        let own = (path, &file);
        inputs::turn_on(&mut scenario, own, Some(own), context);
        let missing = missing(&file.not_stated());
        if !missing.is_empty() {
            context.warn(format!(
                "{}: figures not stated count as zero, unless by grade: {missing}",
                path.display()
            ));
        }
        let model = inputs::at_rate(path, &file.model, scenario.imu.rate_hz, context)?;
        let outages = match self.ask {
            OutageRequest::Longest => self.long_outages(),
            _ => self.outages(),
        };
        let (long, without) = self.prepared().map_err(unusable)?;
        let judged = self.judge_model(&long, without, &scenario, &model);
        let judgement = judged.map_err(unusable)?;
        let margins = judgement.margins.as_ref();
        let is_good = margins.map_or(judgement.outage.length_s() > 0.0, |margins| margins.met);
        let mut document = Document::new(
            "An IMU against its limits",
            Tone::from(is_good),
            self.verdict(&judgement, &outages),
        );
        if let Some(Outage { start_s, end_s }) = judgement.beyond_linear {
            note_beyond(
                &format!("in outage {}", window(start_s, end_s)),
                &mut document,
            );
        }
        let mut json = merged([
            json!({ "schema_version": 1, "question": self.question(&outages) }),
            json!(judgement),
        ]);
        if has_vehicle {
            json["aidings"] = self.aidings(&scenario, &model).map_err(unusable)?;
            document.section("Motion constraints of the car");
            let columns = [
                ("aiding", "aiding"),
                ("error after the outage", "value"),
                ("quantity", "quantity"),
                ("limit", "limit"),
                ("longest outage within the limits", "outage/text"),
            ];
            document.table(Table::of(&json, "/aidings/*", &columns));
        }
        document.section("Error against outage length");
        let columns = [("limit on", "quantity"), ("{outage_s} s", "points/*/value")];
        document.table(Table::of(&json, "/curves/*", &columns));
        let unmet = margins.filter(|margins| !margins.met).map(|margins| {
            let HardestLimit { limit, value, .. } = margins.worst;
            let [value, most] = [value, limit.most].map(|x| limit.quantity.shown(x));
            Failure::bound(format!(
                "{} is {value}, the limit is {most}",
                limit.quantity
            ))
        });
        Ok(PlainAnswer::new(json, document).with_unmet(unmet))
    }

    fn verdict(&self, judgement: &LimitResult, outages: &[Outage]) -> Vec<String> {
        let longest = &judgement.outage.text;
        let Some(margins) = &judgement.margins else {
            let (limits, starts) = (self.limits_in_words(), starts(outages));
            return vec![format!(
                "longest outage within {limits}: {longest} ({starts})"
            )];
        };
        let word = if margins.met { "met" } else { "NOT met" };
        let times = readable(margins.worst.value / margins.worst.limit.most);
        let without = &margins.without_imu_errors;
        let (name, left) = (without.limit.quantity, readable(without.value));
        vec![
            format!(
                "{word}: {}, {times} times the limit",
                in_words(&margins.worst, outages)
            ),
            format!("asked: {}", self.in_words(outages)),
            format!("longest outage within the limits, from the same starts: {longest}"),
            if without.margin() >= 0.0 {
                format!("an IMU without errors would leave {name} {left}")
            } else {
                format!("no IMU keeps the limit: GNSS and start alone leave {name} {left}")
            },
        ]
    }

    /// The units that are known by name.
    fn catalogue(&self) -> Result<Vec<CatalogueUnit>> {
        let unit = |(name, _): &(&str, &str)| {
            self.of_sheet(
                (*name).to_owned(),
                &datasheet::catalogued(name).expect("catalogue")?,
            )
        };
        CATALOGUE.iter().map(unit).collect()
    }

    /// The model files and catalogue entries of a directory.
    fn units_of(&self, directory: &Path, context: &Context<'_>) -> Result<Vec<CatalogueUnit>> {
        if !directory.exists() {
            return refused(
                format!("--catalogue {}: no such directory", directory.display()),
                "--catalogue alone ranks the built-in IMUs",
            );
        }
        let mut paths = listed(&[directory.to_owned()])?;
        paths.retain(|p| p.extension().is_some_and(|e| e == "toml"));
        if paths.is_empty() {
            return refused(
                format!("{}: no model file (.toml)", directory.display()),
                "make one with `nav-sim calibrate` or `nav-sim datasheet`",
            );
        }
        let unit = |path: &PathBuf| {
            let name = path
                .file_stem()
                .unwrap_or_default()
                .to_string_lossy()
                .into_owned();
            if file_kind::of(path)? == FileKind::CatalogueEntry {
                return self.of_sheet(name, &datasheet::read(path)?);
            }
            let file = inputs::model(path, context)?;
            Ok(self.unit(
                name,
                &file,
                inputs::at_rate(path, &file.model, self.scenario.imu.rate_hz, context)?,
            ))
        };
        paths.iter().map(unit).collect()
    }

    fn of_sheet(&self, name: String, sheet: &Datasheet) -> Result<CatalogueUnit> {
        let file = sheet
            .model_file(self.scenario.imu.rate_hz)
            .refuse_within(&name)?
            .file;
        Ok(self.unit(name, &file, file.model.clone()))
    }
}

// Limits, the places of an outage, and what all answers share: curves of drift, doubts.

/// Lengths of an outage on the curves of units (s).
const CURVE_S: [u32; 7] = [1, 3, 10, 30, 60, 120, 300];
/// Longest outage that is examined (s).
const LONGEST_S: f64 = 600.0;
/// Advice for confirming a figure of the covariance analysis.
const CONFIRM: &str = "confirm with nav-sim run --method both";
/// Warns of errors that are beyond linear theory.
fn note_beyond(place: &str, document: &mut Document) {
    let text = format!("beyond linear theory {place}: {CONFIRM}");
    document.note(Importance::Warning, text);
}

/// Places where an outage was tried: `541 starts tried, 300 to 840 s`, or `from 300 s on`.
fn starts(outages: &[Outage]) -> String {
    let count = outages.len();
    let [first, last] = [&outages[0], &outages[count - 1]].map(|o| seconds(o.start_s));
    match count {
        1 => format!("from {first} s on"),
        _ => format!("{count} starts, {first} to {last} s"),
    }
}

/// `p95_m 4.87 at the end of outage 300–360 s`
fn in_words(worst: &HardestLimit, outages: &[Outage]) -> String {
    let outage = outages.get(worst.place).unwrap_or(&outages[0]);
    let place = window(outage.start_s, outage.end_s);
    format!(
        "{} {} at the end of outage {place}",
        worst.limit.quantity,
        readable(worst.value)
    )
}

impl Requirements {
    /// `p95_m ≤ 5 after an outage of 60 s (the worst of 541 starts tried, 300 to 840 s)`
    fn in_words(&self, outages: &[Outage]) -> String {
        let length = seconds(outages[0].end_s - outages[0].start_s);
        let worst = if outages.len() > 1 {
            "the worst of "
        } else {
            ""
        };
        format!(
            "{} after an outage of {length} s ({worst}{})",
            self.limits_in_words(),
            starts(outages)
        )
    }

    fn limits_in_words(&self) -> String {
        let word = |l: &Limit| format!("{} ≤ {}", l.quantity, readable(l.most));
        self.limits.iter().map(word).collect::<Vec<_>>().join(", ")
    }
}

/// A quantity and its unit, for axes and heads.
const fn quantity_in_words(quantity: LimitQuantity) -> &'static str {
    match quantity {
        LimitQuantity::P50 => "horizontal error, median (m)",
        LimitQuantity::P95 => "horizontal error, 95 % quantile (m)",
        LimitQuantity::Rmse => "horizontal error, RMSE (m)",
        LimitQuantity::Roll => "roll, RMSE (°)",
        LimitQuantity::Pitch => "pitch, RMSE (°)",
        LimitQuantity::Yaw => "yaw, RMSE (°)",
    }
}

// The IMU that a limit needs.

fn bound(which: usize, found: &Bound) -> Value {
    match found {
        Bound::AtMost(value) => json!(ImuParameters::in_datasheets(which, *value)),
        Bound::Any => json!("any"),
        Bound::Never => Value::Null,
    }
}

// Which IMU a limit on the errors after an outage needs, what a given one makes of it, and a ranking.

/// The outage that is requested.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum OutageRequest {
    /// One of this length (s), from every second on.
    Length(f64),
    /// This one.
    Window(Outage),
    /// The longest within the limits.
    Longest,
}

impl OutageRequest {
    /// Shortest length (s).
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

/// Requirements on an IMU: limits, outage, trajectory.
#[derive(Debug)]
struct Requirements {
    /// Receiver, start and rate.
    scenario: Scenario,
    /// The reference.
    trajectory: Trajectory,
    track: Track,
    /// Limits of the errors at the outage's end.
    limits: Vec<Limit>,
    ask: OutageRequest,
    first_s: f64,
}

impl Requirements {
    /// `first_s`: the earliest start of an outage of which only the length is given (none: 300 s, less where the
    /// trajectory is short).
    ///
    /// # Errors
    /// When the outage does not lie on the trajectory.
    fn new(
        scenario: Scenario,
        trajectory: Trajectory,
        limits: Vec<Limit>,
        ask: OutageRequest,
        first_s: Option<f64>,
    ) -> Result<Self, Failure> {
        let span_s = trajectory.span_s();
        let (lasts_s, length_s) = (span_s.1 - span_s.0, ask.length_s());
        let settled_s = span_s.0 + SETTLED_S.min(0.5 * (lasts_s - length_s)).max(0.0);
        let earlier = first_s.map_or("", |_| ", or an earlier --start");
        let first_s = first_s.unwrap_or(settled_s);
        let begins_s = match ask {
            OutageRequest::Window(outage) => outage.start_s,
            _ => first_s,
        };
        if begins_s < span_s.0 || begins_s + length_s > span_s.1 {
            return refused(
                format!(
                    "an outage of {length_s} s from {begins_s} s is not on the trajectory, which lasts from {} to {} s",
                    span_s.0, span_s.1
                ),
                format!("a shorter --outage{earlier}"),
            );
        }
        if let OutageRequest::Window(outage) = ask {
            let asked = Scenario {
                outage: Some(vec![outage]),
                ..scenario.clone()
            };
            // as `run` does one that withholds no fix
            asked.outages_on(span_s, 0)?;
        }
        let track = OutagePlacements::track(&scenario, &trajectory).map_err(Failure::input)?;
        Ok(Self {
            scenario,
            trajectory,
            track,
            limits,
            ask,
            first_s,
        })
    }

    /// The IMU that is needed.
    ///
    /// # Errors
    /// When no IMU keeps the limits, or trajectory and rates do not fit together.
    fn required_imu(&self) -> Result<PlainAnswer, RequireError> {
        let outages = self.outages();
        let course = self.course(&outages);
        let scenario = &self.with_stated_turn_on();
        let need = ImuSearch {
            course: &course,
            scenario,
            limits: &self.limits,
            t_corr_s: CORRELATION_TIME_S,
        };
        let (imu, places) = need.allocated()?;
        let model = imu.model(self.scenario.imu.rate_hz);
        let worst =
            HardestLimit::of(&self.limits, &course.drifts(scenario, &model)?).expect("limits");
        let turn_on = |sensor| scenario.imu.turn_on_bias(sensor).unwrap_or(0.0);
        let [accel, gyro] = Sensor::ALL.map(turn_on);
        let biases = match [accel, gyro] {
            [0.0, 0.0] => "without turn-on bias ([imu] of --scenario states one)".to_owned(),
            biases => {
                let [accel, gyro] = biases.map(readable);
                format!("with turn-on biases of {accel} m/s² (accel) and {gyro} rad/s (gyro)")
            }
        };
        let beyond_linear = self.beyond_linear(scenario, &model, outages[worst.place])?;
        let question = self.in_words(&outages);
        let lines = [
            format!("required for {question}"),
            format!("an IMU {biases}"),
            format!("hardest: {}", in_words(&worst, &outages)),
        ];
        let mut document = Document::new("The required IMU", Tone::Good, lines);
        if let Some(Outage { start_s, end_s }) = beyond_linear {
            note_beyond(
                &format!("in outage {}", window(start_s, end_s)),
                &mut document,
            );
        }
        let mut file = ModelFile::new(model);
        let mut provenance = known(json!({
            "program": PROGRAM,
            "made_by": "require",
            "label": "a requirement, not a calibration",
            "question": question,
            "turn_on_bias": biases,
        }));
        let mut figures = Vec::new();
        for (i, name) in ImuParameters::NAMES.into_iter().enumerate() {
            let allocated = ImuParameters::in_datasheets(i, imu.values[i]);
            provenance.insert(name.to_owned(), allocated.into());
            figures.push(json!({
                "figure": name,
                "allocated": allocated,
                "alone": bound(i, &need.limit_with_others_perfect(&imu, i, &places)?),
                "others_10_times_better": bound(i, &need.limit_of(&imu, i, 0.1, &places)?),
            }));
        }
        file.provenance = Some(provenance);
        file.turn_on = self.stated_turn_on();
        let json = merged([
            json!({
                "schema_version": 1,
                "question": self.question(&outages),
                "t_corr_s": imu.t_corr_s,
                "turn_on_bias": { "accel_m_s2": accel, "gyro_rad_s": gyro },
                "figures": figures,
                "beyond_linear": beyond_linear,
            }),
            json!(worst),
        ]);
        document.section("Largest figures");
        document.text("Only error: the IMU has no other. Others 10 × better: every other figure ten times smaller.");
        let columns = [
            ("figure", "figure"),
            ("equal variance shares", "allocated"),
            ("only error", "alone"),
            ("others 10 × better", "others_10_times_better"),
        ];
        document.table(Table::of(&json, "/figures/*", &columns));
        Ok(PlainAnswer::new(json, document).with([("", model_file::to_toml(&file))]))
    }

    /// The scenario with a filter that expects the turn-on biases that `[imu]` states, as it expects those of a model file.
    fn with_stated_turn_on(&self) -> Scenario {
        let mut scenario = self.scenario.clone();
        let (stated, silent) = (self.stated_turn_on(), Context::default());
        inputs::expect_turn_on(&mut scenario.initial, stated, Path::new(""), &silent);
        scenario
    }

    fn stated_turn_on(&self) -> Option<TurnOn> {
        let sigma = |sensor| Some([self.scenario.imu.turn_on_bias(sensor)?; 3]);
        let stated = TurnOn {
            accel_m_s2: sigma(Sensor::Accel),
            gyro_rad_s: sigma(Sensor::Gyro),
        };
        (stated != TurnOn::default()).then_some(stated)
    }

    /// What every IMU along this track is judged with: the places of an outage, each as long as the trajectory allows, and the
    /// hardest limit of an IMU without errors, none where the longest outage is requested.
    fn prepared(&self) -> Result<(OutagePlacements<'_>, Option<HardestLimit>), RequireError> {
        let asked = (self.ask != OutageRequest::Longest).then(|| self.course(&self.outages()));
        let without = |course| worst_without_imu_errors(&course, &self.scenario, &self.limits);
        Ok((
            self.course(&self.long_outages()),
            asked.map(without).transpose()?,
        ))
    }

    /// Errors after outages of growing length, at the places that the outage requested has, each as far as the trajectory
    /// goes; the longest outage within the limits; the hardest limit after the outage requested, none where no place has one
    /// of that length.
    fn bridged(
        &self,
        long: &OutagePlacements<'_>,
        scenario: &Scenario,
        model: &Model,
    ) -> Result<OutageCurves, RequireError> {
        let curves = long.curves(scenario, model)?;
        let longest = self.longest_of(long, scenario, model, &curves)?;
        let length_s = self.length_of(&longest);
        let mut ends = after(&curves, length_s);
        if ends.is_empty() && length_s > 0.0 {
            // The curves need not have the length that is asked for.
            let has_room = |outage: &&Outage| outage.end_s - outage.start_s > length_s - SAME_S;
            let places = long.outages().iter().filter(has_room);
            let places: Vec<Outage> = places.map(|outage| cut(outage, length_s)).collect();
            ends = long.drifts_in(&places, scenario, model)?;
        }
        let worst = HardestLimit::of(&self.limits, &ends);
        Ok((curves, longest, worst))
    }

    /// The length asked for, or the longest within the limits (s).
    fn length_of(&self, longest: &LongestOutage) -> f64 {
        match self.ask {
            OutageRequest::Longest => longest.length_s(),
            ask => ask.length_s(),
        }
    }

    /// Judges a model against the limits. `scenario` is that of the unit, with its turn-on biases.
    ///
    /// # Errors
    /// When the model has no filter.
    fn judge_model(
        &self,
        long: &OutagePlacements<'_>,
        without_imu_errors: Option<HardestLimit>,
        scenario: &Scenario,
        model: &Model,
    ) -> Result<LimitResult, RequireError> {
        let (curves, outage, worst) = self.bridged(long, scenario, model)?;
        let length_s = self.length_of(&outage);
        // of one set of starts: with fewer starts for longer outages the worst of them would fall
        let lasts = |length_s: &u32| !after(&curves, f64::from(*length_s)).is_empty();
        let longest_s = f64::from(CURVE_S.into_iter().rev().find(lasts).unwrap_or(0));
        let is_long =
            |curve: &&Vec<Drift>| curve.last().is_some_and(|d| d.after_s > longest_s - 0.5);
        let common: Vec<_> = curves.iter().filter(is_long).cloned().collect();
        let of_limit = |Limit { quantity, .. }: &Limit| {
            let point = |outage_s: u32| {
                let largest = Drift::largest(&after(&common, f64::from(outage_s)), *quantity);
                json!({ "outage_s": outage_s, "value": largest.map(|(_, x)| x) })
            };
            json!({ "quantity": quantity, "points": CURVE_S.map(point) })
        };
        let shown = worst.map(|worst| cut(&long.outages()[worst.place], length_s));
        let margins = worst
            .zip(without_imu_errors)
            .map(|(worst, without)| Margins::new(worst, without));
        let beyond_linear = shown.map(|outage| self.beyond_linear(scenario, model, outage));
        Ok(LimitResult {
            curves: self.limits.iter().map(of_limit).collect(),
            outage,
            beyond_linear: beyond_linear.transpose()?.flatten(),
            margins,
        })
    }

    /// The limits without aiding, with what every car has, and with its wheel.
    ///
    /// # Errors
    /// When the model has no filter.
    fn aidings(&self, scenario: &Scenario, model: &Model) -> Result<Value, RequireError> {
        let all = [
            ("none", AidingSettings::default()),
            ("nhc", AidingSettings::car()),
            ("nhc, odometer", AidingSettings::car_with_odometer()),
        ];
        let aided = |(name, aiding): (&str, AidingSettings)| {
            let scenario = Scenario {
                aiding,
                ..scenario.clone()
            };
            let places = self.long_outages();
            let long = OutagePlacements::new(&scenario, &self.trajectory, &places)?;
            let (_, outage, worst) = self.bridged(&long, &scenario, model)?;
            // the hardest limit: none where no place has an outage of that length
            Ok(merged([
                json!({ "aiding": name, "outage": outage }),
                json!(worst),
            ]))
        };
        let aided: Result<Vec<Value>, RequireError> = all.into_par_iter().map(aided).collect();
        Ok(aided?.into())
    }

    /// Outage whose errors are beyond linear theory by the criterion of `run`, if any.
    fn beyond_linear(
        &self,
        scenario: &Scenario,
        model: &Model,
        outage: Outage,
    ) -> Result<Option<Outage>, RequireError> {
        let (scenario, outages) = (scenario.with_full_noise(), [outage]);
        let track = self.track.with_outages(&outages);
        let expected = ExpectedRun::along(
            &track,
            &scenario.experiment(&self.trajectory, Truth::Model(model), &[], &outages, 0),
            &scenario.filter_model(model, &outages, &track)?,
            model,
        );
        Ok(expected
            .is_some_and(|expected| expected.summary.outages[0].beyond_linear)
            .then_some(outage))
    }

    /// Units whose figures are all stated, the best first, then the others by name.
    ///
    /// # Errors
    /// When a model has no filter, with its name, or the longest outage is requested.
    fn ranked(&self, units: &[CatalogueUnit]) -> Result<PlainAnswer> {
        let (long, without) = self.prepared().map_err(Failure::input)?;
        let ranked = |unit: &CatalogueUnit| {
            let judged = self.judge_model(&long, without, &unit.scenario, &unit.model);
            let mut judgement = judged.refuse_within(&unit.name)?;
            let is_complete = unit.not_stated.is_empty();
            let mut kept = "not met";
            if let Some(margins) = judgement.margins.as_mut().filter(|margins| margins.met) {
                (kept, margins.met) = (if is_complete { "met" } else { "open" }, is_complete);
            }
            let own = json!({
                "unit": unit.name,
                "kept": kept,
                "not_stated": unit.not_stated,
                "missing": missing(&unit.not_stated),
            });
            let margins = judgement.margins.as_ref();
            let margin = margins.map_or(0.0, |margins| margins.worst.margin());
            Ok((margin, merged([own, json!(judgement)])))
        };
        let ranked: Vec<Result<_>> = units.par_iter().map(ranked).collect();
        let ranked = ranked.into_iter().collect::<Result<Vec<_>>>()?;
        let mut units: Vec<_> = units.iter().zip(ranked).collect();
        units.sort_by(|(a, (margin, _)), (b, (other, _))| {
            match [a, b].map(|unit| unit.not_stated.is_empty()) {
                [true, true] => other.total_cmp(margin),
                [false, false] => a.name.cmp(&b.name),
                [a, b] => b.cmp(&a),
            }
        });
        let open = units
            .iter()
            .filter(|(unit, _)| !unit.not_stated.is_empty())
            .count();
        let rows: Vec<Value> = units.into_iter().map(|(_, (_, row))| row).collect();
        let named = |is: &dyn Fn(&Value) -> bool| -> Vec<&str> {
            let rows = rows.iter().filter(|row| is(row));
            rows.filter_map(|row| row["unit"].as_str()).collect()
        };
        let (met, outages) = (named(&|row| row["kept"] == "met"), self.outages());
        let answer = met.first().map_or(NONE.to_owned(), |best| {
            let count = met.len();
            format!("{best} is the best of {count} units that keep the limit")
        });
        let mut lines = vec![answer, format!("asked: {}", self.in_words(&outages))];
        if open > 0 {
            lines.push(format!(
                "{} not ranked: data sheets lack figures (--verbose lists them)",
                counted(open, "unit")
            ));
        }
        let tone = Tone::from(!met.is_empty());
        let mut document = Document::new("IMUs against a limit", tone, lines);
        let beyond = named(&|row| !row["beyond_linear"].is_null());
        if !beyond.is_empty() {
            note_beyond(&beyond.join(", "), &mut document);
        }
        let unmet = met.is_empty().then(|| Failure::bound(NONE));
        let quantity = quantity_in_words(self.limits[0].quantity);
        let columns = format!(
            "1 s … 300 s: {quantity} after such an outage, at starts that allow all; bridges: longest outage within the limits"
        );
        document.note(Importance::Remark, columns);
        let question = self.question(&outages);
        let json = json!({ "schema_version": 1, "question": question, "units": rows });
        document.section("Ranking");
        let columns = [
            ("unit", "unit"),
            ("limit", "kept"),
            ("bridges", "outage/text"),
            ("{outage_s} s", "curves/0/points/*/value"),
        ];
        document.table(Table::of(&json, "/units/*", &columns));
        document.section("Figures that are missing");
        let columns = [("unit", "unit"), ("not stated", "missing")];
        document.table(Table::of(&json, "/units/*", &columns));
        document.text(RULE);
        Ok(PlainAnswer::new(json, document).with_unmet(unmet))
    }

    /// The longest outage of which all places are within the limits, in whole seconds. The first place holds the longest.
    fn longest_of(
        &self,
        long: &OutagePlacements<'_>,
        scenario: &Scenario,
        model: &Model,
        curves: &[Vec<Drift>],
    ) -> Result<LongestOutage, FilterModelError> {
        let is_missed = |drift: &Drift| self.limits.iter().any(|l| drift.exceeds(l));
        let bracket = |(outage, curve): (&Outage, &Vec<Drift>)| {
            let missed = curve.iter().position(is_missed)?;
            let kept_s = missed
                .checked_sub(1)
                .map_or(0.0, |kept| curve[kept].after_s);
            Some((*outage, kept_s, curve[missed].after_s))
        };
        let mut brackets: Vec<_> = long
            .outages()
            .iter()
            .zip(curves)
            .filter_map(bracket)
            .collect();
        let least = |of: fn(&(Outage, f64, f64)) -> f64| {
            brackets.iter().map(of).fold(f64::INFINITY, f64::min)
        };
        let [mut kept_s, mut missed_s] = [least(|b| b.1), least(|b| b.2)];
        brackets.retain(|(_, kept_s, _)| *kept_s < missed_s);
        let places: Vec<Outage> = brackets.into_iter().map(|(outage, ..)| outage).collect();
        // The curves of long outages take long steps.
        while missed_s - kept_s > 1.0 + SAME_S {
            let length_s = kept_s + (0.5 * (missed_s - kept_s)).floor().max(1.0);
            let tried: Vec<Outage> = places.iter().map(|o| cut(o, length_s)).collect();
            let drifts = long.drifts_in(&tried, scenario, model)?;
            let is_kept = !drifts.iter().any(is_missed);
            *(if is_kept { &mut kept_s } else { &mut missed_s }) = length_s;
        }
        let longest_s = kept_s.is_finite().then_some(kept_s);
        let lasts_s = curves
            .first()
            .and_then(|curve| curve.last())
            .map(|d| d.after_s);
        let at_least_s = lasts_s.unwrap_or(0.0);
        let at_least = || {
            let rest = if at_least_s < LONGEST_S {
                "to the end of the trajectory"
            } else {
                "longer ones are not tried"
            };
            format!("≥ {} s, {rest}", seconds(at_least_s))
        };
        let text = match longest_s {
            // curves begin with the first second: what is not kept then may be kept for a part of it
            Some(s) if s < 1.0 => "less than 1 s".to_owned(),
            Some(s) => format!("{} s", seconds(s)),
            None => at_least(),
        };
        Ok(LongestOutage {
            longest_s,
            at_least_s: longest_s.is_none().then_some(at_least_s),
            text,
        })
    }

    /// A unit whose turn-on biases are there and expected; `model` is at the rate of the IMU.
    fn unit(&self, name: String, file: &ModelFile, model: Model) -> CatalogueUnit {
        let mut scenario = self.scenario.clone();
        let own = (Path::new(&name), file);
        inputs::turn_on(&mut scenario, own, Some(own), &Context::default());
        CatalogueUnit {
            name,
            model,
            scenario,
            not_stated: file.not_stated(),
        }
    }

    /// The places of the outage; those of one second where the longest is sought.
    fn outages(&self) -> Vec<Outage> {
        match self.ask {
            OutageRequest::Window(outage) => vec![outage],
            ask => self.places(ask.length_s(), ask.length_s()),
        }
    }

    /// An outage of this length at all its beginnings; fewer where outages of `mean_s` would together last too long.
    fn places(&self, length_s: f64, mean_s: f64) -> Vec<Outage> {
        let end_s = self.trajectory.end_s();
        let seconds = (end_s - length_s - self.first_s).floor().max(0.0) + 1.0;
        let count = seconds.min((TOGETHER_S / mean_s).max(BEGINNINGS));
        evenly(
            self.trajectory.span_s(),
            self.first_s,
            length_s,
            count as u32,
        )
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
            OutageRequest::Longest => self.places(self.ask.length_s(), self.mean_length_s()),
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

    fn course(&self, outages: &[Outage]) -> OutagePlacements<'_> {
        OutagePlacements::along(&self.track, &self.trajectory, outages)
    }

    fn question(&self, outages: &[Outage]) -> Value {
        json!({ "limits": self.limits, "outages": outages })
    }
}

/// A unit to be ranked.
struct CatalogueUnit {
    /// Its name.
    name: String,
    /// At the rate of the IMU.
    model: Model,
    /// The scenario with its turn-on biases.
    scenario: Scenario,
    /// Figures that its datasheet does not state, and the model therefore has not.
    not_stated: Vec<String>,
}

/// Times come from samples: within a millisecond they are the same (s).
const SAME_S: f64 = 1e-3;

/// The first part of an outage, of this length (s), or all of a shorter one.
fn cut(outage: &Outage, length_s: f64) -> Outage {
    Outage {
        end_s: outage.end_s.min(outage.start_s + length_s),
        ..*outage
    }
}

/// The errors after a time without fixes at every place where the outage lasts so long.
fn after(curves: &[Vec<Drift>], length_s: f64) -> Vec<Drift> {
    let drift_of_curve = |curve: &Vec<Drift>| {
        curve
            .get(curve.partition_point(|d| d.after_s < length_s - SAME_S))
            .filter(|d| d.after_s < length_s + SAME_S)
            .copied()
    };
    curves.iter().filter_map(drift_of_curve).collect()
}

// A given IMU against its limits.

/// The longest outage that keeps the limits.
#[derive(Debug, Serialize)]
struct LongestOutage {
    /// Its length (s).
    #[serde(skip_serializing_if = "Option::is_none")]
    longest_s: Option<f64>,
    /// All that was looked at (s).
    #[serde(skip_serializing_if = "Option::is_none")]
    at_least_s: Option<f64>,
    text: String,
}

impl LongestOutage {
    /// Length that is bridged (s).
    fn length_s(&self) -> f64 {
        self.longest_s.or(self.at_least_s).unwrap_or_default()
    }
}

/// Curves of errors, the longest outage within the limits, and the hardest limit.
type OutageCurves = (Vec<Vec<Drift>>, LongestOutage, Option<HardestLimit>);

/// Result of a model against the limits.
#[derive(Debug, Serialize)]
struct LimitResult {
    outage: LongestOutage,
    /// The quantity of each limit, at its worst place, after outages of growing length: of the places that allow them all.
    curves: Vec<Value>,
    /// The outage of the answer, where it is beyond linear theory.
    beyond_linear: Option<Outage>,
    /// After the outage that was asked for; none where the longest is sought.
    #[serde(flatten)]
    margins: Option<Margins>,
}

// Units of a catalogue against a limit.

/// Assumptions of a ranking.
const RULE: &str = "Missing figures count as zero: open means that the limit would be kept then. Turn-on bias is the repeatability between power-ons, or that of the grade; an initial zero offset counts as removed. Figures without a sensor are missing for both.";

/// `bias, accel turn-on`: figures that both sensors lack are named once.
fn missing(not_stated: &[String]) -> String {
    let mut words = not_stated.join(", ").replace('_', "-");
    for figure in ["noise", "bias", "turn-on", "turn-on by grade"] {
        words = words.replace(&format!("accel {figure}, gyro {figure}"), figure);
    }
    words
}

#[cfg(test)]
#[path = "require_tests.rs"]
mod tests;
