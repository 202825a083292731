//! Ratios between two experiments on the same trajectory with the same outages: what the filter of one
//! believes, relative to the other ([Minaretzis et al.](crate::bibliography::Minaretzis24), Table I).

use super::estimate::{Estimate, PerState, SampleSize};
use crate::linalg::mean;
use crate::sensors::outage::Outage;
use crate::simulation::{OutageRecord, REPORTED, RunRecord};
use serde::Serialize;
use statrs::distribution::{ContinuousCDF, StudentsT};

/// The statistics of one epoch that ratios are made of.
#[derive(Debug, Clone)]
pub struct EpochRow {
    /// Time on the trajectory (s).
    pub t_s: f64,
    /// ASEE of each reported state.
    pub asee: [f64; REPORTED],
    /// Mean NEES.
    pub nees: f64,
    /// Share of runs covered.
    pub coverage: f64,
}

/// The results of an experiment, as far as ratios need them.
#[derive(Debug, Clone)]
pub struct ExperimentResult {
    /// Epochs in time order.
    pub epochs: Vec<EpochRow>,
    /// Runs in run order.
    pub runs: Vec<RunRecord>,
    /// Outages (start, end) (s).
    pub outages: Vec<(f64, f64)>,
    /// Number of independent windows, as in [`RunResult`](crate::simulation::RunResult): more runs
    /// than these share their noise.
    pub independent_windows: Option<f64>,
    /// True if the one run is the expectation of a covariance analysis: it has no Monte-Carlo
    /// error.
    pub is_expected: bool,
}

/// One state in one outage.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct StateRatio {
    /// Mean over the outage's epochs of (ASEE ratio − 1)·100.
    pub ratio_error_pct: f64,
    /// Its 95 % interval: of Monte Carlo, and of what the calibrations leave open where that is known
    /// ([`OutageComparison::widen`]). NaN where runs are too few; none where nothing was drawn and nothing else is known.
    pub ci95_pct: Option<[f64; 2]>,
    /// Half the 95 % interval of the ASEE ratio that the calibrations alone leave (points, linearised), where that is known.
    pub calibration_half_pct: Option<f64>,
    /// Mean over the outage's epochs of |ASEE ratio − 1|·100.
    pub abs_ratio_error_pct: f64,
    /// (ratio − 1)·100 of the RMSE just before the first fix after the outage.
    pub rmse_end_ratio_error_pct: f64,
    /// Its 95 % Monte-Carlo interval; none where nothing was drawn.
    pub rmse_end_ci95_pct: Option<[f64; 2]>,
}

/// One outage of a candidate against the reference.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct OutageComparison {
    /// Reported states.
    #[serde(skip)]
    pub states: [StateRatio; REPORTED],
    /// Mean NEES over the outage's epochs.
    pub nees_mean: f64,
    /// The reference's.
    pub nees_mean_reference: f64,
    /// Mean coverage over the outage's epochs.
    pub coverage_mean: f64,
    /// The reference's.
    pub coverage_mean_reference: f64,
}

/// The comparison of a candidate with the reference, outage by outage.
///
/// `paired`: whether run k of both saw the same noise (same seed, same truth); the intervals are narrower
/// for it. The interval of the ASEE ratio comes from the per-run means over the outage, a of the candidate
/// and b of the reference, by linearisation: with ρ = ā/b̄, ρ − E ρ ≈ mean(a − ρ b)/b̄.
///
/// # Errors
/// When epochs or outages differ.
pub fn compare(
    candidate: &ExperimentResult,
    reference: &ExperimentResult,
    paired: bool,
) -> Result<Vec<OutageComparison>, String> {
    let differ = |what: &str, words: &dyn Fn(&ExperimentResult) -> String| {
        let [own, other] = [candidate, reference].map(words);
        format!("the {what} differ: {own} against {other} of the reference")
    };
    if candidate.outages != reference.outages {
        return Err(differ("outages", &|e| match e.outages.as_slice() {
            [] => "none".to_owned(),
            all => {
                let windows = all.iter().map(|(a, b)| format!("{a}:{b}"));
                windows.collect::<Vec<_>>().join(", ")
            }
        }));
    }
    // To the last bit: epochs of the same schedule are equal, and ratios of unequal epochs would mean
    // nothing.
    let time = |row: &EpochRow| row.t_s.to_bits();
    let times = candidate.epochs.iter().map(time);
    if times.ne(reference.epochs.iter().map(time)) {
        return Err(differ("reporting epochs", &|e| {
            let ends = [e.epochs.first(), e.epochs.last()];
            let [first, last] = ends.map(|row| row.map_or(f64::NAN, |row| row.t_s));
            format!("{} from {first} to {last} s", e.epochs.len())
        }));
    }
    let outages = reference.outages.iter().enumerate();
    let of_outage =
        |(i, window): (usize, &(f64, f64))| outage(candidate, reference, i, *window, paired);
    Ok(outages.map(of_outage).collect())
}

