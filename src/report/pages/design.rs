//! The page of a design: how wide intervals would be, against the length and the number of recordings.

use super::window;
use crate::report::design::{Design, design_verdict};
use crate::report::page::{Axis, Cell, Chart, Colour, Mark, Page, Panel, Series, Table, Tone};

/// The page.
pub(crate) fn design_page(designs: &[Design]) -> Page {
    let (tone, verdict) = verdict(designs);
    let mut page = Page::new("What recordings would tell", tone, [verdict]);
    design_verdict(designs).lines().for_each(|line| page.text(&super::sentence(line)));
    let parameters = designs.first().map_or(0, |d| d.parameters.len());
    if designs.len() == 1 {
        page.chart(&beside(&designs[0]), BESIDE);
    } else {
        page.charts(&(0..parameters).filter_map(|k| against_hours(designs, k)).collect::<Vec<_>>(), AGAINST);
    }
    if designs.iter().any(|d| !d.horizontal_p95.is_empty()) {
        page.section("What that is in navigation");
        if designs.len() > 1 {
            page.chart(&navigation(designs), NAVIGATION);
        }
        page.table(&quantiles(designs));
    }
    page.section("All numbers");
    page.table(&table(designs));
    page.checked(
        "against recordings that were made and calibrated, 150 times, within four deviations of the scatter (27 %; \
         src/calibration/anticipated.rs).",
    );
    page
}

const BESIDE: &str =
    "Half of the 95 % interval to expect of each parameter (% of its value), and that of endless recordings.";
const AGAINST: &str = "Half of the 95 % interval to expect (% of the value) against the length of each recording; a curve that goes \
                       flat has reached what recordings differ by among themselves. Dashed: endless recordings.";
const NAVIGATION: &str =
    "Half of the 95 % interval of the 95 % quantile of the horizontal error at the end of each outage.";

/// How many parameters the largest plan would determine.
fn verdict(designs: &[Design]) -> (Tone, String) {
    let Some(largest) = designs.last() else { return (Tone::Doubtful, "Nothing was planned.".to_owned()) };
    let open = largest.parameters.iter().filter(|p| p.half_width_pct.is_none()).count();
    let plan = format!("{} recordings of {} h", largest.recordings, largest.hours);
    let all = largest.parameters.len();
    if open == 0 {
        (
            Tone::Good,
            format!("{plan} would determine all {all} parameters; known least: {}.", largest.least_known()),
        )
    } else {
        (Tone::Doubtful, format!("{plan} would determine {} of {all} parameters.", all - open))
    }
}

/// The parameters of one design beside one another.
fn beside(design: &Design) -> Chart {
    let names = design.parameters.iter().map(|p| p.name()).collect();
    let points = |value: &dyn Fn(usize) -> Option<f64>| -> Vec<(f64, f64, f64)> {
        let all = (0..design.parameters.len()).filter_map(|k| Some((k as f64, value(k)?, f64::NAN)));
        all.collect()
    };
    let parameter_points = points(&|k| design.parameters[k].half_width_pct);
    let endless = points(&|k| design.parameters[k].endless_half_width_pct);
    let series = vec![
        Series::points("this plan", Colour::REAL, parameter_points),
        Series::points("endless recordings", Colour::Soft, endless),
    ];
    let panel = Panel::new(Axis::log("half width (%)"), series);
    Chart::new("Intervals to expect", Axis::names(names), vec![panel])
}

