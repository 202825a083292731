//! A chart in characters, for a terminal: the lines of its first panel, each drawn with the first letter of its name.

use super::axis::{Ruler, is_shown, range, ticks};
use super::chart::{Chart, Mark, Panel, Scale};
use crate::report::comparison::in_order;

/// The rows of a chart of so many characters by so many rows, axes and title among them; none without a value to show.
pub(crate) fn terminal(chart: &Chart, columns: usize, rows: usize) -> Vec<String> {
    let Some(panel) = chart.panels.first() else { return Vec::new() };
    let lines = lines(panel);
    let shown = |axis, values: &dyn Fn(&(f64, f64)) -> f64| {
        let shows = |p: &&(f64, f64)| is_shown(p.0, &chart.x.scale) && is_shown(p.1, &panel.y.scale);
        let points = lines.iter().flat_map(|(_, points)| points.iter()).filter(shows);
        range(axis, points.map(values), 0.0)
    };
    let (Some(x), Some(y)) = (shown(&chart.x, &|p| p.0), shown(&panel.y, &|p| p.1)) else {
        return Vec::new();
    };
    let height = rows.saturating_sub(3).max(2);
    let labels = ticks(&panel.y, y, (height / 3).max(2));
    let left = labels.iter().map(|(_, label)| label.chars().count()).max().unwrap_or(0);
    let width = columns.saturating_sub(left + 1).max(2);
    let x = Ruler { range: x, is_log: chart.x.scale == Scale::Log, pixels: (0.0, (width - 1) as f64) };
    let y = Ruler { range: y, is_log: panel.y.scale == Scale::Log, pixels: ((height - 1) as f64, 0.0) };
    let mut grid = vec![vec![' '; width]; height];
    for (letter, points) in &lines {
        draw(points, *letter, (&x, &y), &mut grid);
    }
    let at_row = |row: usize| labels.iter().find(|(value, _)| y.at(*value).round() as usize == row);
    let mut text = vec![format!("{}: {}", panel.y.label, names(panel))];
    for (row, cells) in grid.iter().enumerate() {
        let label = at_row(row).map_or("", |(_, label)| label.as_str());
        let tick = if label.is_empty() { '│' } else { '┤' };
        text.push(format!("{label:>left$}{tick}{}", cells.iter().collect::<String>().trim_end()));
    }
    let most = width / 8;
    let places = ticks(&chart.x, x.range, most.max(2));
    text.push(format!("{:left$}└{}", "", rule(&places, &x, width)));
    text.push(format!("{:left$} {}", "", below(&places, &x, width, &chart.x.label)));
    text
}

/// The plain lines, by the first letters of their names.
fn lines(panel: &Panel) -> Vec<(char, &[(f64, f64)])> {
    let mut lines = Vec::new();
    for series in &panel.series {
        if let (Mark::Line(points, _), Some(letter)) = (&series.mark, series.name.chars().next()) {
            lines.push((letter, points.as_slice()));
        }
    }
    lines
}

/// Each name once.
fn names(panel: &Panel) -> String {
    let lines = panel.series.iter().filter(|s| matches!(s.mark, Mark::Line(..)) && !s.name.is_empty());
    in_order(lines.map(|s| s.name.as_str())).join(", ")
}

/// A line from point to point, a character a column at least.
fn draw(points: &[(f64, f64)], letter: char, (x, y): (&Ruler, &Ruler), grid: &mut [Vec<char>]) {
    let place = |p: &(f64, f64)| (x.at(p.0), y.at(p.1));
    let mut put = |(column, row): (f64, f64)| {
        if column.is_finite() && row.is_finite() {
            let row = &mut grid[(row.round().max(0.0) as usize).min(y.pixels.0 as usize)];
            let last = row.len() - 1;
            row[(column.round().max(0.0) as usize).min(last)] = letter;
        }
    };
    points.iter().for_each(|p| put(place(p)));
    for pair in points.windows(2) {
        let (from, to) = (place(&pair[0]), place(&pair[1]));
        let steps = (to.0 - from.0).abs().max((to.1 - from.1).abs()).ceil();
        if steps.is_finite() {
            for k in 1..steps as u32 {
                let part = f64::from(k) / steps;
                put((from.0 + part * (to.0 - from.0), from.1 + part * (to.1 - from.1)));
            }
        }
    }
}

/// The axis, with a mark at each tick.
fn rule(places: &[(f64, String)], x: &Ruler, width: usize) -> String {
    let is_tick = |column: usize| places.iter().any(|(value, _)| x.at(*value).round() as usize == column);
    (0..width).map(|column| if is_tick(column) { '┬' } else { '─' }).collect()
}

/// The labels of the ticks that have room beside one another, then that of the axis.
fn below(places: &[(f64, String)], x: &Ruler, width: usize, label: &str) -> String {
    let mut text = String::new();
    let room = width.saturating_sub(label.chars().count() + 1);
    for (value, label) in places {
        let (length, from) = (label.chars().count(), text.chars().count());
        let start = (x.at(*value).round() as usize).saturating_sub(length / 2);
        if (start > from || from == 0) && start + length <= room {
            text += &" ".repeat(start - from);
            text += label;
        }
    }
    let gap = width.saturating_sub(text.chars().count() + label.chars().count());
    format!("{text}{}{label}", " ".repeat(gap))
}

/// Texts beside one another, the first of so many characters.
pub(crate) fn beside(left: &[String], right: &[String], columns: usize) -> Vec<String> {
    let rows = left.len().max(right.len());
    let cell = |rows: &[String], k: usize| rows.get(k).cloned().unwrap_or_default();
    let row = |k: usize| format!("{:<columns$}  {}", cell(left, k), cell(right, k)).trim_end().to_owned();
    (0..rows).map(row).collect()
}

#[cfg(test)]
mod tests {
    use super::super::{Axis, Colour, Series};
    use super::*;

    /// A straight line of slope −1 in logarithms is the diagonal.
    #[test]
    fn a_line_goes_from_corner_to_corner() {
        let series = vec![Series::line("white", Colour::Ink, vec![(1.0, 1.0), (100.0, 0.01)])];
        let chart = Chart::new("", Axis::log("τ (s)"), vec![Panel::new(Axis::log("σ"), series)]);
        let text = terminal(&chart, 26, 12);
        assert_eq!(text.len(), 12);
        assert_eq!(text[0], "σ: white");
        let cells: Vec<Vec<char>> = text[1..10].iter().map(|row| row.chars().collect()).collect();
        assert!(cells[0].contains(&'w') && text[1].starts_with("   1┤w"), "{text:#?}");
        assert!(text[9].ends_with('w') && text[9].chars().count() == 26, "{text:#?}");
        assert!(text[11].ends_with("τ (s)") && text.iter().all(|row| row.chars().count() <= 26), "{text:#?}");
        let both = beside(&text, &text[..3], 26);
        assert!(both.len() == 12 && both[0].ends_with("  σ: white"), "{both:#?}");
    }

    #[test]
    fn nothing_to_show_is_no_text() {
        let series = vec![Series::line("a", Colour::Ink, vec![(1.0, f64::NAN)])];
        let chart = Chart::new("", Axis::linear("t"), vec![Panel::new(Axis::log("y"), series)]);
        assert!(terminal(&chart, 40, 10).is_empty());
    }
}
