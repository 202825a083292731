//! White noise of the recording beside that of the model: a model made at rest knows nothing of the vibrations of a
//! drive, and one of another unit knows nothing at all.
//!
//! Fourth differences of white noise have 70 times its variance, and hardly contain the motion of a vehicle. Where
//! they are far larger than the model's, the recording's own white noise is taken unless the fixes disagree: at a low rate
//! motion can still be read as noise.

use super::outcome::{not_withheld, total_nis};
use super::{DriveData, FusionSettings, Solution, Start, fuse};
use crate::ekf::FilterModel;
use crate::imu::{Channel, ImuIncrement, Sensor};
use crate::linalg::{mean, median};
use crate::noise::{Composite, Model, Process, ProcessKind};
use serde::Serialize;
use std::f64::consts::FRAC_PI_2;

/// Factor on the model's standard deviation from which on noise is of another kind: the right IMU reads 0.2 to 1.3 on real drives,
/// phones 3 to 43.
const LARGER: f64 = 2.0;
/// Sum of the squares of the coefficients of a fourth difference.
const OF_FOURTH: f64 = 70.0;
/// Samples from which the median absolute deviation is known to a tenth.
const FEWEST: usize = 200;
/// Standard deviation of a normal distribution over its median absolute deviation.
const OF_MAD: f64 = 1.482_602;
/// Loss in −2 ln(likelihood) from which the fixes disagree: odds of e^5. On a drive that hardly tells, it is 5 by chance.
const DECIDES: f64 = 10.0;
/// Length of a recording that is examined (s).
const MOST_S: f64 = 1200.0;

/// White noise of a sensor that is larger than the model's.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct ExcessWhiteNoise {
    /// The sensor.
    pub sensor: Sensor,
    /// Its standard deviation over the model's, root mean square of the axes.
    pub times_model: f64,
    /// Variance of a sample at the model's rate, mean of the axes (units²).
    pub sigma2: f64,
}

/// The sensors whose white noise in the recording is far larger than the model's.
pub fn own_noise(imu: &[ImuIncrement], rate_hz: f64, model: &Model) -> Vec<ExcessWhiteNoise> {
    let band = rate_hz / model.rate_hz;
    let of_sensor = |sensor: Sensor| {
        let channels = || Channel::ALL.into_iter().filter(|c| c.sensor == sensor);
        let sigma2 = mean(channels().map(|channel| recorded(imu, channel))) / band;
        let stated = mean(channels().map(|channel| stated(model.axis(channel), band)));
        let times_model = (sigma2 / stated).sqrt();
        let is_larger = times_model > LARGER && times_model.is_finite();
        (is_larger && imu.len() >= FEWEST).then_some(ExcessWhiteNoise {
            sensor,
            times_model,
            sigma2,
        })
    };
    Sensor::ALL.into_iter().filter_map(of_sensor).collect()
}

/// Variance of white noise with the fourth differences of the recording (units²).
fn recorded(imu: &[ImuIncrement], channel: Channel) -> f64 {
    let rate = |s: &ImuIncrement| {
        let increment = match channel.sensor {
            Sensor::Accel => s.dv,
            Sensor::Gyro => s.dtheta,
        };
        increment[channel.axis as usize] / s.dt_s
    };
    let rates: Vec<f64> = imu.iter().map(rate).collect();
    let fourth = rates
        .windows(5)
        .map(|w| (w[0] - 4.0 * w[1] + 6.0 * w[2] - 4.0 * w[3] + w[4]).abs());
    (OF_MAD * median(fourth).unwrap_or(0.0)).powi(2) / OF_FOURTH
}

/// White noise of a model in this share of its band, by the spectrum of its processes.
fn stated(axis: &Composite, band: f64) -> f64 {
    const STEPS: u32 = 256;
    let power = (0..STEPS).map(|k| {
        let angle = FRAC_PI_2 * (f64::from(k) + 0.5) / f64::from(STEPS);
        let sin2 = (angle * band).min(FRAC_PI_2).sin().powi(2);
        let density = axis.processes.iter().map(|p| p.spectrum(sin2));
        density.sum::<f64>() * (2.0 * angle.sin()).powi(8)
    });
    mean(power) / OF_FOURTH
}

impl ExcessWhiteNoise {
    /// The model with this noise for the white noise of the sensor.
    pub fn apply_to(&self, model: &mut Model) {
        let channels = Channel::ALL.into_iter().filter(|c| c.sensor == self.sensor);
        for channel in channels {
            let processes = &mut model.axes[channel.index()].processes;
            processes.retain(|p| p.kind() != ProcessKind::White);
            processes.extend(Process::white(self.sigma2));
        }
    }
}

