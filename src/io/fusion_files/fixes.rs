//! Recorded GNSS fixes.

use super::nmea::{self, is_nmea};
use super::rtklib::{self, is_rtklib};
use super::{doubt, of_file, remark, time_back};
use crate::io::table::{self, Asked, Column, Dictionary, Quantity, Table};
use crate::io::{Failure as Error, Place, help, logs, source};
use glam::{DMat3, DVec3};
use nav_sim_document::Note;
use nav_sim_logs::{Clock, Content, Fix, Stamp, in_seconds};
use nav_sim_navigation::earth::{A, MAX_LATITUDE, ecef_to_geodetic, geodetic_to_ecef};
use nav_sim_navigation::frames::q_e_n;
use nav_sim_navigation::gnss::{FixSigma, GnssFix, GnssVelocity};
use nav_sim_signal::units::DEG;
use std::f64::consts::PI;
use std::path::Path;

/// Seconds of a GNSS week.
pub(in crate::io) const WEEK_S: f64 = 604_800.0;
/// Faster than this from one fix to the next is no motion (m/s).
const MAX_SPEED: f64 = 8000.0;

/// Quantities of fixes; a deviation up is one down.
static QUANTITIES: [Quantity; 21] = [
    Quantity::time(&["t", "time", "timestamp", "tow", "sow"]),
    Quantity::angle("lat_deg", &["lat", "latitude"]),
    Quantity::angle("lon_deg", &["lon", "lng", "longitude"]),
    Quantity::length("h_m", &["h", "height", "alt", "altitude"]),
    Quantity::length(
        "sd_n_m",
        &[
            "sd_n",
            "std_n",
            "sigma_n",
            "pos_std_n",
            "sd_north",
            "sd_lat",
            "sdn",
        ],
    ),
    Quantity::length(
        "sd_e_m",
        &[
            "sd_e",
            "std_e",
            "sigma_e",
            "pos_std_e",
            "sd_east",
            "sd_lon",
            "sde",
        ],
    ),
    Quantity::length(
        "sd_d_m",
        &[
            "sd_d",
            "std_d",
            "sigma_d",
            "pos_std_d",
            "sd_u",
            "std_u",
            "sd_h",
            "sdu",
        ],
    ),
    Quantity::speed("v_n_m_s", &["v_n", "vn"]),
    Quantity::speed("v_e_m_s", &["v_e", "ve"]),
    V_D,
    V_D.reversed(&["v_u", "vu"]),
    Quantity::speed("sd_vn_m_s", &["sd_vn", "sd_v_n", "vel_std_n", "sdvn"]),
    Quantity::speed("sd_ve_m_s", &["sd_ve", "sd_v_e", "vel_std_e", "sdve"]),
    Quantity::speed("sd_vd_m_s", &["sd_vd", "sd_v_d", "vel_std_d", "sdvu"]),
    Quantity::number("week", &["week", "gps_week"]),
    Quantity::length("x_m", &["x", "x_ecef", "ecef_x", "pos_x"]),
    Quantity::length("y_m", &["y", "y_ecef", "ecef_y", "pos_y"]),
    Quantity::length("z_m", &["z", "z_ecef", "ecef_z", "pos_z"]),
    Quantity::length("sd_x_m", &["sd_x", "sdx", "std_x", "sigma_x"]),
    Quantity::length("sd_y_m", &["sd_y", "sdy", "std_y", "sigma_y"]),
    Quantity::length("sd_z_m", &["sd_z", "sdz", "std_z", "sigma_z"]),
];
const V_D: Quantity = Quantity::speed("v_d_m_s", &["v_d", "vd"]);
const PLACE: [&str; 3] = ["lat_deg", "lon_deg", "h_m"];
const PLACE_SIGMA: [&str; 3] = ["sd_n_m", "sd_e_m", "sd_d_m"];
/// The same in the Earth's axes.
const PLACE_E: [&str; 3] = ["x_m", "y_m", "z_m"];
const PLACE_SIGMA_E: [&str; 3] = ["sd_x_m", "sd_y_m", "sd_z_m"];
const VELOCITY: [&str; 3] = ["v_n_m_s", "v_e_m_s", "v_d_m_s"];
const VELOCITY_SIGMA: [&str; 3] = ["sd_vn_m_s", "sd_ve_m_s", "sd_vd_m_s"];

