//! Input files of `fuse`: recorded IMU data, GNSS fixes, an initial state. Own tables, known
//! headers of recordings, text files of KF-GINS, solutions of RTKLIB, sentences of NMEA 0183.

use super::file_kind::{self, FileKind};
use super::logs::LogOptions;
use super::recordings::timing::{UNITS, median_step, unit_of_step};
use super::recordings::{OF_CLOCK, OF_RECEIVER, ReadOptions, STAMP, check_gravity, gravity_factor};
use super::table::{
    Column, DefaultUnit, Dictionary, InputTable, LATITUDE, LONGITUDE, NONE, Quantity, SPEED,
};
use super::toml_file::TomlSource;
use super::{Failure, Failure as Error, Place, help, logs, recordings, source, table};
use chrono::{DateTime, NaiveDateTime};
use glam::{DMat3, DVec3};
use nav_sim_document::{Importance, Note};
use nav_sim_logs::{Clock, Content, LogFix, Stamp, in_seconds};
use nav_sim_navigation::earth::{MAX_LATITUDE_DEG, ecef_to_geodetic, geodetic_to_ecef};
use nav_sim_navigation::ekf::InitialSettings;
use nav_sim_navigation::frames::{NavState, RollPitchYaw, q_e_n};
use nav_sim_navigation::fusion::{LONGEST_GAP_S, Start, WheelSpeed, bridged};
use nav_sim_navigation::gnss::{FixSigma, GnssFix, GnssVelocity};
use nav_sim_navigation::strapdown::MAX_ROTATION;
use nav_sim_signal::imu::ImuIncrement;
use nav_sim_signal::units::Between;
use nav_sim_signal::units::DEG;
pub(crate) use nmea::is_nmea;
use schemars::JsonSchema;
use serde::Deserialize;
use std::f64::consts::PI;
use std::path::Path;

mod nmea;

fn note(importance: Importance, text: impl Into<String>) -> Note {
    let text = text.into();
    Note { importance, text }
}

/// Note on the reading of a file.
fn remark(text: impl Into<String>) -> Note {
    note(Importance::Remark, text)
}

/// Warning about a file.
fn doubt(text: impl Into<String>) -> Note {
    note(Importance::Warning, text)
}

/// A note with the name of the file before it.
fn of_file(note: Note, path: &str) -> Note {
    let text = format!("{path}: {}", note.text);
    Note { text, ..note }
}

/// The first row of a table of numbers without a header, and what separates them; none of any other text.
pub(super) fn bare_row(text: &str) -> Option<(Vec<f64>, u8)> {
    let mut lines = text.lines().map(str::trim);
    let first = lines.find(|l| !(l.is_empty() || l.starts_with(['#', '%', '/'])))?;
    let (cells, delimiter) = table::cells(first, &FIXES);
    let row = cells
        .iter()
        .map(|cell| table::number(cell.as_bytes(), delimiter));
    let row: Vec<f64> = row.collect::<Option<_>>()?;
    (row.len() > 1).then_some((row, delimiter))
}

/// Refuses fixes whose times are seconds by their name and thousandths or less by their steps, over as long as the IMU has.
fn check_unit(table: &InputTable, imu_s: Option<(f64, f64)>) -> Result<(), Failure> {
    /// A step between fixes (s) that is no longer one.
    const LONG_S: f64 = 20.0;
    let (Some(time), Some((from_s, to_s))) = (table.get("t_s"), imu_s) else {
        return Ok(());
    };
    let t_s: Vec<f64> = (0..table.rows()).map(|row| time.si(row)).collect();
    let step = median_step(&t_s);
    let is_meant = |(unit_s, _): &&(f64, &str)| {
        let span_s = (t_s[t_s.len() - 1] - t_s[0]) * unit_s;
        (0.5..2.0).contains(&(span_s / (to_s - from_s)))
    };
    let Some((factor, _)) = UNITS[1..].iter().find(is_meant).filter(|_| step > LONG_S) else {
        return Ok(());
    };
    // The name may state a unit already, of which this is a fraction.
    let unit_s = factor * time.factor.unwrap_or(1.0);
    let unit = UNITS.iter().find(|(s, _)| (s / unit_s - 1.0).abs() < 0.1);
    unit.map_or(Ok(()), |(_, unit)| Err(no_seconds(table, time, step, unit)))
}

/// The refusal of times in another unit than their name says.
fn no_seconds(table: &InputTable, time: &Column, step: f64, unit: &str) -> Failure {
    let name = &time.name;
    let text = format!("column \"{name}\" has steps of {step} s: they are {unit}");
    let ending = unit.replace('µ', "u");
    (table.refused(text)).or_hint(format!("name the column t_{ending}"))
}

/// Refuses times (s) that stand still or go back; `line` is that of the k-th.
pub(super) fn increasing(
    path: &str,
    line: impl Fn(usize) -> u64,
    t_s: impl Iterator<Item = f64> + Clone,
) -> Result<(), Failure> {
    let mut steps = (1..).zip(t_s.clone().zip(t_s.skip(1)));
    let Some((k, (previous_s, t_s))) = steps.find(|(_, (from, to))| to <= from) else {
        return Ok(());
    };
    let message = format!("time goes from {previous_s} s to {t_s} s: it must increase");
    Err(Failure::contents(path, line(k), message)
        .or_hint("sort the rows by time and remove repeated ones"))
}

// Recorded GNSS fixes.

/// Seconds of a GNSS week.
pub(crate) const WEEK_S: f64 = 604_800.0;
/// Faster than this from one fix to the next is no motion (m/s).
const MAX_SPEED: f64 = 8000.0;

/// Quantities of fixes; a deviation up is one down.
static FIX_QUANTITIES: [Quantity; 33] = [
    Quantity::time("t time timestamp tow sow gpstime"),
    Quantity::angle("lat_deg", "lat latitude").within(LATITUDE),
    Quantity::angle("lon_deg", "lon lng longitude").within(LONGITUDE),
    Quantity::length(
        "h_m",
        "h height alt altitude ellip_hgt h_ell ellipsoidal_height",
    ),
    Quantity::length("sd_n_m", SD_N).positive(),
    Quantity::length("sd_e_m", SD_E).positive(),
    Quantity::length("sd_d_m", SD_D).positive(),
    Quantity::speed("v_n_m_s", "v_n vn local_vn vnorth v_north"),
    Quantity::speed("v_e_m_s", "v_e ve local_ve veast v_east"),
    V_D,
    V_D.reversed("v_u vu v_up vup local_vu"),
    Quantity::speed("sd_vn_m_s", SD_VN).positive(),
    Quantity::speed("sd_ve_m_s", SD_VE).positive(),
    Quantity::speed("sd_vd_m_s", SD_VD).positive(),
    Quantity::number("week", "week gps_week wnc_w gpstime_week"),
    Quantity::length("x_ecef_m", "x_ecef ecef_x"),
    Quantity::length("y_ecef_m", "y_ecef ecef_y"),
    Quantity::length("z_ecef_m", "z_ecef ecef_z"),
    Quantity::length("sd_x_m", "sd_x sdx").positive(),
    Quantity::length("sd_y_m", "sd_y sdy").positive(),
    Quantity::length("sd_z_m", "sd_z sdz").positive(),
    Quantity::length("sd_xy_m", "sdxy"),
    Quantity::length("sd_yz_m", "sdyz"),
    Quantity::length("sd_zx_m", "sdzx"),
    Quantity::speed("v_x_m_s", "v_x vx"),
    Quantity::speed("v_y_m_s", "v_y vy"),
    Quantity::speed("v_z_m_s", "v_z vz"),
    Quantity::speed("sd_vx_m_s", "sd_vx sdvx").positive(),
    Quantity::speed("sd_vy_m_s", "sd_vy sdvy").positive(),
    Quantity::speed("sd_vz_m_s", "sd_vz sdvz").positive(),
    Quantity::speed("sd_vxy_m_s", "sdvxy"),
    Quantity::speed("sd_vyz_m_s", "sdvyz"),
    Quantity::speed("sd_vzx_m_s", "sdvzx"),
];
pub(super) const SD_N: &str = "sd_n std_n sigma_n pos_std_n sd_north sd_lat sdn north_std sdnorth";
pub(super) const SD_E: &str = "sd_e std_e sigma_e pos_std_e sd_east sd_lon sde east_std sdeast";
pub(super) const SD_D: &str = "sd_d std_d sigma_d pos_std_d sd_u std_u sd_h sdu up_std sdheight";
pub(super) const SD_VN: &str = "sd_vn sd_v_n std_vn std_v_n vel_std_n sdvn northvel_std sd_vnorth";
pub(super) const SD_VE: &str = "sd_ve sd_v_e std_ve std_v_e vel_std_e sdve eastvel_std sd_veast";
pub(super) const SD_VD: &str =
    "sd_vd sd_v_d std_vd std_v_d vel_std_d sdvu sd_vu sd_v_u upvel_std sd_vup sd_vh";
