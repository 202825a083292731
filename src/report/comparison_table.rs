//! The layout of the paper's Table I: scenario by outage, state by estimator.

use super::verdict::axis_of;
use nav_sim_document::{Cell, Table, short_names, shortest, window};
use nav_sim_navigation::metrics::{OutageComparison, RatioError, Verdict};
use nav_sim_navigation::simulation::REPORTED_NAMES;

/// Estimators by the names their run directories end in.
const ESTIMATORS: [&str; 6] = ["sr-awv", "dr-awv", "awv", "rgmwm", "gmwm", "avlr"];

/// Where a run stands in Table I: its row (scenario) and column (estimator, may be empty).
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Label {
    /// Row.
    pub scenario: String,
    /// Column.
    pub estimator: String,
}

impl Label {
    /// From a run directory's name: `II_sr-awv` or `II/sr-awv` is scenario II, estimator SR-AWV. A name
    /// that ends in no estimator is a scenario of its own; the estimator is then the one the model was
    /// made with, if known.
    pub(crate) fn of(directory: &str, model_estimator: Option<&str>) -> Self {
        let parts: Vec<&str> = directory
            .split('/')
            .filter(|p| !p.is_empty() && *p != ".")
            .collect();
        let name = parts.last().copied().unwrap_or(directory);
        let lower = name.to_lowercase();
        for estimator in ESTIMATORS {
            let Some(head) = lower.strip_suffix(estimator) else {
                continue;
            };
            let parent = parts.len().checked_sub(2).map_or("", |i| parts[i]);
            let separated = head.ends_with(['_', '-', '.', ' ']);
            let scenario = match head.len() {
                0 => parent,
                n if separated => name[..n].trim_end_matches(['_', '-', '.', ' ']),
                _ => continue,
            };
            return Self {
                scenario: scenario.to_owned(),
                estimator: estimator.to_uppercase(),
            };
        }
        let estimator = model_estimator.unwrap_or_default().to_uppercase();
        Self {
            scenario: name.to_owned(),
            estimator,
        }
    }
}

/// A candidate and what the comparison with the reference found.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct CandidateResult {
    /// Run directory.
    pub run: String,
    /// Its place in the table.
    pub label: Label,
    /// Whether it is the reference itself.
    pub is_reference: bool,
    /// Whether run k saw the same noise as that of the reference.
    pub is_paired: bool,
    /// Whether its filter is as good as it believes.
    pub verdict: Verdict,
    /// Outage by outage.
    pub outages: Vec<OutageComparison>,
}

/// Candidates by scenario and estimator, both in the order in which they were given.
pub(crate) struct Layout<'a> {
    candidates: &'a [CandidateResult],
    labels: Vec<Label>,
    /// Scenarios.
    pub scenarios: Vec<String>,
    /// Estimators; one without a name where none is known.
    pub estimators: Vec<String>,
}

impl<'a> Layout<'a> {
    /// Of candidates, each in a place of its own.
    pub(crate) fn of(candidates: &'a [CandidateResult]) -> Self {
        let labels = distinct_labels(candidates);
        let scenarios = in_order(labels.iter().map(|label| label.scenario.as_str()));
        let estimators = in_order(labels.iter().map(|label| label.estimator.as_str()));
        let owned = |names: Vec<&str>| names.into_iter().map(str::to_owned).collect();
        Self {
            candidates,
            scenarios: owned(scenarios),
            estimators: owned(estimators),
            labels,
        }
    }

    /// Whether scenarios and estimators are known, so that they can stand beside one another.
    pub(crate) fn is_grid(&self) -> bool {
        self.scenarios.len() > 1
            && self.estimators.len() > 1
            && self.estimators.iter().all(|e| !e.is_empty())
    }

    /// Ratio of one place; empty where there is none.
    fn cell(&self, scenario: &str, estimator: &str, outage: usize, state: usize) -> Cell {
        let here = |label: &Label| label.scenario == scenario && label.estimator == estimator;
        let found = self
            .labels
            .iter()
            .position(here)
            .map(|i| &self.candidates[i]);
        match found.map(|c| (c.is_reference, c.outages.get(outage))) {
            Some((true, _)) => Cell::figures("reference"),
            Some((false, Some(found))) => Cell::figures(signed(&found.states[state].asee)),
            _ => Cell::figures(""),
        }
    }

    /// A row a scenario, outage and state, a column an estimator.
    pub(crate) fn by_state(&self, states: &[usize], outages: &[(f64, f64)]) -> Table {
        let heads = self
            .estimators
            .iter()
            .map(|estimator| format!("{estimator} (%)").trim_start().to_owned());
        let mut table = Table::new(["scenario", "outage", "state"])
            .and(heads)
            .with_keys(3);
        for scenario in &self.scenarios {
            for (outage, (start_s, end_s)) in outages.iter().enumerate() {
                for state in states {
                    let keys = [
                        scenario.clone(),
                        window(*start_s, *end_s),
                        axis_of(*state).to_owned(),
                    ];
                    let cells = self
                        .estimators
                        .iter()
                        .map(|e| self.cell(scenario, e, outage, *state));
                    table.row(keys.into_iter().map(Cell::from).chain(cells));
                }
            }
        }
        table
    }
}

