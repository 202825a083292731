use super::*;
use crate::earth::{e_to_n, gravity_down, ned_difference};
use crate::frames::wrap_angle;
use crate::tests::*;
use crate::units::STANDARD_GRAVITY;

/// From 10 s on, with ramps of a second.
fn profile(speed: f64, segments: &str) -> Profile {
    let mut profile = crate::tests::profile(speed, segments);
    (profile.start.t_s, profile.ramp_s) = (10.0, 1.0);
    profile
}

fn built(speed: f64, segments: &str) -> Trajectory {
    profile(speed, segments).build().unwrap()
}

/// Speed, acceleration along and across the track (m/s²), and angles at an instant.
fn feel(t: &Trajectory, t_s: f64) -> (f64, DVec3, RollPitchYaw) {
    let state = t.state(t_s);
    let a_n = e_to_n(state.lat, state.lon, t.kinematics(t_s).a_e);
    (
        state.v_n.length(),
        state.q_b_n.conjugate() * a_n,
        RollPitchYaw::from_quat(state.q_b_n),
    )
}

fn largest(t: &Trajectory, f: impl Fn(f64) -> f64) -> f64 {
    let n = ((t.end_s() - t.start_s()) * 50.0) as usize;
    (0..=n)
        .map(|k| f(t.start_s() + k as f64 / 50.0))
        .fold(0.0, f64::max)
}

#[test]
fn a_straight_covers_its_distance_in_its_direction() {
    let t = built(20.0, "{ kind = 'straight', distance_m = 1000 }");
    assert_eq!((t.start_s(), t.end_s()), (10.0, 60.0));
    let (start, end) = (t.state(10.0), t.state(60.0));
    let moved = ned_difference(start.place(), end.place());
    // Loxodrome against radii at its start: 1000² tan(lat)/(2 R) = 0.08 m.
    let (north, east) = ((40.0 * DEG).cos(), (40.0 * DEG).sin());
    assert!(
        (moved - DVec3::new(north, east, 0.0) * 1000.0).length() < 0.15,
        "{moved}"
    );
    // Positions in e are rounded to 1e-9 m, 0.02 s apart.
    assert!(moved.z.abs() < 1e-8 && (t.state(37.3).v_n.length() - 20.0).abs() < 1e-7);
}

#[test]
fn acceleration_keeps_its_limit_and_reaches_its_speed() {
    let t = built(
        0.0,
        "{ kind = 'accelerate', to_speed_m_s = 25, accel_m_s2 = 2 },
        { kind = 'accelerate', to_speed_m_s = 5, duration_s = 12 }",
    );
    assert_abs_diff_eq!(t.end_s(), 10.0 + 13.5 + 12.0, epsilon = 1e-12); // Δv/a + ramp
    // what the spline of step 0.02 s makes of the speed (m/s)
    assert_abs_diff_eq!(feel(&t, 23.5).0, 25.0, epsilon = 1e-5);
    assert_abs_diff_eq!(feel(&t, t.end_s()).0, 5.0, epsilon = 1e-5);
    // Beside the curvature of the Earth, v²/R = 1e-4 m/s², all of it is along the track.
    assert_abs_diff_eq!(largest(&t, |s| feel(&t, s).1.x), 2.0, epsilon = 1e-4);
    assert!(largest(&t, |s| feel(&t, s).1.y.abs()) < 2e-4);
}

#[test]
fn turns_end_where_they_should_whatever_limits_them() {
    for (by, duration) in [
        ("duration_s = 14", 14.0),
        ("rate_deg_s = 10", 10.0),
        ("radius_m = 60", 90.0 * DEG * 6.0 + 1.0),
        ("lateral_accel_m_s2 = 2", 90.0 * DEG * 5.0 + 1.0),
    ] {
        let turn = format!("{{ kind = 'turn', angle_deg = -90, {by} }}");
        let t = built(10.0, &(turn + ", { kind = 'straight', duration_s = 1 }"));
        assert_abs_diff_eq!(t.end_s(), 11.0 + duration, epsilon = 1e-9);
        assert_abs_diff_eq!(feel(&t, t.end_s()).2.yaw / DEG, -50.0, epsilon = 1e-10);
        let lateral = largest(&t, |s| -feel(&t, s).1.y);
        let expected = 10.0 * 90.0 * DEG / (duration - 1.0);
        assert!(
            (lateral - expected).abs() < 1e-3,
            "{by}: {lateral} {expected}"
        );
    }
}

