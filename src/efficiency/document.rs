//! Results of an estimator study: `results.csv`, `results.json`, and what is said and drawn of them.

use crate::report::Answer;
use crate::report::comparison_table::in_order;
use nav_sim_calibration::efficiency::{Accuracy, is_more_accurate, mean_log_rmse};
use nav_sim_document::{
    Axis, Cell, Chart, Colour, Document, Importance, Interval, Mark, Panel, Series, Table, Tone,
    readable, shortest,
};
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
        let numbers = [
            r.target, a.bias, a.bias_se, a.spread, a.rmse, a.rmse_se, r.ratio, r.ratio_se,
        ]
        .map(shortest);
        let names = [&r.scenario, &r.estimator, &r.parameter]
            .map(|n| format!("\"{}\"", n.replace('"', "\"\"")));
        let last = shortest(r.without_root);
        text += &format!(
            "{},{},{},{last}\n",
            names.join(","),
            numbers.join(","),
            r.zeros
        );
    }
    text
}

impl EfficiencyFile {
    fn scenarios(&self) -> Vec<&str> {
        in_order(self.results.iter().map(|r| r.scenario.as_str()))
    }

    fn estimators(&self) -> Vec<&str> {
        in_order(self.results.iter().map(|r| r.estimator.as_str()))
    }

    /// Whether the sets tell the most accurate estimator over all parameters of each scenario.
    fn verdict(&self) -> (Tone, Vec<String>) {
        let mut tone = Tone::Good;
        let line = |scenario: &&str| {
            let accuracies = |estimator: &str| -> Vec<&Accuracy> {
                let rows = self
                    .results
                    .iter()
                    .filter(|r| r.scenario == **scenario && r.estimator == estimator);
                rows.map(|r| &r.accuracy).collect()
            };
            let mut ranked: Vec<(&str, Vec<&Accuracy>)> = self
                .estimators()
                .into_iter()
                .map(|e| (e, accuracies(e)))
                .filter(|(_, a)| !a.is_empty())
                .collect();
            ranked.sort_by(|a, b| mean_log_rmse(&a.1).total_cmp(&mean_log_rmse(&b.1)));
            let shown = |(name, all): &(&str, Vec<&Accuracy>)| {
                format!("{name} ({} %)", readable(100.0 * mean_log_rmse(all).exp()))
            };
            match ranked.as_slice() {
                [] => format!("{scenario}: no estimator"),
                [only] => format!("{scenario}: {}", shown(only)),
                [best, second, ..]
                    if is_more_accurate(&best.1, &second.1, ranked.len() - 1, self.sets) =>
                {
                    format!(
                        "{scenario}: {} is more accurate than {}",
                        shown(best),
                        shown(second)
                    )
                }
                [best, second, ..] => {
                    tone = Tone::Undecided;
                    let sets = self.sets;
                    format!(
                        "{scenario}: {sets} sets cannot tell {} from {}",
                        shown(best),
                        shown(second)
                    )
                }
            }
        };
        let lines = self.scenarios().iter().map(line).collect();
        (tone, lines)
    }

    /// A row a scenario and estimator, a column a parameter.
    fn lead(&self) -> Table {
        let parameters = in_order(self.results.iter().map(|r| r.parameter.as_str()));
        let heads = parameters
            .iter()
            .map(|name| format!("{} (%)", symbol(name)));
        let mut table = Table::new(["scenario", "estimator"])
            .and(heads)
            .with_keys(2);
        for row in self.results.chunks(parameters.len().max(1)) {
            let cell = |r: &EfficiencyRow| {
                let [rmse, se] = [r.accuracy.rmse, r.accuracy.rmse_se].map(|v| readable(100.0 * v));
                Cell::figures(format!("{rmse} ± {se}"))
            };
            let names = [row[0].scenario.as_str(), &row[0].estimator].map(Cell::from);
            table.row(names.into_iter().chain(row.iter().map(cell)));
        }
        table
    }

    /// A row a scenario, estimator and parameter.
    fn all_numbers(&self) -> Table {
        let mut table = Table::new([
            "scenario",
            "estimator",
            "parameter",
            "robust RMSE",
            "± its standard error",
            "median error",
            "RMSE / that of the first estimator",
            "± standard error of the ratio",
        ])
        .with_keys(3);
        for (i, r) in self.results.iter().enumerate() {
            let number =
                |value: f64, key: &str| Cell::number(value, &format!("/results/{i}/{key}"));
            table.row([
                r.scenario.clone().into(),
                r.estimator.clone().into(),
                r.parameter.clone().into(),
                number(r.accuracy.rmse, "rmse"),
                number(r.accuracy.rmse_se, "rmse_se"),
                number(r.accuracy.bias, "bias"),
                number(r.ratio, "ratio"),
                number(r.ratio_se, "ratio_se"),
            ]);
        }
        table
    }
}

impl Answer for EfficiencyFile {
    fn document(&self) -> Document {
        let (tone, lines) = self.verdict();
        let mut document = Document::new("Study of the estimators", tone, lines);
        let text = "robust RMSE (eq. 15 of the paper) in % of the true value ± its Monte-Carlo standard error; in brackets above: geometric mean";
        document.note(Importance::Remark, text);
        document.lead(self.lead());
        document.charts(
            &charts(self),
            "Robust RMSE in % of the true value; bars are 95 % Monte-Carlo intervals.",
        );
        document.section("All numbers");
        document
            .text("As parts of the true value θ₀; results.csv and results.json have them in full.");
        document.table(&self.all_numbers());
        document
    }
}

/// Half a 95 % interval in standard errors.
const HALF: f64 = 1.96;

