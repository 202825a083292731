//! Coarse alignment: where a recording that says nothing of its start begins to be navigated.
//!
//! Heading is the course of the first fix that moves fast enough, or its opposite: the filter is run from
//! both, and the innovations of the fixes that follow tell whether the vehicle goes forwards or backwards.
//! Roll and pitch come from levelling ([Groves](crate::bibliography::Groves13), sec. 5.6.1) in a static
//! window before it, carried on with the gyroscopes, or from the mean specific force while it moves and the
//! change of the GNSS velocity, whichever is known better. A start that the fixes of the following minute
//! contradict is given up for the next, and a heading that they move is not believed as well as it says.

pub(super) mod course;
mod levelling;
mod trial;

use super::assessment::Finding;
use super::{Found, Heading, Recorded, Settings, Start};
use crate::earth::radii;
use crate::ekf::{Belief, InitialSettings};
use crate::frames::{NavState, RollPitchYaw, wrap_angle};
use crate::gnss::GnssFix;
use crate::imu::ImuIncrement;
use crate::metrics::VerdictKind;
use crate::units::DEG;
use course::{Moving, SLOW, courses, first_fast, nearest_to_fast};
use glam::{DQuat, DVec3};
pub use levelling::moves;
use levelling::{Level, Scene};
use std::f64::consts::PI;

/// How much later other starts are tried (s), where none at the first moving fix agrees with what follows.
const LATER_S: [f64; 5] = [15.0, 30.0, 60.0, 120.0, 240.0];
/// Tilt beyond which the axes of an IMU are hardly those of a vehicle (rad).
const UPRIGHT: f64 = 45.0 * DEG;

/// Standard deviations of the biases, which spoil a levelling.
#[derive(Debug, Clone, Copy, PartialEq)]
struct BiasSigma {
    /// Accelerometer (m/s²).
    accel: f64,
    /// Gyroscope (rad/s).
    gyro: f64,
}

/// Why a recording cannot be aligned.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum AlignmentError {
    /// It never moves fast enough.
    #[error(
        "no course: no fix moves at {:.1} m/s and ten standard deviations{}",
        SLOW.0,
        .nearest.map_or_else(String::new, |(t, v, s)| format!(" (nearest: {v:.2} ± {s:.2} m/s at {t:.2} s)"))
    )]
    NoCourse {
        /// The fix that comes nearest to it: when (s), its speed and the standard deviation of that (m/s).
        nearest: Option<(f64, f64, f64)>,
    },
    /// A heading was given, and nothing to level with.
    #[error("no fix with IMU samples around it to level with")]
    NoLevel,
    /// No specific force to level with.
    #[error("no IMU samples after the first moving fix at {t_s:.2} s to level with")]
    NoSamples {
        /// The fix (s).
        t_s: f64,
    },
}

/// A start found in the recording.
#[derive(Debug, Clone, PartialEq)]
pub struct Alignment {
    /// Where the filter starts.
    pub start: Start,
    /// What speaks against it.
    pub doubts: Vec<(VerdictKind, Finding)>,
}

/// The start of a recording. Fixes that are withheld are not looked at.
///
/// # Errors
/// When it never moves, or there is nothing to level with.
pub fn coarse(
    recorded: &Recorded<'_>,
    settings: &Settings,
    belief: &Belief,
) -> Result<Alignment, AlignmentError> {
    let gnss = kept(recorded, settings);
    let recorded = Recorded {
        gnss: &gnss,
        ..*recorded
    };
    let courses = courses(&gnss, recorded.imu);
    let Some(first) = first_fast(&courses, f64::NEG_INFINITY) else {
        return Err(AlignmentError::NoCourse {
            nearest: nearest_to_fast(&courses),
        });
    };
    let first_s = courses[first].fix.t_s;
    let later = LATER_S
        .iter()
        .filter_map(|s| first_fast(&courses, first_s + s));
    let finished = |mut candidate: Candidate| {
        trial::widen(&recorded, belief, settings, &mut candidate.start);
        candidate.alignment()
    };
    let mut best: Option<Candidate> = None;
    let mut tried_s = f64::NEG_INFINITY;
    for at in std::iter::once(first).chain(later) {
        if courses[at].fix.t_s <= tried_s {
            continue;
        }
        tried_s = courses[at].fix.t_s;
        for candidate in candidates(&recorded, settings, belief, &courses, at) {
            // on a straight road anything agrees: a later start must also tell forwards from backwards
            if candidate.agrees() && (at == first || candidate.trial.decided) {
                return Ok(finished(candidate));
            }
            best.get_or_insert(candidate);
        }
    }
    best.map(finished)
        .ok_or(AlignmentError::NoSamples { t_s: first_s })
}