const V_D: Quantity = Quantity::speed("v_d_m_s", "v_d vd");
/// Columns of position, its deviations, velocity and those.
const GEODETIC: [[&str; 3]; 4] = [
    ["lat_deg", "lon_deg", "h_m"],
    ["sd_n_m", "sd_e_m", "sd_d_m"],
    ["v_n_m_s", "v_e_m_s", "v_d_m_s"],
    ["sd_vn_m_s", "sd_ve_m_s", "sd_vd_m_s"],
];
/// Names of the columns in axes fixed to the Earth.
const ECEF: [[&str; 3]; 4] = [
    ["x_ecef_m", "y_ecef_m", "z_ecef_m"],
    ["sd_x_m", "sd_y_m", "sd_z_m"],
    ["v_x_m_s", "v_y_m_s", "v_z_m_s"],
    ["sd_vx_m_s", "sd_vy_m_s", "sd_vz_m_s"],
];
/// Square roots of the covariances between axes, with their signs, of position and velocity.
const ECEF_COVARIANCE: [[&str; 3]; 2] = [
    ["sd_xy_m", "sd_yz_m", "sd_zx_m"],
    ["sd_vxy_m_s", "sd_vyz_m_s", "sd_vzx_m_s"],
];

/// Dictionary of fixes. Texts without a header are those of KF-GINS.
pub(super) const FIXES: Dictionary<'_> = Dictionary {
    bare: &[
        "t_s lat_deg lon_deg h_m sd_n_m sd_e_m sd_d_m",
        "t_s lat_deg lon_deg h_m v_n_m_s v_e_m_s v_d_m_s sd_n_m sd_e_m sd_d_m sd_vn_m_s sd_ve_m_s sd_vd_m_s",
    ],
    bad_cell: "remove the row: a fix needs every number; angles are in degrees, or named lat_rad, lon_rad",
    ..Dictionary::new(
        &FIX_QUANTITIES,
        "columns: t_s, lat_deg, lon_deg, h_m, sd_n_m, sd_e_m, sd_d_m; with velocity v_n_m_s … and sd_vn_m_s …; as KF-GINS without a header, 7 (t_s, latitude, longitude, height, three deviations) or 13 (velocity after the height)",
    )
};

/// Dictionary of solutions, which have numbers that stand for none.
const SOLUTION: Dictionary<'_> = Dictionary {
    is_partial: true,
    advice: "let RTKLIB write latitude, longitude, height, or x, y, z (out-solformat = llh or xyz)",
    ..FIXES
};

/// A fix as a file has it: line, time (s); where it states them, position (rad, m), its standard deviations, velocity and those.
type Stated = (u64, f64, [Option<DVec3>; 4]);

/// Fixes of a file, and remarks.
type Fixes = (Vec<Stated>, Vec<Note>);

/// The fixes of the rows of a table. Position and its deviations are needed; velocity and its deviations come together or not
/// at all. `unsaid` are the standard deviations where the file states none.
fn of_rows(
    table: &InputTable,
    unsaid: Option<&FixSigma>,
    mut remarks: Vec<Note>,
) -> Result<Fixes, Error> {
    let has = |names: [&str; 3]| names.into_iter().any(|name| table.has(name));
    let is_ecef = has(ECEF[0]);
    let names = if is_ecef { ECEF } else { GEODETIC };
    let [place, place_sigma, velocity, velocity_sigma] = names;
    let has_velocity = has(velocity) || has(velocity_sigma);
    let own = velocity.into_iter().filter(|_| has_velocity);
    table.require(["t_s"].into_iter().chain(place).chain(own))?;
    // what is missing in all of a position or velocity may be given for the whole file
    let is_unsaid = has_velocity && unsaid.is_none_or(|sigma| sigma.vel_m_s.is_none());
    let sigmas = [(place_sigma, unsaid.is_none()), (velocity_sigma, is_unsaid)];
    let sigmas = sigmas
        .into_iter()
        .filter(|(names, is_needed)| *is_needed || has(*names));
    // a receiver's log that has all but these
    let found = table.require(sigmas.flat_map(|(names, _)| names));
    found.map_err(|e| e.or_option(help::FIX_SIGMA))?;
    let [time] = table.columns(["t_s"])?;
    let groups = names.map(|names| table.all(names));
    let covariances = ECEF_COVARIANCE.map(|names| table.all(names));
    let fix = |row: usize| {
        let weeks = table.get("week").map_or(0.0, |week| week.si(row));
        let three = |columns: Option<[&Column; 3]>| Some(columns?.map(|c| c.si(row)).into());
        let mut stated = groups.map(three);
        if is_ecef {
            stated = in_geodetic(stated, covariances.map(three));
        }
        (table.line(row), time.si(row) + weeks * WEEK_S, stated)
    };
    if !table.ignored.is_empty() {
        let text = format!("columns not used: {}", table.ignored.join(", "));
        remarks.push(remark(text));
    }
    remarks.extend(table.assumptions.iter().map(remark));
    remarks.extend(table.warnings.iter().map(doubt));
    Ok(((0..table.rows()).map(fix).collect(), remarks))
}

/// Converts an ECEF fix to latitude, longitude, height, and to the axes north, east, down.
/// `covariances` are the signed roots of those between x and y, y and z, z and x; 0 where not
/// stated.
fn in_geodetic(
    [place, sigma, velocity, velocity_sigma]: [Option<DVec3>; 4],
    covariances: [Option<DVec3>; 2],
) -> [Option<DVec3>; 4] {
    let (lat, lon, h) = place.map_or((f64::NAN, f64::NAN, f64::NAN), ecef_to_geodetic);
    let to_n = DMat3::from_quat(q_e_n(lat, lon));
    let rotated = |(sigma, roots): (Option<DVec3>, Option<DVec3>)| {
        let variance = sigma? * sigma?;
        let roots = roots.filter(|roots| roots.is_finite()).unwrap_or_default();
        let [xy, yz, zx] = (roots * roots.abs()).to_array();
        let covariance = DMat3::from_cols(
            DVec3::new(variance.x, xy, zx),
            DVec3::new(xy, variance.y, yz),
            DVec3::new(zx, yz, variance.z),
        );
        let of_n = to_n * covariance * to_n.transpose();
        Some(DVec3::from([0, 1, 2].map(|k| of_n.col(k)[k].sqrt())))
    };
    let [of_place, of_velocity] = covariances;
    [
        place.map(|_| DVec3::new(lat, lon, h)),
        rotated((sigma, of_place)),
        velocity.map(|v| to_n * v),
        rotated((velocity_sigma, of_velocity)),
    ]
}

