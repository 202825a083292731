//! Verdict and document of a tuning.

use super::*;
use crate::report::Answer;
use nav_sim_document::Tone;
use nav_sim_navigation::simulation::lincov::Departure;

fn consistency(ratio: f64, nees: f64) -> FilterConsistency {
    let (end_s, rmse_end) = (vec![90.0], vec![[1.0; 9]]);
    FilterConsistency {
        nees,
        largest: Departure {
            ratio,
            state: 8,
            outage: Some(0),
            truth: 0,
        },
        range: [0.95, ratio],
        end_s,
        rmse_end,
    }
}

fn result(filter: FilterStates, of_run: FilterConsistency) -> TuneResult {
    TuneResult {
        aiding_sigmas: None,
        filter,
        filter_of_run: FilterStates::Reduced15,
        factors: vec![Factor {
            sensor: Sensor::Gyro,
            on_variance: 4.0,
        }],
        before: consistency(2.0, 30.0),
        after: consistency(1.0, 8.8),
        of_run: (filter != FilterStates::Reduced15).then_some(of_run),
        informed: Some(consistency(1.0, 9.0)),
        truths: vec!["truth.toml".to_owned()],
        is_drawn: false,
        aim: Aim::Worst,
        without_factor: Vec::new(),
    }
}

/// The filter that was tuned is named, and what `run` makes by default beside it: a verdict on the full filter is not one on
/// that of 15 states.
#[test]
fn the_verdict_has_factors_cost_and_both_filters() {
    let lines = result(FilterStates::Full, consistency(1.19, 9.51)).verdict();
    assert_eq!(
        lines[0],
        "gyro × 4.00 (variance); cost 0.0 % of horizontal RMSE; NEES 30.0 → 8.80 (9 if right)"
    );
    assert_eq!(
        lines[1],
        "tuned, the full filter is consistent: errors 0.950 to 1.00 × sigma"
    );
    assert!(
        lines[2].contains("the default of run, is overconfident: errors 0.950 to 1.19"),
        "{lines:?}"
    );
    assert_eq!(
        result(FilterStates::Reduced15, consistency(1.0, 8.8))
            .verdict()
            .len(),
        2
    );
}

/// Never green where a filter is over- or underconfident; what `run` calls underconfident is called so.
#[test]
fn the_colour_is_that_of_the_worst_word() {
    let mut tuned = result(FilterStates::Reduced15, consistency(1.0, 8.8));
    assert_eq!(tuned.document().verdict.tone, Tone::Doubtful);
    tuned.after.range[0] = 0.756;
    let document = tuned.document();
    assert!(
        document.verdict.lines[1].contains("is underconfident: errors 0.756 to"),
        "{document:?}"
    );
    assert!(
        document.notes()[0].text.contains("--for mean"),
        "{document:?}"
    );
    tuned.factors[0].on_variance = 1.0;
    (tuned.before, tuned.after) = (consistency(1.0, 9.0), consistency(1.0, 9.0));
    assert_eq!(tuned.document().verdict.tone, Tone::Good);
    (tuned.before.range, tuned.after.range) = ([0.8, 0.9], [0.8, 0.9]);
    let document = tuned.document();
    assert!(
        document.verdict.tone == Tone::Doubtful
            && document.verdict.lines[0].starts_with("no factor is needed")
    );
}

/// Where an error is largest: the outage where there are several, the truth where there are several.
#[test]
fn the_largest_error_has_a_place() {
    let mut tuned = result(FilterStates::Reduced15, consistency(1.0, 8.8));
    let mut found = consistency(1.0, 8.8);
    assert_eq!(tuned.place(&found), "yaw_deg");
    found.end_s.push(300.0);
    assert_eq!(tuned.place(&found), "yaw_deg at 90 s");
    tuned.truths.push("other.toml".to_owned());
    (found.largest.truth, found.largest.outage) = (1, None);
    assert_eq!(tuned.place(&found), "yaw_deg over the run, other.toml");
}

/// Errors of 3 and 4 times what a filter has that knows the truth: √((9 + 16)/2) − 1 of cost.
#[test]
fn the_cost_is_the_root_mean_square_over_outages() {
    let mut tuned = result(FilterStates::Reduced15, consistency(1.0, 8.8));
    let ends = |scales: [f64; 2]| FilterConsistency {
        end_s: vec![90.0, 300.0],
        rmse_end: scales.map(|scale| [scale * 5.0; 9]).to_vec(),
        ..consistency(1.0, 9.0)
    };
    tuned.informed = Some(ends([1.0, 1.0]));
    assert!((tuned.cost(&ends([3.0, 4.0])) - (12.5_f64.sqrt() - 1.0)).abs() < 1e-12);
}

/// On average a filter is overconfident whose NEES is beyond the square of what the errors of one state may be; a sensor without
/// noise is the reason where the filter is overconfident, or the cost is absurd, and none otherwise.
#[test]
fn what_is_not_met_has_its_reason() {
    let mut tuned = result(FilterStates::Reduced15, consistency(1.0, 8.8));
    tuned.aim = Aim::Mean;
    let bound = 9.0 * (1.0 + TOLERANCE).powi(2);
    for (nees, is_met) in [(0.999 * bound, true), (1.001 * bound, false)] {
        tuned.after.nees = nees;
        assert_eq!(tuned.unmet().is_none(), is_met, "{nees}");
    }
    tuned.without_factor.push(Sensor::Accel);
    assert!(
        tuned
            .unmet()
            .unwrap()
            .starts_with("the model has no accel noise to multiply")
    );
    tuned.after.nees = 9.0;
    assert_eq!(tuned.unmet(), None);
    tuned.after.rmse_end = vec![[2.1; 9]];
    assert!(
        tuned
            .unmet()
            .unwrap()
            .starts_with("the model has no accel noise to multiply")
    );
}

#[test]
fn a_factor_on_the_aiding_is_told_where_there_is_one() {
    let mut tuned = result(FilterStates::Reduced15, consistency(1.0, 8.8));
    for (factor, told) in [
        (None, None),
        (Some(1.0), None),
        (
            Some(2.5),
            Some("every sigma of [aiding] × 2.50, and then of the model:"),
        ),
        (
            Some(f64::NAN),
            Some("no sigma of the aiding covers its errors: give the filter states of them"),
        ),
    ] {
        tuned.aiding_sigmas = factor;
        assert_eq!(tuned.of_aiding().as_deref(), told);
    }
}
