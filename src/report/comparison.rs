//! `comparison.json`, what is in it and what is said of it.

use super::short_names;
use super::verdict::verdict_in_short;
use nav_sim_navigation::metrics::{OutageComparison, Verdict, VerdictKind};
use nav_sim_navigation::simulation::REPORTED_NAMES;
use serde::Serialize;

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
        let parts: Vec<&str> = directory.split('/').filter(|p| !p.is_empty() && *p != ".").collect();
        let name = parts.last().copied().unwrap_or(directory);
        let lower = name.to_lowercase();
        for estimator in ESTIMATORS {
            let Some(head) = lower.strip_suffix(estimator) else { continue };
            let parent = parts.len().checked_sub(2).map_or("", |i| parts[i]);
            let separated = head.ends_with(['_', '-', '.', ' ']);
            let scenario = match head.len() {
                0 => parent,
                n if separated => name[..n].trim_end_matches(['_', '-', '.', ' ']),
                _ => continue,
            };
            return Self { scenario: scenario.to_owned(), estimator: estimator.to_uppercase() };
        }
        let estimator = model_estimator.unwrap_or_default().to_uppercase();
        Self { scenario: name.to_owned(), estimator }
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

/// What `comparison.json` holds.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(crate) struct ComparisonFile {
    /// Layout version.
    pub schema_version: u32,
    /// Run directory of the reference.
    pub reference: String,
    /// Whether run k saw the same noise everywhere, so that intervals are those of paired differences.
    pub paired: bool,
    /// One row a run, the reference first.
    pub verdicts: Vec<VerdictRow>,
    /// One row a run, outage and state.
    pub rows: Vec<Row>,
    /// One row a run and outage.
    pub consistency: Vec<ConsistencyRow>,
}

/// Whether the filter of a run is as good as it believes.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(crate) struct VerdictRow {
    /// Run directory.
    pub run: String,
    /// The verdict.
    #[serde(flatten)]
    pub verdict: Verdict,
}

/// One state of one run in one outage, against the reference.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(crate) struct Row {
    /// Run directory.
    pub run: String,
    /// Whether run k saw the same noise as that of the reference, so that the intervals are those of paired differences.
    pub paired: bool,
    /// Outage, from 0.
    pub outage: usize,
    /// State.
    pub state: &'static str,
    /// Mean over the outage of (ASEE ratio − 1)·100.
    pub ratio_error_pct: f64,
    /// Mean of its absolute value.
    pub abs_ratio_error_pct: f64,
    /// 95 % interval of the signed mean: Monte Carlo and, where it is known, what the calibrations leave open; null where
    /// nothing was drawn and nothing is known of those.
    pub ci95_pct: Option<[f64; 2]>,
    /// Half the interval that the calibrations alone leave (points); null where it is not known.
    pub calibration_half_pct: Option<f64>,
    /// (ratio − 1)·100 of the RMSE at the outage's end.
    pub rmse_end_ratio_error_pct: f64,
    /// Its 95 % Monte-Carlo interval; null where nothing was drawn.
    pub rmse_end_ci95_pct: Option<[f64; 2]>,
}

/// Consistency of one run in one outage, beside the reference's.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(crate) struct ConsistencyRow {
    /// Run directory.
    pub run: String,
    /// Outage, from 0.
    pub outage: usize,
    /// Mean NEES over the outage.
    pub nees_mean: f64,
    /// The reference's.
    pub nees_mean_reference: f64,
    /// Mean coverage over the outage.
    pub coverage_mean: f64,
    /// The reference's.
    pub coverage_mean_reference: f64,
}

