use super::*;
use crate::metrics::{Requirement, VerdictKind};

use crate::simulation::{EpochSums, OutageRecord, RunRecord};
use crate::tests::*;

/// Runs of a filter that is right by construction: errors drawn from its own covariance (identity).
fn matched(runs: u64, epochs: usize) -> RunResult {
    let mut normal = normals(11);
    let mut sums = Vec::new();
    for t in 0..epochs {
        let mut s = EpochSums {
            t_s: t as f64,
            gnss: true,
            count: runs,
            ..EpochSums::default()
        };
        for _ in 0..runs {
            let e: [f64; 9] = std::array::from_fn(|_| normal());
            for i in 0..9 {
                s.see[i] += 1.0;
                s.see_sq[i] += 1.0;
                s.error[i] += e[i];
                s.error_sq[i] += e[i].powi(2);
                s.error_4[i] += e[i].powi(4);
            }
            let nees: f64 = e.iter().map(|x| x * x).sum();
            s.nees[0] += nees;
            s.nees[1] += nees * nees;
            let six: f64 = [0, 1, 2, 6, 7, 8].iter().map(|i| e[*i].powi(2)).sum();
            s.covered += u64::from(six <= 12.591_587_243_743_977); // 95 % quantile of χ²(6)
        }
        sums.push(s);
    }
    let record = |run| RunRecord {
        run,
        diverged: false,
        outages: vec![OutageRecord {
            see_mean: [1.0; 9],
            see_end: [1.0; 9],
            ..OutageRecord::default()
        }],
        nis: (6.0, 10),
        ..RunRecord::default()
    };
    RunResult {
        epochs: sums,
        runs: (0..runs).map(record).collect(),
        outages: vec![(2.0, 4.0)],
        filter_states: 15,
        fix_components: 6,
        coverage_level: 0.95,
        run_epochs: runs * 1000,
        ..RunResult::default()
    }
}

fn summary_of(result: &RunResult) -> Summary {
    Summary::of(result, &super::super::epochs(result), 7)
}

/// Over 2000 independent epochs 95 % of the NEES means lie in their band, within 5 standard deviations of
/// a binomial share, 5 √(0.05·0.95/2000) = 0.0244. The band of the coverage is discrete: for 50 runs its
/// probability is 98.3 % (44 to 50 of 50, and 50 cannot be exceeded).
#[test]
fn a_correct_filter_is_found_correct_and_one_off_by_a_quarter_is_not() {
    let mut result = matched(50, 2000);
    let Summary { nees, coverage, .. } = summary_of(&result);
    assert_abs_diff_eq!(nees.fraction_inside, 0.95, epsilon = 0.0244);
    assert_abs_diff_eq!(nees.mean, 9.0, epsilon = 5.0 * (18.0_f64 / 1e5).sqrt());
    assert!(coverage.fraction_inside > 0.95, "{coverage:?}");
    assert_abs_diff_eq!(
        coverage.mean,
        0.95,
        epsilon = 5.0 * (0.0475_f64 / 1e5).sqrt()
    );
    for s in &mut result.epochs {
        s.nees = s.nees.map(|n| n * 1.25);
    }
    // the mean is at 11.25 ± 0.75, the band ends at 10.2: 0.1 by the normal law
    assert!(summary_of(&result).nees.fraction_inside < 0.2);
}

#[test]
fn the_file_has_the_keys_of_the_interface() {
    let mut result = matched(5, 6);
    result.runs[2].diverged = true;
    result.runs[4].diverged = true;
    let json = serde_json::to_value(summary_of(&result)).unwrap();
    for pointer in [
        "/outages/0/start_s",
        "/outages/0/asee_mean/pos_e_m",
        "/outages/0/rmse_end/roll_deg",
        "/outages/0/asee_end/roll_deg",
        "/outages/0/rmse_mean/pos_d_m",
        "/accuracy/rmse_mean/yaw_deg",
        "/verdict/nees",
        "/verdict/coverage",
        "/independent_runs",
        "/outages/0/horizontal_error_end_m/p50",
        "/outages/0/horizontal_error_end_m/max",
        "/nees/fraction_inside",
        "/coverage/level",
    ] {
        assert!(
            json.pointer(pointer).is_some_and(|v| v.is_number()),
            "{pointer} in {json}"
        );
    }
    assert_eq!(json["schema_version"], 1);
    assert_eq!(json["method"], "monte-carlo");
    assert_eq!(json["verdict"]["kind"], "diverged");
    assert_eq!(
        (&json["runs"], &json["diverged"], &json["diverged_runs"]),
        (&5.into(), &2.into(), &serde_json::json!([2, 4]))
    );
    assert_eq!(json["nis"]["fixes"], 30);
}

