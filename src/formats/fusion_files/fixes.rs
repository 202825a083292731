//! Recorded GNSS fixes.

use super::nmea::{self, is_nmea};
use super::rtklib::{self, is_rtklib};
use super::{Remark, bare_columns, log, table, time_back};
use crate::formats::trajectory_file::columns::{Column, Columns, Known, Unit};
use crate::formats::trajectory_file::table::{Table, text};
use crate::formats::{FileError as Error, Place, Setting, logs};
use glam::{DMat3, DVec3};
use nav_sim_navigation::earth::{A, MAX_LATITUDE, ecef_to_geodetic, geodetic_to_ecef};
use nav_sim_navigation::frames::q_e_n;
use nav_sim_navigation::gnss::{FixSigma, GnssFix, GnssVelocity};
use nav_sim_signal::units::DEG;
use std::f64::consts::PI;
use std::path::Path;

/// Seconds of a GNSS week.
pub(super) const WEEK_S: f64 = 604_800.0;
/// Faster than this from one fix to the next is no motion (m/s).
const MAX_SPEED: f64 = 8000.0;

/// Quantities of fixes, as a KF-GINS text has them; a deviation up is one down.
static KNOWN: [Known; 20] = [
    Known::new(
        "t_s",
        &["t", "time", "timestamp", "tow", "sow"],
        Unit::Time,
        true,
    ),
    Known::new("lat_deg", &["lat", "latitude"], Unit::Angle, true),
    Known::new("lon_deg", &["lon", "lng", "longitude"], Unit::Angle, true),
    Known::new(
        "h_m",
        &["h", "height", "alt", "altitude"],
        Unit::Length,
        true,
    ),
    Known::new(
        "sd_n_m",
        &[
            "sd_n",
            "std_n",
            "sigma_n",
            "pos_std_n",
            "sd_north",
            "sd_lat",
        ],
        Unit::Length,
        true,
    ),
    Known::new(
        "sd_e_m",
        &["sd_e", "std_e", "sigma_e", "pos_std_e", "sd_east", "sd_lon"],
        Unit::Length,
        true,
    ),
    Known::new(
        "sd_d_m",
        &[
            "sd_d",
            "std_d",
            "sigma_d",
            "pos_std_d",
            "sd_u",
            "std_u",
            "sd_h",
        ],
        Unit::Length,
        true,
    ),
    Known::new("v_n_m_s", &["v_n", "vn"], Unit::Speed, true),
    Known::new("v_e_m_s", &["v_e", "ve"], Unit::Speed, true),
    Known::new("v_d_m_s", &["v_d", "vd"], Unit::Speed, true),
    Known::new(
        "sd_vn_m_s",
        &["sd_vn", "sd_v_n", "vel_std_n"],
        Unit::Speed,
        true,
    ),
    Known::new(
        "sd_ve_m_s",
        &["sd_ve", "sd_v_e", "vel_std_e"],
        Unit::Speed,
        true,
    ),
    Known::new(
        "sd_vd_m_s",
        &["sd_vd", "sd_v_d", "vel_std_d"],
        Unit::Speed,
        true,
    ),
    Known::new("week", &["week", "gps_week"], Unit::Count, true),
    Known::new(
        "x_m",
        &["x", "x_ecef", "ecef_x", "pos_x"],
        Unit::Length,
        true,
    ),
    Known::new(
        "y_m",
        &["y", "y_ecef", "ecef_y", "pos_y"],
        Unit::Length,
        true,
    ),
    Known::new(
        "z_m",
        &["z", "z_ecef", "ecef_z", "pos_z"],
        Unit::Length,
        true,
    ),
    Known::new(
        "sd_x_m",
        &["sd_x", "sdx", "std_x", "sigma_x"],
        Unit::Length,
        true,
    ),
    Known::new(
        "sd_y_m",
        &["sd_y", "sdy", "std_y", "sigma_y"],
        Unit::Length,
        true,
    ),
    Known::new(
        "sd_z_m",
        &["sd_z", "sdz", "std_z", "sigma_z"],
        Unit::Length,
        true,
    ),
];
const PLACE: [&str; 4] = ["t_s", "lat_deg", "lon_deg", "h_m"];
const PLACE_SIGMA: [&str; 3] = ["sd_n_m", "sd_e_m", "sd_d_m"];
/// The same in the Earth's axes.
const PLACE_E: [&str; 4] = ["t_s", "x_m", "y_m", "z_m"];
const PLACE_SIGMA_E: [&str; 3] = ["sd_x_m", "sd_y_m", "sd_z_m"];
const VELOCITY: [&str; 3] = ["v_n_m_s", "v_e_m_s", "v_d_m_s"];
const VELOCITY_SIGMA: [&str; 3] = ["sd_vn_m_s", "sd_ve_m_s", "sd_vd_m_s"];
/// Columns of a text without a header, with positions alone.
pub(super) const POSITION: usize = 7;

