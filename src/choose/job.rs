//! Static recordings and a trajectory → the noise model that a filter is best made of.

use super::{Candidate, Contender, Drive, Fold, Laboratory, Ranking, Unit};
use crate::app::Context;
use crate::app::Failure;
use crate::calibrate::{
    Calibration, CalibrationOptions, EstimatorChoice, Measured, measure, without_warm_up,
};
use crate::formats::recordings;
use crate::formats::recordings::{FileReport, ReadOptions};
use crate::report::six_digits;
use nav_sim_calibration::{Estimator, model_of};
use nav_sim_navigation::scenario::Scenario;
use nav_sim_navigation::sensors::outage::Outage;
use nav_sim_navigation::trajectory::Trajectory;
use nav_sim_signal::imu::{Axis, Channel, Recording};
use nav_sim_signal::noise::Model;
use std::path::PathBuf;

/// Where candidates navigate.
#[derive(Debug)]
pub struct ChoiceDrive {
    /// The reference.
    pub trajectory: Trajectory,
    /// Receiver, start, what filters expect beside the noise model.
    pub scenario: Scenario,
    /// When there are no fixes; at least one.
    pub outages: Vec<Outage>,
    /// Seed of all random numbers.
    pub seed: u64,
    /// Runs on each recording; none: two on each window that lies in it side by side, between 16 and 64.
    pub runs: Option<u64>,
}

/// What was found.
#[derive(Debug)]
#[non_exhaustive]
pub struct Chosen {
    /// The candidates, the winner first.
    pub ranking: Ranking,
    /// What the winner is.
    pub winner: Candidate,
    /// The winner's calibration of all recordings, before any inflation.
    pub calibration: Calibration,
    /// Its noise model.
    pub model: Model,
    /// The recordings that are calibrated on but judge no candidate.
    pub abnormal: Vec<String>,
    /// The files that were read, in the order of the recordings.
    pub files: Vec<PathBuf>,
}

/// Fewest recordings of which one can be left out: two remain to be averaged.
pub(super) const FEWEST: usize = 3;

