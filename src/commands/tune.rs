//! `nav-sim tune`: the smallest factors on the variances of a noise model that make its filter consistent with other truths.

use crate::app::inputs::{self, SettingsArgs};
use crate::app::{
    Command, Context, Failure, Input, Inputs, OutputKind, PlainAnswer, Result, refused,
};
use crate::io::model_file::{self, ModelFile, PROGRAM, known};
use crate::parse;
use crate::report::in_order;
use nav_sim_document::{Document, Table, Tone, readable, seconds, short_names};
use nav_sim_navigation::ekf::{FilterModelError, FilterStates};
use nav_sim_navigation::metrics::{PerState, VerdictKind};
use nav_sim_navigation::scenario::Scenario;
use nav_sim_navigation::sensors::defects::ImuSettings;
use nav_sim_navigation::sensors::outage::Outage;
use nav_sim_navigation::simulation::lincov::{
    ConsistencyCriterion, Factor, FilterConsistency, Track, TrueErrors, TuningProblem,
    aiding_factor, drive, scaled,
};
use nav_sim_navigation::simulation::{NEES_DOF, REPORTED_NAMES, TOLERANCE};
use nav_sim_signal::imu::Sensor;
use nav_sim_signal::noise::Model;
use serde_json::{Value, json};
use std::path::PathBuf;

/// Find the smallest factors on MODEL that make its filter consistent for another truth
///
/// Factors multiply variances of all processes but quantization noise, which is in no filter. They are found by linear
/// covariance analysis along the trajectory. Where no factor makes the filter consistent, the exit code is 3 and no model
/// is written.
#[derive(clap::Args, Debug, Clone)]
pub struct Tune {
    /// Noise model to be tuned
    model: PathBuf,
    /// Noise models that may make the errors, such as those of single recordings [default: MODEL, with the errors in SCENARIO]
    #[arg(id = "truth", long = "truth", value_name = "MODEL2", num_args = 1..)]
    truths: Vec<PathBuf>,
    /// Trajectory: motion profile (.toml) or table (.csv) [default: a built-in drive with outages of that length]
    #[arg(long, value_name = "FILE")]
    pub trajectory: Option<PathBuf>,
    /// Outages, receiver, start, IMU rate.
    #[command(flatten)]
    settings: SettingsArgs,
    /// Meaning of consistent: worst, no error of any truth exceeds what the filter states; mean, the NEES is right on average
    #[arg(id = "for", long = "for", value_name = "AIM", value_parser = parse::one_of::<ConsistencyCriterion>(&ConsistencyCriterion::NAMES), default_value_t)]
    aim: ConsistencyCriterion,
    /// Filter to tune: full (a bias state for each process), 15 (one bias per axis) or 21 (and a scale factor per axis);
    /// these two take longer; the filter that `run` makes by default is assessed too
    #[arg(long, value_name = "STATES", default_value = "full")]
    filter: FilterStates,
}

/// Help where fixes are too rare to reduce a model.
const RARE_FIXES: &str =
    "raise it: the verdict includes the 15-state filter, whatever --filter tunes";

/// Longest schedule of outages that is examined where no trajectory says how long (s).
const DAY_S: f64 = 86_400.0;

impl Command for Tune {
    type Answer = PlainAnswer;
    const NAME: &'static str = "tune";
    const OUT: OutputKind = OutputKind::File {
        name: "tuned.toml",
        help: "Model file to write",
    };

    fn inputs(&self, given: Inputs) -> Result<Inputs> {
        self.refuse_recordings().map(|()| given)
    }

