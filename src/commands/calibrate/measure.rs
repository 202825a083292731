//! Calibration: from static recordings, or directories of them, to a noise model for each sensor or axis.

use super::document::CalibrationNote;
use crate::app::reading::note_report;
use crate::app::{Context, Failure, refused};
use crate::io::recordings::{FileReport, ReadOptions, Report};
use crate::io::{curve_file, recordings};
use crate::report::CurvesFile;
use nav_sim_calibration::{
    self, Advance, Bootstrap, CalibrationError, CalibrationSettings, Diagnosis, Estimator, Group,
    Outcome, RecordingWarmUp, Replicate, Scope, TurnOnSpread, WarmUp, add_intervals_with_progress,
    diagnose, fit_curve, replicates, turn_on, warm_up,
};
use nav_sim_signal::imu::{Channel, Recording, Sensor};
use nav_sim_signal::names::UnknownName;
use nav_sim_signal::noise::Model;
use nav_sim_signal::wavelet::{Curve, Tuning, default_levels};
use rayon::prelude::*;
use std::path::{Path, PathBuf};
use std::str::FromStr;

/// Choice of estimators.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum EstimatorChoice {
    /// This one.
    One(Estimator),
    /// The three averages; of a single recording GMWM and RGMWM.
    All,
}

impl FromStr for EstimatorChoice {
    type Err = UnknownName;

    fn from_str(word: &str) -> Result<Self, Self::Err> {
        if word == "all" {
            Ok(Self::All)
        } else {
            word.parse().map(Self::One)
        }
    }
}

impl EstimatorChoice {
    /// Returns true for an estimator that takes one recording at a time.
    pub fn is_single(self) -> bool {
        matches!(self, Self::One(estimator) if estimator.is_single())
    }

    /// The estimators that it may come to.
    pub(crate) fn possible(self) -> Vec<Estimator> {
        match self {
            Self::One(estimator) => vec![estimator],
            Self::All => [1, 2]
                .into_iter()
                .flat_map(|n| self.estimators(n))
                .flatten()
                .collect(),
        }
    }

    /// The estimators for so many recordings.
    fn estimators(self, recordings: usize) -> Result<Vec<Estimator>, Failure> {
        match self {
            Self::One(estimator) if estimator.is_single() && recordings > 1 => refused(
                format!("--estimator {estimator} takes one recording; there are {recordings}"),
                "awv, sr-awv and dr-awv take several",
            ),
            Self::One(estimator) => Ok(vec![estimator]),
            Self::All if recordings == 1 => Ok(vec![Estimator::Gmwm, Estimator::Rgmwm]),
            Self::All => Ok(vec![Estimator::Awv, Estimator::SrAwv, Estimator::DrAwv]),
        }
    }
}

/// Recordings that were measured, none a copy of another.
pub(crate) struct MeasuredRecordings {
    pub report: Report,
    pub replicates: Vec<(Channel, Replicate)>,
    pub warm_ups: Vec<RecordingWarmUp>,
    pub settings: CalibrationSettings,
}

/// A calibration: the fitted models and the wavelet variances behind them.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct Calibration {
    /// The wavelet variances.
    pub groups: Vec<Group>,
    /// The fitted models: for each group, one per estimator.
    pub outcomes: Vec<Outcome>,
    /// Settings of the fit.
    pub settings: CalibrationSettings,
    /// The recordings that do not begin as they go on.
    pub warm_ups: Vec<RecordingWarmUp>,
    /// Turn-on bias from the recordings' means, for each estimator and sensor.
    pub turn_on: Vec<TurnOnSpread>,
    /// Each recording against the others.
    pub diagnoses: Vec<Diagnosis>,
    /// Provenance that the model files record beside the fits.
    pub(crate) note: CalibrationNote,
}

/// Reads and measures recordings: errors in them are known before the long half begins.
pub(crate) fn measure(
    paths: &[PathBuf],
    mut reading: ReadOptions,
    scales: Option<u32>,
    estimators: EstimatorChoice,
    settings: &CalibrationSettings,
    context: &Context<'_>,
) -> Result<MeasuredRecordings, Failure> {
    // As many scales as parameters, and one that the default leaves out.
    reading.min_samples = scales.map_or(2 << settings.model.parameters(), |j| 1 << j);
    let look = |recording: Recording| MeasuredRecording::new(recording, scales, &settings.tuning);
    let (looks, report) = visit(paths, &reading, &look, context)?;
    let looks = looks.into_iter().collect::<Result<Vec<_>, _>>()?;
    let rate_hz = report.files[0].rate_hz;
    let warm_ups = warm_ups(&looks, reading.skip_s, rate_hz);
    warn_of_short_recording(&report, scales, context);
    // a file for each sensor, as phones write them, is no more than one recording of each
    let of = |channel: &Channel| {
        let has = |look: &&MeasuredRecording| look.replicates.iter().any(|(own, _)| own == channel);
        looks.iter().filter(has).count()
    };
    let estimators = estimators.estimators(Channel::ALL.iter().map(of).max().unwrap_or(0))?;
    let settings = CalibrationSettings {
        estimators,
        rate_hz,
        ..settings.clone()
    };
    let mut measured: Vec<_> = looks.into_iter().flat_map(|look| look.replicates).collect();
    keep_first_mean_per_file(&report, &mut measured);
    Ok(MeasuredRecordings {
        report,
        replicates: measured,
        warm_ups,
        settings,
    })
}

