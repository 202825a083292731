//! A fusion drawn: track, position, errors, innovations.

use glam::DVec2;
use nav_sim_document::{Axis, Chart, Colour, Mark, Panel, Series, Stroke};
use nav_sim_navigation::earth::ned_difference;
use nav_sim_navigation::fusion::{FixRecord, Row, Solution, Use};
use nav_sim_navigation::metrics::chi_square_band;

/// States in JSON and on axes.
pub(super) const STATES: [(&str, &str); 9] = [
    ("pos_n_m", "north (m)"),
    ("pos_e_m", "east (m)"),
    ("pos_d_m", "down (m)"),
    ("vel_n_m_s", "velocity north (m/s)"),
    ("vel_e_m_s", "velocity east (m/s)"),
    ("vel_d_m_s", "velocity down (m/s)"),
    ("roll_deg", "roll (°)"),
    ("pitch_deg", "pitch (°)"),
    ("yaw_deg", "yaw (°)"),
];
/// Points of a curve that is smooth: more do not show.
const MOST: usize = 120;
/// Fixes of one fate in a panel: more lie on one another.
const MOST_FIXES: usize = 1000;
/// Points of a map along its larger half.
const PIXELS: f64 = 400.0;
/// Velocities of a reference that are known worse than this are not drawn: its positions jump (m/s).
const UNEVEN: f64 = 0.5;

pub(super) const POSITION: &str =
    "Dashed: horizontal 1 σ stated. Line: distance from the reference.";
pub(super) const ERRORS: &str = "Lines: estimate less reference. Bands: ± 1 σ.";
pub(super) const FIXES: &str = "Of a right filter 95 % of the used fixes are in the band.";

/// Colour of what is smoothed.
const SMOOTHED: Colour = Colour::Hue(2);

fn timed(title: &str, panels: Vec<Panel>, outages: &[(f64, f64)]) -> Chart {
    Chart::new(title, Axis::linear("time (s)"), panels)
        .with_outages(outages)
        .in_group("time")
}

pub(super) fn map(solution: &Solution, outages: &[(f64, f64)]) -> Chart {
    let Some(first) = solution.rows.first() else {
        return Chart::map("Track", Vec::new());
    };
    let place = |row: &Row| {
        let moved = ned_difference(&first.state, row.state.lat, row.state.lon, row.state.h);
        DVec2::new(moved.y, moved.x)
    };
    let error = |row: &Row| {
        row.error
            .map_or(DVec2::NAN, |e| DVec2::new(e.values[1], e.values[0]))
    };
    let reference = |row: &Row| place(row) - error(row);
    let all: Vec<DVec2> = solution.rows.iter().map(place).collect();
    let extent = all
        .iter()
        .fold(DVec2::ZERO, |most, p| most.max(p.abs()))
        .max_element();
    // what lies within a pixel is one point
    let way = |points: &mut dyn Iterator<Item = DVec2>| {
        let mut kept: Vec<DVec2> = Vec::new();
        points.for_each(|p| match kept.last() {
            Some(last) if last.distance(p) < extent / PIXELS => {}
            _ => kept.push(p),
        });
        kept.into_iter().map(|p| (p.x, p.y)).collect::<Vec<_>>()
    };
    let mut series = Vec::new();
    // the three lie on one another but for metres: wide beneath narrow beneath dashed, all are seen
    if solution.rows.iter().any(|row| row.error.is_some()) {
        let line = Mark::Line(way(&mut solution.rows.iter().map(reference)), Stroke::Bold);
        series.push(Series::new("reference", Colour::Ink, line));
    }
    for (start_s, end_s) in outages {
        let within = solution
            .rows
            .iter()
            .filter(|row| (start_s..end_s).contains(&&row.t_s));
        let line = Mark::Line(way(&mut within.map(place)), Stroke::Bold);
        series.push(Series::new("outage", Colour::Hue(4), line));
    }
    series.push(Series::line(
        "solution",
        Colour::REAL,
        way(&mut all.iter().copied()),
    ));
    let smoothed = solution.smoothed.iter();
    series.extend(
        smoothed.map(|rows| Series::dashed("smoothed", SMOOTHED, way(&mut rows.iter().map(place)))),
    );
    let ends = [("start", Some(first)), ("end", solution.rows.last())];
    series.extend(ends.into_iter().filter_map(|(name, row)| {
        let DVec2 { x, y } = place(row?);
        Some(Series::new(name, Colour::RIGHT, Mark::Place(x, y)))
    }));
    Chart::map("Track", series)
}

/// Some of many rows, for curves that are smooth.
fn thinned(rows: &[Row]) -> impl Iterator<Item = &Row> {
    rows.iter().step_by(rows.len().div_ceil(MOST).max(1))
}

