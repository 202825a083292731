//! What is doubtful about a trajectory file that can be used all the same.

use super::samples::{Attitude, MOVING, Rows};
use super::velocities::Velocities;
use nav_sim_navigation::earth::geodetic_to_ecef;
use nav_sim_navigation::frames::{NavState, RollPitchYaw, wrap_angle};
use nav_sim_navigation::trajectory::Trajectory;
use nav_sim_navigation::trajectory::plausibility::Limits;
use nav_sim_signal::units::DEG;
use std::f64::consts::{FRAC_PI_2, PI};

/// Longest step between rows that is not doubted (s).
pub(super) const LONG_STEP_S: f64 = 1.0 + 1e-6;
/// Heights that are not doubted (m).
const PLAUSIBLE_HEIGHT: std::ops::RangeInclusive<f64> = -500.0..=100_000.0;
/// Length of the mean direction above which a course hardly changes: within ±45° it is 0.9.
const STRAIGHT: f64 = 0.9;
/// The same above which a course turns too little to tell whether a heading turns with it: within ±60° it is 0.8.
const TURNING: f64 = 0.7;
/// Share of the scatter of the course that a heading which has nothing to do with it leaves at least.
const UNRELATED: f64 = 0.7;
/// Horizontal speed (m/s) from which on what drives or flies forward looks ahead; slower vehicles turn on the spot, and hover.
const FAST: f64 = 3.0;
/// Instants at which path and attitude are compared: more tell no more.
const LOOKS: usize = 2000;

/// Long steps, where the curve between rows is a guess, and gaps.
pub(super) fn steps(rows: &mut Rows) {
    let time = |i: usize| rows.samples[i].t_s;
    let mut steps: Vec<(f64, usize)> = (1..rows.samples.len()).map(|i| (time(i) - time(i - 1), i)).collect();
    steps.sort_by(|a, b| a.0.total_cmp(&b.0));
    let Some(&(median, _)) = steps.get(steps.len() / 2) else { return };
    let gaps = steps.iter().filter(|(s, _)| *s > LONG_STEP_S.max(1.5 * median)).count();
    let last = steps.last().filter(|_| gaps > 0).map(|&(step, i)| {
        let more = if gaps > 1 { format!(" ({gaps} such gaps)") } else { String::new() };
        let message = format!("gap of {step:.3} s before {} s{more}: the path in it is a guess", time(i));
        (rows.lines[i], message)
    });
    if median > LONG_STEP_S {
        let milliseconds = if is_slow(rows) { "; or is the time in milliseconds (t_ms)?" } else { "" };
        let text = format!(
            "rows are {median} s apart: less than one a second, the path between is a guess{milliseconds}"
        );
        rows.doubt(None, text);
    }
    if let Some((line, message)) = last {
        rows.doubt(Some(line), message);
    }
}

/// Whether the rows are of a motion that would be a vehicle's if the time were a thousandth of what it is.
fn is_slow(rows: &Rows) -> bool {
    let place = |i: usize| geodetic_to_ecef(rows.samples[i].lat, rows.samples[i].lon, rows.samples[i].h);
    let last = rows.samples.len() - 1;
    let path_m: f64 = (0..last).map(|i| place(i).distance(place(i + 1))).sum();
    let speed = path_m / (rows.samples[last].t_s - rows.samples[0].t_s);
    // metres, not the scatter of a receiver at rest
    path_m > 100.0 && 1e3 * speed <= Limits::default().speed
}

/// Positions too fast for a vehicle, and not so if the time were in minutes.
fn minutes(rows: &mut Rows, trajectory: &Trajectory) {
    let mut speeds: Vec<f64> = rows.samples.iter().map(|s| trajectory.state(s.t_s).v_n.length()).collect();
    speeds.sort_by(f64::total_cmp);
    let (median, limit) = (speeds[speeds.len() / 2], Limits::default().speed);
    if median > limit && median <= 60.0 * limit {
        let text = format!(
            "the positions move at {median:.0} m/s (median): is the time in minutes? It is expected in seconds"
        );
        rows.doubt(None, text);
    }
}

