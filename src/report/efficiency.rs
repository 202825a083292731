//! Results of an estimator study: `results.csv`, `results.json`, the table on the terminal and the data of
//! the paper's Figure 2.

use super::markdown_table as plain_table;
use super::number::shortest;
use nav_sim_calibration::efficiency::Accuracy;
use serde::Serialize;

/// What a study found.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(crate) struct EfficiencyFile {
    /// Version of this layout.
    pub schema_version: u32,
    /// Sets of replicates, H.
    pub sets: u64,
    /// What the study was, as in `study.json`.
    pub study: serde_json::Value,
    /// One entry for each scenario, estimator and parameter.
    pub results: Vec<EfficiencyRow>,
}

/// One estimator's accuracy in one parameter and scenario.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(crate) struct EfficiencyRow {
    /// Name of the contamination.
    pub scenario: String,
    /// The estimator.
    pub estimator: String,
    /// Process and parameter.
    pub parameter: String,
    /// theta_0.
    pub target: f64,
    /// Its errors relative to the target.
    #[serde(flatten)]
    pub accuracy: Accuracy,
    /// RMSE over that of the study's first estimator in the same scenario, on the same sets.
    pub ratio: f64,
    /// Its Monte-Carlo standard error.
    pub ratio_se: f64,
    /// Sets in which the estimate is 0: not identifiable.
    pub zeros: usize,
    /// Share of robust wavelet variances that had no admissible root (0 for a classical estimator).
    pub without_root: f64,
}

/// All numbers, one line for each scenario, estimator and parameter (also the data of a plot).
pub(crate) fn efficiency_csv(file: &EfficiencyFile) -> String {
    let mut text = "scenario,estimator,parameter,target,bias,bias_se,spread,rmse,rmse_se,ratio,ratio_se,zeros,without_root\n".to_owned();
    for r in &file.results {
        let a = &r.accuracy;
        let numbers =
            [r.target, a.bias, a.bias_se, a.spread, a.rmse, a.rmse_se, r.ratio, r.ratio_se].map(shortest);
        let names =
            [&r.scenario, &r.estimator, &r.parameter].map(|n| format!("\"{}\"", n.replace('"', "\"\"")));
        let last = shortest(r.without_root);
        text += &format!("{},{},{},{last}\n", names.join(","), numbers.join(","), r.zeros);
    }
    text
}

/// The table for people: rows scenario × estimator, columns the parameters.
pub(crate) fn efficiency_table(file: &EfficiencyFile) -> String {
    let mut parameters: Vec<(&str, f64)> = Vec::new();
    for r in &file.results {
        if !parameters.iter().any(|(name, _)| *name == r.parameter) {
            parameters.push((&r.parameter, r.target));
        }
    }
    let heads = parameters.iter().map(|(name, target)| format!("{name} = {target:.6e}"));
    let mut rows: Vec<Vec<String>> =
        vec![["scenario", "estimator"].map(str::to_owned).into_iter().chain(heads).collect()];
    for row in file.results.chunks(parameters.len().max(1)) {
        let cell = |r: &EfficiencyRow| {
            let [rmse, se, bias] = [r.accuracy.rmse, r.accuracy.rmse_se, r.accuracy.bias].map(|v| 100.0 * v);
            let se = if se.is_finite() { percent(se) } else { "n/a".to_owned() };
            format!("{} ± {se} ({})", percent(rmse), signed(bias))
        };
        let names = [row[0].scenario.clone(), row[0].estimator.clone()];
        rows.push(names.into_iter().chain(row.iter().map(cell)).collect());
    }
    format!(
        "robust RMSE in % of theta_0 ± its Monte-Carlo standard error (median relative error), {} sets\n{}",
        file.sets,
        plain_table(&rows)
    )
}

/// Two significant digits at least, none that say nothing.
fn percent(x: f64) -> String {
    match x.abs() {
        m if m >= 100.0 || m == 0.0 => format!("{x:.0}"),
        m if m >= 10.0 => format!("{x:.1}"),
        m if m >= 1.0 => format!("{x:.2}"),
        m if m >= 0.1 => format!("{x:.3}"),
        _ => format!("{x:.2e}"),
    }
}

fn signed(x: f64) -> String {
    if x > 0.0 { format!("+{}", percent(x)) } else { percent(x) }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use nav_sim_calibration::efficiency::accuracy;

    /// A file of estimates of one parameter whose truth is 2: scenario, estimator, parameter of each row.
    pub(in crate::report) fn file(estimates: &[f64], rows: &[[&str; 3]]) -> EfficiencyFile {
        let a = accuracy(estimates, 2.0, 1);
        let row = |[scenario, estimator, parameter]: &[&str; 3]| EfficiencyRow {
            scenario: (*scenario).into(),
            estimator: (*estimator).into(),
            parameter: (*parameter).into(),
            target: 2.0,
            accuracy: a.clone(),
            ratio: 1.0,
            ratio_se: 0.0,
            zeros: 0,
            without_root: 0.0,
        };
        let (sets, results) = (estimates.len() as u64, rows.iter().map(row).collect());
        EfficiencyFile { schema_version: 1, sets, study: serde_json::Value::Null, results }
    }

    fn five_sets() -> EfficiencyFile {
        let rows = [
            ["a, b", "awv", "WN sigma2"],
            ["a, b", "awv", "RW gamma2"],
            ["a, b", "dr-awv", "WN sigma2"],
            ["a, b", "dr-awv", "RW gamma2"],
        ];
        file(&[1.8, 2.0, 2.2, 2.4, 20.0], &rows)
    }

    #[test]
    fn the_table_has_a_row_an_estimator_and_a_column_a_parameter() {
        let text = efficiency_table(&five_sets());
        let lines: Vec<&str> = text.lines().collect();
        assert_eq!(lines.len(), 5, "{text}");
        assert!(lines[1].contains("WN sigma2 = 2.000000e0") && lines[1].contains("RW gamma2"), "{text}");
        // 0.1·√(1 + 1.4826²) = 17.9 %, median 10 %.
        assert!(lines[3].contains("| 17.9 ± ") && lines[3].contains("(+10.0)"), "{text}");
    }

    #[test]
    fn the_csv_reads_back() {
        let text = efficiency_csv(&five_sets());
        let mut reader = csv::Reader::from_reader(text.as_bytes());
        let rows: Vec<csv::StringRecord> = reader.records().map(Result::unwrap).collect();
        assert_eq!((rows.len(), &rows[0][0], &rows[3][1], &rows[3][2]), (4, "a, b", "dr-awv", "RW gamma2"));
        assert_eq!(&rows[0][7], shortest(five_sets().results[0].accuracy.rmse));
        assert_eq!(&rows[0][9], "1", "the first estimator's ratio to itself");
    }
}
