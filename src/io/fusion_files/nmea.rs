//! NMEA 0183 sentences of a receiver, as it logs them: `GGA` (position), `RMC` (speed and course, date), `GST` (standard
//! deviations), from any talker. What has one time is one fix.
//!
//! The layout of the sentences is that of the receivers' manuals (Trimble R6/R7/R8, appendix A; u-blox protocol
//! specifications).

use super::{Fixes, clock, doubt, remark};
use crate::io::Failure as Error;
use chrono::{NaiveDate, NaiveTime, Timelike};
use glam::{DVec2, DVec3};
use nav_sim_navigation::gnss::FixSigma;
use nav_sim_signal::units::DEG;

/// Seconds of a day.
const DAY_S: f64 = 86_400.0;
/// A knot (m/s).
const KNOT: f64 = 1852.0 / 3600.0;

/// Contents of the sentences of one time.
#[derive(Default)]
struct Epoch {
    /// Line of its position.
    line: u64,
    /// Time of day as written (s), and since the midnight before the first sentence.
    time_s: f64,
    since_s: f64,
    /// Latitude, longitude (rad), height above the ellipsoid (m).
    position: Option<DVec3>,
    sigma: Option<DVec3>,
    /// North and east (m/s), and what an unknown course leaves open of them (m/s).
    velocity: Option<(DVec2, f64)>,
}

/// All of a log.
#[derive(Default)]
struct NmeaLog {
    epochs: Vec<Epoch>,
    /// Midnight before the first sentence (Unix s), from the last date seen: before time is acquired receivers output
    /// arbitrary dates.
    midnight_s: Option<f64>,
    has_separation: bool,
}

/// Returns true if one of the first lines of a text has a sentence of a receiver in it.
pub(crate) fn is_nmea(text: &str) -> bool {
    // those of VectorNav are of an IMU
    let is_address = |word: &str| {
        let is_upper = word.bytes().all(|b| b.is_ascii_uppercase());
        word.len() == 5 && is_upper && &word[..2] != "VN"
    };
    let mut lines = text.lines().take(20).map(str::trim_end);
    lines.any(|line| body(line).is_ok_and(|body| body.split(',').next().is_some_and(is_address)))
}

impl NmeaLog {
    /// A sentence, whatever a logger wrote before it in its line.
    fn sentence(&mut self, line: u64, text: &str, has_checksums: bool) -> Result<(), &'static str> {
        let fields = fields(text, has_checksums)?;
        let field = |i: usize| fields.get(i).copied().unwrap_or_default();
        let number = |i: usize| field(i).parse::<f64>().ok();
        let kind = field(0).get(2..).unwrap_or_default();
        // proprietary ones begin with P
        if !matches!(kind, "RMC" | "GGA" | "GST")
            || field(1).is_empty()
            || field(0).starts_with('P')
        {
            return Ok(());
        }
        let time_s = time_of_day(field(1)).ok_or("not a time of day hhmmss.ss")?;
        let last = self.epochs.last().map(|e| (e.time_s, e.since_s - e.time_s));
        if last.is_none_or(|(last_s, _)| last_s != time_s) {
            // after midnight it is a day later
            let next_day =
                |(last_s, day_s)| day_s + DAY_S * f64::from(last_s - time_s > DAY_S / 2.0);
            self.epochs.push(Epoch {
                time_s,
                since_s: time_s + last.map_or(0.0, next_day),
                ..Epoch::default()
            });
        }
        let Some(epoch) = self.epochs.last_mut() else {
            return Ok(());
        };
        match kind {
            // quality 0: none, 6: dead reckoning, 7: typed in by hand
            "GGA" if epoch.position.is_none() && !matches!(field(6), "" | "0" | "6" | "7") => {
                let lat = angle(field(2), field(3), 90.0);
                let lon = angle(field(4), field(5), 180.0);
                let lat = lat.ok_or("not a latitude ddmm.mmmm,N or S")?;
                let lon = lon.ok_or("not a longitude dddmm.mmmm,E or W")?;
                let altitude = number(9).ok_or("not an altitude")?;
                epoch.line = line;
                epoch.position = Some(DVec3::new(lat, lon, altitude + number(11).unwrap_or(0.0)));
                self.has_separation |= number(11).is_some();
            }
            "GST" => {
                let sigma = [6, 7, 8].map(|i| number(i).unwrap_or_default());
                epoch.sigma = Some(DVec3::from(sigma)).filter(|sigma| sigma.min_element() > 0.0);
            }
            "RMC" => {
                if field(2) == "A" {
                    epoch.velocity = number(7).map(|knots| horizontal(knots, number(8)));
                }
                let first =
                    midnight(field(9)).map(|midnight_s| midnight_s - epoch.since_s + time_s);
                self.midnight_s = first.or(self.midnight_s);
            }
            _ => {}
        }
        Ok(())
    }

    /// Offset added to the seconds since the first midnight, and the name of the resulting clock:
    /// Unix time where the span of the IMU shows it, else seconds of the first day, else GPS time.
    fn clock(&self, imu_s: Option<(f64, f64)>) -> Option<(f64, String)> {
        let midnight_s = self.midnight_s?;
        let (first, last) = (self.epochs.first()?.since_s, self.epochs.last()?.since_s);
        let is_of_day = imu_s.is_some_and(|imu| imu.0 <= last && first <= imu.1);
        let clock = clock((midnight_s + first, midnight_s + last), imu_s)?;
        let is_meant = clock.origin_s == 0.0 || !is_of_day;
        is_meant.then_some((midnight_s - clock.origin_s, clock.name))
    }
}

