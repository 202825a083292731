//! Tables of studies: one row a cell, column and outage (and epoch, and run). Every column has its unit in
//! its name; numbers that do not exist are NaN (null in JSON).

use nav_sim_navigation::metrics::{self, EpochMetrics, Measured, OutageComparison, OutageMetrics};
use nav_sim_navigation::simulation::{BIAS_NAMES, REPORTED, REPORTED_NAMES};

/// A value of a table.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Value {
    /// A name.
    Text(String),
    /// A count.
    Int(u64),
    /// A number, NaN if there is none.
    Float(f64),
}

/// What a column holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum ValueKind {
    /// Names.
    Text,
    /// Counts.
    Int,
    /// Numbers.
    Float,
}

/// Name of a column and what it holds.
pub(crate) type TableColumn = (String, ValueKind);

/// A row: one value a column.
pub(crate) type TableRow = Vec<Value>;

/// A column of a cell by name, and what its runs gave.
#[derive(Debug, Clone, Copy)]
pub(crate) struct ColumnResult<'a> {
    /// Trajectory, truth, scenario, receiver, outage set.
    pub cell: [&'a str; 5],
    /// Candidate.
    pub candidate: &'a str,
    /// Filter: 15, 21 or full.
    pub filter: &'a str,
    /// The candidate its ratios refer to, with the same filter; empty without ratios.
    pub reference: &'a str,
    /// All runs, or what is expected of them.
    pub measured: &'a Measured,
}

const KEYS: [&str; 7] = [
    "trajectory",
    "truth",
    "scenario",
    "gnss",
    "outage_set",
    "candidate",
    "filter",
];

/// Names of the states without their units, and the units.
fn states() -> [(&'static str, &'static str); REPORTED] {
    REPORTED_NAMES.map(|name| {
        let unit = ["_m_s", "_deg", "_m"]
            .into_iter()
            .find(|unit| name.ends_with(unit))
            .unwrap_or("");
        (&name[..name.len() - unit.len()], &unit[unit.len().min(1)..])
    })
}

fn columns(names: impl IntoIterator<Item = (String, ValueKind)>) -> Vec<TableColumn> {
    KEYS.iter()
        .map(|k| ((*k).to_owned(), ValueKind::Text))
        .chain(names)
        .collect()
}

fn floats(names: Vec<String>) -> impl Iterator<Item = (String, ValueKind)> {
    names.into_iter().map(|name| (name, ValueKind::Float))
}

fn ints<const N: usize>(names: [&str; N]) -> impl Iterator<Item = (String, ValueKind)> {
    names
        .map(|name| (name.to_owned(), ValueKind::Int))
        .into_iter()
}

fn keys(result: &ColumnResult<'_>) -> TableRow {
    let names = result
        .cell
        .into_iter()
        .chain([result.candidate, result.filter]);
    names.map(|name| Value::Text(name.to_owned())).collect()
}

fn prefixed(prefix: &str) -> Vec<String> {
    REPORTED_NAMES.map(|name| format!("{prefix}_{name}")).into()
}

const HORIZONTAL: [&str; 10] = [
    "horizontal_error_end_p50_m",
    "horizontal_error_end_p50_ci95_low_m",
    "horizontal_error_end_p50_ci95_high_m",
    "horizontal_error_end_p95_m",
    "horizontal_error_end_p95_ci95_low_m",
    "horizontal_error_end_p95_ci95_high_m",
    "horizontal_error_end_max_m",
    "reconvergence_p50_s",
    "reconvergence_p95_s",
    "reconvergence_never_share",
];

/// Columns of the table of outages.
pub(crate) fn outage_columns() -> Vec<TableColumn> {
    let mut names: Vec<String> = ["start_s", "end_s", "duration_s"].map(str::to_owned).into();
    for prefix in ["asee_mean", "rmse_mean", "asee_end", "rmse_end"] {
        names.extend(prefixed(prefix));
        names.extend(prefixed(&format!("{prefix}_std_error")));
    }
    names.extend(
        [
            "nees_end",
            "nees_end_std_error",
            "log_density_end",
            "log_density_end_std_error",
        ]
        .map(str::to_owned),
    );
    names.push("verdict_ratio".to_owned());
    names.extend(HORIZONTAL.map(str::to_owned));
    for (state, _) in states() {
        let ratio = |name: &str| format!("{name}_{state}_pct");
        names.extend(["asee_ratio_error", "asee_ratio_abs_error"].map(ratio));
        names.extend(["low", "high"].map(|end| format!("asee_ratio_error_{state}_ci95_{end}_pct")));
        names.push(format!("rmse_end_ratio_error_{state}_pct"));
        names.extend(
            ["low", "high"].map(|end| format!("rmse_end_ratio_error_{state}_ci95_{end}_pct")),
        );
    }
    names.extend(
        [
            "nees_mean",
            "nees_mean_reference",
            "coverage_mean",
            "coverage_mean_reference",
        ]
        .map(str::to_owned),
    );
    let words =
        ["reference", "verdict", "verdict_state"].map(|name| (name.to_owned(), ValueKind::Text));
    columns(
        words
            .into_iter()
            .chain(ints(["outage", "runs", "diverged"]))
            .chain(floats(names)),
    )
}