fn outage(
    candidate: &ExperimentResult,
    reference: &ExperimentResult,
    index: usize,
    (start_s, end_s): (f64, f64),
    paired: bool,
) -> OutageComparison {
    let outage = Outage { start_s, end_s };
    let [c, r] = [candidate, reference].map(|e| {
        let within = e.epochs.iter().filter(|row| outage.withholds(row.t_s));
        within.collect::<Vec<_>>()
    });
    let sides = records(candidate, reference, index, paired);
    let windows = [candidate.independent_windows, reference.independent_windows]
        .into_iter()
        .flatten();
    let pairing = Pairing {
        paired,
        windows: windows.reduce(f64::min),
        is_expected: [candidate.is_expected, reference.is_expected],
    };
    let mean_ratio = |value: &dyn Fn(&OutageRecord) -> f64| {
        let [a, b] = [&sides.0, &sides.1].map(|side| side.iter().map(|o| value(o)).collect());
        let [a, b]: [Vec<f64>; 2] = [a, b];
        pairing.mean_ratio(&a, &b)
    };
    let state = |i: usize| {
        let ratios = c.iter().zip(&r);
        let ratios = ratios.map(|(c, r)| (c.asee[i] / r.asee[i] - 1.0) * 100.0);
        let pct = mean(ratios.clone());
        let (_, half) = mean_ratio(&|o| o.see_mean[i]);
        let (rmse, rmse_ci95) = root(mean_ratio(&|o| o.error_end[i].powi(2)));
        StateRatio {
            ratio_error_pct: pct,
            ci95_pct: half.map(|half| [pct - half, pct + half]),
            calibration_half_pct: None,
            abs_ratio_error_pct: mean(ratios.map(f64::abs)),
            rmse_end_ratio_error_pct: rmse,
            rmse_end_ci95_pct: rmse_ci95,
        }
    };
    let [nees, coverage] = [|row: &EpochRow| row.nees, |row: &EpochRow| row.coverage]
        .map(|value| [&c, &r].map(|side| mean(side.iter().map(|row| value(row)))));
    OutageComparison {
        states: std::array::from_fn(state),
        nees_mean: nees[0],
        nees_mean_reference: nees[1],
        coverage_mean: coverage[0],
        coverage_mean_reference: coverage[1],
    }
}

impl OutageComparison {
    /// Adds to the intervals of the ASEE ratios what the calibrations leave open: the 95 % intervals of the mean ASEE over
    /// the outage of candidate and reference, each where it is known. The two are taken as independent: of models of the
    /// same recordings, whose errors hang together, the interval is too wide rather than too narrow.
    pub fn widen(&mut self, calibrations: &[PerState<(f64, f64)>]) {
        for (i, state) in self.states.iter_mut().enumerate() {
            // In logarithms, where the intervals of scale parameters are nearly symmetric and no ratio is below zero;
            // independent, so squares add.
            let half_of_log = |of: &PerState<(f64, f64)>| 0.5 * (of.0[i].1 / of.0[i].0).ln();
            let calibration = calibrations.iter().map(half_of_log).fold(0.0, f64::hypot);
            let ratio = 100.0 + state.ratio_error_pct;
            // Where nothing was drawn, what the calibrations leave open is all.
            let sampled = state
                .ci95_pct
                .map_or(0.0, |[low, high]| 0.5 * (high - low) / ratio);
            let half = sampled.hypot(calibration);
            state.ci95_pct = Some([-half, half].map(|half| ratio * half.exp() - 100.0));
            state.calibration_half_pct = Some(ratio * calibration);
        }
    }
}

