//! The sources of errors on the page of a run directory.

use super::charts::budget_chart;
use crate::report::STATES;
use nav_sim_document::{Cell, Document, Table, window};
use nav_sim_navigation::metrics::{Budget, OutageSummary, Summary};
use nav_sim_navigation::simulation::REPORTED_NAMES;

/// What the errors at the ends of the outages that are shown are made of, beside what the filter believes.
pub(super) fn budgets(summary: &Summary, shown: &[usize], page: &mut Document) {
    let kinds = |o: &'_ OutageSummary| {
        [
            ("true errors", o.budget.clone(), "budget"),
            (
                "what the filter believes",
                o.believed_budget.clone(),
                "believed_budget",
            ),
        ]
    };
    let mut bars: Vec<(String, Budget)> = Vec::new();
    for i in shown {
        let o = &summary.outages[*i];
        let word = |kind: &str| {
            if kind == "true errors" {
                "true"
            } else {
                "believed"
            }
        };
        let known = kinds(o).into_iter().filter_map(|(kind, budget, _)| {
            Some((
                format!("{}, {}", window(o.start_s, o.end_s), word(kind)),
                budget?,
            ))
        });
        bars.extend(known);
    }
    if bars.is_empty() {
        return;
    }
    page.section("Sources of errors");
    page.chart(&budget_chart(&bars), "Shares in the mean square at the end of each outage: of the true errors, by covariance analysis, and of those that the filter believes in.");
    for i in shown {
        let o = &summary.outages[*i];
        for (kind, budget, key) in kinds(o) {
            let Some(budget) = budget else { continue };
            let title = format!(
                "Sources of errors at the end of {}: {kind} (shares)",
                window(o.start_s, o.end_s)
            );
            let table = budget_table(&budget, &format!("/outages/{i}/{key}"));
            page.folded(&title, |page| page.table(&table));
        }
    }
}

fn budget_table(budget: &Budget, place: &str) -> Table {
    let names = STATES
        .iter()
        .map(|state| state.split(" (").next().unwrap_or(state).to_owned());
    let mut table = Table::new(["source"]).and(names);
    for (source, shares) in &budget.shares {
        let key = source.replace('~', "~0").replace('/', "~1");
        let cell =
            |(share, state): (&f64, &&str)| Cell::number(*share, &format!("{place}/{key}/{state}"));
        table.row(
            std::iter::once(Cell::from(source.clone()))
                .chain(shares.0.iter().zip(&REPORTED_NAMES).map(cell)),
        );
    }
    table
}