/// Rows of the filter, and smoothed ones: names of what is stated and of the error, colours. A panel has room for three
/// names in its legend.
fn solutions(solution: &Solution) -> Vec<(&[Row], [&'static str; 2], [Colour; 2])> {
    let rows = solution.rows.as_slice();
    match solution.smoothed.as_deref() {
        None => vec![(rows, ["1 σ", "error"], [Colour::BELIEVED, Colour::REAL])],
        Some(smoothed) => {
            vec![
                (rows, ["filter"; 2], [Colour::REAL; 2]),
                (smoothed, ["smoothed"; 2], [SMOOTHED; 2]),
            ]
        }
    }
}

pub(super) fn position(solution: &Solution, outages: &[(f64, f64)]) -> Chart {
    let mut series = Vec::new();
    for (rows, [stated, error], [believed, real]) in solutions(solution) {
        let sigma = thinned(rows)
            .map(|row| (row.t_s, row.sigma[0].hypot(row.sigma[1])))
            .collect();
        series.push(Series::dashed(stated, believed, sigma));
        let errors = rows
            .iter()
            .filter_map(|row| Some((row.t_s, row.error?.values[0].hypot(row.error?.values[1]))));
        let errors: Vec<_> = errors.collect();
        series.extend((!errors.is_empty()).then(|| Series::line(error, real, errors)));
    }
    timed(
        "Horizontal position",
        vec![Panel::new(Axis::log("horizontal (m)"), series)],
        outages,
    )
}

pub(super) fn errors(solution: &Solution, outages: &[(f64, f64)]) -> Vec<Chart> {
    let chart = |(i, (_, name)): (usize, &(&str, &str))| {
        let is_velocity = (3..6).contains(&i);
        let error = |row: &Row| {
            let known = row
                .error
                .filter(|e| !is_velocity || e.velocity_sigma < UNEVEN);
            (row.t_s, known.map_or(f64::NAN, |e| e.values[i]))
        };
        let mut series = Vec::new();
        for (rows, [stated, line], [believed, real]) in solutions(solution) {
            let sigma = thinned(rows)
                .map(|row| (row.t_s, -row.sigma[i], row.sigma[i]))
                .collect();
            series.push(Series::new(stated, believed, Mark::Band(sigma)));
            series.push(Series::line(line, real, rows.iter().map(error).collect()));
        }
        timed(
            name,
            vec![Panel::new(Axis::linear("").with_zero(), series)],
            outages,
        )
        .small()
    };
    STATES.iter().enumerate().map(chart).collect()
}

/// Fates of fixes, and their colours.
const FATES: [(Use, &str, Colour); 3] = [
    (Use::Used, "used", Colour::BELIEVED),
    (Use::Withheld, "withheld", Colour::Soft),
    (Use::Rejected, "rejected", Colour::REAL),
];

/// A series for each fate of fixes.
fn fixes(fixes: &[FixRecord], value: &dyn Fn(&FixRecord) -> f64) -> Vec<Series> {
    let of_fate = |(fate, name, colour): (Use, &str, Colour)| {
        let of_fate: Vec<&FixRecord> = fixes.iter().filter(|f| f.used == fate).collect();
        let every = of_fate.len().div_ceil(MOST_FIXES).max(1);
        let points = of_fate
            .into_iter()
            .step_by(every)
            .map(|f| (f.t_s, value(f), f64::NAN));
        let points: Vec<_> = points.collect();
        (!points.is_empty()).then(|| Series::points(name, colour, points))
    };
    FATES.into_iter().filter_map(of_fate).collect()
}

pub(super) fn innovations(solution: &Solution, outages: &[(f64, f64)]) -> Chart {
    let panel = |(i, name): (usize, &str)| {
        let normalised = |f: &FixRecord| {
            f.innovation
                .get(i)
                .zip(f.sigma.get(i))
                .map_or(f64::NAN, |(x, s)| x / s)
        };
        let mut series = vec![Series::new(
            "95 % band",
            Colour::RIGHT,
            Mark::Zone(-1.96, 1.96),
        )];
        series.extend(fixes(&solution.fixes, &normalised));
        Panel {
            height: 0.55,
            ..Panel::new(
                Axis::linear(&format!("{name} (σ)")).including(-3.0, 3.0),
                series,
            )
        }
    };
    let panels = ["north", "east", "down"]
        .into_iter()
        .enumerate()
        .map(panel)
        .collect();
    timed("Innovations of position, normalised", panels, outages)
}

pub(super) fn nis(records: &[FixRecord], outages: &[(f64, f64)]) -> Chart {
    let dof = records
        .iter()
        .map(|f| f.innovation.len())
        .max()
        .unwrap_or(0);
    let band = chi_square_band(dof, 1.0);
    let mut series = vec![Series::new(
        "95 % band of a right filter",
        Colour::RIGHT,
        Mark::Zone(band.lower, band.upper),
    )];
    series.extend(fixes(records, &|f| f.nis));
    timed(
        "NIS",
        vec![Panel::new(
            Axis::log(&format!("NIS ({dof} if right)")),
            series,
        )],
        outages,
    )
}
