//! Candidates beside one another, recording by recording.

use super::candidates::{Candidate, Fold};
use nav_sim_navigation::linalg::mean;
use nav_sim_navigation::simulation::{NEES_DOF, OutageRecord, RunRecord};
use serde::Serialize;
use statrs::distribution::{ChiSquared, ContinuousCDF, StudentsT};

/// Fewest recordings for a useful interval: with three, its half-width is 2.5 times their standard deviation.
const MIN_RECORDINGS: usize = 4;
/// A recording whose errors are this many times as large in NEES as any filter assumes is described by no candidate.
const UNDESCRIBED_NEES: f64 = 2.0 * 9.0;

/// A mean over recordings.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct RecordingMean {
    /// Its value.
    pub value: f64,
    /// 95 % interval (Student's t, the recording as unit, widened for what folds share); not finite (null) of one
    /// recording.
    pub ci95: (f64, f64),
}

/// A candidate beside the winner, on the same recordings.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Difference {
    /// Its log score less the winner's (nats an outage end); negative is worse.
    pub log_score: RecordingMean,
    /// Its interval, simultaneous for all candidates together at 95 % (Bonferroni).
    pub joint95: (f64, f64),
}

/// A candidate on one recording.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct FoldScore {
    /// The recording that was left out.
    pub recording: String,
    /// Windows of it.
    pub windows: u64,
    /// Its score.
    #[serde(flatten)]
    pub score: Score,
}

/// A candidate with its place.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct RankedCandidate {
    /// In words.
    pub candidate: String,
    /// `best`, `tied` with it, or `single`: of one recording, for comparison.
    pub place: &'static str,
    /// Its index among those that were given.
    pub index: usize,
    /// True if it may be chosen; others are shown for comparison.
    pub eligible: bool,
    /// True for the winner and for candidates indistinguishable from it.
    pub tied: bool,
    /// Mean log score (nats an outage end).
    pub log_score: RecordingMean,
    /// Horizontal RMSE at the ends of outages (m), root mean square over recordings.
    pub rmse_m: f64,
    /// Standard deviation that its filter states for it (m).
    pub believed_m: f64,
    /// Mean NEES at the ends of outages; 9 is right.
    pub nees: RecordingMean,
    /// Share of the ends within the filter's 95 % ellipsoid.
    pub coverage: f64,
    /// Beside the winner.
    pub difference: Difference,
    /// Recording by recording.
    pub folds: Vec<FoldScore>,
}

/// All candidates, the best first, those that may be chosen before the others.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Ranking {
    /// The candidate of the highest mean score of those that may be chosen.
    pub winner: String,
    /// Candidates that the data cannot tell from the winner.
    pub tied: Vec<String>,
    /// The candidates.
    pub candidates: Vec<RankedCandidate>,
    /// Recordings that no candidate describes: the least NEES of all is above 18 where 9 is right.
    pub undescribed: Vec<String>,
    /// True if the data distinguish the winner from at least one other eligible candidate.
    pub tells: bool,
}

impl Ranking {
    /// Ranks the candidates by their scores on each left-out recording.
    ///
    /// # Panics
    /// Without an eligible candidate, or without a recording.
    pub fn new(candidates: &[Candidate], folds: &[Fold]) -> Self {
        let eligible: Vec<usize> = (0..candidates.len())
            .filter(|c| candidates[*c].is_eligible())
            .collect();
        let score = |c: usize| folds.iter().map(|f| f.scores[c].all.log_score).sum::<f64>();
        // the first of equals
        let higher = |best: usize, c: usize| if score(c) > score(best) { c } else { best };
        let winner = eligible.iter().copied().reduce(higher);
        let winner = winner.expect("candidate");
        let rivals = eligible.len().saturating_sub(1).max(1);
        let mut placed: Vec<RankedCandidate> = (0..candidates.len())
            .map(|c| place(c, &candidates[c], winner, rivals, folds))
            .collect();
        placed.sort_by(|a, b| {
            b.eligible
                .cmp(&a.eligible)
                .then(b.log_score.value.total_cmp(&a.log_score.value))
        });
        let fails = |f: &&Fold| !f.scores.iter().any(|s| s.all.nees <= UNDESCRIBED_NEES);
        let undescribed = folds.iter().filter(fails).map(|f| f.recording.clone());
        let tells = folds.len() >= MIN_RECORDINGS && placed.iter().any(|p| p.eligible && !p.tied);
        let tied = placed.iter().skip(1).filter(|p| p.place == "tied");
        Self {
            winner: placed[0].candidate.clone(),
            tied: tied.map(|p| p.candidate.clone()).collect(),
            candidates: placed,
            undescribed: undescribed.collect(),
            tells,
        }
    }
}

