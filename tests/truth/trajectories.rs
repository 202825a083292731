//! The shipped trajectories are plausible and close: their noise-free IMU samples, mechanised, return to
//! them. And ideal samples and strapdown agree with independent truth.

use crate::shared::*;
use nav_sim::io::trajectory_file::load;
use nav_sim::navigation::frames::NavState;
use nav_sim::navigation::trajectory::ideal_imu::ideal_imu;
use nav_sim_navigation::closure::{Bounds, Closure};
use nav_sim_navigation::earth::ned_difference;
use nav_sim_navigation::strapdown::Strapdown;
use nav_sim_navigation::trajectory::plausibility::examine;
use nav_sim_signal::lanes::Vec3;
use std::io::Read;

const SHIPPED: [&str; 3] = ["land_vehicle", "figure_eight", "fixed_wing"];

/// What the shipped trajectories must meet at 100 Hz.
const BOUNDS: Bounds = Bounds {
    position_m: 0.01,
    velocity_m_s: 1e-3,
    attitude_rad: 1e-6,
};

/// A shipped profile that starts elsewhere.
fn moved(name: &str, lat_deg: f64, lon_deg: f64) -> Trajectory {
    let text = std::fs::read_to_string(root(&format!("trajectories/{name}.toml"))).unwrap();
    let start = text.find("start = { lat_deg = ").unwrap();
    let rest = start + text[start..].find(", h_m").unwrap();
    let place = format!("start = {{ lat_deg = {lat_deg}, lon_deg = {lon_deg}");
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("moved.toml");
    std::fs::write(&path, text[..start].to_owned() + &place + &text[rest..]).unwrap();
    load(&path, None).unwrap().0
}

fn closure(trajectory: &Trajectory, rate_hz: f64) -> Closure {
    Closure::new(trajectory, rate_hz, GravityModel::Wgs84).unwrap()
}

#[test]
fn shipped_trajectories_last_900_s_and_are_plausible() {
    // Speed (m/s), acceleration (m/s²), jerk (m/s³), rate (°/s): drives stay comfortable, the aircraft banks by 33°.
    for (name, limits) in [
        ("land_vehicle", [25.1, 3.0, 5.0, 17.2]),
        ("figure_eight", [12.1, 2.2, 3.0, 11.5]),
        ("fixed_wing", [70.1, 7.0, 5.0, 20.1]),
    ] {
        let t = shipped(name);
        assert!(
            t.start_s() == 0.0 && t.end_s() >= 900.0,
            "{name} lasts {} s",
            t.end_s()
        );
        let (largest, beyond) = examine(&t, &limits);
        assert!(beyond.is_empty(), "{name}: {largest:?}");
        assert!(largest[0] > limits[0] - 0.2, "{name}: {largest:?}");
    }
}

/// The outages of the navigation study: straight in one, turning throughout the other.
#[test]
fn the_drive_is_straight_in_one_outage_and_turns_in_the_other() {
    let t = shipped("land_vehicle");
    let yaw_rate = |s: f64| t.kinematics(s).omega_eb_b.z.abs();
    let rates = |from: f64| {
        (0..900)
            .map(move |k| from + 0.1 * f64::from(k))
            .map(yaw_rate)
    };
    assert!(rates(300.0).all(|rate| rate < 1e-5));
    let turning = rates(700.0).filter(|rate| *rate > 0.05).count();
    assert!(turning > 700, "turning for {} s of 90", turning / 10);
    let stands = |s: &u32| t.state(f64::from(*s)).v_n.length() < 1e-3;
    let standing = (0..900).filter(stands).count();
    assert!((100..200).contains(&standing), "standing for {standing} s");
}

#[test]
fn shipped_trajectories_close_and_the_error_falls_faster_than_dt_squared() {
    for name in SHIPPED {
        let t = shipped(name);
        let [slow, nominal, fast] = [50.0, 100.0, 200.0].map(|rate| closure(&t, rate));
        for c in [slow, nominal, fast] {
            assert!(c.within(&BOUNDS), "{name}: {c:?}");
        }
        let falls =
            |f: fn(&Closure) -> f64| f(&slow) / f(&nominal) > 4.0 && f(&nominal) / f(&fast) > 4.0;
        let all_fall =
            falls(|c| c.position_m) && falls(|c| c.velocity_m_s) && falls(|c| c.attitude_rad);
        assert!(all_fall, "{name}: {slow:?} {nominal:?} {fast:?}");
    }
}

#[test]
fn closure_holds_in_both_hemispheres_and_across_the_antimeridian() {
    for (name, lat_deg, lon_deg) in [
        ("land_vehicle", -46.5, 179.99),
        ("land_vehicle", 70.0, 179.999),
        ("figure_eight", -0.0005, 179.9995),
        ("fixed_wing", 62.0, 179.9),
        ("fixed_wing", 0.0, 179.95),
    ] {
        let t = moved(name, lat_deg, lon_deg);
        let lon: Vec<f64> = (0..900).map(|s| t.state(f64::from(s)).lon).collect();
        assert!(
            lon.iter().any(|l| *l > 0.0) && lon.iter().any(|l| *l < 0.0),
            "{name} does not cross ±180°"
        );
        let c = closure(&t, 100.0);
        assert!(c.within(&BOUNDS), "{name} from {lat_deg}, {lon_deg}: {c:?}");
    }
}

