//! The page of a study: verdicts, drift against the length of outages.

use super::sentence;
use crate::report::choose::RankedPlace;
use crate::report::page::{Axis, Chart, Colour, Interval, Mark, Page, Panel, Series, Table};
use crate::report::study::{ShownCell, drift_table, ratio_table, verdict_table};
use crate::report::verdict::gravest;
use nav_sim_navigation::metrics::{OutageMetrics, VerdictKind};

/// The page of a merged study. `reference`: what ratios refer to; `more`: cells that are in outages.csv only; `rankings`:
/// of candidates calibrated without the recordings that make the errors.
pub(crate) fn study_page(
    cells: &[ShownCell],
    reference: &str,
    states: &[usize],
    more: usize,
    rankings: &[RankedPlace],
) -> String {
    let kind = gravest(cells.iter().flat_map(|cell| &cell.columns).map(|column| &column.verdict));
    let mut page = Page::new("Study", super::tone(kind), [verdict(cells)]);
    for place in rankings {
        page.section(&format!("Candidates on recordings left out: {}", place.name));
        place.verdict.iter().for_each(|line| page.text(&sentence(line)));
        page.table(&Table::of_rows(&place.rows));
        page.text(&sentence(&place.legend));
    }
    if let Some(chart) = drift(cells) {
        page.chart(&chart, "Horizontal error just before the first fix after an outage: median over the runs, the bar up to the 95 % quantile.");
    }
    page.section("Verdict on each filter");
    page.text("NEES over the run (9 if right), error over its standard deviation in the state that is farthest off; of an undecided filter, the runs that would decide.");
    page.table(&Table::of_rows(&verdict_table(cells)));
    page.section("Horizontal error at the ends of outages: median (95 %), m");
    page.table(&Table::of_rows(&drift_table(cells)));
    for cell in cells.iter().filter(|c| c.columns.len() > 1 && c.columns[0].comparison.is_some()) {
        page.section(&format!("{}: ASEE relative to {reference} (%)", cell.name));
        page.text(
            "Mean over the outage of (ratio − 1)·100 ± half the 95 % interval (mean of the absolute value).",
        );
        page.table(&Table::of_rows(&ratio_table(cell, states)));
    }
    if more > 0 {
        page.text(&format!("{more} more cells are in outages.csv."));
    }
    page.text("All numbers: outages.csv, outages.json, runs.csv.");
    page.html()
}

/// Candidate by candidate: in how many cells its filter is as good as it believes, and what it is in the others.
fn verdict(cells: &[ShownCell]) -> String {
    let Some(first) = cells.first() else { return "The study has no cell.".to_owned() };
    let of_column = |(k, name): (usize, &str)| {
        let column_results = || cells.iter().filter_map(|cell| cell.columns.get(k));
        let count = |kind: VerdictKind| column_results().filter(|c| c.verdict.kind == kind).count();
        let told = VerdictKind::ALL.into_iter().filter(|kind| count(*kind) > 0);
        let words: Vec<String> = told.map(|kind| format!("{kind} in {}", count(kind))).collect();
        format!("{name}: {}", words.join(", "))
    };
    let all: Vec<String> = first.columns.iter().map(|c| c.name.as_str()).enumerate().map(of_column).collect();
    let cells = if cells.len() == 1 { "one cell".to_owned() } else { format!("{} cells", cells.len()) };
    format!("Of {cells}, {}.", all.join("; "))
}

/// Error against length, where there are several lengths: points a candidate, and a line through them where each length
/// stands once.
fn drift(cells: &[ShownCell]) -> Option<Chart> {
    let duration = |o: &OutageMetrics| o.end_s - o.start_s;
    let mut lengths: Vec<f64> =
        cells.iter().flat_map(|c| &c.columns).flat_map(|c| c.outages.iter().map(duration)).collect();
    lengths.sort_by(f64::total_cmp);
    lengths.dedup_by(|a, b| (*a - *b).abs() < 1e-6);
    if lengths.len() < 2 {
        return None;
    }
    let names: Vec<&str> = cells[0].columns.iter().map(|c| c.name.as_str()).collect();
    let mut series = Vec::new();
    for (k, name) in names.iter().enumerate() {
        let outages = cells.iter().filter_map(|c| c.columns.get(k)).flat_map(|c| &c.outages);
        // beside one another, by two per cent of the length
        let beside = 1.0 + 0.02 * (k as f64 - 0.5 * (names.len() as f64 - 1.0));
        let point = |o: &OutageMetrics| Interval {
            x: duration(o) * beside,
            y: o.horizontal_p50_m.value,
            low: f64::NAN,
            high: o.horizontal_p95_m.value,
        };
        let mut points: Vec<Interval> = outages.map(point).collect();
        points.sort_by(|a, b| a.x.total_cmp(&b.x));
        if points.windows(2).all(|pair| pair[0].x < pair[1].x) {
            series.push(Series::line(name, Colour::Hue(k), points.iter().map(|p| (p.x, p.y)).collect()));
        }
        series.push(Series::new(name, Colour::Hue(k), Mark::Points(points)));
    }
    let panel = Panel { height: 1.3, ..Panel::new(Axis::log("horizontal error (m)"), series) };
    Some(Chart::new(
        "Drift against the length of an outage",
        Axis::log("length of the outage (s)"),
        vec![panel],
    ))
}
