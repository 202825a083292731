//! Trajectory files: CSV, motion profiles (TOML), imports.

use super::file_kind::{self, FileKind};
use super::fusion_files::{
    SD_D, SD_E, SD_N, SD_VD, SD_VE, SD_VN, WEEK_S, check_jump, doubt_degrees, increasing, is_nmea,
    is_rtklib, read_gnss,
};
use super::recordings::timing::median_step;
use super::table::{
    self, Column, Dictionary, InputTable, LATITUDE, LONGITUDE, Quantity, normalised,
};
use super::{Failure, Failure as Error, Place, source};
use crate::parse;
use chrono::{DateTime, Utc};
use glam::{DQuat, DVec3};
use nalgebra::{DMatrix, SMatrix};
use nav_sim_navigation::earth::{e_to_n, ecef_to_geodetic, geodetic_to_ecef};
use nav_sim_navigation::frames::{NavState, RollPitchYaw, q_e_n, wrap_angle};
use nav_sim_navigation::fusion::judge::StatedRow;
use nav_sim_navigation::gnss::GnssFix;
use nav_sim_navigation::linalg::median;
use nav_sim_navigation::trajectory;
use nav_sim_navigation::trajectory::plausibility::VelocityMisfit;
use nav_sim_navigation::trajectory::reference::{Reference, breaks, usable};
use nav_sim_navigation::trajectory::{Trajectory, TrajectorySample};
use nav_sim_signal::units::DEG;
pub(crate) use profile::schema as profile_schema;
use roxmltree::{Document, Node};
use std::f64::consts::{FRAC_1_SQRT_2, FRAC_PI_2, PI, TAU};
use std::fmt::Write;
use std::ops::Range;
use std::path::Path;

mod profile;

type Covariance = SMatrix<f64, 9, 9>;

const KNOWN: &str =
    ".toml (motion profile), .csv, .tsv, .txt, .nav (KF-GINS), .tum or .gpx (also .gz)";

/// Reads a trajectory: a motion profile (`.toml`), or a table with a header (`.csv`, `.tsv`, `.txt`) whose columns
/// are `t_s`, `lat_deg`, `lon_deg`, `h_m` or `n_m`, `e_m`, `d_m` (in the plane that touches the Earth at the
/// origin), `roll_deg`, `pitch_deg`, `yaw_deg`. Columns `v_n_m_s`, `v_e_m_s`, `v_d_m_s` are compared with the
/// positions. Without attitude, heading and pitch follow the path.
///
/// Of other tools: KF-GINS results (`.nav`), TUM (`.tum`), GPX (`.gpx`). All but profiles may be packed (`.gz`).
///
/// # Errors
/// Whatever is wrong with the file, with its line.
pub fn load(path: &Path, origin: Option<[f64; 3]>) -> Result<(Trajectory, Vec<String>), Failure> {
    let found = match read(path, origin, Purpose::Drive) {
        Ok(None) => profile::load(path).map(|profile| (profile, Vec::new())),
        Ok(Some(rows)) => rows.trajectory(),
        Err(e) => Err(e),
    };
    found.map_err(or_other_kind(path))
}

/// Reads a trajectory that is only compared with. Where its position or attitude jumps as no vehicle does, where
/// rows are missing, not finite or out of range, it is left out and the rest is used; what was left out is
/// among the warnings.
///
/// # Errors
/// A file that cannot be read, with its line; rows of which no stretch is usable.
pub(crate) fn load_reference(
    path: &Path,
    origin: Option<[f64; 3]>,
) -> Result<(Reference, Vec<String>), Failure> {
    let found = match read(path, origin, Purpose::Reference) {
        Ok(None) => profile::load(path).map(|profile| (profile.into(), Vec::new())),
        Ok(Some(rows)) => rows.reference(),
        Err(e) => Err(e),
    };
    found.map_err(or_other_kind(path))
}

/// The refusal of a file that may be no trajectory.
fn or_other_kind(path: &Path) -> impl Fn(Failure) -> Failure {
    move |e| file_kind::or_wrong_kind(&[FileKind::Trajectory, FileKind::Gnss], path, e)
}

/// The rows of a file; none of a motion profile.
fn read(path: &Path, origin: Option<[f64; 3]>, purpose: Purpose) -> Result<Option<Rows>, Failure> {
    let name = path.display().to_string();
    let lower = name.to_lowercase();
    let plain = lower.strip_suffix(".gz").unwrap_or(&lower);
    match plain.rsplit_once('.').map_or("", |(_, ending)| ending) {
        "toml" => Ok(None),
        "gpx" => gpx(&name, &source::table_text(path)?).map(Some),
        ending @ ("nav" | "tum" | "csv" | "tsv" | "txt") => {
            let text = source::table_text(path)?;
            rows(&name, &text, ending, origin, purpose).map(Some)
        }
        _ => {
            let message = format!("a trajectory file ends in {KNOWN}");
            Err(Failure::contents(name, Place::Within, message))
        }
    }
}

/// Reads the solution of a filter: a table of a trajectory, with standard deviations or a file of them or of covariances
/// beside it, or a solution of RTKLIB or NMEA sentences, whose clock is taken to be that of `clock_s` (start, end).
///
/// # Errors
/// Whatever is wrong with the files, with its line.
pub(crate) fn load_solution(
    path: &Path,
    covariance: Option<&Path>,
    origin: Option<[f64; 3]>,
    clock_s: (f64, f64),
) -> Result<(Vec<StatedRow>, Vec<String>), Failure> {
    let text = source::table_text(path)?;
    if is_rtklib(&text) || is_nmea(&text) {
        let (fixes, notes) = read_gnss(path, None, Some(clock_s), None)?;
        let rows = fixes.iter().map(of_fix).collect();
        return Ok((rows, notes.into_iter().map(|note| note.text).collect()));
    }
    let Some(mut rows) = read(path, origin, Purpose::Solution).map_err(or_other_kind(path))? else {
        let message = "a .toml file is no solution";
        let refused = Error::contents(path.display().to_string(), Place::Within, message);
        return Err(or_other_kind(path)(refused));
    };
    rows.check_heights()?;
    rows.check_steps()?;
    increasing(
        &rows.path,
        |k| rows.lines[k],
        rows.samples.iter().map(|s| s.t_s),
    )?;
    let has = [!rows.velocities.is_empty(), !rows.follows_path];
    let row = |(k, sample): (usize, &TrajectorySample)| StatedRow {
        t_s: sample.t_s,
        state: NavState {
            lat: sample.lat,
            lon: sample.lon,
            h: sample.h,
            v_n: rows.velocities.get(k).copied().unwrap_or_default(),
            q_b_n: sample.q_b_n,
        },
        has,
        covariance: of_sigmas(&rows.sigmas[k]),
        has_correlations: false,
    };
    let mut stated: Vec<StatedRow> = rows.samples.iter().enumerate().map(row).collect();
    let mut doubts = rows.doubts;
    if let Some(path) = covariance {
        doubts.extend(add_covariances(path, &mut stated)?);
    }
    Ok((stated, doubts))
}

