//! Recorded GNSS fixes.

use super::nmea::{self, is_nmea};
use super::rtklib::{self, is_rtklib};
use super::{Remark, bare_columns, table, time_back};
use crate::formats::suggest::nearest;
use crate::formats::trajectory_file::table::{Table, text};
use crate::formats::{FileError as Error, Kind, Place, Setting};
use glam::DVec3;
use nav_sim_navigation::earth::{MAX_LATITUDE, geodetic_to_ecef};
use nav_sim_navigation::gnss::{FixSigma, GnssFix, GnssVelocity};
use nav_sim_signal::units::DEG;
use std::f64::consts::PI;
use std::path::Path;

/// Seconds of a GNSS week.
pub(super) const WEEK_S: f64 = 604_800.0;
/// Faster than this from one fix to the next is no motion (m/s).
const MAX_SPEED: f64 = 8000.0;

/// Quantities: our own name, and the names without a unit that other programs have for it.
const QUANTITIES: [(&str, &[&str]); 14] = [
    ("t_s", &["t", "time", "timestamp", "tow", "sow"]),
    ("lat_deg", &["lat", "latitude"]),
    ("lon_deg", &["lon", "lng", "longitude"]),
    ("h_m", &["h", "height", "alt", "altitude"]),
    ("sd_n_m", &["sd_n", "std_n", "sigma_n", "pos_std_n", "sd_north", "sd_lat"]),
    ("sd_e_m", &["sd_e", "std_e", "sigma_e", "pos_std_e", "sd_east", "sd_lon"]),
    ("sd_d_m", &["sd_d", "std_d", "sigma_d", "pos_std_d", "sd_u", "std_u", "sd_h"]),
    ("v_n_m_s", &["v_n", "vn"]),
    ("v_e_m_s", &["v_e", "ve"]),
    ("v_d_m_s", &["v_d", "vd"]),
    ("sd_vn_m_s", &["sd_vn", "sd_v_n", "vel_std_n"]),
    ("sd_ve_m_s", &["sd_ve", "sd_v_e", "vel_std_e"]),
    ("sd_vd_m_s", &["sd_vd", "sd_v_d", "vel_std_d"]),
    ("week", &["week"]),
];
/// Time, position and its deviations: what every file has.
pub(super) const POSITION: usize = 7;
/// Velocity and its deviations.
const VELOCITY: std::ops::Range<usize> = 7..13;
const WEEK: usize = 13;
/// The columns of a KF-GINS text with velocity: its deviations stand behind the velocity.
const KF_GINS_VELOCITY: [usize; 13] = [0, 1, 2, 3, 7, 8, 9, 4, 5, 6, 10, 11, 12];
/// What a text without a header may be.
const KF_GINS: &str = "a KF-GINS text has 7 columns (t_s, latitude, longitude, height, standard deviations north, east, \
                       down), or 13 (t_s, latitude, longitude, height, velocity north, east, down, their standard \
                       deviations: position, velocity)";

/// What the columns are called.
pub(super) const COLUMNS: &str = "a GNSS file has the columns t_s, lat_deg, lon_deg, h_m, sd_n_m, sd_e_m, sd_d_m and may \
                                  have v_n_m_s, v_e_m_s, v_d_m_s, sd_vn_m_s, sd_ve_m_s, sd_vd_m_s; or it is a KF-GINS \
                                  text of 7 columns, or of 13 with velocity, or a solution of RTKLIB, or NMEA sentences";