/// Dictionary of fixes. Texts without a header are those of KF-GINS.
const DICTIONARY: Dictionary = Dictionary {
    bare: &[
        &[
            "t_s", "lat_deg", "lon_deg", "h_m", "sd_n_m", "sd_e_m", "sd_d_m",
        ],
        &[
            "t_s",
            "lat_deg",
            "lon_deg",
            "h_m",
            "v_n_m_s",
            "v_e_m_s",
            "v_d_m_s",
            "sd_n_m",
            "sd_e_m",
            "sd_d_m",
            "sd_vn_m_s",
            "sd_ve_m_s",
            "sd_vd_m_s",
        ],
    ],
    bad_cell: |error, _| error.hint("remove the row: a fix that is not whole is no fix"),
    ..Dictionary::new(
        &QUANTITIES,
        "columns: t_s, lat_deg, lon_deg, h_m (or x_m, y_m, z_m), sd_n_m, sd_e_m, sd_d_m; with velocity v_n_m_s … and \
             sd_vn_m_s …; without a header, as KF-GINS has it, 7 of them (t_s, latitude, longitude, height, three deviations) \
             or 13 (velocity behind the height)",
    )
};

/// The fixes of the rows of a table, each with its line. Position and its deviations are needed; velocity and its deviations
/// come together or not at all. `unsaid` are the standard deviations where the file states none.
fn of_rows(
    table: &Table,
    unsaid: Option<&FixSigma>,
    remarks: &mut Vec<Note>,
) -> Result<Vec<(u64, GnssFix)>, Error> {
    let any = |names: [&str; 3]| names.into_iter().any(|name| table.has(name));
    // whether place, and its deviations, are in the Earth's axes
    let is_earth = any(PLACE_E) && !table.has(PLACE[0]);
    let is_sigma_earth = any(PLACE_SIGMA_E) && !table.has(PLACE_SIGMA[0]);
    let place = if is_earth { PLACE_E } else { PLACE };
    let place_sigma = match is_sigma_earth {
        true => PLACE_SIGMA_E,
        false => PLACE_SIGMA,
    };
    let has_velocity = any(VELOCITY) || any(VELOCITY_SIGMA);
    let own = ["t_s"].into_iter().chain(place);
    let own = own.chain(VELOCITY.into_iter().filter(|_| has_velocity));
    table.require(own, &DICTIONARY)?;
    let mut sigmas = Vec::new();
    // what is missing in all of a position or velocity may be given for the whole file
    if unsaid.is_none() || any(place_sigma) {
        sigmas.extend(place_sigma);
    }
    let given_velocity = unsaid.and_then(|sigma| sigma.vel_m_s);
    if has_velocity && (given_velocity.is_none() || any(VELOCITY_SIGMA)) {
        sigmas.extend(VELOCITY_SIGMA);
    }
    // a receiver's log that has all but these
    let found = table.require(sigmas, &DICTIONARY);
    found.map_err(|e| e.or(help::FIX_SIGMA))?;
    let ([time], place) = (
        table.columns(["t_s"], &DICTIONARY)?,
        table.columns(place, &DICTIONARY)?,
    );
    let place_sigma = table.all(place_sigma);
    let (velocity, velocity_sigma) = (table.all(VELOCITY), table.all(VELOCITY_SIGMA));
    if place_sigma.is_none() || velocity.is_some() && velocity_sigma.is_none() {
        remarks.push(remark("standard deviations as given for all fixes"));
    }
    if !table.ignored.is_empty() {
        let text = format!("columns not used: {}", table.ignored.join(", "));
        remarks.push(remark(text));
    }
    let fix = |row: usize| {
        let triad = |columns: [&Column; 3]| DVec3::from(columns.map(|column| column.si(row)));
        let r = triad(place);
        let (lat, lon, h) = match is_earth {
            false => (r.x, r.y, r.z),
            true => ecef_to_geodetic(r),
        };
        let stated = place_sigma.map(|columns| match is_sigma_earth {
            false => triad(columns),
            true => sigma_of_earth(lat, lon, triad(columns)),
        });
        let given = unsaid.map(|s| DVec3::from(s.pos_m));
        let velocity = velocity.map(|columns| {
            let sigma = velocity_sigma
                .map(triad)
                .or(given_velocity.map(DVec3::from));
            GnssVelocity::new(triad(columns), sigma.unwrap_or(DVec3::NAN))
        });
        let weeks = table.get("week").map_or(0.0, |week| week.si(row));
        let fix = GnssFix {
            t_s: time.si(row) + weeks * WEEK_S,
            lat,
            lon,
            h,
            pos_sigma_n: stated.or(given).unwrap_or(DVec3::NAN),
            velocity,
        };
        const DEGREES: &str = "latitude within ±89.9, longitude in (−180, 180] or [0, 360), in degrees (or lat_rad, lon_rad)";
        const SIGMA: &str =
            "a fix needs the standard deviations its receiver believes; remove rows without";
        let sigmas = [place_sigma, velocity_sigma].into_iter().flatten();
        let [first, second, _] = place;
        let is_far = (r.length() - A).abs() > BEYOND_EARTH_M;
        let is_longitude = (-180.0 * DEG - 1e-9..=360.0 * DEG + 1e-9).contains(&lon);
        let (column, reason, advice) = if is_earth && is_far {
            let advice = "the Earth's x, y, z in metres, 6.4e6 from its centre";
            (
                first,
                "is not a place near the surface of the Earth",
                advice,
            )
        } else if lat.abs() > 90.0 * DEG {
            (first, "is not a latitude", DEGREES)
        } else if !is_longitude {
            (second, "is not a longitude", DEGREES)
        } else if lat.abs() > MAX_LATITUDE {
            let reason = "is too near a pole to navigate in latitude and longitude";
            (first, reason, DEGREES)
        } else if let Some(column) = sigmas.flatten().find(|column| column.si(row) <= 0.0) {
            let reason = "is not a standard deviation: it must be above 0";
            (column, reason, SIGMA)
        } else {
            return Ok((table.line(row), fix));
        };
        let (line, value) = (table.line(row), column.values[row].to_string());
        Err(Error::cell(&table.path, line, &column.name, value, reason).or_hint(advice))
    };
    (0..table.rows()).map(fix).collect()
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
) -> Result<(Vec<GnssFix>, Vec<Note>), Error> {
    let shown = path.display().to_string();
    let (fixes, remarks) = match logs::kind_of(path) {
        Some(_) => of_log(path, (unsaid, topic), clock_s)?,
        None => {
            let text = source::table_text(path)?;
            if text.trim_start().starts_with('<') {
                let message = "XML, as GPX and KML are, not a table of fixes";
                return Err(Error::contents(shown, 1_u64, message).or_hint(
                    "write its points as a table t_s, lat_deg, lon_deg, h_m on the clock of the IMU",
                ));
            }
            match is_nmea(&text) {
                true => nmea::fixes(&shown, &text, unsaid, clock_s)?,
                false => of_table(&shown, text, unsaid, clock_s)?,
            }
        }
    };
    for pair in fixes.windows(2) {
        check_step(&shown, pair[1].0, &pair[0].1, &pair[1].1)?;
    }
    let fixes = fixes.into_iter().map(|(_, fix)| fix).collect();
    let remarks = remarks.into_iter().map(|note| of_file(note, &shown));
    Ok((fixes, remarks.collect()))
}

