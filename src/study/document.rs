//! A merged study as people read it.

use crate::choose::RankedPlace;
use crate::report::comparison_table::{CandidateResult, Label, ratio_table};
use crate::report::states::tone;
use crate::report::verdict::{gravest, verdict_in_short};
use nav_sim_document::{
    Axis, Cell, Chart, Colour, Document, Importance, Interval, Mark, Panel, Series, Table,
    readable, window,
};
use nav_sim_navigation::metrics::{OutageComparison, OutageMetrics, Verdict, VerdictKind};

/// A column of a cell.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct ShownColumn {
    /// Candidate, and filter where there are several.
    pub name: String,
    /// Its place in the table of ratios.
    pub label: Label,
    /// Its outages.
    pub outages: Vec<OutageMetrics>,
    /// Against the reference, if ratios are kept.
    pub comparison: Option<Vec<OutageComparison>>,
    /// Whether it is the reference.
    pub is_reference: bool,
    /// Verdict on its filter.
    pub verdict: Verdict,
}

/// A cell.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct ShownCell {
    /// Its name.
    pub name: String,
    /// Its columns.
    pub columns: Vec<ShownColumn>,
}

/// A study, merged.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct MergedStudy {
    /// Study, trajectories and runs, in a line.
    pub subject: String,
    /// Candidate that ratios refer to, in words.
    pub reference: String,
    /// States in the tables of ratios.
    pub states: Vec<usize>,
    /// Cells that are shown.
    pub cells: Vec<ShownCell>,
    /// Cells that are in the files only.
    pub more: usize,
    /// Where recordings are left out: which candidate is best, place by place.
    pub rankings: Vec<RankedPlace>,
}

impl MergedStudy {
    /// Cells that are shown.
    const SHOWN: usize = 24;

    /// Adds a cell.
    pub(crate) fn add(&mut self, cell: ShownCell) {
        if self.cells.len() < Self::SHOWN {
            self.cells.push(cell);
        } else {
            self.more += 1;
        }
    }

    /// The document.
    pub(crate) fn document(&self) -> Document {
        let columns = self.cells.iter().flat_map(|cell| &cell.columns);
        let kind = gravest(columns.map(|column| &column.verdict));
        let mut lines: Vec<String> = self
            .rankings
            .iter()
            .take(1)
            .flat_map(|r| r.verdict.clone())
            .collect();
        lines.extend(self.verdict());
        lines.push(self.subject.clone());
        let mut document = Document::new("Study", tone(kind), lines);
        for place in &self.rankings {
            document.section(&format!(
                "Candidates on recordings left out: {}",
                place.name
            ));
            place.verdict.iter().for_each(|line| document.text(line));
            document.table(&place.table);
        }
        document.section("Horizontal error at the ends of outages: median (95 %)");
        document.lead(self.drift_table());
        if let Some(chart) = self.drift() {
            document.chart(&chart, "Horizontal error just before the first fix: median over the runs, the bar up to the 95 % quantile.");
        }
        document.section("Verdict on each filter");
        document.text("NEES over the run (9 if right); error over its standard deviation in the state that is farthest off.");
        document.table(&self.verdict_table());
        for cell in self
            .cells
            .iter()
            .filter(|c| c.columns.len() > 1 && c.columns[0].comparison.is_some())
        {
            document.section(&format!(
                "{}: ASEE relative to {}",
                cell.name, self.reference
            ));
            document.text("Mean over the outage of (ratio − 1)·100 ± half the 95 % interval.");
            document.table(&cell.ratio_table(&self.states));
        }
        if self.more > 0 {
            document.note(
                Importance::Remark,
                format!("{} more cells are in outages.csv", self.more),
            );
        }
        document
    }

    /// Candidate by candidate: in how many cells its filter is as good as it believes, and what it is in the others.
    fn verdict(&self) -> Vec<String> {
        const LINES: usize = 4;
        let Some(first) = self.cells.first() else {
            return vec!["the study has no cell".to_owned()];
        };
        let of_column = |(k, column): (usize, &ShownColumn)| {
            let verdicts = || {
                self.cells
                    .iter()
                    .filter_map(move |cell| cell.columns.get(k))
                    .map(|c| &c.verdict)
            };
            let told = VerdictKind::ALL.iter().filter_map(|kind| {
                let of_kind = verdicts().filter(|verdict| verdict.kind == *kind).count();
                (of_kind > 0).then(|| format!("{kind} in {of_kind}"))
            });
            format!("{}: {}", column.name, told.collect::<Vec<_>>().join(", "))
        };
        let all: Vec<String> = first.columns.iter().enumerate().map(of_column).collect();
        let cells = if self.cells.len() == 1 {
            "one cell".to_owned()
        } else {
            format!("{} cells", self.cells.len())
        };
        let line = format!("of {cells}, {}", all.join("; "));
        match line.chars().count() <= 120 {
            true => vec![line],
            false => all.into_iter().take(LINES).collect(),
        }
    }

