//! Mounting angles of the IMU in a road vehicle, estimated from the drive itself.
//!
//! The vehicle is assumed to move along its x axis, forwards for the most part, without slip and
//! without bank on average. First the specific force is compared with the change of the GNSS
//! velocity along the track (`track`): gravity gives roll and pitch; accelerations and turns give
//! the yaw. Then the fusion filter propagates the attitude of the IMU through the whole drive with
//! its biases estimated, and the mounting is the mean rotation from it to the track (`refined`).

use super::alignment::{
    Alignment, CarrierSpeed, MovingFix, between, carried, coarse, courses, steps,
};
use super::outcome::{is_contradicted, nis_per_component};
use super::{DriveData, FusionSettings, SolutionRow, fuse};
use crate::earth::gravity_down;
use crate::ekf::FilterModel;
use crate::frames::RollPitchYaw;
use crate::units::{DEG, Refused};
use glam::{DQuat, DVec3};
use std::f64::consts::PI;
use std::fmt::Display;

/// Largest standard deviation of an angle that is still an answer (rad).
const DETERMINED: f64 = 5.0 * DEG;

/// A mounting that was found.
#[derive(Debug, Clone)]
pub struct Mounting {
    /// Takes the IMU's axes, returns front, right, down.
    pub q_s_b: DQuat,
    /// Angles relative to the axes that the search began with: what a user gives for the next drive.
    pub angles: RollPitchYaw,
    /// Standard deviations about the vehicle's front, right and down axes (rad).
    pub sigma_b: DVec3,
    /// Distance driven with a known course (m).
    pub way_m: f64,
    /// Factor on the stated standard deviations of the fixes with which it was found.
    pub sigma_factor: f64,
}

impl Mounting {
    /// Roll, pitch and yaw in degrees.
    pub fn angles_deg(&self) -> [f64; 3] {
        [self.angles.roll, self.angles.pitch, self.angles.yaw].map(|a| a / DEG)
    }

    /// Standard deviations about front, right and down in degrees.
    pub fn sigma_deg(&self) -> [f64; 3] {
        (self.sigma_b / DEG).to_array()
    }
}

/// Finds the mounting. The rotation of the settings is where the axes' names come from; fixes that are withheld are
/// not looked at.
///
/// # Errors
/// When the drive does not show it.
pub fn find(
    recorded: &DriveData<'_>,
    settings: &FusionSettings,
    filter_model: &FilterModel,
) -> Result<Mounting, Refused> {
    let gnss = settings.kept(recorded.gnss);
    let recorded = recorded.with_gnss(&gnss);
    let rough = along(&recorded, settings)?;
    // with standard deviations as stated, or where the fixes contradict those, with what makes their NIS 1
    let (mut widened, mut factor) = (gnss.clone(), 1.0);
    let found = loop {
        match refine_with_filter(&recorded.with_gnss(&widened), settings, filter_model, rough)? {
            Ok(found) => break found,
            Err(nis) if nis > 1.0 && factor * nis.sqrt() <= MOST_WIDENED => {
                factor *= nis.sqrt();
                let fixes = gnss.iter();
                let fixes = fixes.map(|fix| fix.with_sigmas_times(factor, factor));
                widened = fixes.collect();
            }
            Err(nis) => {
                let why = "the fixes contradict the filter, NIS";
                return Err(not_found(format!("{why} {nis:.1} per component")));
            }
        }
    };
    let named = ["roll", "pitch", "yaw"]
        .into_iter()
        .zip(found.sigma_b.to_array());
    // NaN is not determined either
    let worst = named
        .into_iter()
        .find(|(_, sigma)| sigma.is_nan() || *sigma > DETERMINED);
    if let Some((axis, sigma)) = worst {
        return Err(undetermined(axis, sigma, DETERMINED));
    }
    Ok(Mounting {
        sigma_factor: factor,
        ..found
    })
}