/// The covariance of independent errors with these standard deviations (m, m/s, rad), angles in degrees.
fn of_sigmas(sigmas: &[f64; 9]) -> Covariance {
    let unit = |i: usize| if i < 6 { 1.0 } else { DEG };
    Covariance::from_fn(|i, j| match i == j {
        true => (sigmas[i] / unit(i)).powi(2),
        false => 0.0,
    })
}

fn of_fix(fix: &GnssFix) -> StatedRow {
    let mut sigmas = [f64::NAN; 9];
    sigmas[..3].copy_from_slice(&fix.pos_sigma_n.to_array());
    let mut v_n = DVec3::ZERO;
    let velocity = fix.velocity.and_then(|v| Some((v, v.down?)));
    if let Some((v, (down, down_sigma))) = velocity {
        v_n = v.horizontal.extend(down);
        sigmas[3..6].copy_from_slice(&v.horizontal_sigma.extend(down_sigma).to_array());
    }
    StatedRow {
        t_s: fix.t_s,
        state: NavState {
            lat: fix.lat,
            lon: fix.lon,
            h: fix.h,
            v_n,
            q_b_n: DQuat::IDENTITY,
        },
        has: [velocity.is_some(), false],
        covariance: of_sigmas(&sigmas),
        has_correlations: false,
    }
}

/// Puts the standard deviations or covariances of a file at the rows of its times: a table of standard deviations with a
/// header, the one that KF-GINS writes, or rows of a time and a matrix, row by row: position north, east, down (3 × 3, m²);
/// the pose of ROS, x, y, z and rotations about them (6 × 6, m², rad²); position, velocity, rotations about north, east, down
/// (9 × 9).
fn add_covariances(path: &Path, rows: &mut [StatedRow]) -> Result<Option<String>, Failure> {
    const COUNTS: [usize; 3] = [1 + 9, 1 + 36, 1 + 81];
    const KF_GINS_COLUMNS: usize = 22;
    let name = path.display().to_string();
    let text = source::table_text(path)?;
    let numbers = |line: &str| -> Option<Vec<f64>> {
        let cells = line.split(|c: char| c.is_whitespace() || c == ',');
        let cells = cells.filter(|cell| !cell.is_empty());
        cells.map(|cell| cell.parse().ok()).collect()
    };
    let lines = || (1_u64..).zip(text.lines());
    let content = || {
        lines().filter(|(_, l)| !(l.trim().is_empty() || l.trim_start().starts_with(['#', '%'])))
    };
    let first = content().next().and_then(|(_, line)| numbers(line));
    let is_matrix = first.is_some_and(|row| row.len() != KF_GINS_COLUMNS);
    let mut found: Vec<(f64, u64, Covariance)> = Vec::new();
    if is_matrix {
        for (line, text) in content() {
            let row = numbers(text)
                .filter(|row| COUNTS.contains(&row.len()) && row.iter().all(|x| x.is_finite()));
            let row = row.ok_or_else(|| {
                let message = "expected a time and 9, 36 or 81 finite numbers";
                Error::contents(&name, line, message)
            })?;
            found.push((row[0], line, of_matrix(&row[1..])));
        }
    } else {
        let dictionary = Dictionary {
            bare: &[KF_GINS_SIGMAS],
            ..DICTIONARY
        };
        let table = table::parse(&name, &text, &dictionary)?;
        let refused = |e| file_kind::or_wrong_kind(&[], path, e);
        let [time] = table.columns(["t_s"]).map_err(refused)?;
        let sigmas_of_position = SIGMAS.into_iter().take(3);
        table.require(sigmas_of_position).map_err(refused)?;
        let all = (0..).zip(sigmas(&table));
        found.extend(all.map(|(row, own)| (time.si(row), table.line(row), of_sigmas(&own))));
    }
    increasing(&name, |k| found[k].1, found.iter().map(|(t_s, ..)| *t_s))?;
    for (_, line, covariance) in &found {
        let known: Vec<usize> = (0..9).filter(|i| !covariance[(*i, *i)].is_nan()).collect();
        let block = DMatrix::from_fn(known.len(), known.len(), |i, j| {
            covariance[(known[i], known[j])]
        });
        let is_symmetric = (&block - block.transpose()).amax() <= 1e-6 * block.amax();
        if !is_symmetric || block.cholesky().is_none() {
            let message = "the covariance is not symmetric and positive definite";
            let advice = "write a time and the matrix row by row, variances of m², (m/s)² and rad² on its diagonal";
            return Err(Error::contents(&name, *line, message).or_hint(advice));
        }
    }
    let times: Vec<f64> = rows.iter().map(|row| row.t_s).collect();
    let near_s = 0.55 * median_step(&times);
    let mut matched = 0;
    for row in rows.iter_mut() {
        let next = found.partition_point(|(t_s, ..)| *t_s < row.t_s);
        let beside = found[next.saturating_sub(1)..(next + 1).min(found.len())].iter();
        let nearest = beside.min_by(|a, b| (a.0 - row.t_s).abs().total_cmp(&(b.0 - row.t_s).abs()));
        if let Some((.., own)) = nearest.filter(|(t_s, ..)| (t_s - row.t_s).abs() <= near_s) {
            row.covariance = *own;
            row.has_correlations = is_matrix;
            matched += 1;
        } else {
            row.covariance = Covariance::from_diagonal_element(f64::NAN);
        }
    }
    let span = found.first().zip(found.last());
    if let Some((first, last)) = span.filter(|_| 2 * matched < rows.len()) {
        let message = format!(
            "times {} to {} s match {matched} of the {} rows of the solution, {} to {} s",
            first.0,
            last.0,
            rows.len(),
            times[0],
            times[times.len() - 1]
        );
        return Err(Error::contents(&name, Place::Within, message)
            .or_hint("write both with the same time stamps"));
    }
    let without = rows.len() - matched;
    Ok((without > 0).then(|| format!("{name}: nothing for {without} of {} rows", rows.len())))
}

/// A covariance from its numbers, row by row; angles in degrees, NaN where a state is not in it.
fn of_matrix(numbers: &[f64]) -> Covariance {
    let mut covariance = Covariance::from_diagonal_element(f64::NAN);
    let size = [(9, 3), (36, 6), (81, 9)];
    let size = size.iter().find(|(count, _)| *count == numbers.len());
    let size = size.map_or(0, |(_, size)| *size);
    // Where each number stands, and its sign: the pose of ROS is east, north, up.
    let place = |i: usize| match (size, i) {
        (6, 0 | 1) => (1 - i, 1.0),
        (6, 2) => (2, -1.0),
        (6, 3 | 4) => (10 - i, 1.0),
        (6, 5) => (8, -1.0),
        _ => (i, 1.0),
    };
    let unit = |i: usize| if i < 6 { 1.0 } else { DEG };
    for i in 0..size {
        for j in 0..size {
            let ((row, a), (column, b)) = (place(i), place(j));
            covariance[(row, column)] = a * b * numbers[size * i + j] / (unit(row) * unit(column));
        }
    }
    covariance
}

