//! Difference of the clocks of IMU and GNSS: turns of the course against those of the gyroscopes.
//!
//! The norm of the mean angular rate between two fixes does not depend on how the IMU is mounted, and in a road vehicle it
//! is the rate of the course. The lag at which the two agree best is the difference of the clocks.

use super::alignment::{MovingFix, coarse, courses, steps};
use super::{DriveData, FusionSettings, Solution, antenna_offset, check_clocks, fuse};
use crate::earth::ned_difference;
use crate::ekf::FilterModel;
use crate::frames::wrap_angle;
use crate::gnss::{GnssFix, GnssVelocity};
use crate::imu::ImuIncrement;
use crate::linalg::{by_value, mean};
use glam::DVec3;
use rayon::prelude::*;
use serde::Serialize;

/// Lags that are tried (s), the longer ones where none of the others fits, and the step from one to the next.
const LONGEST_S: [f64; 2] = [60.0, 600.0];
const STEP_S: f64 = 0.1;
/// Shortest lag that is reported: turns between fixes a second apart, of receivers that filter them, lie off by less (s).
const SHORTEST_S: f64 = 0.5;
/// Times from the beginning of a turn to its end (s): of fixes nearer to one another the course is mostly noise.
const APART_S: (f64, f64) = (0.9, 5.0);
/// Most turns that are examined.
const MOST: usize = 2000;
/// Fewest turns of which anything is said.
const FEWEST: usize = 30;
/// Correlation from which the turns are the same ones.
const SAME: f64 = 0.8;
/// Factor by which the clocks as given must leave more of the turns unexplained, and the least
/// share that counts: between fixes the course of a vehicle is not quite its heading.
const UNEXPLAINED: f64 = 2.0;
const LEAST: f64 = 0.005;

/// Clocks that are not the same.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct ClocksApart {
    /// Time that the clock of the fixes is ahead of the IMU's (s).
    pub delay_s: f64,
    /// Its standard deviation (s), where the innovations tell it finer than the turns.
    pub sigma_s: Option<f64>,
    /// Correlation of the turns, as the clocks are and without the delay.
    pub correlation: [f64; 2],
}