/// The paper's Table I: a row a scenario and outage, a column a state and estimator; (ASEE ratio − 1)·100 with half its
/// 95 % interval.
pub(crate) fn ratio_table(
    candidates: &[CandidateResult],
    states: &[usize],
    outages: &[(f64, f64)],
) -> Table {
    let layout = Layout::of(candidates);
    let columns = || {
        states
            .iter()
            .flat_map(|s| layout.estimators.iter().map(move |e| (*s, e)))
    };
    let name =
        |(s, e): (usize, &String)| format!("{} {e}", axis_of(s)).trim_end().to_owned() + " (%)";
    let mut table = Table::new(["scenario", "outage"])
        .and(columns().map(name))
        .with_keys(2);
    for scenario in &layout.scenarios {
        for (outage, (start_s, end_s)) in outages.iter().enumerate() {
            let keys = [scenario.clone(), window(*start_s, *end_s)].map(Cell::from);
            table.row(
                keys.into_iter()
                    .chain(columns().map(|(s, e)| layout.cell(scenario, e, outage, s))),
            );
        }
    }
    table
}

/// Ratios for other programs: one row a run, outage and state, every number in a cell of its own,
/// and no number for the reference itself.
pub(crate) fn ratio_rows(
    candidates: &[CandidateResult],
    states: &[usize],
    outages: &[(f64, f64)],
    reference: &str,
) -> Table {
    let mut table = Table::new([
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
    ]);
    let number = |x: Option<f64>| {
        x.filter(|x| x.is_finite())
            .map_or_else(String::new, shortest)
    };
    for (
        candidate,
        Label {
            scenario,
            estimator,
        },
    ) in candidates.iter().zip(distinct_labels(candidates))
    {
        for (outage, (start_s, end_s)) in candidate.outages.iter().zip(outages) {
            for state in states {
                let found = (!candidate.is_reference).then_some(outage.states[*state]);
                let names =
                    [scenario.as_str(), &estimator, &candidate.run, reference].map(str::to_owned);
                let window = [*start_s, *end_s].map(shortest);
                let numbers = [
                    found.map(|ratio| ratio.asee.pct),
                    found.and_then(|ratio| Some(ratio.asee.ci95_pct?[0])),
                    found.and_then(|ratio| Some(ratio.asee.ci95_pct?[1])),
                    found.and_then(|ratio| ratio.calibration_half_pct),
                    found.map(|ratio| ratio.asee_abs_pct),
                ];
                let state = REPORTED_NAMES[*state].to_owned();
                let cells = names
                    .into_iter()
                    .chain(window)
                    .chain([state])
                    .chain(numbers.map(number));
                table.row(cells.map(Cell::from));
            }
        }
    }
    table
}