#[cfg(test)]
mod tests;

// From rows to a trajectory.

/// Longest step between rows that is not doubted (s).
const LONG_STEP_S: f64 = 1.0 + 1e-6;
/// Heights at which the gravity model means something (m).
const HEIGHT: std::ops::RangeInclusive<f64> = -12_000.0..=1_000_000.0;
/// Below this speed a path has no direction (m/s).
const MOVING: f64 = 0.5;
/// A trajectory lasts a day at most (s), as motion profiles do: a wrong time stamp would ask for more memory
/// than there is.
const MAX_DURATION_S: f64 = 86_400.0;

/// Quantities of a trajectory; x, y, z and quaternions are in the axes of ROS ([REP 103](https://www.ros.org/reps/rep-0103.html)):
/// position east, north, up of the origin; body forward, left, up.
static QUANTITIES: [Quantity; 32] = [
    Quantity::time("t time timestamp"),
    Quantity::number("week", "week gps_week"),
    Quantity::angle("lat_deg", "lat latitude").within(LATITUDE),
    Quantity::angle("lon_deg", "lon lng longitude").within(LONGITUDE),
    Quantity::length("h_m", "h alt height altitude"),
    N,
    E,
    D,
    D.reversed("u up"),
    Quantity::angle("roll_deg", "roll").within((-180.0, 180.0, "is not a roll angle")),
    Quantity::angle("pitch_deg", "pitch").within((-90.0, 90.0, "is not a pitch angle")),
    // one that was unwrapped goes on below −180 and above 180: the same angle
    Quantity::angle("yaw_deg", "yaw heading azimuth").within((-360.0, 360.0, "is not a heading")),
    Quantity::speed("v_n_m_s", "v_n vn v_north").with_unit(),
    Quantity::speed("v_e_m_s", "v_e ve v_east").with_unit(),
    V_D,
    V_D.reversed("v_u v_up"),
    Quantity::length("x", "x"),
    Quantity::length("y", "y"),
    Quantity::length("z", "z"),
    Quantity::number("qx", "qx q_x"),
    Quantity::number("qy", "qy q_y"),
    Quantity::number("qz", "qz q_z"),
    Quantity::number("qw", "qw q_w"),
    Quantity::length("sd_n_m", SD_N).positive(),
    Quantity::length("sd_e_m", SD_E).positive(),
    Quantity::length("sd_d_m", SD_D).positive(),
    Quantity::speed("sd_vn_m_s", SD_VN).positive(),
    Quantity::speed("sd_ve_m_s", SD_VE).positive(),
    Quantity::speed("sd_vd_m_s", SD_VD).positive(),
    Quantity::angle("sd_roll_deg", "sd_roll std_roll roll_std sigma_roll").positive(),
    Quantity::angle("sd_pitch_deg", "sd_pitch std_pitch pitch_std sigma_pitch").positive(),
    Quantity::angle("sd_yaw_deg", "sd_yaw std_yaw yaw_std sigma_yaw sd_heading").positive(),
];
const N: Quantity = Quantity::length("n_m", "n north").with_unit();
const E: Quantity = Quantity::length("e_m", "e east").with_unit();
const D: Quantity = Quantity::length("d_m", "d down").with_unit();
const V_D: Quantity = Quantity::speed("v_d_m_s", "v_d vd v_down").with_unit();

/// Dictionary of trajectories.
pub(super) const DICTIONARY: Dictionary<'_> = Dictionary {
    bad_cell: "write numbers; angles are in degrees: latitude within ±89.9, longitude and yaw in (−180, 180] or [0, 360), pitch within ±90",
    ..Dictionary::new(
        &QUANTITIES,
        "a trajectory has the columns t_s, lat_deg, lon_deg, h_m (or n_m, e_m, d_m) and may have roll_deg, pitch_deg, yaw_deg",
    )
};
/// A KF-GINS navigation result or truth: week, seconds of week, position, velocity, attitude, between blanks. Time is counted on
/// from the first week.
const KF_GINS: &str =
    "week t_s lat_deg lon_deg h_m v_n_m_s v_e_m_s v_d_m_s roll_deg pitch_deg yaw_deg";
/// A TUM file: time, position (m), quaternion, between blanks.
const TUM: &str = "t_s x y z qx qy qz qw";

const GEODETIC: [&str; 3] = ["lat_deg", "lon_deg", "h_m"];
const LOCAL: [&str; 3] = ["n_m", "e_m", "d_m"];
const ATTITUDE: [&str; 3] = ["roll_deg", "pitch_deg", "yaw_deg"];
const VELOCITY: [&str; 3] = ["v_n_m_s", "v_e_m_s", "v_d_m_s"];
/// Standard deviations, in the order of the reported states.
const SIGMAS: [&str; 9] = [
    "sd_n_m",
    "sd_e_m",
    "sd_d_m",
    "sd_vn_m_s",
    "sd_ve_m_s",
    "sd_vd_m_s",
    "sd_roll_deg",
    "sd_pitch_deg",
    "sd_yaw_deg",
];
/// Standard deviations of KF-GINS: those of position, velocity and attitude, then of twelve errors of the IMU.
const KF_GINS_SIGMAS: &str = "t_s sd_n_m sd_e_m sd_d_m sd_vn_m_s sd_ve_m_s sd_vd_m_s sd_roll_deg sd_pitch_deg \
    sd_yaw_deg i1 i2 i3 i4 i5 i6 i7 i8 i9 i10 i11 i12";

/// Samples of a file of any format, and the line that each comes from.
#[derive(Debug, Default)]
struct Rows {
    path: String,
    /// One for each sample.
    lines: Vec<u64>,
    samples: Vec<TrajectorySample>,
    /// True where the file has no attitude: heading and pitch follow the path.
    follows_path: bool,
    /// Velocities in n that the positions are compared with (m/s), one for each sample or none at all.
    velocities: Vec<DVec3>,
    /// Standard deviations in the order of the reported states (m, m/s, rad; NaN: not stated), one for each sample.
    sigmas: Vec<[f64; 9]>,
    /// True if positions are latitude and longitude, whose unit may be wrong.
    geodetic: bool,
    doubts: Vec<String>,
    /// Doubts for trajectories only: unused columns, and an attitude that follows the path.
    of_trajectory: Vec<String>,
}

impl Rows {
    fn doubt(&mut self, line: Option<u64>, message: impl Into<String>) {
        let line = line.map_or(String::new(), |line| format!(", line {line}"));
        let text = format!("{}{line}: {}", self.path, message.into());
        self.doubts.push(text);
    }

    fn doubt_of_trajectory(&mut self) {
        for text in std::mem::take(&mut self.of_trajectory) {
            self.doubt(None, text);
        }
    }