/// Columns of such files.
pub(super) const COLUMNS: &str = "columns: t_s, lat_deg, lon_deg, h_m (or x_m, y_m, z_m), sd_n_m, sd_e_m, sd_d_m; with velocity v_n_m_s … and sd_vn_m_s …";

/// Axes of three columns.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Axes {
    /// Latitude, longitude, height; north, east, down.
    Local,
    /// The Earth's x, y, z.
    Earth,
}

/// Columns of each quantity; standard deviations may be given for the whole file.
struct FixColumns<'a> {
    place: ([Column; 4], Axes),
    place_sigma: Option<([Column; 3], Axes)>,
    velocity: Option<[Column; 3]>,
    velocity_sigma: Option<[Column; 3]>,
    week: Option<Column>,
    unsaid: Option<&'a FixSigma>,
}

impl<'a> FixColumns<'a> {
    /// Finds them; also the names of those that are not used. Position and its deviations are needed; velocity and its
    /// deviations come together or not at all.
    fn new(table: &Table, unsaid: Option<&'a FixSigma>) -> Result<(Self, Vec<String>), Error> {
        let columns = Columns::new(table, &KNOWN)?;
        let any = |names: [&str; 3]| names.into_iter().any(|name| columns.has(name));
        // what is missing in all of a position or velocity may be given for the whole file
        let is_given = |names: [&str; 3], given: bool| given && !any(names);
        let in_earth = |names: [&str; 3], local: &str| any(names) && !columns.has(local);
        let (place, axes) = match in_earth(["x_m", "y_m", "z_m"], "lat_deg") {
            true => (PLACE_E, Axes::Earth),
            false => (PLACE, Axes::Local),
        };
        let (place_sigma, sigma_axes) = match in_earth(PLACE_SIGMA_E, "sd_n_m") {
            true => (PLACE_SIGMA_E, Axes::Earth),
            false => (PLACE_SIGMA, Axes::Local),
        };
        let mut needed = place.to_vec();
        if !is_given(place_sigma, unsaid.is_some()) {
            needed.extend(place_sigma);
        }
        if any(VELOCITY) || any(VELOCITY_SIGMA) {
            needed.extend(VELOCITY);
            if !is_given(
                VELOCITY_SIGMA,
                unsaid.is_some_and(|sigma| sigma.vel_m_s.is_some()),
            ) {
                needed.extend(VELOCITY_SIGMA);
            }
        }
        let is_sigma = |name: &&'static str| name.starts_with("sd_");
        columns.require(
            table,
            needed.iter().copied().filter(|name| !is_sigma(name)),
            COLUMNS,
        )?;
        // a receiver's log that has all but these
        columns
            .require(table, needed, COLUMNS)
            .map_err(|e| e.setting(Setting::FixSigma))?;
        let [Some(t), Some(a), Some(b), Some(c)] = place.map(|name| columns.get(name)) else {
            return Err(Error::contents(
                table.path.as_str(),
                table.header_line,
                COLUMNS,
            ));
        };
        let found = Self {
            place: ([t, a, b, c], axes),
            place_sigma: columns.three(place_sigma).map(|three| (three, sigma_axes)),
            velocity: columns.three(VELOCITY),
            velocity_sigma: columns.three(VELOCITY_SIGMA),
            week: columns.get("week"),
            unsaid,
        };
        Ok((found, columns.ignored))
    }