#[test]
fn nothing_left_is_null_not_a_crash() {
    let mut result = matched(2, 2);
    for run in &mut result.runs {
        run.diverged = true;
    }
    result.epochs.iter_mut().for_each(|s| {
        *s = EpochSums {
            t_s: s.t_s,
            ..EpochSums::default()
        }
    });
    let json = serde_json::to_value(summary_of(&result)).unwrap();
    assert!(json["nees"]["mean"].is_null() && json["nees"]["lower95"].is_null());
}

/// Sixteen runs that are each other's copies in fours: every interval is that of four.
#[test]
fn runs_that_share_their_noise_count_once_in_every_band() {
    let mut copies = matched(16, 20);
    copies.independent_windows = Some(4.0);
    let Summary {
        nees,
        coverage,
        nis,
        independent_runs,
        ..
    } = summary_of(&copies);
    for (found, four) in [
        ((nees.lower95, nees.upper95), chi_square_band(9, 4.0)),
        (
            (coverage.lower95, coverage.upper95),
            coverage_band(0.95, 4.0),
        ),
        ((nis.lower95, nis.upper95), chi_square_band(6, 40.0)),
    ] {
        assert_eq!(found, (four.lower, four.upper));
    }
    assert_eq!(independent_runs, 4.0);
}

/// Every figure of runs at one standard error above what is expected, one of them at three below. With two independent runs
/// Student's law is Cauchy's, whose quantile is the cotangent of π times the probability beyond it.
#[test]
fn distances_are_counted_in_standard_errors_and_the_bound_is_students() {
    let result = matched(4, 6);
    let mut runs = summary_of(&result);
    let expected = runs.clone();
    let above = |expected: f64| (expected + 0.25, 0.25);
    let (verdict, accuracy, outage) = (&mut runs.verdict, &mut runs.accuracy, &mut runs.outages[0]);
    (verdict.nees, verdict.nees_std_error) = above(expected.nees.mean);
    (verdict.coverage, verdict.coverage_std_error) = above(expected.coverage.mean);
    (outage.nees_end, outage.nees_end_std_error) = above(outage.nees_end);
    for i in 0..9 {
        let mean = &mut accuracy.rmse_mean.0[i];
        (*mean, accuracy.rmse_mean_std_error.0[i]) = above(*mean);
        (outage.rmse_end.0[i], outage.rmse_end_std_error.0[i]) = above(outage.rmse_end.0[i]);
    }
    outage.rmse_end.0[4] -= 1.0;
    runs.independent_runs = 2.0;
    // 21 figures; the largest distance is −3
    let bound = 1.0 / (std::f64::consts::PI * 1e-3 / 42.0).tan();
    let mut expected = expected;
    expected.verdict.kind = VerdictKind::Doubtful;
    runs.outages[0].rmse_end.0[4] -= 0.25 * (bound - 3.001);
    runs.compare_with(&expected);
    assert!(!runs.is_contradicted);
    runs.outages[0].rmse_end.0[4] -= 0.25 * 0.002;
    runs.compare_with(&expected);
    assert!(runs.is_contradicted);
}

/// Where errors are beyond linear theory an analysis alone decides nothing of position and velocity down, and all of the rest.
#[test]
fn a_limit_downwards_beyond_linear_theory_is_left_to_the_runs() {
    let result = matched(4, 6);
    let mut summary = summary_of(&result);
    let outage = &mut summary.outages[0];
    (
        outage.beyond_linear,
        outage.rmse_end,
        outage.horizontal_error_end_m.p95,
    ) = (true, PerState([1.0; 9]), 1.0);
    let met =
        |text: &str, summary: &Summary| text.parse::<Requirement>().unwrap().check(summary).met;
    let down = ["pos_d_m<=2", "vel_d_m_s<=2"];
    let level = ["p95_m<=2", "pos_n_m<=2", "vel_e_m_s<=2", "yaw_deg<=2"];
    assert!(down.iter().chain(&level).all(|text| met(text, &summary)));
    summary.runs = 0;
    assert!(
        !down.iter().any(|text| met(text, &summary))
            && level.iter().all(|text| met(text, &summary))
    );
    assert!(!met("p95_m<=0.9", &summary) && !met("pos_d_m<=0.9", &summary));
}