fn place(
    c: usize,
    candidate: &Candidate,
    winner: usize,
    rivals: usize,
    folds: &[Fold],
) -> RankedCandidate {
    let scores = || folds.iter().map(|fold| &fold.scores[c]);
    let per_recording = |value: &dyn Fn(&Score) -> f64| scores().map(value).collect::<Vec<f64>>();
    let log_scores = folds
        .iter()
        .map(|f| &f.scores)
        .map(|s| (s[c].all.log_score, s[winner].all.log_score));
    let density: Vec<f64> = log_scores.map(|(own, best)| own - best).collect();
    let (log_score, joint95) = (
        mean_with_interval(&density, 0.05),
        mean_with_interval(&density, 0.05 / rivals as f64).ci95,
    );
    let root_mean_square =
        |values: Vec<f64>| (values.iter().map(|x| x * x).sum::<f64>() / values.len() as f64).sqrt();
    let fold = |fold: &Fold| FoldScore {
        recording: fold.recording.clone(),
        windows: fold.windows,
        score: fold.scores[c].clone(),
    };
    // where nothing is known of the difference, nothing tells them apart
    let is_worse = joint95.1 < 0.0 || log_score.value == f64::NEG_INFINITY;
    let (eligible, tied) = (candidate.is_eligible(), c == winner || !is_worse);
    RankedCandidate {
        candidate: candidate.to_string(),
        place: match (c == winner, eligible, tied) {
            (true, ..) => "best",
            (_, false, _) => "single",
            (_, _, true) => "tied",
            _ => "",
        },
        index: c,
        eligible,
        tied,
        log_score: mean_with_interval(&per_recording(&|s| s.all.log_score), 0.05),
        rmse_m: root_mean_square(per_recording(&|s| s.all.rmse_m)),
        believed_m: root_mean_square(per_recording(&|s| s.all.believed_m)),
        nees: log_interval(mean_with_interval(&per_recording(&|s| s.all.nees), 0.05)),
        coverage: mean(scores().map(|s| s.coverage)),
        difference: Difference { log_score, joint95 },
        folds: folds.iter().map(fold).collect(),
    }
}

/// Interval of a positive quantity: symmetric in its logarithm, of the same half-width to first order.
fn log_interval(RecordingMean { value, ci95 }: RecordingMean) -> RecordingMean {
    let factor = ((ci95.1 - value) / value).exp();
    RecordingMean {
        value,
        ci95: (value / factor, value * factor),
    }
}

/// Mean of values, one per recording, and its interval at level 1 − `alpha`. Models of two folds share all but two
/// recordings, so their scores are correlated: the variance of the mean is (1/K + 1/(K − 1)) of that of a score
/// ([Nadeau and Bengio 2003](https://doi.org/10.1023/A:1024068626366), one recording tested for K − 1 calibrated on).
/// In simulations the interval without 1/(K − 1) covered 87 % instead of 95 %.
fn mean_with_interval(values: &[f64], alpha: f64) -> RecordingMean {
    let n = values.len() as f64;
    let value = values.iter().sum::<f64>() / n;
    let variance = values.iter().map(|x| (x - value).powi(2)).sum::<f64>() / (n - 1.0);
    let t = StudentsT::new(0.0, 1.0, n - 1.0)
        .map_or(f64::NAN, |law| law.inverse_cdf(1.0 - 0.5 * alpha));
    let half = t * (variance * (1.0 / n + 1.0 / (n - 1.0))).sqrt();
    RecordingMean {
        value,
        ci95: (value - half, value + half),
    }
}

#[cfg(test)]
mod ranking_tests {
    use super::*;
    use nav_sim_calibration::Estimator;

    fn fold(scores: [f64; 2]) -> Fold {
        let score = |log_score: f64| Score {
            all: EndScore {
                rmse_m: 10.0 - log_score,
                believed_m: 10.0,
                nees: 9.0,
                log_score,
            },
            coverage: 0.95,
            diverged: 0,
            outages: Vec::new(),
        };
        Fold {
            recording: "a".to_owned(),
            windows: 16,
            scores: scores.map(score).to_vec(),
        }
    }

    #[test]
    fn the_interval_of_what_is_positive_is_positive() {
        let nees = log_interval(RecordingMean {
            value: 30.0,
            ci95: (-20.0, 80.0),
        });
        assert!(
            nees.ci95.0 > 0.0 && (nees.ci95.0 * nees.ci95.1 / 900.0 - 1.0).abs() < 1e-12,
            "{nees:?}"
        );
    }

    fn ranked(second: Estimator, folds: &[[f64; 2]]) -> Ranking {
        let candidate = |estimator| Candidate::new(estimator, "WN".parse().unwrap());
        let candidates = [Estimator::Awv, second].map(candidate);
        let named = |(k, scores): (usize, &[f64; 2])| Fold {
            recording: format!("r{k}"),
            ..fold(*scores)
        };
        let folds: Vec<Fold> = folds.iter().enumerate().map(named).collect();
        Ranking::new(&candidates, &folds)
    }

