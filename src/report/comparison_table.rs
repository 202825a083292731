//! The layout of the paper's Table I: scenario by outage, state by estimator.

use super::comparison::{CandidateResult, Label, in_order};
use super::number::{readable, shortest, window};
use super::short_names;
use nav_sim_navigation::metrics::RatioError;
use nav_sim_navigation::simulation::REPORTED_NAMES;

/// The paper's Table I: rows scenario × outage, columns state × estimator; each cell the signed mean ratio
/// error with half its 95 % interval, and in brackets the mean of the absolute ratio error (%). The first
/// row is the head; an interval below half a hundredth has one digit; `states` are indices of reported states.
pub(crate) fn table_rows(candidates: &[CandidateResult], states: &[usize]) -> Vec<Vec<String>> {
    let heads: Vec<String> = states.iter().map(|s| REPORTED_NAMES[*s].to_owned()).collect();
    laid_out(candidates, &heads, &|candidate, outage, column| cell(candidate, outage, states[column]))
}

/// The same for other programs, the first row the head: one row a run, outage and state, every number in a cell of its own,
/// and no number for the reference itself.
pub(crate) fn ratio_rows(
    candidates: &[CandidateResult],
    states: &[usize],
    outages: &[(f64, f64)],
    reference: &str,
) -> Vec<Vec<String>> {
    let head = [
        "scenario",
        "estimator",
        "run",
        "reference",
        "outage_start_s",
        "outage_end_s",
        "state",
        "ratio_error_pct",
        "ci95_low_pct",
        "ci95_high_pct",
        "calibration_half_pct",
        "abs_ratio_error_pct",
    ];
    let mut rows = vec![head.map(str::to_owned).to_vec()];
    let number = |x: Option<f64>| x.filter(|x| x.is_finite()).map_or_else(String::new, shortest);
    for (candidate, Label { scenario, estimator }) in candidates.iter().zip(distinct_labels(candidates)) {
        for (outage, (start_s, end_s)) in candidate.outages.iter().zip(outages) {
            rows.extend(states.iter().map(|state| {
                let found = (!candidate.is_reference).then_some(outage.states[*state]);
                let names = [scenario.as_str(), &estimator, &candidate.run, reference].map(str::to_owned);
                let window = [*start_s, *end_s].map(shortest);
                let numbers = [
                    found.map(|ratio| ratio.asee.pct),
                    found.and_then(|ratio| Some(ratio.asee.ci95_pct?[0])),
                    found.and_then(|ratio| Some(ratio.asee.ci95_pct?[1])),
                    found.and_then(|ratio| ratio.calibration_half_pct),
                    found.map(|ratio| ratio.asee_abs_pct),
                ];
                let state = REPORTED_NAMES[*state].to_owned();
                names.into_iter().chain(window).chain([state]).chain(numbers.map(number)).collect()
            }));
        }
    }
    rows
}

/// Outages by their times in the place of their numbers.
pub(crate) fn with_times(mut rows: Vec<Vec<String>>, outages: &[(f64, f64)]) -> Vec<Vec<String>> {
    for row in rows.iter_mut().skip(1) {
        let time = row[1].parse::<usize>().ok().and_then(|k| outages.get(k - 1));
        row[1] = time.map_or_else(String::new, |w| window(w.0, w.1));
    }
    rows
}

/// Beside Table I, in its layout: mean NEES and coverage over the outage, and (ratio − 1)·100 of the RMSE at
/// its end with half its 95 % interval, for each of the `states`.
pub(crate) fn consistency_rows(candidates: &[CandidateResult], states: &[usize]) -> Vec<Vec<String>> {
    let consistency = |candidate: &CandidateResult, outage: usize, _: usize| {
        let found = &candidate.outages[outage];
        let mut parts = vec![readable(found.nees[0]), format!("{:.3}", found.coverage[0])];
        parts.extend(states.iter().map(|s| match candidate.is_reference {
            true => "–".to_owned(),
            false => signed(&found.states[*s].rmse_end),
        }));
        parts.join(", ")
    };
    laid_out(candidates, &["NEES, coverage, RMSE".to_owned()], &consistency)
}

/// Rows scenario × outage, columns `heads` × estimator.
fn laid_out(
    candidates: &[CandidateResult],
    heads: &[String],
    cell: &dyn Fn(&CandidateResult, usize, usize) -> String,
) -> Vec<Vec<String>> {
    let labels = distinct_labels(candidates);
    let scenarios = in_order(labels.iter().map(|label| label.scenario.as_str()));
    let estimators = in_order(labels.iter().map(|label| label.estimator.as_str()));
    let columns = || (0..heads.len()).flat_map(|s| estimators.iter().map(move |e| (s, *e)));
    let name = |(s, e): (usize, &str)| format!("{} {e}", heads[s]).trim_end().to_owned();
    let mut rows = vec![["scenario", "outage"].map(str::to_owned).to_vec()];
    rows[0].extend(columns().map(name));
    let outages = candidates.iter().map(|c| c.outages.len()).max().unwrap_or(0);
    for scenario in scenarios {
        for outage in 0..outages {
            let cell_of = |(column, estimator): (usize, &str)| {
                let here = |label: &Label| label.scenario == scenario && label.estimator == estimator;
                let found = labels.iter().position(here).map(|i| &candidates[i]);
                let found = found.filter(|c| outage < c.outages.len());
                found.map_or_else(String::new, |c| cell(c, outage, column))
            };
            let mut row = vec![scenario.to_owned(), (outage + 1).to_string()];
            row.extend(columns().map(cell_of));
            rows.push(row);
        }
    }
    rows
}