impl Calibration {
    /// Adds intervals and goodness of fit, if they are requested, diagnoses and turn-on biases to fits.
    pub(crate) fn new(
        groups: Vec<Group>,
        mut outcomes: Vec<Outcome>,
        settings: CalibrationSettings,
        bootstrap: Option<Bootstrap>,
        advance: Advance<'_>,
    ) -> Self {
        if let Some(bootstrap) = bootstrap {
            add_intervals_with_progress(&groups, &mut outcomes, &settings, bootstrap, advance);
        }
        let of_estimator = |e: &Estimator| {
            let own: Vec<&Outcome> = outcomes.iter().filter(|o| o.estimator == *e).collect();
            turn_on(&groups, &own)
        };
        Self {
            turn_on: settings.estimators.iter().flat_map(of_estimator).collect(),
            diagnoses: diagnose(&groups, &outcomes, &settings),
            warm_ups: Vec::new(),
            note: CalibrationNote::default(),
            groups,
            outcomes,
            settings,
        }
    }

    /// The noise model of an estimator, at the rate of the recordings; axes without a recording have no noise.
    pub fn model(&self, estimator: Estimator) -> Model {
        nav_sim_calibration::model_of(
            self.outcomes.iter().filter(|o| o.estimator == estimator),
            self.settings.rate_hz,
        )
    }

    /// The fits of one estimator, with the findings about all recordings.
    pub(crate) fn of(&self, estimator: Estimator) -> Self {
        let mut one = self.clone();
        one.outcomes.retain(|o| o.estimator == estimator);
        one.turn_on.retain(|t| t.estimator == estimator);
        one
    }

    pub(crate) fn curves(&self) -> CurvesFile {
        CurvesFile::new(&self.groups, &self.outcomes, &self.settings)
    }
}

/// Shows recordings one by one; what was found in them is remarked.
pub(crate) fn visit<T: Send>(
    paths: &[PathBuf],
    reading: &ReadOptions,
    look: &(dyn Fn(Recording) -> T + Sync),
    context: &Context<'_>,
) -> Result<(Vec<T>, Report), Failure> {
    let tell = |done, all| match done {
        0 => context.begin("recordings", all as u64),
        _ => context.advance(1),
    };
    let (looks, report) = recordings::visit(paths, reading, look, &tell)?;
    context.end();
    note_report(&report, context);
    Ok((looks, report))
}

/// Wavelet variances of a recording; its samples are dropped.
struct MeasuredRecording {
    recording: String,
    warm_ups: Vec<WarmUp>,
    replicates: Vec<(Channel, Replicate)>,
}

impl MeasuredRecording {
    fn new(
        recording: Recording,
        levels: Option<u32>,
        tuning: &Tuning,
    ) -> Result<Self, CalibrationError> {
        Ok(Self {
            warm_ups: recording
                .signals
                .par_iter()
                .filter_map(|s| warm_up(&s.samples))
                .collect(),
            replicates: replicates(&recording, levels, tuning)?,
            recording: recording.name,
        })
    }
}

/// Stretches of a file share a power-on: only the first counts for the turn-on bias.
fn keep_first_mean_per_file(report: &Report, measured: &mut [(Channel, Replicate)]) {
    let later: Vec<String> = report
        .files
        .iter()
        .flat_map(|file| file.recordings().skip(1))
        .map(|(name, _)| name)
        .collect();
    measured
        .iter_mut()
        .filter(|(_, replicate)| later.contains(&replicate.name))
        .for_each(|(_, replicate)| replicate.mean = f64::NAN);
}

/// Recordings that warm up beyond the time skipped.
fn warm_ups(looks: &[MeasuredRecording], skipped_s: f64, rate_hz: f64) -> Vec<RecordingWarmUp> {
    let warm_up = |look: &MeasuredRecording| RecordingWarmUp {
        recording: look.recording.clone(),
        signals: look.warm_ups.clone(),
        skip_s: warm_up_samples(&look.warm_ups).map(|n| (skipped_s + n as f64 / rate_hz).ceil()),
    };
    let found = looks.iter().filter(|look| !look.warm_ups.is_empty());
    found.map(warm_up).collect()
}

