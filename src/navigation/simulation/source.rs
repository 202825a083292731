//! Random quantities of eight runs: starts, inertial errors, fixes, heights, aiding measurements.

use super::plan::{Event, Plan, TrueAid};
use crate::earth::moved;
use crate::ekf::Fix;
use crate::ekf::filter_model::psi_of_angles;
use crate::frames::{NavState, RollPitchYaw};
use crate::gnss::{GnssFix, GnssVelocity};
use crate::imu::{ImuIncrement, Sensor};
use crate::lanes::{Lanes, Vec3};
use crate::linalg::to_nalgebra;
use crate::rng::{Generator, StreamKey};
use crate::sensors::aiding::{Aid, AidNoise};
use crate::sensors::defects::Defects;
use crate::sensors::gnss::GnssNoise;
use crate::sensors::imu::LaneErrors;
use crate::sensors::normal;
use crate::units::DEG;
use glam::{DQuat, DVec3};
use std::ops::Range;

/// Measurements of eight runs at an instant.
pub(super) struct LaneMeasurements {
    pub fix: Option<Fix>,
    pub height: Option<Lanes>,
    /// Velocities along the vehicle's axes (m/s); of a heading the first is the yaw (rad).
    pub aids: Vec<(Aid, Vec3)>,
}

fn exact_fix(plan: &Plan<'_>, event: &Event) -> Fix {
    let (gnss, (antenna, velocity)) = (plan.experiment.gnss, event.antenna);
    Fix {
        lat: Lanes::splat(antenna[0]),
        lon: Lanes::splat(antenna[1]),
        h: Lanes::splat(antenna[2]),
        v_n: gnss.vel_sigma_m_s.map(|_| Vec3::splat(velocity)),
        pos_sigma_m: gnss.pos_sigma_m.into(),
        vel_sigma_m_s: gnss.vel_sigma_m_s.unwrap_or_default().into(),
        lever_arm_b: gnss.lever_arm_m.into(),
    }
}

fn exact_aid(event: &Event, aided: &TrueAid) -> Vec3 {
    Vec3::splat(match aided.aid {
        Aid::Heading => DVec3::X * RollPitchYaw::from_quat(event.reference.q_b_n).yaw,
        _ => aided.v_b,
    })
}

/// Everything random of eight runs.
pub(super) struct LaneSource<'a> {
    /// Rate of the IMU (Hz).
    rate_hz: f64,
    imu: LaneErrors<'a>,
    gnss: Vec<GnssNoise>,
    /// Streams of the heights; empty without a barometer.
    baro: Vec<Generator>,
    aiding: Vec<AidNoise>,
    /// Empty for an IMU without defects.
    defects: Vec<Defects>,
    keys: Vec<StreamKey<'a>>,
}

impl<'a> LaneSource<'a> {
    pub(super) fn new(plan: &Plan<'a>, first: u64, live: usize) -> Self {
        let experiment = plan.experiment;
        let key = |run| StreamKey {
            seed: experiment.seed,
            scenario: "",
            run,
            source: "",
            process: "",
        };
        let keys: Vec<_> = (first..first + live as u64).map(key).collect();
        let imu = LaneErrors::new(&experiment.truth, &plan.spans, &keys, plan.samples());
        let gnss = keys
            .iter()
            .map(|k| GnssNoise::new(experiment.gnss, *k))
            .collect();
        let height = |key: &StreamKey<'a>| key.stream("baro", "height");
        let baro = experiment.baro.iter();
        let baro = baro.flat_map(|_| keys.iter().map(height)).collect();
        let aiding = keys
            .iter()
            .map(|k| AidNoise::new(experiment.aiding, *k))
            .collect();
        let defects = match experiment.defects {
            settings if settings.is_ideal() => Vec::new(),
            settings => keys.iter().map(|k| Defects::draw(settings, *k)).collect(),
        };
        let rate_hz = experiment.rate_hz;
        Self {
            rate_hz,
            imu,
            gnss,
            baro,
            aiding,
            defects,
            keys,
        }
    }

    /// The nominal starts: the truth and an error drawn from the initial standard deviations.
    pub(super) fn starts(&self, plan: &Plan<'_>) -> Vec<NavState> {
        self.keys
            .iter()
            .map(|key| nominal_start(plan, *key))
            .collect()
    }

    /// The inertial errors of the next samples; idle lanes repeat the ideal.
    pub(super) fn errors(&mut self, plan: &Plan<'_>, samples: Range<usize>) -> &[[Vec3; 2]] {
        let block = self.imu.next(samples.len());
        if !self.defects.is_empty() {
            for (sample, k) in block.iter_mut().zip(samples) {
                let error_inputs = plan.error_inputs(k);
                for (lane, defects) in self.defects.iter().enumerate() {
                    for (error, more) in sample.iter_mut().zip(defects.error(&error_inputs)) {
                        error.set_lane(lane, error.lane(lane) + more);
                    }
                }
            }
        }
        block
    }

    /// The measurements of this epoch. Fixes are drawn within outages too, so that an outage changes no random number
    /// after it.
    pub(super) fn measured(&mut self, plan: &Plan<'_>, event: &Event) -> LaneMeasurements {
        let fix = event.gnss_epoch.then(|| self.fix(plan, event));
        LaneMeasurements {
            fix: fix.filter(|_| event.fix),
            height: self.height(plan, event),
            aids: self.aids(event),
        }
    }

