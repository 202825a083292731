//! `nav-sim design`: the interval that recordings not made yet would give.

use crate::app::inputs::{self, OutageFlag};
use crate::app::{Answer, Command, Context, Failure, Result};
use crate::commands::calibrate::ESTIMATORS;
use crate::commands::run::{NavigateInputs, TrueImu, navigate};
use crate::io::draws_file::DrawsFile;
use crate::io::model_file::ModelFile;
use crate::parse;
use nav_sim_calibration::{
    Bootstrap, CalibrationSettings, Estimator, Outcome, ParameterInterval, PlannedRecordings,
    ScatterSource,
};
use nav_sim_document::{Document, Importance, Table, Tone, readable, window};
use nav_sim_navigation::ekf::FilterStates;
use nav_sim_navigation::metrics::OutageSummary;
use nav_sim_navigation::scenario::{Method, Scenario};
use nav_sim_navigation::sensors::outage::Outage;
use nav_sim_signal::noise::Parameter;
use serde::Serialize;
use std::path::PathBuf;

/// Predict how well a number of recordings of given length would determine an IMU like MODEL
///
/// Draws the wavelet variances of recordings from their sampling distribution, with the [spread] of MODEL between
/// recordings, and calibrates them as `nav-sim calibrate` would. The expected interval is made of the scatter of these
/// estimates about MODEL. What one calibration states is made of the scatter of its own recordings, half of them more and half
/// less; where a parameter is known to ± 100 %, rather less. 200 draws know such an interval to about 20 %. With --trajectory there is also the
/// interval on the horizontal error (95 % quantile) at the end of each outage, for a filter that knows the IMU.
/// Without --recordings or --hours a table of several is printed.
#[derive(clap::Args, Debug, Clone)]
pub struct Design {
    /// Noise model of the IMU, as far as it is known
    model: PathBuf,
    /// Number of recordings [default: a table of 3, 6 and 12]
    #[arg(long, value_name = "K", value_parser = clap::value_parser!(u32).range(2..=1000))]
    pub recordings: Option<u32>,
    /// Length of each in hours [default: a table of 1, 3 and 10]
    #[arg(long, value_name = "HOURS", value_parser = parse::positive)]
    hours: Option<f64>,
    /// Estimator of the planned calibration: awv averages classical wavelet variances; sr-awv
    /// robust ones, against outliers; dr-awv also trims them, against abnormal recordings
    #[arg(long, value_name = "ESTIMATOR", value_parser = parse::one_of::<Estimator>(AVERAGES), default_value_t)]
    estimator: Estimator,
    /// Draws of the bootstrap
    #[arg(long, value_name = "N", default_value_t = 200, value_parser = clap::value_parser!(u32).range(40..=10_000))]
    draws: u32,
    /// Trajectory: motion profile (.toml) or table (.csv)
    #[arg(long, value_name = "FILE")]
    pub trajectory: Option<PathBuf>,
    /// Window without fixes, in seconds (repeatable; default: 300:390 and 700:790)
    #[arg(
        id = "outage",
        long = "outage",
        value_name = "START:END",
        requires = "trajectory"
    )]
    outages: Vec<OutageFlag>,
}

/// The estimators of several recordings.
const AVERAGES: &[&str] = ESTIMATORS.split_at(3).0;

/// Longest recording that is planned (h): a year.
const LONGEST_H: f64 = 8766.0;

impl Command for Design {
    type Answer = Designs;
    const NAME: &'static str = "design";

    fn run(&self, context: &Context<'_>) -> Result<Designs> {
        if self.hours.is_some_and(|hours| hours > LONGEST_H) {
            return Err(Failure::input("--hours: over a year"));
        }
        let file = inputs::model(&self.model, context)?;
        let mut scenario = self.scenario()?;
        let mut destination = None;
        if let Some(path) = &self.trajectory {
            let trajectory = inputs::trajectory(path, context)?;
            let outages = inputs::placed(&scenario, trajectory.span_s(), 0, context)?;
            scenario.imu.rate_hz = file.model.rate_hz;
            let own = (self.model.as_path(), &file);
            inputs::turn_on(&mut scenario, own, Some(own), context);
            scenario.validate().map_err(Failure::input)?;
            destination = Some((
                NavigateInputs::new(trajectory, file.model.clone(), TrueImu::AsBelieved),
                scenario,
                outages,
            ));
        }
        let bootstrap = Bootstrap {
            draws: self.draws as usize,
            seed: context.seed_or(None),
        };
        let recordings = self.recordings.map_or(vec![3, 6, 12], |k| vec![k as usize]);
        let hours = self.hours.map_or(vec![1.0, 3.0, 10.0], |h| vec![h]);
        let mut designs = Vec::new();
        let silent = Context::default();
        for k in recordings {
            for h in &hours {
                // the filter is the same in all of them
                let context = [&silent, context][usize::from(designs.is_empty())];
                designs.push(
                    self.design(&file, &mut destination, bootstrap, (k, *h), context)
                        .map_err(|e| Failure::input(e).hint("more, or longer recordings"))?,
                );
            }
        }
        Ok(Designs {
            schema_version: 1,
            designs,
        })
    }
}