fn not_found(why: impl Display) -> Refused {
    Refused(format!("the mounting is not found: {why}"))
}

/// An angle that scatters too much (rad).
fn undetermined(axis: &str, sigma: f64, limit: f64) -> Refused {
    let (sigma_deg, limit_deg) = (sigma / DEG, limit / DEG);
    not_found(format!(
        "{axis} is known to ±{sigma_deg:.1}°, ±{limit_deg:.0}° is needed"
    ))
}

/// Hardly any of the drive is fast enough to have a course.
fn too_slow(seconds: f64) -> Refused {
    let needed = FEWEST as f64 * BLOCK_S;
    not_found(format!(
        "{seconds:.0} s of the drive have a course, {needed:.0} s are needed"
    ))
}

/// Most that the standard deviations of fixes are widened by: what contradicts more is not the receiver's word.
const MOST_WIDENED: f64 = 5.0;

// Weighted means of what is correlated in time, and their standard deviations.

/// Length of a block (s): slopes, banks and slips of a road are mostly over by then.
const BLOCK_S: f64 = 20.0;
/// Fewest blocks of which a scatter is known.
const FEWEST: usize = 6;

/// Sums over blocks of time.
#[derive(Default)]
struct BlockSums {
    /// Number of the block, and the sum in it.
    sums: Vec<(i64, f64)>,
    weight: f64,
}

impl BlockSums {
    /// Adds `value` of weight `weight` at a time, times in order.
    fn add(&mut self, t_s: f64, value: f64, weight: f64) {
        let block = (t_s / BLOCK_S).floor() as i64;
        self.weight += weight;
        match self.sums.last_mut() {
            Some((last, sum)) if *last == block => *sum += weight * value,
            _ => self.sums.push((block, weight * value)),
        }
    }

    fn count(&self) -> usize {
        self.sums.len()
    }

    fn mean(&self) -> f64 {
        self.sums.iter().map(|(_, sum)| sum).sum::<f64>() / self.weight
    }

    /// Standard deviation of a mean whose values have been reduced by it: from the scatter of the blocks, with the
    /// correlation of neighbours where that is positive (Newey and West's estimator of lag one), and wider where they
    /// are few, as Student's t is.
    fn sigma(&self) -> f64 {
        let count = self.count() as f64;
        let own: f64 = self.sums.iter().map(|(_, sum)| sum * sum).sum();
        let neighbours = self.sums.windows(2).filter(|w| w[1].0 == w[0].0 + 1);
        let shared: f64 = neighbours.map(|w| w[0].1 * w[1].1).sum();
        // Newey and West's weight at lag one is 1/2, and each pair counts twice: factor 1. A negative
        // correlation is not used: it would narrow the interval on the evidence of few blocks.
        let variance = (own + shared.max(0.0)) * count / (count - 1.0);
        // 1 + 1/(4ν) of the normal quantile is t's near one sigma; 2.5/ν covers three
        variance.sqrt() / self.weight * (1.0 + 2.5 / (count - 1.0))
    }
}

// The rotation from the attitude that the filter carries through the drive to the track, its mean.

/// Rows of the filter's solution a second.
const ROWS_HZ: f64 = 2.0;
/// Banks and slopes of roads beside those of the track, at a time (rad).
const AT_A_TIME: DVec3 = DVec3::new(2.0 * DEG, 1.0 * DEG, 0.0);
/// Roll and pitch of a body under an acceleration (rad per m/s²), and the distance of the IMU from
/// the axle that does not steer (m): in a turn the course there leaves the axis.
const LEAN: f64 = 1.0 * DEG;
const AXLE_M: f64 = 2.0;
/// Systematic part that no drive shows (rad). Roads fall to the side by 2 to 2.5 % (1.1 to 1.4°),
/// to the same side wherever traffic keeps to one; loads tilt a body; a vehicle does not run quite
/// along its axis.
const UNSEEN: DVec3 = DVec3::new(1.5 * DEG, 0.5 * DEG, 0.3 * DEG);
/// Factor on the standard deviation of the rough yaw for the filter's start: the filter uses the
/// same data, which are hardly counted twice then.
const LOOSE: f64 = 3.0;
/// Largest difference between the filter's yaw and the rough one, in standard deviations.
const APART: f64 = 4.0;
/// Banks of roads and leaning bodies are less than this, root mean square (rad).
const BANKED: f64 = 8.0 * DEG;
/// Share of the way in the lesser direction from which nobody knows which one is forwards.
const UNDECIDED: f64 = 0.25;

