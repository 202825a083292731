//! Trajectories of other tools: KF-GINS results, TUM, motion definitions of gnss-ins-sim.

use super::Options;
use super::samples::{Attitude, Rows, local};
use super::table::{Numbers, Table, no_rows};
use crate::formats::FileError as Error;
use glam::{DQuat, DVec3};
use nav_sim_navigation::trajectory::TrajectorySample;
use nav_sim_navigation::trajectory::import::{BodyMotion, Command};
use nav_sim_signal::units::DEG;
use std::f64::consts::{FRAC_1_SQRT_2, PI};

/// Seconds of a GNSS week.
const WEEK_S: f64 = 604_800.0;

/// Longest motion definition (s).
const DAY_S: f64 = 86_400.0;

/// A KF-GINS navigation result or truth: week, seconds of week, latitude, longitude (deg), height (m), velocity
/// north, east, down (m/s), roll, pitch, yaw (deg), between blanks. Read as our own table, time counted on
/// from the first week.
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
    let mut table = Table::read(path, text.as_bytes(), Some(&names), numbers)?;
    let first = table.rows[0].1[0];
    for (_, row) in &mut table.rows {
        let week = row.remove(0);
        row[0] += (week - first) * WEEK_S;
    }
    table.columns.remove(0);
    super::samples::rows(table, options, numbers)
}

/// A TUM file: time, x, y, z (m), quaternion x, y, z, w, between blanks. The axes are taken as ROS has them
/// (REP 103): position east, north, up of the origin; body forward, left, up.
pub(super) fn tum(
    path: &str,
    text: &str,
    options: &Options,
    numbers: Numbers,
) -> Result<Rows, Error> {
    let names = ["t_s", "x", "y", "z", "qx", "qy", "qz", "qw"];
    let mut table = Table::read(path, text.as_bytes(), Some(&names), numbers)?;
    table
        .rows
        .retain(|(_, row)| row.iter().all(|x| x.is_finite()));
    let origin = super::samples::origin(&table, options)?;
    // East-north-up to north-east-down, front-right-down to front-left-up: half turns.
    let q_enu_ned = DQuat::from_xyzw(FRAC_1_SQRT_2, FRAC_1_SQRT_2, 0.0, 0.0);
    let q_frd_flu = DQuat::from_rotation_x(PI);
    let mut samples = Vec::with_capacity(table.rows.len());
    for (line, row) in &table.rows {
        let q_flu_enu = DQuat::from_xyzw(row[4], row[5], row[6], row[7]);
        if (q_flu_enu.length() - 1.0).abs() > 0.01 {
            return Err(table.cell(
                *line,
                7,
                &row[7].to_string(),
                "does not make a unit quaternion with the others",
            ));
        }
        let r_ned = q_enu_ned * DVec3::new(row[1], row[2], row[3]);
        samples.push(local(
            row[0],
            origin,
            r_ned,
            q_enu_ned * q_flu_enu * q_frd_flu,
        ));
    }
    let lines = table.rows.iter().map(|(line, _)| *line).collect();
    let mut rows = Rows::new(path, lines, samples, Attitude::Given);
    rows.doubt(
        None,
        "axes taken as ROS has them: position east, north, up; body forward, left, up",
    );
    Ok(rows)
}

/// Whether a text is a motion definition of gnss-ins-sim.
pub(super) fn is_motion_definition(text: &str) -> bool {
    text.trim_start().starts_with("ini lat")
}

/// A motion definition of gnss-ins-sim: a start (latitude, longitude, height, body velocity, yaw, pitch, roll),
/// then commands (type, yaw, pitch, roll, body velocity, duration): 1 rates of change; 2 values to reach;
/// 3 changes; 4 attitude to reach, change of velocity; 5 change of attitude, velocity to reach.
pub(super) fn motion_definition(path: &str, text: &str) -> Result<Rows, Error> {
    let lines: Vec<(u64, &str)> = text
        .lines()
        .enumerate()
        .map(|(i, l)| (i as u64 + 1, l.trim()))
        .filter(|(_, l)| !l.is_empty())
        .collect();
    let Some((&start, rest)) = lines.get(1).zip(lines.get(3..)) else {
        return Err(no_rows(path));
    };
    let ini = numbers(path, start.0, start.1, 9)?;
    let mut motion = BodyMotion {
        start: [ini[0] * DEG, ini[1] * DEG, ini[2]],
        v_b: DVec3::new(ini[3], ini[4], ini[5]),
        rpy: DVec3::new(ini[8], ini[7], ini[6]) * DEG,
        commands: Vec::new(),
    };
    let timed = command_all(&mut motion, path, rest)?;
    let samples = motion.samples();
    let lines = command_lines(&samples, &motion, start.0, rest);
    let mut rows = Rows::new(path, lines, samples, Attitude::Given);
    if !timed {
        rows.doubt(
            None,
            "commands of type 2 to 5 take all of their time, not only what a vehicle needs",
        );
    }
    Ok(rows)
}

