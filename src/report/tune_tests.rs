//! The words of a tuning.

use super::*;
use nav_sim_navigation::simulation::lincov::Departure;

fn honesty(ratio: f64, nees: f64) -> Honesty {
    let (end_s, rmse_end) = (vec![90.0], vec![[1.0; 9]]);
    Honesty {
        nees,
        largest: Departure { ratio, state: 8, outage: Some(0), truth: 0 },
        smallest: Departure { ratio: 0.95, state: 2, outage: None, truth: 0 },
        end_s,
        rmse_end,
    }
}

fn result(filter: FilterStates, of_run: Honesty) -> TuneResult {
    TuneResult {
        filter,
        filter_of_run: FilterStates::Reduced15,
        factors: vec![Factor { sensor: Sensor::Gyro, process: None, on_variance: 4.0 }],
        before: honesty(2.0, 30.0),
        after: honesty(1.0, 8.8),
        of_run: (filter != FilterStates::Reduced15).then_some(of_run),
        informed: honesty(1.0, 9.0),
        truths: vec!["truth.toml".to_owned()],
        is_drawn: false,
        aim: Aim::Worst,
        without_factor: Vec::new(),
        sweep: Vec::new(),
    }
}

/// The filter that was tuned is named, and what `run` does by default is judged too: a verdict on the full filter is
/// not one on that of 15 states.
#[test]
fn the_verdict_names_the_filter_and_judges_the_default_of_run() {
    let verdict = result(FilterStates::Full, honesty(1.19, 9.51)).verdict();
    assert!(verdict.starts_with("the full filter is overconfident by 2.00 in yaw_deg"), "{verdict}");
    let default = "; in the filter of 15 states, which run makes of it by default: the NEES is 9.51, yaw_deg still overconfident by 1.19";
    assert!(verdict.contains(default) && verdict.ends_with("(--filter 15 tunes that one)"), "{verdict}");
    let verdict = result(FilterStates::Full, honesty(0.98, 8.9)).verdict();
    assert!(verdict.contains("by default: it is honest") && !verdict.contains("--filter"), "{verdict}");
    let verdict = result(FilterStates::Reduced15, honesty(1.0, 8.8)).verdict();
    assert!(verdict.starts_with("the filter of 15 states is") && !verdict.contains("default"), "{verdict}");
}

/// What `run` calls underconfident is not called honest alone.
#[test]
fn a_filter_that_states_too_much_is_said_to_be_underconfident() {
    let mut timid = result(FilterStates::Reduced15, honesty(1.0, 8.8));
    timid.after.smallest.ratio = 0.756;
    let verdict = timid.verdict();
    let words = "larger than stated, but underconfident in pos_d_m over the run (0.756 of what is stated)";
    assert!(verdict.contains(words), "{verdict}");
    timid.factors[0].on_variance = 1.0;
    timid.before = honesty(0.9, 7.0);
    let verdict = timid.verdict();
    assert!(verdict.ends_with("no factor is needed (--allow-smaller seeks one below 1)"), "{verdict}");
}