    fn run(&self, context: &Context<'_>) -> Result<PlainAnswer> {
        let mut scenario = self.settings.checked()?;
        if self.truths.is_empty() && scenario.has_no_errors() {
            return refused(
                "no truth: neither --truth nor errors in the scenario",
                "give models (--truth OTHER.toml, one per recording), or a scenario with errors",
            );
        }
        let file = inputs::model(&self.model, context)?;
        let model = inputs::at_rate(&self.model, &file.model, scenario.imu.rate_hz, context)?;
        inputs::expect_turn_on(&mut scenario.initial, file.turn_on, &self.model, context);
        let truths = self.true_errors(&scenario, context)?;
        let (track, outages) = self.track(&scenario, &model, context)?;
        let found = self.tune(&scenario, &model, &truths, &track, &outages);
        let settings = self.settings.file.scenario.as_deref();
        let found = found.map_err(|e| inputs::no_filter(&e, &self.model, settings, RARE_FIXES))?;
        let goal = format!("{} of truths", self.aim);
        let fault = found.fault();
        let tuned = fault.is_none().then(|| {
            let tuned = tuned(&file, &found.factors, &goal, context.inputs());
            ("", model_file::to_toml(&tuned))
        });
        let unmet = fault.map(|fault| {
            let model = self.model.display();
            let message = format!("{model}: {fault}; no tuned model is written");
            Failure::bound(message).hint(found.remedy())
        });
        Ok(PlainAnswer::new(found.json(), found.document())
            .with(tuned)
            .with_unmet(unmet))
    }
}

impl Tune {
    /// A directory or a table holds samples: a truth is a model.
    fn refuse_recordings(&self) -> Result<()> {
        let is_samples = |p: &&PathBuf| {
            p.is_dir()
                || p.extension()
                    .is_some_and(|e| e == "csv" || e == "npy" || e == "gz")
        };
        match self.truths.iter().find(is_samples) {
            None => Ok(()),
            Some(path) => refused(
                format!("--truth {}: recordings, not a model", path.display()),
                "calibrate each: nav-sim calibrate FILE --estimator gmwm -o FILE.toml",
            ),
        }
    }

    /// Candidate truths at the rate of the IMU: noise, turn-on bias, and the scenario's errors of
    /// the true IMU and receiver.
    fn true_errors(&self, scenario: &Scenario, context: &Context<'_>) -> Result<Vec<TrueErrors>> {
        let truth = |path: &PathBuf| {
            let file = inputs::model(path, context)?;
            let model = inputs::at_rate(path, &file.model, scenario.imu.rate_hz, context)?;
            let (mut imu, gnss) = (scenario.imu.clone(), scenario.gnss.clone());
            inputs::make_turn_on(&mut imu, file.turn_on, path, context);
            let aiding = scenario.aiding.clone();
            Ok::<_, Failure>(TrueErrors {
                model,
                imu,
                gnss,
                aiding,
            })
        };
        let truths = self.paths().iter().map(truth).collect::<Result<Vec<_>>>()?;
        let unexpected = |truth: &TrueErrors| {
            let imu = truth.imu.clone();
            let scenario = Scenario {
                imu,
                ..scenario.clone()
            };
            scenario.unexpected()
        };
        let doubts: Vec<String> = truths.iter().flat_map(unexpected).collect();
        context.warn_each(in_order(doubts.iter().map(String::as_str)));
        Ok(truths)
    }

    /// The models that may be true; without --truth MODEL itself, beside what the scenario says is wrong.
    fn paths(&self) -> &[PathBuf] {
        if self.truths.is_empty() {
            std::slice::from_ref(&self.model)
        } else {
            &self.truths
        }
    }

    /// The way of the analysis with its outages.
    fn track(
        &self,
        scenario: &Scenario,
        model: &Model,
        context: &Context<'_>,
    ) -> Result<(Track, Vec<Outage>)> {
        let seed = context.seed_or(scenario.run.seed);
        let Some(path) = &self.trajectory else {
            if !scenario.aiding.is_none()
                || scenario.baro.is_some()
                || scenario.imu.temperature.is_some()
            {
                return refused(
                    "aiding, barometer and temperature profile need a trajectory",
                    "give a trajectory with --trajectory",
                );
            }
            let outages = inputs::placed(scenario, (0.0, DAY_S), seed, context)?;
            let lengths: Vec<f64> = outages.iter().map(|o| o.end_s - o.start_s).collect();
            let Scenario {
                imu,
                gnss,
                initial,
                filter,
                ..
            } = scenario;
            let track = drive(model, imu, gnss, initial, filter.gravity, &lengths);
            let track = track.ok_or_else(|| {
                Failure::input("no built-in drive for this receiver")
                    .hint("give a trajectory with --trajectory")
            })?;
            return Ok((track, outages));
        };
        let trajectory = inputs::trajectory(path, context)?;
        let outages = inputs::placed(scenario, trajectory.span_s(), seed, context)?;
        let track = scenario
            .track(&trajectory, model, &outages)
            .map_err(Failure::input)?;
        Ok((track, outages))
    }
}