    /// Standard deviations that are not of the file, and columns that are not used.
    fn remarks(&self, ignored: &[String]) -> Vec<Remark> {
        let mut remarks = Vec::new();
        if self.place_sigma.is_none() || self.velocity.is_some() && self.velocity_sigma.is_none() {
            remarks.push(Remark::note("standard deviations as given for all fixes"));
        }
        if !ignored.is_empty() {
            remarks.push(Remark::note(format!(
                "columns not used: {}",
                ignored.join(", ")
            )));
        }
        remarks
    }

    fn fix(&self, row: &[f64]) -> GnssFix {
        let triad = |columns: [Column; 3]| DVec3::from(columns.map(|column| column.of(row)));
        let sigma = |columns: Option<[Column; 3]>, given: Option<[f64; 3]>| {
            columns
                .map(triad)
                .or(given.map(DVec3::from))
                .unwrap_or(DVec3::NAN)
        };
        let [t_s, a, b, c] = self.place.0.map(|column| column.of(row));
        let (lat, lon, h) = match self.place.1 {
            Axes::Local => (a, b, c),
            Axes::Earth => ecef_to_geodetic(DVec3::new(a, b, c)),
        };
        let stated = self.place_sigma.map(|(columns, axes)| match axes {
            Axes::Local => triad(columns),
            Axes::Earth => sigma_of_earth(lat, lon, triad(columns)),
        });
        let velocity_sigma = || sigma(self.velocity_sigma, self.unsaid.and_then(|s| s.vel_m_s));
        GnssFix {
            t_s: t_s + self.week.map_or(0.0, |week| week.of(row)) * WEEK_S,
            lat,
            lon,
            h,
            pos_sigma_n: stated
                .or(self.unsaid.map(|s| s.pos_m.into()))
                .unwrap_or(DVec3::NAN),
            velocity: self
                .velocity
                .map(|columns| GnssVelocity::new(triad(columns), velocity_sigma())),
        }
    }

    fn check(&self, table: &Table, line: u64, row: &[f64]) -> Result<(), Error> {
        let refuse = |column: Column, reason, advice| {
            let name = &table.columns[column.index];
            Err(Error::cell(
                &table.path,
                line,
                name,
                row[column.index].to_string(),
                reason,
            )
            .advice(advice))
        };
        const DEGREES: &str = "latitude within ±89.9, longitude in (−180, 180] or [0, 360), in degrees (or lat_rad, lon_rad)";
        let ([_, first, second, third], axes) = self.place;
        let fix = self.fix(row);
        if axes == Axes::Earth {
            let r_e = DVec3::new(first.of(row), second.of(row), third.of(row));
            if (r_e.length() - A).abs() > BEYOND_EARTH_M {
                let advice = "the Earth's x, y, z in metres, 6.4e6 from its centre";
                return refuse(
                    first,
                    "is not a place near the surface of the Earth",
                    advice,
                );
            }
        } else if fix.lat.abs() > 90.0 * DEG {
            return refuse(first, "is not a latitude", DEGREES);
        } else if !(-180.0 * DEG - 1e-9..=360.0 * DEG + 1e-9).contains(&fix.lon) {
            return refuse(second, "is not a longitude", DEGREES);
        }
        if fix.lat.abs() > MAX_LATITUDE {
            return refuse(
                first,
                "is too near a pole to navigate in latitude and longitude",
                DEGREES,
            );
        }
        let of_place = self.place_sigma.map(|(columns, _)| columns);
        let sigmas = [of_place, self.velocity_sigma]
            .into_iter()
            .flatten()
            .flatten();
        match sigmas.into_iter().find(|column| column.of(row) <= 0.0) {
            Some(column) => {
                let advice = "a fix needs the standard deviations its receiver believes; remove rows without";
                refuse(
                    column,
                    "is not a standard deviation: it must be above 0",
                    advice,
                )
            }
            None => Ok(()),
        }
    }
}