/// Fixes with their lines, and remarks.
pub(super) type Fixes = (Vec<(u64, GnssFix)>, Vec<Note>);

/// The fixes of a table, of KF-GINS or of RTKLIB.
fn of_table(
    shown: &str,
    mut text: String,
    unsaid: Option<&FixSigma>,
    clock_s: Option<(f64, f64)>,
) -> Result<Fixes, Error> {
    let mut clock = None;
    if is_rtklib(&text) {
        let (table, name) = rtklib::table(shown, &text, clock_s)?;
        (text, clock) = (table, Some(name));
    }
    let mut table = table::parse(shown, &text, &DICTIONARY, &Asked::default())?;
    let has_all = |table: &Table, columns: [&Column; 3]| {
        (0..table.rows()).all(|row| columns.iter().all(|c| c.si(row) > 0.0))
    };
    if clock.is_some() {
        table.ignored.clear();
        let sigma = table.all(VELOCITY_SIGMA);
        // what states no deviation of one velocity states none
        if !sigma.is_some_and(|sigma| has_all(&table, sigma)) {
            let velocity = VELOCITY.into_iter().chain(VELOCITY_SIGMA);
            velocity.for_each(|name| drop(table.take(name)));
        }
    }
    let mut own = Vec::new();
    let fixes = of_rows(&table, unsaid, &mut own)?;
    let velocity = match table.has(VELOCITY[0]) {
        true => ", velocity",
        false => "",
    };
    let mut remarks = Vec::new();
    if table.is_bare {
        remarks.push(remark(format!(
            "no header: read as KF-GINS text, position{velocity} and standard deviations"
        )));
    }
    remarks.extend(clock.map(|clock| {
        remark(format!(
            "an RTKLIB solution: position{velocity} and standard deviations, in {clock}"
        ))
    }));
    remarks.extend(own);
    remarks.extend(table.assumptions.iter().map(remark));
    let small =
        |(_, f): &(u64, GnssFix)| f.lat.abs() <= 0.5 * PI * DEG && f.lon.abs() <= 2.0 * PI * DEG;
    if fixes.iter().all(small) {
        let text = "latitude and longitude never exceed π: radians? Then name the columns lat_rad, lon_rad";
        remarks.push(doubt(text));
    }
    Ok((fixes, remarks))
}

