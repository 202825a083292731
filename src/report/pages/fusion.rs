//! The page of a fusion: the way, errors against a reference, innovations.

use super::{STATES, error_of};
use crate::report::fusion::FusionSummary;
use crate::report::page::{Axis, Chart, Colour, Interval, Mark, Page, Panel, Series, Stroke};
use nav_sim_navigation::earth::ned_difference;
use nav_sim_navigation::fusion::{FixRecord, Row, Solution, Use};
use nav_sim_navigation::metrics::chi_square_band;

/// The page of a fusion directory.
pub(crate) fn fusion_page(solution: &Solution, summary: &FusionSummary, inputs: &[(String, String)]) -> Page {
    let outages = summary.windows();
    let mut page = Page::new(
        "INS/GNSS fusion of recorded data",
        summary.tone(),
        [format!("The solution is {}.", summary.verdict_line().trim_start_matches("verdict: "))],
    );
    let facts: Vec<(&str, String)> =
        inputs.iter().map(|(role, path)| (role.as_str(), path.clone())).collect();
    page.facts(&facts);
    page.chart(
        &map(solution, &outages),
        "Solution, smoothed where that was asked for, and reference where there is one; north and east of the start.",
    );
    page.section("Figures");
    summary.text().lines().skip(1).for_each(|line| page.text(line));
    if !outages.is_empty() {
        page.table(&summary.outage_table());
    }
    summary.smoothed_table().iter().for_each(|table| page.table(table));
    page.section("Position");
    page.chart(&position(solution, &outages), POSITION);
    if solution.rows.iter().any(|row| row.error.is_some()) {
        page.section("Errors against the reference");
        page.charts(&errors(solution, &outages), ERRORS);
    }
    page.section("Fixes");
    page.chart(&innovations(solution, &outages), INNOVATIONS);
    page.chart(&nis(&solution.fixes, &outages), NIS);
    page.checked(
        "fusions of simulated recordings are consistent with their own covariance, however the samples are split and the IMU is \
         mounted (tests/truth/fusion.rs), smoothed ones too (tests/truth/smoothing.rs).",
    );
    page
}

const POSITION: &str = "Standard deviation of the horizontal position that the filter states; with a reference, the distance from it.";
const ERRORS: &str = "Lines: estimate less reference. Bands: ±3 σ. Of the filter, and of the smoothed solution where that was asked for.";
const INNOVATIONS: &str =
    "Estimated less measured position over its standard deviation; 95 % of used fixes belong into the band.";
const NIS: &str = "Normalised innovation squared of each fix; 95 % belong into the band of a right filter.";

/// What is smoothed.
const SMOOTHED: Colour = Colour::Hue(2);

fn timed(title: &str, panels: Vec<Panel>, outages: &[(f64, f64)]) -> Chart {
    Chart::new(title, Axis::linear("time (s)"), panels).with_outages(outages).in_group("time")
}

fn map(solution: &Solution, outages: &[(f64, f64)]) -> Chart {
    let Some(first) = solution.rows.first() else { return Chart::map("Track", Vec::new()) };
    let place = |row: &Row| {
        let moved = ned_difference(&first.state, row.state.lat, row.state.lon, row.state.h);
        (moved.y, moved.x)
    };
    let reference = |row: &Row| row.error.map(|e| (place(row).0 - e.values[1], place(row).1 - e.values[0]));
    let missing = (f64::NAN, f64::NAN);
    let mut series = Vec::new();
    // the three lie on one another but for metres: wide beneath narrow beneath dashed, all are seen
    if solution.rows.iter().any(|row| row.error.is_some()) {
        let way = solution.rows.iter().map(|row| reference(row).unwrap_or(missing)).collect();
        series.push(Series::new("reference", Colour::Ink, Mark::Line(way, Stroke::Bold)));
    }
    for (start_s, end_s) in outages {
        let within =
            solution.rows.iter().filter(|row| (start_s..end_s).contains(&&row.t_s)).map(place).collect();
        series.push(Series::new("outage", Colour::Hue(4), Mark::Line(within, Stroke::Bold)));
    }
    series.push(Series::line("solution", Colour::REAL, solution.rows.iter().map(place).collect()));
    series.extend(solution.smoothed.iter().map(|rows| {
        Series::new("smoothed", SMOOTHED, Mark::Line(rows.iter().map(place).collect(), Stroke::Dashed))
    }));
    let ends = [("start", Some(first)), ("end", solution.rows.last())];
    series.extend(ends.into_iter().filter_map(|(name, row)| {
        let (east, north) = place(row?);
        Some(Series::new(name, Colour::RIGHT, Mark::Place(east, north)))
    }));
    Chart::map("Track", series)
}

