//! The rotation from the attitude that the filter carries through the drive to the track, its mean.

use super::MountingError;
use super::blocks::{BLOCK_S, Blocks, FEWEST};
use super::track::{Rough, track_attitude};
use crate::ekf::Belief;
use crate::fusion::alignment::course::{Pace, courses};
use crate::fusion::alignment::{Alignment, coarse};
use crate::fusion::assessment::is_contradicted;
use crate::fusion::outcome::nis_per_component;
use crate::fusion::{Recorded, Row, Settings, fuse};
use crate::units::DEG;
use glam::{DQuat, DVec3};

/// Rows of the filter's solution a second.
const ROWS_HZ: f64 = 2.0;
/// Banks and slopes of roads beside those of the track, at a time (rad).
const AT_A_TIME: DVec3 = DVec3::new(2.0 * DEG, 1.0 * DEG, 0.0);
/// What a body leans and nods under an acceleration (rad per m/s²), and how far the IMU is from the axle that does not
/// steer (m): in a turn the course there leaves the axis.
const LEAN: f64 = 1.0 * DEG;
const AXLE_M: f64 = 2.0;
/// What no drive shows (rad). Roads fall to the side by 2 to 2.5 % (1.1 to 1.4°), always to the same one for who keeps to it;
/// loads tilt a body; a vehicle does not run quite along its axis.
const UNSEEN: DVec3 = DVec3::new(1.5 * DEG, 0.5 * DEG, 0.3 * DEG);
/// How many times the standard deviation of the rough yaw the filter begins with: its own, from the same data, is hardly
/// counted twice then.
const LOOSE: f64 = 3.0;
/// How many standard deviations the yaw of the filter may be from the rough one.
const APART: f64 = 4.0;
/// Banks of roads and leaning bodies are less than this, root mean square (rad).
const BANKED: f64 = 8.0 * DEG;
/// Share of the way in the lesser direction from which nobody knows which one is forwards.
const UNDECIDED: f64 = 0.25;

/// The mounting, its standard deviations (rad), the way it rests on (m).
pub(super) struct Refined {
    pub(super) q_s_b: DQuat,
    pub(super) sigma_b: DVec3,
    pub(super) way_m: f64,
}

/// The filter's yaw must be that of the accelerations: biases, which a filter may not expect, do not touch the latter.
fn agreeing(mean: DQuat, sigma: f64) -> Result<(), MountingError> {
    let turn = (if mean.w < 0.0 { -mean } else { mean })
        .to_scaled_axis()
        .z
        .abs();
    let disagree = || MountingError::Disagree {
        yaw_deg: turn / DEG,
        sigma_deg: sigma / DEG,
    };
    if turn <= APART * sigma {
        Ok(())
    } else {
        Err(disagree())
    }
}

/// An instant in motion.
struct Moment {
    t_s: f64,
    /// Takes the axes of the vehicle as it was mounted so far to those of the track.
    q: DQuat,
    /// Standard deviations of that about the axes of the track, for weights, and by the filter alone (rad).
    sigma: DVec3,
    of_filter: DVec3,
    way_m: f64,
}

pub(super) fn through(
    recorded: &Recorded<'_>,
    settings: &Settings,
    belief: &Belief,
    rough: &Rough,
) -> Result<Refined, MountingError> {
    let loose = DVec3::Z * (LOOSE * rough.yaw_sigma);
    let settings = Settings {
        q_s_b: rough.q_s_b,
        mounting_sigma_b: loose,
        rows_hz: ROWS_HZ,
        ..settings.clone()
    };
    let Alignment { start, doubts } = coarse(recorded, &settings, belief)?;
    // what the rows state is then of the IMU's attitude
    let settings = Settings {
        mounting_sigma_b: DVec3::ZERO,
        ..settings
    };
    let solution = fuse(recorded, belief, &start, &settings, None)?;
    // attitudes of a filter that the fixes contradict are no worse than it states only by chance
    if is_contradicted(&solution, &doubts) {
        return Err(MountingError::Contradicted {
            nis_per_component: nis_per_component(&solution),
        });
    }
    let pace = courses(recorded.gnss, recorded.imu)
        .first()
        .map_or(Pace::Fast, |moving| moving.pace);
    let mut moments: Vec<Moment> = solution
        .rows
        .windows(3)
        .filter_map(|w| moment([&w[0], &w[1], &w[2]], pace))
        .collect();
    turn_to_front(&mut moments)?;
    let mean = mean(&moments);
    upright(&moments, mean)?;
    let blocks = deviations(&moments, mean);
    if blocks[0].count() < FEWEST {
        let seconds = moments.len() as f64 / ROWS_HZ;
        return Err(MountingError::TooSlow {
            seconds,
            needed: FEWEST as f64 * BLOCK_S,
        });
    }
    // Three parts: what scatters over the drive, what the filter itself is wrong by all along, and what no
    // drive shows.
    let scatter = DVec3::from_array(blocks.each_ref().map(Blocks::sigma));
    let sigma_b = (scatter.powf(2.0) + of_filter(&moments).powf(2.0) + UNSEEN.powf(2.0)).powf(0.5);
    agreeing(mean, rough.yaw_sigma.hypot(sigma_b.z))?;
    let way_m = moments.iter().map(|m| m.way_m).sum();
    Ok(Refined {
        q_s_b: (mean * rough.q_s_b).normalize(),
        sigma_b,
        way_m,
    })
}

