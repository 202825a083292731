//! The choice of the noise model for a filter, by the recordings themselves.
//!
//! One recording at a time is left out. Every [`Candidate`] is calibrated on the others and navigates on windows of the
//! one left out, whose errors are new to it; all candidates have the same windows and fixes. Candidates are judged by
//! the [`Score`](ranking::Score) at the ends of outages, above all the mean log density of the true error under the filter's belief:
//! a proper score ([Gneiting and Raftery 2007](https://doi.org/10.1198/016214506000001437)), which a filter cannot
//! raise by claiming more, or less, than it knows. The recording is the unit of every interval, not the window:
//! windows of one recording share its noise. [`Ranking`] compares candidates pair by pair, recording by recording.

use crate::app::inputs::{self, SettingsArgs};
use crate::app::reading::{ReadingRequest, WHOLE, unknown_model};
use crate::app::{Command, Context, Failure, Inputs, OutputKind, PlainAnswer, Result, refused};
use crate::commands::calibrate::{
    Calibration, CalibrationNote, ESTIMATORS, EstimatorChoice, MeasuredRecordings, measure,
};
use crate::io::recordings::{self, FileReport, Gaps};
use crate::parse;
use crate::report::csv::merged;
use crate::report::{self, first_names, six_digits};
use candidates::{CalibrationSet, Candidate, Drive, Fold, Inflation, Unit};
use nav_sim_calibration::{Bootstrap, CalibrationSettings, Estimator, ModelChoice, Trim, model_of};
use nav_sim_document::{Document, Importance, Table, Tone, readable, window};
use nav_sim_navigation::ekf::FilterStates;
use ranking::{RankedCandidate, Ranking};
use serde_json::{Value, json};
use std::path::PathBuf;

pub mod candidates;
pub mod ranking;

// `nav-sim choose`: the noise model for a filter, by the recordings themselves.

/// Choose the noise model for a filter by navigating on recordings left out of its calibration
///
/// Leaves out one recording at a time, calibrates every candidate on the others and navigates along TRAJECTORY with
/// windows of the one left out; abnormal recordings are not left out, and judge nothing. Ranks the candidates by the mean log density of the true errors at the ends of outages
/// under the filter's covariance, which rewards accuracy and consistency together. Also prints RMSE, NEES and coverage,
/// with intervals over recordings. Writes report.html, ranking.json and model.toml, the winner calibrated on all
/// recordings.
#[derive(clap::Args, Debug, Clone)]
pub struct Choose {
    /// Static recordings, three or more files, or directories of them
    #[arg(id = "recording", required = true, value_name = "RECORDINGS")]
    inputs: Vec<PathBuf>,
    /// Trajectory: motion profile (.toml) or table (.csv)
    #[arg(long, value_name = "FILE")]
    pub trajectory: PathBuf,
    /// Outages, receiver, start, what filters expect.
    #[command(flatten)]
    settings: SettingsArgs,
    /// Estimators to compare, those of `calibrate` [default: awv, sr-awv, dr-awv; gmwm and avlr for comparison]
    #[arg(long, value_name = "NAMES", hide_possible_values = true, value_delimiter = ',', value_parser = parse::one_of::<Estimator>(EACH))]
    estimator: Vec<Estimator>,
    /// Models to compare, such as N2,N1,WN+RW,auto [default: N2, and WN+RW with awv]
    #[arg(long, value_name = "MODELS", value_delimiter = ',')]
    model: Vec<String>,
    /// Filters to compare: 15, 21, full, as in `run` [default: 15, and full with awv]
    #[arg(long, value_name = "STATES", value_delimiter = ',')]
    filter: Vec<FilterStates>,
    /// Inflation of standard deviations: none, x10 [default: none, and both with awv]
    #[arg(long, value_name = "HOW", value_delimiter = ',')]
    inflate: Vec<Inflation>,
    /// Runs on each recording
    #[arg(long, value_name = "N", default_value_t = 16, value_parser = clap::value_parser!(u64).range(1..=100_000))]
    runs: u64,
    /// Replicates that dr-awv drops at each end of each scale: a number, or a share
    #[arg(long, value_name = "A", default_value_t, hide_short_help = true)]
    trim: Trim,
    /// Gaps and repeated times: refuse, split (into recordings) or ignore
    #[arg(long, value_name = "HOW", hide_possible_values = true, hide_short_help = true, value_parser = parse::one_of::<Gaps>(WHOLE), default_value_t)]
    gaps: Gaps,
    /// Options for reading recordings.
    #[command(flatten)]
    pub recordings: ReadingRequest,
}