    /// Student's t with three degrees of freedom: 3.182446 at 0.975; variance 5/3 of a score, 1/4 + 1/3 of it of the mean.
    #[test]
    fn intervals_are_those_of_student_with_shared_recordings() {
        let found = mean_with_interval(&[1.0, 2.0, 3.0, 4.0], 0.05);
        let half = 3.182_446_305_284_263 * (5.0_f64 / 3.0 * 7.0 / 12.0).sqrt();
        assert!((found.value - 2.5).abs() < 1e-15);
        assert!((found.ci95.1 - 2.5 - half).abs() < 1e-9, "{found:?}");
    }

    /// Recordings differ by far more than candidates; what counts is the difference on each.
    #[test]
    fn differences_are_paired() {
        let found = ranked(
            Estimator::SrAwv,
            &[
                [-10.0, -11.0],
                [-50.0, -51.1],
                [-20.0, -20.9],
                [-90.0, -91.0],
            ],
        );
        assert!(found.tells && found.candidates[0].index == 0 && !found.candidates[1].tied);
        assert!((found.candidates[1].difference.log_score.value + 1.0).abs() < 1e-12);
    }

    /// One recording against three: it decides, and the interval says that nothing is known.
    #[test]
    fn a_recording_that_decides_is_named() {
        let found = ranked(
            Estimator::SrAwv,
            &[
                [-10.0, -11.0],
                [-10.0, -11.0],
                [-10.0, -11.0],
                [-30.0, -10.0],
            ],
        );
        assert_eq!((found.candidates[0].index, found.tells), (1, false));
        assert!(found.candidates.iter().all(|c| c.tied));
    }

    #[test]
    fn three_recordings_tell_nothing_and_single_estimators_never_win() {
        let found = ranked(
            Estimator::Gmwm,
            &[[-10.0, -1.0], [-10.0, -1.1], [-10.0, -0.9]],
        );
        assert!(!found.tells && found.candidates[0].index == 0 && !found.candidates[1].eligible);
    }

    #[test]
    fn a_candidate_that_diverges_is_last() {
        let run = RunRecord {
            diverged: true,
            ..RunRecord::default()
        };
        let diverged = Score::of(&[run], 1).all.log_score;
        let found = ranked(
            Estimator::SrAwv,
            &[
                [diverged, -11.0],
                [-1.0, -11.0],
                [-1.0, -11.0],
                [-1.0, -11.0],
            ],
        );
        assert_eq!(
            (found.candidates[0].index, found.candidates[1].index),
            (1, 0)
        );
        assert!(!found.candidates[1].tied);
    }
}

// How good a filter was at the ends of outages.

/// A filter on one recording, over all outages.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Score {
    /// Over all outages; the log score is minus infinity (null) where a run diverged.
    #[serde(flatten)]
    pub all: EndScore,
    /// Share of errors within the filter's 95 % ellipsoid of the nine states.
    pub coverage: f64,
    /// Runs that diverged; they are in no mean.
    pub diverged: usize,
    /// Outage by outage.
    pub outages: Vec<EndScore>,
}

/// A filter at the end of an outage.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct EndScore {
    /// Horizontal RMSE (m).
    pub rmse_m: f64,
    /// Standard deviation that the filter states for it (m).
    pub believed_m: f64,
    /// Mean NEES of position, velocity and attitude; 9 is right.
    pub nees: f64,
    /// Mean log density of the nine errors (m, m/s, rad) under the filter's belief (nats).
    pub log_score: f64,
}

impl Score {
    /// Scores the runs of one candidate with this number of outages.
    pub(crate) fn of(runs: &[RunRecord], outages: usize) -> Self {
        let kept: Vec<&[OutageRecord]> = runs
            .iter()
            .filter(|r| !r.diverged)
            .map(|r| r.outages.as_slice())
            .collect();
        let end = |i: usize| {
            let mean =
                |value: &dyn Fn(&OutageRecord) -> f64| mean(kept.iter().map(|run| value(&run[i])));
            EndScore {
                rmse_m: mean(&|o| o.horizontal_error_end_m.powi(2)).sqrt(),
                believed_m: mean(&|o| o.see_end[0].powi(2) + o.see_end[1].powi(2)).sqrt(),
                nees: mean(&|o| o.nees_end),
                log_score: mean(&|o| o.log_density_end),
            }
        };
        let outages: Vec<EndScore> = (0..outages).map(end).collect();
        let over = |value: &dyn Fn(&EndScore) -> f64| mean(outages.iter().map(value));
        let limit = ChiSquared::new(NEES_DOF as f64).map_or(f64::NAN, |law| law.inverse_cdf(0.95));
        let inside = |o: &OutageRecord| f64::from(u8::from(o.nees_end <= limit));
        let diverged = runs.len() - kept.len();
        Self {
            all: EndScore {
                rmse_m: over(&|o| o.rmse_m.powi(2)).sqrt(),
                believed_m: over(&|o| o.believed_m.powi(2)).sqrt(),
                nees: over(&|o| o.nees),
                log_score: if diverged > 0 {
                    f64::NEG_INFINITY
                } else {
                    over(&|o| o.log_score)
                },
            },
            coverage: mean(kept.iter().flat_map(|run| run.iter()).map(inside)),
            diverged,
            outages,
        }
    }
}
