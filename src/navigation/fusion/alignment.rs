//! Coarse alignment: where a recording that says nothing of its start begins to be navigated.
//!
//! Heading is the course of the first fix that moves fast enough, or its opposite: the filter is run from
//! both, and the innovations of the fixes that follow tell whether the vehicle goes forwards or backwards.
//! Roll and pitch come from levelling ([Groves](crate::bibliography::Groves13), sec. 5.6.1) in a static
//! window before it, carried on with the gyroscopes, or from the mean specific force while it moves and the
//! change of the GNSS velocity, whichever is known better. A start that the fixes of the following minute
//! contradict is given up for the next, and a heading that they move is not believed as well as it says.

use super::outcome::{Finding, nis_bound, not_withheld, total_nis};
use super::run::rates;
use super::vehicle::{force, rate};
use super::{
    AlignmentSummary, DriveData, FusionSettings, Heading, Levelling, Solution, Start, fuse,
};
use crate::earth::{gravity_down, moved, ned_difference};
use crate::ekf::{FilterModel, InitialSettings};
use crate::frames::{NavState, RollPitchYaw, wrap_angle};
use crate::gnss::GnssFix;
use crate::imu::{ImuIncrement, Sensor};
use crate::linalg::mean;
use crate::metrics::VerdictKind;
use crate::units::{DEG, Refused};
use glam::{DQuat, DVec3};
use std::f64::consts::{PI, SQRT_2};

/// Delays of further start times to try (s), where none at the first moving fix agrees with the
/// fixes after it.
const LATER_S: [f64; 5] = [15.0, 30.0, 60.0, 120.0, 240.0];
/// Tilt beyond which the axes of an IMU are hardly those of a vehicle (rad).
const UPRIGHT: f64 = 45.0 * DEG;

/// A start found in the recording.
#[derive(Debug, Clone)]
pub struct Alignment {
    /// Initial state and its uncertainty.
    pub start: Start,
    /// Doubts about it.
    pub doubts: Vec<(VerdictKind, Finding)>,
}

/// The start of a recording. Fixes that are withheld are not looked at.
///
/// # Errors
/// When it never moves, or there is nothing to level with.
pub fn coarse(
    recorded: &DriveData<'_>,
    settings: &FusionSettings,
    filter_model: &FilterModel,
) -> Result<Alignment, Refused> {
    let gnss = settings.kept(recorded.gnss);
    let courses = courses(&gnss, recorded.imu);
    let Some(first) = first_fast(&courses, f64::NEG_INFINITY) else {
        let nearest = nearest_to_fast(&courses).map_or_else(String::new, |(t, v, s)| {
            format!(" (nearest: {v:.2} ± {s:.2} m/s at {t:.2} s)")
        });
        return Err(Refused(format!(
            "no course: no fix moves at {:.1} m/s and ten standard deviations{nearest}",
            SLOW.0
        )));
    };
    let scene = StartSearch::new(&recorded.with_gnss(&gnss), settings, filter_model);
    let first_s = courses[first].fix.t_s;
    let later = LATER_S
        .iter()
        .filter_map(|s| first_fast(&courses, first_s + s));
    // what few fixes at the end agree with says nothing of the many before
    let imu_end_s = recorded.imu.last().map_or(first_s, |sample| sample.t_s);
    let fixes = |from_s: f64, to_s: f64| {
        let times = gnss.iter().map(|fix| fix.t_s);
        times.filter(|t_s| (from_s..to_s).contains(t_s)).count()
    };
    let leaves_most = |t_s: f64| fixes(first_s, t_s) <= fixes(t_s, imu_end_s);
    let mut best: Option<StartCandidate> = None;
    let mut tried_s = f64::NEG_INFINITY;
    for at in std::iter::once(first).chain(later) {
        if courses[at].fix.t_s <= tried_s || !leaves_most(courses[at].fix.t_s) {
            continue;
        }
        tried_s = courses[at].fix.t_s;
        for candidate in scene.at(&courses[at].fix).candidates(&courses, at) {
            // on a straight road anything agrees: a later start must also tell forwards from backwards
            if candidate.agrees() && (at == first || candidate.decided) {
                return Ok(scene.finished(candidate));
            }
            best.get_or_insert(candidate);
        }
    }
    best.map(|best| scene.finished(best)).ok_or_else(|| {
        Refused(format!(
            "no IMU samples for levelling after the first moving fix at {first_s:.2} s"
        ))
    })
}

