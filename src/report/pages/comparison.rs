//! The page of a comparison: what the filters believe over time beside the reference, the paper's Figure 7 and Table I.

use super::paper::PaperFigure;
use super::{STATES, tone, window};
use crate::report::comparison::{
    CandidateResult, ComparisonFile, Row, in_order, meaning_of_intervals, verdict_lines,
};
use crate::report::comparison_table::{table_rows, with_times};
use crate::report::page::{Axis, Cell, Chart, Colour, Mark, Page, Panel, Series, Table, svg};
use crate::report::short_names;
use crate::report::verdict::gravest;
use nav_sim_navigation::metrics::{Measured, VerdictKind};
use nav_sim_navigation::simulation::{REPORTED, REPORTED_NAMES};

/// How the ASEE of a run departs from that of the reference over time.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct RatioCurves {
    /// Time (s).
    pub t_s: Vec<f64>,
    /// (ratio − 1)·100 of each reported state.
    pub asee_pct: Vec<[f64; REPORTED]>,
}

impl RatioCurves {
    /// Of two experiments with the same epochs.
    pub(crate) fn of(candidate: &Measured, reference: &Measured) -> Self {
        let both = candidate.epochs.iter().zip(&reference.epochs);
        let pct = |i: usize, a: &[f64; REPORTED], b: &[f64; REPORTED]| 100.0 * (a[i] / b[i] - 1.0);
        Self {
            t_s: candidate.epochs.iter().map(|e| e.t_s).collect(),
            asee_pct: both.map(|(c, r)| std::array::from_fn(|i| pct(i, &c.asee, &r.asee))).collect(),
        }
    }
}

/// Runs beside a reference, as they are shown.
#[derive(Debug, Clone, Copy)]
pub(crate) struct ShownComparison<'a> {
    /// The runs.
    pub candidates: &'a [CandidateResult],
    /// How their ratios go with time, one a run.
    pub curves: &'a [RatioCurves],
    /// Start and end of each outage (s).
    pub outages: &'a [(f64, f64)],
    /// The states that are shown.
    pub states: &'a [usize],
}

impl ShownComparison<'_> {
    /// The page of a comparison file. `links`: pages beneath, path and name.
    pub(crate) fn page(&self, file: &ComparisonFile, links: &[(String, String)]) -> String {
        let Self { candidates, outages, states, .. } = *self;
        let kind = gravest(file.verdicts.iter().map(|row| &row.verdict));
        let mut page = Page::new("What the filters believe, compared", tone(kind), [verdict(file)]);
        let is_drawn = file.rows.iter().any(|row| row.rmse_end_ci95_pct.is_some());
        let paired = if file.paired && is_drawn {
            "; the runs saw the same noise, intervals are those of paired differences"
        } else {
            ""
        };
        page.text(&format!("Reference: {}{paired}.", file.reference));
        if !links.is_empty() {
            page.folded("Pages of the single results", |page| page.links(links));
        }
        page.text(CAPTION);
        self.charts().iter().for_each(|chart| page.chart(chart, ""));
        if !outages.is_empty() {
            page.section("ASEE against the reference, mean over the outage (%)");
            page.text(&format!(
                "The layout of the paper's Table I: mean of (ASEE ratio − 1)·100, in brackets the mean of its absolute value; {}.",
                meaning_of_intervals(candidates)
            ));
            page.table(&Table::of_rows(&with_times(table_rows(candidates, states), outages)));
            page.section("Consistency and errors");
            page.text("NEES (9 if right) and coverage over the outage; RMSE at its end against the reference, (ratio − 1)·100.");
            page.table(&consistency(file, outages, states));
        }
        page.html()
    }

    /// The paper's Figure 7, beside its other ones.
    pub(crate) fn figure(&self) -> PaperFigure {
        PaperFigure::new(7, FIGURE, self.charts())
    }

    /// The paper's Figure 7 as a picture.
    pub(crate) fn svg(&self) -> String {
        svg(&self.title(), &self.charts())
    }

    /// A chart a scenario, with a curve an estimator; where the names of the runs tell neither, one with all runs.
    fn charts(&self) -> Vec<Chart> {
        let Self { candidates, curves, .. } = *self;
        let all: Vec<(&CandidateResult, &RatioCurves)> =
            candidates.iter().zip(curves).filter(|(c, _)| !c.is_reference).collect();
        let scenarios = in_order(candidates.iter().map(|c| c.label.scenario.as_str()));
        let estimators = in_order(candidates.iter().map(|c| c.label.estimator.as_str()));
        let is_laid_out = estimators.len() > 1 && scenarios.len() <= SCENARIOS && !estimators.contains(&"");
        if !is_laid_out {
            let names = short_names(&all.iter().map(|(c, _)| c.run.as_str()).collect::<Vec<_>>());
            let curves = all.iter().map(|(_, curves)| *curves);
            let curves_of_scenario: Vec<Curve<'_>> = names
                .iter()
                .zip(curves)
                .enumerate()
                .map(|(hue, (name, curves))| Curve { name, hue, curves })
                .collect();
            return vec![self.chart(&self.title(), &curves_of_scenario)];
        }
        let hue = |estimator: &str| estimators.iter().position(|e| *e == estimator).unwrap_or(0);
        let of_scenario = |scenario: &&str| {
            let of_scenario = all.iter().filter(|(c, _)| c.label.scenario == *scenario);
            let curves: Vec<Curve<'_>> = of_scenario
                .map(|(c, curves)| Curve { name: &c.label.estimator, hue: hue(&c.label.estimator), curves })
                .collect();
            let title = format!("{}, scenario {scenario}", self.title());
            (!curves.is_empty()).then(|| self.chart(&title, &curves))
        };
        scenarios.iter().filter_map(of_scenario).collect()
    }

    /// What a chart shows, with the name of the reference.
    fn title(&self) -> String {
        let reference =
            self.candidates.iter().find(|c| c.is_reference).map_or("the reference", |c| c.run.as_str());
        format!("ASEE against {reference}")
    }

    fn chart(&self, title: &str, curves: &[Curve<'_>]) -> Chart {
        let panel = |state: &usize| {
            let line = |c: &Curve<'_>| {
                let points = c.curves.t_s.iter().zip(&c.curves.asee_pct).map(|(t, pct)| (*t, pct[*state]));
                Series::line(c.name, Colour::Hue(c.hue), points.collect())
            };
            let zero = Series::new("", Colour::Ink, Mark::Level(0.0));
            let name = STATES[*state].split(" (").next().unwrap_or_default();
            let axis = Axis::linear(&format!("{name}: (ratio − 1)·100 (%)")).including(-1.0, 1.0);
            let series = std::iter::once(zero).chain(curves.iter().map(line)).collect();
            Panel { height: 0.8, ..Panel::new(axis, series) }
        };
        let panels = self.states.iter().map(panel).collect();
        Chart::new(title, Axis::linear("time (s)"), panels).with_outages(self.outages).in_group("time")
    }
}