/// One parameter of several designs: a curve for each number of recordings.
fn against_hours(designs: &[Design], k: usize) -> Option<Chart> {
    let name = designs.first()?.parameters[k].name();
    let value = |d: &Design| d.parameters.get(k).and_then(|p| p.half_width_pct).unwrap_or(f64::NAN);
    let mut series = curves(designs, value);
    for (hue, count) in counts(designs).into_iter().enumerate() {
        let last = designs.iter().rfind(|d| d.recordings == count)?;
        let Some(floor) = last.parameters.get(k).and_then(|p| p.endless_half_width_pct) else { continue };
        let hours = designs.iter().map(|d| d.hours);
        let line = hours.clone().fold(f64::INFINITY, f64::min)..=hours.fold(0.0, f64::max);
        let points = vec![(*line.start(), floor), (*line.end(), floor)];
        series.push(Series::dashed("", Colour::Hue(hue), points));
    }
    let panel = Panel::new(Axis::log("half width (%)"), series);
    Some(Chart::new(&name, Axis::log("hours"), vec![panel]).small())
}

fn counts(designs: &[Design]) -> Vec<usize> {
    let mut counts: Vec<usize> = designs.iter().map(|d| d.recordings).collect();
    counts.dedup();
    counts
}

/// A curve over hours for each number of recordings.
fn curves(designs: &[Design], value: impl Fn(&Design) -> f64) -> Vec<Series> {
    let curve = |(hue, count): (usize, usize)| {
        let designs_of_count = || designs.iter().filter(|d| d.recordings == count);
        let points: Vec<(f64, f64)> = designs_of_count().map(|d| (d.hours, value(d))).collect();
        let name = format!("{count} recordings");
        Series::dotted_line(&name, Colour::Hue(hue), points)
    };
    counts(designs).into_iter().enumerate().flat_map(curve).collect()
}

/// The horizontal error: a panel an outage.
fn navigation(designs: &[Design]) -> Chart {
    let outages = designs.first().map_or(0, |d| d.horizontal_p95.len());
    let panel = |k: usize| {
        let q = &designs[0].horizontal_p95[k];
        let value = |d: &Design| d.horizontal_p95.get(k).map_or(f64::NAN, |q| q.half_width_pct);
        let label = format!("{} (%)", window((q.start_s, q.end_s)));
        let mut series = curves(designs, value);
        series.insert(0, Series::new("", Colour::Soft, Mark::Level(0.0)));
        Panel { height: 0.8, ..Panel::new(Axis::linear(&label), series) }
    };
    Chart::new("Horizontal error, 95 % quantile", Axis::log("hours"), (0..outages).map(panel).collect())
}

fn quantiles(designs: &[Design]) -> Table {
    let mut table = Table::new(["recordings", "hours", "outage", "p95 (m)", "from", "to", "half width (%)"]);
    for (i, d) in designs.iter().enumerate() {
        for (k, q) in d.horizontal_p95.iter().enumerate() {
            let source_of = |key: &str| format!("/designs/{i}/horizontal_p95/{k}/{key}");
            table.row([
                Cell::figures(d.recordings.to_string()),
                Cell::number(d.hours, &format!("/designs/{i}/hours")),
                window((q.start_s, q.end_s)).into(),
                Cell::number(q.p95_m, &source_of("p95_m")),
                Cell::number(q.ci95[0], &source_of("ci95/0")),
                Cell::number(q.ci95[1], &source_of("ci95/1")),
                Cell::number(q.half_width_pct, &source_of("half_width_pct")),
            ]);
        }
    }
    table
}

/// Half widths: a row a parameter, a column a design.
fn table(designs: &[Design]) -> Table {
    let plans = designs.iter().map(|d| format!("{} × {} h: ± %", d.recordings, d.hours));
    let mut table = Table::new(["parameter", "value"]).and(plans);
    for (k, p) in designs.iter().take(1).flat_map(|d| &d.parameters).enumerate() {
        let cell = |(i, d): (usize, &Design)| match d.parameters.get(k).and_then(|p| p.half_width_pct) {
            Some(half) => Cell::number(half, &format!("/designs/{i}/parameters/{k}/half_width_pct")),
            None => Cell::figures("not determined"),
        };
        let value = Cell::number(p.value, &format!("/designs/0/parameters/{k}/value"));
        let first = [Cell::from(p.name()), value];
        table.row(first.into_iter().chain(designs.iter().enumerate().map(cell)));
    }
    table
}