/// True if the first belief predicts the fixes as well as the second. What receivers state is right to a factor, so one
/// factor of all deviations is left open.
pub fn predicts_as_well(
    recorded: &DriveData<'_>,
    filter_models: [&FilterModel; 2],
    start: &Start,
    settings: &FusionSettings,
) -> bool {
    let recorded = recorded.until(start.t_s + MOST_S);
    let settings = settings.trial();
    let cost = |filter_model: &FilterModel| {
        let solution = fuse(&recorded, filter_model, start, &settings, None).ok()?;
        Some(cost(&solution)).filter(|cost| cost.is_finite())
    };
    let [first, second] = filter_models.map(cost);
    first.is_some_and(|first| second.is_none_or(|second| first < second + DECIDES))
}

/// −2 ln(likelihood) of the innovations, but for a constant, at the factor of all variances that makes it least.
fn cost(solution: &Solution) -> f64 {
    let log: f64 = not_withheld(solution)
        .flat_map(|f| &f.sigma)
        .map(|s| s.ln())
        .sum();
    let (nis, components) = total_nis(not_withheld(solution));
    2.0 * log + components as f64 * (nis / components as f64).ln()
}

#[cfg(test)]
mod tests {
    use super::super::vehicle_tests::{settings, start_of, without_aids};
    use super::*;
    use crate::scenario::aiding_tests::{consumer, scenario, town};
    use crate::tests::*;

    use crate::simulation::{Plan, record};

    /// White noise `times` that of the model, in a drive of 90 s at 50 Hz with turns and a stop. Fourth differences of 13 500
    /// samples tell the deviation to 2 % (efficiency 0.37 of the median, correlated over four samples): five of that.
    /// Where the noise is the model's, motion proposes nothing; the fixes decide for the right one of two beliefs.
    #[test]
    fn noise_of_the_recording_is_found_and_told_from_motion() {
        let (trajectory, model, plain) = (town(), consumer(), scenario(""));
        let with_white = |times: f64| {
            let mut model = model.clone();
            for axis in &mut model.axes {
                let white = axis.processes[0].times(times);
                axis.processes[0] = white.unwrap();
            }
            model
        };
        let filter_model = |model: &Model| {
            let track = plain.track(&trajectory, model, &[]).unwrap();
            plain.filter_model(model, &[], &track).unwrap()
        };
        let [stated, larger] = [1.0, 400.0].map(|times| filter_model(&with_white(times)));
        for (times, found) in [(1.0, 0), (400.0, 2)] {
            let truth = with_white(times);
            let experiment = plain.experiment(&trajectory, Truth::Model(&truth), &[], &[], 7);
            let recording = record(&Plan::new(&experiment).unwrap(), 0);
            let own = own_noise(&recording.imu, model.rate_hz, &model);
            assert_eq!(own.len(), found, "{own:?}");
            for noise in &own {
                let off = noise.times_model / times.sqrt() - 1.0;
                assert!(off.abs() < 0.1, "{noise:?}");
            }
            let (recorded, start) = (without_aids(&recording), start_of(&recording));
            let as_well = predicts_as_well(&recorded, [&larger, &stated], &start, &settings());
            assert_eq!(as_well, found == 2, "{times}");
        }
    }

    /// Fast noise of an AR1 beside white noise: what the model states is what a recording of it has, also at a tenth of the
    /// rate, where ten samples are averaged (the spectrum about a tenth of the band: 1/(1 − φ)² of the innovations).
    #[test]
    fn fast_noise_of_a_model_is_counted() {
        let white = Composite::new(vec![Process::white(2.0).unwrap()]);
        assert!(
            (stated(&white, 1.0) - 2.0).abs() < 1e-9 && (stated(&white, 0.1) - 2.0).abs() < 1e-9
        );
        let fast = Composite::new(vec![Process::ar1(0.5, 1.0).unwrap()]);
        assert_relative_eq!(stated(&fast, 0.01), 4.0, max_relative = 0.01);
        // the autocovariances of an AR1, φ^k/(1 − φ²), under the fourth difference
        let weights = [70.0, 2.0 * -56.0, 2.0 * 28.0, 2.0 * -8.0, 2.0];
        let sum: f64 = (0..5).map(|k| weights[k as usize] * 0.5_f64.powi(k)).sum();
        assert_relative_eq!(stated(&fast, 1.0), sum / 0.75 / 70.0, max_relative = 1e-9);
    }
}