impl Tune {
    /// The factors, and the filter before and after them. `given` has the filter that `run` would have.
    fn tune(
        &self,
        given: &Scenario,
        model: &Model,
        truths: &[TrueErrors],
        track: &Track,
        outages: &[Outage],
    ) -> std::result::Result<TuneResult, FilterModelError> {
        let mut scenario = given.clone();
        match self.filter {
            // what goes with the filter of 21 states beside the model stays
            FilterStates::Full => scenario = scenario.with_full_noise(),
            reduced => scenario.filter.states = reduced,
        }
        let filter_of_run = given.filter.states;
        // What is wrong with the vehicle's own measurements no noise of the IMU stands for: their sigmas come first.
        let aiding = &given.aiding;
        let filter_model = scenario
            .with_full_noise()
            .filter_model(model, outages, track)?;
        let known = TrueErrors {
            aiding: aiding.clone(),
            ..TrueErrors::from(model.clone())
        };
        let aiding_sigmas = (!aiding.is_none())
            .then(|| aiding_factor(track, &filter_model, &known).unwrap_or(f64::NAN));
        let widened = aiding_sigmas
            .filter(|factor| *factor > 1.0)
            .map(|factor| track.with_aiding_sigmas(factor));
        let analysed = widened.as_ref().unwrap_or(track);
        let full = scenario.with_full_noise();
        let full = |model: &Model| full.filter_model(model, outages, analysed);
        let tuned = |model: &Model| scenario.filter_model(model, outages, analysed);
        let of_run = |model: &Model| given.filter_model(model, outages, analysed);
        let task = TuningProblem {
            model,
            truths,
            track: analysed,
            full: &full,
            filter: &tuned,
            aim: self.aim,
        };
        let factors = task.factors()?;
        let after = task.consistency(task.filter, &factors)?;
        Ok(TuneResult {
            filter: self.filter,
            filter_of_run,
            before: TuningProblem { track, ..task }.consistency(task.filter, &[])?,
            aiding_sigmas,
            after,
            of_run: (self.filter != filter_of_run)
                .then(|| task.consistency(&of_run, &factors))
                .transpose()?,
            consistency_of_matched: truths
                .iter()
                .all(|truth| truth.imu.without_states().next().is_none())
                .then(|| {
                    task.consistency_of_matched(|truth| {
                        with_true_imu_states(&scenario, &truth.imu).filter_model(
                            &truth.model,
                            outages,
                            analysed,
                        )
                    })
                })
                .transpose()?,
            factors,
            truths: self
                .paths()
                .iter()
                .map(|path| path.display().to_string())
                .collect(),
            aim: self.aim,
            without_factor: task.without_factor(),
        })
    }
}

/// The scenario with the filter that has states for what the true IMU is stated to have beside its noise.
fn with_true_imu_states(scenario: &Scenario, imu: &ImuSettings) -> Scenario {
    let mut knowing = scenario.with_full_noise();
    let initial = &mut knowing.initial;
    for (sensor, bias, scale) in [
        (
            Sensor::Accel,
            &mut initial.accel_bias_sigma_m_s2,
            &mut initial.accel_scale_sigma_ppm,
        ),
        (
            Sensor::Gyro,
            &mut initial.gyro_bias_sigma_rad_s,
            &mut initial.gyro_scale_sigma_ppm,
        ),
    ] {
        let (_, ppm) = imu.deviations(sensor);
        *bias = imu.turn_on_bias(sensor).or(*bias);
        *scale = Some(ppm).filter(|ppm| *ppm > 0.0).or(*scale);
    }
    knowing
}

/// The tuned model, and where it came from; `goal`: the aim and what was taken for true.
fn tuned(file: &ModelFile, factors: &[Factor], goal: &str, inputs: &[Input]) -> ModelFile {
    let provenance = known(json!({
        "program": PROGRAM,
        "made_by": "tune",
        "honest_for": goal,
        "factors": entries(factors),
        "inputs": inputs,
    }));
    let (missing, turn_on) = (file.missing.clone(), file.turn_on);
    ModelFile {
        missing,
        turn_on,
        provenance: Some(provenance),
        ..ModelFile::new(scaled(&file.model, factors))
    }
}