impl ComparisonFile {
    /// All candidates against one reference.
    pub(crate) fn new(reference: (&str, &Verdict), paired: bool, candidates: &[CandidateResult]) -> Self {
        let reference_row = VerdictRow { run: reference.0.to_owned(), verdict: *reference.1 };
        let others = candidates.iter().filter(|c| !c.is_reference);
        let verdicts = others.map(|c| VerdictRow { run: c.run.clone(), verdict: c.verdict });
        let mut file = Self {
            schema_version: 1,
            reference: reference.0.to_owned(),
            paired,
            verdicts: std::iter::once(reference_row).chain(verdicts).collect(),
            rows: Vec::new(),
            consistency: Vec::new(),
        };
        for candidate in candidates {
            for (outage, comparison) in candidate.outages.iter().enumerate() {
                file.rows.extend(rows(candidate, outage, comparison));
                file.consistency.push(ConsistencyRow {
                    run: candidate.run.clone(),
                    outage,
                    nees_mean: comparison.nees[0],
                    nees_mean_reference: comparison.nees[1],
                    coverage_mean: comparison.coverage[0],
                    coverage_mean_reference: comparison.coverage[1],
                });
            }
        }
        file
    }
}

fn rows<'a>(
    candidate: &'a CandidateResult,
    outage: usize,
    comparison: &'a OutageComparison,
) -> impl Iterator<Item = Row> + 'a {
    REPORTED_NAMES.iter().zip(&comparison.states).map(move |(state, ratio)| Row {
        run: candidate.run.clone(),
        paired: candidate.is_paired,
        outage,
        state,
        ratio_error_pct: ratio.asee.pct,
        abs_ratio_error_pct: ratio.asee_abs_pct,
        ci95_pct: ratio.asee.ci95_pct,
        calibration_half_pct: ratio.calibration_half_pct,
        rmse_end_ratio_error_pct: ratio.rmse_end.pct,
        rmse_end_ci95_pct: ratio.rmse_end.ci95_pct,
    })
}

/// Which filters are as good as they believe: a line a kind, the gravest first.
pub(crate) fn verdict_lines(verdicts: &[VerdictRow]) -> Vec<String> {
    let names = short_names(&verdicts.iter().map(|row| row.run.as_str()).collect::<Vec<_>>());
    let line = |kind: VerdictKind| {
        let of_kind = verdicts.iter().zip(&names).filter(|(row, _)| row.verdict.kind == kind);
        let runs: Vec<String> =
            of_kind.map(|(row, name)| format!("{name} ({})", verdict_in_short(&row.verdict))).collect();
        (!runs.is_empty()).then(|| format!("{kind}: {}", runs.join(", ")))
    };
    VerdictKind::ALL.into_iter().rev().filter_map(line).collect()
}

/// What the ± of the table are.
pub(crate) fn meaning_of_intervals(candidates: &[CandidateResult]) -> &'static str {
    let states = || candidates.iter().flat_map(|c| &c.outages).flat_map(|outage| &outage.states);
    if states().any(|state| state.calibration_half_pct.is_some()) {
        "± half the 95 % interval, Monte Carlo and calibrations together"
    } else if states().all(|state| state.asee.ci95_pct.is_none()) {
        "nothing is drawn in a covariance analysis, and what the calibrations leave open is not known: no intervals"
    } else {
        "± half the 95 % interval of Monte Carlo; what the calibrations leave open (run --method lincov) is not in it"
    }
}

/// Each name once, where it stood first.
pub(super) fn in_order<'a>(names: impl Iterator<Item = &'a str>) -> Vec<&'a str> {
    let mut unique = Vec::new();
    for name in names {
        if !unique.contains(&name) {
            unique.push(name);
        }
    }
    unique
}

#[cfg(test)]
mod tests {
    use super::super::comparison_table::tests::candidate;
    use super::*;

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
    fn the_file_has_the_keys_of_the_interface() {
        let file = ComparisonFile::new(
            ("I/awv", &Verdict::of(&[], 2, None)),
            true,
            &[candidate("II/awv", 3.0, false)],
        );
        let json = serde_json::to_value(&file).unwrap();
        assert_eq!(json["reference"], "I/awv");
        assert_eq!(json["rows"].as_array().unwrap().len(), 18);
        let row = &json["rows"][10];
        assert_eq!(
            (&row["run"], &row["outage"], &row["state"]),
            (&"II/awv".into(), &1.into(), &"pos_e_m".into())
        );
        assert_eq!((&row["ratio_error_pct"], &row["ci95_pct"][0]), (&3.0.into(), &2.5.into()));
        assert_eq!(row["abs_ratio_error_pct"], 4.0);
    }
}