/// Heights where no vehicle of these goes: a wrong unit, a wrong sign, a depth.
pub(super) fn heights(rows: &mut Rows) {
    if let Some(i) = rows.samples.iter().position(|s| !PLAUSIBLE_HEIGHT.contains(&s.h)) {
        let (line, h) = (Some(rows.lines[i]), rows.samples[i].h);
        rows.doubt(line, format!("height {h} m: in metres above the ellipsoid, up?"));
    }
}

/// What the path says of the other columns.
pub(super) fn of_trajectory(rows: &mut Rows, trajectory: &Trajectory) {
    let radian = |limit: f64| move |angle: f64| angle.abs() <= limit * DEG + 1e-8;
    if rows.attitude == Attitude::Given {
        let moving = Moving::of(rows, trajectory, MOVING);
        let rpy: Vec<RollPitchYaw> = rows.samples.iter().map(|s| RollPitchYaw::from_quat(s.q_b_n)).collect();
        let zero = rpy.iter().all(|a| [a.roll, a.pitch, a.yaw].into_iter().all(radian(0.0)));
        let small =
            |a: &RollPitchYaw| radian(PI)(a.roll) && radian(0.5 * PI)(a.pitch) && radian(2.0 * PI)(a.yaw);
        let radians = if !zero && rpy.iter().all(small) { moving.radians() } else { None };
        let unrelated = || Moving::of(rows, trajectory, FAST).unrelated();
        let message = radians.or_else(|| moving.heading()).or_else(unrelated);
        message.into_iter().for_each(|text| rows.doubt(None, text));
        moving.kilometres().into_iter().for_each(|text| rows.doubt(None, text));
    }
    if rows.geodetic && rows.samples.iter().all(|s| radian(0.5 * PI)(s.lat) && radian(2.0 * PI)(s.lon)) {
        let list = "lat_deg and lon_deg never exceed π";
        rows.doubt(None, format!("{list}: radians? Then name the columns lat_rad, lon_rad"));
    }
    let contradictions = rows.doubts.len();
    Velocities::doubt(rows, trajectory);
    // velocities that agree with the positions confirm the time
    if rows.doubts.len() == contradictions && rows.velocities.given.is_empty() {
        minutes(rows, trajectory);
    }
}

/// Course, climb angle, heading and pitch (rad) wherever the vehicle moves.
struct Moving(Vec<[f64; 4]>);

/// The direction (rad) in the mean, and its length: 1 where all are alike, 0 where they are spread all round.
fn mean_direction(angles: impl Iterator<Item = f64>) -> (f64, f64) {
    let (sin, cos, count) = angles.fold((0.0, 0.0, 0.0), |(sin, cos, count), angle| {
        (sin + angle.sin(), cos + angle.cos(), count + 1.0)
    });
    (sin.atan2(cos), sin.hypot(cos) / count)
}

impl Moving {
    /// Where it moves horizontally with more than this speed (m/s).
    fn of(rows: &Rows, trajectory: &Trajectory, least: f64) -> Self {
        let look = |i: usize| -> Option<[f64; 4]> {
            let NavState { v_n, q_b_n, .. } = trajectory.state(rows.samples[i].t_s);
            let (speed, attitude) = (v_n.x.hypot(v_n.y), RollPitchYaw::from_quat(q_b_n));
            let angles = [v_n.y.atan2(v_n.x), (-v_n.z).atan2(speed), attitude.yaw, attitude.pitch];
            (speed > least).then_some(angles)
        };
        let n = rows.samples.len();
        Self((0..n).step_by(n.div_ceil(LOOKS)).filter_map(look).collect())
    }

    /// Mean distance between the course and what a heading would be if the file meant another (rad).
    fn off(&self, meant: impl Fn(f64) -> f64) -> f64 {
        let off = |[course, _, yaw, _]: &[f64; 4]| wrap_angle(course - meant(*yaw)).abs();
        self.0.iter().map(off).sum::<f64>() / self.0.len() as f64
    }

    /// Angles as small as radians are, unless the path agrees with degrees.
    fn radians(&self) -> Option<String> {
        let says = match self.0.len() {
            0 => "",
            _ if 2.0 * self.off(|yaw| yaw / DEG) < self.off(|yaw| yaw) => {
                ", and the path agrees with radians"
            }
            _ => return None,
        };
        let list = "roll_deg, pitch_deg and yaw_deg never exceed π";
        Some(format!("{list}{says}: radians? Then name the columns roll_rad, pitch_rad, yaw_rad"))
    }