/// Horizontal RMSE over that of a filter that knows the truth, less 1, where the noise of one sensor was made to stand for
/// that of the other.
const ABSURD: f64 = 1.0;
/// Deviation of a factor from 1 that is not worth a word.
const UNCHANGED: f64 = 0.01;

/// Factors, and the filter before and after them.
#[derive(Debug, Clone)]
struct TuneResult {
    /// The filter that was tuned.
    filter: FilterStates,
    /// The filter that `run` makes of the model unless told otherwise.
    filter_of_run: FilterStates,
    /// The factors.
    factors: Vec<Factor>,
    /// The factor on the sigmas of the vehicle's own measurements, where there are any; NaN where none helps.
    aiding_sigmas: Option<f64>,
    /// The filter as it was.
    before: FilterConsistency,
    /// The tuned one.
    after: FilterConsistency,
    /// The tuned model in the filter that `run` makes of it, where that is another.
    of_run: Option<FilterConsistency>,
    /// A filter that knows the truth, each truth its own; none where there are errors of which no filter has states.
    consistency_of_matched: Option<FilterConsistency>,
    /// Names of the truths.
    truths: Vec<String>,
    /// Condition under which the filter counts as consistent.
    aim: ConsistencyCriterion,
    /// Sensors without noise that a factor could multiply, where a truth has some.
    without_factor: Vec<Sensor>,
}

/// Verdict of `run` on a filter, by its covariance analysis.
fn kind(found: &FilterConsistency) -> VerdictKind {
    match found.range {
        [_, largest] if largest > 1.0 + TOLERANCE => VerdictKind::Overconfident,
        [smallest, _] if smallest < 1.0 / (1.0 + TOLERANCE) => VerdictKind::Underconfident,
        _ => VerdictKind::Consistent,
    }
}

impl TuneResult {
    /// The factors and their cost, then the filters that they make.
    fn verdict(&self) -> Vec<String> {
        let name = filter_name(self.filter);
        let changed: Vec<&Factor> = self.factors.iter().filter(|f| is_changed(f)).collect();
        if let Some(unmet) = self.fault() {
            return vec![unmet, format!("at best, {}", described(&name, &self.after))];
        }
        let mut lines = match changed.as_slice() {
            [] => vec![format!(
                "no factor is needed: {}",
                described(&name, &self.after)
            )],
            changed => {
                let cost = self.cost(&self.after);
                let cost = if cost.is_finite() {
                    format!("; cost {:.1} % of horizontal RMSE", 100.0 * cost)
                } else {
                    String::new()
                };
                let [before, after] = [&self.before, &self.after].map(|found| readable(found.nees));
                let factors = factors_in_words(changed);
                let nees = format!("NEES {before} → {after} ({NEES_DOF} if right)");
                vec![
                    format!("{factors} (variance){cost}; {nees}"),
                    format!("tuned, {}", described(&name, &self.after)),
                ]
            }
        };
        self.of_aiding()
            .into_iter()
            .for_each(|line| lines.insert(0, line));
        if let Some(of_run) = &self.of_run {
            let name = format!("{}, the default of run,", filter_name(self.filter_of_run));
            lines.push(format!("tuned, {}", described(&name, of_run)));
        }
        lines
    }

    /// Factor that covers the errors of the vehicle's own measurements.
    fn of_aiding(&self) -> Option<String> {
        let factor = self.aiding_sigmas.filter(|factor| *factor != 1.0)?;
        Some(if factor.is_nan() {
            "no sigma of the aiding covers its errors: give the filter states for them".to_owned()
        } else {
            format!(
                "every sigma of [aiding] × {}, then of the model:",
                readable(factor)
            )
        })
    }