type Records<'a> = Vec<&'a OutageRecord>;

/// The records of one outage on both sides: of the runs that neither side lost when paired.
fn records<'a>(
    candidate: &'a ExperimentResult,
    reference: &'a ExperimentResult,
    outage: usize,
    paired: bool,
) -> (Records<'a>, Records<'a>) {
    let kept = |e: &'a ExperimentResult| {
        e.runs
            .iter()
            .filter(|r| !r.diverged && r.outages.len() > outage)
    };
    let record = |r: &'a RunRecord| &r.outages[outage];
    if !paired {
        return (
            kept(candidate).map(record).collect(),
            kept(reference).map(record).collect(),
        );
    }
    let of_run: std::collections::HashMap<u64, &RunRecord> =
        kept(reference).map(|r| (r.run, r)).collect();
    kept(candidate)
        .filter_map(|c| Some((record(c), record(of_run.get(&c.run)?))))
        .unzip()
}

/// A ratio of means and half the width of its 95 % interval (%); none where no side was sampled.
type MeanRatio = (f64, Option<f64>);

/// The square root of a ratio less 1 (%), its interval by linearisation of the logarithm: a ratio of squares is skewed, and none
/// is below zero.
fn root((ratio, half_width_pct): MeanRatio) -> (f64, Option<[f64; 2]>) {
    let root = ratio.sqrt();
    // d ln √R = dR/(2R).
    let half = half_width_pct.map(|half| half / 100.0 / (2.0 * ratio));
    let pct = |root: f64| (root - 1.0) * 100.0;
    let interval = |half: f64| [-half, half].map(|x| pct(root * x.exp()));
    (pct(root), half.map(interval))
}

/// Correspondence between the runs of two experiments.
struct Pairing {
    /// True if run k of both had the same noise.
    paired: bool,
    /// Independent windows of noise, where they are limited.
    windows: Option<f64>,
    /// The side, candidate or reference, has no Monte-Carlo error.
    is_expected: [bool; 2],
}

impl Pairing {
    fn mean_ratio(&self, a: &[f64], b: &[f64]) -> MeanRatio {
        let (mean_a, mean_b) = (mean(a.iter().copied()), mean(b.iter().copied()));
        let ratio = mean_a / mean_b;
        let sampled: Vec<&[f64]> = [a, b]
            .into_iter()
            .zip(self.is_expected)
            .filter_map(|(side, exact)| (!exact).then_some(side))
            .collect();
        let Some(fewest) = sampled.iter().map(|side| side.len()).min() else {
            return (ratio, None);
        };
        let variance = if sampled.len() == 1 {
            // Var(a/b̄) is Var(ā)/b̄² with b certain, and ρ² Var(b̄)/b̄² with a certain.
            let scale = if self.is_expected[0] {
                ratio * ratio
            } else {
                1.0
            };
            scale * self.variance_of_mean(sampled[0])
        } else if self.paired {
            // What both runs of a pair have in common cancels here: the reason for drawing the same noise
            // twice.
            let differences: Vec<f64> = a.iter().zip(b).map(|(a, b)| a - ratio * b).collect();
            self.variance_of_mean(&differences)
        } else {
            self.variance_of_mean(a) + ratio * ratio * self.variance_of_mean(b)
        };
        // The smaller sample decides: fewer degrees of freedom make a wider interval, never a narrower one.
        let freedom = SampleSize::of(fewest as u64, self.windows).independent - 1.0;
        let t = StudentsT::new(0.0, 1.0, freedom).map_or(f64::NAN, |t| t.inverse_cdf(0.975));
        (ratio, Some(t * variance.sqrt() / mean_b * 100.0))
    }

    fn variance_of_mean(&self, values: &[f64]) -> f64 {
        Estimate::mean_of(values.iter().copied(), self.windows)
            .std_error
            .powi(2)
    }
}

#[cfg(test)]
#[path = "ratio_tests.rs"]
mod tests;