/// The start at the first fix where the IMU can be levelled, its heading given: it need not move.
///
/// # Errors
/// When there is nothing to level with.
pub fn towards(
    recorded: &DriveData<'_>,
    settings: &FusionSettings,
    filter_model: &FilterModel,
    heading: Heading,
) -> Result<Alignment, Refused> {
    let gnss = settings.kept(recorded.gnss);
    let courses = courses(&gnss, recorded.imu);
    let scene = StartSearch::new(&recorded.with_gnss(&gnss), settings, filter_model);
    let sigma = heading.sigma.hypot(settings.mounting_sigma_b.z);
    let start_at = |at: usize| {
        let scene = scene.at(&courses[at].fix);
        let rest = scene.at_rest(&courses[..at], &courses[at]);
        let level = rest.or_else(|| scene.in_motion(&courses[at..], heading.yaw, sigma))?;
        Some(scene.start(&courses[at], &level, (heading.yaw, sigma), [true, false]))
    };
    let start = (0..courses.len())
        .find_map(start_at)
        .ok_or_else(|| Refused("no fix with IMU samples around it for levelling".to_owned()))?;
    let agreement = scene.agreement(&start, TRIAL_S);
    Ok(scene.finished(StartCandidate {
        start,
        decided: true,
        agreements: [agreement; 2],
    }))
}

/// A start that was tried on the fixes after it.
struct StartCandidate {
    start: Start,
    /// True if the opposite heading is refuted.
    decided: bool,
    /// Agreement over the first minute, and over all fixes tried.
    agreements: [Agreement; 2],
}

impl StartCandidate {
    fn agrees(&self) -> bool {
        self.agreements.iter().all(Agreement::holds)
    }
}

/// A recording, and the filter that is tried on it.
#[derive(Clone, Copy)]
struct StartSearch<'a> {
    recorded: DriveData<'a>,
    settings: &'a FusionSettings,
    filter_model: &'a FilterModel,
    /// Standard deviations of the biases, which spoil a levelling: accelerometer (m/s²), gyroscope (rad/s).
    bias: [f64; 2],
    /// Gravity at the fix that is examined (m/s²).
    g: f64,
}

impl<'a> StartSearch<'a> {
    fn new(
        recorded: &DriveData<'a>,
        settings: &'a FusionSettings,
        filter_model: &'a FilterModel,
    ) -> Self {
        Self {
            recorded: *recorded,
            settings,
            filter_model,
            bias: Sensor::ALL.map(|sensor| filter_model.initial_bias_sigma(sensor)),
            g: f64::NAN,
        }
    }

    /// About a fix.
    fn at(self, fix: &GnssFix) -> Self {
        let g = gravity_down(self.settings.gravity, fix.lat.sin(), fix.h);
        Self { g, ..self }
    }

    /// The starts at a moving fix, the one whose levelling is known best first, in the direction that the fixes
    /// speak for.
    fn candidates(&self, courses: &[MovingFix], at: usize) -> Vec<StartCandidate> {
        let moving = &courses[at];
        // the course is the heading of the vehicle; how the IMU sits in it is not better known than the mounting
        let heading_sigma = moving
            .heading_sigma(self.recorded.imu)
            .hypot(self.settings.mounting_sigma_b.z);
        // forwards and backwards
        let headings = [moving.course(), wrap_angle(moving.course() + PI)];
        let rest = self.at_rest(&courses[..at], moving).map(|level| [level; 2]);
        let [forwards, backwards] =
            headings.map(|yaw| self.in_motion(&courses[at..], yaw, heading_sigma));
        let motion = forwards.zip(backwards).map(|(f, b)| [f, b]);
        let mut levels: Vec<[LevelAngles; 2]> = [rest, motion].into_iter().flatten().collect();
        levels.sort_by(|a, b| a[0].sigma.total_cmp(&b[0].sigma));
        let tried = |levels: [LevelAngles; 2]| {
            self.opposite([0, 1].map(|i| {
                let heading = (headings[i], heading_sigma);
                self.start(moving, &levels[i], heading, [false, i == 1])
            }))
        };
        levels.into_iter().map(tried).collect()
    }

