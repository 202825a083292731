//! Calibrating from recordings.

use super::output::{self, outputs};
use super::{Args, EstimatorArg, PoolArg, bootstrap, free_parameters, of_calibration};
use crate::cli::{Failure, Session, read};
use nav_sim::calibration::{
    Estimator, Pool, Replicate, Settings, SignalError, WarmUp, calibrate, grouped, replicates, warm_up,
};
use nav_sim::formats::hash;
use nav_sim::formats::recordings::{FileReport, Report};
use nav_sim::imu::{Channel, Recording, Signal};
use nav_sim::wavelet::{Tuning, default_levels};
use rayon::prelude::*;
use std::path::{Path, PathBuf};

pub(super) fn run(args: &Args, settings: &mut Settings, session: &Session) -> Result<(), Failure> {
    let out = args.out.as_deref().unwrap_or(Path::new("model.toml"));
    output::writable(out)?;
    if args.out.is_none() {
        output::not_of_others(out)?;
    }
    // As many scales as parameters, and one that the default leaves out.
    let needed = args.tuning.scales.map_or(2 << free_parameters(&settings.model), |j| 1 << j);
    let tuning = settings.tuning;
    let look = |recording: Recording| Look::new(&recording, args.tuning.scales, &tuning);
    let (looks, report) = args.recordings.visit(&args.inputs, needed, session, &look)?;
    let looks = looks.into_iter().collect::<Result<Vec<_>, _>>()?;
    distinct(&looks)?;
    disjoint(&report)?;
    settings.rate_hz = report.files[0].rate_hz;
    warm_ups(&looks, args.recordings.skip_s(), settings.rate_hz, session);
    shortest(&report, args.tuning.scales, session);
    let recordings = report.files.iter().map(|f| f.samples.len()).sum();
    settings.estimators = estimators(args.estimator, recordings)?;
    let pool = pool(args, settings)?;
    let files: Vec<PathBuf> = report.files.iter().map(|f| f.path.clone()).collect();
    let guarded: Vec<PathBuf> = files.iter().chain(&args.parameters).cloned().collect();
    let outputs = outputs(out, &settings.estimators, &guarded)?;
    let inputs = files.iter().map(|f| read::input("recording", f)).collect::<Result<Vec<_>, _>>()?;
    let measured = looks.into_iter().flat_map(|look| look.replicates).collect();
    let groups = grouped(measured, pool);
    let mut outcomes = calibrate(&groups, settings).map_err(|e| of_calibration(&e))?;
    bootstrap(args, &groups, &mut outcomes, settings, session);
    let note = output::note(args, settings, inputs, session)?;
    output::finish(&outputs, &groups, &outcomes, settings, &note, session)
}

/// What is kept of a recording, or of one signal of it.
struct Look {
    recording: String,
    /// What tells the samples of each signal from others.
    signals: Vec<(Channel, String)>,
    warm_ups: Vec<(Channel, WarmUp)>,
    replicates: Vec<(Channel, Replicate)>,
}

impl Look {
    fn new(recording: &Recording, levels: Option<u32>, tuning: &Tuning) -> Result<Self, SignalError> {
        let of_signal = |s: &Signal| warm_up(&s.samples).map(|w| (s.channel, w));
        Ok(Self {
            recording: recording.name.clone(),
            signals: recording.signals.par_iter().map(|s| (s.channel, hash::samples(&s.samples))).collect(),
            warm_ups: recording.signals.par_iter().filter_map(of_signal).collect(),
            replicates: replicates(recording, levels, tuning)?,
        })
    }
}

/// Says which recordings do not begin as they go on after what was skipped, and what to leave out.
fn warm_ups(looks: &[Look], skipped_s: f64, rate_hz: f64, session: &Session) {
    for of_one in looks.chunk_by(|a, b| a.recording == b.recording) {
        let found: Vec<&(Channel, WarmUp)> = of_one.iter().flat_map(|look| &look.warm_ups).collect();
        let Some((_, longest)) = found.iter().max_by_key(|(_, w)| w.samples) else { continue };
        let one = |(channel, w): &&(Channel, WarmUp)| {
            let what = if w.mean { "its mean moves" } else { "its noise is another" };
            format!("{channel} ({what}, {:+.0} deviations)", w.deviations)
        };
        session.printer.warn(&format!(
            "{}: not stationary at its beginning: {}; warm-up? --skip-s {} leaves that out",
            of_one[0].recording,
            found.iter().map(one).collect::<Vec<_>>().join(", "),
            (skipped_s + longest.samples as f64 / rate_hz).ceil()
        ));
    }
}

