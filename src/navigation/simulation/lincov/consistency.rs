//! Consistency of a filter with several truths.

use super::pass::{Assessment, Consistency};
use crate::simulation::{NEES_DOF, REPORTED};

/// The upper end of the interval of a figure, from the figure itself and those of the draws around it.
pub type UpperEnd<'a> = dyn Fn(f64, Vec<f64>) -> f64 + Sync + 'a;

/// What counts of the ratios that the truths have of one error: the largest, or the upper end around the first, below which
/// that itself is not.
fn counted(ratios: &[f64], drawn: Option<&UpperEnd<'_>>) -> f64 {
    match (drawn, ratios) {
        (Some(upper_end), [first, draws @ ..]) => upper_end(*first, draws.to_vec()).max(*first),
        _ => ratios.iter().copied().fold(0.0, f64::max),
    }
}

/// Consistency of a filter with several truths.
#[derive(Debug, Clone, PartialEq)]
pub struct FilterConsistency {
    /// Expected NEES, mean over time and truths; 9 is right.
    pub nees: f64,
    /// Where errors are largest against what is stated, at an outage's end or over the whole run (without outages: at any time).
    pub largest: Departure,
    /// Smallest and largest ratio of any state and of all together, in the first truth where the others are its draws: what
    /// `run` calls the filter by.
    pub range: [f64; 2],
    /// When the outages end (s from the start).
    pub end_s: Vec<f64>,
    /// True RMSE of the reported states at these ends, root mean square over the truths.
    pub rmse_end: Vec<[f64; REPORTED]>,
}

/// An error over what the filter states of it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Departure {
    /// What counts of true RMSE over stated standard deviation in the truths.
    pub ratio: f64,
    /// The reported state.
    pub state: usize,
    /// The outage at whose end it is, counted from 0; none: over the whole run.
    pub outage: Option<usize>,
    /// The truth whose ratio is nearest to what counts, counted from 0.
    pub truth: usize,
}

impl FilterConsistency {
    /// Of one filter under several truths.
    pub(super) fn of(assessments: &[Assessment], drawn: Option<&UpperEnd<'_>>) -> Self {
        let count = assessments.len() as f64;
        let mean =
            |a: &Assessment| a.reports.iter().map(|r| r.nees).sum::<f64>() / a.reports.len() as f64;
        let end_s: Vec<f64> = assessments[0]
            .outage_ends
            .iter()
            .map(|end| end.after_s)
            .collect();
        let mut rmse_end = vec![[0.0; REPORTED]; end_s.len()];
        for assessment in assessments {
            for (sum, end) in rmse_end.iter_mut().zip(&assessment.outage_ends) {
                sum.iter_mut()
                    .zip(&end.rmse)
                    .for_each(|(sum, rmse)| *sum += rmse * rmse / count);
            }
        }
        rmse_end.iter_mut().flatten().for_each(|x| *x = x.sqrt());
        let largest = Departure::largest(&departures(assessments, drawn));
        let nees = assessments.iter().map(mean).sum::<f64>() / count;
        let first = if drawn.is_some() {
            &assessments[..1]
        } else {
            assessments
        };
        let nees_over_run = first.iter().map(mean).sum::<f64>() / first.len() as f64;
        let at_ends = first
            .iter()
            .flat_map(|a| a.outage_ends.iter().map(|end| end.nees));
        let together = std::iter::once(nees_over_run)
            .chain(at_ends)
            .map(|nees| (nees / NEES_DOF as f64).sqrt());
        let places = if end_s.is_empty() {
            over_run_of(first, None).to_vec()
        } else {
            departures(first, None)
        };
        let ratios = places.into_iter().map(|d| d.ratio).chain(together);
        let range = ratios.fold([f64::INFINITY, 0.0], |[low, high], r| {
            [r.min(low), r.max(high)]
        });
        Self {
            nees,
            largest,
            range,
            end_s,
            rmse_end,
        }
    }

    /// Horizontal RMSE at the end of each outage (m).
    pub fn horizontal_m(&self) -> impl Iterator<Item = f64> {
        self.rmse_end.iter().map(|rmse| rmse[0].hypot(rmse[1]))
    }
}

impl Departure {
    fn largest(all: &[Self]) -> Self {
        let none = Self {
            ratio: 0.0,
            state: 0,
            outage: None,
            truth: 0,
        };
        all.iter()
            .fold(none, |a, b| if b.ratio > a.ratio { *b } else { a })
    }
}

