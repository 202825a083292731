use super::*;
use crate::earth::{GravityModel, e_to_n, gravity_down, ned_difference, radii};
use crate::frames::{RollPitchYaw, wrap_angle};
use crate::units::{DEG, STANDARD_GRAVITY};
use glam::DVec3;

fn straight(by: Length) -> Segment {
    Segment {
        kind: SegmentKind::Straight(by),
        climb_m: 0.0,
        ramp_s: None,
    }
}

fn accelerate(to_speed: f64, by: Acceleration) -> Segment {
    Segment {
        kind: SegmentKind::Accelerate { to_speed, by },
        climb_m: 0.0,
        ramp_s: None,
    }
}

fn turn(angle_deg: f64, by: Turning) -> Segment {
    Segment {
        kind: SegmentKind::Turn {
            angle: angle_deg * DEG,
            by,
        },
        climb_m: 0.0,
        ramp_s: None,
    }
}

fn profile(speed: f64, segments: Vec<Segment>) -> Profile {
    let start = ProfileStart {
        t_s: 10.0,
        lat: 46.5 * DEG,
        lon: 6.6 * DEG,
        h: 400.0,
        heading: 30.0 * DEG,
        speed,
    };
    Profile {
        start,
        bank: Bank::None,
        ramp_s: 1.0,
        segments,
    }
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
    let t = profile(20.0, vec![straight(Length::Distance(1000.0))])
        .build()
        .unwrap();
    assert_eq!((t.start_s(), t.end_s()), (10.0, 60.0));
    let (start, end) = (t.state(10.0), t.state(60.0));
    let moved = ned_difference(start.place(), end.place());
    // Loxodrome against radii at its start: 1000² tan(lat)/(2 R) = 0.08 m.
    assert!(
        (moved - DVec3::new(30.0_f64.to_radians().cos(), 0.5, 0.0) * 1000.0).length() < 0.15,
        "{moved}"
    );
    // Positions in e are rounded to 1e-9 m, 0.02 s apart.
    assert!(moved.z.abs() < 1e-8 && (t.state(37.3).v_n.length() - 20.0).abs() < 1e-7);
}

#[test]
fn acceleration_keeps_its_limit_and_reaches_its_speed() {
    let t = profile(
        0.0,
        vec![
            accelerate(25.0, Acceleration::Peak(2.0)),
            accelerate(5.0, Acceleration::Duration(12.0)),
        ],
    )
    .build()
    .unwrap();
    assert!((t.end_s() - (10.0 + 13.5 + 12.0)).abs() < 1e-12); // Δv/a + ramp
    assert!(
        (feel(&t, 23.5).0 - 25.0).abs() < 1e-5,
        "{}",
        feel(&t, 23.5).0 - 25.0
    );
    assert!(
        (feel(&t, t.end_s()).0 - 5.0).abs() < 1e-5,
        "{}",
        feel(&t, t.end_s()).0 - 5.0
    );
    // Beside the curvature of the Earth, v²/R = 1e-4 m/s², all of it is along the track.
    assert!((largest(&t, |s| feel(&t, s).1.x) - 2.0).abs() < 1e-4);
    assert!(largest(&t, |s| feel(&t, s).1.y.abs()) < 2e-4);
}

#[test]
fn turns_end_where_they_should_whatever_limits_them() {
    for (by, duration) in [
        (Turning::Duration(14.0), 14.0),
        (Turning::Rate(10.0 * DEG), 10.0),
        (Turning::Radius(60.0), 90.0 * DEG * 6.0 + 1.0),
        (Turning::LateralAccel(2.0), 90.0 * DEG * 5.0 + 1.0),
    ] {
        let t = profile(10.0, vec![turn(-90.0, by), straight(Length::Duration(1.0))])
            .build()
            .unwrap();
        assert!((t.end_s() - 11.0 - duration).abs() < 1e-9);
        assert!((feel(&t, t.end_s()).2.yaw / DEG + 60.0).abs() < 1e-10);
        let lateral = largest(&t, |s| -feel(&t, s).1.y);
        let expected = 10.0 * 90.0 * DEG / (duration - 1.0);
        assert!(
            (lateral - expected).abs() < 1e-3,
            "{by:?}: {lateral} {expected}"
        );
    }
}

#[test]
fn height_changes_by_what_was_asked_and_pitch_is_the_slope() {
    let mut hill = straight(Length::Duration(20.0));
    hill.climb_m = -15.0;
    let t = profile(10.0, vec![hill]).build().unwrap();
    assert!((t.state(t.end_s()).h - 385.0).abs() < 1e-8);
    assert!((largest(&t, |s| feel(&t, s).2.pitch.abs()).sin() - 15.0 / 200.0 / 0.95).abs() < 1e-6);
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
    let mut p = profile(40.0, vec![turn(120.0, Turning::Rate(10.0 * DEG))]);
    (p.bank, p.ramp_s) = (Bank::Coordinated, 3.0);
    let t = p.build().unwrap();
    let middle = 0.5 * (t.start_s() + t.end_s());
    assert!((feel(&t, middle).2.roll - (40.0 * 10.0 * DEG / STANDARD_GRAVITY).atan()).abs() < 1e-6);
    let lateral = largest(&t, |s| {
        let (_, a_b, _) = feel(&t, s);
        let state = t.state(s);
        let g_n = DVec3::Z * gravity_down(GravityModel::Wgs84, state.lat.sin(), state.h);
        (a_b - state.q_b_n.conjugate() * g_n).y.abs()
    });
    assert!(lateral < 2.0 * 3.8e-4, "{lateral}");
}

