//! Where outages are tried.

use super::*;
use nav_sim_navigation::require::LimitQuantity;
use nav_sim_navigation::trajectory::TrajectorySample;

/// At rest from 1000 s on, for so long.
fn at_rest(
    lasts_s: f64,
    ask: OutageRequest,
    first_s: Option<f64>,
) -> Result<Requirements, Failure> {
    let sample = |k: u32| TrajectorySample {
        t_s: 1000.0 + lasts_s * f64::from(k) / 8.0,
        lat: 0.8,
        lon: 0.1,
        h: 400.0,
        q_b_n: glam::DQuat::IDENTITY,
    };
    let trajectory = Trajectory::from_samples(&(0..=8).map(sample).collect::<Vec<_>>()).unwrap();
    let limits = vec![Limit {
        quantity: LimitQuantity::P95,
        most: 5.0,
    }];
    Requirements::new(Scenario::default(), trajectory, limits, ask, first_s)
}

/// After five minutes, or in the middle of what is left of a short drive; every second from there on that the outage fits in.
#[test]
fn outages_of_a_length_begin_where_the_filter_has_settled() {
    for (lasts_s, first_s, count) in [(900.0, 1300.0, 541), (180.0, 1060.0, 61), (60.0, 1000.0, 1)]
    {
        let asked = at_rest(lasts_s, OutageRequest::Length(60.0), None).unwrap();
        let outages = asked.outages();
        assert_eq!(
            (outages[0].start_s, outages.len()),
            (first_s, count),
            "{lasts_s}"
        );
        assert!(
            outages
                .iter()
                .all(|o| o.end_s - o.start_s == 60.0 && o.end_s <= 1000.0 + lasts_s)
        );
    }
    let said = at_rest(59.0, OutageRequest::Length(60.0), None)
        .unwrap_err()
        .to_string();
    assert!(said.contains("which lasts from 1000 to 1059 s"), "{said}");
    assert!(at_rest(180.0, OutageRequest::Length(60.0), Some(999.0)).is_err());
    assert!(at_rest(180.0, OutageRequest::Length(60.0), Some(1121.0)).is_err());
}

/// Against the sum over beginnings every tenth of a second.
#[test]
fn outages_last_in_the_mean_as_long_as_the_drive_lets_them() {
    for lasts_s in [400.0, 2000.0] {
        let asked = at_rest(lasts_s, OutageRequest::Longest, Some(1100.0)).unwrap();
        let left_s = lasts_s - 100.0;
        let steps = (10.0 * left_s) as u32;
        let length_s = |k: u32| LONGEST_S.min(left_s - (f64::from(k) + 0.5) / 10.0);
        let mean_s = (0..steps).map(length_s).sum::<f64>() / f64::from(steps);
        assert!(
            (asked.mean_length_s() / mean_s - 1.0).abs() < 1e-6,
            "{mean_s}"
        );
    }
}