#[test]
fn too_slow_a_rate_for_the_rotation_is_refused() {
    let t = shipped("figure_eight");
    for (rate_hz, expected) in [(0.25, "the rate is too low"), (f64::NAN, "NaN Hz")] {
        let e = Closure::new(&t, rate_hz, GravityModel::Wgs84)
            .unwrap_err()
            .to_string();
        assert!(e.contains(expected), "{e}");
    }
}

/// Independent truth.
struct Truth {
    /// Through its states.
    trajectory: Trajectory,
    /// Its velocity at the start and at the end (m/s).
    v_n: [DVec3; 2],
    /// Its increments over 10 ms (rad, m/s).
    increments: Vec<(DVec3, DVec3)>,
}

fn truth() -> Truth {
    let path = root("tests/data/nav_40s_100hz.csv.gz");
    let (trajectory, warnings) = load(&path, None).unwrap();
    assert!(
        warnings.len() == 1 && warnings[0].contains(": columns not used: dtheta_x_rad"),
        "{warnings:?}"
    );
    let mut text = String::new();
    let file = std::fs::File::open(&path).unwrap();
    flate2::read::GzDecoder::new(file)
        .read_to_string(&mut text)
        .unwrap();
    let rows: Vec<Vec<f64>> = text
        .lines()
        .filter(|l| l.starts_with(|c: char| c.is_ascii_digit()))
        .map(|l| l.split(',').map(|c| c.parse().unwrap()).collect())
        .collect();
    let vector = |row: &[f64], at: usize| DVec3::from_slice(&row[at..at + 3]);
    let v_n = [&rows[0], &rows[rows.len() - 1]].map(|row| vector(row, 4));
    let increments = rows[1..]
        .iter()
        .map(|row| (vector(row, 10), vector(row, 13)))
        .collect();
    Truth {
        trajectory,
        v_n,
        increments,
    }
}

/// The ideal samples are the increments, to the rounding of the states they are made from: angles to 1e-9°
/// (σ = 5.0e-12 rad, √2 of it in a difference); positions to 1e-12° and 1e-6 m (σ = 3.2e-8 and 2.9e-7 m), of
/// which the slopes of a cubic spline differ by 1.879 σ/dt between neighbouring knots.
#[test]
fn ideal_samples_are_the_increments_of_independent_truth() {
    let Truth {
        trajectory,
        increments,
        ..
    } = truth();
    let samples = ideal_imu(&trajectory, 100.0, GravityModel::FirstOrder).unwrap();
    assert_eq!((samples.len(), increments.len()), (4000, 4000));
    let (mut angle, mut horizontal, mut vertical, mut count) = (0.0, 0.0, 0.0, 0.0);
    for (k, (s, (dtheta, dv))) in samples
        .iter()
        .zip(&increments)
        .enumerate()
        .skip(50)
        .take(3900)
    {
        let e = s.omega_ib_b * 0.01 - *dtheta;
        assert!(e.abs().max_element() < 3e-11, "row {k}: {e} rad");
        let q_b_n = trajectory.state(50.0 + 0.01 * (k as f64 + 0.5)).q_b_n;
        let f = q_b_n * (s.f_ib_b * 0.01 - *dv);
        assert!(
            f.truncate().abs().max_element() < 5.0 * 6.04e-6 && f.z.abs() < 5.0 * 5.42e-5,
            "row {k}: {f} m/s"
        );
        angle += e.length_squared() / 3.0;
        horizontal += f.truncate().length_squared() / 2.0;
        vertical += f.z * f.z;
        count += 1.0;
    }
    // 5 % above: three standard deviations of an rms over 3900 rows are 3.4 %.
    let rms = [angle, horizontal, vertical].map(|sum: f64| (sum / count).sqrt());
    assert!(
        rms[0] < 1.05 * 7.13e-12 && rms[1] < 1.05 * 5.19e-6 && rms[2] < 1.05 * 5.42e-5,
        "{rms:?}"
    );
}

/// Independent increments, mechanised, follow independent states. Sums of increments are increments of a
/// lower rate, so that the order of the algorithm shows on them too.
#[test]
fn mechanising_independent_increments_follows_independent_states() {
    let Truth {
        trajectory,
        v_n,
        increments,
    } = truth();
    let start = NavState {
        v_n: v_n[0],
        ..trajectory.state(50.0)
    };
    let end = |every: usize| {
        let mut ins = Strapdown::new(&start, GravityModel::FirstOrder);
        for chunk in increments.chunks_exact(every) {
            let (dtheta, dv) = chunk
                .iter()
                .fold((DVec3::ZERO, DVec3::ZERO), |(a, b), (x, y)| {
                    (a + *x, b + *y)
                });
            ins.step(Vec3::splat(dtheta), Vec3::splat(dv), 0.01 * every as f64);
        }
        let (state, truth) = (ins.lane(0), trajectory.state(90.0));
        let apart = ned_difference(truth.place(), state.place());
        let turned = 2.0 * (truth.q_b_n.conjugate() * state.q_b_n).xyz().length();
        (apart, (state.v_n - v_n[1]).length(), turned)
    };
    // The start is rounded to 1e-7 m, 1e-8 m/s, 2e-11 rad: 1e-6 m in 40 s. The rest is the algorithm's.
    let (p, v, a) = end(1);
    assert!(p.length() < 1e-4 && v < 1e-6 && a < 1e-8, "{p} {v} {a}");
    // Third order from 50 Hz to 12.5 Hz is 64, second order 16.
    let ((_, v, a), (_, v_slow, a_slow)) = (end(2), end(8));
    assert!(
        v_slow / v > 40.0 && a_slow / a > 40.0,
        "{} {}",
        v_slow / v,
        a_slow / a
    );
}
