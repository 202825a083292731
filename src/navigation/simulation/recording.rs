//! One run as its sensors record it: the data that fusion reads, made by the machinery of the runs.

use super::Plan;
use super::source::nominal_start;
use crate::earth::radii;
use crate::frames::NavState;
use crate::gnss::{GnssFix, GnssVelocity};
use crate::imu::{Channel, ImuIncrement, Sensor};
use crate::rng::StreamKey;
use crate::sensors::defects::Defects;
use crate::sensors::gnss::GnssNoise;
use crate::sensors::imu::ImuErrors;
use glam::DVec3;

/// What was recorded, and where the filter would start.
#[derive(Debug, Clone)]
pub struct Recording {
    /// Samples, increments over the interval that ends at their time.
    pub imu: Vec<ImuIncrement>,
    /// Fixes outside the outages, with the standard deviations they were drawn from.
    pub gnss: Vec<GnssFix>,
    /// The nominal start of the run, drawn from the initial standard deviations.
    pub start: NavState,
}

/// What the sensors record in a run: the same noise as the run itself has.
#[must_use]
pub fn record(plan: &Plan<'_>, run: u64) -> Recording {
    let experiment = plan.experiment;
    let (seed, scenario) = (experiment.seed, experiment.scenario);
    let key = StreamKey {
        seed,
        scenario,
        run,
        source: "",
        process: "",
    };
    let mut noise = GnssNoise::new(experiment.gnss, key);
    let gnss = plan
        .events
        .iter()
        .filter(|e| e.gnss_epoch)
        .filter_map(|event| {
            let (dr, dv) = noise.draw(); // at every epoch, so that outages change no number
            let (antenna, velocity) = event.antenna;
            let r = radii(antenna.x.sin());
            let sigma = experiment.gnss.vel_sigma_m_s;
            event.fix.then(|| GnssFix {
                t_s: event.t_s,
                lat: antenna.x + dr.x / (r.meridian + antenna.z),
                lon: antenna.y + dr.y / ((r.transverse + antenna.z) * antenna.x.cos()),
                h: antenna.z - dr.z,
                pos_sigma_n: experiment.gnss.pos_sigma_m.into(),
                velocity: sigma.map(|sigma| GnssVelocity::new(velocity + dv, sigma.into())),
            })
        });
    Recording {
        gnss: gnss.collect(),
        imu: inertial(plan, key),
        start: nominal_start(plan, key),
    }
}

fn inertial(plan: &Plan<'_>, key: StreamKey<'_>) -> Vec<ImuIncrement> {
    let (rate_hz, start_s) = (
        plan.experiment.rate_hz,
        plan.experiment.trajectory.start_s(),
    );
    let mut errors = ImuErrors::new(&plan.errors, key, plan.samples());
    let errors_of = |channel: Channel, errors: &mut ImuErrors<'_>| {
        let mut signal = vec![0.0; plan.samples()];
        errors.fill(channel, &mut signal);
        signal
    };
    // One stream a channel: drawn channel by channel or sample by sample, the numbers are those of the run.
    let signals = Channel::ALL.map(|channel| errors_of(channel, &mut errors));
    let defects = Defects::draw(plan.experiment.defects, key);
    let triad = |sensor: Sensor, k: usize| {
        let first = 3 * sensor as usize;
        DVec3::new(
            signals[first][k],
            signals[first + 1][k],
            signals[first + 2][k],
        )
    };
    let dt_s = 1.0 / rate_hz;
    let settings = plan.experiment.defects;
    let sample = |(k, ideal): (usize, &crate::imu::ImuSample)| {
        let felt = plan.felt(k);
        let [dv, dtheta] = Sensor::ALL.map(|sensor| {
            let value = ideal.of(sensor) + defects.error(&felt)[sensor as usize] + triad(sensor, k);
            settings
                .output
                .as_ref()
                .map_or(value, |output| output.put(sensor, value))
                * dt_s
        });
        ImuIncrement {
            t_s: start_s + (k + 1) as f64 / rate_hz,
            dt_s,
            dtheta,
            dv,
        }
    };
    plan.ideal.iter().enumerate().map(sample).collect()
}
