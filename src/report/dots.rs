//! Dot plots that lie: a name a row, which a phone has room for.

use nav_sim_document::{Axis, Chart, Colour, Panel, Series};

/// Values of one kind, one a row: value and interval; NaN: none.
pub(crate) struct Dots<'a> {
    pub(crate) name: &'a str,
    pub(crate) colour: Colour,
    pub(crate) points: Vec<[f64; 3]>,
}

/// A chart with a row for each name, from top to bottom; `level`: a value to compare with, and its name.
pub(crate) fn dot_chart(
    title: &str,
    axis: Axis,
    names: impl IntoIterator<Item = String>,
    level: Option<(&str, f64)>,
    dots: &[Dots<'_>],
) -> Chart {
    let mut names: Vec<String> = names.into_iter().collect();
    names.reverse();
    let rows = names.len() as f64;
    let mut series: Vec<Series> = Vec::new();
    if let Some((name, value)) = level {
        series.push(Series::dashed(
            name,
            Colour::RIGHT,
            vec![(value, -0.5), (value, rows - 0.5)],
        ));
    }
    for (k, kind) in dots.iter().enumerate() {
        let beside = 0.3 * ((k as f64 + 0.5) / dots.len() as f64 - 0.5);
        let height = |row: usize| rows - 1.0 - row as f64 - beside;
        let interval = |(row, [_, low, high]): (usize, &[f64; 3])| {
            [
                (*low, height(row)),
                (*high, height(row)),
                (f64::NAN, f64::NAN),
            ]
        };
        let point = |(row, [value, ..]): (usize, &[f64; 3])| (*value, height(row), f64::NAN);
        let intervals = kind.points.iter().enumerate().flat_map(interval).collect();
        series.push(Series::line("", kind.colour, intervals));
        series.push(Series::points(
            kind.name,
            kind.colour,
            kind.points.iter().enumerate().map(point),
        ));
    }
    let panel = Panel {
        height: 0.1 * (rows + 1.0),
        ..Panel::new(Axis::names(names), series)
    };
    Chart::new(title, axis, vec![panel])
}