/// Brings fixes in seconds since GPS weeks are counted to the clock of the IMU, which begins and ends at `imu_s`, or to the
/// seconds of their week; the name of that clock.
fn to_clock_of_imu(fixes: &mut [Stated], imu_s: Option<(f64, f64)>) -> String {
    let ends = fixes.first().zip(fixes.last());
    let (first_s, last_s) = ends.map_or((0.0, 0.0), |(first, last)| (first.1, last.1));
    let gps_s = gps_origin_s(first_s + GPS_EPOCH_S as f64);
    let span_s = (first_s + gps_s, last_s + gps_s);
    let [.., of_week] = clocks(span_s.0);
    let clock = clock(span_s, imu_s).unwrap_or(of_week);
    for (_, t_s, _) in fixes {
        // the difference of two numbers of 1e9 keeps 0.2 µs
        *t_s = (1e6 * (*t_s + gps_s - clock.origin_s)).round() / 1e6;
    }
    clock.name
}

/// The fix that is stated; `unsaid` are the standard deviations where it states none.
fn fix(
    path: &str,
    (line, t_s, stated): &Stated,
    unsaid: Option<&FixSigma>,
) -> Result<GnssFix, Error> {
    let refused = |message| Error::contents(path, *line, message);
    let [place, sigma, velocity, velocity_sigma] = *stated;
    let Some(place) = place.filter(|place| (*place + *t_s).is_finite()) else {
        return Err(refused("a fix without a time or position"));
    };
    let sigma = sigma.filter(|sigma| sigma.is_finite());
    let pos_sigma_n = sigma.or(unsaid.map(|sigma| sigma.pos_m.into()));
    let velocity = velocity.and_then(|v| {
        let given = || unsaid?.vel_m_s.map(DVec3::from);
        let stated = velocity_sigma.filter(|sigma| sigma.truncate().is_finite());
        let sigma = stated.or_else(given)?;
        let horizontal = v.truncate();
        horizontal.is_finite().then(|| GnssVelocity {
            horizontal,
            horizontal_sigma: sigma.truncate(),
            down: (v.z + sigma.z).is_finite().then_some((v.z, sigma.z)),
        })
    });
    Ok(GnssFix {
        t_s: *t_s,
        lat: place.x,
        lon: place.y,
        h: place.z,
        pos_sigma_n: pos_sigma_n.ok_or_else(|| {
            refused("a fix without standard deviations").or_option(help::FIX_SIGMA)
        })?,
        velocity,
    })
}

/// The doubt about latitudes and longitudes (rad) of which none is too large for a number of radians that is taken as degrees.
pub(super) fn doubt_degrees(mut places: impl Iterator<Item = [f64; 2]>) -> Option<&'static str> {
    let is_small = |x: f64| x.abs() <= PI * DEG + 1e-8;
    let all = places.all(|[lat, lon]| is_small(2.0 * lat) && is_small(0.5 * lon));
    all.then_some(
        "latitude and longitude never exceed π: radians? Then name the columns lat_rad, lon_rad",
    )
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
    use FileKind as K;
    read_fixes(path, unsaid, clock_s, topic)
        .map_err(|e| file_kind::or_wrong_kind(&[K::Gnss, K::Trajectory, K::Log], path, e))
}

fn read_fixes(
    path: &Path,
    unsaid: Option<&FixSigma>,
    clock_s: Option<(f64, f64)>,
    topic: Option<&str>,
) -> Result<(Vec<GnssFix>, Vec<Note>), Error> {
    let shown = path.display().to_string();
    let (stated, mut remarks) = match logs::kind_of(path) {
        Some(_) => of_log(path, topic, clock_s)?,
        None => {
            let text = source::table_text(path)?;
            if text.trim_start().starts_with('<') {
                let message = "XML such as GPX or KML, not a table of fixes";
                return Err(Error::contents(shown, 1_u64, message).or_hint(
                    "write its points as a table t_s, lat_deg, lon_deg, h_m on the clock of the IMU",
                ));
            }
            if is_nmea(&text) {
                nmea::fixes(&shown, &text, unsaid, clock_s)?
            } else if let Some(header) = rtklib_header(&text) {
                let table = rtklib(&shown, &text, header)?;
                let (mut fixes, mut remarks) = of_rows(&table, unsaid, Vec::new())?;
                let name = to_clock_of_imu(&mut fixes, clock_s);
                remarks.push(remark(format!("an RTKLIB solution, in {name}")));
                (fixes, remarks)
            } else {
                let table = table::parse(&shown, &text, &FIXES)?;
                check_unit(&table, clock_s)?;
                let velocity = match table.has(GEODETIC[2][0]) {
                    true => ", velocity",
                    false => "",
                };
                let text = "no header: read as KF-GINS text, position";
                let text = format!("{text}{velocity} and standard deviations");
                let remarks = table.is_bare.then(|| remark(text));
                let (mut fixes, mut remarks) =
                    of_rows(&table, unsaid, remarks.into_iter().collect())?;
                if table.has("week") {
                    let name = to_clock_of_imu(&mut fixes, clock_s);
                    remarks.push(remark(format!("times are {name}")));
                }
                (fixes, remarks)
            }
        }
    };
    let fixes = stated.iter().map(|stated| fix(&shown, stated, unsaid));
    let fixes: Vec<GnssFix> = fixes.collect::<Result<_, _>>()?;
    if fixes.is_empty() {
        return Err(Error::contents(shown, Place::Within, "no fixes in it"));
    }
    if stated
        .iter()
        .any(|(.., [_, sigma, ..])| sigma.is_none_or(|sigma| !sigma.is_finite()))
    {
        remarks.push(remark(
            "standard deviations as given where the file has none",
        ));
    }
    remarks.extend(doubt_degrees(fixes.iter().map(|fix| [fix.lat, fix.lon])).map(doubt));
    let times = fixes.iter().map(|fix| fix.t_s);
    increasing(&shown, |k| stated[k].0, times)?;
    for (pair, (line, ..)) in fixes.windows(2).zip(stated.iter().skip(1)) {
        let place = |f: &GnssFix| (f.t_s, geodetic_to_ecef(f.lat, f.lon, f.h));
        check_jump(&shown, *line, place(&pair[0]), place(&pair[1]))?;
    }
    let remarks = remarks.into_iter().map(|note| of_file(note, &shown));
    Ok((fixes, remarks.collect()))
}

/// Refuses a step from one place (s, m) to the next that is no motion.
pub(super) fn check_jump(
    path: &str,
    line: u64,
    (from_s, from): (f64, DVec3),
    (to_s, to): (f64, DVec3),
) -> Result<(), Error> {
    let (seconds, metres) = (to_s - from_s, to.distance(from));
    if seconds <= 0.0 || metres <= MAX_SPEED * seconds {
        return Ok(());
    }
    let seconds = (1e6 * seconds).round() / 1e6;
    let message = format!("position jumps by {metres:.0} m in {seconds} s");
    let advice = "latitude and longitude swapped, a sign lost, or a damaged row?";
    Err(Error::contents(path, line, message).or_hint(advice))
}