    /// The trajectory through all rows, and what is doubtful about it. Every format comes through here, so that
    /// what is refused in one is refused in all.
    fn trajectory(mut self) -> Result<(Trajectory, Vec<String>), Error> {
        self.doubt_of_trajectory();
        self.check_heights()?;
        self.check_steps()?;
        let place = |s: &TrajectorySample| (s.t_s, geodetic_to_ecef(s.lat, s.lon, s.h));
        for (pair, line) in self.samples.windows(2).zip(self.lines.iter().skip(1)) {
            check_jump(&self.path, *line, place(&pair[0]), place(&pair[1]))?;
        }
        let trajectory = self.stretch(0..self.samples.len())?;
        self.compare(&trajectory);
        Ok((trajectory, self.doubts))
    }

    /// Heights below the deepest trench and beyond a low orbit are no heights in metres; neither is what is
    /// not finite.
    fn check_heights(&self) -> Result<(), Error> {
        let Some(bad) = self.samples.iter().position(|s| !HEIGHT.contains(&s.h)) else {
            return Ok(());
        };
        let message = format!(
            "height {:?} m is not within −12 to 1000 km",
            self.samples[bad].h
        );
        Err(self.refuse(
            bad,
            message,
            "a value in the wrong column, or a damaged row?",
        ))
    }

    /// Rows a minute apart are no trajectory of a vehicle, their time is in milliseconds; and one time stamp
    /// that is far off makes no trajectory of years. In long steps the curve between rows is a guess.
    fn check_steps(&mut self) -> Result<(), Error> {
        let t_s: Vec<f64> = self.samples.iter().map(|s| s.t_s).collect();
        let step = |i: &usize| t_s[*i] - t_s[*i - 1];
        let by_step = |a: &usize, b: &usize| step(a).total_cmp(&step(b));
        let Some(longest) = (1..t_s.len()).max_by(by_step) else {
            return Ok(());
        };
        let (median_s, longest_s) = (median_step(&t_s), step(&longest));
        let [first_s, .., last_s] = t_s[..] else {
            return Ok(());
        };
        let (previous_s, t_s) = (t_s[longest - 1], t_s[longest]);
        if median_s >= 50.0 {
            let message = format!("the rows are {median_s} s apart");
            let advice = "one row a second at least; is the time in milliseconds (t_ms)?";
            return Err(self.refuse(1, message, advice));
        }
        if last_s - first_s > MAX_DURATION_S {
            let message = format!("time goes from {previous_s} s to {t_s} s; at most a day");
            let advice = "a damaged time stamp, another clock, or another unit?";
            return Err(self.refuse(longest, message, advice));
        }
        if longest_s > LONG_STEP_S.max(1.5 * median_s) {
            let text = format!("gap of {longest_s:.3} s before {t_s} s: the path in it is a guess");
            self.doubt(Some(self.lines[longest]), text);
        }
        if median_s > LONG_STEP_S {
            let text = format!("rows are {median_s} s apart: the path between is a guess");
            self.doubt(None, text);
        }
        Ok(())
    }

    fn refuse(&self, index: usize, message: String, advice: &'static str) -> Error {
        Error::contents(&self.path, self.lines[index], message).or_hint(advice)
    }
}

/// East-north-up to north-east-down and back: a half turn.
const ENU_NED: DQuat = DQuat::from_xyzw(FRAC_1_SQRT_2, FRAC_1_SQRT_2, 0.0, 0.0);

/// What a table is read for.
#[derive(Clone, Copy, PartialEq)]
enum Purpose {
    /// To drive along it: every row is needed.
    Drive,
    /// To compare with it: rows that cannot be used are left out.
    Reference,
    /// To judge it, with its standard deviations.
    Solution,
}

/// The rows of a table. Cells out of range are refused, or their rows left out where not every row is needed.
fn rows(
    path: &str,
    text: &str,
    ending: &str,
    origin: Option<[f64; 3]>,
    purpose: Purpose,
) -> Result<Rows, Error> {
    // Standard deviations say nothing of where a vehicle was, and those of a reference may be 0 or unknown.
    let is_sigma = |q: &Quantity| purpose != Purpose::Solution && SIGMAS.contains(&q.name);
    let dictionary = Dictionary {
        is_partial: purpose == Purpose::Reference,
        unwanted: Some(&is_sigma),
        bare: match ending {
            "nav" => &[KF_GINS],
            "tum" => &[TUM],
            _ => &[],
        },
        ..DICTIONARY
    };
    let mut table = table::parse(path, text, &dictionary)?;
    let has = |names: [&str; 3]| names.into_iter().any(|name| table.has(name));
    let is_enu = table.has("qw");
    let is_local = is_enu || has(LOCAL) && !table.has("lat_deg");
    let position = match is_local {
        _ if is_enu => ["x", "y", "z"],
        true => LOCAL,
        false => GEODETIC,
    };
    let optional = [ATTITUDE, VELOCITY].into_iter().filter(|names| has(*names));
    let needed = ["t_s"]
        .into_iter()
        .chain(position)
        .chain(optional.flatten());
    table.require(needed)?;
    check_units(&table)?;
    let left_out = table.drop_incomplete_rows();
    let origin = is_local.then(|| local_origin(&table, origin)).transpose()?;
    let [time] = table.columns(["t_s"])?;
    let place = table.columns(position)?;
    let (attitude, velocity) = (table.all(ATTITUDE), table.all(VELOCITY));
    let (quaternion, week) = (table.all(["qx", "qy", "qz", "qw"]), table.get("week"));
    let triad = |columns: [&Column; 3], row| columns.map(|column| column.si(row));
    let sample = |row| {
        let weeks = week.map_or(0.0, |week| week.si(row) - week.si(0));
        let t_s = time.si(row) + weeks * WEEK_S;
        let [roll, pitch, yaw] = attitude.map_or([0.0; 3], |all| triad(all, row));
        let mut q_b_n = RollPitchYaw { roll, pitch, yaw }.to_quat();
        let [lat, lon, h] = triad(place, row);
        let mut r_n = DVec3::new(lat, lon, h);
        if let Some(quaternion) = quaternion {
            // front-right-down to front-left-up: a half turn
            let q_flu_enu = DQuat::from_array(quaternion.map(|column| column.si(row)));
            if (q_flu_enu.length() - 1.0).abs() > 0.01 {
                let reason = "makes no unit quaternion with the others";
                let (line, w) = (table.line(row), q_flu_enu.w);
                return Err(Error::cell(path, line, "qw", w, reason));
            }
            q_b_n = ENU_NED * q_flu_enu * DQuat::from_rotation_x(PI);
            r_n = ENU_NED * r_n;
        }
        Ok(match origin {
            None => TrajectorySample {
                t_s,
                lat,
                lon,
                h,
                q_b_n,
            },
            Some(origin) => local(t_s, origin, r_n, q_b_n),
        })
    };
    let all = 0..table.rows();
    let mut rows = Rows {
        path: path.to_owned(),
        lines: all.clone().map(|row| table.line(row)).collect(),
        samples: all.clone().map(sample).collect::<Result<_, _>>()?,
        follows_path: attitude.is_none() && quaternion.is_none(),
        geodetic: !is_local,
        ..Rows::default()
    };
    if let Some(quaternion) = quaternion {
        // Level with x, y, z, w in order, and if they are w, x, y, z.
        let level = |order: [usize; 4]| {
            let up = |row| {
                let q = DQuat::from_array(order.map(|k| quaternion[k].si(row)));
                (q * DVec3::Z).z
            };
            median((0..table.rows()).map(up)).unwrap_or(0.0)
        };
        if level([0, 1, 2, 3]) < 0.5 && level([1, 2, 3, 0]) > 0.9 {
            let text = "the vehicle is level only if the quaternions are w, x, y, z: order them x, y, z, w";
            rows.doubt(None, text.to_owned());
        }
    }
    rows.sigmas = sigmas(&table);
    if let Some(own) = velocity {
        rows.velocities = all.map(|row| triad(own, row).into()).collect();
    }
    // Standard deviations that are left out on purpose are not reported.
    let is_known = |name: &String| table::find(DICTIONARY.quantities, name).is_some();
    table.ignored.retain(|name| !is_known(name));
    let unused = (!table.ignored.is_empty())
        .then(|| format!("columns not used: {}", table.ignored.join(", ")));
    let axes = "axes of ROS: position east, north, up; body forward, left, up";
    let path = "no attitude columns: heading and pitch follow the path, roll is 0";
    rows.of_trajectory = unused
        .into_iter()
        .chain(rows.follows_path.then(|| path.to_owned()))
        .collect();
    let doubts = left_out.into_iter();
    let doubts = doubts.chain(table.assumptions.iter().chain(&table.warnings).cloned());
    for text in doubts.chain(is_enu.then(|| axes.to_owned())) {
        rows.doubt(None, text);
    }
    Ok(rows)
}