    /// The start at a fix; whether its heading is given, and whether it is opposite to the course.
    fn start(
        &self,
        moving: &MovingFix,
        level: &LevelAngles,
        (yaw, heading_sigma): (f64, f64),
        [is_given, is_reversing]: [bool; 2],
    ) -> Start {
        let fix = moving.fix;
        let q_b_n = RollPitchYaw {
            yaw,
            ..level.angles
        }
        .to_quat();
        let [lat, lon, h] = moved(fix.place(), -(q_b_n * self.settings.lever_arm_b));
        let degrees = |angle: f64| (angle / DEG).min(WIDEST_DEG);
        let (tilt, heading) = (degrees(level.sigma), degrees(heading_sigma));
        Start {
            t_s: fix.t_s,
            state: NavState {
                lat,
                lon,
                h,
                v_n: moving.v_n,
                q_b_n,
            },
            sigma: InitialSettings {
                pos_sigma_m: fix.pos_sigma_n.to_array(),
                vel_sigma_m_s: moving.sigma_n.to_array(),
                att_sigma_deg: [tilt, tilt, heading],
                ..InitialSettings::default()
            },
            found: Some(AlignmentSummary {
                level: level.from,
                course_sigma_deg: heading,
                is_given,
                is_reversing,
                moved_deg: None,
            }),
        }
    }

    /// The alignment by a candidate. Its heading is widened where it is not the course: wind sets an aircraft off, currents a
    /// boat. The smoother, from all fixes of the first minute, says how far.
    fn finished(&self, mut candidate: StartCandidate) -> Alignment {
        let doubts = candidate.doubts();
        let start = &mut candidate.start;
        let settings = FusionSettings {
            smooth: true,
            ..self.settings.trial()
        };
        let solution = self.until(&settings, start, TRIAL_S);
        if let Some([first, ..]) = solution.as_ref().and_then(|s| s.smoothed.as_deref()) {
            let [course, heading] =
                [start.state.q_b_n, first.state.q_b_n].map(|q| RollPitchYaw::from_quat(q).yaw);
            let moved_deg = wrap_angle(heading - course) / DEG;
            let sigma_deg = &mut start.sigma.att_sigma_deg[2];
            if moved_deg.abs() > MOVED * *sigma_deg {
                *sigma_deg = sigma_deg.hypot(moved_deg).min(WIDEST_DEG);
                start
                    .found
                    .iter_mut()
                    .for_each(|found| found.moved_deg = Some(moved_deg));
            }
        }
        Alignment {
            start: candidate.start,
            doubts,
        }
    }

    /// The solution from a start over this many seconds, its rows those of the start and the end.
    fn until(&self, settings: &FusionSettings, start: &Start, seconds: f64) -> Option<Solution> {
        let recorded = self.recorded.until(start.t_s + seconds);
        fuse(&recorded, self.filter_model, start, settings, None).ok()
    }

    fn agreement(&self, start: &Start, seconds: f64) -> Agreement {
        let Some(solution) = self.until(&self.settings.trial(), start, seconds) else {
            return Agreement {
                cost: f64::INFINITY,
                nis: f64::INFINITY,
                components: 0,
            };
        };
        let (nis, components) = total_nis(not_withheld(&solution));
        Agreement {
            // the sum of the logarithms stands for the determinant: the correlations of both starts are alike
            cost: not_withheld(&solution)
                .map(|f| f.nis + 2.0 * f.sigma.iter().map(|s| s.ln()).sum::<f64>())
                .sum(),
            nis: nis / components.max(1) as f64,
            components,
        }
    }

    /// Runs the filter from two opposite starts over the first minute, and longer while that does not tell them apart; the
    /// better one.
    fn opposite(&self, starts: [Start; 2]) -> StartCandidate {
        let begin_s = starts[0].t_s;
        let end_s = self.recorded.gnss.last().map_or(begin_s, |f| f.t_s);
        let mut window_s = TRIAL_S;
        let mut first: Option<[Agreement; 2]> = None;
        loop {
            let both = starts
                .each_ref()
                .map(|start| self.agreement(start, window_s));
            let first = *first.get_or_insert(both);
            // a receiver that is worse than it says exaggerates the difference as much as the NIS of the better
            let least = both[0].nis.min(both[1].nis).max(1.0);
            let gain = (both[0].cost - both[1].cost) / least;
            let decided = gain.abs() >= DECIDED;
            if decided || begin_s + window_s >= end_s {
                // forwards unless that is refuted
                let better = usize::from(decided && gain > 0.0);
                let [forwards, backwards] = starts;
                return StartCandidate {
                    start: if better == 0 { forwards } else { backwards },
                    decided,
                    agreements: [first[better], both[better]],
                };
            }
            window_s *= 2.0;
        }
    }
}

