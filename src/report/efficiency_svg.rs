//! The picture of an estimator study: robust RMSE, a panel a parameter, a bar an estimator and scenario (the
//! paper's Figure 2 as a picture of its numbers).

use super::efficiency::{EfficiencyFile, EfficiencyRow};
use super::svg::{Scale, escape, range, text, tick_label, ticks};
use std::fmt::Write as _;

const WIDTH: f64 = 860.0;
const HEIGHT: f64 = 230.0;
const LEFT: f64 = 62.0;
const RIGHT: f64 = 12.0;
const TOP: f64 = 30.0;
const BOTTOM: f64 = 40.0;
const STYLE: &str = concat!(
    include_str!("report.css"),
    ".paper { fill: var(--paper); } .e0 { fill: #8a8f98; } .e1 { fill: #3a7dc9; } .e2 { fill: #d9822b; }\n",
    ".e3 { fill: #5aa469; } .whisker { stroke: currentColor; stroke-width: 1; fill: none; }\n",
);

/// The picture.
#[must_use]
pub fn efficiency_svg(file: &EfficiencyFile) -> String {
    let mut parameters: Vec<&str> = Vec::new();
    for row in &file.results {
        if !parameters.contains(&row.parameter.as_str()) {
            parameters.push(&row.parameter);
        }
    }
    let height = HEIGHT * parameters.len() as f64;
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {WIDTH} {height}\" width=\"{WIDTH}\" \
         height=\"{height}\" role=\"img\" aria-label=\"robust RMSE\">\n<title>Robust RMSE of {} sets</title>\n\
         <style>\n{STYLE}</style>\n<rect class=\"paper\" width=\"{WIDTH}\" height=\"{height}\"/>\n",
        file.sets
    );
    for (i, parameter) in parameters.iter().enumerate() {
        let rows: Vec<&EfficiencyRow> = file.results.iter().filter(|r| r.parameter == *parameter).collect();
        let _ = writeln!(svg, "<g transform=\"translate(0 {})\">", HEIGHT * i as f64);
        panel(parameter, &rows, &mut svg);
        svg += "</g>\n";
    }
    svg + "</svg>\n"
}

/// Bars of one parameter, grouped by scenario, on a logarithmic scale.
fn panel(parameter: &str, rows: &[&EfficiencyRow], svg: &mut String) {
    let title = format!("{parameter}: robust RMSE, % of theta_0");
    text(svg, "title", (LEFT, 18.0), "start", &title);
    let shown = |r: &&&EfficiencyRow| r.rmse.is_finite() && r.rmse > 0.0;
    let ends =
        |r: &&EfficiencyRow| [100.0 * (r.rmse - r.rmse_se).max(0.5 * r.rmse), 100.0 * (r.rmse + r.rmse_se)];
    let Some((low, high)) = range(rows.iter().filter(shown).flat_map(ends)) else { return };
    let (low, high) = (low / 1.5, high * 1.2);
    let bottom = HEIGHT - BOTTOM;
    let at = |y: f64| bottom - (y.ln() - low.ln()) / (high.ln() - low.ln()) * (bottom - TOP);
    for y in ticks((low, high), Scale::Log) {
        let _ = writeln!(svg, "<path class=\"grid\" d=\"M{LEFT} {:.1}H{}\"/>", at(y), WIDTH - RIGHT);
        text(svg, "tick", (LEFT - 6.0, at(y) + 4.0), "end", &tick_label(y));
    }
    let scenarios: Vec<&[&EfficiencyRow]> = rows.chunk_by(|a, b| a.scenario == b.scenario).collect();
    let slot = (WIDTH - LEFT - RIGHT) / scenarios.len() as f64;
    for (s, group) in scenarios.iter().enumerate() {
        let left = LEFT + slot * s as f64;
        let width = (0.8 * slot / group.len() as f64).min(60.0);
        let first = left + 0.5 * (slot - width * group.len() as f64);
        for (e, row) in group.iter().enumerate().filter(|(_, r)| shown(r)) {
            let (x, top) = (first + width * e as f64, at(100.0 * row.rmse));
            let hover = format!("{} {}: {:.3} %", row.scenario, row.estimator, 100.0 * row.rmse);
            let _ = writeln!(
                svg,
                "<rect class=\"e{}\" x=\"{x:.1}\" y=\"{top:.1}\" width=\"{:.1}\" height=\"{:.1}\"><title>{}</title></rect>",
                e % 4,
                0.9 * width,
                bottom - top,
                escape(&hover)
            );
            let [a, b] = ends(row).map(at);
            let _ = writeln!(svg, "<path class=\"whisker\" d=\"M{:.1} {a:.1}V{b:.1}\"/>", x + 0.45 * width);
            text(svg, "tick", (x + 0.45 * width, bottom + 13.0), "middle", &row.estimator);
        }
        text(svg, "label", (left + 0.5 * slot, bottom + 30.0), "middle", &group[0].scenario);
    }
    let _ = writeln!(svg, "<path class=\"axis\" d=\"M{LEFT} {TOP}V{bottom}H{}\"/>", WIDTH - RIGHT);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::efficiency::accuracy;

    #[test]
    fn a_bar_for_every_number() {
        let a = accuracy(&[1.8, 2.0, 2.2, 2.4], 2.0, 1);
        let row = |scenario: &str, estimator: &str| EfficiencyRow {
            scenario: scenario.into(),
            estimator: estimator.into(),
            parameter: "WN sigma2".into(),
            ..EfficiencyRow::new(&a, &a)
        };
        let results = vec![row("I", "awv"), row("I", "dr-awv"), row("<II>", "awv"), row("<II>", "dr-awv")];
        let file = EfficiencyFile { schema_version: 1, sets: 4, study: serde_json::Value::Null, results };
        let svg = efficiency_svg(&file);
        assert_eq!(svg.matches("<rect class=\"e").count(), 4);
        assert!(svg.contains("&lt;II&gt; awv: ") && svg.ends_with("</svg>\n") && !svg.contains("NaN"));
    }
}
