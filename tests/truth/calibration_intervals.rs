//! Intervals that a calibration leaves in navigation figures, against laboratories whose IMU is known: each records
//! it anew, calibrates, and states intervals; those hold what the filter of the true model states, and the errors that
//! the laboratory's own filter truly has.

use crate::shared::*;
use nav_sim::app::Context;
use nav_sim::calibration::{
    Bootstrap, CalibrationSettings, Estimator, ModelChoice, Pool, add_intervals, calibrate,
    grouped, replicates,
};
use nav_sim::commands::run::{NavigateInputs, TrueImu, navigate};
use nav_sim::io::draws_file::{Draws, DrawsFile};
use nav_sim::navigation::metrics::Summary;
use nav_sim::navigation::simulation::REPORTED_NAMES;
use nav_sim::signal::imu::Channel;
use nav_sim::signal::noise::VirtualImu;

/// What every laboratory has.
struct World {
    truth: Model,
    fitted: &'static str,
    trajectory: Trajectory,
    scenario: Scenario,
    recordings: u64,
    samples: usize,
}

/// A model, and what other recordings would have given.
struct Calibrated {
    model: Model,
    draws: Draws,
}

impl World {
    /// So many laboratories: what they calibrate does not depend on the filter.
    fn laboratories(&self, count: u64) -> Vec<Calibrated> {
        (1..=count).map(|seed| self.laboratory(seed)).collect()
    }

    fn laboratory(&self, seed: u64) -> Calibrated {
        let settings = CalibrationSettings {
            estimators: vec![Estimator::Awv],
            model: ModelChoice::Given(self.fitted.parse().unwrap()),
            rate_hz: self.truth.rate_hz,
            ..CalibrationSettings::default()
        };
        let imu = VirtualImu {
            model: &self.truth,
            spread: None,
            contamination: None,
            seed,
        };
        let mut measured = Vec::new();
        for run in 1..=self.recordings {
            let recording = imu.recording(run, &Channel::ALL, self.samples).unwrap();
            measured.extend(replicates(&recording, None, &settings.tuning).unwrap());
        }
        let groups = grouped(measured, Pool::Sensor);
        let mut outcomes = calibrate(&groups, &settings).unwrap();
        add_intervals(
            &groups,
            &mut outcomes,
            &settings,
            Bootstrap { draws: 200, seed },
        );
        let model = Model::pooled(
            settings.rate_hz,
            &outcomes[0].fit.composite,
            &outcomes[1].fit.composite,
        );
        let draws = DrawsFile::of(&outcomes, settings.rate_hz)
            .unwrap()
            .draws(&model)
            .unwrap();
        Calibrated { model, draws }
    }

    /// A covariance analysis with this model in the filter and this truth.
    fn analysis(&self, model: &Model, truth: TrueImu, draws: Option<Draws>) -> Summary {
        let mut inputs = NavigateInputs::new(self.trajectory.clone(), model.clone(), truth);
        inputs.model_draws = draws;
        let span = self.trajectory.span_s();
        let outages = self.scenario.outages_on(span, 0).unwrap().windows;
        navigate(&inputs, &self.scenario, &outages, 0, &Context::default())
            .unwrap()
            .summary
    }

    /// How many of the laboratories' intervals hold the truth: of the ASEE and of the RMSE at the end of the last outage,
    /// state by state, and of the quantiles of the horizontal error.
    fn held(&self, laboratories: &[Calibrated]) -> ([u64; 9], [u64; 9], [u64; 2]) {
        let informed = self.analysis(&self.truth, TrueImu::AsBelieved, None);
        let asee = informed.outages.last().unwrap().asee_end;
        let (mut of_asee, mut of_rmse, mut of_quantiles) = ([0; 9], [0; 9], [0; 2]);
        for Calibrated { model, draws } in laboratories {
            let stated = self.analysis(model, TrueImu::AsBelieved, Some(draws.clone()));
            let truly = self.analysis(model, TrueImu::Model(self.truth.clone()), None);
            let (stated, truly) = (
                stated.outages.last().unwrap(),
                truly.outages.last().unwrap(),
            );
            let holds =
                |(low, high): (f64, f64), value: f64| u64::from(low <= value && value <= high);
            for i in 0..9 {
                of_asee[i] += holds(stated.asee_end_ci95.unwrap().0[i], asee.0[i]);
                of_rmse[i] += holds(stated.rmse_end_ci95.unwrap().0[i], truly.rmse_end.0[i]);
            }
            let (h, t) = (
                &stated.horizontal_error_end_m,
                &truly.horizontal_error_end_m,
            );
            for (count, (ends, value)) in of_quantiles
                .iter_mut()
                .zip([(h.p50_ci95, t.p50), (h.p95_ci95, t.p95)])
            {
                *count += holds((ends.0.unwrap(), ends.1.unwrap()), value);
            }
        }
        (of_asee, of_rmse, of_quantiles)
    }
}

/// Two minutes with an outage of 40 s, at 10 Hz.
fn short(states: &str) -> World {
    let axis = |unit: f64| {
        let ar1 = Process::ar1(0.99, 2e-7 * unit).unwrap();
        Composite::new(vec![Process::white(2e-5 * unit).unwrap(), ar1])
    };
    let scenario = format!(
        "run.method = \"lincov\"\nfilter.states = \"{states}\"\nimu.rate_hz = 10\noutage = [{{ start_s = 70, end_s = 110 }}]"
    );
    World {
        truth: Model::pooled(10.0, &axis(1.0), &axis(1e-3)),
        fitted: "WN+AR1",
        trajectory: super::lincov_sampled::drive(),
        scenario: toml::from_str(&scenario).unwrap(),
        recordings: 4,
        samples: 1 << 12,
    }
}

/// Of 200 laboratories, with the filter of 15 and of all states: a frequency that is really 0.95 lies within
/// 4·√(0.95·0.05/200) = 6.2 % of it.
#[test]
#[ignore = "night: its figures are in examples/README.md"]
fn intervals_of_many_laboratories() {
    const LABORATORIES: u64 = 200;
    let laboratories = short("15").laboratories(LABORATORIES);
    for states in ["15", "full"] {
        let (asee, rmse, quantiles) = short(states).held(&laboratories);
        println!("filter {states}: of {LABORATORIES} intervals so many hold the truth");
        for i in 0..9 {
            println!("| {} | {} | {} |", REPORTED_NAMES[i], asee[i], rmse[i]);
        }
        println!("horizontal p50 {}, p95 {}", quantiles[0], quantiles[1]);
        let least = asee.iter().chain(&rmse).min().unwrap_or(&0);
        let most = asee.iter().chain(&rmse).max().unwrap_or(&0);
        println!(
            "figure calibration_intervals: filter {states}: {least} to {most} of {LABORATORIES} hold the truth"
        );
        let share = |n: &u64| *n as f64 / LABORATORIES as f64;
        assert!(
            asee.iter()
                .chain(&rmse)
                .chain(&quantiles)
                .map(share)
                .all(|s| (s - 0.95).abs() < 0.062)
        );
    }
}