/// The vehicle beside its track at a row that moves fast enough for a course.
fn moment([before, row, after]: [&Row; 3], pace: Pace) -> Option<Moment> {
    let (v_n, speed) = (row.state.v_n, row.state.v_n.truncate().length());
    let of_velocity = row.sigma[3].max(row.sigma[4]);
    if speed < pace.needed(of_velocity) {
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
    Some(Moment {
        t_s: row.t_s,
        q,
        sigma,
        of_filter,
        way_m: speed / ROWS_HZ,
    })
}

/// Where the vehicle goes backwards its front is behind the track's. More of the way is forwards.
fn turn_to_front(moments: &mut [Moment]) -> Result<(), MountingError> {
    let is_against = |m: &Moment| (m.q * DVec3::X).x < 0.0;
    let way =
        |of: &dyn Fn(&&Moment) -> bool| moments.iter().filter(of).map(|m| m.way_m).sum::<f64>();
    let (against, all) = (way(&|m| is_against(m)), way(&|_| true));
    let share = against.min(all - against) / all;
    if share > UNDECIDED {
        return Err(MountingError::Directions { share });
    }
    let front_is_behind = against > all - against;
    for m in moments {
        if is_against(m) != front_is_behind {
            m.q = DQuat::from_rotation_z(std::f64::consts::PI) * m.q;
        }
    }
    Ok(())
}

/// The rotation about which the moments deviate by nothing on average.
fn mean(moments: &[Moment]) -> DQuat {
    let mut mean = moments.first().map_or(DQuat::IDENTITY, |m| m.q);
    // each step takes the curvature of rotations anew; five are enough from anywhere
    for _ in 0..5 {
        let step = DVec3::from_array(deviations(moments, mean).each_ref().map(Blocks::mean));
        mean = (DQuat::from_scaled_axis(step) * mean).normalize();
    }
    mean
}

/// What banks into its turns is an aircraft, whose way says little of its attitude.
fn upright(moments: &[Moment], mean: DQuat) -> Result<(), MountingError> {
    let square = moments
        .iter()
        .map(|m| deviation(m, mean).x.powi(2))
        .sum::<f64>()
        / moments.len().max(1) as f64;
    let bank = square.sqrt();
    if bank > BANKED {
        Err(MountingError::Banks {
            bank_deg: bank / DEG,
        })
    } else {
        Ok(())
    }
}

/// The deviation of a moment from a rotation, about the track's axes (rad).
fn deviation(moment: &Moment, mean: DQuat) -> DVec3 {
    let q = moment.q * mean.inverse();
    (if q.w < 0.0 { -q } else { q }).to_scaled_axis()
}

/// The deviations of all, in blocks.
fn deviations(moments: &[Moment], mean: DQuat) -> [Blocks; 3] {
    let mut blocks: [Blocks; 3] = std::array::from_fn(|_| Blocks::default());
    for m in moments {
        let deviation = deviation(m, mean).to_array();
        for (i, sum) in blocks.iter_mut().enumerate() {
            sum.add(m.t_s, deviation[i], m.sigma[i].powi(-2));
        }
    }
    blocks
}

/// The filter's own standard deviations on average: its errors last, and are not less for being looked at often.
fn of_filter(moments: &[Moment]) -> DVec3 {
    let weights: DVec3 = moments.iter().map(|m| m.sigma.powf(-2.0)).sum();
    let sums: DVec3 = moments
        .iter()
        .map(|m| m.of_filter.powf(2.0) * m.sigma.powf(-2.0))
        .sum();
    // Not divided by the number of moments: an attitude error lasts for minutes, so that averaging does not
    // reduce it.
    (sums / weights).powf(0.5)
}