/// The quantity of a column and the factor to SI (angles: radians); none if it means nothing here.
fn classify(name: &str) -> Option<(usize, f64)> {
    let name = name.to_lowercase().replace([' ', '-'], "_");
    if name == "gps_week" {
        return Some((WEEK, 1.0));
    }
    let endings: [(&str, f64, std::ops::RangeInclusive<usize>); 9] = [
        ("_m_s", 1.0, 7..=12),
        ("_mps", 1.0, 7..=12),
        ("_ms", 1e-3, 0..=0),
        ("_us", 1e-6, 0..=0),
        ("_ns", 1e-9, 0..=0),
        ("_s", 1.0, 0..=0),
        ("_deg", DEG, 1..=2),
        ("_rad", 1.0, 1..=2),
        ("_m", 1.0, 3..=6),
    ];
    let of_stem = |stem: &str| QUANTITIES.iter().position(|(_, stems)| stems.contains(&stem));
    let with = endings.into_iter().find_map(|(ending, factor, legal)| {
        let index = of_stem(name.strip_suffix(ending)?)?;
        legal.contains(&index).then_some((index, factor))
    });
    // without a unit: seconds, degrees, metres, metres a second
    with.or_else(|| of_stem(&name).map(|i| (i, if i == 1 || i == 2 { DEG } else { 1.0 })))
}

/// Where each quantity stands: column and factor.
struct Columns([Option<(usize, f64)>; QUANTITIES.len()]);

impl Columns {
    /// Standard deviations that are not of the file, and columns that are not used.
    fn remarks(&self, ignored: &[String]) -> Vec<Remark> {
        let unstated = |quantity: usize| self.0[quantity].is_none();
        let mut remarks = Vec::new();
        if unstated(4) || self.0[VELOCITY.start].is_some() && unstated(10) {
            remarks.push(Remark::note("standard deviations as given for all fixes"));
        }
        if !ignored.is_empty() {
            remarks.push(Remark::note(format!("columns not used: {}", ignored.join(", "))));
        }
        remarks
    }

    fn of(table: &Table, unsaid: Option<&FixSigma>) -> Result<(Self, Vec<String>), Error> {
        let mut columns = Self([None; QUANTITIES.len()]);
        let mut ignored = Vec::new();
        for (at, name) in table.columns.iter().enumerate() {
            let Some((quantity, factor)) = classify(name) else {
                ignored.push(name.clone());
                continue;
            };
            if let Some((earlier, _)) = columns.0[quantity].replace((at, factor)) {
                return Err(table.given_twice([earlier, at], QUANTITIES[quantity].0));
            }
        }
        columns.complete(table, &ignored, unsaid)?;
        Ok((columns, ignored))
    }

    /// Position and its deviations are needed; velocity and its deviations come together or not at all.
    /// What is missing in all of a position or velocity may be given for the whole file.
    fn complete(&self, table: &Table, ignored: &[String], unsaid: Option<&FixSigma>) -> Result<(), Error> {
        let has_velocity = VELOCITY.into_iter().any(|i| self.0[i].is_some());
        let needed = if has_velocity { 0..VELOCITY.end } else { 0..POSITION };
        let none_of =
            |quantities: std::ops::Range<usize>| quantities.into_iter().all(|i| self.0[i].is_none());
        let given = |i: usize| match i {
            4..7 => unsaid.is_some() && none_of(4..7),
            10..13 => unsaid.is_some_and(|s| s.vel_m_s.is_some()) && none_of(10..13),
            _ => false,
        };
        let missing: Vec<&str> =
            needed.filter(|i| self.0[*i].is_none() && !given(*i)).map(|i| QUANTITIES[i].0).collect();
        if missing.is_empty() {
            return Ok(());
        }
        let slip = ignored.iter().find_map(|name| Some((name, nearest(name, missing.iter().copied())?)));
        let verb = if missing.len() == 1 { "is" } else { "are" };
        let mut columns = format!("{} {verb}", missing.join(", "));
        if let Some((name, meant)) = slip {
            columns = format!("\"{name}\" is not known (\"{meant}\"?); {columns}");
        }
        let kind = Kind::Columns(format!("{columns} missing").into());
        let error = Error::new(table.path.as_str(), table.header_line, kind).advice(COLUMNS);
        // a receiver's log that has all but these
        let only_sigma = slip.is_none() && missing.iter().all(|name| name.starts_with("sd_"));
        Err(if only_sigma { error.setting(Setting::FixSigma) } else { error })
    }

    fn value(&self, quantity: usize, row: &[f64]) -> f64 {
        self.0[quantity].map_or(0.0, |(column, factor)| row[column] * factor)
    }