/// Reads the commands of a motion; whether all of them are rates of change, which take the time they say.
fn command_all(motion: &mut BodyMotion, path: &str, lines: &[(u64, &str)]) -> Result<bool, Error> {
    let (mut rpy, mut v_b, mut timed, mut total_s) = (motion.rpy, motion.v_b, true, 0.0);
    for &(line, text) in lines {
        let cells = numbers(path, line, text, 8)?;
        let duration_s = cells[7];
        let (angles, speeds) = (
            DVec3::new(cells[3], cells[2], cells[1]) * DEG,
            DVec3::from_slice(&cells[4..7]),
        );
        let change = match cells[0] as i64 {
            1 => (angles * duration_s, speeds * duration_s),
            2 => (angles - rpy, speeds - v_b),
            3 => (angles, speeds),
            4 => (angles - rpy, speeds),
            5 => (angles, speeds - v_b),
            _ => {
                return Err(Error::contents(
                    path,
                    line,
                    format!("command type {} is none of 1 to 5", cells[0]),
                ));
            }
        };
        total_s += duration_s;
        if duration_s <= 0.0 || total_s > DAY_S {
            let message =
                format!("command duration {duration_s} s is not > 0, or makes more than a day");
            return Err(Error::contents(path, line, message));
        }
        timed &= cells[0] as i64 == 1;
        (rpy, v_b) = (rpy + change.0, v_b + change.1);
        motion.commands.push(Command {
            duration_s,
            rpy: change.0,
            v_b: change.1,
        });
    }
    Ok(timed)
}

/// The line of the command that leads to each sample; that of the start for the first.
fn command_lines(
    samples: &[TrajectorySample],
    motion: &BodyMotion,
    start: u64,
    commands: &[(u64, &str)],
) -> Vec<u64> {
    let (mut lines, mut end_s) = (vec![start], 0.0);
    for (command, (line, _)) in motion.commands.iter().zip(commands) {
        end_s += command.duration_s;
        let within = samples[lines.len()..]
            .iter()
            .take_while(|s| s.t_s <= end_s + 1e-6)
            .count();
        lines.extend(std::iter::repeat_n(*line, within));
    }
    lines.resize(samples.len(), lines.last().copied().unwrap_or(start));
    lines
}

fn numbers(path: &str, line: u64, text: &str, least: usize) -> Result<Vec<f64>, Error> {
    let number = |cell: &str| match cell.trim().parse::<f64>() {
        Ok(x) if x.is_finite() => Ok(x),
        _ => Err(Error::contents(
            path,
            line,
            format!("\"{}\" is not a number", cell.trim()),
        )),
    };
    let cells = text.split(',').map(number).collect::<Result<Vec<_>, _>>()?;
    if cells.len() < least {
        return Err(Error::row_length(path, line, cells.len(), least));
    }
    Ok(cells)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::formats::trajectory_file::Warning;
    use nav_sim_navigation::frames::RollPitchYaw;
    use nav_sim_navigation::trajectory::Trajectory;

    type Loaded = Result<(Trajectory, Vec<Warning>), Error>;

    fn nav(text: &str) -> Loaded {
        kf_gins("truth.nav", text, &Options::default(), Numbers::Finite)?.trajectory()
    }

    fn tum(path: &str, text: &str, options: &Options) -> Loaded {
        super::tum(path, text, options, Numbers::Finite)?.trajectory()
    }

    fn motion_definition(path: &str, text: &str) -> Loaded {
        super::motion_definition(path, text)?.trajectory()
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
        assert!(warnings[0].message.contains("ROS"));
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

    const HEAD: &str = "ini lat (deg),ini lon (deg),ini alt (m),ini vx_body (m/s),ini vy_body (m/s),ini vz_body \
                        (m/s),ini yaw (deg),ini pitch (deg),ini roll (deg)\n32,120,5,10,0,0,90,0,0\ncommand type,yaw \
                        (deg),pitch (deg),roll (deg),vx_body (m/s),vy_body (m/s),vz_body (m/s),command duration (s),GPS \
                        visibility\n";

    #[test]
    fn motion_definitions_of_gnss_ins_sim() {
        let text = format!("{HEAD}1,0,0,0,0,0,0,1,0\n1,-15,0,0,0,0,0,6,0\n5,0,0,0,4,0,0,8,1\n");
        assert!(is_motion_definition(&text));
        let (t, warnings) = motion_definition("m.csv", &text).unwrap();
        assert!(warnings[0].message.contains("type 2 to 5"));
        assert_eq!(t.end_s(), 15.0);
        // Facing east, then turned left by 90°: north; slowed down to 4 m/s.
        assert!((t.state(1.0).v_n - DVec3::Y * 10.0).length() < 1e-4);
        assert!(
            (t.state(15.0).v_n - DVec3::X * 4.0).length() < 1e-4,
            "{}",
            t.state(15.0).v_n
        );
        let refused = |line: &str| {
            motion_definition("m.csv", &format!("{HEAD}{line}\n"))
                .unwrap_err()
                .to_string()
        };
        assert_eq!(
            refused("7,0,0,0,0,0,0,1,0"),
            "m.csv, line 4: command type 7 is none of 1 to 5"
        );
        assert_eq!(
            refused("1,0,0,0,0,0,0,0,0"),
            "m.csv, line 4: command duration 0 s is not > 0, or makes more than a day"
        );
        assert_eq!(
            refused("1,0,x,0,0,0,0,1,0"),
            "m.csv, line 4: \"x\" is not a number"
        );
    }
}