/// A navigation with the model that will be calibrated: trajectory and model, filter and receiver, outages.
type Destination = (NavigateInputs, Scenario, Vec<Outage>);

impl Design {
    /// Drives are analysed, with a state for every process.
    fn scenario(&self) -> Result<Scenario> {
        let mut scenario = Scenario::default();
        scenario.run.method = Method::Lincov;
        scenario.filter.states = FilterStates::Full;
        if !self.outages.is_empty() {
            scenario.outage = Some(inputs::windows_of(&self.outages)?);
        }
        Ok(scenario)
    }

    /// The intervals that `recordings` of `hours` each would give.
    fn design(
        &self,
        file: &ModelFile,
        destination: &mut Option<Destination>,
        bootstrap: Bootstrap,
        (recordings, hours): (usize, f64),
        context: &Context<'_>,
    ) -> Result<DesignOutcome> {
        let model = &file.model;
        let anticipated = PlannedRecordings {
            model,
            spread: file.spread.as_ref(),
            recordings,
            samples: (hours * 3600.0 * model.rate_hz).round() as usize,
        };
        let settings = CalibrationSettings::default();
        let outcomes =
            |scattering| anticipated.outcomes(self.estimator, &settings, scattering, bootstrap);
        let all = outcomes(ScatterSource::All)?;
        let designed = |all: &[Outcome]| -> Vec<DesignedParameter> {
            all.iter()
                .flat_map(|o| designed(o, model.rate_hz))
                .collect()
        };
        let mut parameters = designed(&all);
        if file.spread.is_some() {
            let endless = designed(&outcomes(ScatterSource::BetweenRecordings)?);
            for (parameter, endless) in parameters.iter_mut().zip(endless) {
                parameter.endless_half_width_pct = endless.half_width_pct;
            }
        }
        let horizontal_p95 = match destination {
            Some(destination) => destination_quantiles(destination, &all, model.rate_hz, context)?,
            None => Vec::new(),
        };
        Ok(DesignOutcome {
            recordings,
            hours,
            horizontal_p95,
            known_least: least_known(&parameters),
            undetermined: parameters
                .iter()
                .filter(|p| p.half_width_pct.is_none())
                .count(),
            parameters,
        })
    }
}

/// The parameters of an outcome; correlation times in the place of phi and beta, of which a per cent says nothing.
fn designed(outcome: &Outcome, rate_hz: f64) -> Vec<DesignedParameter> {
    let composite = &outcome.fit.composite;
    let parameter_of_interval = |interval: &ParameterInterval| {
        let mut values = composite.parameters();
        let (_, value) = values.find(|(parameter, _)| *parameter == interval.of)?;
        let label = &composite.labels()[interval.of.process];
        let (parameter, shown): (String, &dyn Fn(f64) -> f64) = match interval.of.parameter {
            Parameter::Phi => (format!("{label} correlation_time_s"), &|phi| {
                -1.0 / (rate_hz * phi.ln())
            }),
            Parameter::Beta => (format!("{label} correlation_time_s"), &|beta| 1.0 / beta),
            _ => (composite.name_of(interval.of), &|value| value),
        };
        let value = shown(value);
        let ci95 = interval.absent.is_none().then(|| {
            let (a, b) = (shown(interval.low), shown(interval.high));
            [a.min(b), a.max(b)]
        });
        Some(DesignedParameter {
            signals: outcome.scope.name(),
            parameter,
            value,
            ci95,
            half_width_pct: ci95.map(|ends| half_width_pct(value, ends)),
            endless_half_width_pct: None,
        })
    };
    outcome
        .inference
        .iter()
        .flat_map(|i| &i.intervals)
        .filter_map(parameter_of_interval)
        .collect()
}

fn half_width_pct(value: f64, [low, high]: [f64; 2]) -> f64 {
    50.0 * (high - low) / value.abs()
}