/// The estimators that are one.
const EACH: &[&str] = ESTIMATORS.split_at(6).0;

impl Command for Choose {
    type Answer = PlainAnswer;
    const NAME: &'static str = "choose";
    const OUT: OutputKind = OutputKind::Directory {
        path: "out/choice",
        files: &[
            "model.toml",
            "model.wv.json",
            "model.html",
            "model.svg",
            "model.draws.json",
            "ranking.json",
        ],
    };
    const PLOT: bool = false;

    fn inputs(&self, given: Inputs) -> Result<Inputs> {
        self.candidates().map(|_| given)
    }

    /// Files are read twice, so that no more than a few are in memory.
    fn run(&self, context: &Context<'_>) -> Result<PlainAnswer> {
        let candidates = self.candidates()?;
        let scenario = self.settings.checked()?;
        let trajectory = inputs::trajectory(&self.trajectory, context)?;
        let seed = context.seed_or(scenario.run.seed);
        let outages = inputs::placed(&scenario, trajectory.span_s(), seed, context)?;
        if outages.is_empty() {
            return refused(
                "no outage: candidates are compared at the ends of outages",
                "give one with --outage START:END",
            );
        }
        // the candidates have estimators and models of their own
        let settings = CalibrationSettings {
            trim: self.trim,
            ..CalibrationSettings::default()
        };
        let (reading, estimator) = (
            self.recordings.options(self.gaps),
            EstimatorChoice::One(Estimator::Awv),
        );
        let mut measured = measure(
            &self.inputs,
            reading.clone(),
            None,
            estimator,
            &settings,
            context,
        )?;
        let found_hz = measured.settings.rate_hz;
        let rate_hz = nominal_hz(found_hz, scenario.gnss.rate_hz);
        if rate_hz != found_hz {
            context.remark(format!(
                "the recordings run at {} Hz: taken as {rate_hz} Hz, to meet the fixes",
                six_digits(found_hz)
            ));
            measured.settings.rate_hz = rate_hz;
        }
        let files = &measured.report.files;
        if files.len() < FEWEST {
            let message = format!(
                "{} recordings are too few to leave one out: {FEWEST} are needed",
                files.len()
            );
            return refused(
                message,
                "one file is one recording; nav-sim calibrate takes fewer",
            );
        }
        let units = units(&measured);
        let laboratory = CalibrationSet {
            units,
            settings: measured.settings,
        };
        let drive = Drive::new(&trajectory, scenario, outages.clone(), rate_hz, seed)?;
        let judges = laboratory.judges()?;
        context.begin("runs", judges.len() as u64 * self.runs);
        let mut folds = Vec::new();
        for k in &judges {
            let file = &files[*k];
            let (mut read, _) = recordings::read(std::slice::from_ref(&file.path), &reading)?;
            // The clocks of the files are not quite alike: one rate is that of all.
            read.iter_mut().for_each(|r| r.rate_hz = rate_hz);
            let advance = |n| context.advance(n);
            let (recording, windows) = (file.file.clone(), self.runs);
            let scores = drive
                .leave_out(&laboratory, *k, read, &candidates, windows, &advance)
                .map_err(|e| e.within(&recording))?;
            folds.push(Fold {
                recording,
                windows,
                scores,
            });
        }
        context.end();
        let ranking = Ranking::new(&candidates, &folds);
        let best = &ranking.candidates[0];
        let diverges = |c: &&RankedCandidate| c.log_score.value == f64::NEG_INFINITY;
        if diverges(&best) {
            return Err(Failure::failed(
                "every candidate has runs that diverge on a recording",
            )
            .hint("nav-sim calibrate names abnormal recordings; --inflate x10 adds wider candidates"));
        }
        let winner = &candidates[best.index];
        // an estimator of single recordings never wins: this is of all of them
        let (groups, mut outcomes, settings) = laboratory.calibrate(winner, None)?;
        // The model that was compared is the one that is written.
        outcomes
            .iter_mut()
            .for_each(|outcome| outcome.reading = None);
        let model = winner.inflated(&model_of(&outcomes, settings.rate_hz));
        let mut calibration = Calibration::new(
            groups,
            outcomes,
            settings,
            Some(Bootstrap {
                seed,
                ..Bootstrap::default()
            }),
            &|_| {},
        );
        calibration.turn_on.clear();
        calibration.note = CalibrationNote {
            reading: self.recordings.provenance(self.gaps),
            seed: Some(seed),
            inputs: context.inputs().to_vec(),
        };
        let others = files
            .iter()
            .enumerate()
            .filter(|(k, _)| !judges.contains(k));
        let abnormal: Vec<&str> = others.map(|(_, file)| file.file.as_str()).collect();
        let verdict = ranking.verdict();
        let trajectory = self.trajectory.display().to_string();
        let json = merged([
            json!({
                "schema_version": 1,
                "verdict": verdict,
                "trajectory": trajectory,
                "outages": outages,
                "seed": seed,
            }),
            json!(ranking),
        ]);
        let tone = match ranking.tells {
            true => Tone::Good,
            false => Tone::Undecided,
        };
        let mut document = Document::new("Which noise model", tone, verdict);
        let mut warn = |text, names: &[&str]| {
            if !names.is_empty() {
                document.note(Importance::Warning, format!("{text}: {}", names.join(", ")));
            }
        };
        warn(
            "abnormal, ranks no candidate (nav-sim calibrate says how)",
            &abnormal,
        );
        let diverged = ranking.candidates.iter().filter(diverges);
        let diverged: Vec<&str> = diverged.map(|c| c.candidate.as_str()).collect();
        warn("its runs diverge on a recording", &diverged);
        let undescribed: Vec<&str> = ranking.undescribed.iter().map(String::as_str).collect();
        warn(
            "no candidate describes it (a warm-up? see nav-sim calibrate)",
            &undescribed,
        );
        let ends = outages.iter().map(|o| window(o.start_s, o.end_s));
        let ends = ends.collect::<Vec<_>>().join(", ");
        document.text(&format!("along {trajectory}, outages {ends}, seed {seed}"));
        tables(&json, &mut document);
        let how = winner.inflation.name();
        let inflated = (winner.inflation != Inflation::None).then_some((&model, how));
        let mut files = calibration.files_of(winner.estimator, "model", inflated);
        files.push(("ranking.json".to_owned(), report::json(&json)));
        Ok(PlainAnswer::new(json, document).with(files))
    }
}