/// The fixes that are not withheld.
fn kept(recorded: &Recorded<'_>, settings: &Settings) -> Vec<GnssFix> {
    let withheld = |f: &&GnssFix| settings.outages.iter().any(|o| o.withholds(f.t_s));
    recorded
        .gnss
        .iter()
        .filter(|f| !withheld(f))
        .copied()
        .collect()
}

/// The start at the first fix where the IMU can be levelled, its heading given: it need not move.
///
/// # Errors
/// When there is nothing to level with.
pub fn towards(
    recorded: &Recorded<'_>,
    settings: &Settings,
    belief: &Belief,
    heading: Heading,
) -> Result<Alignment, AlignmentError> {
    let gnss = kept(recorded, settings);
    let recorded = Recorded {
        gnss: &gnss,
        ..*recorded
    };
    let courses = courses(&gnss, recorded.imu);
    let sigma = heading.sigma.hypot(settings.mounting_sigma_b.z);
    let start_at = |at: usize| {
        let scene = Scene::new(&recorded, settings, belief, &courses[at].fix);
        let rest = scene.at_rest(&courses[..at], &courses[at]);
        let level = rest.or_else(|| scene.in_motion(&courses[at..], heading.yaw, sigma))?;
        Some(start(
            &courses[at],
            &level,
            Along::Given,
            (heading.yaw, sigma),
            settings,
        ))
    };
    let mut start = (0..courses.len())
        .find_map(start_at)
        .ok_or(AlignmentError::NoLevel)?;
    let trial = trial::alone(&recorded, belief, settings, &start);
    trial::widen(&recorded, belief, settings, &mut start);
    Ok(Candidate { start, trial }.alignment())
}

/// Which way the vehicle goes along its course.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Along {
    Forwards,
    Backwards,
    /// Not asked: the heading is given.
    Given,
}

/// A start that was tried on the fixes after it.
struct Candidate {
    start: Start,
    trial: trial::Trial,
}

impl Candidate {
    fn agrees(&self) -> bool {
        self.trial.agreements.iter().all(trial::Agreement::holds)
    }

    fn alignment(self) -> Alignment {
        let mut doubts = Vec::new();
        if !self.agrees() {
            let nis_per_component = self.trial.agreements[0].nis;
            doubts.push((
                VerdictKind::Overconfident,
                Finding::Start { nis_per_component },
            ));
        }
        if !self.trial.decided {
            doubts.push((VerdictKind::Doubtful, Finding::Direction));
        }
        // a vehicle is level, more or less, at its start
        let RollPitchYaw { roll, pitch, .. } = RollPitchYaw::from_quat(self.start.state.q_b_n);
        if (roll.cos() * pitch.cos()).acos() > UPRIGHT {
            let (roll_deg, pitch_deg) = (roll / DEG, pitch / DEG);
            doubts.push((
                VerdictKind::Doubtful,
                Finding::NotLevel {
                    roll_deg,
                    pitch_deg,
                },
            ));
        }
        Alignment {
            start: self.start,
            doubts,
        }
    }
}