/// Samples to leave out of a recording for all its signals; `None` if that does not help one of them.
fn warm_up_samples(signals: &[WarmUp]) -> Option<usize> {
    let helps = signals.iter().all(|w| w.change.is_some());
    signals.iter().map(|w| w.samples).max().filter(|_| helps)
}

/// Warns of a recording so short that it lacks scales of the others, or costs the average scales.
fn warn_of_short_recording(report: &Report, scales: Option<u32>, context: &Context<'_>) {
    let levels = |samples: usize| scales.unwrap_or(u32::MAX).min(default_levels(samples));
    let recordings = report.files.iter().flat_map(FileReport::recordings);
    let Some((recording, samples)) = recordings
        .clone()
        .min_by_key(|(_, samples)| levels(*samples))
    else {
        return;
    };
    let mut found: Vec<u32> = recordings.map(|(_, samples)| levels(samples)).collect();
    found.sort_unstable();
    // Scales are averaged up to the last that more than half of the recordings have ([`calibration::average`]).
    let (scales, used) = (found[0], found[(found.len() - 1) / 2]);
    if scales < found[found.len() / 2] {
        let most = found[found.len() - 1];
        context.warn(format!(
            "{recording}: {samples} samples have {scales} scales, the longest recording {most}; the average has {used}"
        ));
    }
}

// Wavelet-variance curves that come from elsewhere → models.

/// Curves of a file, each with what it is for.
pub(crate) type Curves = Vec<(Scope, Estimator, Curve)>;

/// Reads curves, and returns the settings with their estimators and rate, and true if a sensor was assumed. `rate_hz`
/// and `sensor` apply to curves that state none.
///
/// # Errors
/// When the file cannot be read, says nothing of rate or sensor where nothing is given, or has two curves for one model.
pub(crate) fn read_curves(
    path: &Path,
    rate_hz: Option<f64>,
    sensor: Option<Sensor>,
    settings: &CalibrationSettings,
) -> Result<(Curves, CalibrationSettings, bool), Failure> {
    let named = curve_file::read(path)?;
    let path = || path.display().to_string();
    let rate_hz = match (named[0].rate_hz, rate_hz) {
        (Some(stated), Some(given)) => {
            return refused(
                format!(
                    "{}: the curve is at {stated} Hz, --rate-hz is {given}",
                    path()
                ),
                "leave --rate-hz out: it is for CSV curves",
            );
        }
        (stated, given) => stated.or(given).ok_or_else(|| {
            Failure::input(format!("{}: the curve states no sample rate", path()))
                .hint("give the rate with --rate-hz")
        })?,
    };
    let mut is_sensor_assumed = false;
    let mut curves = Curves::new();
    for named in named {
        let estimator = named
            .estimator
            .and_then(|name| name.parse().ok())
            .unwrap_or(Estimator::Given);
        is_sensor_assumed |= named.sensor.or(sensor).is_none();
        if let (Some(stated), Some(given)) = (named.sensor, sensor)
            && stated != given
        {
            return refused(
                format!(
                    "{}: the curve is of {}, --axes of {}",
                    path(),
                    stated.name(),
                    given.name()
                ),
                "leave --axes out: it is for CSV curves",
            );
        }
        let sensor = named.sensor.or(sensor).unwrap_or(Sensor::Accel);
        let scope = Scope {
            sensor,
            axis: named.axis,
        };
        if curves
            .iter()
            .any(|(s, e, _)| (*s, *e) == (scope, estimator))
        {
            return refused(
                format!("{}: two curves of {} for {estimator}", path(), scope.name()),
                "calibrate the recordings themselves",
            );
        }
        curves.push((scope, estimator, named.curve));
    }
    let estimators = Estimator::ALL
        .into_iter()
        .filter(|e| curves.iter().any(|(_, estimator, _)| estimator == e))
        .collect();
    Ok((
        curves,
        CalibrationSettings {
            estimators,
            rate_hz,
            ..settings.clone()
        },
        is_sensor_assumed,
    ))
}

/// Fits a model to each curve.
///
/// # Errors
/// When a curve is too short for the model.
pub(crate) fn calibrate_curves(
    curves: Curves,
    settings: CalibrationSettings,
    bootstrap: Option<Bootstrap>,
) -> Result<Calibration, Failure> {
    let (mut groups, mut outcomes) = (Vec::new(), Vec::new());
    for (scope, estimator, curve) in curves {
        let group = Group {
            scope,
            replicates: Vec::new(),
        };
        outcomes.push(fit_curve(&group, estimator, curve, &settings, &|_| {})?);
        groups.push(group);
    }
    Ok(Calibration::new(
        groups,
        outcomes,
        settings,
        bootstrap,
        &|_| {},
    ))
}