/// Which filters are not as good as they believe, or better.
fn verdict(file: &ComparisonFile) -> String {
    let (right, wrong): (Vec<_>, Vec<_>) =
        file.verdicts.iter().cloned().partition(|row| row.verdict.kind == VerdictKind::Consistent);
    let lines = verdict_lines(&wrong);
    match (right.len(), lines.as_slice()) {
        (n, []) => format!("All {n} filters are consistent: their errors are as large as they believe."),
        (0, lines) => format!("{}.", lines.join(". ")),
        (n, lines) => format!("{}. The other {n} filters are consistent.", lines.join(". ")),
    }
}

const FIGURE: &str = "Departure of the ASEE of each filter from that of AWV in scenario I, (ratio − 1)·100, scenario by scenario; \
                      outages shaded.";

const CAPTION: &str = "ASEE (averaged standard estimation error): the filter's own standard deviation. 0 % is as the reference believes; \
                       below it a filter is surer of itself.";

/// Scenarios that have a chart each; of more, one chart has all runs.
const SCENARIOS: usize = 6;

/// One run in a chart.
struct Curve<'a> {
    name: &'a str,
    hue: usize,
    curves: &'a RatioCurves,
}

/// A row a run and outage, as they stand in comparison.json.
fn consistency(file: &ComparisonFile, outages: &[(f64, f64)], states: &[usize]) -> Table {
    let errors =
        states.iter().map(|s| format!("RMSE {} (%)", STATES[*s].split(" (").next().unwrap_or_default()));
    let mut table = Table::new(["run", "outage", "NEES", "NEES of the reference", "coverage"]).and(errors);
    for (i, row) in file.consistency.iter().enumerate() {
        let source_of = |key: &str| format!("/consistency/{i}/{key}");
        let mut cells: Vec<Cell> = vec![
            row.run.clone().into(),
            outages.get(row.outage).map_or_else(String::new, |w| window(*w)).into(),
            Cell::number(row.nees_mean, &source_of("nees_mean")),
            Cell::number(row.nees_mean_reference, &source_of("nees_mean_reference")),
            Cell::number(row.coverage_mean, &source_of("coverage_mean")),
        ];
        for state in states {
            let is_of_cell =
                |r: &&Row| r.run == row.run && r.outage == row.outage && r.state == REPORTED_NAMES[*state];
            let place = file.rows.iter().position(|r| is_of_cell(&r));
            cells.push(place.map_or_else(
                || Cell::figures("–"),
                |k| {
                    Cell::number(
                        file.rows[k].rmse_end_ratio_error_pct,
                        &format!("/rows/{k}/rmse_end_ratio_error_pct"),
                    )
                },
            ));
        }
        table.row(cells);
    }
    table
}