impl StartCandidate {
    fn doubts(&self) -> Vec<(VerdictKind, Finding)> {
        let nis_per_component = self.agreements[0].nis;
        let contradicted = Finding::Start { nis_per_component };
        // a vehicle is level, more or less, at its start
        let RollPitchYaw { roll, pitch, .. } = RollPitchYaw::from_quat(self.start.state.q_b_n);
        let tilted = Finding::NotLevel {
            roll_deg: roll / DEG,
            pitch_deg: pitch / DEG,
        };
        [
            (!self.agrees()).then_some((VerdictKind::Overconfident, contradicted)),
            (!self.decided).then_some((VerdictKind::Doubtful, Finding::Direction)),
            ((roll.cos() * pitch.cos()).acos() > UPRIGHT)
                .then_some((VerdictKind::Doubtful, tilted)),
        ]
        .into_iter()
        .flatten()
        .collect()
    }
}

/// Samples whose interval ends in (from, to].
pub(super) fn between(imu: &[ImuIncrement], from: f64, to: f64) -> &[ImuIncrement] {
    let first = imu.partition_point(|s| s.t_s <= from + 1e-9);
    let end = imu.partition_point(|s| s.t_s <= to + 1e-9);
    &imu[first..end.max(first)]
}

/// Attitude of the IMU at the end of the samples with respect to its axes at the start, and the
/// velocity change by specific force, in the axes at the start (m/s).
pub(super) fn carried(samples: &[ImuIncrement]) -> (DQuat, DVec3) {
    let (mut q, mut dv) = (DQuat::IDENTITY, DVec3::ZERO);
    for s in samples {
        let half = DQuat::from_scaled_axis(s.dtheta * 0.5);
        dv += q * half * s.dv;
        q = (q * half * half).normalize();
    }
    (q, dv)
}

// The course of the vehicle from GNSS: velocities as measured, or from positions a second or more apart.

/// Largest angle between the axis of a vehicle and its course on a straight road (rad): slip,
/// mounting.
const SLIP: f64 = 2.0 * DEG;
/// Distance from the axle that does not steer to the IMU (m): in a turn the course there leaves the axis.
const AXLE_M: f64 = 2.0;
/// Slowest course that is taken as a heading, and how many of its standard deviations: of what goes fast at times, as road
/// vehicles do, and of what never does, as people, carts and small robots.
const FAST: (f64, f64) = (3.0, 5.0);
const SLOW: (f64, f64) = (0.5, 10.0);
/// Lateral sway at a walk (m/s).
const SWAY: f64 = 0.15;
/// Shortest time from one position to another that gives a velocity, and the longest (s).
const BASELINE_S: (f64, f64) = (1.0, 3.0);
/// Largest acceleration allowed between two fixes (m/s²).
const ACCELERATION: f64 = 2.0;

/// Carrier of the IMU, by its motion.
#[derive(Clone, Copy, PartialEq)]
pub(super) enum CarrierSpeed {
    Fast,
    Slow,
}

impl CarrierSpeed {
    /// The speed from which a course is a heading, where velocities are known as well as `sigma` (m/s).
    pub(super) fn min_heading_speed(self, sigma: f64) -> f64 {
        let (least, sigmas) = if self == Self::Fast { FAST } else { SLOW };
        least.max(sigmas * sigma)
    }

    /// Standard deviation of the angle between axis and course at a speed (rad).
    pub(super) fn slip(self, speed: f64) -> f64 {
        if self == Self::Fast {
            SLIP
        } else {
            SLIP.hypot(SWAY / speed)
        }
    }
}

/// A fix with its velocity and the standard deviations of it (m/s).
pub(super) struct MovingFix {
    pub fix: GnssFix,
    pub v_n: DVec3,
    pub sigma_n: DVec3,
    /// Half the time between the two positions it comes from: it is as old as that (s); 0 as measured.
    lag_s: f64,
    pub pace: CarrierSpeed,
}

