//! The page of a tuning: how honest the filter is against the factor on its variances, before and after.

use super::{STATES, error_of};
use crate::report::number::seconds;
use crate::report::page::{Axis, Cell, Chart, Colour, Mark, Page, Panel, Series, Table, Tone};
use crate::report::tune::TuneResult;
use nav_sim_navigation::simulation::NEES_DOF;
use nav_sim_navigation::simulation::lincov::Honesty;

/// The page.
pub(crate) fn tune_page(result: &TuneResult) -> Page {
    let tone = if result.is_honest() { Tone::Good } else { Tone::Doubtful };
    let mut page = Page::new("Honest inflation of a noise model", tone, [super::sentence(&result.verdict())]);
    page.facts(&[("truths", result.truths.join(", "))]);
    page.section("Factors");
    page.text("On the variances of the model; the standard deviations take their square roots.");
    page.table(&factors(result));
    page.section("How sharp the answer is");
    page.chart(&sweep(result), SWEEP);
    page.section("The filters beside one another");
    page.table(&filters(result));
    if !result.after.end_s.is_empty() {
        page.charts(&ends(result), ENDS);
    }
    page.checked(
        "covariance analysis against 2000 Monte-Carlo runs (examples/README.md); sampled runs agree with the tuned filter's honesty \
         (tests/truth/tune.rs).",
    );
    page
}

const SWEEP: &str = "The tuned filter with all its variances times a factor (1: as tuned). NEES: the squared error in units of the \
                     filter's own covariance, expected over time and truths. Largest RMSE/σ: over states and ends of outages. Cost: \
                     horizontal RMSE at the ends of outages against a filter that knows the truth.";
const ENDS: &str = "True RMSE at the end of each outage, root mean square over the truths.";

fn factors(result: &TuneResult) -> Table {
    let mut table = Table::new(["sensor", "process", "factor on the variance"]);
    for (i, f) in result.factors.iter().enumerate() {
        table.row([
            f.sensor.name().into(),
            f.process.clone().unwrap_or_else(|| "all".to_owned()).into(),
            Cell::number(f.on_variance, &format!("/factors/{i}/on_variance")),
        ]);
    }
    table
}

fn sweep(result: &TuneResult) -> Chart {
    let curve = |value: &dyn Fn(&Honesty) -> f64| -> Vec<(f64, f64)> {
        result.sweep.iter().map(|(factor, h)| (*factor, value(h))).collect()
    };
    let right = |y: f64| Series::new("right", Colour::RIGHT, Mark::Level(y));
    let mut panels = vec![
        Panel::new(
            Axis::log(&format!("NEES ({NEES_DOF} if right)")),
            vec![right(NEES_DOF as f64), Series::line("tuned × factor", Colour::REAL, curve(&|h| h.nees))],
        ),
        Panel::new(
            Axis::log("largest RMSE/σ"),
            vec![right(1.0), Series::line("tuned × factor", Colour::REAL, curve(&|h| h.largest.ratio))],
        ),
    ];
    if !result.after.end_s.is_empty() {
        let cost = curve(&|h| 100.0 * result.cost_of(h));
        let series = vec![Series::line("tuned × factor", Colour::REAL, cost)];
        panels.push(Panel::new(Axis::linear("cost (%)").including(0.0, 0.0), series));
    }
    panels.iter_mut().for_each(|panel| panel.height = 0.7);
    Chart::new("Honesty and cost against the variances", Axis::log("factor on all variances"), panels)
}

fn filters(result: &TuneResult) -> Table {
    let ends = result.before.end_s.iter().map(|t| format!("horizontal RMSE at {} s (m)", seconds(*t)));
    let mut table = Table::new(["filter", "NEES", "largest RMSE/σ", "in"]).and(ends);
    for (i, (name, h)) in result.filters().enumerate() {
        let number = |value: f64, key: String| Cell::number(value, &format!("/filters/{i}/{key}"));
        let mut row = vec![
            name.into(),
            number(h.nees, "nees".to_owned()),
            number(h.largest.ratio, "largest_ratio".to_owned()),
            STATES[h.largest.state].into(),
        ];
        let ends = h.horizontal_m().enumerate();
        row.extend(ends.map(|(k, rmse)| number(rmse, format!("outage_end/{k}/horizontal_rmse_m"))));
        table.row(row);
    }
    table
}

/// A small chart a state: the RMSE of each filter at the ends of outages.
fn ends(result: &TuneResult) -> Vec<Chart> {
    let names: Vec<String> = result.before.end_s.iter().map(|t| format!("{} s", seconds(*t))).collect();
    let chart = |(state, name): (usize, &&str)| {
        let series = result.filters().enumerate().map(|(hue, (filter, h))| {
            let point = |(k, rmse): (usize, &[f64; STATES.len()])| {
                (k as f64 + 0.12 * (hue as f64 - 1.5), rmse[state], f64::NAN)
            };
            Series::points(filter, Colour::Hue(hue), h.rmse_end.iter().enumerate().map(point))
        });
        let panel = Panel::new(Axis::linear("").including(0.0, 0.0), series.collect());
        Chart::new(&error_of(name), Axis::names(names.clone()), vec![panel]).small()
    };
    STATES.iter().enumerate().map(chart).collect()
}
