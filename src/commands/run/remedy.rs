//! What helps a filter that is overconfident.

use super::RunAnswer;
use crate::report::{unexpected_in_words, unexpected_line};
use nav_sim_document::window;
use nav_sim_navigation::ekf::FixUpdate;
use nav_sim_navigation::metrics::{Summary, VerdictKind};
use nav_sim_navigation::scenario::{Method, Unexpected};
use nav_sim_navigation::simulation::{REPORTED, REPORTED_NAMES};

const TOO_LARGE: &str =
    "errors too large for a linear filter; another MODEL or nav-sim tune does not help";

/// The same, with the update that helps: where errors are too large after fixes that follow an outage, not before them.
fn too_large(summary: &Summary, answer: &RunAnswer) -> String {
    let verdict = &summary.verdict;
    let is_after = |first: usize| {
        let is_met_again = summary.outages[first].reconvergence_s.p50.is_finite();
        is_met_again && verdict.worst_outage.is_none_or(|outage| outage > first)
    };
    let is_linear = answer.origin.configuration.filter.update == FixUpdate::Ekf;
    match is_linear && verdict.beyond_linear.is_some_and(is_after) {
        true => format!("{TOO_LARGE}; filter.update = \"iterated\" does"),
        false => TOO_LARGE.to_owned(),
    }
}

/// What helps: by what the belief lacks, where linear analysis finds the filter wrong already; errors that are large are then
/// its consequence.
pub(super) fn remedy(summary: &Summary, unexpected: &[Unexpected], answer: &RunAnswer) -> String {
    let quality = summary
        .reduction
        .as_ref()
        .and_then(|reduction| reduction.quality.as_ref());
    let ratios = quality.into_iter().flat_map(|q| {
        q.outage_end
            .iter()
            .chain([&q.mean])
            .flat_map(|state| state.0)
    });
    if summary.is_contradicted {
        return too_large(summary, answer);
    }
    if let Some(largest) = largest_unexpected(summary, unexpected) {
        return largest;
    }
    let is_too_large = summary.verdict.beyond_linear.is_some();
    let [is_recorded, is_modelled] = ["static", "truth"].map(|role| answer.has_input(role));
    // what recordings contain is unknown, and so is whether linear analysis would find the filter wrong
    if is_recorded && is_too_large {
        return too_large(summary, answer);
    }
    // where the reduced filter is right about the errors of its own model, the errors are of something else
    if ratios.fold(0.0, f64::max) > 1.0 + summary.verdict.tolerance {
        return "--filter full has a state for each process of the model".to_owned();
    }
    if is_recorded || is_modelled {
        return "the errors are not those of MODEL: nav-sim tune finds variances that cover them"
            .to_owned();
    }
    // linear analysis, which draws nothing, finds the filter wrong already: it has no state for one of the errors
    let is_expected = summary.method == Method::Lincov.name();
    let is_analysed =
        is_expected || summary.verdict.by_covariance_analysis == Some(VerdictKind::Overconfident);
    match unexpected.first() {
        Some(found) if is_analysed => unexpected_line(found),
        None if is_expected && !is_too_large => beside_the_states(summary).to_owned(),
        _ => too_large(summary, answer),
    }
}

/// What covers an error that is in the budgets and that no state of the filter is for.
fn beside_the_states(summary: &Summary) -> &'static str {
    let sources = summary
        .outages
        .iter()
        .filter_map(|o| o.budget.as_ref())
        .flat_map(|budget| &budget.shares);
    let no_filter_has = |name: &String| name.contains(".QN") || name.contains(".MA1");
    if sources.map(|(name, _)| name).any(no_filter_has) {
        return "MODEL has noise that no filter contains: nav-sim tune --truth MODEL covers it";
    }
    "the errors are not those of MODEL: nav-sim tune --scenario finds variances that cover them"
}

/// The source with the largest share of the worst error, of those that the filter does not expect, where it makes at least
/// half of what is too much there; without an outage, which has the shares, the first.
fn largest_unexpected(summary: &Summary, unexpected: &[Unexpected]) -> Option<String> {
    let verdict = &summary.verdict;
    let outage = verdict
        .worst_outage
        .or_else(|| summary.outages.len().checked_sub(1));
    let known =
        outage.and_then(|k| Some((&summary.outages[k], summary.outages[k].budget.as_ref()?)));
    let Some((outage, budget)) = known else {
        return unexpected.first().map(unexpected_line);
    };
    let worst = REPORTED_NAMES
        .iter()
        .position(|name| *name == verdict.worst_state);
    // the state, and the share in its mean square
    let share = |cause: &Unexpected| {
        let sources = cause.sources();
        let of_cause = budget
            .shares
            .iter()
            .filter(|(name, _)| sources.contains(name));
        let shares = of_cause.fold([0.0; REPORTED], |sum, (_, of)| {
            std::array::from_fn(|i| sum[i] + of.0[i])
        });
        let states = worst.map_or(0..REPORTED, |state| state..state + 1);
        states
            .map(|state| (state, shares[state]))
            .max_by(|a, b| a.1.total_cmp(&b.1))
    };
    let shares = unexpected
        .iter()
        .filter_map(|cause| Some((cause, share(cause)?)));
    let (largest, (state, share)) = shares.max_by(|a, b| a.1.1.total_cmp(&b.1.1))?;
    // of a mean square that is ratio² times what is believed, this share is too much
    let excess = 1.0 - verdict.ratio.powi(-2);
    let place = format!(
        "{} at the end of {}",
        REPORTED_NAMES[state],
        window(outage.start_s, outage.end_s)
    );
    let told = || {
        let (what, remedy) = unexpected_in_words(largest);
        format!(
            "{what} ({:.0} % of the mean square of {place}): {remedy}",
            100.0 * share
        )
    };
    (share > 0.5 * excess).then(told)
}