impl MovingFix {
    pub(super) fn speed(&self) -> f64 {
        self.v_n.truncate().length()
    }

    pub(super) fn sigma(&self) -> f64 {
        self.sigma_n.truncate().max_element()
    }

    /// The speed from which the course of this fix is a heading (m/s).
    pub(super) fn min_heading_speed(&self) -> f64 {
        self.pace.min_heading_speed(self.sigma())
    }

    /// The direction in which it moves (rad from north).
    pub(super) fn course(&self) -> f64 {
        self.v_n.y.atan2(self.v_n.x)
    }

    /// Standard deviation of the vehicle's axis about the course (rad).
    fn heading_sigma(&self, imu: &[ImuIncrement]) -> f64 {
        let t_s = self.fix.t_s;
        let turns = between(imu, t_s - self.lag_s, t_s).iter().map(|s| s.dtheta);
        let turned = turns.sum::<DVec3>().length();
        // the angular rate over a second around the fix
        let (seconds, [_, omega]) = rates(between(imu, t_s - 0.5, t_s + 0.5));
        let rate = if seconds > 0.0 { omega.length() } else { 0.0 };
        // the first fast fix is one whose error makes it fast: the vehicle moves more slowly than it says
        let speed = self.speed() - 1.5 * self.sigma();
        (self.sigma() / speed)
            .hypot(self.pace.slip(speed))
            .hypot(turned)
            .hypot(rate * AXLE_M / speed)
    }
}

/// The velocities within the IMU recording.
pub(super) fn courses(gnss: &[GnssFix], imu: &[ImuIncrement]) -> Vec<MovingFix> {
    let first = imu.first().map_or(f64::INFINITY, |s| s.t_s - s.dt_s);
    let last = imu.last().map_or(f64::NEG_INFINITY, |s| s.t_s);
    let inside = |m: &MovingFix| m.fix.t_s >= first && m.fix.t_s < last;
    let velocity = |(i, fix): (usize, &GnssFix)| match fix.velocity {
        Some(velocity) => Some(MovingFix {
            fix: *fix,
            v_n: velocity.v_n(),
            sigma_n: velocity.sigma_n(),
            lag_s: 0.0,
            pace: CarrierSpeed::Fast,
        }),
        None => {
            let earlier = gnss[..i].partition_point(|f| f.t_s <= fix.t_s - BASELINE_S.0 + 1e-6);
            derived(&gnss[earlier.checked_sub(1)?], fix)
        }
    };
    let mut all: Vec<MovingFix> = gnss
        .iter()
        .enumerate()
        .filter_map(velocity)
        .filter(inside)
        .collect();
    if first_fast(&all, f64::NEG_INFINITY).is_none() {
        all.iter_mut()
            .for_each(|moving| moving.pace = CarrierSpeed::Slow);
    }
    all
}

/// Fixes one after the other that are at least `apart_s` apart, with when their velocities were (s).
pub(super) fn steps(courses: &[MovingFix], apart_s: f64) -> Vec<[(&MovingFix, f64); 2]> {
    let when = |m: &MovingFix| m.fix.t_s - m.lag_s;
    let mut all = Vec::new();
    let mut first = 0;
    while let Some(from) = courses.get(first) {
        let later = courses[first..].partition_point(|m| when(m) < when(from) + apart_s);
        // twice at the same time, by files that a clock sets back
        let next = first + later.max(1);
        let Some(to) = courses.get(next) else { break };
        all.push([(from, when(from)), (to, when(to))]);
        first = next;
    }
    all
}

/// The first fix from `from_s` on whose course is a heading. One fix alone may be an outlier, and among
/// thousands at rest one is five standard deviations off: the next must move as well.
fn first_fast(courses: &[MovingFix], from_s: f64) -> Option<usize> {
    let fast = |i: usize| {
        let supported = courses
            .get(i + 1)
            .is_none_or(|next| next.speed() >= 0.6 * next.min_heading_speed());
        courses[i].fix.t_s >= from_s
            && courses[i].speed() >= courses[i].min_heading_speed()
            && supported
    };
    (0..courses.len()).find(|i| fast(*i))
}