/// The draws of the calibration, taken through the analysis.
fn destination_quantiles(
    (inputs, scenario, outages): &mut Destination,
    outcomes: &[Outcome],
    rate_hz: f64,
    context: &Context<'_>,
) -> Result<Vec<DesignedQuantile>> {
    outcomes
        .iter()
        .for_each(|outcome| outcome.apply_to(&mut inputs.model));
    let draws = DrawsFile::of(outcomes, rate_hz);
    inputs.model_draws = draws.and_then(|draws| draws.draws(&inputs.model));
    let found = navigate(inputs, scenario, outages, 0, context)?;
    let quantile = |o: &OutageSummary| {
        let h = &o.horizontal_error_end_m;
        let ci95: [f64; 2] = h.p95_ci95.0.zip(h.p95_ci95.1)?.into();
        let half_width_pct = half_width_pct(h.p95, ci95);
        Some(DesignedQuantile {
            start_s: o.start_s,
            end_s: o.end_s,
            p95_m: h.p95,
            ci95,
            half_width_pct,
        })
    };
    Ok(found.summary.outages.iter().filter_map(quantile).collect())
}

/// Several designs.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Designs {
    /// Layout version.
    schema_version: u32,
    /// One for each number of recordings and length, the largest last.
    designs: Vec<DesignOutcome>,
}

/// Expected result of a number of recordings of one length.
#[derive(Debug, Clone, PartialEq, Serialize)]
struct DesignOutcome {
    /// Recordings.
    pub recordings: usize,
    /// Length of each (h).
    pub hours: f64,
    /// Every parameter.
    pub parameters: Vec<DesignedParameter>,
    /// The horizontal p95 at the end of each outage.
    pub horizontal_p95: Vec<DesignedQuantile>,
    /// The parameter with the widest interval.
    pub known_least: String,
    /// Number of parameters without an interval.
    pub undetermined: usize,
}

/// The interval that a parameter would have.
#[derive(Debug, Clone, PartialEq, Serialize)]
struct DesignedParameter {
    /// `accel`, or `accel.x` alone.
    pub signals: String,
    /// `WN sigma2`, `AR1_1 correlation_time_s`.
    pub parameter: String,
    /// Its value (units of the model file; s).
    pub value: f64,
    /// Expected 95 % interval; none where the recordings would not determine it.
    pub ci95: Option<[f64; 2]>,
    /// Half of its width over the value (%).
    pub half_width_pct: Option<f64>,
    /// Half-width of endless recordings, where parameters vary between them: what no length takes away.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub endless_half_width_pct: Option<f64>,
}

impl DesignedParameter {
    /// `accel WN sigma2`
    fn name(&self) -> String {
        format!("{} {}", self.signals, self.parameter)
    }
}

/// The interval that the horizontal p95 at an outage's end would have.
#[derive(Debug, Clone, PartialEq, Serialize)]
struct DesignedQuantile {
    /// First instant without a fix (s).
    pub start_s: f64,
    /// First instant with a fix again (s).
    pub end_s: f64,
    /// The quantile with the model as it is (m).
    pub p95_m: f64,
    /// Expected 95 % interval (m).
    pub ci95: [f64; 2],
    /// Half of its width over the value (%).
    pub half_width_pct: f64,
}

/// Caveat on the expected interval against that of one calibration. Of 400 to 1000 simulated
/// intervals of a random walk (white noise and random walk, four recordings of three axes; ± 57 to
/// ± 102 % expected by 2000 draws) the median was 0.83 to 0.88 of the expected one, the mean 0.92
/// to 0.95, and 32 to 33 % were wider (AWV and DR-AWV); for white noise 0.93 to 0.98. All of them
/// held the truth in 96 to 98.5 % of the cases: a scatter estimated from twelve signals is more
/// often too small than too large, for which Student's quantile compensates.
const STATED: &str = "where ± 100 % are expected, half of the calibrations state under 0.85 of it, one in three more";

/// A part of an interval this large is nearly all of it.
const NEARLY_ALL: f64 = 0.8;

/// The parameter that would be known least: its name, and how well.
fn least_known(parameters: &[DesignedParameter]) -> String {
    parameters
        .iter()
        .filter_map(|p| Some((p, p.half_width_pct?)))
        .max_by(|a, b| a.1.total_cmp(&b.1))
        .map_or("–".to_owned(), |(p, half)| {
            format!("{} ± {} %", p.name(), readable(half))
        })
}