/// The standard deviations of each row (m, m/s, rad); NaN where it has none.
fn sigmas(table: &InputTable) -> Vec<[f64; 9]> {
    let columns = SIGMAS.map(|name| table.get(name));
    let of_row = |row| columns.map(|column| column.map_or(f64::NAN, |column| column.si(row)));
    (0..table.rows()).map(of_row).collect()
}

/// Refuses angles of the attitude without a unit in their names, of which none is too large for radians.
fn check_units(table: &InputTable) -> Result<(), Error> {
    let is_bare = |column: &&Column| {
        let name = normalised(&column.name);
        !name.ends_with("deg") && !name.ends_with("rad")
    };
    let attitude = ATTITUDE.into_iter().filter_map(|name| table.get(name));
    let bare: Vec<&Column> = attitude.filter(is_bare).collect();
    let values = bare.iter().flat_map(|column| &column.values);
    let largest = values
        .filter(|x| x.is_finite())
        .fold(0.0, |most: f64, x| most.max(x.abs()));
    if largest == 0.0 || largest > TAU {
        return Ok(()); // alike in both units, or degrees
    }
    let names: Vec<String> = bare
        .iter()
        .map(|column| column.name.to_lowercase())
        .collect();
    let names = names.join(", ");
    let message = format!("no unit in the name of {names}, and no value exceeds 2π");
    Err(table
        .refused(message)
        .or_hint("end the names in _deg or _rad"))
}

/// A sample given in the axes north, east, down of the origin.
fn local(t_s: f64, [lat0, lon0, h0]: [f64; 3], r_n0: DVec3, q_b_n0: DQuat) -> TrajectorySample {
    let q_n0_e = q_e_n(lat0, lon0).inverse();
    let (lat, lon, h) = ecef_to_geodetic(geodetic_to_ecef(lat0, lon0, h0) + q_n0_e * r_n0);
    TrajectorySample {
        t_s,
        lat,
        lon,
        h,
        q_b_n: q_e_n(lat, lon) * q_n0_e * q_b_n0,
    }
}

/// The origin of local coordinates: the one given, or the file's `# origin: lat, lon, h` line.
fn local_origin(table: &InputTable, given: Option<[f64; 3]>) -> Result<[f64; 3], Error> {
    if let Some(origin) = given {
        return Ok(origin);
    }
    let line = table.comments.iter().find_map(|c| c.strip_prefix("origin"));
    line.and_then(|line| parse_origin(line.trim_start_matches([':', '=', ' '])))
        .ok_or_else(|| {
            let message = "local coordinates need an origin on the Earth";
            Error::contents(&table.path, Place::Within, message)
                .or_option(("origin", "give --origin LAT_DEG,LON_DEG,H_M"))
                .or_hint_without((
                    "origin",
                    "convert it: nav-sim trajectory convert FILE --origin LAT_DEG,LON_DEG,H_M",
                ))
                .or_hint("a first line \"# origin: LAT_DEG, LON_DEG, H_M\"")
        })
}

/// An origin as it is written, `LAT_DEG,LON_DEG,H_M`: latitude, longitude (rad), height (m).
pub(crate) fn parse_origin(text: &str) -> Option<[f64; 3]> {
    let [lat, lon, h] = parse::numbers(text)?;
    (lat.abs() <= 89.9 && lon.abs() <= 360.0).then_some([lat * DEG, lon * DEG, h])
}

/// Heading and pitch along the path; at rest between those before and after.
fn follow_path(samples: &mut [TrajectorySample]) {
    let moving = |i: usize| Some((samples[i].t_s, direction(samples, i)?));
    let moving: Vec<(f64, (f64, f64))> = (0..samples.len()).filter_map(moving).collect();
    let direction_of = |k: usize| moving.get(k.min(moving.len().saturating_sub(1)));
    for sample in samples {
        let next = moving.partition_point(|(t_s, ..)| *t_s < sample.t_s);
        let from = direction_of(next.saturating_sub(1));
        let (Some(from), Some(to)) = (from, direction_of(next)) else {
            continue;
        };
        let share = match to.0 - from.0 {
            span if span > 0.0 => ((sample.t_s - from.0) / span).clamp(0.0, 1.0),
            _ => 0.0,
        };
        let ((yaw, pitch), (to_yaw, to_pitch)) = (from.1, to.1);
        sample.q_b_n = RollPitchYaw {
            roll: 0.0,
            pitch: pitch + share * (to_pitch - pitch),
            yaw: yaw + share * wrap_angle(to_yaw - yaw),
        }
        .to_quat();
    }
}

/// Heading and pitch of the parabola through a row and its neighbours (at the ends through the nearest three), if that is a
/// motion. The chord from the row before to the one after has the direction of the path halfway between them, which is not
/// that at the row where the steps are unequal.
fn direction(samples: &[TrajectorySample], i: usize) -> Option<(f64, f64)> {
    let position = |k: usize| geodetic_to_ecef(samples[k].lat, samples[k].lon, samples[k].h);
    let slope =
        |a: usize, b: usize| (position(b) - position(a)) / (samples[b].t_s - samples[a].t_s);
    let velocity = if samples.len() < 3 {
        slope(0, samples.len() - 1)
    } else {
        // Of the parabola through three rows the slope between two is that at their middle, and linear in time.
        let middle = i.clamp(1, samples.len() - 2);
        let [before, at, after] = [middle - 1, middle, middle + 1].map(|k| samples[k].t_s);
        let (first, second) = (slope(middle - 1, middle), slope(middle, middle + 1));
        let share = (2.0 * samples[i].t_s - before - at) / (after - before);
        first.lerp(second, share)
    };
    let v = e_to_n(samples[i].lat, samples[i].lon, velocity);
    (v.length() > MOVING).then(|| (v.y.atan2(v.x), (-v.z).atan2(v.x.hypot(v.y))))
}