/// The filter's yaw must be that of the accelerations: biases, which a filter may not expect, do not touch the latter.
fn agreeing(mean: DQuat, sigma: f64) -> Result<(), Refused> {
    let turn = (if mean.w < 0.0 { -mean } else { mean })
        .to_scaled_axis()
        .z
        .abs();
    if turn <= APART * sigma {
        return Ok(());
    }
    let (yaw_deg, sigma_deg) = (turn / DEG, sigma / DEG);
    Err(not_found(format!(
        "the filter's yaw is {yaw_deg:.1} ± {sigma_deg:.1}° from that of accelerations"
    )))
}

/// An instant in motion.
struct MotionSample {
    t_s: f64,
    /// Takes the axes of the vehicle as it was mounted so far to those of the track.
    q: DQuat,
    /// Standard deviations of that about the axes of the track, for weights, and by the filter alone (rad).
    sigma: DVec3,
    of_filter: DVec3,
    way_m: f64,
}

/// Refined by the filter, or the NIS per component of fixes that contradict it.
fn refine_with_filter(
    recorded: &DriveData<'_>,
    settings: &FusionSettings,
    filter_model: &FilterModel,
    rough: (DQuat, f64),
) -> Result<Result<Mounting, f64>, Refused> {
    let named = settings.q_s_b.inverse();
    let loose = DVec3::Z * (LOOSE * rough.1);
    let settings = FusionSettings {
        q_s_b: rough.0,
        mounting_sigma_b: loose,
        rows_hz: ROWS_HZ,
        ..settings.clone()
    };
    let Alignment { start, doubts } =
        coarse(recorded, &settings, filter_model).map_err(not_found)?;
    // what the rows state is then of the IMU's attitude
    let settings = FusionSettings {
        mounting_sigma_b: DVec3::ZERO,
        ..settings
    };
    let solution = fuse(recorded, filter_model, &start, &settings, None).map_err(not_found)?;
    // attitudes of a filter that the fixes contradict are no worse than it states only by chance
    if is_contradicted(&solution, &doubts) {
        return Ok(Err(nis_per_component(&solution)));
    }
    let pace = courses(recorded.gnss, recorded.imu)
        .first()
        .map_or(CarrierSpeed::Fast, |moving| moving.pace);
    let mut moments: Vec<MotionSample> = solution
        .rows
        .windows(3)
        .filter_map(|w| moment([&w[0], &w[1], &w[2]], pace))
        .collect();
    turn_to_front(&mut moments)?;
    let mean = mean(&moments);
    refuse_banking(&moments, mean)?;
    let blocks = deviations(&moments, mean);
    if blocks[0].count() < FEWEST {
        return Err(too_slow(moments.len() as f64 / ROWS_HZ));
    }
    // Three parts: what scatters over the drive, what the filter itself is wrong by all along, and what no
    // drive shows.
    let scatter = DVec3::from_array(blocks.each_ref().map(BlockSums::sigma));
    let sigma_b = (scatter.powf(2.0) + of_filter(&moments).powf(2.0) + UNSEEN.powf(2.0)).powf(0.5);
    agreeing(mean, rough.1.hypot(sigma_b.z))?;
    let q_s_b = (mean * rough.0).normalize();
    Ok(Ok(Mounting {
        q_s_b,
        angles: RollPitchYaw::from_quat(q_s_b * named),
        sigma_b,
        way_m: moments.iter().map(|m| m.way_m).sum(),
        sigma_factor: 1.0,
    }))
}