/// Reads fixes of a topic, of several; `imu_s` is when the IMU begins and ends.
///
/// # Errors
/// When the log is damaged, or has no fixes.
fn of_log(path: &Path, topic: Option<&str>, imu_s: Option<(f64, f64)>) -> Result<Fixes, Error> {
    let refused = |e| logs::refused(path, e);
    let log = logs::open(path)?;
    let channel = log.channel(Content::Fix, topic).map_err(refused)?;
    let read = log.fixes(channel, Stamp::default()).map_err(refused)?;
    let span = read.first().zip(read.last());
    let span = span.filter(|_| channel.clock == Clock::Unix);
    let [first_s, last_s] = span
        .map(|(a, b)| [a, b])
        .map_or([0.0; 2], |ends| ends.map(|fix| in_seconds(fix.stamp_ns)));
    let clock = clock((first_s, last_s), imu_s).filter(|_| span.is_some());
    let (origin_s, name) = clock.map_or((0.0, String::new()), |c| {
        (c.origin_s, format!(", in {}", c.name))
    });
    let fix = |(line, fix): (u64, LogFix)| {
        let place = DVec3::new(fix.lat_deg * DEG, fix.lon_deg * DEG, fix.h_m);
        let [sigma, v, v_sigma] =
            [fix.sd_ned_m, fix.v_ned_m_s, fix.sd_v_ned_m_s].map(|own| own.map(DVec3::from));
        let t_s = in_seconds(fix.stamp_ns) - origin_s;
        (line, t_s, [Some(place), sigma, v, v_sigma])
    };
    let cut = log.damage().map(logs::cut_off);
    let remarks = cut.map(doubt).into_iter();
    let said = remark(format!("fixes of {}{name}", channel.topic));
    Ok((
        (1..).zip(read).map(fix).collect(),
        remarks.chain([said]).collect(),
    ))
}

#[cfg(test)]
mod fix_tests {
    use super::*;
    use crate::io::tests::Files;
    use approx::assert_abs_diff_eq;
    use glam::DVec2;

    /// Text of Inertial Explorer: units in a line of their own, week and second, velocities up. The IMU ran in seconds of the
    /// week, of which 462797.3 is there.
    #[test]
    fn names_and_units_in_two_lines_are_read() {
        let rows = "\
  GPSTime   GPSTime   Latitude  Longitude Ellip-Hgt Local-VE Local-VN Local-VU East-Std North-Std Up-Std EastVel-Std NorthVel-Std UpVel-Std
     week       (s)      (deg)      (deg)       (m)    (m/s)    (m/s)    (m/s)      (m)       (m)    (m)       (m/s)        (m/s)     (m/s)
     2209 462797.30      30.53    114.356      18.0     1.92     1.11     0.01     0.01     0.012  0.037       0.037        0.043     0.103
";
        let (_files, path) = Files::with("a.posT", rows);
        let (fixes, notes) = read_gnss(&path, None, Some((462_000.0, 463_000.0)), None).unwrap();
        let fix = &fixes[0];
        assert_eq!((fix.t_s, fix.h), (462_797.3, 18.0));
        assert_abs_diff_eq!(fix.lat, 30.53 * DEG, epsilon = 1e-15);
        assert_eq!(fix.pos_sigma_n, DVec3::new(0.012, 0.01, 0.037));
        let velocity = fix.velocity.unwrap();
        assert_eq!(velocity.horizontal, DVec2::new(1.11, 1.92));
        assert_eq!(velocity.down, Some((-0.01, 0.103)));
        assert_eq!(velocity.horizontal_sigma, DVec2::new(0.043, 0.037));
        assert!(
            notes
                .iter()
                .any(|n| n.text.ends_with("seconds of GPS week 2209"))
        );
    }

    /// The sums are those of the independent writer of the file (`src/logs/tests/data/expected.csv`), in degrees and metres.
    #[test]
    fn fixes_of_a_log_are_those_of_its_writer() {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("src/logs/tests/data/ros2_zstd.mcap");
        let (fixes, _) = read_gnss(&path, None, None, None).unwrap();
        let sum = |of: fn(&GnssFix) -> f64| fixes.iter().map(of).sum::<f64>();
        assert_eq!(fixes.len(), 4);
        assert_abs_diff_eq!(
            sum(|f| f.lat) / DEG,
            186.000_007_999_999_98,
            epsilon = 1e-11
        );
        assert_abs_diff_eq!(sum(|f| f.lon) / DEG, 26.399_984, epsilon = 1e-11);
        assert_abs_diff_eq!(sum(|f| f.h), 1_601.022_578_849_756, epsilon = 1e-9);
        assert_abs_diff_eq!(sum(|f| f.pos_sigma_n.z), 4.8, epsilon = 1e-12);
    }
}

// Solutions of RTKLIB (`.pos`): a table whose header is a comment and whose time (GPST) takes two columns.

/// 1980-01-06, from which GPS weeks are counted (Unix s).
const GPS_EPOCH_S: i64 = 315_964_800;
/// Leap seconds between GPS time and UTC, and from when on (Unix s): IERS Bulletin C.
const LEAPS: [(f64, f64); 6] = [
    (1_483_228_800.0, 18.0),
    (1_435_708_800.0, 17.0),
    (1_341_100_800.0, 16.0),
    (1_230_768_000.0, 15.0),
    (1_136_073_600.0, 14.0),
    (915_148_800.0, 13.0),
];

/// True if a text is such a solution.
pub(crate) fn is_rtklib(text: &str) -> bool {
    rtklib_header(text).is_some()
}

/// The line that names the columns.
fn rtklib_header(text: &str) -> Option<(usize, &str)> {
    let comments = text
        .lines()
        .enumerate()
        .take_while(|(_, l)| l.starts_with('%') || l.trim().is_empty());
    let is_header = |l: &str| l.contains("sdn(m)") || l.contains("sdx(m)");
    comments.filter(|(_, l)| is_header(l)).last()
}

/// Clock that an IMU may run in.
#[derive(Debug, PartialEq)]
struct ClockOfImu {
    /// Subtracted from Unix times of the fixes (s).
    origin_s: f64,
    name: String,
}

/// Unix time at which GPS time is 0, by the leap seconds of a time (Unix s).
fn gps_origin_s(unix_s: f64) -> f64 {
    let leap = LEAPS.iter().find(|(from_s, _)| unix_s >= *from_s);
    GPS_EPOCH_S as f64 - leap.map_or(0.0, |(_, leap_s)| *leap_s)
}

/// Clocks that IMUs run in beside fixes that begin then (Unix s): Unix time, GPS time, seconds of the GPS week.
fn clocks(begin_s: f64) -> [ClockOfImu; 3] {
    let gps_s = gps_origin_s(begin_s);
    let week = ((begin_s - gps_s) / WEEK_S).floor();
    let week_name = format!("seconds of GPS week {week}");
    [
        (0.0, "Unix time"),
        (gps_s, "seconds of GPS time"),
        (gps_s + week * WEEK_S, &week_name),
    ]
    .map(|(origin_s, name)| ClockOfImu {
        origin_s,
        name: name.to_owned(),
    })
}

/// The clock in which an IMU ran beside fixes of such times (Unix s).
fn clock(span_s: (f64, f64), imu_s: Option<(f64, f64)>) -> Option<ClockOfImu> {
    let (first_s, last_s) = imu_s?;
    clocks(span_s.0)
        .into_iter()
        .find(|clock| first_s <= span_s.1 - clock.origin_s && span_s.0 - clock.origin_s <= last_s)
}

/// Clocks that a solution may be in, and how far they are ahead of UTC (s); GPS time is by its leap seconds.
const ZONES: [(&str, Option<f64>); 3] =
    [("GPST", None), ("UTC", Some(0.0)), ("JST", Some(32_400.0))];

