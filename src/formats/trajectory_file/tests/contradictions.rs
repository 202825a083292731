//! Columns that contradict one another are told, and what they look like.

use super::*;

/// A drive in hills along changing courses with the velocities of its path, until columns are changed: time, north, east, down (m),
/// yaw (degrees), velocities north, east, down.
fn driven(header: &str, row: impl Fn([f64; 8]) -> [f64; 8]) -> Vec<String> {
    let mut text = format!("# origin: 46.5, 6.5, 400\n{header}\n");
    for k in 0..600 {
        let t = 0.5 * f64::from(k);
        // 10 m/s around a circle in 314 s, 20 m up and down in 125 s
        let (course, climb) = (0.02 * t, 0.05 * t);
        let place = [500.0 * course.sin(), 500.0 * (1.0 - course.cos()), 20.0 * climb.cos()];
        let velocity = [10.0 * course.cos(), 10.0 * course.sin(), -climb.sin()];
        let [t, n, e, d, yaw, vn, ve, vd] =
            row([t, place[0], place[1], place[2], course / DEG, velocity[0], velocity[1], velocity[2]]);
        let yaw = (yaw + 180.0).rem_euclid(360.0) - 180.0;
        text += &format!("{t},{n},{e},{d},0,0,{yaw},{vn},{ve},{vd}\n");
    }
    doubted(&text)
}

const NAMES: &str = "t_s,n_m,e_m,d_m,roll_deg,pitch_deg,yaw_deg,v_n_m_s,v_e_m_s,v_d_m_s";

fn said(row: fn([f64; 8]) -> [f64; 8], words: &str) {
    let found = driven(NAMES, row);
    assert!(found.iter().any(|text| text.contains(words)), "{words}: {found:?}");
}

#[test]
fn velocities_of_another_sign_order_or_unit_are_named() {
    assert_eq!(driven(NAMES, |row| row), [""; 0]);
    said(
        |[t, n, e, d, y, a, b, c]| [t, n, e, d, y, a, b, -c],
        "; v_d_m_s has the sign of a velocity up; the positions",
    );
    said(|[t, n, e, d, y, a, b, c]| [t, n, e, d, y, a, -b, c], "v_e_m_s has the sign of a velocity west");
    said(|[t, n, e, d, y, a, b, c]| [t, n, e, d, y, b, a, c], "v_n_m_s and v_e_m_s look exchanged");
    said(|[t, n, e, d, y, a, b, c]| [t, n, e, d, y, 3.6 * a, 3.6 * b, 3.6 * c], "look like km/h");
    said(
        |[t, n, e, d, y, ..]| [t, n, e, d, y, 0.0, 0.0, 0.0],
        "; v_n_m_s, v_e_m_s, v_d_m_s are zero throughout; the positions",
    );
    said(
        |[t, n, e, d, y, a, b, _]| [t, n, e, 3.0 * d, y, a, b, 0.0],
        "; v_d_m_s is zero throughout; the positions",
    );
    // a plane drive has no vertical velocity
    assert_eq!(driven(NAMES, |[t, n, e, _, y, a, b, _]| [t, n, e, 0.0, y, a, b, 0.0]), [""; 0]);
    // the name that the file has, and the other way round
    let up = NAMES.replace("v_d_m_s", "v_up_m_s");
    let found = driven(&up, |row| row);
    assert!(found.iter().any(|text| text.contains("v_up_m_s has the sign of a velocity down")), "{found:?}");
    // a slow vertical motion beside a fast one: nothing but the sign shows it
    let gentle = |[t, n, e, d, y, a, b, c]: [f64; 8]| [t, n, e, 0.2 * d, y, a, b, -0.2 * c];
    said(gentle, "v_d_m_s has the sign of a velocity up");
    // noise of a receiver at rest has no sign
    let noisy = |[t, n, e, _, y, a, b, c]: [f64; 8]| [t, n, e, 0.0, y, a, b, 0.05 * c];
    assert_eq!(driven(NAMES, noisy), [""; 0]);
}

#[test]
fn a_time_in_minutes_or_milliseconds_is_named() {
    said(|[t, n, e, d, y, a, b, c]| [t / 60.0, n, e, d, y, a, b, c], "the time looks like minutes");
    said(
        |[t, n, e, d, y, a, b, c]| [10.0 * t, n, e, d, y, 100.0 * a, 100.0 * b, 100.0 * c],
        "the time looks like milliseconds",
    );
    // without velocities: by the speed
    let without = |scale: f64| {
        let rows: String =
            (0..99).map(|k| format!("{},{},0,0\n", scale * f64::from(k), 10.0 * f64::from(k))).collect();
        doubted(&format!("# origin: 46.5, 6.5, 400\nt_s,n_m,e_m,d_m\n{rows}")).join("\n")
    };
    assert!(!without(1.0).contains("time in"), "{}", without(1.0));
    assert!(
        without(1.0 / 60.0).contains("600 m/s (median): is the time in minutes?"),
        "{}",
        without(1.0 / 60.0)
    );
    // rows of 10 m that are 20 apart: in milliseconds 500 m/s, no vehicle; 40 apart 250 m/s
    let fast = without(20.0);
    assert!(fast.contains("rows are 20 s apart") && !fast.contains("milliseconds"), "{fast}");
    let slow = without(40.0);
    assert!(slow.contains("or is the time in milliseconds (t_ms)?"), "{slow}");
}

#[test]
fn a_heading_that_is_turned_by_a_constant_angle_is_named() {
    said(
        |[t, n, e, d, y, a, b, c]| [t, n, e, d, y + 12.0, a, b, c],
        "yaw is 12.0° clockwise of the course wherever",
    );
    said(
        |[t, n, e, d, y, a, b, c]| [t, n, e, d, y - 40.0, a, b, c],
        "yaw is 40.0° anticlockwise of the course",
    );
    // crabbing in a wind from the west of 2 m/s: as far to the right as to the left
    let crabbing = |[t, n, e, d, y, a, b, c]: [f64; 8]| [t, n, e, d, y - 11.0 * (y * DEG).cos(), a, b, c];
    assert_eq!(driven(NAMES, crabbing), [""; 0]);
}

/// A heading that nobody filled in, or of something else; not that of a slow vehicle, nor one that slips by up to 40° either way.
#[test]
fn a_heading_without_a_relation_to_the_path_is_doubted() {
    said(
        |[t, n, e, d, _, a, b, c]| [t, n, e, d, 30.0, a, b, c],
        "yaw stays the same while the course turns: they are ",
    );
    said(
        |[t, n, e, d, _, a, b, c]| [t, n, e, d, 0.0, a, b, c],
        "yaw stays the same while the course turns: they are ",
    );
    // six times as fast as the course: all round in whichever convention
    said(
        |[t, n, e, d, _, a, b, c]| [t, n, e, d, 7.0 * t, a, b, c],
        "yaw does not turn with the course: they are 9",
    );
    let slow =
        |[t, n, e, d, _, a, b, c]: [f64; 8]| [t, 0.2 * n, 0.2 * e, 0.2 * d, 30.0, 0.2 * a, 0.2 * b, 0.2 * c];
    assert_eq!(driven(NAMES, slow), [""; 0]);
    let slipping = |[t, n, e, d, y, a, b, c]: [f64; 8]| [t, n, e, d, y + 40.0 * (0.05 * t).sin(), a, b, c];
    assert_eq!(driven(NAMES, slipping), [""; 0]);
}
