//! "My six recordings disagree: which do I use?" Each replicate against the others, scale by scale, and what
//! leaving it out does to each estimator.

use super::average::{Estimator, Replicate, average};
use super::pipeline::Settings;
use super::replicates::Group;
use super::robust_scale::{deviation, median};
use super::spread::variance_of_log;
use crate::imu::Axis;
use crate::wavelet::interval::{edof_eta3, edof_robust};

/// A score this large at [`SCALES`] scales, or one of [`GROSS`] at one, makes a replicate abnormal.
const LARGE: f64 = 5.0;
/// See [`LARGE`].
const SCALES: usize = 3;
/// See [`LARGE`].
const GROSS: f64 = 10.0;
/// Fewer replicates cannot say which of them is abnormal.
const FEWEST: usize = 4;

/// What is abnormal about a replicate.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Verdict {
    /// Nothing.
    Normal,
    /// Its classical wavelet variance is, its robust one is not: outliers within it.
    Outliers,
    /// Its robust wavelet variance is: its noise is another.
    Noise,
}

impl Verdict {
    /// Name in files.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Normal => "normal",
            Self::Outliers => "outliers",
            Self::Noise => "abnormal",
        }
    }
}

/// One replicate against the others of its axis.
///
/// A score is (ln nu − median of the others)/s; s is the larger of 1.4826 MAD of the others and what the
/// degrees of freedom eta3 predict, so neither an accidentally narrow MAD nor an honest difference between
/// replicates raises alarms.
#[derive(Debug, Clone, PartialEq)]
pub struct ReplicateDiagnosis {
    /// Recording.
    pub name: String,
    /// Axis.
    pub axis: Option<Axis>,
    /// Scores of the classical wavelet variance, level 1 first; empty when there are fewer than four replicates.
    pub classical: Vec<f64>,
    /// Scores of the robust wavelet variance.
    pub robust: Vec<f64>,
    /// What they say.
    pub verdict: Verdict,
    /// What leaving it out does.
    pub left_out: Vec<LeftOut>,
}

/// How far an estimator's curve moves when one replicate is left out.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LeftOut {
    /// The estimator.
    pub estimator: Estimator,
    /// Level at which the curve moves most, in standard deviations of its own.
    pub level: u32,
    /// nu without it over nu with it, less one, there.
    pub change: f64,
    /// The same in standard deviations of ln nu of the curve.
    pub deviations: f64,
}

/// Diagnoses every replicate of a group. Without two replicates there is nothing to compare.
#[must_use]
pub fn diagnose(group: &Group, settings: &Settings) -> Vec<ReplicateDiagnosis> {
    let all = &group.replicates;
    if all.len() < 2 {
        return Vec::new();
    }
    (0..all.len()).map(|i| replicate(all, i, settings)).collect()
}

fn replicate(all: &[Replicate], index: usize, settings: &Settings) -> ReplicateDiagnosis {
    let own = &all[index];
    let alike = |(i, r): &(usize, &Replicate)| *i != index && r.axis == own.axis;
    let others: Vec<&Replicate> = all.iter().enumerate().filter(alike).map(|(_, r)| r).collect();
    let efficiency = settings.tuning.efficiency();
    let [classical, robust] = [Estimator::Awv, Estimator::SrAwv].map(|e| scores(own, &others, e, efficiency));
    let verdict = match (abnormal(&classical), abnormal(&robust)) {
        (_, true) => Verdict::Noise,
        (true, false) => Verdict::Outliers,
        _ => Verdict::Normal,
    };
    let left_out = settings.estimators.iter().filter_map(|e| left_out(all, index, *e, settings)).collect();
    ReplicateDiagnosis { name: own.name.clone(), axis: own.axis, classical, robust, verdict, left_out }
}

/// Levels at which a replicate is far from the others.
#[must_use]
pub fn large(scores: &[f64]) -> Vec<u32> {
    (1..).zip(scores).filter(|(_, z)| z.abs() > LARGE).map(|(level, _)| level).collect()
}

fn abnormal(scores: &[f64]) -> bool {
    large(scores).len() >= SCALES || scores.iter().any(|z| z.abs() > GROSS)
}