/// The starts at a moving fix, the one whose levelling is known best first, in the direction that the fixes
/// speak for.
fn candidates(
    recorded: &Recorded<'_>,
    settings: &Settings,
    belief: &Belief,
    courses: &[Moving],
    at: usize,
) -> Vec<Candidate> {
    let moving = &courses[at];
    let scene = Scene::new(recorded, settings, belief, &moving.fix);
    // the course is the heading of the vehicle; how the IMU sits in it is not better known than the mounting
    let heading_sigma = moving
        .heading_sigma(recorded.imu)
        .hypot(settings.mounting_sigma_b.z);
    let in_motion = |heading| scene.in_motion(&courses[at..], heading, heading_sigma);
    let forwards = moving.course();
    let backwards = wrap_angle(forwards + PI);
    let rest = scene
        .at_rest(&courses[..at], moving)
        .map(|level| [level; 2]);
    let motion = in_motion(forwards)
        .zip(in_motion(backwards))
        .map(|(f, b)| [f, b]);
    let mut levels: Vec<[Level; 2]> = [rest, motion].into_iter().flatten().collect();
    levels.sort_by(|a, b| a[0].sigma.total_cmp(&b[0].sigma));
    let tried = |[f, b]: [Level; 2]| {
        let starts = [
            (f, Along::Forwards, forwards),
            (b, Along::Backwards, backwards),
        ]
        .map(|(level, along, yaw)| start(moving, &level, along, (yaw, heading_sigma), settings));
        let trial = trial::opposite(recorded, belief, settings, starts.each_ref());
        let [f, b] = starts;
        Candidate {
            start: if trial.better == 0 { f } else { b },
            trial,
        }
    };
    levels.into_iter().map(tried).collect()
}

fn start(
    moving: &Moving,
    level: &Level,
    along: Along,
    (yaw, heading_sigma): (f64, f64),
    settings: &Settings,
) -> Start {
    let fix = moving.fix;
    let q_b_n = RollPitchYaw {
        roll: level.roll,
        pitch: level.pitch,
        yaw,
    }
    .to_quat();
    let arm_n = q_b_n * settings.lever_arm_b;
    let r = radii(fix.lat.sin());
    let state = NavState {
        lat: fix.lat - arm_n.x / (r.meridian + fix.h),
        lon: fix.lon - arm_n.y / ((r.transverse + fix.h) * fix.lat.cos()),
        h: fix.h + arm_n.z,
        v_n: moving.v_n,
        q_b_n,
    };
    let degrees = |angle: f64| (angle / DEG).min(30.0);
    let (tilt, heading) = (degrees(level.sigma), degrees(heading_sigma));
    let sigma = InitialSettings {
        pos_sigma_m: fix.pos_sigma_n.to_array(),
        vel_sigma_m_s: moving.sigma_n.to_array(),
        att_sigma_deg: [tilt, tilt, heading],
        ..InitialSettings::default()
    };
    let found = Found {
        level: level.from,
        course_sigma_deg: heading,
        is_given: along == Along::Given,
        is_reversing: along == Along::Backwards,
        moved_deg: None,
    };
    Start {
        t_s: fix.t_s,
        state,
        sigma,
        found: Some(found),
    }
}

/// Samples whose interval ends in (from, to].
pub(in crate::fusion) fn between(imu: &[ImuIncrement], from: f64, to: f64) -> &[ImuIncrement] {
    let first = imu.partition_point(|s| s.t_s <= from + 1e-9);
    let end = imu.partition_point(|s| s.t_s <= to + 1e-9);
    &imu[first..end.max(first)]
}

/// How far the IMU turns through the samples, from its axes then to those at the start, and the velocity that the
/// specific force makes, in the axes at the start (m/s).
pub(in crate::fusion) fn carried(samples: &[ImuIncrement]) -> (DQuat, DVec3) {
    let (mut q, mut dv) = (DQuat::IDENTITY, DVec3::ZERO);
    for s in samples {
        let half = DQuat::from_scaled_axis(s.dtheta * 0.5);
        dv += q * half * s.dv;
        q = (q * half * half).normalize();
    }
    (q, dv)
}