/// The rows of a solution, their times in seconds since GPS weeks are counted.
fn rtklib(path: &str, text: &str, (at, names): (usize, &str)) -> Result<InputTable, Error> {
    let refuse = |line: usize, message: &str, advice: &'static str| {
        Error::contents(path, line + 1, message).or_hint(advice)
    };
    let Some((_, ahead_s)) = ZONES.iter().find(|(zone, _)| names.contains(zone)) else {
        let advice = "write the solution in GPS time (out-timesys = gpst)";
        return Err(refuse(at, "times that are not GPST, UTC or JST", advice));
    };
    // commas separate cells, or are decimal marks
    let is_comma = names.contains(',');
    let (separator, mark) = if is_comma { (",", ",") } else { (" ", ".") };
    // angles in degrees, minutes and seconds take three columns each
    let is_dms = names.contains("d'\"");
    // the time, which takes two columns, in one
    let (mut whole, mut count) = (String::new(), usize::MAX);
    for (i, line) in text.lines().enumerate() {
        let line = line.replace(',', mark);
        let cells = line.split([' ', ';', '\t', '%']);
        let cells = cells.flat_map(|cell| cell.split(separator));
        let cells: Vec<&str> = cells.filter(|cell| !cell.is_empty()).collect();
        let is_row = !(line.starts_with('%') || cells.is_empty());
        match cells[..] {
            [_, ref names @ ..] if i == at => {
                // of commas one more may be a decimal mark
                count = if is_comma { usize::MAX } else { names.len() };
                let names = [&["t_s"], names].concat().join(separator);
                whole += &names.replace("d'\"", "deg");
            }
            [first, second, ref rest @ ..] if is_row => {
                let angles = [rest.get(..3), rest.get(3..6)].map(|dms| dms.and_then(degrees));
                let angles = is_dms.then_some(angles).and_then(|[lat, lon]| lat.zip(lon));
                let row = gps_time_s(first, second, *ahead_s).map(|t_s| match angles {
                    Some((lat, lon)) => {
                        let angles = [t_s, lat, lon].map(|x| x.to_string());
                        [angles.join(separator), rest[6..].join(separator)].join(separator)
                    }
                    None => {
                        let rest = rest[..count.min(rest.len())].join(separator);
                        [&*t_s.to_string(), &rest].join(separator)
                    }
                });
                whole += &row.ok_or_else(|| {
                    let message = "not a row of time, position, quality, satellites and deviations";
                    let advice = "2021/03/01 00:00:01.000 (or 2147 86401.000), latitude, longitude, height, Q, ns, sdn, sde, sdu";
                    refuse(i, message, advice)
                })?;
            }
            _ => {}
        }
        whole.push('\n');
    }
    let mut table = table::parse(path, &whole, &SOLUTION)?;
    table.ignored.clear();
    Ok(table)
}

/// An angle of degrees, minutes and seconds.
fn degrees(dms: &[&str]) -> Option<f64> {
    let sixtieths = dms.iter().rev().try_fold(0.0, |below, part| {
        Some(below / 60.0 + part.trim_start_matches('-').parse::<f64>().ok()?)
    })?;
    Some(if dms[0].starts_with('-') {
        -sixtieths
    } else {
        sixtieths
    })
}

/// Seconds since GPS weeks are counted, of a date and a time of day or of a week and its second, in GPS time or so far ahead of
/// UTC (s).
fn gps_time_s(first: &str, second: &str, ahead_s: Option<f64>) -> Option<f64> {
    let t_s = if first.contains('/') {
        let text = format!("{first} {second}");
        let time = NaiveDateTime::parse_from_str(&text, "%Y/%m/%d %H:%M:%S%.f").ok()?;
        // GPST has no leap seconds, and neither has this count
        let since = time.and_utc() - DateTime::from_timestamp(GPS_EPOCH_S, 0)?;
        since.num_seconds() as f64 + 1e-9 * f64::from(since.subsec_nanos())
    } else {
        first.parse::<u32>().map(f64::from).ok()? * WEEK_S + second.parse::<f64>().ok()?
    };
    let Some(ahead_s) = ahead_s else {
        return Some(t_s);
    };
    let unix_s = t_s - ahead_s + GPS_EPOCH_S as f64;
    Some(unix_s - gps_origin_s(unix_s))
}

#[cfg(test)]
mod rtklib_tests {
    use super::*;
    use crate::io::tests::{Files, answers};
    use approx::assert_abs_diff_eq;

    const HEAD: &str = "% program : RTKLIB\n%  GPST  latitude(deg) longitude(deg)  height(m)   Q  ns   sdn(m)   sde(m)   sdu(m)\n";

    fn fixes(text: &str, imu_s: Option<(f64, f64)>) -> Result<(Vec<GnssFix>, Vec<Note>), String> {
        let (files, path) = Files::with("a.pos", text);
        read_gnss(&path, None, imu_s, None).map_err(|e| files.told(&e))
    }

    /// The times of the fixes, and what is said of their clock.
    fn times(text: &str, imu_s: Option<(f64, f64)>) -> (Vec<f64>, String) {
        let (fixes, notes) = fixes(text, imu_s).unwrap();
        assert_eq!(fixes[0].pos_sigma_n.z, 4.0);
        let said = notes[0].text.split(": ").nth(1).unwrap_or_default();
        (fixes.iter().map(|fix| fix.t_s).collect(), said.to_owned())
    }

    #[test]
    fn what_is_no_table_of_fixes_is_refused_with_its_line() {
        let commas = "%  GPST,latitude(deg),longitude(deg),height(m),Q,ns,sdn(m),sde(m),sdu(m)\n\
            2021/03/01 00:00:01,250,46,5,-6,50001,400,8,5,8,2,0,2,1,4,0\n";
        let texts = [
            HEAD.to_owned(),
            format!("{HEAD}2021/03/01 46.5 6.5\n"),
            HEAD.replace("GPST", "TAI"),
            commas.to_owned(),
            "t_s,lat_deg,lon_deg,h_m,sd_n_m,sd_e_m,sd_d_m,altitude\n0,46,7,400,1,1,2,450\n"
                .to_owned(),
        ];
        insta::assert_snapshot!(answers(texts.iter().map(|text| (text, fixes(text, None)))));
    }

    /// The other output settings of RTKLIB state the same track. Deviations along the axes of the Earth turn by the rotation
    /// from them to north, east, down: at latitude 0 and longitude 45° north is z, east (y − x)/√2 and down −(x + y)/√2, so
    /// that variances of 1, 4 and 9 m² with 2 m² between x and y are 9 north, (1 + 4)/2 − 2 east and (1 + 4)/2 + 2 down.
    #[test]
    fn other_formats_state_the_same_fixes() {
        let text = |name: &str, in_file: &str, row: &str| {
            format!(
                "{}{row} 400.8 5 8 2.0 2.1 4.0\n",
                HEAD.replace(name, in_file)
            )
        };
        let llh = text("GPST", "GPST", "2021/03/01 00:00:01.250 46.5 -6.50001");
        let expected = fixes(&llh, None).unwrap().0[0];
        assert_eq!(expected.t_s, 86_401.25);
        for text in [
            text(
                "(deg)",
                "(d'\")",
                "2021/03/01 00:00:01.250 46 30 00.0 -6 30 00.036",
            ),
            text("GPST", "UTC", "2021/02/28 23:59:43.250 46.5 -6.50001"),
            text("GPST", "JST", "2021/03/01 08:59:43.250 46.5 -6.50001"),
        ] {
            let fix = fixes(&text, None).unwrap().0[0];
            assert_eq!(fix.t_s, expected.t_s, "{text}");
            assert!(
                (fix.lat - expected.lat).abs() < 1e-15 && (fix.lon - expected.lon).abs() < 1e-15
            );
        }
        let ecef = "% GPST x-ecef(m) y-ecef(m) z-ecef(m) Q ns sdx(m) sdy(m) sdz(m) sdxy(m) sdyz(m) sdzx(m) vx(m/s) vy(m/s) vz(m/s) sdvx sdvy sdvz\n\
                    2021/03/01 00:00:01.250 4510094.634714941 4510094.634714941 0 5 8 1 2 3 1.4142135623730951 0 0 1 2 3 0.1 0.2 0.3\n";
        let fix = fixes(ecef, None).unwrap().0[0];
        let (v, sigma) = (fix.velocity.unwrap(), fix.pos_sigma_n);
        let (down, down_sigma) = v.down.unwrap();
        for (found, expected) in [
            (fix.lat, 0.0),
            (fix.lon, 45.0 * DEG),
            (fix.h, 100.0),
            (sigma.x, 3.0),
            (sigma.y, 0.5_f64.sqrt()),
            (sigma.z, 4.5_f64.sqrt()),
            (v.horizontal.x, 3.0),
            (v.horizontal.y, 0.5_f64.sqrt()),
            (down, -4.5_f64.sqrt()),
            (down_sigma, 0.025_f64.sqrt()),
        ] {
            assert_abs_diff_eq!(found, expected, epsilon = 1e-9);
        }
    }