    /// The heights of this epoch, if the barometer has one.
    fn height(&mut self, plan: &Plan<'_>, event: &Event) -> Option<Lanes> {
        let baro = plan.experiment.baro.filter(|_| event.baro)?;
        let mut h = Lanes::splat(event.reference.h);
        for (lane, stream) in self.baro.iter_mut().enumerate() {
            h[lane] += baro.sigma_m * normal(stream);
        }
        Some(h)
    }

    /// Aiding measurements of the vehicle at this epoch.
    fn aids(&mut self, event: &Event) -> Vec<(Aid, Vec3)> {
        let after_s = event.sample as f64 / self.rate_hz;
        let mut measure = |aided: &TrueAid| {
            let is_heading = aided.aid == Aid::Heading;
            let axes = if is_heading { &[0] } else { aided.aid.axes() };
            let mut value = exact_aid(event, aided);
            for (lane, noise) in self.aiding.iter_mut().enumerate() {
                for &axis in axes {
                    value[axis][lane] += noise.draw(aided.aid, axis, after_s, aided.v_b, aided.a_b);
                }
            }
            // Drawn in outages too, as a fix is: an outage changes no random number after it.
            (!aided.withheld).then_some((aided.aid, value))
        };
        event.aids.iter().filter_map(&mut measure).collect()
    }

    /// The fixes of this epoch.
    fn fix(&mut self, plan: &Plan<'_>, event: &Event) -> Fix {
        let (antenna, velocity) = event.antenna;
        let mut fix = exact_fix(plan, event);
        for (lane, noise) in self.gnss.iter_mut().enumerate() {
            let (position, speed) = noise.draw();
            [fix.lat[lane], fix.lon[lane], fix.h[lane]] = moved(antenna, position);
            if let Some(v_n) = &mut fix.v_n {
                v_n.set_lane(lane, velocity + speed);
            }
        }
        fix
    }
}

fn nominal_start(plan: &Plan<'_>, key: StreamKey<'_>) -> NavState {
    let (truth, initial) = (plan.start, plan.experiment.initial);
    if initial.perfect {
        return truth;
    }
    let draw = |process: &'static str, sigma: [f64; 3]| {
        let mut generator = key.stream("initial", process);
        DVec3::from(sigma.map(|sigma| sigma * normal(&mut generator)))
    };
    let dr = draw("position", initial.pos_sigma_m);
    let dv = draw("velocity", initial.vel_sigma_m_s);
    let angles = draw("attitude", initial.att_sigma_deg.map(|s| s * DEG));
    // Drawn as roll, pitch, yaw and brought to psi_n by the map that makes the filter's covariance: the NEES
    // at the start is a χ² of nine degrees of freedom, to first order.
    let psi = psi_of_angles(truth.q_b_n) * to_nalgebra(angles);
    let [lat, lon, h] = moved(truth.place(), dr);
    NavState {
        lat,
        lon,
        h,
        v_n: truth.v_n + dv,
        q_b_n: DQuat::from_scaled_axis(DVec3::from_slice(psi.as_slice())) * truth.q_b_n,
    }
}

// One run as its sensors record it: the data that fusion reads, made by the machinery of the runs.

/// Recorded measurements of one run, and the initial state of its filter.
#[derive(Debug, Clone)]
pub struct SimulatedRecording {
    /// Samples, increments over the interval that ends at their time.
    pub imu: Vec<ImuIncrement>,
    /// Fixes outside the outages, with the standard deviations they were drawn from.
    pub gnss: Vec<GnssFix>,
    /// The nominal start of the run, drawn from the initial standard deviations.
    pub start: NavState,
}

/// Samples whose errors are drawn at a time.
const BLOCK: usize = 4096;

/// Records the sensors in a run, with the same noise as in the run itself.
pub fn record(plan: &Plan<'_>, run: u64) -> SimulatedRecording {
    let mut source = LaneSource::new(plan, run, 1);
    let fix = |event: &Event| {
        let fix = source.fix(plan, event); // at every epoch, so that outages change no number
        let velocity = |v_n: Vec3| GnssVelocity::new(v_n.lane(0), fix.vel_sigma_m_s);
        event.fix.then(|| GnssFix {
            t_s: event.t_s,
            lat: fix.lat[0],
            lon: fix.lon[0],
            h: fix.h[0],
            pos_sigma_n: fix.pos_sigma_m,
            velocity: fix.v_n.map(velocity),
        })
    };
    let epochs = plan.events.iter().filter(|e| e.gnss_epoch);
    let gnss = epochs.filter_map(fix).collect();
    let (rate_hz, start_s) = (source.rate_hz, plan.experiment.trajectory.start_s());
    let dt_s = 1.0 / rate_hz;
    let mut imu = Vec::with_capacity(plan.samples());
    for first in (0..plan.samples()).step_by(BLOCK) {
        let block = first..plan.samples().min(first + BLOCK);
        for (ideal, error) in plan.ideal[block.clone()]
            .iter()
            .zip(source.errors(plan, block))
        {
            let [dv, dtheta] = Sensor::ALL
                .map(|sensor| (ideal.of(sensor) + error[sensor as usize].lane(0)) * dt_s);
            imu.push(ImuIncrement {
                t_s: start_s + (imu.len() + 1) as f64 / rate_hz,
                dt_s,
                dtheta,
                dv,
            });
        }
    }
    SimulatedRecording {
        imu,
        gnss,
        start: source.starts(plan)[0],
    }
}