/// The vehicle beside its track at a row that moves fast enough for a course.
fn moment([before, row, after]: [&SolutionRow; 3], pace: CarrierSpeed) -> Option<MotionSample> {
    let (v_n, speed) = (row.state.v_n, row.state.v_n.truncate().length());
    let of_velocity = row.sigma[3].max(row.sigma[4]);
    if speed < pace.min_heading_speed(of_velocity) {
        return None;
    }
    let seconds = after.t_s - before.t_s;
    let acceleration = (after.state.v_n - before.state.v_n).truncate() / seconds;
    let turned = before.state.q_b_n.inverse() * after.state.q_b_n;
    let rate = turned.to_scaled_axis().length() / seconds;
    let lean = LEAN * acceleration.length();
    // ω · lever/speed is the angle between the course at the IMU and the axis of the body in a turn.
    let slip = (rate * AXLE_M / speed)
        .hypot(of_velocity / speed)
        .hypot(pace.slip(speed));
    let of_filter = DVec3::new(row.sigma[6], row.sigma[7], row.sigma[8]) * DEG;
    // About the front axis lean in turns; about the right axis nod, and the error of the slope by that of the
    // vertical velocity; about down slip.
    let others = DVec3::new(lean, lean.hypot(row.sigma[5] / speed), slip);
    let q = track_attitude(v_n, row.sigma[5]).inverse() * row.state.q_b_n;
    let sigma = (of_filter.powf(2.0) + AT_A_TIME.powf(2.0) + others.powf(2.0)).powf(0.5);
    Some(MotionSample {
        t_s: row.t_s,
        q,
        sigma,
        of_filter,
        way_m: speed / ROWS_HZ,
    })
}

/// Turns the track around where the vehicle goes backwards. Most of the way is assumed to be
/// forwards.
fn turn_to_front(moments: &mut [MotionSample]) -> Result<(), Refused> {
    let is_against = |m: &MotionSample| (m.q * DVec3::X).x < 0.0;
    let way = |of: &dyn Fn(&&MotionSample) -> bool| {
        moments.iter().filter(of).map(|m| m.way_m).sum::<f64>()
    };
    let (against, all) = (way(&|m| is_against(m)), way(&|_| true));
    let share = against.min(all - against) / all;
    if share > UNDECIDED {
        let percent = 100.0 * share;
        return Err(not_found(format!(
            "{percent:.0} % of the way goes against the direction of the rest"
        )));
    }
    let front_is_behind = against > all - against;
    for m in moments {
        if is_against(m) != front_is_behind {
            m.q = DQuat::from_rotation_z(PI) * m.q;
        }
    }
    Ok(())
}

/// The rotation about which the moments deviate by nothing on average.
fn mean(moments: &[MotionSample]) -> DQuat {
    let mut mean = moments.first().map_or(DQuat::IDENTITY, |m| m.q);
    // each step takes the curvature of rotations anew; five are enough from anywhere
    for _ in 0..5 {
        let step = DVec3::from_array(deviations(moments, mean).each_ref().map(BlockSums::mean));
        mean = (DQuat::from_scaled_axis(step) * mean).normalize();
    }
    mean
}

/// Refuses a carrier that banks into its turns: an aircraft, whose track says little of its
/// attitude.
fn refuse_banking(moments: &[MotionSample], mean: DQuat) -> Result<(), Refused> {
    let square = moments
        .iter()
        .map(|m| deviation(m, mean).x.powi(2))
        .sum::<f64>()
        / moments.len().max(1) as f64;
    let bank = square.sqrt();
    if bank > BANKED {
        let bank_deg = bank / DEG;
        Err(not_found(format!(
            "the vehicle banks by {bank_deg:.0}° (rms) along its track, as aircraft do"
        )))
    } else {
        Ok(())
    }
}