    /// Decimal commas, of numbers and seconds; commas between the cells too, which are told from them by the header alone.
    #[test]
    fn decimal_commas_state_the_same_fixes() {
        let row = "2021/03/01 00:00:01.250 46.5 -6.50001 400.8 5 8 2.0 2.1 4.0\n";
        let expected = fixes(&format!("{HEAD}{row}"), None).unwrap().0;
        let comma = |text: &str| text.replace('.', ",");
        let listed = |text: &str| {
            let (date, rest) = text.split_once(' ').unwrap();
            format!("{date} {}", rest.replace(' ', ","))
        };
        let names = HEAD.split_once("%  ").unwrap().1;
        let names: Vec<&str> = names.split_whitespace().collect();
        let names = format!("% program\n%  {}\n", names.join(","));
        for text in [
            format!("{HEAD}{}", comma(row)),
            format!("{HEAD}{}", comma(row).replace(' ', ";")),
            format!("{names}{}", listed(row)),
        ] {
            assert_eq!(fixes(&text, None).unwrap().0, expected, "{text}");
        }
    }

    /// 2021-03-01 was a Monday, the second day of GPS week 2147.
    #[test]
    fn dates_and_weeks_are_one_clock() {
        let dated = format!("{HEAD}2021/03/01 00:00:01.250   46.5 6.5 400.8  5  8  2.0 2.1 4.0\n");
        let counted = format!("{HEAD}2147 86401.250   46.5 6.5 400.8  5  8  2.0 2.1 4.0\n");
        assert!(is_rtklib(&dated) && !is_rtklib("t_s,lat_deg\n") && !is_rtklib(""));
        for text in [dated, counted] {
            let (t_s, said) = times(&text, None);
            assert_eq!(t_s, [86_401.25]);
            assert_eq!(said, "an RTKLIB solution, in seconds of GPS week 2147");
        }
    }

    /// An IMU in Unix time, 18 leap seconds behind since 2017, or in GPS time has the fixes on its clock. 86401.25 s of
    /// week 2147 are 1298591.6 million of GPS time.
    #[test]
    fn the_clock_is_the_imu_s() {
        let row = "46.5 6.5 400.8 5 8 2.0 2.1 4.0\n";
        let text = format!("{HEAD}2021/03/01 00:00:01.250 {row}");
        let gps_s = 2147.0 * WEEK_S + 86_401.25;
        let unix_s = 1_614_556_801.25 - 18.0;
        for (start_s, words) in [(gps_s, "seconds of GPS time"), (unix_s, "Unix time")] {
            let imu_s = Some((start_s - 5.0, start_s + 5.0));
            let (t_s, said) = times(&text, imu_s);
            assert_eq!(t_s, [start_s]);
            assert_eq!(said, format!("an RTKLIB solution, in {words}"));
        }
    }

    /// Fixes in Unix time beside IMUs in GPS time and in its weeks; an IMU of no known clock leaves them.
    #[test]
    fn dated_fixes_come_to_the_clock_of_the_imu() {
        let unix_s = (1_614_556_783.25, 1_614_556_883.25);
        let of = |start_s: f64| clock(unix_s, Some((start_s - 5.0, start_s + 5.0)));
        let gps_s = 2147.0 * WEEK_S + 86_401.25;
        for (start_s, name) in [
            (unix_s.0, "Unix time"),
            (gps_s, "seconds of GPS time"),
            (86_401.25, "seconds of GPS week 2147"),
        ] {
            let clock = of(start_s).unwrap();
            assert_eq!(
                (unix_s.0 - clock.origin_s, clock.name.as_str()),
                (start_s, name)
            );
        }
        assert_eq!([of(3_326.0), clock(unix_s, None)], [None, None]);
    }

    #[test]
    fn the_week_counts_on() {
        let text =
            format!("{HEAD}2147 604799 46.5 6.5 400 5 8 2 2 4\n2148 0.5 46.5 6.5 400 5 8 2 2 4\n");
        assert_eq!(times(&text, None).0, [604_799.0, 604_800.5]);
    }
}

// Recorded IMU data.

/// A step this many times the median one is a gap.
const GAP: f64 = 1.5;
/// A step from which on it is no IMU's (s).
const SLOWEST_S: f64 = 2.0;
/// Mean angular rate above which the unit is doubted (rad/s).
const FAST: f64 = 2.0;

/// A recording, ready to be fused.
pub(crate) struct ImuFile {
    /// Samples whose intervals follow one another.
    pub samples: Vec<ImuIncrement>,
    /// Samples a second, by the median step.
    pub rate_hz: f64,
    /// Warnings, and notes on the reading.
    pub remarks: Vec<Note>,
}

/// Dictionary of recordings under way. Texts without a header are those of KF-GINS, with or without an odometer.
const SAMPLES: Dictionary<'_> = Dictionary {
    bare: &[
        "t_s dtheta_x_rad dtheta_y_rad dtheta_z_rad dv_x_m_s dv_y_m_s dv_z_m_s",
        "t_s dtheta_x_rad dtheta_y_rad dtheta_z_rad dv_x_m_s dv_y_m_s dv_z_m_s odometer_m_s",
    ],
    advice: "columns: t_s, gyro_x_rad_s … accel_z_m_s2 (rates) or t_s, dtheta_x_rad … dv_z_m_s (increments); as KF-GINS without a header, 7 (t_s, dtheta_x, dtheta_y, dtheta_z in rad, dv_x, dv_y, dv_z in m/s), or 8 with an odometer",
    ..recordings::DICTIONARY
};