/// The fix that comes nearest to moving fast enough: when (s), its speed and standard deviation (m/s).
fn nearest_to_fast(courses: &[MovingFix]) -> Option<(f64, f64, f64)> {
    let share = |m: &MovingFix| m.speed() / m.min_heading_speed();
    let nearest = courses
        .iter()
        .max_by(|a, b| share(a).total_cmp(&share(b)))?;
    Some((nearest.fix.t_s, nearest.speed(), nearest.sigma()))
}

/// The mean velocity between two fixes; none where they are too far apart in time.
fn derived(before: &GnssFix, fix: &GnssFix) -> Option<MovingFix> {
    let dt = fix.t_s - before.t_s;
    if dt > BASELINE_S.1 {
        return None;
    }
    let v_n = -ned_difference(fix.place(), before.place()) / dt;
    let lag_s = 0.5 * dt;
    let variance = (fix.pos_sigma_n.powf(2.0) + before.pos_sigma_n.powf(2.0)) / (dt * dt);
    let sigma_n = (variance + DVec3::splat((ACCELERATION * lag_s).powi(2))).powf(0.5);
    Some(MovingFix {
        fix: *fix,
        v_n,
        sigma_n,
        lag_s,
        pace: CarrierSpeed::Fast,
    })
}

// Roll and pitch at a fix: from gravity in a static window before it, or from the specific force in motion
// and the change of the GNSS velocity.

/// Lengths of static windows (s). A long one leaves less acceleration that GNSS does not see.
const STILL_S: [f64; 4] = [2.0, 4.0, 8.0, 16.0];
/// Time from the first acceleration to a speed that GNSS shows (s).
const DEPARTURE_S: f64 = 3.0;
/// Longest time over which the gyroscopes propagate a levelling (s).
const MAX_AGE_S: f64 = 60.0;
/// Length of the window in motion (s).
const MOVING_S: f64 = 5.0;
/// Spread of specific force (m/s²) and mean angular rate (rad/s) above which nothing is static.
const STILL: (f64, f64) = (0.5, 0.03);
/// Largest spread of a static window over that of the quietest one: engines idle, roads shake more.
const QUIET: f64 = 3.0;

/// Roll and pitch at the first moving fix.
#[derive(Clone, Copy)]
struct LevelAngles {
    /// Without yaw.
    angles: RollPitchYaw,
    /// Standard deviation of both (rad).
    sigma: f64,
    from: Levelling,
}

/// Statistics of a window in the vehicle's axes.
struct StaticWindow {
    end_s: f64,
    seconds: f64,
    /// Mean specific force (m/s²) and angular rate (rad/s).
    f: DVec3,
    omega: DVec3,
    /// Standard deviation of the specific force of a sample (m/s²) and of its rate (rad/s).
    spread: (f64, f64),
}

fn window(samples: &[ImuIncrement], q_s_b: DQuat) -> StaticWindow {
    let (seconds, [f, omega]) = rates(samples);
    let spread = |of: fn(&ImuIncrement) -> DVec3, about: DVec3| {
        mean(samples.iter().map(|s| (of(s) - about).length_squared())).sqrt()
    };
    let spread = (spread(force, f), spread(rate, omega));
    let end_s = samples.last().map_or(f64::NAN, |s| s.t_s);
    StaticWindow {
        end_s,
        seconds,
        f: q_s_b * f,
        omega: q_s_b * omega,
        spread,
    }
}

/// True where the specific force is spread too much for anything that stands: vibrations at rest are less.
pub fn moves(imu: &[ImuIncrement]) -> bool {
    window(imu, DQuat::IDENTITY).spread.0 >= STILL.0
}