    /// Reason that the factors are of no use, if there is one.
    fn fault(&self) -> Option<String> {
        let is_overconfident = match self.aim {
            ConsistencyCriterion::Worst => self.after.largest.ratio > 1.0 + TOLERANCE,
            ConsistencyCriterion::Mean => {
                self.after.nees / NEES_DOF as f64 > (1.0 + TOLERANCE).powi(2)
            }
        };
        let is_at_limit = self.factors.iter().any(Factor::is_at_limit);
        let names: Vec<&str> = self
            .without_factor
            .iter()
            .map(|sensor| sensor.name())
            .collect();
        if !names.is_empty() && (is_overconfident || is_at_limit || self.cost(&self.after) > ABSURD)
        {
            let names = names.join(" and ");
            return Some(format!(
                "the model has no {names} noise to scale, the truth has some"
            ));
        }
        let limit = if is_at_limit {
            ": a factor is at its limit"
        } else {
            ""
        };
        let unmet = || format!("larger noise alone does not make this filter consistent{limit}");
        (is_overconfident || is_at_limit).then(unmet)
    }

    /// Advice where the factors are of no use.
    fn remedy(&self) -> &'static str {
        match self.aim {
            _ if !self.without_factor.is_empty() => {
                "give it the noise of its data sheet (nav-sim datasheet) or of the truth, and tune again"
            }
            ConsistencyCriterion::Mean => {
                "--for worst, other processes, or the turn-on bias and scale factors of the truth"
            }
            ConsistencyCriterion::Worst => {
                "other processes, or the turn-on bias and scale factors of the truth"
            }
        }
    }

    /// Horizontal RMSE at the outages' ends over that of a filter that knows the truth, less 1; NaN without one.
    fn cost(&self, found: &FilterConsistency) -> f64 {
        let square = |h: &FilterConsistency| h.horizontal_m().map(|x| x * x).sum::<f64>();
        (square(found)
            / self
                .consistency_of_matched
                .as_ref()
                .map_or(f64::NAN, square))
        .sqrt()
            - 1.0
    }

    fn filters(&self) -> impl Iterator<Item = (&'static str, &FilterConsistency)> {
        let tuned = [("untuned", &self.before), ("tuned", &self.after)].into_iter();
        let of_run = self.of_run.iter().map(|h| ("tuned, default of run", h));
        tuned.chain(of_run).chain(
            self.consistency_of_matched
                .iter()
                .map(|h| ("knows the truth", h)),
        )
    }

    /// The truth in which an error is largest.
    fn worst_truth(&self, found: &FilterConsistency) -> &str {
        &self.truths[found.largest.truth]
    }
}

impl TuneResult {
    fn json(&self) -> Value {
        let end = |(after_s, rmse): (&f64, &[f64; REPORTED_NAMES.len()])| {
            json!({
                "after_s": after_s,
                "rmse": PerState(*rmse),
                "horizontal_rmse_m": rmse[0].hypot(rmse[1]),
            })
        };
        let filter = |(filter, found): (&str, &FilterConsistency)| {
            json!({
                "filter": filter,
                "verdict": kind(found).name(),
                "place": self.place(found),
                "nees": found.nees,
                "largest_ratio": found.largest.ratio,
                "state": REPORTED_NAMES[found.largest.state],
                "truth": self.worst_truth(found),
                "outage_end": found.end_s.iter().zip(&found.rmse_end).map(end).collect::<Value>(),
            })
        };
        let mut file = json!({
            "schema_version": 1,
            "verdict": self.verdict().join("; "),
            "factors": entries(&self.factors),
            "truths": self.truths,
            "horizontal_rmse_cost": self.cost(&self.after),
            "filters": self.filters().map(filter).collect::<Value>(),
        });
        if let Some(factor) = self.aiding_sigmas {
            file["aiding_sigma_factor"] = json!(factor);
        }
        file
    }
}

/// Factors in files.
fn entries(factors: &[Factor]) -> Value {
    let entry = |factor: &Factor| {
        json!({
            "sensor": factor.sensor.name(),
            "on_variance": factor.on_variance,
            "on_sigma": factor.on_variance.sqrt(),
        })
    };
    factors.iter().map(entry).collect()
}

fn is_changed(factor: &Factor) -> bool {
    (factor.on_variance - 1.0).abs() >= UNCHANGED
}

/// `the full filter is overconfident: errors 0.95 to 1.31 × sigma`
fn described(name: &str, found: &FilterConsistency) -> String {
    let [smallest, largest] = found.range.map(readable);
    format!(
        "the {name} is {}: errors {smallest} to {largest} × sigma",
        kind(found)
    )
}

/// `filter of 15 states`
fn filter_name(states: FilterStates) -> String {
    if states == FilterStates::Full {
        "full filter".to_owned()
    } else {
        format!("filter of {states} states")
    }
}