    fn table(&self, keys: &[&str], unit: &str) -> Table {
        let names = self.cells.first().map_or(&[][..], |cell| &cell.columns);
        let head = keys.iter().map(|key| (*key).to_owned());
        let names = names.iter().map(|column| format!("{}{unit}", column.name));
        Table::new([]).and(head.chain(names)).with_keys(keys.len())
    }

    /// A row a cell, a column a candidate.
    fn verdict_table(&self) -> Table {
        let mut table = self.table(&["cell"], "");
        for cell in &self.cells {
            let shown = |column: &ShownColumn| {
                Cell::from(format!(
                    "{}, {}",
                    column.verdict.kind,
                    verdict_in_short(&column.verdict)
                ))
            };
            table.row(
                std::iter::once(cell.name.as_str().into()).chain(cell.columns.iter().map(shown)),
            );
        }
        table
    }

    /// Horizontal error just before the first fix after each outage: a row an outage, a column a candidate.
    fn drift_table(&self) -> Table {
        let mut table = self.table(&["cell", "outage"], " (m)");
        for ShownCell { name, columns } in &self.cells {
            let Some(first) = columns.first() else {
                continue;
            };
            for (i, o) in first.outages.iter().enumerate() {
                let shown = |column: &ShownColumn| {
                    let o = &column.outages[i];
                    let (p50, p95) = (o.horizontal_p50_m.value, o.horizontal_p95_m.value);
                    Cell::figures(format!("{} ({})", readable(p50), readable(p95)))
                };
                let keys = [Cell::from(name.as_str()), window(o.start_s, o.end_s).into()];
                table.row(keys.into_iter().chain(columns.iter().map(shown)));
            }
        }
        table
    }

    /// Error against length, where there are several lengths: points a candidate, and a line through them where each length
    /// stands once.
    fn drift(&self) -> Option<Chart> {
        let cells = &self.cells;
        let duration = |o: &OutageMetrics| o.end_s - o.start_s;
        let mut lengths: Vec<f64> = cells
            .iter()
            .flat_map(|c| &c.columns)
            .flat_map(|c| c.outages.iter().map(duration))
            .collect();
        lengths.sort_by(f64::total_cmp);
        lengths.dedup_by(|a, b| (*a - *b).abs() < 1e-6);
        if lengths.len() < 2 {
            return None;
        }
        let names: Vec<&str> = cells[0].columns.iter().map(|c| c.name.as_str()).collect();
        let mut series = Vec::new();
        for (k, name) in names.iter().enumerate() {
            let outages = cells
                .iter()
                .filter_map(|c| c.columns.get(k))
                .flat_map(|c| &c.outages);
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
                series.push(Series::line(
                    name,
                    Colour::Hue(k),
                    points.iter().map(|p| (p.x, p.y)).collect(),
                ));
            }
            series.push(Series::new(name, Colour::Hue(k), Mark::Points(points)));
        }
        let panel = Panel {
            height: 1.3,
            ..Panel::new(Axis::log("horizontal error (m)"), series)
        };
        Some(Chart::new(
            "Drift against the length of an outage",
            Axis::log("length of the outage (s)"),
            vec![panel],
        ))
    }
}

impl ShownCell {
    /// The layout of the paper's Table I, a candidate (with its filter, where there are several) in the place of a scenario.
    fn ratio_table(&self, states: &[usize]) -> Table {
        let candidate = |column: &ShownColumn| CandidateResult {
            run: column.name.clone(),
            label: column.label.clone(),
            is_reference: column.is_reference,
            is_paired: true,
            verdict: column.verdict,
            outages: column.comparison.clone().unwrap_or_default(),
        };
        let candidates: Vec<CandidateResult> = self.columns.iter().map(candidate).collect();
        let outages = self
            .columns
            .first()
            .map_or(&[][..], |column| &column.outages);
        let outages: Vec<(f64, f64)> = outages.iter().map(|o| (o.start_s, o.end_s)).collect();
        ratio_table(&candidates, states, &outages)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::sample;
    use nav_sim_navigation::metrics::{self, Measured};

    /// A row is of a candidate and of an outage, which is told by its times.
    #[test]
    fn ratios_stand_beside_candidates_and_times() {
        let result = sample::result();
        let (outages, experiment) = (metrics::outages(&result), Measured::from(&result));
        let comparison = metrics::compare(&experiment, &experiment, true).unwrap();
        let column = |name: &str, is_reference: bool| ShownColumn {
            name: name.to_owned(),
            label: Label::of(name, None),
            outages: outages.clone(),
            comparison: Some(comparison.clone()),
            is_reference,
            verdict: Verdict::of(&[], 2, None),
        };
        let cell = ShownCell {
            name: "land".to_owned(),
            columns: vec![column("right", true), column("wrong", false)],
        };
        let table = cell.ratio_table(&[1]).csv();
        let rows: Vec<&str> = table.lines().collect();
        let window = window(outages[0].start_s, outages[0].end_s);
        assert!(
            rows[1].starts_with(&format!("right,{window},reference")),
            "{table}"
        );
        assert_eq!(rows.len(), 1 + 2 * outages.len());
    }
}