/// Reads fixes of a topic, of several; `unsaid` are the standard deviations where the log states none, `imu_s` is when the IMU
/// begins and ends.
///
/// # Errors
/// When the log is damaged, has no fixes, or states no standard deviations where none are given.
fn of_log(
    path: &Path,
    (unsaid, topic): (Option<&FixSigma>, Option<&str>),
    imu_s: Option<(f64, f64)>,
) -> Result<Fixes, Error> {
    let refused = |e| logs::refused(path, e);
    let log = logs::open(path)?;
    let channel = log.channel(Content::Fix, topic).map_err(refused)?;
    let read = log.fixes(channel, Stamp::default()).map_err(refused)?;
    let unstated = || {
        let message = "the fixes have no standard deviations";
        Error::contents(path.display(), Place::Within, message).or(help::FIX_SIGMA)
    };
    let fixes = (1..)
        .zip(read)
        .map(|(row, fix)| Some((row, in_radians(&fix, unsaid)?)));
    let mut fixes: Vec<(u64, GnssFix)> = fixes.collect::<Option<_>>().ok_or_else(unstated)?;
    let mut said = format!("fixes of {}", channel.topic);
    let span_s = fixes.first().zip(fixes.last());
    let clock = span_s
        .filter(|_| channel.clock == Clock::Unix)
        .and_then(|((_, first), (_, last))| rtklib::clock((first.t_s, last.t_s), imu_s));
    if let Some(clock) = clock.filter(|clock| clock.origin_s != 0.0) {
        fixes
            .iter_mut()
            .for_each(|(_, fix)| fix.t_s -= clock.origin_s);
        said = format!("{said}, in {}", clock.name);
    }
    let cut = log.damage().map(logs::cut_off);
    let remarks = cut.map(doubt).into_iter();
    Ok((fixes, remarks.chain([remark(said)]).collect()))
}

/// The same fix with angles in radians; none without standard deviations.
fn in_radians(fix: &Fix, unsaid: Option<&FixSigma>) -> Option<GnssFix> {
    let pos_sigma_n = fix.sd_ned_m.or(unsaid.map(|sigma| sigma.pos_m))?;
    let velocity_sigma = fix.sd_v_ned_m_s.or(unsaid.and_then(|sigma| sigma.vel_m_s));
    let velocity = fix.v_ned_m_s.zip(velocity_sigma);
    Some(GnssFix {
        t_s: in_seconds(fix.stamp_ns),
        lat: fix.lat_deg * DEG,
        lon: fix.lon_deg * DEG,
        h: fix.h_m,
        pos_sigma_n: DVec3::from(pos_sigma_n),
        velocity: velocity.map(|(v, sigma)| GnssVelocity::new(v.into(), sigma.into())),
    })
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
        .or_hint("is a latitude swapped with a longitude, a sign lost, or a row damaged?"))
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
        assert_eq!(e.advice().unwrap(), "remove one of them");
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

    /// The sums are those of the independent writer of the file (`src/logs/tests/data/expected.csv`), in degrees and metres.
    #[test]
    fn fixes_of_a_log_are_those_of_its_writer() {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("src/logs/tests/data/ros2_zstd.mcap");
        let (fixes, _) = of_log(&path, (None, None), None).unwrap();
        let sum = |of: fn(&GnssFix) -> f64| fixes.iter().map(|(_, fix)| of(fix)).sum::<f64>();
        assert_eq!(fixes.len(), 4);
        assert!((sum(|f| f.lat) / DEG - 186.000_007_999_999_98).abs() < 1e-11);
        assert!((sum(|f| f.lon) / DEG - 26.399_984).abs() < 1e-11);
        assert!((sum(|f| f.h) - 1_601.022_578_849_756).abs() < 1e-9);
        assert!((sum(|f| f.pos_sigma_n.z) - 4.8).abs() < 1e-12);
    }
}