/// Says which recording is so much shorter than the others that it costs all of them scales.
fn shortest(report: &Report, scales: Option<u32>, session: &Session) {
    let levels = |samples: usize| scales.unwrap_or(u32::MAX).min(default_levels(samples));
    let recordings = report.files.iter().flat_map(FileReport::recordings);
    let Some((file, samples)) = recordings.clone().min_by_key(|(_, samples)| levels(*samples)) else {
        return;
    };
    let mut found: Vec<u32> = recordings.map(|(_, samples)| levels(samples)).collect();
    found.sort_unstable();
    let (fewest, usual) = (found[0], found[found.len() / 2]);
    if fewest < usual {
        session.printer.warn(&format!(
            "{file}: its {samples} samples limit all recordings to {fewest} scales; without it there would be more \
             (half of them have {usual}): leave it out for those"
        ));
    }
}

fn estimators(arg: EstimatorArg, recordings: usize) -> Result<Vec<Estimator>, Failure> {
    let estimators = match arg {
        EstimatorArg::Awv => vec![Estimator::Awv],
        EstimatorArg::SrAwv => vec![Estimator::SrAwv],
        EstimatorArg::DrAwv => vec![Estimator::DrAwv],
        EstimatorArg::Gmwm => vec![Estimator::Gmwm],
        EstimatorArg::Rgmwm => vec![Estimator::Rgmwm],
        EstimatorArg::Avlr => vec![Estimator::Avlr],
        EstimatorArg::All if recordings == 1 => vec![Estimator::Gmwm, Estimator::Rgmwm],
        EstimatorArg::All => vec![Estimator::Awv, Estimator::SrAwv, Estimator::DrAwv],
    };
    match estimators.iter().find(|e| e.is_single() && recordings > 1) {
        None => Ok(estimators),
        Some(e) => {
            let message =
                format!("--estimator {} takes one recording at a time; there are {recordings}", e.name());
            Err(Failure::input(message).hint("awv, sr-awv and dr-awv take several"))
        }
    }
}

fn pool(args: &Args, settings: &Settings) -> Result<Pool, Failure> {
    let single = settings.estimators.iter().any(|e| e.is_single());
    match args.pool {
        Some(PoolArg::Axes) => Ok(Pool::Axes),
        Some(PoolArg::Sensor) if single => {
            Err(Failure::input("--pool sensor: gmwm, rgmwm and avlr take one signal at a time")
                .hint("--pool axes"))
        }
        Some(PoolArg::Sensor) => Ok(Pool::Sensor),
        None if single => Ok(Pool::Axes),
        None => Ok(Pool::Sensor),
    }
}

/// Refuses copies of a recording: one replicate would count as two, and intervals come out too narrow.
fn distinct(looks: &[Look]) -> Result<(), Failure> {
    for (i, look) in looks.iter().enumerate() {
        let copy = |other: &&Look| {
            other.recording != look.recording && other.signals.iter().any(|s| look.signals.contains(s))
        };
        if let Some(first) = looks[..i].iter().find(copy) {
            let (copy, first) = (&look.recording, &first.recording);
            let message = format!("{copy} is a copy of {first}: it would count as two replicates");
            return Err(Failure::input(message).hint("leave one of them out"));
        }
    }
    Ok(())
}

/// Refuses recordings that have samples in common, such as a copy less its first rows: as copies.
fn disjoint(report: &Report) -> Result<(), Failure> {
    let Some((one, other, share)) = report.overlap() else { return Ok(()) };
    let percent = 100.0 * share;
    let message = format!(
        "{other} and {one} have samples in common, about {percent:.0} % of each: they are no two replicates"
    );
    Err(Failure::input(message).hint("leave one of them out, or cut off the rows that both have"))
}