/// Leaves out one recording after the other, but those that are abnormal, and ranks candidates by what they do on it. Files are read twice, so that
/// no more than a few are in memory. `options.estimators` and the model of `options.settings` count nothing: the
/// candidates have theirs.
///
/// # Errors
/// When recordings cannot be read or are fewer than three, a model cannot be made, or trajectory and rates do not fit
/// together.
pub fn choose(
    paths: &[PathBuf],
    options: &CalibrationOptions,
    candidates: &[Candidate],
    drive: ChoiceDrive,
    context: &Context<'_>,
) -> Result<Chosen, Failure> {
    let options = CalibrationOptions {
        estimators: EstimatorChoice::One(Estimator::Awv),
        ..options.clone()
    };
    let asked_pool = options.pool;
    let mut measured = measure(
        paths,
        &CalibrationOptions {
            pool: None,
            ..options.clone()
        },
        context,
    )?;
    let found_hz = measured.settings.rate_hz;
    let rate_hz = nominal_hz(found_hz, drive.scenario.gnss.rate_hz);
    if rate_hz != found_hz {
        context.remark(format!(
            "the recordings run at {} Hz: taken as {rate_hz} Hz, so that fixes meet samples",
            six_digits(found_hz)
        ));
        measured.settings.rate_hz = rate_hz;
    }
    // The clocks of the files are not quite alike: one rate is that of all.
    let reading = ReadOptions {
        rate_hz: Some(rate_hz),
        ..options.reading.clone()
    };
    let options = CalibrationOptions { reading, ..options };
    let files = measured.report.files.clone();
    if files.len() < FEWEST {
        let message = format!(
            "{} recordings are too few to leave one out: {FEWEST} or more are needed",
            files.len()
        );
        return Err(
            Failure::input(message).hint("each recording is a file; nav-sim calibrate takes fewer")
        );
    }
    let units = units(&measured);
    let samples: Vec<usize> = units.iter().map(samples_in).collect();
    let laboratory = Laboratory::new(units, measured.settings, asked_pool);
    let ChoiceDrive {
        trajectory,
        scenario,
        outages,
        seed,
        runs,
    } = drive;
    let drive = Drive::new(&trajectory, scenario, outages, rate_hz, seed)?;
    let runs: Vec<u64> = samples
        .iter()
        .map(|count| runs.unwrap_or_else(|| runs_on(&drive, *count)))
        .collect();
    let judges = laboratory.judges().map_err(Failure::from)?;
    context.begin("runs", judges.iter().map(|k| runs[*k]).sum());
    let mut folds: Vec<(String, Fold)> = Vec::new();
    for &k in &judges {
        let file = &files[k];
        let read = samples_of(file, &options)?;
        let advance = |n| context.advance(n);
        let fold = drive.leave_out(&laboratory, k, &read, candidates, runs[k], &advance)?;
        folds.push((file.file.clone(), fold));
    }
    context.end();
    let contenders: Vec<Contender> = candidates.iter().map(Contender::from).collect();
    let ranking = Ranking::new(&contenders, &folds);
    let winner = candidates[ranking.winner().index].clone();
    // an estimator of single recordings never wins: this is of all of them
    let (groups, outcomes, settings) =
        laboratory.calibrate(&winner, None).map_err(Failure::from)?;
    let calibrated = model_of(&outcomes, settings.rate_hz);
    let model = drive.inflated(&laboratory, None, &winner, &calibrated)?;
    let calibration = Calibration {
        groups,
        outcomes,
        settings,
        beginnings: Default::default(),
        turn_on: Vec::new(),
    }
    .with_inference(options.bootstrap, &|_| {});
    let is_judge = |(k, _): &(usize, &FileReport)| judges.contains(k);
    let abnormal = files
        .iter()
        .enumerate()
        .filter(|found| !is_judge(found))
        .map(|(_, file)| file.file.clone());
    let abnormal = abnormal.collect();
    let files = files.into_iter().map(|file| file.path).collect();
    Ok(Chosen {
        ranking,
        winner,
        calibration,
        model,
        abnormal,
        files,
    })
}

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
fn units(measured: &Measured) -> Vec<Unit> {
    let signals = || {
        measured.groups.iter().flat_map(|group| {
            let axis_of = move |axis: Option<Axis>| axis.or(group.scope.axis).unwrap_or(Axis::X);
            let channel = move |axis| Channel {
                sensor: group.scope.sensor,
                axis: axis_of(axis),
            };
            group.replicates.iter().map(move |r| (channel(r.axis), r))
        })
    };
    let unit = |file: &FileReport| {
        let names: Vec<String> = file.recordings().map(|(name, _)| name).collect();
        let replicates = signals()
            .filter(|(_, r)| names.contains(&r.name))
            .map(|(c, r)| (c, r.clone()));
        Unit {
            name: file.file.clone(),
            replicates: replicates.collect(),
        }
    };
    measured.report.files.iter().map(unit).collect()
}

/// Samples of a recording that were measured: a warm-up that is left out is not among them.
fn samples_in(unit: &Unit) -> usize {
    let of_channel = |channel: Channel| {
        unit.replicates
            .iter()
            .filter(|(of_channel, _)| *of_channel == channel)
            .map(|(_, r)| r.samples)
            .sum::<usize>()
    };
    Channel::ALL.into_iter().map(of_channel).max().unwrap_or(0)
}

/// Two runs on each window that lies in a recording of so many samples side by side; whole batches.
fn runs_on(drive: &Drive, samples: usize) -> u64 {
    let windows = drive.independent_windows(samples);
    ((2.0 * windows / 8.0).ceil() as u64 * 8).clamp(16, 64)
}

/// The samples that were measured: a warm-up that was left out of the curves is no stretch to navigate on either.
fn samples_of(file: &FileReport, options: &CalibrationOptions) -> Result<Vec<Recording>, Failure> {
    let (read, _) = recordings::read(std::slice::from_ref(&file.path), &options.reading)?;
    let measured = |recording| without_warm_up(recording, options.skip_warm_up).0;
    Ok(read.into_iter().map(measured).collect())
}
