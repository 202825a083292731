//! Ratios between two experiments on the same trajectory with the same outages: what the filter of one
//! believes, relative to the other ([Minaretzis et al.](crate::bibliography::Minaretzis24), Table I).

use super::estimate::{Estimate, PerState, SampleSize};
use super::expected::Expected;
use super::outage::{EpochMetrics, epochs};
use super::verdict::Verdict;
use crate::sensors::outage::Outage;
use crate::simulation::{OutageRecord, REPORTED, RunRecord, RunResult};
use statrs::distribution::{ContinuousCDF, StudentsT};

/// The statistics of one epoch that ratios are made of.
#[derive(Debug, Clone, PartialEq)]
pub struct EpochRow {
    /// Time on the trajectory (s).
    pub t_s: f64,
    /// ASEE of each reported state.
    pub asee: [f64; REPORTED],
    /// RMSE of each reported state.
    pub rmse: [f64; REPORTED],
    /// Mean NEES.
    pub nees: f64,
    /// Share of runs covered.
    pub coverage: f64,
}

impl From<&EpochMetrics> for EpochRow {
    fn from(e: &EpochMetrics) -> Self {
        Self {
            t_s: e.t_s,
            asee: e.asee.0.map(|e| e.value),
            rmse: e.rmse.0.map(|e| e.value),
            nees: e.nees.value,
            coverage: e.coverage,
        }
    }
}

/// The results of an experiment, as far as ratios need them.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Measured {
    /// Epochs in time order.
    pub epochs: Vec<EpochRow>,
    /// Runs in run order.
    pub runs: Vec<RunRecord>,
    /// Outages (start, end) (s).
    pub outages: Vec<(f64, f64)>,
    /// As in [`RunResult`]: runs beyond these share their noise.
    pub independent_windows: Option<f64>,
    /// Whether the one run stands for what covariance analysis expects: it has no Monte-Carlo error.
    pub is_expected: bool,
    /// Of a covariance analysis, the first outage in which errors are beyond linear theory.
    pub beyond_linear: Option<usize>,
}

impl From<&RunResult> for Measured {
    fn from(result: &RunResult) -> Self {
        Self {
            epochs: epochs(result).iter().map(EpochRow::from).collect(),
            runs: result.runs.clone(),
            outages: result.outages.clone(),
            independent_windows: result.independent_windows,
            is_expected: false,
            beyond_linear: None,
        }
    }
}

impl From<&Expected> for Measured {
    fn from(expected: &Expected) -> Self {
        Self {
            epochs: expected.epochs.iter().map(EpochRow::from).collect(),
            runs: vec![expected.record.clone()],
            outages: expected
                .outages
                .iter()
                .map(|o| (o.start_s, o.end_s))
                .collect(),
            independent_windows: None,
            is_expected: true,
            beyond_linear: expected.beyond_linear(),
        }
    }
}

impl Measured {
    /// The runs that were made; none of a covariance analysis.
    pub fn sampled(&self) -> &[RunRecord] {
        if self.is_expected { &[] } else { &self.runs }
    }

    /// Whether the filter is as good as it believes.
    pub fn verdict(&self) -> Verdict {
        match self.runs.as_slice() {
            [record] if self.is_expected => Verdict::expected(record, self.beyond_linear),
            runs => Verdict::of(runs, self.outages.len(), self.independent_windows),
        }
    }
}

/// Why two experiments have no ratio.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum ComparisonError {
    /// Other outages.
    #[error("the outages differ: {candidate} against {reference} of the reference")]
    Outages {
        /// Outages of the candidate, in words.
        candidate: String,
        /// Outages of the reference, in words.
        reference: String,
    },
    /// Other numbers of runs of the same noise: the epochs' statistics are of all runs, not of the common ones.
    #[error("{candidate} runs against {reference} of the reference, of the same seed")]
    Runs {
        /// Runs of the candidate.
        candidate: usize,
        /// Runs of the reference.
        reference: usize,
    },
    /// Other epochs.
    #[error("the reporting epochs differ: {candidate} against {reference} of the reference")]
    Epochs {
        /// Epochs of the candidate, in words.
        candidate: String,
        /// Epochs of the reference, in words.
        reference: String,
    },
}

/// A mean ratio's distance from unity (%) and the 95 % interval of it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RatioError {
    /// (ratio − 1)·100.
    pub pct: f64,
    /// Its interval: of Monte Carlo, and of what the calibrations leave open where that is known
    /// ([`OutageComparison::widen`]). NaN where runs are too few; none where nothing was drawn and nothing else is known.
    pub ci95_pct: Option<[f64; 2]>,
}