/// Distance from the Earth's equatorial radius beyond which nothing navigates (m): its flattening, and aircraft.
const BEYOND_EARTH_M: f64 = 1e5;

/// Standard deviations north, east, down of errors that are independent in the Earth's axes: the diagonal of
/// C diag(σ²) Cᵀ.
fn sigma_of_earth(lat: f64, lon: f64, sigma_e: DVec3) -> DVec3 {
    let c_e_n = DMat3::from_quat(q_e_n(lat, lon));
    let squared = |v: DVec3| v * v;
    let variance = DMat3::from_cols(
        squared(c_e_n.x_axis),
        squared(c_e_n.y_axis),
        squared(c_e_n.z_axis),
    );
    (variance * squared(sigma_e)).powf(0.5)
}

/// A file of fixes that is not read, told by its first characters.
fn of_another_kind(path: &str, text: &str) -> Option<Error> {
    let text = text.trim_start();
    let error = || {
        Error::contents(path, 1_u64, "XML, as GPX and KML are, not a table of fixes").advice(
            "write its points as a table t_s, lat_deg, lon_deg, h_m on the clock of the IMU",
        )
    };
    text.starts_with('<').then(error)
}

/// Reads fixes: a table with a header, or the text of KF-GINS (time, latitude, longitude (deg), height (m),
/// standard deviations north, east, down (m); or with velocity behind the height and its deviations behind
/// those), a solution of RTKLIB, NMEA sentences, a log (of several topics, `topic`). `unsaid` are the standard deviations where the file states none, `clock_s` when
/// the IMU begins and ends, where there is one. Also what is doubtful about it.
///
/// # Errors
/// Whatever is wrong with it, with its line.
pub(crate) fn read_gnss(
    path: &Path,
    unsaid: Option<&FixSigma>,
    clock_s: Option<(f64, f64)>,
    topic: Option<&str>,
) -> Result<(Vec<GnssFix>, Vec<Remark>), Error> {
    let shown = path.display().to_string();
    let (fixes, remarks) = match logs::kind_of(path) {
        Some(_) => log::fixes(path, (unsaid, topic), clock_s)?,
        None => of_text(path, text(path)?, unsaid, clock_s)?,
    };
    for pair in fixes.windows(2) {
        check_step(&shown, pair[1].0, &pair[0].1, &pair[1].1)?;
    }
    let fixes = fixes.into_iter().map(|(_, fix)| fix).collect();
    Ok((
        fixes,
        remarks.into_iter().map(|r| r.of_file(&shown)).collect(),
    ))
}

/// The fixes of a text: sentences or a table.
fn of_text(
    path: &Path,
    text: String,
    unsaid: Option<&FixSigma>,
    clock_s: Option<(f64, f64)>,
) -> Result<Fixes, Error> {
    let shown = path.display().to_string();
    match of_another_kind(&shown, &text) {
        Some(error) => Err(error),
        None if is_nmea(&text) => nmea::fixes(&shown, &text, unsaid, clock_s),
        None => of_table(path, text, (unsaid, clock_s)),
    }
}

/// Fixes with their lines, and remarks.
pub(super) type Fixes = (Vec<(u64, GnssFix)>, Vec<Remark>);