    fn triad(&self, first: usize, row: &[f64]) -> DVec3 {
        DVec3::new(self.value(first, row), self.value(first + 1, row), self.value(first + 2, row))
    }
}

/// A file of fixes that is not read, told by its first characters.
fn of_another_kind(path: &str, text: &str) -> Option<Error> {
    let text = text.trim_start_matches('\u{feff}').trim_start();
    let error = || {
        Error::contents(path, 1_u64, "XML, as GPX and KML are, not a table of fixes").advice(
            "write its points as a table t_s, lat_deg, lon_deg, h_m on the clock of the IMU, and give their standard deviations \
             with --gnss-sigma",
        )
    };
    text.starts_with('<').then(error)
}

/// Reads fixes: a table with a header, or the text of KF-GINS (time, latitude, longitude (deg), height (m),
/// standard deviations north, east, down (m); or with velocity behind the height and its deviations behind
/// those), a solution of RTKLIB, NMEA sentences. `unsaid` are the standard deviations where the file states none, `clock_s` when
/// the IMU begins and ends, where there is one. Also what is doubtful about it.
///
/// # Errors
/// Whatever is wrong with it, with its line.
pub(crate) fn read_gnss(
    path: &Path,
    unsaid: Option<&FixSigma>,
    clock_s: Option<(f64, f64)>,
) -> Result<(Vec<GnssFix>, Vec<Remark>), Error> {
    let shown = path.display().to_string();
    let text = text(path)?;
    if let Some(error) = of_another_kind(&shown, &text) {
        return Err(error);
    }
    let (fixes, remarks) = if is_nmea(&text) {
        nmea::fixes(&shown, &text, unsaid, clock_s)?
    } else {
        of_table(path, text, unsaid)?
    };
    for pair in fixes.windows(2) {
        check_step(&shown, pair[1].0, &pair[0].1, &pair[1].1)?;
    }
    let fixes = fixes.into_iter().map(|(_, fix)| fix).collect();
    Ok((fixes, remarks.into_iter().map(|r| r.of_file(&shown)).collect()))
}

/// Fixes with their lines, and remarks.
pub(super) type Fixes = (Vec<(u64, GnssFix)>, Vec<Remark>);

/// The fixes of a table, of KF-GINS or of RTKLIB.
fn of_table(path: &Path, mut text: String, unsaid: Option<&FixSigma>) -> Result<Fixes, Error> {
    let mut remarks = Vec::new();
    let is_rtklib = is_rtklib(&text);
    if is_rtklib {
        let (table, remark) = rtklib::rows(&path.display().to_string(), &text)?;
        (text, remarks) = (table, vec![Remark::note(remark)]);
    }
    let bare = bare_columns(&text);
    let names = bare.map(|columns| bare_names(path, columns)).transpose()?;
    let table = table(path, &text, names.as_deref())?;
    let (columns, ignored) = Columns::of(&table, unsaid)?;
    if bare.is_some() && !is_rtklib {
        let velocity = if columns.0[VELOCITY.start].is_some() { ", velocity" } else { "" };
        let text = format!("no header: read as KF-GINS text, position{velocity} and standard deviations");
        remarks.push(Remark::note(text));
    }
    remarks.extend(columns.remarks(&ignored));
    let mut fixes = Vec::with_capacity(table.rows.len());
    for (line, row) in &table.rows {
        check_values(&table, &columns, *line, row)?;
        fixes.push((*line, fix(&columns, row, unsaid)));
    }
    let small = |(_, f): &(u64, GnssFix)| f.lat.abs() <= 0.5 * PI * DEG && f.lon.abs() <= 2.0 * PI * DEG;
    if fixes.iter().all(small) {
        let text = "latitude and longitude never exceed π: radians? Then name the columns lat_rad, lon_rad";
        remarks.push(Remark::doubt(text));
    }
    Ok((fixes, remarks))
}

