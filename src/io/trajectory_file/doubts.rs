//! Doubts about a trajectory file that can be used all the same: gaps, units, conventions.

use super::samples::{Attitude, MOVING, Rows};
use nav_sim_navigation::frames::{NavState, RollPitchYaw, wrap_angle};
use nav_sim_navigation::trajectory::Trajectory;
use nav_sim_navigation::trajectory::plausibility::VelocityMisfit;
use nav_sim_signal::units::DEG;
use std::f64::consts::{FRAC_PI_2, PI};

/// Instants at which path and attitude are compared: more tell no more.
const LOOKS: usize = 2000;

/// The path against the other columns.
pub(super) fn of_trajectory(rows: &mut Rows, trajectory: &Trajectory) {
    let small = |angle: f64| angle.abs() <= PI * DEG + 1e-8;
    if rows.geodetic
        && rows
            .samples
            .iter()
            .all(|s| small(s.lat) && small(0.5 * s.lon))
    {
        rows.doubt(
            None,
            "lat_deg and lon_deg never exceed π: radians? Then name the columns lat_rad, lon_rad",
        );
    }
    if rows.attitude == Attitude::Given {
        heading(rows, trajectory)
            .into_iter()
            .for_each(|text| rows.doubt(None, text));
    }
    let times = rows.samples.iter().map(|s| s.t_s);
    let given: Vec<_> = times.zip(rows.velocities.iter().copied()).collect();
    let misfit = VelocityMisfit::new(trajectory, &given).filter(VelocityMisfit::contradicts);
    if let Some(VelocityMisfit { rms, worst_s, .. }) = misfit {
        let line = given
            .iter()
            .position(|(t_s, _)| *t_s == worst_s)
            .map(|i| rows.lines[i]);
        let text = format!(
            "velocity columns differ from the positions, which are used, by {rms:.3} m/s rms"
        );
        rows.doubt(line, text);
    }
}

/// A heading far from the course that another convention or unit brings near it: four times as near, where it is
/// more than 20° off. A vehicle that drifts, or a drone, agrees with none.
fn heading(rows: &Rows, trajectory: &Trajectory) -> Option<String> {
    type Convention = (&'static str, fn(f64) -> f64);
    const CONVENTIONS: [Convention; 6] = [
        ("in radians (name the column yaw_rad)", |yaw| yaw / DEG),
        ("anticlockwise from north", |yaw| -yaw),
        (
            "anticlockwise from east, or with latitude and longitude swapped",
            |yaw| FRAC_PI_2 - yaw,
        ),
        ("clockwise from east", |yaw| FRAC_PI_2 + yaw),
        ("clockwise from west", |yaw| yaw - FRAC_PI_2),
        ("backwards", |yaw| yaw + PI),
    ];
    let look = |i: usize| {
        let NavState { v_n, q_b_n, .. } = trajectory.state(rows.samples[i].t_s);
        let moves = v_n.x.hypot(v_n.y) > MOVING;
        moves.then(|| (v_n.y.atan2(v_n.x), RollPitchYaw::from_quat(q_b_n).yaw))
    };
    let n = rows.samples.len();
    let looks: Vec<(f64, f64)> = (0..n).step_by(n.div_ceil(LOOKS)).filter_map(look).collect();
    let off = |meant: fn(f64) -> f64| {
        let sum: f64 = looks
            .iter()
            .map(|(course, yaw)| wrap_angle(course - meant(*yaw)).abs())
            .sum();
        sum / looks.len() as f64 / DEG
    };
    let given = off(|yaw| yaw);
    let tried = CONVENTIONS
        .iter()
        .map(|(words, meant)| (off(*meant), words));
    let (best, words) = tried.min_by(|a, b| a.0.total_cmp(&b.0))?;
    (given > 20.0 && best < 0.25 * given).then(|| {
        format!("yaw is {given:.0}° from the course in the mean, {best:.1}° when read {words}")
    })
}