/// The fixes of a table, of KF-GINS or of RTKLIB.
fn of_table(
    path: &Path,
    mut text: String,
    (unsaid, clock_s): (Option<&FixSigma>, Option<(f64, f64)>),
) -> Result<Fixes, Error> {
    let mut remarks = Vec::new();
    let is_rtklib = is_rtklib(&text);
    if is_rtklib {
        let (table, remark) = rtklib::rows(&path.display().to_string(), &text, clock_s)?;
        (text, remarks) = (table, vec![Remark::note(remark)]);
    }
    let bare = bare_columns(&text);
    let names = bare.map(|columns| bare_names(path, columns)).transpose()?;
    let table = table(path, &text, names.as_deref())?;
    let (columns, ignored) = FixColumns::new(&table, unsaid)?;
    if bare.is_some() && !is_rtklib {
        let velocity = if columns.velocity.is_some() {
            ", velocity"
        } else {
            ""
        };
        let text =
            format!("no header: read as KF-GINS text, position{velocity} and standard deviations");
        remarks.push(Remark::note(text));
    }
    remarks.extend(columns.remarks(&ignored));
    let mut fixes = Vec::with_capacity(table.rows.len());
    for (line, row) in &table.rows {
        columns.check(&table, *line, row)?;
        fixes.push((*line, columns.fix(row)));
    }
    let small =
        |(_, f): &(u64, GnssFix)| f.lat.abs() <= 0.5 * PI * DEG && f.lon.abs() <= 2.0 * PI * DEG;
    if fixes.iter().all(small) {
        let text = "latitude and longitude never exceed π: radians? Then name the columns lat_rad, lon_rad";
        remarks.push(Remark::doubt(text));
    }
    Ok((fixes, remarks))
}

/// The columns of a KF-GINS text, which has no header.
fn bare_names(path: &Path, columns: usize) -> Result<Vec<&'static str>, Error> {
    let velocity = if columns == 13 { &VELOCITY[..] } else { &[] };
    let velocity_sigma = if columns == 13 {
        &VELOCITY_SIGMA[..]
    } else {
        &[]
    };
    if columns == POSITION || columns == 13 {
        return Ok([&PLACE, velocity, &PLACE_SIGMA, velocity_sigma].concat());
    }
    let message = format!("{columns} columns without a header");
    Err(Error::contents(path.display().to_string(), Place::Within, message).advice(
        "KF-GINS: 7 columns (t_s, latitude, longitude, height, three deviations), or 13 (with velocity behind the height)",
    ))
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
    let message = format!(
        "the fix is {metres:.0} m from the one {} s before",
        (1e6 * seconds).round() / 1e6
    );
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
        let e = read_gnss(&path, None, None, None).unwrap_err();
        assert!(
            e.to_string()
                .ends_with("line 1: columns \"h_m\" and \"altitude\" both give h_m"),
            "{e}"
        );
        assert_eq!(e.hint().unwrap(), "remove one of them");
    }

    /// On the equator at Greenwich x is up, y east and z north; equal deviations are equal in any axes.
    #[test]
    fn places_in_the_axes_of_the_earth_are_read() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("gnss.csv");
        let read = |rows: &str| {
            std::fs::write(&path, format!("t_s,X,Y,Z,sd_x,sd_y,sd_z\n{rows}")).unwrap();
            read_gnss(&path, None, None, None).map(|(fixes, _)| fixes)
        };
        let r_e = geodetic_to_ecef(46.5 * DEG, 6.5 * DEG, 400.0);
        let place = format!("1,{},{},{},2,2,2\n", r_e.x, r_e.y, r_e.z);
        let [equator, alps] = ["0,6378237,0,0,3,2,1\n", &place].map(|row| read(row).unwrap()[0]);
        assert!(
            equator.lat.abs() < 1e-15 && equator.lon == 0.0 && (equator.h - 100.0).abs() < 1e-8
        );
        assert!((equator.pos_sigma_n - DVec3::new(1.0, 2.0, 3.0)).length() < 1e-12);
        // a nanometre of rounding in 6.4e6 m
        assert!((alps.lat - 46.5 * DEG).abs() < 1e-15 && (alps.lon - 6.5 * DEG).abs() < 1e-15);
        assert!(
            (alps.h - 400.0).abs() < 1e-8
                && (alps.pos_sigma_n - DVec3::splat(2.0)).length() < 1e-12
        );
        let e = read("0,6378.2,0,0,3,2,1\n").unwrap_err().to_string();
        assert!(
            e.contains("column \"X\": 6378.2 is not a place near the surface"),
            "{e}"
        );
    }
}