/// One row an outage; a set without outages has no row.
pub(crate) fn outage_rows(
    result: &ColumnResult<'_>,
    outages: &[OutageMetrics],
    comparison: Option<&[OutageComparison]>,
) -> Vec<TableRow> {
    let runs = result.measured.sampled().len() as u64;
    let diverged = result
        .measured
        .sampled()
        .iter()
        .filter(|r| r.diverged)
        .count() as u64;
    let verdict = result.measured.verdict();
    let words = [result.reference, verdict.kind.name(), verdict.worst_state];
    let row = |(i, outage): (usize, &OutageMetrics)| {
        let mut row = keys(result);
        row.extend(words.map(|word| Value::Text(word.to_owned())));
        row.extend([i as u64, runs, diverged].map(Value::Int));
        let ratios = comparison.and_then(|c| c.get(i));
        row.extend(
            outage_values(outage, verdict.ratio, runs - diverged)
                .into_iter()
                .chain(ratio_values(ratios))
                .map(Value::Float),
        );
        row
    };
    outages.iter().enumerate().map(row).collect()
}

fn outage_values(o: &OutageMetrics, verdict_ratio: f64, kept: u64) -> Vec<f64> {
    let mut values = vec![o.start_s, o.end_s, o.end_s - o.start_s];
    for estimates in [&o.asee_mean, &o.rmse_mean, &o.asee_end, &o.rmse_end] {
        values.extend(estimates.0.map(|e| e.value));
        values.extend(estimates.0.map(|e| e.std_error));
    }
    values.extend([o.nees_end.value, o.nees_end.std_error]);
    values.extend([
        o.log_density_end.value,
        o.log_density_end.std_error,
        verdict_ratio,
    ]);
    for quantile in [&o.horizontal_p50_m, &o.horizontal_p95_m] {
        let (low, high) = quantile.ci95;
        values.extend([
            quantile.value,
            low.unwrap_or(f64::NAN),
            high.unwrap_or(f64::NAN),
        ]);
    }
    let r = &o.reconvergence;
    let never = r.never.map_or(f64::NAN, |never| never as f64 / kept as f64);
    values.extend([o.horizontal_max_m, r.p50_s.value, r.p95_s.value, never]);
    values
}

fn ratio_values(comparison: Option<&OutageComparison>) -> Vec<f64> {
    let Some(c) = comparison else {
        return vec![f64::NAN; 7 * REPORTED + 4];
    };
    let of_state = |s: &metrics::StateRatio| {
        let [[low, high], [rmse_low, rmse_high]] = [s.asee.ci95_pct, s.rmse_end.ci95_pct]
            .map(|interval| interval.unwrap_or([f64::NAN; 2]));
        [
            s.asee.pct,
            s.asee_abs_pct,
            low,
            high,
            s.rmse_end.pct,
            rmse_low,
            rmse_high,
        ]
    };
    c.states
        .iter()
        .flat_map(of_state)
        .chain(c.nees)
        .chain(c.coverage)
        .collect()
}

/// Columns of the table of epochs.
pub(crate) fn epoch_columns() -> Vec<TableColumn> {
    let mut names = vec!["t_s".to_owned()];
    for prefix in ["asee", "asee_std_error", "rmse", "rmse_std_error", "bias"] {
        names.extend(prefixed(prefix));
    }
    names.extend(["mean_pos_err_m", "mean_att_err_deg", "nees", "coverage"].map(str::to_owned));
    names.extend(BIAS_NAMES.map(|name| format!("asee_{name}")));
    columns(ints(["fix", "runs"]).chain(floats(names)))
}

/// One row an epoch.
pub(crate) fn epoch_rows(result: &ColumnResult<'_>, epochs: &[EpochMetrics]) -> Vec<TableRow> {
    let row = |e: &EpochMetrics| {
        let mut row = keys(result);
        row.extend([u64::from(e.gnss), e.count].map(Value::Int));
        let mut values = vec![e.t_s];
        for estimates in [&e.asee, &e.rmse] {
            values.extend(estimates.0.map(|e| e.value));
            values.extend(estimates.0.map(|e| e.std_error));
        }
        values.extend(e.bias.0.map(|e| e.value));
        values.extend([
            e.mean_pos_err_m.value,
            e.mean_att_err_deg.value,
            e.nees.value,
            e.coverage,
        ]);
        values.extend(e.bias_asee);
        row.extend(values.into_iter().map(Value::Float));
        row
    };
    epochs.iter().map(row).collect()
}

/// Columns of the table of runs.
pub(crate) fn run_columns() -> Vec<TableColumn> {
    let mut names: Vec<String> = ["nis_mean", "nees_mean", "coverage"]
        .map(str::to_owned)
        .into();
    names.extend(
        ["see_mean", "see_end", "error_end"]
            .into_iter()
            .flat_map(prefixed),
    );
    let ends = [
        "nees_end",
        "log_density_end",
        "horizontal_error_end_m",
        "reconvergence_s",
    ];
    names.extend(ends.map(str::to_owned));
    columns(ints(["run", "outage", "diverged", "fixes"]).chain(floats(names)))
}

/// One row a run and outage; a covariance analysis has none.
pub(crate) fn run_rows(result: &ColumnResult<'_>) -> Vec<TableRow> {
    let mut rows = Vec::new();
    for run in result.measured.sampled() {
        for (i, o) in run.outages.iter().enumerate() {
            let mut row = keys(result);
            row.extend([run.run, i as u64, u64::from(run.diverged), run.nis.1].map(Value::Int));
            let whole = [run.nis.0, run.nees_mean, run.covered].into_iter();
            let states = whole.chain(o.see_mean).chain(o.see_end).chain(o.error_end);
            let ends = [
                o.nees_end,
                o.log_density_end,
                o.horizontal_error_end_m,
                o.reconvergence_s,
            ];
            row.extend(states.chain(ends).map(Value::Float));
            rows.push(row);
        }
    }
    rows
}

#[cfg(test)]
mod tests;