/// One state in one outage.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StateRatio {
    /// Mean over the outage's epochs of (ASEE ratio − 1)·100.
    pub asee: RatioError,
    /// Mean over the outage's epochs of |ASEE ratio − 1|·100.
    pub asee_abs_pct: f64,
    /// Half the 95 % interval of the ASEE ratio that the calibrations alone leave (points), where that is known.
    pub calibration_half_pct: Option<f64>,
    /// (ratio − 1)·100 of the RMSE just before the first fix after the outage.
    pub rmse_end: RatioError,
}

/// One outage of a candidate against the reference.
#[derive(Debug, Clone, PartialEq)]
pub struct OutageComparison {
    /// Reported states.
    pub states: [StateRatio; REPORTED],
    /// Mean NEES over the outage's epochs: candidate, reference.
    pub nees: [f64; 2],
    /// Mean coverage over the outage's epochs: candidate, reference.
    pub coverage: [f64; 2],
}

/// The comparison of a candidate with the reference, outage by outage.
///
/// `paired`: whether run k of both saw the same noise (same seed, same truth); the intervals are narrower
/// for it. The interval of the ASEE ratio comes from the per-run means over the outage, a of the candidate
/// and b of the reference, by linearisation: with ρ = ā/b̄, ρ − E ρ ≈ mean(a − ρ b)/b̄.
///
/// # Errors
/// When epochs or outages differ, or the numbers of paired runs.
pub fn compare(
    candidate: &Measured,
    reference: &Measured,
    paired: bool,
) -> Result<Vec<OutageComparison>, ComparisonError> {
    comparable(candidate, reference)?;
    if paired && candidate.runs.len() != reference.runs.len() {
        return Err(ComparisonError::Runs {
            candidate: candidate.runs.len(),
            reference: reference.runs.len(),
        });
    }
    let ratio_of_outage =
        |(i, window): (usize, &(f64, f64))| outage(candidate, reference, i, *window, paired);
    Ok(reference
        .outages
        .iter()
        .enumerate()
        .map(ratio_of_outage)
        .collect())
}

fn comparable(candidate: &Measured, reference: &Measured) -> Result<(), ComparisonError> {
    if candidate.outages != reference.outages {
        let words = |e: &Measured| match e.outages.as_slice() {
            [] => "none".to_owned(),
            all => all
                .iter()
                .map(|(a, b)| format!("{a}:{b}"))
                .collect::<Vec<_>>()
                .join(", "),
        };
        let (candidate, reference) = (words(candidate), words(reference));
        return Err(ComparisonError::Outages {
            candidate,
            reference,
        });
    }
    // To the last bit: epochs of the same schedule are equal, and ratios of unequal epochs would mean
    // nothing.
    let times = |e: &Measured| {
        e.epochs
            .iter()
            .map(|row| row.t_s.to_bits())
            .collect::<Vec<_>>()
    };
    if times(candidate) != times(reference) {
        let words = |e: &Measured| match (e.epochs.first(), e.epochs.last()) {
            (Some(first), Some(last)) => {
                format!("{} from {} to {} s", e.epochs.len(), first.t_s, last.t_s)
            }
            _ => "none".to_owned(),
        };
        let (candidate, reference) = (words(candidate), words(reference));
        return Err(ComparisonError::Epochs {
            candidate,
            reference,
        });
    }
    Ok(())
}