impl Choose {
    /// Candidates to compare: the default ones, or all combinations of the given options.
    fn candidates(&self) -> Result<Vec<Candidate>> {
        let Self {
            estimator,
            model,
            filter,
            inflate,
            ..
        } = self;
        if estimator.is_empty() && model.is_empty() && filter.is_empty() && inflate.is_empty() {
            return Ok(Candidate::default_set());
        }
        let models = model.iter().map(|m| m.parse().map_err(unknown_model));
        let models: Vec<ModelChoice> = models.collect::<Result<_>>()?;
        fn or<T: Clone>(given: &[T], usual: &[T]) -> Vec<T> {
            if given.is_empty() { usual } else { given }.to_vec()
        }
        let candidates = Candidate::product(
            &or(
                estimator,
                &[Estimator::Awv, Estimator::SrAwv, Estimator::DrAwv],
            ),
            &or(&models, &[ModelChoice::default()]),
            &or(filter, &[FilterStates::Reduced15]),
            &or(inflate, &[Inflation::None]),
        );
        if candidates.iter().any(Candidate::is_eligible) {
            return Ok(candidates);
        }
        refused(
            "gmwm, rgmwm and avlr take one recording, and no other estimator is given",
            "add awv, sr-awv or dr-awv to --estimator",
        )
    }
}

