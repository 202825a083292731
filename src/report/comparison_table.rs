//! The layout of the paper's Table I: scenario by outage, state by estimator.

use super::verdict::axis_of;
use nav_sim_document::{Cell, Table, short_names, window};
use nav_sim_navigation::metrics::{OutageComparison, StateRatio};
use nav_sim_navigation::simulation::REPORTED;
use serde_json::Value;

/// Estimators by the names their run directories end in.
const ESTIMATORS: [&str; 6] = ["sr-awv", "dr-awv", "awv", "rgmwm", "gmwm", "avlr"];

/// Where a run stands in Table I: its row (scenario) and column (estimator, may be empty).
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
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
    /// True of the reference itself.
    pub is_reference: bool,
    /// True if run k saw the same noise as that of the reference.
    pub is_paired: bool,
    /// The verdict on its filter.
    pub verdict: Value,
    /// Outage by outage.
    pub outages: Vec<OutageComparison>,
    /// Time (s) and (ASEE ratio − 1)·100 of each reported state.
    pub curve: Vec<(f64, [f64; REPORTED])>,
}

/// Scenarios and estimators of candidates, in the order in which they were given.
pub(crate) fn layout(candidates: &[CandidateResult]) -> [Vec<&str>; 2] {
    let labels = || candidates.iter().map(|c| &c.label);
    [
        in_order(labels().map(|label| label.scenario.as_str())),
        in_order(labels().map(|label| label.estimator.as_str())),
    ]
}

/// The paper's Table I: a row a scenario and outage, a column a state and estimator; (ASEE ratio − 1)·100 with half its
/// 95 % interval.
pub(crate) fn ratio_table(
    candidates: &[CandidateResult],
    states: &[usize],
    outages: &[(f64, f64)],
) -> Table {
    let [scenarios, estimators] = layout(candidates);
    let columns = || {
        states
            .iter()
            .flat_map(|s| estimators.iter().map(move |e| (*s, *e)))
    };
    let name = |(s, e)| format!("{} {e}", axis_of(s)).trim_end().to_owned() + " (%)";
    let mut table = Table::new(["scenario", "outage"])
        .and(columns().map(name))
        .with_keys(2);
    for scenario in scenarios {
        for (outage, (start_s, end_s)) in outages.iter().enumerate() {
            let keys = [scenario.to_owned(), window(*start_s, *end_s)].map(Cell::from);
            let cell = |(state, estimator): (usize, &str)| {
                let is_here = |c: &&CandidateResult| {
                    c.label.scenario == scenario && c.label.estimator == estimator
                };
                let text = match candidates.iter().find(is_here) {
                    Some(c) if c.is_reference => "reference".to_owned(),
                    Some(c) => signed(&c.outages[outage].states[state]),
                    None => String::new(),
                };
                Cell::figures(text)
            };
            table.row(keys.into_iter().chain(columns().map(cell)));
        }
    }
    table
}

/// Gives each candidate a place of its own: those that would share one have rows of their names, and a number if even these are
/// the same.
pub(crate) fn separate(candidates: &mut [CandidateResult]) {
    let labels: Vec<Label> = candidates.iter().map(|c| c.label.clone()).collect();
    let runs: Vec<&str> = candidates.iter().map(|c| c.run.as_str()).collect();
    let names = short_names(&runs);
    for (k, candidate) in candidates.iter_mut().enumerate() {
        if labels.iter().filter(|label| **label == labels[k]).count() > 1 {
            let name = &names[k];
            candidate.label.scenario = match names[..k].iter().filter(|n| *n == name).count() {
                0 => name.clone(),
                before => format!("{name} ({})", before + 1),
            };
        }
    }
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
fn signed(ratio: &StateRatio) -> String {
    let half = ratio.ci95_pct.map(|[low, high]| (high - low) / 2.0);
    match half.filter(|half| (0.005..1e3).contains(half)) {
        Some(half) => format!("{:+.2} ± {half:.2}", ratio.ratio_error_pct),
        None => format!("{:+.2}", ratio.ratio_error_pct),
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;

    pub(crate) fn candidate(run: &str, pct: f64, is_reference: bool) -> CandidateResult {
        let ci95_pct = Some([pct - 0.5, pct + 0.5]);
        let state = StateRatio {
            ratio_error_pct: pct,
            ci95_pct,
            calibration_half_pct: None,
            abs_ratio_error_pct: pct.abs() + 1.0,
            rmse_end_ratio_error_pct: pct,
            rmse_end_ci95_pct: ci95_pct,
        };
        let outage = OutageComparison {
            states: [state; 9],
            nees_mean: 9.5,
            nees_mean_reference: 9.0,
            coverage_mean: 0.9,
            coverage_mean_reference: 0.95,
        };
        let outages = vec![outage.clone(), outage];
        let verdict = Value::Null;
        let label = Label::of(run, None);
        CandidateResult {
            run: run.into(),
            label,
            is_reference,
            is_paired: true,
            verdict,
            outages,
            curve: Vec::new(),
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
    }

    #[test]
    fn candidates_that_would_share_a_place_all_have_one() {
        let runs = ["a/drive", "b/drive", "x/I_awv", "y/I_awv", "c", "c"];
        let mut all: Vec<_> = (1..)
            .zip(runs)
            .map(|(k, run)| candidate(run, f64::from(k), false))
            .collect();
        separate(&mut all);
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
