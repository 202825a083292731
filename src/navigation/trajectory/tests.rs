use super::*;
use crate::earth::E2;
use crate::tests::*;

fn resting() -> Vec<TrajectorySample> {
    through(5, 1.0, |_| (46.0, 7.0, 400.0, [1.0, -2.0, 200.0]))
}

/// Samples of latitude, longitude, height, and roll, pitch and yaw, all angles in degrees.
fn through(
    n: u32,
    dt_s: f64,
    at: impl Fn(f64) -> (f64, f64, f64, [f64; 3]),
) -> Vec<TrajectorySample> {
    samples(n, dt_s, |t_s| {
        let (lat_deg, lon_deg, h, rpy_deg) = at(t_s);
        let [roll, pitch, yaw] = rpy_deg.map(|a| a * DEG);
        let q_b_n = RollPitchYaw { roll, pitch, yaw }.to_quat();
        (lat_deg * DEG, lon_deg * DEG, h, q_b_n)
    })
}

#[test]
fn samples_are_met_and_a_resting_vehicle_rests() {
    let trajectory = Trajectory::from_samples(&resting()).unwrap();
    assert_eq!((trajectory.start_s(), trajectory.end_s()), (0.0, 5.0));
    let state = trajectory.state(2.4);
    let rpy = RollPitchYaw::from_quat(state.q_b_n);
    assert!((state.lat / DEG - 46.0).abs() < 1e-13 && (state.h - 400.0).abs() < 2e-9);
    assert!((rpy.roll / DEG - 1.0).abs() < 1e-12 && (rpy.yaw / DEG + 160.0).abs() < 1e-12);
    assert!(state.v_n.length() < 1e-12 && trajectory.kinematics(2.4).omega_eb_b.length() < 1e-14);
}

/// Due east along a parallel across ±180°, in both hemispheres, level and heading east: closed form.
#[test]
fn east_along_a_parallel_across_the_antimeridian() {
    for lat_deg in [-37.0, 52.0] {
        let rate_deg_s = 1e-3;
        let samples = through(60, 1.0, |t_s| {
            (lat_deg, 179.97 + rate_deg_s * t_s, 1000.0, [0.0, 0.0, 90.0])
        });
        let trajectory = Trajectory::from_samples(&samples).unwrap();
        let (s, c) = (lat_deg * DEG).sin_cos();
        let rho = (radii(s).transverse + 1000.0) * c;
        for t_s in [0.0, 10.3, 29.95, 30.0, 44.4, 60.0] {
            let state = trajectory.state(t_s);
            let lon_deg = 179.97 + rate_deg_s * t_s;
            let wrapped = if lon_deg > 180.0 {
                lon_deg - 360.0
            } else {
                lon_deg
            };
            assert!((state.lon / DEG - wrapped).abs() < 1e-11 || (lon_deg - 180.0).abs() < 1e-12);
            assert!((state.v_n - DVec3::Y * rho * rate_deg_s * DEG).length() < 1e-8);
            assert!((state.lat / DEG - lat_deg).abs() < 1e-13 && (state.h - 1000.0).abs() < 1e-8);
            // The body turns with n: omega_en_n, heading east it is (east, −north, down) in b.
            let omega_en_n = crate::earth::omega_en_n(state.lat, state.h, state.v_n);
            let expected = DVec3::new(omega_en_n.y, -omega_en_n.x, omega_en_n.z);
            assert!((trajectory.kinematics(t_s).omega_eb_b - expected).length() < 1e-14);
        }
    }
}

/// North along a meridian at a constant latitude rate: v = (R_N + h) lat', and along the track the
/// acceleration dR_N/dlat lat'², vertically −v²/(R_N + h).
#[test]
fn north_along_a_meridian() {
    let rate = 2e-3 * DEG;
    let samples = through(60, 1.0, |t_s| (45.0 + 2e-3 * t_s, -120.0, 0.0, [0.0; 3]));
    let trajectory = Trajectory::from_samples(&samples).unwrap();
    let (t_s, lat) = (31.7, (45.0 + 2e-3 * 31.7) * DEG);
    let meridian = radii(lat.sin()).meridian;
    let state = trajectory.state(t_s);
    assert!((state.v_n - DVec3::X * meridian * rate).length() < 1e-7);
    let a_n = e_to_n(state.lat, state.lon, trajectory.kinematics(t_s).a_e);
    let along =
        3.0 * E2 * lat.sin() * lat.cos() * meridian / (1.0 - E2 * lat.sin().powi(2)) * rate * rate;
    let expected = DVec3::new(along, 0.0, meridian * rate * rate);
    assert!((a_n - expected).length() < 1e-8, "{a_n} {expected}");
}