/// Fewest recordings of which one can be left out: two remain to be averaged.
const FEWEST: usize = 3;

/// The rate of which that of the fixes is a whole divisor, if the clock of the recordings (Hz) shows it to within its own
/// error: quartz is within 1e-4, and a stamp that was rounded at either end costs no more than the rest. Else that of the
/// clock.
fn nominal_hz(found_hz: f64, fix_hz: f64) -> f64 {
    const CLOCK: f64 = 1e-3;
    let nominal_hz = (found_hz / fix_hz).round() * fix_hz;
    let apart = (nominal_hz / found_hz - 1.0).abs();
    // To the precision of a rate that is written with seven digits it is one already.
    if apart > 1e-6 && apart <= CLOCK {
        nominal_hz
    } else {
        found_hz
    }
}

/// The recordings, each with its signals' wavelet variances.
fn units(measured: &MeasuredRecordings) -> Vec<Unit> {
    let unit = |file: &FileReport| {
        let names: Vec<String> = file.recordings().map(|(name, _)| name).collect();
        let own = measured
            .replicates
            .iter()
            .filter(|(_, r)| names.contains(&r.name));
        own.cloned().collect()
    };
    measured.report.files.iter().map(unit).collect()
}

// The ranking of candidates as a document.

impl Ranking {
    /// The winner, what cannot be told from it, and how good it is.
    fn verdict(&self) -> Vec<String> {
        let (winner, recordings) = (&self.candidates[0], self.candidates[0].folds.len());
        let name = &winner.candidate;
        let eligible = self.candidates.iter().filter(|p| p.eligible).count();
        let mut lines = vec![match (self.tells, eligible) {
            (_, 1) => format!("{name}: no other candidate"),
            (true, _) => {
                format!("{name} is the best of {eligible} candidates on {recordings} recordings")
            }
            (false, _) => format!(
                "undecided: {recordings} recordings cannot separate {eligible} candidates; {name} scores highest"
            ),
        }];
        if self.tells && !self.tied.is_empty() {
            lines.push(format!("as good: {}", first_names(&self.tied)));
        }
        lines.push(format!(
            "its horizontal error at the ends of outages: {} m, stated {} m, NEES {} (9 if right)",
            readable(winner.rmse_m),
            readable(winner.believed_m),
            readable(winner.nees.value)
        ));
        lines
    }
}

fn tables(json: &Value, document: &mut Document) {
    let columns = [
        ("candidate", "candidate"),
        ("", "place"),
        ("log score (nats)", "log_score/value"),
        ("to the best", "difference/log_score/value"),
        ("95 %", "difference/log_score/ci95"),
        ("NEES (9)", "nees/value"),
        ("95 %", "nees/ci95"),
        ("RMSE (m)", "rmse_m"),
    ];
    document.table(Table::of(json, "/candidates/*", &columns));
    let columns = [
        ("candidate", "candidate"),
        ("RMSE (m)", "rmse_m"),
        ("believed (m)", "believed_m"),
        ("coverage (0.95)", "coverage"),
    ];
    document.table(Table::of(json, "/candidates/*", &columns));
    let columns = [
        ("recording left out", "recording"),
        ("candidate", "../../candidate"),
        ("windows", "windows"),
        ("NEES (9)", "nees"),
        ("log score (nats)", "log_score"),
        ("RMSE (m)", "rmse_m"),
    ];
    let folds = Table::of(json, "/candidates/*/folds/*", &columns);
    document.folded("Recording by recording", |inside| inside.table(folds));
}