/// `gyro × 4.02, accel × 1.59`
fn factors_in_words(changed: &[&Factor]) -> String {
    let word = |f: &&Factor| format!("{} × {}", f.sensor.name(), readable(f.on_variance));
    changed.iter().map(word).collect::<Vec<_>>().join(", ")
}

impl TuneResult {
    fn document(&self) -> Document {
        let found = kind(&self.after);
        let tone = match self.fault() {
            Some(_) => Tone::Bad,
            None if !self.factors.iter().any(is_changed) && found == VerdictKind::Consistent => {
                Tone::Good
            }
            None => Tone::Doubtful,
        };
        let json = self.json();
        let mut document = Document::new("Factors on a noise model", tone, self.verdict());
        let truths: Vec<&str> = self.truths.iter().map(String::as_str).collect();
        document.text(&format!("truths: {}", short_names(&truths).join(", ")));
        document.section("Filters");
        let nees = format!("NEES ({NEES_DOF})");
        let columns = [
            ("filter", "filter"),
            ("verdict", "verdict"),
            (nees.as_str(), "nees"),
            ("RMSE/sigma", "largest_ratio"),
            ("in", "place"),
            ("RMSE {after_s} s (m)", "outage_end/*/horizontal_rmse_m"),
        ];
        document.table(Table::of(&json, "/filters/*", &columns));
        document.text("RMSE/sigma: largest error over the stated one. RMSE: horizontal, at the end of an outage.");
        document.section("Factors");
        let columns = [
            ("sensor", "sensor"),
            ("factor on the variance", "on_variance"),
            ("on the standard deviation", "on_sigma"),
        ];
        document.table(Table::of(&json, "/factors/*", &columns));
        document
    }
}