fn outage(
    candidate: &Measured,
    reference: &Measured,
    index: usize,
    (start_s, end_s): (f64, f64),
    paired: bool,
) -> OutageComparison {
    let outage = Outage { start_s, end_s };
    let pick = |e: &Measured| {
        e.epochs
            .iter()
            .filter(|row| outage.withholds(row.t_s))
            .cloned()
            .collect::<Vec<EpochRow>>()
    };
    let (c, r) = (pick(candidate), pick(reference));
    let records = records(candidate, reference, index, paired);
    let windows = [candidate.independent_windows, reference.independent_windows]
        .into_iter()
        .flatten();
    let is_expected = [candidate.is_expected, reference.is_expected];
    let pairing = Pairing {
        paired,
        windows: windows.reduce(f64::min),
        is_expected,
    };
    let state = |i: usize| {
        let ratios: Vec<f64> = c
            .iter()
            .zip(&r)
            .map(|(c, r)| (c.asee[i] / r.asee[i] - 1.0) * 100.0)
            .collect();
        let see = |side: &[&OutageRecord]| side.iter().map(|o| o.see_mean[i]).collect::<Vec<_>>();
        let square = |side: &[&OutageRecord]| {
            side.iter()
                .map(|o| o.error_end[i].powi(2))
                .collect::<Vec<_>>()
        };
        let pct = mean(ratios.iter().copied());
        let asee = pairing.mean_ratio(&see(&records.0), &see(&records.1));
        StateRatio {
            asee: RatioError {
                pct,
                ci95_pct: asee.half_width_pct.map(|half| [pct - half, pct + half]),
            },
            asee_abs_pct: mean(ratios.iter().map(|e| e.abs())),
            calibration_half_pct: None,
            rmse_end: pairing
                .mean_ratio(&square(&records.0), &square(&records.1))
                .root(),
        }
    };
    OutageComparison {
        states: std::array::from_fn(state),
        nees: [
            mean(c.iter().map(|row| row.nees)),
            mean(r.iter().map(|row| row.nees)),
        ],
        coverage: [
            mean(c.iter().map(|row| row.coverage)),
            mean(r.iter().map(|row| row.coverage)),
        ],
    }
}

impl OutageComparison {
    /// Adds to the intervals of the ASEE ratios what the calibrations leave open: the 95 % intervals of the mean ASEE over
    /// the outage, of candidate and reference. The two are taken as independent: of models of the same recordings,
    /// whose errors hang together, the interval is too wide rather than too narrow.
    pub fn widen(&mut self, candidate: &PerState<(f64, f64)>, reference: &PerState<(f64, f64)>) {
        let half_of_log = |(low, high): (f64, f64)| 0.5 * (high / low).ln();
        for (state, (c, r)) in self
            .states
            .iter_mut()
            .zip(candidate.0.iter().zip(&reference.0))
        {
            let RatioError { pct, ci95_pct } = state.asee;
            // In logarithms, where the intervals of scale parameters are nearly symmetric; independent, so
            // squares add.
            let calibration = (100.0 + pct) * half_of_log(*c).hypot(half_of_log(*r));
            // Where nothing was drawn, what the calibrations leave open is all.
            let half = ci95_pct
                .map_or(0.0, |[low, high]| 0.5 * (high - low))
                .hypot(calibration);
            state.asee.ci95_pct = Some([pct - half, pct + half]);
            state.calibration_half_pct = Some(calibration);
        }
    }
}

type Records<'a> = Vec<&'a OutageRecord>;

/// The records of one outage on both sides: of the runs that neither side lost when paired.
fn records<'a>(
    candidate: &'a Measured,
    reference: &'a Measured,
    outage: usize,
    paired: bool,
) -> (Records<'a>, Records<'a>) {
    let kept = |e: &'a Measured| {
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
struct MeanRatio {
    ratio: f64,
    half_width_pct: Option<f64>,
}

impl MeanRatio {
    /// The square root of the ratio, its interval by linearisation of the logarithm: a ratio of squares is skewed, and
    /// none is below zero.
    fn root(&self) -> RatioError {
        let root = self.ratio.sqrt();
        // d ln √R = dR/(2R).
        let half = self
            .half_width_pct
            .map(|half| half / 100.0 / (2.0 * self.ratio));
        let pct = |root: f64| (root - 1.0) * 100.0;
        let interval = |half: f64| [-half, half].map(|x| pct(root * x.exp()));
        RatioError {
            pct: pct(root),
            ci95_pct: half.map(interval),
        }
    }
}

/// How the runs of two experiments belong together.
struct Pairing {
    /// Whether run k of both saw the same noise.
    paired: bool,
    /// Independent windows of noise, where they are limited.
    windows: Option<f64>,
    /// Which side, candidate or reference, has no Monte-Carlo error.
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
            return MeanRatio {
                ratio,
                half_width_pct: None,
            };
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
        MeanRatio {
            ratio,
            half_width_pct: Some(t * variance.sqrt() / mean_b * 100.0),
        }
    }

    fn variance_of_mean(&self, values: &[f64]) -> f64 {
        Estimate::mean_of(values.iter().copied(), self.windows)
            .std_error
            .powi(2)
    }
}

fn mean(values: impl Iterator<Item = f64>) -> f64 {
    let (n, sum) = values.fold((0.0, 0.0), |(n, sum), v| (n + 1.0, sum + v));
    sum / n
}

#[cfg(test)]
#[path = "ratio_tests.rs"]
mod tests;