/// A constant turn about a tilted axis through yaw ±180° and through pitch 90°: the rate of the spline is
/// the rate of the motion up to fourth order: (ω h/2)⁴/… below 1e-6 relative at 5° a sample.
#[test]
fn constant_rotation_through_every_attitude() {
    let rate = DVec3::new(0.3, 0.4, -0.2) * (50.0 * DEG / DVec3::new(0.3, 0.4, -0.2).length());
    let mut samples = samples(200, 0.1, |t_s| {
        (
            -33.0 * DEG,
            151.0 * DEG,
            20.0,
            DQuat::from_scaled_axis(rate * t_s),
        )
    });
    // Either sign of a quaternion is the same attitude.
    samples
        .iter_mut()
        .step_by(3)
        .for_each(|s| s.q_b_n = -s.q_b_n);
    let trajectory = Trajectory::from_samples(&samples).unwrap();
    for k in 0..=1000 {
        let t_s = 0.02 * f64::from(k);
        assert!((trajectory.kinematics(t_s).omega_eb_b - rate).length() < 2e-5 * rate.length());
        let error = trajectory.state(t_s).q_b_n * DQuat::from_scaled_axis(rate * t_s).conjugate();
        assert!(error.xyz().length() * 2.0 < 1e-6);
    }
}

/// The derivatives are the derivatives: central differences of position, velocity and attitude.
#[test]
fn kinematics_agree_with_central_differences() {
    let samples = through(30, 1.0, |t| {
        let wave = (0.4 * t).sin();
        let rpy_deg = [5.0 * wave, -3.0 * wave, 20.0 * t];
        (
            46.0 + 1e-4 * wave,
            7.0 + 2e-4 * t,
            400.0 + 3.0 * wave,
            rpy_deg,
        )
    });
    let trajectory = Trajectory::from_samples(&samples).unwrap();
    let step = 1e-3;
    for t_s in [0.6, 13.2, 22.9] {
        let [before, now, after] = [t_s - step, t_s, t_s + step].map(|t| trajectory.kinematics(t));
        // Rounding of positions in e: 1e-9 m / 2e-3 s.
        assert!((now.v_e - (after.r_e - before.r_e) / (2.0 * step)).length() < 2e-6);
        assert!((now.a_e - (after.v_e - before.v_e) / (2.0 * step)).length() < 1e-9);
        let turn = (before.q_b_e.conjugate() * after.q_b_e).to_scaled_axis() / (2.0 * step);
        assert!(
            (now.omega_eb_b - turn).length() < 1e-6,
            "{} {turn}",
            now.omega_eb_b
        );
    }
}

#[test]
fn unusable_samples_are_refused_by_name() {
    type Change = fn(&mut [TrajectorySample]);
    let cases: [(Change, &str); 6] = [
        (
            |s| s[4].t_s = 2.5,
            "time goes from 3 s to 2.5 s: it must increase",
        ),
        (
            |s| s[4].t_s = 3.0,
            "time goes from 3 s to 3 s: it must increase",
        ),
        (|s| s[2].h = f64::NAN, "h = NaN is not a finite number"),
        (
            |s| s[5].lat = 89.95 * DEG,
            "latitude 89.95° at 5 s is beyond ±89.9°",
        ),
        (
            |s| s[3].q_b_n = DQuat::from_rotation_z(61.0 * DEG) * s[3].q_b_n,
            "attitude turns 61.0° between 2 s and 3 s: more than 60°",
        ),
        (
            |s| s[3].q_b_n = DQuat::from_xyzw(0.0, 0.0, 0.0, 0.0),
            "attitude = 0 is not a finite number",
        ),
    ];
    let refused = |samples: &[TrajectorySample]| Trajectory::from_samples(samples).unwrap_err();
    for (change, expected) in cases {
        let mut samples = resting();
        change(&mut samples);
        assert_eq!(refused(&samples).to_string(), expected);
    }
    let expected = "3 samples: a trajectory needs at least 4";
    assert_eq!(refused(&resting()[..3]).to_string(), expected);
}

#[test]
fn what_is_left_of_a_trajectory_is_the_same_motion() {
    let turning = through(39, 1.0, |t| {
        (
            45.0 + 1e-4 * t,
            7.0 + 1e-6 * t * t,
            100.0,
            [0.0, 1.0, 3.0 * t],
        )
    });
    let whole = Trajectory::from_samples(&turning).unwrap();
    let part = whole.until(20.5);
    assert_eq!((part.start_s(), part.end_s()), (0.0, 21.0));
    assert_eq!(whole.until(99.0).end_s(), 39.0);
    for i in 0..=210 {
        let t_s = 0.1 * f64::from(i);
        assert_eq!(part.kinematics(t_s), whole.kinematics(t_s), "{t_s} s");
    }
}