/// A chart a parameter: scenarios side by side, estimators beside one another in each.
fn charts(file: &EfficiencyFile) -> Vec<Chart> {
    let (scenarios, estimators) = (file.scenarios(), file.estimators());
    let chart = |parameter: &str| {
        let rows: Vec<&EfficiencyRow> = file
            .results
            .iter()
            .filter(|r| r.parameter == parameter)
            .collect();
        let series = estimators.iter().enumerate().map(|(k, estimator)| {
            let beside = 0.6 * ((k as f64 + 0.5) / estimators.len() as f64 - 0.5);
            let point = |r: &&EfficiencyRow| {
                let x = scenarios.iter().position(|s| *s == r.scenario)? as f64 + beside;
                let y = 100.0 * r.accuracy.rmse;
                let half = 100.0 * HALF * r.accuracy.rmse_se;
                Some(Interval {
                    x,
                    y,
                    low: (y - half).max(0.1 * y),
                    high: y + half,
                })
            };
            let points = rows
                .iter()
                .filter(|r| r.estimator == **estimator)
                .filter_map(point);
            Series::new(estimator, Colour::Hue(k), Mark::Points(points.collect()))
        });
        let axis = axis(&rows.iter().map(|r| r.accuracy.rmse).collect::<Vec<_>>());
        let panel = Panel::new(axis, series.collect());
        let names = scenarios.iter().map(|s| (*s).to_owned()).collect();
        Chart::new(
            &format!("Accuracy of {}", symbol(parameter)),
            Axis::names(names),
            vec![panel],
        )
    };
    in_order(file.results.iter().map(|r| r.parameter.as_str()))
        .into_iter()
        .map(chart)
        .collect()
}

/// `WN σ²` for `WN sigma2`.
fn symbol(parameter: &str) -> String {
    [
        ("sigma2", "σ²"),
        ("gamma2", "γ²"),
        ("phi", "φ"),
        ("q2", "Q²"),
    ]
    .into_iter()
    .fold(parameter.to_owned(), |text, (name, sign)| {
        text.replace(name, sign)
    })
}

/// By powers of ten where values are that far apart.
fn axis(values: &[f64]) -> Axis {
    let positive = || values.iter().copied().filter(|v| *v > 0.0 && v.is_finite());
    let (low, high) = (
        positive().fold(f64::INFINITY, f64::min),
        positive().fold(0.0, f64::max),
    );
    let label = "robust RMSE (% of θ₀)";
    if high > 10.0 * low {
        Axis::log(label)
    } else {
        Axis::linear(label).including(0.0, 0.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nav_sim_calibration::efficiency::accuracy;

    /// A file of estimates of one parameter whose truth is 2, in two scenarios: one estimator as given, another one with ten
    /// times the error.
    fn file(estimates: &[f64]) -> EfficiencyFile {
        let far: Vec<f64> = estimates.iter().map(|e| 2.0 + 10.0 * (e - 2.0)).collect();
        let row = |scenario: &str, estimator: &str, estimates: &[f64]| EfficiencyRow {
            scenario: scenario.into(),
            estimator: estimator.into(),
            parameter: "WN sigma2".into(),
            target: 2.0,
            accuracy: accuracy(estimates, 2.0, 1),
            ratio: 1.0,
            ratio_se: 0.0,
            zeros: 0,
            without_root: 0.0,
        };
        let results = vec![
            row("a, b", "dr-awv", estimates),
            row("a, b", "awv", &far),
            row("<II>", "dr-awv", estimates),
            row("<II>", "awv", estimates),
        ];
        EfficiencyFile {
            schema_version: 1,
            sets: estimates.len() as u64,
            study: serde_json::Value::Null,
            results,
        }
    }

    /// Ten times the error is told, the same error is not: grey.
    #[test]
    fn the_best_is_named_only_where_the_sets_tell_it() {
        let estimates: Vec<f64> = (0..40)
            .map(|k| 2.0 + 0.1 * (f64::from(k) * 2.4).sin())
            .collect();
        let document = file(&estimates).document();
        let lines = &document.verdict.lines;
        assert!(
            lines[0].starts_with("a, b: dr-awv (")
                && lines[0].contains(" is more accurate than awv ("),
            "{lines:?}"
        );
        assert!(
            lines[1].starts_with("<II>: 40 sets cannot tell "),
            "{lines:?}"
        );
        assert_eq!(document.verdict.tone, Tone::Undecided);
        let text = document.terminal(100);
        assert!(
            text.lines().count() == 8 && text.contains("WN σ² (%)"),
            "{text}"
        );
    }

    #[test]
    fn a_point_for_every_number() {
        let svg = file(&[1.8, 2.0, 2.2, 2.4]).document().svg();
        assert_eq!(
            svg.matches("h0M").count() + svg.matches("class=\"dot\" d=\"M").count(),
            4 + 2
        ); // two in the legend
        assert!(
            svg.contains(">&lt;II&gt;</text>") && svg.ends_with("</svg>\n") && !svg.contains("NaN")
        );
    }

    #[test]
    fn the_csv_reads_back() {
        let file = file(&[1.8, 2.0, 2.2, 2.4, 20.0]);
        let text = efficiency_csv(&file);
        let mut reader = csv::Reader::from_reader(text.as_bytes());
        let rows: Vec<csv::StringRecord> = reader.records().map(Result::unwrap).collect();
        assert_eq!(
            (rows.len(), &rows[0][0], &rows[3][1], &rows[3][2]),
            (4, "a, b", "awv", "WN sigma2")
        );
        assert_eq!(&rows[0][7], shortest(file.results[0].accuracy.rmse));
        assert_eq!(&rows[0][9], "1", "the first estimator's ratio to itself");
    }
}