fn scores(own: &Replicate, others: &[&Replicate], estimator: Estimator, efficiency: f64) -> Vec<f64> {
    if others.len() + 1 < FEWEST {
        return Vec::new();
    }
    let levels = others.iter().map(|r| r.classical.len()).chain([own.classical.len()]).min().unwrap_or(0);
    let score = |i: usize| {
        let logs: Vec<f64> = others.iter().map(|r| r.value(estimator, i).ln()).collect();
        let variance = |r: &Replicate| {
            let eta3 = edof_eta3(r.samples, i as u32 + 1);
            variance_of_log(if estimator.is_robust() { edof_robust(eta3, efficiency) } else { eta3 })
        };
        // The median of n values has π/2 times the variance of their mean.
        let centre = std::f64::consts::FRAC_PI_2 / (others.len() * others.len()) as f64;
        let noise = variance(own) + centre * others.iter().map(|r| variance(r)).sum::<f64>();
        (own.value(estimator, i).ln() - median(&logs)) / noise.sqrt().max(deviation(&logs))
    };
    // A silent scale (coarse quantisation) has no logarithm, and says nothing.
    (0..levels).map(score).map(|z| if z.is_finite() { z } else { 0.0 }).collect()
}

fn left_out(all: &[Replicate], index: usize, estimator: Estimator, settings: &Settings) -> Option<LeftOut> {
    let rest: Vec<Replicate> =
        all.iter().enumerate().filter(|(i, _)| *i != index).map(|(_, r)| r.clone()).collect();
    let curve = |r: &[Replicate]| average(r, estimator, settings.trim, settings.tuning.efficiency()).ok();
    let (with, without) = (curve(all)?, curve(&rest)?);
    let moves = with.levels.iter().zip(&with.wv).zip(&with.edof).zip(&without.wv);
    let one = |(((level, with), edof), without): (((&u32, &f64), &f64), &f64)| {
        let ratio = without / with;
        let deviations = ratio.ln() / variance_of_log(*edof).sqrt();
        LeftOut { estimator, level: *level, change: ratio - 1.0, deviations }
    };
    moves.map(one).max_by(|a, b| a.deviations.abs().total_cmp(&b.deviations.abs()))
}

/// The answer in words: a line for each abnormal replicate, and which to use.
#[must_use]
pub fn advice(diagnoses: &[ReplicateDiagnosis], settings: &Settings) -> Vec<String> {
    let scored = diagnoses.iter().any(|d| !d.classical.is_empty());
    if diagnoses.is_empty() {
        return Vec::new();
    }
    if !scored {
        return vec!["too few replicates to tell which of them is abnormal: four are needed".to_owned()];
    }
    let abnormal: Vec<&ReplicateDiagnosis> =
        diagnoses.iter().filter(|d| d.verdict != Verdict::Normal).collect();
    let mut lines: Vec<String> = abnormal.iter().map(|d| describe(d, settings.rate_hz)).collect();
    lines.push(answer(diagnoses.len(), &abnormal));
    lines
}

fn describe(diagnosis: &ReplicateDiagnosis, rate_hz: f64) -> String {
    let (scores, what) = match diagnosis.verdict {
        Verdict::Noise => {
            (&diagnosis.robust, "its noise is not that of the others (robust wavelet variance)")
        }
        _ => (&diagnosis.classical, "outliers within it (classical wavelet variance; the robust one agrees)"),
    };
    let axis = diagnosis.axis.map_or(String::new(), |a| format!(" {}", a.name()));
    let levels = large(scores);
    let tau = |level: u32| f64::from(level).exp2() / rate_hz;
    let worst = (1_u32..).zip(scores).max_by(|a, b| a.1.abs().total_cmp(&b.1.abs())).unwrap_or((1, &0.0));
    let range = match (levels.first(), levels.last()) {
        (Some(a), Some(b)) if a != b => {
            format!("{} of {} scales from {} s to {} s", levels.len(), scores.len(), tau(*a), tau(*b))
        }
        _ => "one scale".to_owned(),
    };
    let moves: Vec<String> = diagnosis
        .left_out
        .iter()
        .map(|l| format!("{} by {:+.0} % (at {} s)", l.estimator.name(), 100.0 * l.change, tau(l.level)))
        .collect();
    let moves =
        if moves.is_empty() { String::new() } else { format!("; left out, it moves {}", moves.join(", ")) };
    format!(
        "{}{axis} is abnormal: {what} at {range}, most at {} s ({:+.0} deviations){moves}",
        diagnosis.name,
        tau(worst.0),
        worst.1
    )
}