#[test]
fn height_changes_by_what_was_asked_and_pitch_is_the_slope() {
    let t = built(
        10.0,
        "{ kind = 'straight', duration_s = 20, climb_m = -15 }",
    );
    assert_abs_diff_eq!(t.state(t.end_s()).h, 385.0, epsilon = 1e-8);
    assert_abs_diff_eq!(
        largest(&t, |s| feel(&t, s).2.pitch.abs()).sin(),
        15.0 / 200.0 / 0.95,
        epsilon = 1e-6
    );
    for s in [12.0, 17.7, 25.0] {
        let (speed, _, rpy) = feel(&t, s);
        assert!(
            (t.state(s).v_n.z + speed * rpy.pitch.sin()).abs() < 1e-6
                && (speed - 10.0).abs() < 1e-6
        );
    }
}

/// In a coordinated turn the specific force has no lateral component, but for what a spline of step
/// h = 0.02 s makes of a lateral acceleration a that builds up in 3 s: (1/8 + 1/12) h² max a″ with
/// a″ = 5.77 · 7 m/s² / (3 s)², doubled where a‴ jumps.
#[test]
fn coordinated_turns_bank() {
    let mut p = profile(40.0, "{ kind = 'turn', angle_deg = 120, rate_deg_s = 10 }");
    (p.bank, p.ramp_s) = (Bank::Coordinated, 3.0);
    let t = p.build().unwrap();
    let middle = 0.5 * (t.start_s() + t.end_s());
    assert_abs_diff_eq!(
        feel(&t, middle).2.roll,
        (40.0 * 10.0 * DEG / STANDARD_GRAVITY).atan(),
        epsilon = 1e-6
    );
    let lateral = largest(&t, |s| {
        let (_, a_b, _) = feel(&t, s);
        let state = t.state(s);
        let g_n = DVec3::Z * gravity_down(GravityModel::Wgs84, state.lat.sin(), state.h);
        (a_b - state.q_b_n.conjugate() * g_n).y.abs()
    });
    assert!(lateral < 2.0 * 3.8e-4, "{lateral}");
}

#[test]
fn acceleration_and_rate_are_continuous_over_a_stop_and_go_drive() {
    let t = built(
        0.0,
        "{ kind = 'accelerate', to_speed_m_s = 15, accel_m_s2 = 3 },
        { kind = 'turn', angle_deg = 60, lateral_accel_m_s2 = 3 },
        { kind = 'stop', duration_s = 5, decel_m_s2 = 3 },
        { kind = 'accelerate', to_speed_m_s = 8, accel_m_s2 = 3 }",
    );
    let n = ((t.end_s() - t.start_s()) / 0.005) as usize;
    let after = |k: usize| t.kinematics(t.start_s() + 0.005 * k as f64);
    let largest = |change: &dyn Fn(
        &crate::trajectory::Kinematics,
        &crate::trajectory::Kinematics,
    ) -> DVec3| {
        let of = |k| change(&after(k), &after(k - 1)).length();
        (1..=n).map(of).fold(0.0, f64::max)
    };
    let jump = largest(&|now, before| now.a_e - before.a_e);
    let rate = largest(&|now, before| now.omega_eb_b - before.omega_eb_b);
    assert!(jump < 1.875 * 3.0 * 0.005 * 1.05, "{jump}");
    assert!(rate < 1.875 * 3.0 / 15.0 * 0.005 * 1.05, "{rate}");
    // It stands still while it stands still.
    let rest = t.kinematics(10.0 + 6.0 + 5.24 + 1.0 + 6.0 + 2.0);
    assert!(rest.v_e.length() < 1e-9, "{}", rest.v_e.length());
}