/// The places of candidates, each its own: those that would share one have rows of their names, and a
/// number if even these are the same.
fn distinct_labels(candidates: &[CandidateResult]) -> Vec<Label> {
    let shared = |c: &CandidateResult| candidates.iter().filter(|o| o.label == c.label).count() > 1;
    let names = short_names(
        &candidates
            .iter()
            .map(|c| c.run.as_str())
            .collect::<Vec<_>>(),
    );
    let mut labels: Vec<Label> = Vec::new();
    for (candidate, name) in candidates.iter().zip(names) {
        let mut label = candidate.label.clone();
        if shared(candidate) {
            label.scenario = name;
        }
        let name = label.scenario.clone();
        let taken = |label: &Label, labels: &[Label]| {
            labels.contains(label)
                || candidates
                    .iter()
                    .any(|c| !shared(c) && shared(candidate) && c.label == *label)
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

/// Each name once, where it stood first.
pub(crate) fn in_order<'a>(names: impl Iterator<Item = &'a str>) -> Vec<&'a str> {
    let mut unique = Vec::new();
    for name in names {
        if !unique.contains(&name) {
            unique.push(name);
        }
    }
    unique
}

/// A ratio's distance from unity with half its 95 % interval (%): none where runs are too few for one, or ratios equal.
fn signed(error: &RatioError) -> String {
    let half = error.ci95_pct.map(|[low, high]| (high - low) / 2.0);
    match half.filter(|half| (0.005..1e3).contains(half)) {
        Some(half) => format!("{:+.2} ± {half:.2}", error.pct),
        None => format!("{:+.2}", error.pct),
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use nav_sim_navigation::metrics::StateRatio;

    pub(crate) fn candidate(run: &str, pct: f64, is_reference: bool) -> CandidateResult {
        let error = RatioError {
            pct,
            ci95_pct: Some([pct - 0.5, pct + 0.5]),
        };
        let state = StateRatio {
            asee: error,
            asee_abs_pct: pct.abs() + 1.0,
            calibration_half_pct: None,
            rmse_end: error,
        };
        let outage = OutageComparison {
            states: [state; 9],
            nees: [9.5, 9.0],
            coverage: [0.9, 0.95],
        };
        let outages = vec![outage.clone(), outage];
        let verdict = Verdict::of(&[], 2, None);
        let label = Label::of(run, None);
        CandidateResult {
            run: run.into(),
            label,
            is_reference,
            is_paired: true,
            verdict,
            outages,
        }
    }

    #[test]
    fn names_of_directories_are_places_in_the_table() {
        let cases = [
            ("runs/II_sr-awv", "II", "SR-AWV"),
            ("II/dr-awv", "II", "DR-AWV"),
            ("./III-AWV/", "III", "AWV"),
            ("awv", "", "AWV"),
            ("rgmwm", "", "RGMWM"),
            ("city", "city", "GMWM"),
            ("lawv", "lawv", "GMWM"),
        ];
        for (directory, scenario, estimator) in cases {
            let label = Label::of(directory, Some("gmwm"));
            assert_eq!(
                (label.scenario.as_str(), label.estimator.as_str()),
                (scenario, estimator),
                "{directory}"
            );
        }
    }

    #[test]
    fn the_table_is_laid_out_as_the_papers() {
        let all = [
            candidate("I/awv", 0.0, true),
            candidate("I/sr-awv", 0.96, false),
            candidate("II/awv", -75.0, false),
        ];
        let outages = [(300.0, 390.0), (700.0, 790.0)];
        let table = ratio_table(&all, &[1, 6], &outages).csv();
        let rows: Vec<&str> = table.lines().collect();
        assert_eq!(
            rows[0],
            "scenario,outage,East AWV (%),East SR-AWV (%),roll AWV (%),roll SR-AWV (%)"
        );
        assert_eq!(
            rows[1],
            "I,300–390 s,reference,+0.96 ± 0.50,reference,+0.96 ± 0.50"
        );
        assert_eq!(rows[4], "II,700–790 s,-75.00 ± 0.50,,-75.00 ± 0.50,");
        let by_state = Layout::of(&all).by_state(&[1, 6], &outages).csv();
        let rows: Vec<&str> = by_state.lines().collect();
        assert_eq!(
            (rows.len(), rows[0]),
            (9, "scenario,outage,state,AWV (%),SR-AWV (%)")
        );
        assert_eq!(rows[2], "I,300–390 s,roll,reference,+0.96 ± 0.50");
    }

    #[test]
    fn every_number_of_the_table_for_other_programs_is_one() {
        let all = [
            candidate("I/awv", 0.0, true),
            candidate("II/sr-awv", -75.0, false),
        ];
        let table = ratio_rows(&all, &[1, 6], &[(4.0, 8.0), (20.0, 30.5)], "I/awv").csv();
        let rows: Vec<&str> = table.lines().collect();
        assert_eq!(rows.len(), 1 + 2 * 2 * 2);
        assert_eq!(rows[1], "I,AWV,I/awv,I/awv,4,8,pos_e_m,,,,,");
        assert_eq!(
            rows[8],
            "II,SR-AWV,II/sr-awv,I/awv,20,30.5,roll_deg,-75,-75.5,-74.5,,76"
        );
    }

    #[test]
    fn candidates_that_would_share_a_place_all_have_one() {
        let runs = ["a/drive", "b/drive", "x/I_awv", "y/I_awv", "c", "c"];
        let all: Vec<_> = (1..)
            .zip(runs)
            .map(|(k, run)| candidate(run, f64::from(k), false))
            .collect();
        let table = ratio_table(&all, &[0], &[(1.0, 2.0), (3.0, 4.0)]).csv();
        let rows: Vec<Vec<&str>> = table
            .lines()
            .skip(1)
            .map(|line| line.split(',').collect())
            .collect();
        let names: Vec<&str> = rows.iter().step_by(2).map(|row| row[0]).collect();
        assert_eq!(
            names,
            ["a/drive", "b/drive", "x/I_awv", "y/I_awv", "c", "c (2)"]
        );
        assert_eq!(rows.len(), 2 * all.len());
        for (k, row) in rows.iter().enumerate() {
            let shown = format!("+{}.00", k / 2 + 1);
            assert_eq!(
                row.iter().filter(|text| text.starts_with(&shown)).count(),
                1,
                "{row:?}"
            );
        }
    }
}