/// What draws add to the first truth under a filter, as factors; they hardly depend on the filter.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct DrawFactors {
    /// The upper end of each ratio, in the order of [`departures`].
    ratios: Vec<f64>,
    /// The same of the ratios over the whole run.
    over_run: [f64; REPORTED],
    /// The mean NEES of all.
    nees: f64,
    /// The root mean square of all at the ends of outages.
    rmse_end: Vec<[f64; REPORTED]>,
}

impl DrawFactors {
    /// Of a filter under the first truth and its draws, whose consistency is known.
    pub(super) fn of(
        assessments: &[Assessment],
        drawn: &UpperEnd<'_>,
        consistency: &FilterConsistency,
    ) -> Self {
        let first = &assessments[..1];
        let (all, alone) = (
            departures(assessments, Some(drawn)),
            departures(first, None),
        );
        let over_run = over_run_of(assessments, Some(drawn)).map(|d| d.ratio);
        let alone_over_run = over_run_of(first, None).map(|d| d.ratio);
        let alone_consistency = FilterConsistency::of(first, None);
        let over = |all: &[f64; REPORTED], alone: &[f64; REPORTED]| {
            std::array::from_fn(|i| all[i] / alone[i])
        };
        let rmse_end = consistency.rmse_end.iter().zip(&alone_consistency.rmse_end);
        Self {
            ratios: all
                .iter()
                .zip(&alone)
                .map(|(all, alone)| all.ratio / alone.ratio)
                .collect(),
            over_run: over(&over_run, &alone_over_run),
            nees: consistency.nees / alone_consistency.nees,
            rmse_end: rmse_end.map(|(all, alone)| over(all, alone)).collect(),
        }
    }

    /// The consistency of another filter, by the first truth.
    pub(super) fn consistency(&self, first: &[Assessment]) -> FilterConsistency {
        let mut consistency = FilterConsistency::of(first, None);
        let mut departures = departures(first, None);
        departures
            .iter_mut()
            .zip(&self.ratios)
            .for_each(|(d, margin)| d.ratio *= margin);
        consistency.largest = Departure::largest(&departures);
        consistency.nees *= self.nees;
        let ends = consistency.rmse_end.iter_mut().flatten();
        ends.zip(self.rmse_end.iter().flatten())
            .for_each(|(rmse, margin)| *rmse *= margin);
        consistency
    }

    /// Takes the errors of the first truth to the upper ends of their intervals.
    pub(super) fn enlarge(&self, first: &mut Assessment) {
        let ends = first.outage_ends.iter_mut().flat_map(|end| &mut end.rmse);
        ends.zip(&self.ratios)
            .for_each(|(rmse, margin)| *rmse *= margin);
        for report in &mut first.reports {
            report
                .rmse
                .iter_mut()
                .zip(&self.over_run)
                .for_each(|(rmse, margin)| *rmse *= margin);
        }
    }
}

/// Every state at every place where a filter is judged: at the ends of outages and then over the whole run; without outages
/// wherever it reports.
fn departures(assessments: &[Assessment], drawn: Option<&UpperEnd<'_>>) -> Vec<Departure> {
    let at = |outage: Option<usize>, instants: fn(&Assessment) -> &[Consistency], k: usize| {
        states(assessments, drawn, outage, &|a| instants(a)[k].ratio())
    };
    match assessments[0].outage_ends.len() {
        0 => (0..assessments[0].reports.len())
            .flat_map(|k| at(None, |a| &a.reports, k))
            .collect(),
        ends => {
            let at_ends = (0..ends).flat_map(|k| at(Some(k), |a| &a.outage_ends, k));
            at_ends.chain(over_run_of(assessments, drawn)).collect()
        }
    }
}

fn over_run_of(assessments: &[Assessment], drawn: Option<&UpperEnd<'_>>) -> [Departure; REPORTED] {
    states(assessments, drawn, None, &Assessment::ratio_over_run)
}

/// Every state at one place.
fn states(
    assessments: &[Assessment],
    drawn: Option<&UpperEnd<'_>>,
    outage: Option<usize>,
    ratios: &dyn Fn(&Assessment) -> [f64; REPORTED],
) -> [Departure; REPORTED] {
    let of_truths: Vec<[f64; REPORTED]> = assessments.iter().map(ratios).collect();
    std::array::from_fn(|state| {
        let ratios: Vec<f64> = of_truths.iter().map(|of_truth| of_truth[state]).collect();
        let ratio = counted(&ratios, drawn);
        let distance = |truth: &usize| (ratios[*truth] - ratio).abs();
        let truth = (0..ratios.len()).min_by(|a, b| distance(a).total_cmp(&distance(b)));
        Departure {
            ratio,
            state,
            outage,
            truth: truth.unwrap_or(0),
        }
    })
}