/// The columns of a KF-GINS text, which has no header.
fn bare_names(path: &Path, columns: usize) -> Result<Vec<&'static str>, Error> {
    match columns {
        POSITION => Ok(QUANTITIES[..POSITION].iter().map(|(name, _)| *name).collect()),
        13 => Ok(KF_GINS_VELOCITY.map(|i| QUANTITIES[i].0).to_vec()),
        _ => {
            let message = format!("{columns} columns without a header");
            Err(Error::contents(path.display().to_string(), Place::Within, message).advice(KF_GINS))
        }
    }
}

fn fix(columns: &Columns, row: &[f64], unsaid: Option<&FixSigma>) -> GnssFix {
    let value = |quantity| columns.value(quantity, row);
    let has_velocity = columns.0[VELOCITY.start].is_some();
    let sigma = |first: usize, otherwise: Option<[f64; 3]>| match (columns.0[first], otherwise) {
        (None, Some(sigma)) => sigma.into(),
        _ => columns.triad(first, row),
    };
    GnssFix {
        t_s: value(0) + value(WEEK) * WEEK_S,
        lat: value(1),
        lon: value(2),
        h: value(3),
        pos_sigma_n: sigma(4, unsaid.map(|s| s.pos_m)),
        velocity: has_velocity
            .then(|| GnssVelocity::new(columns.triad(7, row), sigma(10, unsaid.and_then(|s| s.vel_m_s)))),
    }
}

fn check_values(table: &Table, columns: &Columns, line: u64, row: &[f64]) -> Result<(), Error> {
    let refuse = |quantity: usize, reason| {
        let index = columns.0[quantity].map_or(0, |(index, _)| index);
        let column = &table.columns[index];
        let advice = if column.starts_with("lat") || column.starts_with("lon") {
            "latitude within ±89.9, longitude in (−180, 180] or [0, 360), in degrees (or name the columns lat_rad, \
             lon_rad)"
        } else {
            "a fix needs the standard deviations its receiver believes; remove rows without"
        };
        Err(Error::cell(&table.path, line, column, row[index].to_string(), reason).advice(advice))
    };
    let (lat, lon) = (columns.value(1, row), columns.value(2, row));
    if lat.abs() > 90.0 * DEG {
        return refuse(1, "is not a latitude");
    }
    if lat.abs() > MAX_LATITUDE {
        return refuse(1, "is too near a pole to navigate in latitude and longitude");
    }
    if !(-180.0 * DEG - 1e-9..=360.0 * DEG + 1e-9).contains(&lon) {
        return refuse(2, "is not a longitude");
    }
    for quantity in (4..POSITION).chain(10..VELOCITY.end).filter(|q| columns.0[*q].is_some()) {
        if columns.value(quantity, row) <= 0.0 {
            return refuse(quantity, "is not a standard deviation: it must be above 0");
        }
    }
    Ok(())
}

fn check_step(path: &str, line: u64, before: &GnssFix, fix: &GnssFix) -> Result<(), Error> {
    let seconds = fix.t_s - before.t_s;
    if seconds <= 0.0 {
        return Err(time_back(path, line, before.t_s, fix.t_s));
    }
    let place = |f: &GnssFix| geodetic_to_ecef(f.lat, f.lon, f.h);
    let metres = place(fix).distance(place(before));
    if metres <= MAX_SPEED * seconds {
        return Ok(());
    }
    let message = format!("the fix is {metres:.0} m from the one {} s before", (1e6 * seconds).round() / 1e6);
    Err(Error::contents(path, line, message)
        .advice("is a latitude swapped with a longitude, a sign lost, or a row damaged?"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_quantity_in_two_columns_is_refused() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("gnss.csv");
        let text = "t_s,lat_deg,lon_deg,h_m,sd_n_m,sd_e_m,sd_d_m,altitude\n0,46,7,400,1,1,2,450\n";
        std::fs::write(&path, text).unwrap();
        let e = read_gnss(&path, None, None).unwrap_err();
        assert!(e.to_string().ends_with("line 1: columns \"h_m\" and \"altitude\" both give h_m"), "{e}");
        assert_eq!(e.hint().unwrap(), "remove one of them");
    }
}