impl StartSearch<'_> {
    /// The tilt's standard deviation with the biases and a levelling of age `age_s` (rad).
    fn tilt_sigma(&self, age_s: f64, own: f64) -> f64 {
        (self.bias[0] / self.g)
            .hypot(self.bias[1] * age_s)
            .hypot(own)
            .hypot(0.3 * DEG)
    }

    /// Levelling in the static window that says most of the attitude at the fix, carried on by the gyroscopes.
    ///
    /// A window is judged by its own standard deviation: what GNSS lets the vehicle accelerate unseen falls with
    /// its length, the drift of the gyroscopes grows with its age.
    fn at_rest(&self, before: &[MovingFix], moving: &MovingFix) -> Option<LevelAngles> {
        let to_s = moving.fix.t_s;
        let ends = (0..)
            .map(|k| to_s - 0.25 * f64::from(k))
            .take_while(|end| to_s - end <= MAX_AGE_S);
        let windows: Vec<StaticWindow> = ends
            .flat_map(|end| STILL_S.map(|length| self.calm(end, length)))
            .flatten()
            .collect();
        let quietest = windows
            .iter()
            .map(|w| w.spread.0)
            .fold(f64::INFINITY, f64::min);
        windows
            .iter()
            .filter(|w| w.spread.0 <= QUIET * quietest)
            .filter_map(|w| self.carried(w, before, moving))
            .min_by(|a, b| a.sigma.total_cmp(&b.sigma))
    }

    /// The window, when the IMU sees nothing happen in it.
    fn calm(&self, end_s: f64, length_s: f64) -> Option<StaticWindow> {
        let samples = between(self.recorded.imu, end_s - length_s, end_s);
        let q_s_b = self.settings.q_s_b;
        let (first, second) = samples.split_at(samples.len() / 2);
        let (whole, first, second) = (
            window(samples, q_s_b),
            window(first, q_s_b),
            window(second, q_s_b),
        );
        let (force, rate) = whole.spread;
        // constant, as gravity and biases are; the spread's share is for vibrations, which average out slowly
        let constant = first.f.distance(second.f) < 0.1 + force / 4.0
            && first.omega.distance(second.omega) < 0.01 + rate / 4.0;
        let gravity = (whole.f.length() - self.g).abs() < 0.5_f64.max(4.0 * self.bias[0]);
        let turning = whole.omega.length() > STILL.1.max(4.0 * self.bias[1]);
        let calm =
            whole.seconds > 0.8 * length_s && force < STILL.0 && constant && gravity && !turning;
        calm.then_some(whole)
    }

    /// The levelling of a window at the time of the fix, unless GNSS contradicts its standing still.
    fn carried(
        &self,
        w: &StaticWindow,
        before: &[MovingFix],
        moving: &MovingFix,
    ) -> Option<LevelAngles> {
        let (from, departed) = (w.end_s - w.seconds, w.end_s + DEPARTURE_S);
        let age_s = moving.fix.t_s - w.end_s;
        let (q, gained) = self.carry(w, moving.fix.t_s);
        let unseen = if moving.fix.velocity.is_some() {
            let seen: Vec<&MovingFix> = before
                .iter()
                .filter(|m| (from..=departed).contains(&m.fix.t_s))
                .collect();
            slow(&seen).then(|| SQRT_2 * seen[0].sigma() / (w.seconds * self.g))?
        } else {
            // positions alone are slow to tell rest from acceleration: what the IMU gained on the way must be
            // the speed that GNSS then shows
            let agrees = (gained.truncate().length() - moving.speed()).abs() < 3.0 * moving.sigma();
            (stays(before, from, departed) && agrees).then(|| moving.sigma() / (age_s * self.g))?
        };
        let own = (w.spread.0 / self.g / 10.0).hypot(unseen);
        Some(LevelAngles {
            angles: RollPitchYaw::from_quat(q),
            sigma: self.tilt_sigma(age_s, own),
            from: Levelling::AtRest(w.end_s),
        })
    }

    /// A levelling at rest carried on with the gyroscopes: the attitude from level axes whose first is the
    /// heading of the body then, and the velocity gained in them.
    fn carry(&self, w: &StaticWindow, to_s: f64) -> (DQuat, DVec3) {
        let mut q = level(w.f, DVec3::Z * -self.g).to_quat();
        let mut gained = DVec3::ZERO;
        for s in between(self.recorded.imu, w.end_s, to_s) {
            gained += q * (self.settings.q_s_b * s.dv) + DVec3::Z * self.g * s.dt_s;
            q = (q * DQuat::from_scaled_axis(self.settings.q_s_b * s.dtheta)).normalize();
        }
        (q, gained)
    }

    /// Levelling while it moves: the mean specific force after the fix is the change of the GNSS velocity
    /// less gravity, in the axes of this heading.
    fn in_motion(
        &self,
        after: &[MovingFix],
        heading: f64,
        heading_sigma: f64,
    ) -> Option<LevelAngles> {
        let from = after.first()?;
        let near = after
            .iter()
            .take_while(|m| m.fix.t_s <= from.fix.t_s + MOVING_S)
            .count();
        // with fixes far apart, the next one
        let to = after.get(near.max(2) - 1)?;
        let (from_s, to_s) = (from.fix.t_s - from.lag_s, to.fix.t_s - to.lag_s);
        let (samples, seconds) = (between(self.recorded.imu, from_s, to_s), to_s - from_s);
        if samples.is_empty() || seconds > MAX_AGE_S / 2.0 {
            return None;
        }
        let dv = self.settings.q_s_b * carried(samples).1;
        let a_n = (to.v_n - from.v_n) / seconds;
        let f_h = DQuat::from_rotation_z(-heading) * (a_n - DVec3::Z * self.g);
        let velocities = from.sigma().hypot(to.sigma()) / (seconds * self.g);
        let own = velocities.hypot(heading_sigma * a_n.truncate().length() / self.g);
        Some(LevelAngles {
            angles: level(dv / seconds, f_h),
            sigma: self.tilt_sigma(0.5 * seconds, own),
            from: Levelling::InMotion(seconds),
        })
    }
}