#[test]
fn waypoints_are_met_at_the_end_and_passed_inside_before() {
    for (lat_deg, lon_deg) in [(46.5, 6.6), (-60.0, 179.99)] {
        let mut p = profile(
            30.0,
            "{ kind = 'waypoints', lateral_accel_m_s2 = 3, ramp_s = 2, points = [
                { n_m = 2000, e_m = 0 },
                { n_m = 2000, e_m = 3000, h_m = 700 },
                { n_m = -500, e_m = 2500 },
            ] }",
        );
        (p.start.lat, p.start.lon) = (lat_deg * DEG, lon_deg * DEG);
        let t = p.build().unwrap();
        let place = |s: f64| {
            let (state, r) = (t.state(s), radii(p.start.lat.sin()));
            let east =
                wrap_angle(state.lon - p.start.lon) * (r.transverse + 400.0) * p.start.lat.cos();
            DVec3::new(
                (state.lat - p.start.lat) * (r.meridian + 400.0),
                east,
                state.h,
            )
        };
        let end = place(t.end_s());
        assert!(
            (end - DVec3::new(-500.0, 2500.0, 700.0)).length() < 5e-3,
            "{end}"
        );
        for corner in [
            DVec3::new(2000.0, 0.0, 400.0),
            DVec3::new(2000.0, 3000.0, 700.0),
        ] {
            let nearest = -largest(&t, |s| 1e6 - (place(s) - corner).length()) + 1e6;
            // A circle of radius v²/a = 300 m cuts a right corner by r (√2 − 1) = 124 m; ramps cut more.
            assert!(nearest > 50.0 && nearest < 200.0, "{nearest}");
        }
        assert!(largest(&t, |s| feel(&t, s).1.y.abs()) < 3.01);
    }
}

#[test]
fn what_cannot_be_followed_is_refused() {
    let profile = |speed: f64, segments: &str| {
        let mut profile = profile(speed, segments);
        profile.start.heading = 30.0 * DEG;
        profile
    };
    let refused = |profile: &Profile| profile.build().unwrap_err().to_string();
    let waypoints = |north: f64, east: f64| {
        let (a, b) = (
            format!("n_m = {north}, e_m = {east}"),
            format!("n_m = {}, e_m = 0", 2.0 * north),
        );
        format!("{{ kind = 'waypoints', radius_m = 30, points = [{{ {a} }}, {{ {b} }}] }}")
    };
    for (speed, segment, expected) in [
        (
            1.0,
            "{ kind = 'straight', duration_s = 1e300 }",
            "\"duration_s\" makes the trajectory 1.000e300 s long: over a day",
        ),
        (
            2.0,
            "{ kind = 'straight', distance_m = 1e300 }",
            "\"distance_m\" makes the trajectory 5.000e299 s long: over a day",
        ),
        (
            0.0,
            "{ kind = 'straight', distance_m = 5 }",
            "\"distance_m\" needs a moving vehicle, which stands still here",
        ),
        (
            0.0,
            "{ kind = 'turn', angle_deg = 10, radius_m = 5 }",
            "\"radius_m\" needs a moving vehicle, which stands still here",
        ),
        (
            5.0,
            "{ kind = 'straight', duration_s = 10, climb_m = 50 }",
            "\"climb_m\" is too steep: 50 m over 50.0 m of path climbs more than 60°",
        ),
        (
            10.0,
            &waypoints(2.0, 5.0),
            "\"points\" has waypoint 1 inside the turning circle",
        ),
        (
            10.0,
            &waypoints(0.0, 200.0),
            "\"points\" turns back by 173° at waypoint 1: more than 150°",
        ),
        (
            10.0,
            &waypoints(40.0, 60.0),
            "\"points\" has waypoint 1 too near: 46.5 m away, the turns take 55.4 m",
        ),
        (
            0.0,
            &waypoints(100.0, 0.0),
            "\"points\" needs a moving vehicle, which stands still here",
        ),
    ] {
        assert_eq!(
            refused(&profile(speed, segment)),
            format!("segment 1: {expected}")
        );
    }
    let fast = profile(5.0, "{ kind = 'turn', angle_deg = 10000, duration_s = 1 }");
    let lost = Profile {
        start: ProfileStart {
            lat: f64::NAN,
            ..fast.start
        },
        ..fast.clone()
    };
    for (profile, expected) in [
        (
            fast,
            "\"segment\" gives no trajectory: attitude turns 65.4° between 10.14 s and 10.16 s: more than 60°",
        ),
        (
            profile(5.0, ""),
            "\"segment\" is not a list of at least one segment",
        ),
        (lost, "\"lat_deg\" is not a latitude within ±89.9°"),
    ] {
        assert_eq!(refused(&profile), format!("start: {expected}"));
    }
}