/// The deviation of a moment from a rotation, about the track's axes (rad).
fn deviation(moment: &MotionSample, mean: DQuat) -> DVec3 {
    let q = moment.q * mean.inverse();
    (if q.w < 0.0 { -q } else { q }).to_scaled_axis()
}

/// The deviations of all, in blocks.
fn deviations(moments: &[MotionSample], mean: DQuat) -> [BlockSums; 3] {
    let mut blocks: [BlockSums; 3] = std::array::from_fn(|_| BlockSums::default());
    for m in moments {
        let deviation = deviation(m, mean).to_array();
        for (i, sum) in blocks.iter_mut().enumerate() {
            sum.add(m.t_s, deviation[i], m.sigma[i].powi(-2));
        }
    }
    blocks
}

/// The filter's own standard deviations on average: its errors last, and are not less for being examined often.
fn of_filter(moments: &[MotionSample]) -> DVec3 {
    let weights: DVec3 = moments.iter().map(|m| m.sigma.powf(-2.0)).sum();
    let sums: DVec3 = moments
        .iter()
        .map(|m| m.of_filter.powf(2.0) * m.sigma.powf(-2.0))
        .sum();
    // Not divided by the number of moments: an attitude error lasts for minutes, so that averaging does not
    // reduce it.
    (sums / weights).powf(0.5)
}

// The specific force beside what the change of the GNSS velocity says it is along the track: a rotation, by
// gravity and by accelerations.

/// Times between two velocities whose difference is an acceleration (s).
const APART_S: (f64, f64) = (0.9, 5.0);
/// Standard deviation of a vehicle's acceleration from that of its antenna (m/s²): sway, vibration,
/// lever arm.
const SWAY: f64 = 0.5;
/// Slopes of roads (rad): vertical velocities that are worse than this are not believed.
const SLOPE: f64 = 3.0 * DEG;
/// Largest standard deviation of the yaw that the filter can begin with (rad).
const ROUGH: f64 = 20.0 * DEG;

/// A stretch between two velocities.
struct VelocityChange {
    t_s: f64,
    /// Mean specific force in the axes of the IMU and along the track, in the middle of the stretch (m/s²).
    f_s: DVec3,
    f_track: DVec3,
    weight: f64,
}

/// The attitude of a vehicle without slip and bank: front along the velocity, right level.
fn track_attitude(v_n: DVec3, sigma_down: f64) -> DQuat {
    let speed = v_n.truncate().length();
    let slope = (-v_n.z).atan2(speed);
    // what is measured worse than slopes are is drawn to none
    let believed = 1.0 / (1.0 + (sigma_down / speed / SLOPE).powi(2));
    DQuat::from_rotation_z(v_n.y.atan2(v_n.x)) * DQuat::from_rotation_y(slope * believed)
}