/// Returns true if velocities are zero to within their standard deviations, each and on average.
fn slow(seen: &[&MovingFix]) -> bool {
    let n = seen.len() as f64;
    let mean = seen
        .iter()
        .map(|m| m.v_n.truncate())
        .sum::<glam::DVec2>()
        .length()
        / n;
    let sigma = (seen.iter().map(|m| m.sigma().powi(2)).sum::<f64>()).sqrt() / n;
    let each = |m: &&MovingFix| m.speed() < 0.3_f64.max(4.0 * m.sigma());
    !seen.is_empty() && seen.iter().all(each) && mean < 0.2_f64.max(4.0 * sigma)
}

/// Returns true if the fixes in a stretch of time stay within four standard deviations of the
/// first.
fn stays(fixes: &[MovingFix], from: f64, to: f64) -> bool {
    let within: Vec<&GnssFix> = fixes
        .iter()
        .map(|m| &m.fix)
        .filter(|f| (from..=to).contains(&f.t_s))
        .collect();
    let Some((first, rest)) = within.split_first() else {
        return false;
    };
    let near = |f: &&GnssFix| {
        let apart = ned_difference(first.place(), f.place()).truncate();
        let [sigma, sigma_of_first] = [f, first].map(|f| f.pos_sigma_n.truncate().length());
        apart.length() < 0.5_f64.max(4.0 / SQRT_2 * sigma.hypot(sigma_of_first))
    };
    rest.len() >= 2 && rest.iter().all(near)
}

/// Roll and pitch that take a specific force in b to the same one in level axes of the right heading:
/// f_h = R_y(pitch) R_x(roll) f_b, upright. Yaw is 0.
fn level(f_b: DVec3, f_h: DVec3) -> RollPitchYaw {
    // After the roll, y is as it is in the level axes: ρ sin(delta − roll) = f_h.y with f_z < 0.
    let (rho, delta) = (f_b.y.hypot(f_b.z), f_b.y.atan2(f_b.z));
    let roll = wrap_angle(delta - PI + (f_h.y / rho).clamp(-1.0, 1.0).asin());
    let v = DQuat::from_rotation_x(roll) * f_b;
    let pitch = (v.z * f_h.x - v.x * f_h.z).atan2(v.x * f_h.x + v.z * f_h.z);
    RollPitchYaw {
        roll,
        pitch,
        yaw: 0.0,
    }
}

// Which of two starts the fixes that follow speak for: the filter is run from both, and its innovations tell.

/// Length of the recording that is tried first (s). Doubled until the two starts are distinguished.
const TRIAL_S: f64 = 60.0;
/// A heading that the smoother moves by more than this many of its standard deviations is not known as well as it says.
const MOVED: f64 = 3.0;
/// Largest standard deviation of a start (degrees).
const WIDEST_DEG: f64 = 30.0;
/// Difference of −2 ln(likelihood) between forwards and backwards from which one is refuted: odds of e^10.
const DECIDED: f64 = 20.0;

/// Agreement of a start with the fixes after it.
#[derive(Clone, Copy)]
struct Agreement {
    /// −2 ln(likelihood) of the innovations, up to a constant.
    cost: f64,
    /// Mean NIS per component, and of how many components.
    nis: f64,
    components: usize,
}

impl Agreement {
    fn holds(&self) -> bool {
        self.nis <= nis_bound(self.components)
    }
}
