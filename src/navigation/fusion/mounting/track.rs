//! The specific force beside what the change of the GNSS velocity says it is along the track: a rotation, by
//! gravity and by accelerations.

use super::MountingError;
use super::blocks::{BLOCK_S, Blocks, FEWEST};
use crate::earth::gravity_down;
use crate::fusion::alignment::course::{Moving, courses, steps};
use crate::fusion::alignment::{between, carried};
use crate::fusion::{Recorded, Settings};
use crate::units::DEG;
use glam::{DQuat, DVec3};

/// Times between two velocities whose difference is an acceleration (s).
const APART_S: (f64, f64) = (0.9, 5.0);
/// What the accelerations of a vehicle differ from those of its antenna by (m/s²): sway, vibrations, the arm between.
const SWAY: f64 = 0.5;
/// Slopes of roads (rad): vertical velocities that are worse than this are not believed.
const SLOPE: f64 = 3.0 * DEG;
/// Largest standard deviation of the yaw that the filter can begin with (rad).
const ROUGH: f64 = 20.0 * DEG;

/// A mounting, how well its yaw is known, and why.
#[derive(Debug, Clone, Copy)]
pub(super) struct Rough {
    pub(super) q_s_b: DQuat,
    /// Standard deviation of the yaw (rad).
    pub(super) yaw_sigma: f64,
}

/// A stretch between two velocities.
struct Stretch {
    t_s: f64,
    /// Mean specific force in the axes of the IMU and along the track, in the middle of the stretch (m/s²).
    f_s: DVec3,
    f_track: DVec3,
    weight: f64,
}

/// The attitude of a vehicle without slip and bank: front along the velocity, right level.
pub(super) fn track_attitude(v_n: DVec3, sigma_down: f64) -> DQuat {
    let speed = v_n.truncate().length();
    let slope = (-v_n.z).atan2(speed);
    // what is measured worse than slopes are is drawn to none
    let believed = 1.0 / (1.0 + (sigma_down / speed / SLOPE).powi(2));
    DQuat::from_rotation_z(v_n.y.atan2(v_n.x)) * DQuat::from_rotation_y(slope * believed)
}

/// The rotation from the IMU to the track.
pub(super) fn along(recorded: &Recorded<'_>, settings: &Settings) -> Result<Rough, MountingError> {
    let stretches = stretches(recorded, settings);
    let mut seen = Blocks::default();
    stretches.iter().for_each(|s| seen.add(s.t_s, 0.0, 1.0));
    if seen.count() < FEWEST {
        // the sum of nothing is -0
        let seconds = stretches
            .windows(2)
            .map(|w| (w[1].t_s - w[0].t_s).min(APART_S.1))
            .fold(0.0, |a, b| a + b);
        return Err(MountingError::TooSlow {
            seconds,
            needed: FEWEST as f64 * BLOCK_S,
        });
    }
    let weights: f64 = stretches.iter().map(|s| s.weight).sum();
    let mean = |of: fn(&Stretch) -> DVec3| {
        stretches.iter().map(|s| of(s) * s.weight).sum::<DVec3>() / weights
    };
    let (mean_s, mean_track) = (mean(|s| s.f_s), mean(|s| s.f_track));
    // level first: then what is left is a turn about the mean of the specific force
    let level = DQuat::from_rotation_arc(mean_s.normalize(), mean_track.normalize());
    let up = mean_track.normalize();
    // less their means, so that neither a bias of the accelerometers nor a tilt counts as acceleration
    let pair = |s: &Stretch| (level * (s.f_s - mean_s), s.f_track - mean_track);
    let (mut sine, mut cosine) = (0.0, 0.0);
    for s in &stretches {
        let (u, w) = pair(s);
        // Wahba's problem about one axis: both vectors projected across `up`, sums of their sine and cosine.
        sine += s.weight * up.dot(u.cross(w));
        cosine += s.weight * (u.dot(w) - up.dot(u) * up.dot(w));
    }
    let turn = DQuat::from_axis_angle(up, sine.atan2(cosine));
    let yaw_sigma = turn_sigma(
        &stretches,
        |s| {
            let (u, w) = pair(s);
            (turn * u, w)
        },
        up,
    );
    if yaw_sigma <= ROUGH {
        Ok(Rough {
            q_s_b: (turn * level).normalize(),
            yaw_sigma,
        })
    } else {
        let degrees = |angle: f64| {
            if angle.is_finite() {
                (angle / DEG).min(180.0)
            } else {
                180.0
            }
        };
        Err(MountingError::NotDetermined {
            axis: "yaw",
            sigma_deg: degrees(yaw_sigma),
            limit_deg: ROUGH / DEG,
        })
    }
}

/// Standard deviation of the turn about `up` (rad): of the sum of the torques of what it leaves, over that of the
/// products that hold it.
fn turn_sigma(
    stretches: &[Stretch],
    turned: impl Fn(&Stretch) -> (DVec3, DVec3),
    up: DVec3,
) -> f64 {
    let mut torques = Blocks::default();
    let mut stiffness = 0.0;
    for s in stretches {
        let (u, w) = turned(s);
        let held = u.dot(w) - up.dot(u) * up.dot(w);
        torques.add(s.t_s, up.dot(u.cross(w)), s.weight);
        stiffness += s.weight * held;
    }
    let weights: f64 = stretches.iter().map(|s| s.weight).sum();
    // A sandwich: the deviation of the sum of the torques (σ of the weighted mean times the weights) over the
    // slope of that sum with the turn.
    torques.sigma() * weights / stiffness.max(0.0)
}

/// The stretches between fixes that have a course.
fn stretches(recorded: &Recorded<'_>, settings: &Settings) -> Vec<Stretch> {
    let courses: Vec<Moving> = courses(recorded.gnss, recorded.imu)
        .into_iter()
        .filter(|m| m.speed() >= m.needed())
        .collect();
    let steps = steps(&courses, APART_S.0);
    steps
        .into_iter()
        .filter_map(|[from, to]| stretch(recorded, settings, from, to))
        .collect()
}

fn stretch(
    recorded: &Recorded<'_>,
    settings: &Settings,
    (from, from_s): (&Moving, f64),
    (to, to_s): (&Moving, f64),
) -> Option<Stretch> {
    let seconds = to_s - from_s;
    let samples = between(recorded.imu, from_s, to_s);
    if !(APART_S.0..=APART_S.1).contains(&seconds) || samples.is_empty() {
        return None;
    }
    let (q, dv) = carried(samples);
    let covered: f64 = samples.iter().map(|s| s.dt_s).sum();
    // The sum is in the axes at the beginning; half of the rotation brings it to those of the middle, where
    // the mean velocity is taken.
    let to_middle = DQuat::from_scaled_axis(q.to_scaled_axis() * -0.5);
    let g = gravity_down(settings.gravity, from.fix.lat.sin(), from.fix.h);
    // f = v̇ − g; Coriolis at driving speeds is 4e-3 m/s², far below the sway.
    let f_n = (to.v_n - from.v_n) / seconds - DVec3::Z * g;
    let sigma_down = from.sigma_n.z.hypot(to.sigma_n.z) / 2.0;
    let to_track = track_attitude((from.v_n + to.v_n) / 2.0, sigma_down).inverse();
    let sigma = from.sigma().hypot(to.sigma()) / seconds;
    Some(Stretch {
        t_s: (from_s + to_s) / 2.0,
        f_s: to_middle * dv / covered,
        f_track: to_track * f_n,
        weight: 1.0 / (sigma * sigma + SWAY * SWAY),
    })
}