impl DesignOutcome {
    /// Parameters whose intervals are nearly all due to what recordings differ by: longer ones tell no more.
    fn lengths_do_not_help(&self) -> usize {
        let is_floor = |p: &&DesignedParameter| {
            p.endless_half_width_pct
                .zip(p.half_width_pct)
                .is_some_and(|(floor, all)| floor >= NEARLY_ALL * all)
        };
        self.parameters.iter().filter(is_floor).count()
    }
}

impl Designs {
    /// Number of parameters that the largest plan determines, and the least certain one.
    fn verdict(&self) -> (Tone, Vec<String>) {
        let Some(largest) = self.designs.last() else {
            return (Tone::Undecided, vec!["nothing was planned".to_owned()]);
        };
        let (all, open) = (largest.parameters.len(), largest.undetermined);
        let plan = format!("{} recordings of {} h", largest.recordings, largest.hours);
        let first = format!(
            "{plan} would determine {} of {all} parameters; least certain: {}",
            all - open,
            largest.known_least
        );
        let p95 = largest.horizontal_p95.iter().map(|q| {
            let (window, half) = (window(q.start_s, q.end_s), readable(q.half_width_pct));
            format!(
                "horizontal p95 at the end of {window}: {} m ± {half} %",
                readable(q.p95_m)
            )
        });
        (
            if open == 0 {
                Tone::Good
            } else {
                Tone::Doubtful
            },
            std::iter::once(first).chain(p95).collect(),
        )
    }

    /// A row a design, or of one design a row a parameter.
    fn lead(&self) -> Table {
        if self.designs.len() == 1 {
            let columns = [
                ("parameter", "{signals} {parameter}"),
                ("value", "value"),
                ("from", "ci95/0"),
                ("to", "ci95/1"),
                ("± (%)", "half_width_pct"),
                ("± however long (%)", "endless_half_width_pct"),
            ];
            return Table::of(self, "/designs/0/parameters/*", &columns).without_unknown();
        }
        let columns = [
            ("recordings", "recordings"),
            ("hours", "hours"),
            ("least certain", "known_least"),
            ("not determined", "undetermined"),
            (
                "p95 at the end of {start_s}–{end_s} s (± %)",
                "horizontal_p95/*/half_width_pct",
            ),
        ];
        Table::of(self, "/designs/*", &columns).with_keys(2)
    }
}

impl Answer for Designs {
    fn document(&self) -> Document {
        let designs = &self.designs;
        let (tone, lines) = self.verdict();
        let mut document = Document::new("Expected intervals", tone, lines);
        let floor = designs.last().map_or(0, DesignOutcome::lengths_do_not_help);
        if floor > 0 {
            let text = format!(
                "more hours will not help {floor} parameters, which differ between recordings; more recordings will"
            );
            document.note(Importance::Remark, text);
        }
        document.note(Importance::Remark, STATED);
        document.table(self.lead());
        if designs.iter().any(|d| !d.horizontal_p95.is_empty()) {
            document.section("Effect on navigation");
            document.table(Table::of(
                self,
                "/designs/*/horizontal_p95/*",
                &[
                    ("recordings", "../../recordings"),
                    ("hours", "../../hours"),
                    ("outage", "{start_s}–{end_s} s"),
                    ("p95 (m)", "p95_m"),
                    ("from", "ci95/0"),
                    ("to", "ci95/1"),
                    ("half width (%)", "half_width_pct"),
                ],
            ));
        }
        document
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn designed(
        recordings: usize,
        hours: f64,
        half_width_pct: f64,
        floor: Option<f64>,
    ) -> DesignOutcome {
        let parameter = DesignedParameter {
            signals: "gyro".to_owned(),
            parameter: "WN sigma2".to_owned(),
            value: 1.0,
            ci95: None,
            half_width_pct: Some(half_width_pct),
            endless_half_width_pct: floor,
        };
        DesignOutcome {
            recordings,
            hours,
            parameters: vec![parameter],
            horizontal_p95: Vec::new(),
            known_least: String::new(),
            undetermined: 0,
        }
    }

    /// Hours do not help where four fifths of an interval are left of endless recordings.
    #[test]
    fn hours_help_until_most_of_an_interval_is_what_recordings_differ_by() {
        for (floor, count) in [(None, 0), (Some(31.9), 0), (Some(32.1), 1)] {
            assert_eq!(designed(4, 1.0, 40.0, floor).lengths_do_not_help(), count);
        }
    }
}