/// Reads a recording: a table whose headers are those of static recordings (rates, or increments over the
/// interval that ends at the time given), or the text of KF-GINS: time, three angle increments (rad), three
/// velocity increments (m/s), and perhaps an odometer's speed, which is left. `names` are those of the columns of a file
/// without a header, `topic` is that of a log that has several.
///
/// # Errors
/// Whatever is wrong with it, with its line.
pub(crate) fn read_imu(
    path: &Path,
    names: Option<&[String]>,
    topic: Option<&str>,
) -> Result<ImuFile, Error> {
    let options = ReadOptions {
        columns: names.map(<[String]>::to_vec),
        log: LogOptions {
            topic: topic.map(str::to_owned),
            ..LogOptions::default()
        },
        ..ReadOptions::default()
    };
    let mut table = recordings::load(path, &options, &SAMPLES)?;
    let facts = recordings::facts::repair_drive(&mut table);
    let names = [
        "t_s", "accel.x", "accel.y", "accel.z", "gyro.x", "gyro.y", "gyro.z",
    ];
    let [time, signals @ ..] = table.columns(names).map_err(|refusal| {
        let misspelt = recordings::facts::misspelt(&table, |_| true).into_iter();
        misspelt.fold(refusal, Failure::hint)
    })?;
    let unit_s = |values| unit_of_step(median_step(values)).0;
    let unit_s = time.factor.unwrap_or_else(|| unit_s(&time.values));
    let from_gravity = gravity_factor(&table)?;
    let mut remarks: Vec<Note> = table.assumptions.iter().map(remark).collect();
    remarks.extend(table.warnings.iter().chain(&facts).map(doubt));
    if table.is_bare {
        let odometer = match table.ignored.is_empty() {
            true => "",
            false => "; the odometer in column 8 is not used",
        };
        let text = "no header: read as KF-GINS text, angle then velocity increments";
        remarks.push(remark(format!("{text}{odometer}")));
    }
    let t_s: Vec<f64> = time.values.iter().map(|t| t * unit_s).collect();
    let (samples, needed) = (t_s.len(), 3);
    if samples < needed {
        let message = format!("{samples} samples, but {needed} are needed");
        return Err(Error::contents(&table.path, Place::Within, message));
    }
    increasing(&table.path, |k| table.line(k), t_s.iter().copied())?;
    let step = median_step(&t_s);
    if step > SLOWEST_S && time.factor == Some(1.0) {
        return Err(no_seconds(&table, time, step, unit_of_step(step).1));
    }
    let since_s = |k: usize| if k == 0 { step } else { t_s[k] - t_s[k - 1] };
    let samples = (0..t_s.len()).map(|k| {
        // those after a hole last a step like any other
        let dt_s = Some(since_s(k))
            .filter(|s| *s <= GAP * step)
            .unwrap_or(step);
        let three = |own: &[&Column]| {
            let value =
                |axis: usize| own[axis].values[k] * own[axis].factor.unwrap_or(from_gravity);
            let seconds = if own[0].quantity.per_sample {
                1.0
            } else {
                dt_s
            };
            DVec3::from([0, 1, 2].map(value)) * seconds
        };
        ImuIncrement {
            t_s: t_s[k],
            dt_s,
            dtheta: three(&signals[3..]),
            dv: three(&signals[..3]),
        }
    });
    let mut samples: Vec<ImuIncrement> = samples.collect();
    let glitches = replace_glitches(&mut samples);
    if let Some(first) = glitches.first() {
        remarks.push(doubt(format!(
            "samples that no motion explains: {}, the first at {} s (line {}); taken as missing",
            glitches.len(),
            t_s[*first],
            table.line(*first)
        )));
    }
    remarks.extend(doubt_units(&table.path, &samples, 1.0 / step)?.map(doubt));
    let mut holes = Vec::new();
    for (k, sample) in samples.iter().enumerate() {
        let refuse = |message: String| Error::contents(&table.path, table.line(k), message);
        let missing_s = since_s(k) - step;
        if missing_s > LONGEST_GAP_S + 0.5 * step {
            let [from, to] = [k - 1, k].map(|k| t_s[k]);
            let message = format!("no samples from {from} s to {to} s: at most {LONGEST_GAP_S} s");
            let advice = "fuse the stretches before and after it one by one";
            return Err(refuse(message).or_hint(advice));
        }
        let angle = sample.dtheta.length();
        if angle > MAX_ROTATION {
            let [degrees, most] = [angle, MAX_ROTATION].map(|a| a / DEG);
            let message = format!("a rotation of {degrees:.1}° in one sample, at most {most:.1}°");
            let advice =
                "is the unit right? gyro_x_deg_s is degrees, gyro_x_rad_s radians per second";
            return Err(refuse(message).or_hint(advice));
        }
        if missing_s > (GAP - 1.0) * step {
            holes.push(format!(
                "{missing_s:.2} s before {:.2} s (line {})",
                t_s[k],
                table.line(k)
            ));
        }
    }
    if let Some((first, more)) = holes.split_first() {
        let more = more.len();
        remarks.push(doubt(format!(
            "samples missing: {first} and {more} more gaps; bridged"
        )));
    }
    let remarks = remarks.into_iter().map(|note| of_file(note, &table.path));
    Ok(ImuFile {
        samples: bridged(&samples, step),
        rate_hz: 1.0 / step,
        remarks: remarks.collect(),
    })
}

/// Change of angular rate (rad/s) and specific force (m/s²) from one sample to the next and back that no motion makes.
const GLITCH: [f64; 2] = [10.0, 500.0];

/// Puts the mean of its neighbours, which agree, in the place of a sample that is far from both; which ones (one sample is bridged
/// like that anyway).
fn replace_glitches(samples: &mut [ImuIncrement]) -> Vec<usize> {
    let rates = |s: &ImuIncrement| [s.dtheta / s.dt_s, s.dv / s.dt_s];
    let mut found = Vec::new();
    for k in 1..samples.len().saturating_sub(1) {
        let [before, at, after] = [k - 1, k, k + 1].map(|k| rates(&samples[k]));
        let dt_s = samples[k].dt_s;
        let limits = [GLITCH[0].min(MAX_ROTATION / dt_s), GLITCH[1]];
        let mean = [0, 1].map(|i| 0.5 * (before[i] + after[i]));
        let is_glitch = |i: usize| {
            let apart = before[i].distance(after[i]);
            apart < 0.1 * limits[i] && at[i].distance(mean[i]) > limits[i]
        };
        if (0..2).any(is_glitch) {
            (samples[k].dtheta, samples[k].dv) = (mean[0] * dt_s, mean[1] * dt_s);
            found.push(k);
        }
    }
    found
}

/// Over a whole recording the specific force is gravity in the mean, and nothing turns all the time.
fn doubt_units(
    path: &str,
    samples: &[ImuIncrement],
    rate_hz: f64,
) -> Result<Option<String>, Error> {
    let mean = |of: fn(&ImuIncrement) -> DVec3| {
        let lengths = samples
            .iter()
            .map(|sample| of(sample).length() / sample.dt_s);
        lengths.sum::<f64>() / samples.len() as f64
    };
    let (force, rate) = (mean(|sample| sample.dv), mean(|sample| sample.dtheta));
    if !(4.0..25.0).contains(&force) {
        check_gravity(path, force, Some(rate_hz))?;
        check_gravity(path, force.max(0.3), None)?;
    }
    let degrees = rate / DEG;
    let text = format!("mean angular rate {degrees:.0} deg/s: deg/s named rad/s?");
    Ok((rate > FAST).then_some(text))
}

// An initial state (TOML).

/// Largest velocity (m/s): beyond that of the Earth's surface and of orbits.
const MAX_SPEED_M_S: f64 = 1e4;

/// Initial state of a drive: nav-sim fuse --initial
#[derive(Deserialize, JsonSchema)]
#[schemars(title = "Initial state", deny_unknown_fields)]
struct InitialTable {
    /// Time (s)
    t_s: f64,
    /// Latitude of the IMU (degrees)
    #[schemars(range(min = -MAX_LATITUDE_DEG, max = MAX_LATITUDE_DEG))]
    lat_deg: f64,
    /// Longitude of the IMU (degrees)
    lon_deg: Between<-360, 360, false>,
    /// Height of the IMU above the ellipsoid (m)
    #[schemars(range(min = -1e5, max = 1e6))]
    h_m: f64,
    /// Velocity north (m/s; default: 0)
    #[serde(default)]
    #[schemars(range(min = -MAX_SPEED_M_S, max = MAX_SPEED_M_S))]
    v_n_m_s: f64,
    /// Velocity east (m/s; default: 0)
    #[serde(default)]
    #[schemars(range(min = -MAX_SPEED_M_S, max = MAX_SPEED_M_S))]
    v_e_m_s: f64,
    /// Velocity down (m/s; default: 0)
    #[serde(default)]
    #[schemars(range(min = -MAX_SPEED_M_S, max = MAX_SPEED_M_S))]
    v_d_m_s: f64,
    /// Roll of the vehicle (degrees)
    roll_deg: Between<-180, 180, false>,
    /// Pitch (degrees)
    pitch_deg: Between<-90, 90, false>,
    /// Yaw (degrees)
    yaw_deg: Between<-360, 360, false>,
    #[serde(flatten)]
    sigma: InitialSettings,
}