fn position(solution: &Solution, outages: &[(f64, f64)]) -> Chart {
    let horizontal =
        |rows: &[Row], value: fn(&Row) -> f64| rows.iter().map(|row| (row.t_s, value(row))).collect();
    let sigma = |row: &Row| row.sigma[0].hypot(row.sigma[1]);
    let error = |row: &Row| row.error.map_or(f64::NAN, |e| e.values[0].hypot(e.values[1]));
    let rows = &solution.rows;
    let has_reference = rows.iter().any(|row| row.error.is_some());
    let mut series = vec![Series::line("σ of the filter", Colour::BELIEVED, horizontal(rows, sigma))];
    if has_reference {
        series.push(Series::line("error against the reference", Colour::REAL, horizontal(rows, error)));
    }
    if let Some(rows) = &solution.smoothed {
        let dashed = Mark::Line(horizontal(rows, sigma), Stroke::Dashed);
        series.push(Series::new("σ smoothed", SMOOTHED, dashed));
        if has_reference {
            series.push(Series::line("error smoothed", SMOOTHED, horizontal(rows, error)));
        }
    }
    timed("Horizontal position", vec![Panel::new(Axis::log("horizontal (m)"), series)], outages)
}

fn errors(solution: &Solution, outages: &[(f64, f64)]) -> Vec<Chart> {
    // a panel has room for three names in its legend
    let (names, colours) = match solution.smoothed {
        Some(_) => (["filter"; 2], [Colour::REAL; 2]),
        None => (["±3 σ", "error"], [Colour::BELIEVED, Colour::REAL]),
    };
    let filtered = (&solution.rows, names, colours);
    let smoothed = solution.smoothed.as_ref().map(|rows| (rows, ["smoothed"; 2], [SMOOTHED; 2]));
    let chart = |(i, state): (usize, &&str)| {
        let mut series = Vec::new();
        for (rows, [band, line], [believed, real]) in std::iter::once(filtered).chain(smoothed) {
            let sigma = rows.iter().map(|row| (row.t_s, -3.0 * row.sigma[i], 3.0 * row.sigma[i])).collect();
            let error = |row: &Row| (row.t_s, row.error.map_or(f64::NAN, |e| e.values[i]));
            series.push(Series::new(band, believed, Mark::Band(sigma)));
            series.push(Series::line(line, real, rows.iter().map(error).collect()));
        }
        timed(&error_of(state), vec![Panel::new(Axis::linear(""), series)], outages).small()
    };
    STATES.iter().enumerate().map(chart).collect()
}

/// What became of fixes, and its colour.
const KINDS: [(Use, &str, Colour); 3] = [
    (Use::Used, "used", Colour::BELIEVED),
    (Use::Withheld, "withheld", Colour::Soft),
    (Use::Rejected, "rejected", Colour::REAL),
];

/// A series for each thing that became of fixes.
fn fixes(fixes: &[FixRecord], value: &dyn Fn(&FixRecord) -> f64) -> Vec<Series> {
    let of_kind = |(kind, name, colour): (Use, &str, Colour)| {
        let point = |f: &FixRecord| Interval { x: f.t_s, y: value(f), low: f64::NAN, high: f64::NAN };
        let points: Vec<Interval> = fixes.iter().filter(|f| f.used == kind).map(point).collect();
        (!points.is_empty()).then(|| Series::new(name, colour, Mark::Points(points)))
    };
    KINDS.into_iter().filter_map(of_kind).collect()
}

fn innovations(solution: &Solution, outages: &[(f64, f64)]) -> Chart {
    let panel = |(i, name): (usize, &str)| {
        let normalised =
            |f: &FixRecord| f.innovation.get(i).zip(f.sigma.get(i)).map_or(f64::NAN, |(x, s)| x / s);
        let mut series = vec![Series::new("95 % band", Colour::RIGHT, Mark::Zone(-1.96, 1.96))];
        series.extend(fixes(&solution.fixes, &normalised));
        Panel {
            height: 0.55,
            ..Panel::new(Axis::linear(&format!("{name} (σ)")).including(-3.0, 3.0), series)
        }
    };
    let panels = ["north", "east", "down"].into_iter().enumerate().map(panel).collect();
    timed("Innovations of position, normalised", panels, outages)
}

fn nis(records: &[FixRecord], outages: &[(f64, f64)]) -> Chart {
    let dof = records.iter().map(|f| f.innovation.len()).max().unwrap_or(0);
    let band = chi_square_band(dof, 1.0);
    let mut series =
        vec![Series::new("95 % band of a right filter", Colour::RIGHT, Mark::Zone(band.lower, band.upper))];
    series.extend(fixes(records, &|f| f.nis));
    timed("NIS", vec![Panel::new(Axis::log(&format!("NIS ({dof} if right)")), series)], outages)
}