/// The places of candidates, each its own: those that would share one have rows of their names, and a
/// number if even these are the same.
fn distinct_labels(candidates: &[CandidateResult]) -> Vec<Label> {
    let shared = |c: &CandidateResult| candidates.iter().filter(|o| o.label == c.label).count() > 1;
    let names = short_names(&candidates.iter().map(|c| c.run.as_str()).collect::<Vec<_>>());
    let mut labels: Vec<Label> = Vec::new();
    for (candidate, name) in candidates.iter().zip(names) {
        let mut label = candidate.label.clone();
        if shared(candidate) {
            label.scenario = name;
        }
        let name = label.scenario.clone();
        let taken = |label: &Label, labels: &[Label]| {
            labels.contains(label)
                || candidates.iter().any(|c| !shared(c) && shared(candidate) && c.label == *label)
        };
        let mut number = 1;
        while taken(&label, &labels) {
            number += 1;
            label.scenario = format!("{name} ({number})");
        }
        labels.push(label);
    }
    labels
}

fn cell(candidate: &CandidateResult, outage: usize, state: usize) -> String {
    if candidate.is_reference {
        return "–".to_owned();
    }
    let ratio = candidate.outages[outage].states[state];
    format!("{} ({:.2})", signed(&ratio.asee), ratio.asee_abs_pct)
}

/// A ratio's distance from unity with half its 95 % interval (%).
fn signed(error: &RatioError) -> String {
    let interval = match error.ci95_pct.map(|[low, high]| (high - low) / 2.0) {
        Some(half) if half >= 0.005 => format!(" ± {half:.2}"),
        // below that it is the rounding of equal ratios
        Some(half) if half > 1e-9 => format!(" ± {half:.0e}"),
        _ => String::new(),
    };
    format!("{:+.2}{interval}", error.pct)
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use nav_sim_navigation::metrics::{OutageComparison, StateRatio, Verdict};

    pub(in crate::report) fn candidate(run: &str, pct: f64, is_reference: bool) -> CandidateResult {
        let error = RatioError { pct, ci95_pct: Some([pct - 0.5, pct + 0.5]) };
        let state = StateRatio {
            asee: error,
            asee_abs_pct: pct.abs() + 1.0,
            calibration_half_pct: None,
            rmse_end: error,
        };
        let outage = OutageComparison { states: [state; 9], nees: [9.5, 9.0], coverage: [0.9, 0.95] };
        let outages = vec![outage.clone(), outage];
        let verdict = Verdict::of(&[], 2, None);
        let label = Label::of(run, None);
        CandidateResult { run: run.into(), label, is_reference, is_paired: true, verdict, outages }
    }

    #[test]
    fn the_table_is_laid_out_as_the_papers() {
        let all = [
            candidate("I/awv", 0.0, true),
            candidate("I/sr-awv", 0.96, false),
            candidate("II/awv", -75.0, false),
        ];
        let rows = table_rows(&all, &[1, 6]);
        assert_eq!(
            rows[0],
            ["scenario", "outage", "pos_e_m AWV", "pos_e_m SR-AWV", "roll_deg AWV", "roll_deg SR-AWV"]
        );
        assert_eq!(rows[1], ["I", "1", "–", "+0.96 ± 0.50 (1.96)", "–", "+0.96 ± 0.50 (1.96)"]);
        assert_eq!(rows[4][..4], ["II", "2", "-75.00 ± 0.50 (76.00)", ""]);
        let rows = consistency_rows(&all, &[1, 6]);
        assert_eq!(rows[0][2], "NEES, coverage, RMSE AWV");
        assert_eq!(rows[1][2..], ["9.50, 0.900, –, –", "9.50, 0.900, +0.96 ± 0.50, +0.96 ± 0.50"]);
    }

    #[test]
    fn every_number_of_the_table_for_other_programs_is_one() {
        let all = [candidate("I/awv", 0.0, true), candidate("II/sr-awv", -75.0, false)];
        let rows = ratio_rows(&all, &[1, 6], &[(4.0, 8.0), (20.0, 30.5)], "I/awv");
        assert_eq!(rows.len(), 1 + 2 * 2 * 2);
        assert!(rows.iter().all(|row| row.len() == rows[0].len()));
        assert_eq!(rows[1], ["I", "AWV", "I/awv", "I/awv", "4", "8", "pos_e_m", "", "", "", "", ""]);
        assert_eq!(
            rows[8],
            [
                "II",
                "SR-AWV",
                "II/sr-awv",
                "I/awv",
                "20",
                "30.5",
                "roll_deg",
                "-75",
                "-75.5",
                "-74.5",
                "",
                "76"
            ]
        );
    }

    #[test]
    fn candidates_that_would_share_a_place_all_have_one() {
        let runs = ["a/drive", "b/drive", "x/I_awv", "y/I_awv", "c", "c"];
        let all: Vec<_> = (1..).zip(runs).map(|(k, run)| candidate(run, f64::from(k), false)).collect();
        let rows = table_rows(&all, &[0]);
        let names: Vec<&str> = rows[1..].iter().step_by(2).map(|row| row[0].as_str()).collect();
        assert_eq!(names, ["a/drive", "b/drive", "x/I_awv", "y/I_awv", "c", "c (2)"]);
        assert_eq!(rows.len(), 1 + 2 * all.len());
        for (k, row) in rows[1..].iter().enumerate() {
            let shown = format!("+{}.00", k / 2 + 1);
            assert_eq!(row.iter().filter(|text| text.starts_with(&shown)).count(), 1, "{row:?}");
        }
    }
}