#[cfg(test)]
mod attitude_tests {
    use super::*;
    use crate::io::table::find;

    #[test]
    fn names_of_many_tools() {
        for (name, quantity, factor) in [
            ("t_s", "t_s", 1.0),
            ("time_s", "t_s", 1.0),
            ("timestamp_ns", "t_s", 1e-9),
            ("Latitude", "lat_deg", DEG),
            ("lon_deg", "lon_deg", DEG),
            ("lat_rad", "lat_deg", 1.0),
            ("alt_m", "h_m", 1.0),
            ("height_m", "h_m", 1.0),
            ("heading_deg", "yaw_deg", DEG),
            ("roll", "roll_deg", DEG),
            ("pitch_rad", "pitch_deg", 1.0),
            ("vn_mps", "v_n_m_s", 1.0),
            ("v_d_m_s", "v_d_m_s", 1.0),
            ("v_up_m_s", "v_d_m_s", -1.0),
            ("up_m", "d_m", -1.0),
            ("e_m", "e_m", 1.0),
            ("sd_roll_deg", "sd_roll_deg", DEG),
            ("std_n_m", "sd_n_m", 1.0),
        ] {
            let found = find(&QUANTITIES, name).map(|(own, factor)| (own.name, factor));
            assert_eq!(found, Some((quantity, Some(factor))), "{name}");
        }
        for name in [
            "sd_roll_m",
            "gnss",
            "e",
            "n",
            "roll_m",
            "lat_m",
            "t_deg",
            "v_n_deg",
        ] {
            assert!(find(&QUANTITIES, name).is_none(), "{name}");
        }
        let is_own =
            |own: &Quantity| find(&QUANTITIES, own.name).is_some_and(|q| q.0.name == own.name);
        assert!(
            QUANTITIES
                .iter()
                .filter(|own| own.name != "week")
                .all(is_own)
        );
    }
}

// Doubts about a trajectory file that can be used all the same: gaps, units, conventions.

/// Instants at which path and attitude are compared: more tell no more.
const LOOKS: usize = 2000;

impl Rows {
    /// Compares the path with the other columns.
    fn compare(&mut self, trajectory: &Trajectory) {
        let places = self.samples.iter().map(|s| [s.lat, s.lon]);
        let degrees = doubt_degrees(places).filter(|_| self.geodetic);
        let heading = heading(self, trajectory).filter(|_| !self.follows_path);
        for text in degrees.map(str::to_owned).into_iter().chain(heading) {
            self.doubt(None, text);
        }
        let times = self.samples.iter().map(|s| s.t_s);
        let given: Vec<_> = times.zip(self.velocities.iter().copied()).collect();
        if let Some((worst_s, text)) = contradiction(trajectory, &given) {
            let worst = given.iter().position(|(t_s, _)| *t_s == worst_s);
            self.doubt(worst.map(|i| self.lines[i]), text);
        }
    }
}

/// Velocities (s, m/s) that positions contradict: where most, and in words.
fn contradiction(trajectory: &Trajectory, given: &[(f64, DVec3)]) -> Option<(f64, String)> {
    let misfit = VelocityMisfit::new(trajectory, given).filter(VelocityMisfit::contradicts);
    misfit.map(|VelocityMisfit { rms, worst_s, .. }| {
        let text = format!(
            "velocity columns differ from the positions, which are used, by {rms:.3} m/s rms"
        );
        (worst_s, text)
    })
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
    (given > 20.0 && best < 0.25 * given)
        .then(|| format!("yaw is {given:.0}° from the mean course, {best:.1}° when read {words}"))
}

// A recorded trajectory that is only compared with: what jumps is left out.

impl Rows {
    /// The stretches of the rows between what no vehicle does, and what is doubtful about them.
    fn reference(mut self) -> Result<(Reference, Vec<String>), Error> {
        self.doubt_of_trajectory();
        let found = breaks(&self.samples);
        let mut refused = None;
        if self.samples.is_empty() {
            let left_out = self.doubts.first().cloned();
            let message = left_out.unwrap_or_else(|| format!("{}: no rows in it", self.path));
            return Err(
                Error::input(message).hint("check units: angles are in degrees, or named _rad")
            );
        }
        let (mut stretches, mut seconds) = (Vec::new(), 0.0);
        let mut contradicted = None;
        for range in usable(&self.samples, &found) {
            match self.stretch(range.clone()) {
                Ok(stretch) => {
                    let velocities = self.velocities.get(range.clone()).into_iter().flatten();
                    let times = self.samples[range.clone()].iter().map(|s| s.t_s);
                    let given: Vec<_> = times.zip(velocities.copied()).collect();
                    contradicted = contradicted.or_else(|| contradiction(&stretch, &given));
                    seconds += stretch.end_s() - stretch.start_s();
                    stretches.push(stretch);
                }
                Err(source) => refused = refused.or(Some(source)),
            }
        }
        if let Some((_, text)) = contradicted {
            self.doubt(None, text);
        }
        let parts = stretches.len();
        let Some(reference) = Reference::of_stretches(stretches) else {
            let whole = self.stretch(0..self.samples.len()).err();
            let none = "no five seconds without a jump in position or attitude";
            let none = || Error::contents(&self.path, Place::Within, none);
            return Err(refused.or(whole).unwrap_or_else(none));
        };
        if let Some(first) = found.first() {
            let (line, at) = (self.lines[first.index], self.samples[first.index].t_s);
            let other = found.len() - 1;
            let text = format!(
                "{} at {at:.2} s and {other} more: compared with {seconds:.1} s in {parts} stretches",
                first.fault
            );
            self.doubt(Some(line), text);
        } else if let Some(source) = refused {
            self.doubt(None, format!("left out of the comparison: {source}"));
        }
        Ok((reference, self.doubts))
    }

    /// The trajectory through some rows.
    fn stretch(&self, range: Range<usize>) -> Result<Trajectory, Error> {
        use trajectory::TrajectoryError as E;
        let through = |samples: &[TrajectorySample]| {
            Trajectory::from_samples(samples).map_err(|source| {
                let advice = match source {
                    E::Time { .. } => Some("remove repeated rows, sort by time, or split the file where the clock was set back"),
                    E::Rotation { .. } => Some("an angle in the wrong column or unit? Such fast turns need more rows"),
                    E::TooFew { .. } => Some("give at least four rows, one a second or more"),
                    E::Latitude { .. } => Some("latitude and longitude cannot navigate at the poles; is a column swapped?"),
                    E::NotFinite { .. } => None,
                };
                let last = samples.len().saturating_sub(1);
                let index = range.start + source.index().unwrap_or(last);
                let line = self.lines.get(index).copied().unwrap_or(1);
                let refusal = Error::contents(&self.path, line, source.to_string());
                refusal.or_hint_if(advice.map(str::to_owned))
            })
        };
        let mut samples = self.samples[range.clone()].to_vec();
        if self.follows_path {
            through(&samples)?; // times increase, positions are on the Earth
            follow_path(&mut samples);
        }
        through(&samples)
    }
}