/// The acceleration of the spline never jumps: its change over 5 ms is what the jerk allows, peak rate of
/// a quintic ramp 1.875 · 3 m/s² / 1 s, plus a turn's.
#[test]
fn acceleration_and_rate_are_continuous_over_a_stop_and_go_drive() {
    let stop = Segment {
        kind: SegmentKind::Stop {
            duration: 5.0,
            decel: 3.0,
        },
        climb_m: 0.0,
        ramp_s: None,
    };
    let segments = vec![
        accelerate(15.0, Acceleration::Peak(3.0)),
        turn(60.0, Turning::LateralAccel(3.0)),
        stop,
        accelerate(8.0, Acceleration::Peak(3.0)),
    ];
    let t = profile(0.0, segments).build().unwrap();
    let n = ((t.end_s() - t.start_s()) / 0.005) as usize;
    let kinematics_after = |k: usize| t.kinematics(t.start_s() + 0.005 * k as f64);
    let jump = (1..=n)
        .map(|k| (kinematics_after(k).a_e - kinematics_after(k - 1).a_e).length())
        .fold(0.0, f64::max);
    let rate = (1..=n)
        .map(|k| (kinematics_after(k).omega_eb_b - kinematics_after(k - 1).omega_eb_b).length())
        .fold(0.0, f64::max);
    assert!(jump < 1.875 * 3.0 * 0.005 * 1.05, "{jump}");
    assert!(rate < 1.875 * 3.0 / 15.0 * 0.005 * 1.05, "{rate}");
    // It stands still while it stands still.
    let rest = t.kinematics(10.0 + 6.0 + 5.24 + 1.0 + 6.0 + 2.0);
    assert!(rest.v_e.length() < 1e-9, "{}", rest.v_e.length());
}

#[test]
fn waypoints_are_met_at_the_end_and_passed_inside_before() {
    let local = |north: f64, east: f64, h: Option<f64>| Waypoint {
        place: HorizontalPosition::Local { north, east },
        h,
    };
    for (lat_deg, lon_deg) in [(46.5, 6.6), (-60.0, 179.99)] {
        let points = vec![
            local(2000.0, 0.0, None),
            local(2000.0, 3000.0, Some(700.0)),
            local(-500.0, 2500.0, None),
        ];
        let by = Turning::LateralAccel(3.0);
        let segment = Segment {
            kind: SegmentKind::Waypoints { points, by },
            climb_m: 0.0,
            ramp_s: Some(2.0),
        };
        let mut p = profile(30.0, vec![segment]);
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
        assert!(
            (place(t.end_s()) - DVec3::new(-500.0, 2500.0, 700.0)).length() < 5e-3,
            "{}",
            place(t.end_s())
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
    let refused = |speed: f64, segment: Segment| {
        profile(speed, vec![segment])
            .build()
            .unwrap_err()
            .to_string()
    };
    let straight_s = |s| straight(Length::Duration(s));
    assert_eq!(
        refused(1.0, straight_s(1e300)),
        "segment 1: \"duration_s\" makes the trajectory 1.000e300 s long: over a day"
    );
    assert_eq!(
        refused(2.0, straight(Length::Distance(1e300))),
        "segment 1: \"distance_m\" makes the trajectory 5.000e299 s long: over a day"
    );
    assert_eq!(
        refused(0.0, straight(Length::Distance(5.0))),
        "segment 1: \"distance_m\" needs a moving vehicle, which stands still here"
    );
    assert_eq!(
        refused(0.0, turn(10.0, Turning::Radius(5.0))),
        "segment 1: \"radius_m\" needs a moving vehicle, which stands still here"
    );
    assert_eq!(
        refused(
            5.0,
            Segment {
                climb_m: 50.0,
                ..straight_s(10.0)
            }
        ),
        "segment 1: \"climb_m\" is too steep: 50 m over 50.0 m of path climbs more than 60°"
    );
    assert_eq!(
        refused(5.0, turn(10_000.0, Turning::Duration(1.0))),
        "start: \"segment\" gives no trajectory: attitude turns 65.4° between 10.14 s and 10.16 s: more than 60°"
    );
    let waypoints = |north, east| {
        let points = vec![
            Waypoint {
                place: HorizontalPosition::Local { north, east },
                h: None,
            },
            Waypoint {
                place: HorizontalPosition::Local {
                    north: 2.0 * north,
                    east: 0.0,
                },
                h: None,
            },
        ];
        Segment {
            kind: SegmentKind::Waypoints {
                points,
                by: Turning::Radius(30.0),
            },
            climb_m: 0.0,
            ramp_s: None,
        }
    };
    assert_eq!(
        refused(10.0, waypoints(2.0, 5.0)),
        "segment 1: \"points\" has waypoint 1 inside the turning circle"
    );
    assert_eq!(
        refused(10.0, waypoints(0.0, 200.0)),
        "segment 1: \"points\" turns back by 173° at waypoint 1: more than 150°"
    );
    assert_eq!(
        refused(10.0, waypoints(40.0, 60.0)),
        "segment 1: \"points\" has waypoint 1 too near: 46.5 m away, the turns take 55.4 m"
    );
    assert!(refused(0.0, waypoints(100.0, 0.0)).contains("\"points\" needs a moving vehicle"));
    let mut p = profile(5.0, Vec::new());
    assert_eq!(
        p.build().unwrap_err().to_string(),
        "start: \"segment\" is not a list of at least one segment"
    );
    p.segments.push(straight_s(1.0));
    p.start.lat = f64::NAN;
    assert_eq!(
        p.build().unwrap_err().to_string(),
        "start: \"lat_deg\" is not a latitude within ±89.9°"
    );
}