/// Fixes of a log, and its notes. `default_sigma`: standard deviations where `GST` states none; `imu_s` is when the IMU
/// begins and ends.
///
/// # Errors
/// A damaged sentence, no position at all.
pub(super) fn fixes(
    path: &str,
    text: &str,
    default_sigma: Option<&FixSigma>,
    imu_s: Option<(f64, f64)>,
) -> Result<Fixes, Error> {
    let mut log = NmeaLog::default();
    let lines = (1..).zip(text.lines().map(str::trim));
    let lines: Vec<(u64, &str)> = lines.filter(|(_, line)| !line.is_empty()).collect();
    let has_checksums = lines.iter().any(|(_, line)| line.contains('*'));
    let ends = [lines.first(), lines.last()].map(|end| end.map(|(i, _)| *i));
    for (i, line) in lines {
        // cut at its ends by whatever logged it
        if let Err(message) = log.sentence(i, line, has_checksums)
            && !ends.contains(&Some(i))
        {
            let found: String = line.chars().take(60).collect();
            let refused = Error::contents(path, i, format!("{message}: {found}"));
            return Err(refused.or_hint("remove the line, if only that is damaged"));
        }
    }
    let day = || (0.0, "seconds of the day (UTC)".to_owned());
    let (origin_s, clock) = log.clock(imu_s).unwrap_or_else(day);
    let vel_sigma = default_sigma.and_then(|s| s.vel_m_s);
    let fix = |epoch: &Epoch| {
        let (v, sigma) = epoch
            .velocity
            .zip(vel_sigma)
            .map(|((v, course), [n, e, _])| {
                let sigma = DVec2::new(n.hypot(course), e.hypot(course));
                (v.extend(f64::NAN), sigma.extend(f64::NAN))
            })
            .unzip();
        let stated = [Some(epoch.position?), epoch.sigma, v, sigma];
        Some((epoch.line, origin_s + epoch.since_s, stated))
    };
    let fixes: Vec<_> = log.epochs.iter().filter_map(fix).collect();
    let count = fixes.len();
    if count == 0 {
        let message = "NMEA sentences without GGA fixes";
        return Err(Error::contents(path, 1_u64, message)
            .or_hint("let the receiver write GGA, RMC and GST"));
    }
    let text = format!("NMEA sentences: {count} fixes, times are {clock}");
    let mut remarks = vec![remark(text)];
    if !has_checksums {
        let text = "no sentence has a checksum: damaged digits are undetected";
        remarks.push(doubt(text));
    }
    if vel_sigma.is_none() && log.epochs.iter().any(|e| e.velocity.is_some()) {
        let text =
            "speed and course are unused without standard deviations: --gnss-sigma 2,2,4:0.1";
        remarks.push(doubt(text));
    }
    if !log.has_separation {
        let text = "GGA states no geoid separation: heights are above the sea, up to 100 m off";
        remarks.push(doubt(text));
    }
    Ok((fixes, remarks))
}

/// Text between `$` and the end of a line; before it, a logger may have written the time of
/// arrival.
fn body(line: &str) -> Result<&str, &'static str> {
    let start = line.find(['$', '!']);
    start
        .map(|start| &line[start + 1..])
        .ok_or("not a sentence: no $")
}

/// Fields of a sentence after checking its checksum (XOR of the bytes between `$` and `*`), unless the log has none.
fn fields(line: &str, has_checksums: bool) -> Result<Vec<&str>, &'static str> {
    if !has_checksums {
        return Ok(body(line)?.split(',').collect());
    }
    let whole = body(line)?.rsplit_once('*');
    let summed = whole.and_then(|(body, sum)| Some((body, u8::from_str_radix(sum, 16).ok()?)));
    let (body, sum) = summed.ok_or("no checksum")?;
    match sum == body.bytes().fold(0, |all, byte| all ^ byte) {
        true => Ok(body.split(',').collect()),
        false => Err("wrong checksum"),
    }
}

/// `hhmmss.ss` (s of the day).
fn time_of_day(text: &str) -> Option<f64> {
    let time = NaiveTime::parse_from_str(text, "%H%M%S%.f").ok()?;
    Some(f64::from(time.num_seconds_from_midnight()) + f64::from(time.nanosecond()) / 1e9)
}

/// `ddmm.mmmm` or `dddmm.mmmm` and its hemisphere (rad).
fn angle(text: &str, hemisphere: &str, limit_deg: f64) -> Option<f64> {
    let point = text.find('.').unwrap_or(text.len());
    let (degrees, minutes) = text.split_at_checked(point.checked_sub(2)?)?;
    let (degrees, minutes): (u16, f64) = (degrees.parse().ok()?, minutes.parse().ok()?);
    let value = f64::from(degrees) + minutes / 60.0;
    let sign = match hemisphere {
        "N" | "E" => 1.0,
        "S" | "W" => -1.0,
        _ => return None,
    };
    ((0.0..60.0).contains(&minutes) && value <= limit_deg).then_some(sign * value * DEG)
}

/// Midnight of a date `ddmmyy` (Unix s).
fn midnight(text: &str) -> Option<f64> {
    let date = NaiveDate::parse_from_str(text, "%d%m%y").ok()?;
    Some(date.and_time(NaiveTime::MIN).and_utc().timestamp() as f64)
}

/// North and east velocity, and its sigma. Receivers state no course at rest: then zero, with the speed as sigma.
fn horizontal(knots: f64, course_deg: Option<f64>) -> (DVec2, f64) {
    let speed = knots * KNOT;
    course_deg.map_or((DVec2::ZERO, speed), |course| {
        (speed * DVec2::from_angle(course * DEG), 0.0)
    })
}

#[cfg(test)]
mod tests;