/// The JSON schema of such a file.
#[must_use]
pub(crate) fn initial_schema() -> serde_json::Value {
    schemars::schema_for!(InitialTable).to_value()
}

/// Reads an initial state: time, position of the IMU, velocity (0 where it is not said), attitude of the
/// vehicle, and standard deviations as in the `[initial]` section of a scenario.
///
/// # Errors
/// File, line, key and value of what is refused.
pub(crate) fn read_initial(path: &Path) -> Result<Start, Failure> {
    let refused = |e| file_kind::or_wrong_kind(&[FileKind::Initial], path, e);
    parse(&TomlSource::read(path)?).map_err(refused)
}

fn parse(source: &TomlSource) -> Result<Start, Failure> {
    let d: InitialTable = source.get()?;
    let (roll, pitch, yaw) = (d.roll_deg.0 * DEG, d.pitch_deg.0 * DEG, d.yaw_deg.0 * DEG);
    let state = NavState {
        lat: d.lat_deg * DEG,
        lon: d.lon_deg.0 * DEG,
        h: d.h_m,
        v_n: DVec3::new(d.v_n_m_s, d.v_e_m_s, d.v_d_m_s),
        q_b_n: RollPitchYaw { roll, pitch, yaw }.to_quat(),
    };
    let sigma = d.sigma;
    if sigma.perfect {
        return Err(source.refused("perfect", "is for simulations only"));
    }
    Ok(Start {
        t_s: d.t_s,
        state,
        sigma,
        found: None,
    })
}

#[cfg(test)]
mod initial_tests {
    use super::*;
    use crate::io::tests::{answers, told};

    #[test]
    fn refusals_name_line_key_and_value() {
        let sound = "t_s = 0\nlat_deg = 46\nlon_deg = 6\nh_m = 400\nroll_deg = 0\npitch_deg = 0\nyaw_deg = 40\n";
        let read = |text: &str| parse(&TomlSource::new("i.toml", text));
        assert_eq!(read(sound).unwrap().sigma, InitialSettings::default());
        insta::assert_snapshot!(answers(
            [
                ("= 46", "= 91"),
                ("= 46", "= 89.95"),
                ("= 400", "= inf"),
                ("h_m = 400\n", ""),
                ("yaw_deg", "heading_deg"),
                ("t_s = 0", "pos_sigma_m = [1, 1, 1]"),
                ("t_s = 0", "t_s = 0\npos_sigma_m = [1, 1, -1]"),
            ]
            .map(|(old, new)| {
                let text = sound.replacen(old, new, 1);
                let answer = read(&text).map_err(|e| told(&e));
                (text, answer)
            })
        ));
    }
}

// Recorded speeds of a wheel.

/// Speeds and their times.
static SPEED_QUANTITIES: [Quantity; 5] = [
    Quantity::time(OF_CLOCK),
    Quantity::time(STAMP),
    Quantity::time(OF_RECEIVER),
    Quantity::new("t_s", "timeus", NONE, DefaultUnit::Is(1e-6)),
    Quantity::new(
        "speed",
        "speed velocity vel v wheel wheel_speed odometer odo forward forward_speed",
        SPEED,
        DefaultUnit::Unknown,
    ),
];

const SPEEDS: Dictionary<'_> = Dictionary::new(
    &SPEED_QUANTITIES,
    "columns: t_s and wheel_m_s (or wheel_km_h, wheel_mph), negative in reverse",
);

/// Reads speeds: a table with a time and a speed.
///
/// # Errors
/// Whatever is wrong with it, with its line.
pub(crate) fn read_wheel(path: &Path) -> Result<Vec<WheelSpeed>, Error> {
    let table = table::read(path, &SPEEDS)?;
    let columns = table.columns(["t_s", "speed"]);
    let [time, speed] = columns.map_err(|e| file_kind::or_wrong_kind(&[], path, e))?;
    if speed.factor.is_none() {
        return Err(table.no_unit(speed));
    }
    let t_s = (0..table.rows()).map(|row| time.si(row));
    increasing(&table.path, |k| table.line(k), t_s.clone())?;
    let rows = t_s.enumerate().map(|(row, t_s)| {
        let m_s = speed.si(row);
        WheelSpeed { t_s, m_s }
    });
    Ok(rows.collect())
}

#[cfg(test)]
mod wheel_tests {
    use super::*;
    use crate::io::tests::{Files, answers};
    use approx::assert_abs_diff_eq;

    fn read(text: &str) -> Result<Vec<WheelSpeed>, String> {
        let (files, path) = Files::with("w.csv", text);
        read_wheel(&path).map_err(|e| files.told(&e))
    }

    #[test]
    fn speeds_come_by_the_unit_of_their_column() {
        for (header, m_s) in [
            ("t_s,wheel_m_s", 36.0),
            ("time,speed (km/h)", 10.0),
            ("t_s,odo_km_h", 10.0),
            ("t_s,v_mph", 16.09344),
        ] {
            let speeds = read(&format!("{header}\n0.5,36\n1.5,-18\n")).unwrap();
            for (speed, t_s, m_s) in [(&speeds[0], 0.5, m_s), (&speeds[1], 1.5, -m_s / 2.0)] {
                assert_eq!(speed.t_s, t_s, "{header}");
                assert_abs_diff_eq!(speed.m_s, m_s, epsilon = 1e-12);
            }
        }
    }

    #[test]
    fn what_is_no_speed_is_refused_with_its_line_and_column() {
        insta::assert_snapshot!(answers(
            [
                "# a\nt_s,wheel_ticks\n0,1\n",
                "t_s,wheel\n0,1\n",
                "t_s,wheel_m_s,speed_m_s\n0,1,1\n",
                "t_s,gear\n0,1\n",
                "wheel_m_s\n1\n",
                "t_s,wheel_m_s\n1,2\n1,2\n",
                "t_s,wheel_m_s\n1,x\n",
            ]
            .map(|text| (text, read(text)))
        ));
    }
}

#[cfg(test)]
mod gap_tests {
    use super::*;
    use crate::io::tests::Files;
    use std::fmt::Write;

    /// Half a step more is a gap, less is not.
    #[test]
    fn a_step_of_one_and_a_half_is_a_gap() {
        let read = |more_s: f64| {
            let mut text = "t_s,accel_x_m_s2,accel_y_m_s2,accel_z_m_s2,gyro_x_rad_s,gyro_y_rad_s,gyro_z_rad_s\n".to_owned();
            for k in 0..40 {
                let t_s = 0.01 * f64::from(k) + if k < 20 { 0.0 } else { more_s };
                writeln!(text, "{t_s},0.01,0.02,-9.81,0.001,0.002,0.003").unwrap();
            }
            let (_files, path) = Files::with("imu.csv", text);
            let file = read_imu(&path, None, None).unwrap();
            file.samples.len()
        };
        assert_eq!([0.004, 0.006, 0.009].map(read), [40, 41, 41]);
    }
}