    /// A heading far from the course that another convention brings near it: four times as near, where it is
    /// more than 20° off. A vehicle that drifts, or a drone, agrees with none.
    fn heading(&self) -> Option<String> {
        type Convention = (&'static str, fn(f64) -> f64);
        const CONVENTIONS: [Convention; 5] = [
            ("with the opposite sign (anticlockwise from north)", |yaw| -yaw),
            ("anticlockwise from east, or with latitude and longitude swapped", |yaw| FRAC_PI_2 - yaw),
            ("clockwise from east", |yaw| FRAC_PI_2 + yaw),
            ("clockwise from west", |yaw| yaw - FRAC_PI_2),
            ("the other way round, driving backwards", |yaw| yaw + PI),
        ];
        if self.0.is_empty() {
            return None;
        }
        let as_given = self.off(|yaw| yaw);
        let others = CONVENTIONS.iter().map(|(words, meant)| (self.off(meant), words));
        let (best, words) = others.min_by(|a, b| a.0.total_cmp(&b.0))?;
        let convention = (as_given > 20.0 * DEG && best < 0.25 * as_given).then(|| {
            format!(
                "yaw is {:.0}° from the course in the mean, and {:.1}° when it is read {words}: yaw is expected clockwise \
                 from north",
                as_given / DEG,
                best / DEG
            )
        });
        convention.or_else(|| self.turned())
    }

    /// A heading that is off by the same angle whatever the course: wind and drift would change it from leg to leg.
    fn turned(&self) -> Option<String> {
        let (_, straight) = mean_direction(self.0.iter().map(|[course, ..]| *course));
        let (offset, _) = mean_direction(self.0.iter().map(|[course, _, yaw, _]| yaw - course));
        let left = self.off(|yaw| yaw - offset);
        (straight < STRAIGHT && offset.abs() > 3.0 * DEG && left < 0.25 * offset.abs()).then(|| {
            format!(
                "yaw is {:.1}° {} of the course wherever the vehicle goes (within {:.1}° in the mean): a magnetic heading, or an \
                 IMU that is mounted turned?",
                offset.abs() / DEG,
                if offset > 0.0 { "clockwise" } else { "anticlockwise" },
                left / DEG
            )
        })
    }

    /// A heading that does not turn with the course: of a sideslip, a crab angle or a mounting it keeps most of it.
    fn unrelated(&self) -> Option<String> {
        let length = |angle: fn(&[f64; 4]) -> f64| mean_direction(self.0.iter().map(angle)).1;
        let (course, between) = (length(|[course, ..]| *course), length(|[course, _, yaw, _]| yaw - course));
        // too few looks have a mean direction by chance
        let is_unrelated =
            self.0.len() >= 20 && course < TURNING && 1.0 - between > UNRELATED * (1.0 - course);
        is_unrelated.then(|| {
            let how = if length(|[_, _, yaw, _]| *yaw) > 0.99 { "yaw stays the same while the course turns" } else { "yaw does not turn with the course" };
            format!(
                "{how}: they are {:.0}° apart in the mean. A helicopter or a drone may fly so; of other vehicles, is it the heading?",
                self.off(|yaw| yaw) / DEG
            )
        })
    }

    /// Heights that climb a thousandth of what the pitch says, and yet with it.
    fn kilometres(&self) -> Option<String> {
        let n = self.0.len() as f64;
        let mean = |i: usize| self.0.iter().map(|a| a[i]).sum::<f64>() / n;
        let (climb, pitch) = (mean(1), mean(3));
        let moment = |f: &dyn Fn(&[f64; 4]) -> f64| self.0.iter().map(f).sum::<f64>() / n;
        let of_pitch = moment(&|a| (a[3] - pitch).powi(2));
        let of_climb = moment(&|a| (a[1] - climb).powi(2));
        let both = moment(&|a| (a[1] - climb) * (a[3] - pitch));
        let slope = both / of_pitch;
        let alike = of_pitch.sqrt() > 0.5 * DEG && both > 0.7 * (of_pitch * of_climb).sqrt();
        (alike && (5e-4..2e-3).contains(&slope)).then(|| {
            "the heights climb a thousandth of what the pitch says: are they in kilometres? h_m is in metres".to_owned()
        })
    }
}