/// The rotation from the IMU to the track, and the standard deviation of its yaw (rad).
fn along(recorded: &DriveData<'_>, settings: &FusionSettings) -> Result<(DQuat, f64), Refused> {
    let stretches = stretches(recorded, settings);
    let mut seen = BlockSums::default();
    stretches.iter().for_each(|s| seen.add(s.t_s, 0.0, 1.0));
    if seen.count() < FEWEST {
        // the sum of nothing is -0
        let seconds = stretches
            .windows(2)
            .map(|w| (w[1].t_s - w[0].t_s).min(APART_S.1))
            .fold(0.0, |a, b| a + b);
        return Err(too_slow(seconds));
    }
    let weights: f64 = stretches.iter().map(|s| s.weight).sum();
    let mean = |of: fn(&VelocityChange) -> DVec3| {
        stretches.iter().map(|s| of(s) * s.weight).sum::<DVec3>() / weights
    };
    let (mean_s, mean_track) = (mean(|s| s.f_s), mean(|s| s.f_track));
    // level first: then what is left is a turn about the mean of the specific force
    let level = DQuat::from_rotation_arc(mean_s.normalize(), mean_track.normalize());
    let up = mean_track.normalize();
    // less their means, so that neither a bias of the accelerometers nor a tilt counts as acceleration
    let pair = |s: &VelocityChange| (level * (s.f_s - mean_s), s.f_track - mean_track);
    // Wahba's problem about one axis: both vectors projected across `up`, sums of their sine and cosine.
    let torque = |u: DVec3, w: DVec3| up.dot(u.cross(w));
    let held = |u: DVec3, w: DVec3| u.dot(w) - up.dot(u) * up.dot(w);
    let sum = |turn: DQuat, of: &dyn Fn(DVec3, DVec3) -> f64| -> f64 {
        let terms = stretches.iter().map(|s| {
            let (u, w) = pair(s);
            s.weight * of(turn * u, w)
        });
        terms.fold(0.0, |a, b| a + b)
    };
    let none = DQuat::IDENTITY;
    let turn = DQuat::from_axis_angle(up, sum(none, &torque).atan2(sum(none, &held)));
    let mut torques = BlockSums::default();
    for s in &stretches {
        let (u, w) = pair(s);
        torques.add(s.t_s, torque(turn * u, w), s.weight);
    }
    // A sandwich: the deviation of the sum of the torques of what the turn leaves (σ of the weighted mean times the
    // weights) over the slope of that sum with the turn, which is that of the products that hold it.
    let yaw_sigma = torques.sigma() * weights / sum(turn, &held).max(0.0);
    if yaw_sigma <= ROUGH {
        Ok(((turn * level).normalize(), yaw_sigma))
    } else {
        // NaN is not less than half a turn
        Err(undetermined("yaw", yaw_sigma.min(PI), ROUGH))
    }
}

/// The stretches between fixes that have a course.
fn stretches(recorded: &DriveData<'_>, settings: &FusionSettings) -> Vec<VelocityChange> {
    let courses: Vec<MovingFix> = courses(recorded.gnss, recorded.imu)
        .into_iter()
        .filter(|m| m.speed() >= m.min_heading_speed())
        .collect();
    let steps = steps(&courses, APART_S.0);
    steps
        .into_iter()
        .filter_map(|[from, to]| stretch(recorded, settings, from, to))
        .collect()
}

fn stretch(
    recorded: &DriveData<'_>,
    settings: &FusionSettings,
    (from, from_s): (&MovingFix, f64),
    (to, to_s): (&MovingFix, f64),
) -> Option<VelocityChange> {
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
    Some(VelocityChange {
        t_s: (from_s + to_s) / 2.0,
        f_s: to_middle * dv / covered,
        f_track: to_track * f_n,
        weight: 1.0 / (sigma * sigma + SWAY * SWAY),
    })
}

#[cfg(test)]
mod blocks_tests {
    use super::*;
    use approx::assert_abs_diff_eq;

    /// Of 400 values of ±1, neighbours as often alike as not, the mean has the standard deviation 1/√400.
    #[test]
    fn the_scatter_of_blocks_is_that_of_their_mean() {
        let mut blocks = BlockSums::default();
        for k in 0..400 {
            let value = if k % 4 < 2 { 1.0 } else { -1.0 };
            (0..10).for_each(|i| {
                blocks.add(BLOCK_S * (f64::from(k) + 0.1 * f64::from(i)), value, 2.0)
            });
        }
        assert!(blocks.mean().abs() < 1e-12 && blocks.count() == 400);
        // 1 % for the few
        assert_abs_diff_eq!(blocks.sigma() * 20.0, 1.0, epsilon = 0.01);
        // neighbours that are all alike in pairs: half as many values
        let mut pairs = BlockSums::default();
        (0..400).for_each(|k| {
            pairs.add(
                BLOCK_S * f64::from(k),
                if (k / 2) % 2 == 0 { 1.0 } else { -1.0 },
                1.0,
            )
        });
        assert!(pairs.sigma() >= blocks.sigma());
    }
}