/// The lag at which the turns agree; none where they agree as they are, or at no lag. `rest` is what the innovations say is left
/// of the delay where the fixes are earlier by it, and its standard deviation (s).
pub fn clocks_apart(
    recorded: &DriveData<'_>,
    rest: impl FnOnce(&DriveData<'_>) -> Option<[f64; 2]>,
) -> Option<ClocksApart> {
    let within = |longest_s: &f64| agreement(recorded, *longest_s);
    let [lag_s, best, now] = LONGEST_S.iter().find_map(within)?;
    // 1 − r², for r < 0 more than 1: turns that go against each other explain less than nothing.
    let unexplained = |r: f64| 1.0 - r * r.abs();
    let is_other = unexplained(now) > UNEXPLAINED * unexplained(best).max(LEAST);
    if !is_other || lag_s.abs() < SHORTEST_S {
        return None;
    }
    let gnss = earlier(recorded.gnss, -lag_s);
    let rest = rest(&recorded.with_gnss(&gnss));
    let delay_s = rest.map_or(0.0, |[rest_s, _]| rest_s) - lag_s;
    (delay_s.abs() >= SHORTEST_S).then_some(ClocksApart {
        delay_s,
        sigma_s: rest.map(|[_, sigma_s]| sigma_s),
        correlation: [now, best],
    })
}

/// The lag of the gyroscopes at which the turns are the same ones (s), their correlation there and as the clocks are; by
/// positions where velocities tell none.
fn agreement(recorded: &DriveData<'_>, longest_s: f64) -> Option<[f64; 3]> {
    let turned = TurnedAngle::new(recorded.imu);
    let steps = (longest_s / STEP_S) as i32;
    let of_turns = |gnss: &[GnssFix]| {
        let turns = turns(&recorded.with_gnss(gnss));
        let tried = (-steps..=steps).into_par_iter().filter_map(|k| {
            let lag_s = f64::from(k) * STEP_S;
            Some((lag_s, correlation(&turns, &turned, lag_s)?))
        });
        let (lag_s, best) = tried.collect::<Vec<_>>().into_iter().max_by(by_value)?;
        let now = correlation(&turns, &turned, 0.0)?;
        (best >= SAME).then_some([lag_s, best, now])
    };
    of_turns(recorded.gnss).or_else(|| of_turns(&with_velocities(recorded.gnss)))
}

/// A stretch between two fixes and the mean rate of the course in it (rad/s, without its sign).
struct Turn {
    from_s: f64,
    to_s: f64,
    rate: f64,
}

/// The turns between fixes that move fast enough for a course, one after the other.
fn turns(recorded: &DriveData<'_>) -> Vec<Turn> {
    let courses = courses(recorded.gnss, recorded.imu);
    let all: Vec<Turn> = steps(&courses, APART_S.0)
        .into_iter()
        .filter_map(|[from, to]| turn(from, to))
        .collect();
    let every = all.len().div_ceil(MOST).max(1);
    all.into_iter().step_by(every).collect()
}

/// The turn between two fixes; none where one of them hardly moves, or too much time is between them.
fn turn((from, from_s): (&MovingFix, f64), (to, to_s): (&MovingFix, f64)) -> Option<Turn> {
    let is_course = |m: &MovingFix| m.speed() >= m.min_heading_speed();
    let seconds = to_s - from_s;
    let is_one = is_course(from) && is_course(to) && (APART_S.0..=APART_S.1).contains(&seconds);
    // Without its sign: the norm of the angular rate has none.
    let rate = wrap_angle(to.course() - from.course()).abs() / seconds;
    is_one.then_some(Turn { from_s, to_s, rate })
}

/// Pearson's correlation of the turns with those of the gyroscopes `lag_s` later; none where fewer than half of them
/// lie in the recording, or hardly any.
fn correlation(turns: &[Turn], turned: &TurnedAngle, lag_s: f64) -> Option<f64> {
    let rate = |turn: &Turn| {
        // The sum of increments is a rotation only to first order; over seconds of a road turn that is
        // enough.
        let angle = turned.until(turn.to_s + lag_s)? - turned.until(turn.from_s + lag_s)?;
        Some((turn.rate, angle.length() / (turn.to_s - turn.from_s)))
    };
    let pairs: Vec<(f64, f64)> = turns.iter().filter_map(rate).collect();
    // At a long lag only the overlap is left: a correlation of few turns is high by chance.
    if pairs.len() < FEWEST.max(turns.len() / 2) {
        return None;
    }
    let mean_x = mean(pairs.iter().map(|p| p.0));
    let mean_y = mean(pairs.iter().map(|p| p.1));
    let products = |[xx, yy, xy]: [f64; 3], (x, y): &(f64, f64)| {
        let (x, y) = (x - mean_x, y - mean_y);
        [xx + x * x, yy + y * y, xy + x * y]
    };
    let [xx, yy, xy] = pairs.iter().fold([0.0; 3], products);
    Some(xy / (xx * yy).sqrt()).filter(|r| r.is_finite())
}

/// The angle through which the IMU has turned, as the sum of its increments.
struct TurnedAngle {
    times: Vec<f64>,
    angles: Vec<DVec3>,
}

impl TurnedAngle {
    fn new(imu: &[ImuIncrement]) -> Self {
        let mut angle = DVec3::ZERO;
        let add = |sample: &ImuIncrement| {
            angle += sample.dtheta;
            angle
        };
        Self {
            times: imu.iter().map(|s| s.t_s).collect(),
            angles: imu.iter().map(add).collect(),
        }
    }

    /// Up to a time, between samples in proportion; none outside the recording.
    fn until(&self, t_s: f64) -> Option<DVec3> {
        let next = self.times.partition_point(|t| *t < t_s);
        let before = next.checked_sub(1)?;
        let (from, to) = (self.times[before], *self.times.get(next)?);
        Some(self.angles[before].lerp(self.angles[next], (t_s - from) / (to - from)))
    }
}

// Clocks without a common origin: an IMU that counts from its own start beside fixes that are dated.
//
// Two loggers of one drive begin within a minute of one another. The turns of the course against those of the
// gyroscopes ([`super::clocks_apart`]) tell the rest to some tenths of a second; the delay among these at which the
// filter's innovations are smallest, and their slope there ([`super::antenna_offset()`]), tell it to hundredths.

/// Delays that are tried about the one at which the turns agree, and how far apart (s): the course of what walks is ahead
/// of the turns of its body by half a step.
const TRIED: (i32, f64) = (5, 0.2);
/// Time from one position to the next where positions alone tell the turns (s).
const BASELINE_S: f64 = 2.0;
/// Most of a recording that is examined (s).
const MOST_S: f64 = 1200.0;
/// NIS per component of a fix that contradicts, however much, and of one before the start: a wrong delay makes some starts
/// be given up for later ones, whose fewer fixes would speak for it.
const CONTRADICTS: f64 = 16.0;

/// Time that the clock of the fixes is ahead of the IMU's (s), where the two have nothing in common and the turns agree
/// when both recordings begin within a minute of one another.
pub fn rough_origin(recorded: &DriveData<'_>) -> Option<f64> {
    let begins_s = check_clocks(recorded).err()?.delay_s()?;
    let gnss = earlier(recorded.gnss, begins_s);
    let [lag_s, ..] = agreement(&recorded.with_gnss(&gnss), LONGEST_S[0])?;
    Some(begins_s - lag_s)
}

/// Every other of fixes a baseline apart, with the velocities from the one before to the one after: over a second the course of
/// positions is mostly noise, and velocities that share positions are no two.
fn with_velocities(gnss: &[GnssFix]) -> Vec<GnssFix> {
    let mut kept: Vec<GnssFix> = Vec::new();
    for fix in gnss {
        let is_near = |last: &GnssFix| fix.t_s - last.t_s < BASELINE_S - 1e-6;
        if !kept.last().is_some_and(is_near) {
            kept.push(*fix);
        }
    }
    let centred = |three: &[GnssFix]| {
        let (before, after) = (&three[0], &three[2]);
        let seconds = after.t_s - before.t_s;
        let v_n = ned_difference(before.place(), after.place()) / seconds;
        let sigma_n = before.pos_sigma_n.powf(2.0) + after.pos_sigma_n.powf(2.0);
        let velocity = GnssVelocity {
            horizontal: v_n.truncate(),
            horizontal_sigma: sigma_n.powf(0.5).truncate() / seconds,
            down: None,
        };
        GnssFix {
            velocity: Some(velocity),
            ..three[1]
        }
    };
    kept.windows(3).step_by(2).map(centred).collect()
}

/// The rest of a delay that was found roughly (s): the one at which the innovations are smallest.
pub fn refine_clock_offset(
    recorded: &DriveData<'_>,
    filter_model: &FilterModel,
    settings: &FusionSettings,
) -> f64 {
    let to_s = recorded.gnss.first().map_or(0.0, |fix| fix.t_s) + MOST_S;
    let recorded = recorded.until(to_s);
    let fixes = recorded.gnss;
    let settings = settings.trial();
    let tried = |k: i32| {
        let delay_s = f64::from(k) * TRIED.1;
        let gnss = earlier(fixes, delay_s);
        let recorded = recorded.with_gnss(&gnss);
        let start = coarse(&recorded, &settings, filter_model).ok()?.start;
        let solution = fuse(&recorded, filter_model, &start, &settings, None).ok()?;
        Some((delay_s, disagreement(&solution, fixes.len()), start))
    };
    let all: Vec<_> = (-TRIED.0..=TRIED.0)
        .into_par_iter()
        .filter_map(tried)
        .collect();
    let least = (0..all.len()).min_by(|a, b| all[*a].1.total_cmp(&all[*b].1));
    let Some(((delay_s, _, start), least)) = least.map(|least| (&all[least], least)) else {
        return 0.0;
    };
    let gnss = earlier(fixes, *delay_s);
    let found = antenna_offset(&recorded.with_gnss(&gnss), filter_model, start, &settings);
    let rest_s = found.and_then(|found| found.delay_s);
    delay_s + rest_s.map_or_else(|| vertex(&all, least), |[rest_s, _]| rest_s)
}

/// Minimum of the parabola through a step and its neighbours (s behind the step): a delay that the
/// innovations hardly show.
fn vertex<T>(tried: &[(f64, f64, T)], least: usize) -> f64 {
    let three = least.checked_sub(1).and_then(|k| tried.get(k..k + 3));
    let Some([(_, before, _), (_, at, _), (_, after, _)]) = three else {
        return 0.0;
    };
    let bend = (before - 2.0 * at + after).max(f64::MIN_POSITIVE);
    0.5 * TRIED.1 * (before - after) / bend
}

/// Mean NIS per component of this many fixes, those before the start among them.
fn disagreement(solution: &Solution, fixes: usize) -> f64 {
    let of = |nis: f64, components: usize| (nis / components as f64).min(CONTRADICTS);
    let seen: f64 = solution
        .fixes
        .iter()
        .map(|fix| of(fix.nis, fix.innovation.len()))
        .sum();
    let unseen = fixes.saturating_sub(solution.fixes.len());
    (seen + CONTRADICTS * unseen as f64) / fixes as f64
}

/// Fixes so much earlier (s).
pub fn earlier(gnss: &[GnssFix], seconds: f64) -> Vec<GnssFix> {
    gnss.iter()
        .map(|fix| GnssFix {
            t_s: fix.t_s - seconds,
            ..*fix
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::earth::moved;
    use crate::tests::key;
    use approx::assert_abs_diff_eq;
    use rand::RngExt;

    /// A drive of ten minutes at 10 m/s whose course turns by `rate(t)`, an IMU at 50 Hz in any attitude, and so many fixes a
    /// second whose clock is `late_s` ahead of the IMU's; the velocities of more than one are 0.05 m/s off to either side.
    fn drive(
        fixes: usize,
        late_s: f64,
        rate: impl Fn(f64) -> f64,
    ) -> (Vec<ImuIncrement>, Vec<GnssFix>) {
        let axis = DVec3::new(0.6, 0.0, 0.8);
        let (mut imu, mut gnss, mut course) = (Vec::new(), Vec::new(), 0.0_f64);
        for k in 1..=30_000_usize {
            let t_s = k as f64 * 0.02;
            let turn = rate(t_s) * 0.02;
            course += turn;
            imu.push(ImuIncrement {
                t_s,
                dt_s: 0.02,
                dtheta: axis * turn,
                dv: DVec3::ZERO,
            });
            if k.is_multiple_of(50 / fixes) {
                let is_off = fixes > 1 && k.is_multiple_of(100 / fixes);
                let course = course + if is_off { 0.005 } else { 0.0 };
                let v_n = 10.0 * DVec3::new(course.cos(), course.sin(), 0.0);
                gnss.push(GnssFix {
                    t_s: t_s + late_s,
                    lat: 0.8,
                    lon: 0.1,
                    h: 0.0,
                    pos_sigma_n: DVec3::ONE,
                    velocity: Some(GnssVelocity::new(v_n, DVec3::splat(0.05))),
                });
            }
        }
        (imu, gnss)
    }

    fn turns_apart((imu, gnss): &(Vec<ImuIncrement>, Vec<GnssFix>)) -> Option<ClocksApart> {
        let recorded = DriveData {
            imu,
            gnss,
            aids: &[],
        };
        clocks_apart(&recorded, |_| None)
    }

    /// Turns that never come again in the same order.
    fn winding(t_s: f64) -> f64 {
        0.2 * (t_s / 7.0).sin() * (t_s / 11.3).sin() + 0.1 * (t_s / 31.7).sin()
    }

    /// Positions alone, 2 m off to any side, that begin 20 s after the IMU on a clock of their own: the origin is found to the
    /// second that `refine_clock_offset` looks at.
    #[test]
    fn positions_tell_the_origin_of_their_clock() {
        let late_s = 50_400.0;
        let (imu, mut gnss) = drive(1, late_s, winding);
        let (mut place, mut g) = ([0.8, 0.1, 0.0], key(1).generator());
        for fix in &mut gnss {
            let mut off_m = || g.random_range(-2.0..2.0);
            place = moved(place, fix.velocity.unwrap().v_n());
            [fix.lat, fix.lon, fix.h] = moved(place, DVec3::new(off_m(), off_m(), 0.0));
            (fix.pos_sigma_n, fix.velocity) = (DVec3::splat(2.0), None);
        }
        let found_s = rough_origin(&DriveData {
            imu: &imu,
            gnss: &gnss[20..],
            aids: &[],
        });
        let off_s = found_s.unwrap() - late_s;
        assert!(off_s.abs() < 1.0, "{off_s}");
    }

    #[test]
    fn the_difference_of_the_clocks_is_found_with_its_sign() {
        for (fixes, late_s) in [(1, 18.0), (1, -18.0), (1, 2.0), (1, -0.7), (10, 2.0)] {
            let apart = turns_apart(&drive(fixes, late_s, winding)).unwrap();
            assert_abs_diff_eq!(apart.delay_s, late_s, epsilon = 0.5 * STEP_S);
        }
    }

    #[test]
    fn nothing_is_said_of_one_clock_nor_of_straight_roads_nor_of_turns_that_repeat() {
        // a round of 20 s: as good as they are as 20 s later
        let round = |t: f64| 0.3 * (std::f64::consts::PI * t / 10.0).sin();
        for drive in [
            drive(1, 0.0, winding),
            drive(1, 18.0, |_| 0.0),
            drive(1, 0.0, round),
        ] {
            assert_eq!(turns_apart(&drive), None);
        }
    }
}
