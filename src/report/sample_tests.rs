//! A small made-up result for the tests of this room.

use nav_sim_navigation::simulation::{EpochSums, GainsUsed, OutageRecord, RunRecord, RunResult};

/// Four runs of 12 epochs, one outage from 4 to 8 s, errors as large as the filter believes.
pub(crate) fn result() -> RunResult {
    let runs = 4;
    let epoch = |t: u32| {
        let outage = (4..8).contains(&t);
        let sigma = 0.3
            + if outage {
                f64::from(t - 3).powi(2)
            } else {
                0.1 * f64::from(t % 3)
            };
        let n = f64::from(runs);
        EpochSums {
            t_s: f64::from(t),
            gnss: !outage,
            count: u64::from(runs),
            see: [n * sigma; 9],
            see_sq: [n * sigma * sigma * 1.01; 9],
            bias_see: [n * 1e-4; 6],
            error: [0.2 * sigma; 9],
            first_error: Some([0.4 * sigma; 9]),
            error_sq: [n * 1.1 * sigma * sigma; 9],
            error_4: [n * 3.0 * sigma.powi(4); 9],
            pos_error: [n * 1.6 * sigma, n * 3.0 * sigma * sigma],
            att_error: [n * 1.5 * sigma, n * 2.9 * sigma * sigma],
            nees: [n * 8.5, n * 90.0],
            covered: u64::from(runs) - u64::from(outage),
        }
    };
    let run = |run: u32| RunRecord {
        run: u64::from(run),
        diverged: false,
        outages: vec![OutageRecord {
            see_mean: [7.5 + 0.01 * f64::from(run); 9],
            see_end: [16.3 + 0.01 * f64::from(run); 9],
            nees_end: 8.0 + f64::from(run),
            log_density_end: -7.0 - 0.3 * f64::from(run),
            error_end: [3.0 - f64::from(run); 9],
            horizontal_error_end_m: 2.0 + f64::from(run),
            reconvergence_s: 1.0 + f64::from(run),
        }],
        nis: (5.5 + 0.3 * f64::from(run), 8),
        nees_mean: 8.5 + 0.1 * f64::from(run),
        covered: 0.75,
        normalised_sq: [1.0 + 0.1 * f64::from(run); 9],
    };
    RunResult {
        epochs: (0..12).map(epoch).collect(),
        runs: (0..runs).map(run).collect(),
        outages: vec![(4.0, 8.0)],
        filter_states: 15,
        fix_components: 6,
        coverage_level: 0.95,
        run_epochs: 4800,
        independent_windows: None,
        gains: GainsUsed::default(),
    }
}