fn answer(count: usize, abnormal: &[&ReplicateDiagnosis]) -> String {
    let noise = abnormal.iter().filter(|d| d.verdict == Verdict::Noise).count();
    match (abnormal.len(), noise) {
        (0, _) => format!("the {count} replicates agree: use them all, with any estimator"),
        (_, 0) => "use all of them with sr-awv or dr-awv: the outliers hardly touch those".to_owned(),
        (_, n) if 2 * n < count => format!(
            "use dr-awv with a --trim of at least {n}, or leave the abnormal recordings out once you know \
             what happened to them"
        ),
        _ => "half of them or more are abnormal: there is no majority to trust; look at the recordings"
            .to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::calibration::{ModelSpec, Trim, Weighting};
    use crate::imu::Sensor;
    use crate::rng::StreamKey;
    use crate::wavelet::{Convention, Tuning, both};
    use rand::RngExt;
    use rand_distr::StandardNormal;

    fn settings() -> Settings {
        Settings {
            estimators: vec![Estimator::Awv, Estimator::SrAwv, Estimator::DrAwv],
            spec: ModelSpec::n1(),
            trim: Trim::Count(1),
            tuning: Tuning::new(0.6, Convention::Exact).unwrap(),
            weighting: Weighting::Edof,
            rate_hz: 1.0,
        }
    }

    fn noise(set: u64, run: u64) -> Vec<f64> {
        let mut generator = StreamKey { seed: set, scenario: "", run, source: "", process: "" }.generator();
        (0..4096).map(|_| generator.sample::<f64, _>(StandardNormal)).collect()
    }

    fn group(signals: &[Vec<f64>]) -> Group {
        let replicate = |(i, signal): (usize, &Vec<f64>)| {
            let (classical, robust) = both(signal, 11, &settings().tuning).unwrap();
            Replicate {
                name: format!("run{i}"),
                axis: Some(Axis::X),
                samples: signal.len(),
                classical,
                robust,
            }
        };
        let replicates = signals.iter().enumerate().map(replicate).collect();
        Group { sensor: Sensor::Accel, axis: Some(Axis::X), replicates }
    }

    /// 40 sets of 6 alike replicates: no more than one false alarm (a score is Student-like at worst, and three
    /// of eleven scales must pass five deviations of a conservative law).
    #[test]
    fn alike_replicates_raise_no_alarm() {
        let mut alarms = 0;
        for set in 0..40 {
            let signals: Vec<Vec<f64>> = (0..6).map(|run| noise(set, run)).collect();
            let diagnoses = diagnose(&group(&signals), &settings());
            alarms += diagnoses.iter().filter(|d| d.verdict != Verdict::Normal).count();
        }
        assert!(alarms <= 1, "{alarms} of 240");
    }

    /// One replicate with a few spikes, one with half as much noise again.
    #[test]
    fn outliers_and_another_noise_are_told_apart() {
        let mut signals: Vec<Vec<f64>> = (0..7).map(|run| noise(100, run)).collect();
        (0..3).for_each(|i| signals[2][100 + 1300 * i] += 100.0);
        signals[5].iter_mut().for_each(|x| *x *= 1.5);
        let diagnoses = diagnose(&group(&signals), &settings());
        let verdicts: Vec<Verdict> = diagnoses.iter().map(|d| d.verdict).collect();
        use Verdict::{Noise, Normal, Outliers};
        assert_eq!(verdicts, [Normal, Normal, Outliers, Normal, Normal, Noise, Normal]);
        // 3 spikes of 100² on 4096 samples make AWV 1 + 7.3/7: it halves without them. The others stay
        // within what the noise of their curves allows.
        let left_out = &diagnoses[2].left_out;
        assert!((left_out[0].change + 0.5).abs() < 0.15 && left_out[0].deviations < -10.0, "{left_out:?}");
        assert!(left_out[1].deviations.abs() < 3.0 && left_out[2].deviations.abs() < 3.0, "{left_out:?}");
        let words = advice(&diagnoses, &settings());
        assert_eq!(words.len(), 3);
        assert!(words[0].starts_with("run2 x is abnormal: outliers within it"), "{}", words[0]);
        assert!(words[2].starts_with("use dr-awv with a --trim of at least 1"), "{}", words[2]);
    }

    #[test]
    fn three_replicates_cannot_say_which() {
        let signals: Vec<Vec<f64>> = (0..3).map(|run| noise(7, run)).collect();
        let diagnoses = diagnose(&group(&signals), &settings());
        assert!(diagnoses.iter().all(|d| d.classical.is_empty()));
        assert!(advice(&diagnoses, &settings())[0].starts_with("too few replicates"));
        assert!(diagnose(&group(&signals[..1]), &settings()).is_empty());
    }
}