#[cfg(test)]
mod import_tests {
    use super::*;
    use crate::io::fusion_files::WEEK_S;
    use crate::io::tests::{answers, told};
    use approx::assert_abs_diff_eq;
    use nav_sim_navigation::frames::RollPitchYaw;
    use nav_sim_navigation::trajectory::Trajectory;

    type Loaded = Result<(Trajectory, Vec<String>), Error>;

    fn nav(text: &str) -> Loaded {
        rows("truth.nav", text, "nav", None, Purpose::Drive)?.trajectory()
    }

    fn tum(path: &str, text: &str, origin: Option<[f64; 3]>) -> Loaded {
        rows(path, text, "tum", origin, Purpose::Drive)?.trajectory()
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
        let v_n = t.state(604_800.0).v_n;
        assert_abs_diff_eq!(v_n.y, 19.2, epsilon = 0.02);
    }

    #[test]
    fn tum_files_are_read_with_the_axes_of_ros() {
        let text: String = (0..6)
            .map(|k| format!("{k}.5 {} 0 0 0 0 0 1\n", 3 * k))
            .collect();
        let origin = Some([0.8, 0.1, 50.0]);
        let (t, warnings) = tum("a.tum", &text, origin).unwrap();
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
        insta::assert_snapshot!(answers([
            ("no origin", tum("a.tum", &text, None).map_err(|e| told(&e))),
            (
                "0 0 0 0 0 0 0 2",
                tum("a.tum", "0 0 0 0 0 0 0 2\n", origin).map_err(|e| told(&e))
            ),
            ("2016 1 2 3", nav("2016 1 2 3\n").map_err(|e| told(&e))),
        ]));
    }
}

// GPX tracks: time, latitude, longitude, elevation of every track point.
//
// Format: <https://www.topografix.com/GPX/1/1/>. Elements are known by their names without the prefix of a
// namespace; comments, extensions and everything outside track points are passed over.

/// A GPX track; heading and pitch follow the path.
fn gpx(path: &str, text: &str) -> Result<Rows, Error> {
    let document = Document::parse(text).map_err(|e| {
        let line = u64::from(e.pos().row);
        Error::contents(path, line, format!("not well-formed XML: {e}"))
    })?;
    let mut rows = Rows {
        path: path.to_owned(),
        follows_path: true,
        ..Rows::default()
    };
    let (mut start, mut line, mut counted) = (None, 1, 0);
    let nodes = document.descendants();
    for point in nodes.filter(|node| node.tag_name().name() == "trkpt") {
        let begin = point.range().start;
        line += text[counted..begin].matches('\n').count() as u64;
        counted = begin;
        // extensions have times and elevations of their own
        let child = |name| point.children().find(|own| own.tag_name().name() == name);
        let text = |name| {
            let child = || child(name)?.children().find(Node::is_text)?.text();
            point.attribute(name).or_else(child)
        };
        let absent = |column| {
            let reason = "does not have it, or not as a number";
            Error::cell(path, line, column, "the track point", reason).or_hint(
                "every <trkpt> needs lat, lon, <ele> and <time>: export them with the track",
            )
        };
        let number = |column| {
            let number = text(column).and_then(|text| text.trim().parse::<f64>().ok());
            number.ok_or_else(|| absent(column))
        };
        let time = text("time").and_then(|text| instant(text.trim()));
        let time = time.ok_or_else(|| absent("time"))?;
        rows.samples.push(TrajectorySample {
            t_s: (time - *start.get_or_insert(time)).as_seconds_f64(),
            lat: number("lat")? * DEG,
            lon: number("lon")? * DEG,
            h: number("ele")?,
            q_b_n: DQuat::IDENTITY,
        });
        rows.lines.push(line);
    }
    if rows.samples.is_empty() {
        return Err(Error::contents(path, Place::Within, "no rows in it"));
    }
    rows.doubt(
        None,
        "GPX: heading and pitch follow the path, roll is 0; elevations count as ellipsoidal heights",
    );
    Ok(rows)
}

/// A time as GPX has it: 2024-05-01T10:20:30.5Z, with another offset, or without one (UTC).
fn instant(text: &str) -> Option<DateTime<Utc>> {
    let parsed = DateTime::parse_from_rfc3339(text)
        .or_else(|_| DateTime::parse_from_rfc3339(&format!("{text}Z")));
    parsed.ok().map(|time| time.to_utc())
}

#[cfg(test)]
mod gpx_tests {
    use super::*;
    use crate::io::tests::{answers, told};
    use glam::DVec3;
    use nav_sim_navigation::frames::RollPitchYaw;
    use nav_sim_navigation::trajectory::Trajectory;

    fn load(path: &str, text: &str) -> Result<(Trajectory, Vec<String>), Error> {
        gpx(path, text)?.trajectory()
    }

    /// Nine points north, 1e-4 degrees and a metre up a second, across a leap day and into another time zone.
    fn track() -> String {
        let point = |k: u32| {
            let lat = 46.0 + 1e-4 * f64::from(k);
            format!(
                "<trkpt lon='7.0' lat=\"{lat}\">\n<ele>{}</ele><time>2024-02-29T23:59:{}Z</time></trkpt>\n",
                500 + k,
                52 + k
            )
        };
        let last = "<trkpt lat=\"46.0008\" lon=\"7\"><ele>508</ele><time>2024-03-01T02:00:00+02:00</time></trkpt>";
        let points: String = (0..8).map(point).collect();
        format!("<gpx>\n<trk><trkseg>\n{points}{last}</trkseg></trk></gpx>")
    }