impl TuneResult {
    /// State, time and truth of the largest error.
    fn place(&self, found: &FilterConsistency) -> String {
        let mut place = REPORTED_NAMES[found.largest.state].to_owned();
        match found.largest.outage {
            Some(outage) if found.end_s.len() > 1 => {
                place += &format!(" at {} s", seconds(found.end_s[outage]))
            }
            None if !found.end_s.is_empty() => place += " over the run",
            _ => {}
        }
        if self.truths.len() > 1 {
            format!("{place}, {}", self.worst_truth(found))
        } else {
            place
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nav_sim_navigation::simulation::lincov::WorstRatio;

    fn consistency(ratio: f64, nees: f64) -> FilterConsistency {
        FilterConsistency {
            nees,
            largest: WorstRatio {
                ratio,
                state: 8,
                outage: Some(0),
                truth: 0,
            },
            range: [0.95, ratio],
            end_s: vec![90.0],
            rmse_end: vec![[1.0; 9]],
        }
    }

    /// A factor of 4 makes the filter of 15 states consistent.
    fn tuned() -> TuneResult {
        TuneResult {
            aiding_sigmas: None,
            filter: FilterStates::Reduced15,
            filter_of_run: FilterStates::Reduced15,
            factors: vec![Factor {
                sensor: Sensor::Gyro,
                on_variance: 4.0,
            }],
            before: consistency(2.0, 30.0),
            after: consistency(1.0, 8.8),
            of_run: None,
            consistency_of_matched: Some(consistency(1.0, 9.0)),
            truths: vec!["truth.toml".to_owned()],
            aim: ConsistencyCriterion::Worst,
            without_factor: Vec::new(),
        }
    }

    /// The filter that was tuned is named, and the default of `run` beside it: a verdict on the full filter is not one on
    /// that of 15 states.
    #[test]
    fn the_verdict_has_factors_cost_and_both_filters() {
        assert_eq!(tuned().verdict().len(), 2);
        let full = TuneResult {
            filter: FilterStates::Full,
            of_run: Some(consistency(1.19, 9.51)),
            ..tuned()
        };
        let lines = [
            "gyro × 4.00 (variance); cost 0.0 % of horizontal RMSE; NEES 30.0 → 8.80 (9 if right)",
            "tuned, the full filter is consistent: errors 0.950 to 1.00 × sigma",
            "tuned, the filter of 15 states, the default of run, is overconfident: errors 0.950 to 1.19 × sigma",
        ];
        assert_eq!(full.verdict(), lines);
    }

    /// Never green where a filter is over- or underconfident.
    #[test]
    fn the_colour_is_that_of_the_worst_word() {
        let right = TuneResult {
            before: consistency(1.0, 9.0),
            after: consistency(1.0, 9.0),
            factors: Vec::new(),
            ..tuned()
        };
        assert_eq!(right.document().tone, Tone::Good);
        assert_eq!(tuned().document().tone, Tone::Doubtful);
        let mut under = right;
        (under.before.range, under.after.range) = ([0.8, 0.9], [0.8, 0.9]);
        let mut factor = tuned();
        factor.after.range[0] = 0.756;
        let filter = "the filter of 15 states is underconfident: errors";
        for (tuning, verdict) in [
            (
                under,
                format!("no factor is needed: {filter} 0.800 to 0.900 × sigma"),
            ),
            (factor, format!("tuned, {filter} 0.756 to 1.00 × sigma")),
        ] {
            let document = tuning.document();
            assert_eq!(document.tone, Tone::Doubtful);
            assert_eq!(document.verdict.last(), Some(&verdict));
        }
    }

    /// The place of the largest error: the outage where there are several, the truth where there are several.
    #[test]
    fn the_largest_error_has_a_place() {
        let mut tuned = tuned();
        let mut found = consistency(1.0, 8.8);
        assert_eq!(tuned.place(&found), "yaw_deg");
        found.end_s.push(300.0);
        assert_eq!(tuned.place(&found), "yaw_deg at 90 s");
        tuned.truths.push("other.toml".to_owned());
        (found.largest.truth, found.largest.outage) = (1, None);
        assert_eq!(tuned.place(&found), "yaw_deg over the run, other.toml");
    }

    /// Errors of 3 and 4 times those of a filter that knows the truth: √((9 + 16)/2) − 1 of cost.
    #[test]
    fn the_cost_is_the_root_mean_square_over_outages() {
        let ends = |scales: [f64; 2]| FilterConsistency {
            end_s: vec![90.0, 300.0],
            rmse_end: scales.map(|scale| [scale * 5.0; 9]).to_vec(),
            ..consistency(1.0, 9.0)
        };
        let tuned = TuneResult {
            consistency_of_matched: Some(ends([1.0, 1.0])),
            ..tuned()
        };
        assert!((tuned.cost(&ends([3.0, 4.0])) - (12.5_f64.sqrt() - 1.0)).abs() < 1e-12);
    }

    /// On average a filter is overconfident whose NEES is beyond the square of the allowed errors of one state; a sensor without
    /// noise is the reason where the filter is overconfident, or the cost is absurd, and none otherwise.
    #[test]
    fn a_verdict_that_is_not_met_has_its_reason() {
        let mut tuned = tuned();
        tuned.aim = ConsistencyCriterion::Mean;
        let bound = 9.0 * (1.0 + TOLERANCE).powi(2);
        for (nees, is_met) in [(0.999 * bound, true), (1.001 * bound, false)] {
            tuned.after.nees = nees;
            assert_eq!(tuned.fault().is_none(), is_met, "{nees}");
        }
        tuned.without_factor.push(Sensor::Accel);
        let reason = "the model has no accel noise to scale, the truth has some";
        for (nees, rmse, fault) in [
            (1.001 * bound, 1.0, Some(reason)),
            (9.0, 1.0, None),
            (9.0, 2.1, Some(reason)),
        ] {
            tuned.after.nees = nees;
            tuned.after.rmse_end = vec![[rmse; 9]];
            assert_eq!(tuned.fault().as_deref(), fault, "{nees} {rmse}");
        }
    }

    #[test]
    fn a_factor_on_the_aiding_is_told_where_there_is_one() {
        for (factor, told) in [
            (None, None),
            (Some(1.0), None),
            (
                Some(2.5),
                Some("every sigma of [aiding] × 2.50, then of the model:"),
            ),
            (
                Some(f64::NAN),
                Some("no sigma of the aiding covers its errors: give the filter states for them"),
            ),
        ] {
            let tuned = TuneResult {
                aiding_sigmas: factor,
                ..tuned()
            };
            assert_eq!(tuned.of_aiding().as_deref(), told);
        }
    }
}
