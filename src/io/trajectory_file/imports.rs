//! Trajectories of other tools: KF-GINS results, TUM.

use super::Options;
use super::samples::{Attitude, Rows, dictionary, local, origin, rows};
use crate::io::Failure as Error;
use crate::io::table::{Asked, Column, Dictionary, Numbers, Quantity, Table, parse};
use glam::{DQuat, DVec3};
use std::f64::consts::{FRAC_1_SQRT_2, PI};

/// The table of a text without a header.
fn bare(path: &str, text: &str, names: &[&str], dictionary: &Dictionary) -> Result<Table, Error> {
    let names: Vec<String> = names.iter().map(|name| (*name).to_owned()).collect();
    let asked = Asked {
        names: Some(&names),
        ..Asked::default()
    };
    parse(path, text, dictionary, &asked)
}

/// A KF-GINS navigation result or truth: week, seconds of week, latitude, longitude (deg), height (m), velocity
/// north, east, down (m/s), roll, pitch, yaw (deg), between blanks. Time is counted on from the first week.
pub(super) fn kf_gins(
    path: &str,
    text: &str,
    options: &Options,
    numbers: Numbers,
) -> Result<Rows, Error> {
    let names = [
        "week",
        "t_s",
        "lat_deg",
        "lon_deg",
        "h_m",
        "v_n_m_s",
        "v_e_m_s",
        "v_d_m_s",
        "roll_deg",
        "pitch_deg",
        "yaw_deg",
    ];
    rows(
        bare(path, text, &names, &dictionary(numbers))?,
        options,
        numbers,
    )
}

/// Quantities of a TUM file.
static TUM: [Quantity; 8] = [
    Quantity::time(&["t"]),
    Quantity::number("x", &["x"]),
    Quantity::number("y", &["y"]),
    Quantity::number("z", &["z"]),
    Quantity::number("qx", &["qx"]),
    Quantity::number("qy", &["qy"]),
    Quantity::number("qz", &["qz"]),
    Quantity::number("qw", &["qw"]),
];

/// A TUM file: time, x, y, z (m), quaternion x, y, z, w, between blanks. The axes are taken as ROS has them
/// (REP 103): position east, north, up of the origin; body forward, left, up.
pub(super) fn tum(
    path: &str,
    text: &str,
    options: &Options,
    numbers: Numbers,
) -> Result<Rows, Error> {
    let dictionary = Dictionary {
        quantities: &TUM,
        ..dictionary(numbers)
    };
    let names = ["t_s", "x", "y", "z", "qx", "qy", "qz", "qw"];
    let mut table = bare(path, text, &names, &dictionary)?;
    table.retain(|table, row| table.columns.iter().all(|c| c.values[row].is_finite()));
    let origin = origin(&table, options)?;
    // East-north-up to north-east-down, front-right-down to front-left-up: half turns.
    let q_enu_ned = DQuat::from_xyzw(FRAC_1_SQRT_2, FRAC_1_SQRT_2, 0.0, 0.0);
    let q_frd_flu = DQuat::from_rotation_x(PI);
    let mut samples = Vec::with_capacity(table.rows());
    for row in 0..table.rows() {
        let value = |column: &Column| column.si(row);
        let all: Vec<f64> = table.columns.iter().map(value).collect();
        let q_flu_enu = DQuat::from_slice(&all[4..]);
        if (q_flu_enu.length() - 1.0).abs() > 0.01 {
            let reason = "does not make a unit quaternion with the others";
            let line = table.line(row);
            return Err(Error::cell(path, line, "qw", all[7].to_string(), reason));
        }
        let r_ned = q_enu_ned * DVec3::from_slice(&all[1..4]);
        samples.push(local(
            all[0],
            origin,
            r_ned,
            q_enu_ned * q_flu_enu * q_frd_flu,
        ));
    }
    let lines = (0..table.rows()).map(|row| table.line(row)).collect();
    let mut rows = Rows::new(path, lines, samples, Attitude::Given);
    rows.doubt(
        None,
        "axes taken as ROS has them: position east, north, up; body forward, left, up",
    );
    Ok(rows)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::io::fusion_files::WEEK_S;
    use nav_sim_navigation::frames::RollPitchYaw;
    use nav_sim_navigation::trajectory::Trajectory;

    type Loaded = Result<(Trajectory, Vec<String>), Error>;

    fn nav(text: &str) -> Loaded {
        kf_gins("truth.nav", text, &Options::default(), Numbers::Finite)?.trajectory()
    }

    fn tum(path: &str, text: &str, options: &Options) -> Loaded {
        super::tum(path, text, options, Numbers::Finite)?.trajectory()
    }

    #[test]
    fn kf_gins_results_run_on_across_the_week() {
        let row = |k: i32| {
            let sow = 604_798.5 + 0.5 * f64::from(k);
            let (week, sow) = if sow >= WEEK_S {
                (2017, sow - WEEK_S)
            } else {
                (2016, sow)
            };
            let lon = 114.0 + 1e-4 * f64::from(k);
            format!("{week}  {sow:.3} 30.5 {lon:.6} 20.0 0.0 19.2 0.0 0.1 0.2 90.0\n")
        };
        let text: String = (0..9).map(row).collect();
        let (t, warnings) = nav(&text).unwrap();
        assert!(warnings.is_empty(), "{warnings:?}");
        assert_eq!((t.start_s(), t.end_s()), (604_798.5, 604_802.5));
        assert!(
            (t.state(604_800.0).v_n.y - 19.2).abs() < 0.02,
            "{}",
            t.state(604_800.0).v_n
        );
        let e = nav("2016 1 2 3\n").unwrap_err();
        assert_eq!(e.to_string(), "truth.nav, line 1: 4 values, but 11 columns");
    }

    /// East along x at 3 m/s, facing east (ROS: no rotation): heading 90°, level.
    #[test]
    fn tum_files_are_read_with_the_axes_of_ros() {
        let text: String = (0..6)
            .map(|k| format!("{k}.5 {} 0 0 0 0 0 1\n", 3 * k))
            .collect();
        let options = Options {
            origin: Some([0.8, 0.1, 50.0]),
        };
        let (t, warnings) = tum("a.tum", &text, &options).unwrap();
        assert!(warnings[0].contains("ROS"));
        let state = t.state(2.0);
        let rpy = RollPitchYaw::from_quat(state.q_b_n);
        assert!(
            (state.v_n - DVec3::Y * 3.0).length() < 1e-4,
            "{}",
            state.v_n
        );
        assert!(
            (rpy.yaw - 0.5 * PI).abs() < 1e-5 && rpy.roll.abs() < 1e-5 && rpy.pitch.abs() < 1e-5,
            "{rpy:?}"
        );
        let e = tum("a.tum", &text, &Options::default()).unwrap_err();
        assert!(
            e.to_string().contains("needs an origin on the Earth"),
            "{e}"
        );
        let e = tum("a.tum", "0 0 0 0 0 0 0 2\n", &options)
            .unwrap_err()
            .to_string();
        assert_eq!(
            e,
            "a.tum, line 1: column \"qw\": 2 does not make a unit quaternion with the others"
        );
    }
}
