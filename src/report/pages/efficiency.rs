//! The page of an estimator study: the paper's Figure 2, a point an estimator with its interval.

use crate::report::comparison::in_order;
use crate::report::efficiency::{EfficiencyFile, EfficiencyRow};
use crate::report::number::readable;
use crate::report::page::{Axis, Cell, Chart, Colour, Interval, Mark, Page, Panel, Series, Table, Tone, svg};

/// The page.
pub(crate) fn efficiency_page(file: &EfficiencyFile) -> String {
    let mut page = Page::new("Study of the estimators", Tone::Good, [verdict(file)]);
    page.text(CAPTION);
    charts(file).iter().for_each(|chart| page.chart(chart, ""));
    page.section("All numbers");
    page.text("As parts of the true value θ₀; results.csv and results.json have them in full.");
    let mut table = Table::new([
        "scenario",
        "estimator",
        "parameter",
        "robust RMSE",
        "± its standard error",
        "median error",
    ])
    .and(["RMSE / that of the first estimator".to_owned(), "± its standard error".to_owned()]);
    for (i, r) in file.results.iter().enumerate() {
        let number = |value: f64, key: &str| Cell::number(value, &format!("/results/{i}/{key}"));
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
    page.table(&table);
    page.html()
}

/// The same as a picture.
pub(crate) fn efficiency_svg(file: &EfficiencyFile) -> String {
    svg(&format!("Robust RMSE of {} sets", file.sets), &charts(file))
}

const CAPTION: &str =
    "Robust RMSE (eq. 15 of the paper) in % of the true value; bars are 95 % Monte-Carlo intervals.";
/// Half a 95 % interval in standard errors.
const HALF: f64 = 1.96;

/// Which estimator is the most accurate one in each scenario: the least geometric mean of its RMSE over the parameters.
fn verdict(file: &EfficiencyFile) -> String {
    let best = |scenario: &&str| {
        let rows_of_scenario =
            || file.results.iter().filter(|r| r.scenario == **scenario && r.accuracy.rmse > 0.0);
        let score = |estimator: &str| {
            let logs: Vec<f64> = rows_of_scenario()
                .filter(|r| r.estimator == estimator)
                .map(|r| r.accuracy.rmse.ln())
                .collect();
            logs.iter().sum::<f64>() / logs.len() as f64
        };
        let estimators = in_order(rows_of_scenario().map(|r| r.estimator.as_str()));
        let least = estimators.into_iter().min_by(|a, b| score(a).total_cmp(&score(b)))?;
        Some(format!("{scenario}: {least} ({} %)", readable(100.0 * score(least).exp())))
    };
    let scenarios = in_order(file.results.iter().map(|r| r.scenario.as_str()));
    let found: Vec<String> = scenarios.iter().filter_map(best).collect();
    format!(
        "Most accurate over all parameters (geometric mean of the robust RMSE, {} sets): {}.",
        file.sets,
        found.join("; ")
    )
}

/// A chart a parameter: scenarios side by side, estimators beside one another in each.
fn charts(file: &EfficiencyFile) -> Vec<Chart> {
    let scenarios = in_order(file.results.iter().map(|r| r.scenario.as_str()));
    let estimators = in_order(file.results.iter().map(|r| r.estimator.as_str()));
    let chart = |parameter: &str| {
        let rows: Vec<&EfficiencyRow> = file.results.iter().filter(|r| r.parameter == parameter).collect();
        let series = estimators.iter().enumerate().map(|(k, estimator)| {
            let beside = 0.6 * ((k as f64 + 0.5) / estimators.len() as f64 - 0.5);
            let point = |r: &&EfficiencyRow| {
                let x = scenarios.iter().position(|s| *s == r.scenario)? as f64 + beside;
                let y = 100.0 * r.accuracy.rmse;
                let half = 100.0 * HALF * r.accuracy.rmse_se;
                Some(Interval { x, y, low: (y - half).max(0.1 * y), high: y + half })
            };
            let points = rows.iter().filter(|r| r.estimator == **estimator).filter_map(point);
            Series::new(estimator, Colour::Hue(k), Mark::Points(points.collect()))
        });
        let axis = axis(&rows.iter().map(|r| r.accuracy.rmse).collect::<Vec<_>>());
        let panel = Panel::new(axis, series.collect());
        let names = scenarios.iter().map(|s| (*s).to_owned()).collect();
        Chart::new(&format!("Accuracy of {}", symbol(parameter)), Axis::names(names), vec![panel])
    };
    in_order(file.results.iter().map(|r| r.parameter.as_str())).into_iter().map(chart).collect()
}

/// `WN σ²` for `WN sigma2`.
fn symbol(parameter: &str) -> String {
    [("sigma2", "σ²"), ("gamma2", "γ²"), ("phi", "φ"), ("q2", "Q²")]
        .into_iter()
        .fold(parameter.to_owned(), |text, (name, sign)| text.replace(name, sign))
}

/// By powers of ten where values are that far apart.
fn axis(values: &[f64]) -> Axis {
    let positive = || values.iter().copied().filter(|v| *v > 0.0 && v.is_finite());
    let (low, high) = (positive().fold(f64::INFINITY, f64::min), positive().fold(0.0, f64::max));
    let label = "robust RMSE (% of θ₀)";
    if high > 10.0 * low { Axis::log(label) } else { Axis::linear(label).including(0.0, 0.0) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::efficiency::tests::file;

    #[test]
    fn a_point_for_every_number() {
        let places = [["I", "awv"], ["I", "dr-awv"], ["<II>", "awv"], ["<II>", "dr-awv"]];
        let rows = places.map(|[scenario, estimator]| [scenario, estimator, "WN sigma2"]);
        let file = file(&[1.8, 2.0, 2.2, 2.4], &rows);
        let svg = efficiency_svg(&file);
        assert_eq!(svg.matches("h0M").count() + svg.matches("class=\"dot\" d=\"M").count(), 4 + 2); // two in the legend
        assert!(svg.contains(">&lt;II&gt;</text>") && svg.ends_with("</svg>\n") && !svg.contains("NaN"));
    }
}