    #[test]
    fn a_byte_order_mark_is_no_part_of_a_file() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.gpx");
        std::fs::write(&path, format!("\u{feff}{}", track())).unwrap();
        let (t, _) = super::load(&path, None).unwrap();
        assert_eq!((t.start_s(), t.end_s()), (0.0, 8.0));
    }

    #[test]
    fn tracks_get_their_heading_from_the_path() {
        let text = track();
        let (t, warnings) = load("a.gpx", &text).unwrap();
        assert_eq!((t.start_s(), t.end_s(), warnings.len()), (0.0, 8.0, 1));
        let (v_n, rpy) = (
            t.state(4.0).v_n,
            RollPitchYaw::from_quat(t.state(4.0).q_b_n),
        );
        assert!(
            (v_n - DVec3::new(11.117, 0.0, -1.0)).length() < 0.01,
            "{v_n}"
        );
        let pitch = (1.0_f64 / 11.117).atan();
        assert!(
            rpy.yaw.abs() < 1e-6 && (rpy.pitch - pitch).abs() < 1e-3,
            "{rpy:?}"
        );
    }

    #[test]
    fn what_is_no_track_is_refused_with_its_line() {
        let text = track();
        insta::assert_snapshot!(answers(
            [
                ("no height", text.replacen("<ele>500</ele>", "", 1)),
                ("no points", "<gpx></gpx>".to_owned()),
                ("no XML", text.replacen("</trkpt>", "</trkseg>", 1)),
                ("bad month", text.replacen("-02-", "-00-", 1)),
                (
                    "a far stamp",
                    text.replacen("2024-03-01T02", "2024-05-01T02", 1)
                ),
                ("a far height", text.replacen("<ele>503", "<ele>4e7", 1)),
            ]
            .map(|(name, text)| (name, load("a.gpx", &text).map_err(|e| told(&e))))
        ));
    }

    #[test]
    fn prefixes_comments_and_extensions_change_nothing() {
        let written = track()
            .replace("<trk", "<g:trk")
            .replace("</trk", "</g:trk")
            .replace("<ele>", "<g:ele><!-- metres --><![CDATA[")
            .replace("</ele>", "]]></g:ele>")
            .replace(
                "<time>",
                "<g:extensions><ele>9</ele><x:time/></g:extensions><g:time>\n  ",
            )
            .replace("</time>", "\n</g:time>")
            .replace(
                "<gpx>",
                "<?xml version=\"1.0\"?>\n<gpx xmlns:g='u' xmlns:x='v'><!-- <trkpt lat='1'> -->",
            );
        let (plain, other) = (
            gpx("a.gpx", &track()).unwrap(),
            gpx("a.gpx", &written).unwrap(),
        );
        assert_eq!(plain.samples, other.samples);
        assert_eq!((plain.lines[0], other.lines[0]), (3, 4));
    }

    #[test]
    fn times_have_fractions_offsets_and_leap_seconds() {
        let start = instant("2016-12-31T23:59:59.75Z").unwrap();
        for (text, seconds) in [
            ("2016-12-31T23:59:60.5Z", 0.75),
            ("2017-01-01T00:00:00Z", 0.25),
            ("2017-01-01T00:00:01.125", 1.375),
            ("2017-01-01T01:30:00+01:30", 0.25),
        ] {
            assert_eq!(
                (instant(text).unwrap() - start).as_seconds_f64(),
                seconds,
                "{text}"
            );
        }
        assert!(
            ["", "2017-02-29T00:00:00Z", "2017-01-01", "noon"]
                .iter()
                .all(|text| instant(text).is_none())
        );
    }
}

// Trajectories as CSV.

/// Instants of a trajectory: evenly spaced ones from the start (Hz), or those that it was made from.
pub(crate) fn instants(trajectory: &Trajectory, rate_hz: Option<f64>) -> Vec<f64> {
    let Some(rate_hz) = rate_hz else {
        return trajectory.knots().to_vec();
    };
    let start_s = trajectory.start_s();
    let steps = ((trajectory.end_s() - start_s) * rate_hz + 1e-6).floor() as u64;
    (0..=steps).map(|k| start_s + k as f64 / rate_hz).collect()
}

/// The header of a trajectory as CSV.
pub(crate) const HEADER: &str =
    "t_s,lat_deg,lon_deg,h_m,v_n_m_s,v_e_m_s,v_d_m_s,roll_deg,pitch_deg,yaw_deg\n";

/// A trajectory as CSV. Positions are written with the digits that read back to them, since accelerations are their second
/// differences; times to the nanosecond, velocities to 1e-9 m/s, angles to 1e-12 degrees.
pub(crate) fn csv(trajectory: &Trajectory, rate_hz: Option<f64>) -> String {
    let mut text = HEADER.to_owned();
    for t_s in instants(trajectory, rate_hz) {
        let state = trajectory.state(t_s);
        let (v, rpy) = (state.v_n, RollPitchYaw::from_quat(state.q_b_n));
        let [v_n, v_e, v_d] = v.to_array().map(|v| tidy(v, 9));
        let [roll, pitch, yaw] = [rpy.roll, rpy.pitch, rpy.yaw].map(|a| tidy(a / DEG, 12));
        let (lat, lon) = (state.lat / DEG + 0.0, wrap_angle(state.lon) / DEG + 0.0);
        let (t_s, h) = (tidy(t_s, 9), state.h + 0.0);
        let _ = writeln!(
            text,
            "{t_s},{lat},{lon},{h},{v_n},{v_e},{v_d},{roll},{pitch},{yaw}"
        );
    }
    text
}

/// The rows as TUM has them, in the axes of ROS ([REP 103](https://www.ros.org/reps/rep-0103.html)) at an origin, or at the first
/// row: what the reader of TUM files turns back.
pub(crate) fn tum(
    trajectory: &Trajectory,
    rate_hz: Option<f64>,
    origin: Option<[f64; 3]>,
) -> String {
    let all = instants(trajectory, rate_hz);
    let first = trajectory.state(trajectory.start_s());
    let [lat0, lon0, h0] = origin.unwrap_or([first.lat, first.lon, first.h]);
    let (q_e_n0, r_e0) = (q_e_n(lat0, lon0), geodetic_to_ecef(lat0, lon0, h0));
    let (lat_deg, lon_deg) = (lat0 / DEG, lon0 / DEG);
    let mut text = format!(
        "# t_s x y z (m; east, north, up) qx qy qz qw (forward, left, up) (nav-sim trajectory convert)\n\
         # origin: {lat_deg}, {lon_deg}, {h0}\n"
    );
    for t_s in all {
        let state = trajectory.state(t_s);
        let r_e = geodetic_to_ecef(state.lat, state.lon, state.h) - r_e0;
        let q_b_n0 = q_e_n0 * q_e_n(state.lat, state.lon).inverse() * state.q_b_n;
        let q = ENU_NED * q_b_n0 * DQuat::from_rotation_x(PI);
        let [x, y, z] = (ENU_NED * (q_e_n0 * r_e)).to_array().map(|x| tidy(x, 6));
        let [qx, qy, qz, qw] = q.to_array().map(|x| tidy(x, 12));
        let _ = writeln!(text, "{} {x} {y} {z} {qx} {qy} {qz} {qw}", tidy(t_s, 9));
    }
    text
}

/// The nearest number of this many decimals; no negative zero.
fn tidy(x: f64, decimals: i32) -> f64 {
    let scale = 10_f64.powi(decimals);
    (x * scale).round() / scale + 0.0
}

#[cfg(test)]
mod csv_tests {
    use super::*;

    #[test]
    fn numbers_are_tidy() {
        let shown =
            [-0.0, 0.1 + 0.2, -1e-14, 45.000_000_000_000_01].map(|x| tidy(x, 9).to_string());
        assert_eq!(shown, ["0", "0.3", "0", "45"]);
    }
}
