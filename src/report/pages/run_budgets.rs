//! The sources of errors on the page of a run directory.

use super::run_charts::budget_chart;
use super::{STATES, window};
use crate::report::page::{Cell, Page, Table};
use nav_sim_navigation::metrics::{Budget, OutageSummary, Summary};
use nav_sim_navigation::simulation::REPORTED_NAMES;

/// What the errors at the ends of the outages that are shown are made of, beside what the filter believes.
pub(super) fn budgets(summary: &Summary, shown: &[usize], page: &mut Page) {
    let kinds = |o: &'_ OutageSummary| {
        [
            ("true errors", o.budget.clone(), "budget"),
            ("what the filter believes", o.believed_budget.clone(), "believed_budget"),
        ]
    };
    let mut bars: Vec<(String, Budget)> = Vec::new();
    for i in shown {
        let o = &summary.outages[*i];
        let word = |kind: &str| if kind == "true errors" { "true" } else { "believed" };
        let known = kinds(o).into_iter().filter_map(|(kind, budget, _)| {
            Some((format!("{}, {}", window((o.start_s, o.end_s)), word(kind)), budget?))
        });
        bars.extend(known);
    }
    if bars.is_empty() {
        return;
    }
    page.section("Sources of errors");
    page.chart(&budget_chart(&bars), "Shares in the mean square at the end of each outage: of the true errors, by covariance analysis, and of those that the filter believes in.");
    if let Some(words) = linear_shares(shown.iter().map(|i| &summary.outages[*i])) {
        page.text(&words);
    }
    for i in shown {
        let o = &summary.outages[*i];
        for (kind, budget, key) in kinds(o) {
            let Some(budget) = budget else { continue };
            let title =
                format!("Sources of errors at the end of {}: {kind} (shares)", window((o.start_s, o.end_s)));
            let table = budget_table(&budget, &format!("/outages/{i}/{key}"));
            page.folded(&title, |page| page.table(&table));
        }
    }
}

/// Shares are those of linear theory: said where the RMSE beside them is larger than that by more than a hundredth.
fn linear_shares<'a>(outages: impl Iterator<Item = &'a OutageSummary>) -> Option<String> {
    let share = |o: &'a OutageSummary| Some((o, o.second_order.shares_of_rmse(&o.budget.as_ref()?.total)));
    let largest = |shares: &[f64; 2]| shares[0].max(shares[1]);
    let (outage, shares) =
        outages.filter_map(share).max_by(|a, b| largest(&a.1).total_cmp(&largest(&b.1)))?;
    let [position, velocity] = shares.map(|share| format!("{:.0} %", 100.0 * share));
    (largest(&shares) > 0.01).then(|| {
        format!(
            "The shares of position and velocity down are of linear theory, in which their RMSE at the end of {} is smaller by {position} and \
             {velocity}; the second order has no source of its own.",
            window((outage.start_s, outage.end_s))
        )
    })
}

fn budget_table(budget: &Budget, place: &str) -> Table {
    let names = STATES.iter().map(|state| state.split(" (").next().unwrap_or(state).to_owned());
    let mut table = Table::new(["source"]).and(names);
    for (source, shares) in &budget.shares {
        let key = source.replace('~', "~0").replace('/', "~1");
        let cell = |(share, state): (&f64, &&str)| Cell::number(*share, &format!("{place}/{key}/{state}"));
        table.row(
            std::iter::once(Cell::from(source.clone())).chain(shares.0.iter().zip(&REPORTED_NAMES).map(cell)),
        );
    }
    table
}
