//! NMEA 0183 sentences of a receiver, as it logs them: `GGA` (position), `RMC` or `VTG` (speed and course), `GST`
//! (standard deviations), `RMC` or `ZDA` (date), from any talker. What has one time is one fix.
//!
//! The layout of the sentences is that of the receivers' manuals (Trimble R6/R7/R8, appendix A; u-blox protocol
//! specifications).

use super::fixes::Fixes;
use super::rtklib;
use super::{doubt, remark};
use crate::io::fusion_files::WEEK_S;
use crate::io::{Failure as Error, help};
use chrono::NaiveDate;
use glam::{DVec2, DVec3};
use nav_sim_document::Note;
use nav_sim_navigation::gnss::{FixSigma, GnssFix, GnssVelocity};
use nav_sim_signal::units::DEG;
use std::collections::BTreeMap;

/// Seconds of a day.
const DAY_S: f64 = 86_400.0;

/// What the sentences of one time say.
#[derive(Debug, Clone, Default)]
struct Epoch {
    /// Line of its first sentence, and of its position.
    line: usize,
    /// Time of day as written (s), and the days since the first sentence.
    time_s: f64,
    day: f64,
    /// Latitude, longitude (rad), height above the ellipsoid (m).
    position: Option<[f64; 3]>,
    hdop: Option<f64>,
    sigma: Option<DVec3>,
    /// North and east (m/s), and what an unknown course leaves open of them (m/s).
    velocity: Option<(DVec2, f64)>,
}

/// All of a log.
#[derive(Debug, Default)]
pub(super) struct Log {
    epochs: Vec<Epoch>,
    /// Midnights before the first sentence (Unix s), and how many sentences state them.
    dates: BTreeMap<i64, usize>,
    /// Positions that are none: no fix, dead reckoning, typed in by hand.
    left_out: usize,
    has_separation: bool,
    has_checksums: bool,
}

/// Whether a text is such a log: one of its first lines has a sentence of a receiver in it.
pub(in crate::io) fn is_nmea(text: &str) -> bool {
    text.lines()
        .take(20)
        .any(|line| address(line.trim_end()).is_some())
}

impl Log {
    /// Reads all sentences, whatever a logger wrote before them in their lines. A first or last line that is cut is left
    /// out. Where no sentence has a checksum, their numbers of fields tell those that are whole; a last line without an
    /// end may be cut within a number.
    pub(super) fn read(path: &str, text: &str) -> Result<Self, Error> {
        let has_checksums = text.contains('*');
        let ended = || text.rsplit_once('\n').map_or(text, |(whole, _)| whole);
        let kept = if has_checksums { text } else { ended() };
        let split = |line| {
            if has_checksums {
                fields(line)
            } else {
                unchecked_fields(line)
            }
        };
        let lines = kept.lines().map(str::trim).enumerate();
        let lines: Vec<(usize, &str)> = lines.filter(|(_, line)| !line.is_empty()).collect();
        let ends = [lines.first().map(|l| l.0), lines.last().map(|l| l.0)];
        let mut log = Self {
            has_checksums,
            ..Self::default()
        };
        for (i, line) in lines {
            let said = split(line).and_then(|fields| log.sentence(i + 1, &fields));
            match said {
                Err(message) if !ends.contains(&Some(i)) => {
                    let found: String = line.chars().take(60).collect();
                    let advice = "remove the line, if no more than it is damaged";
                    return Err(
                        Error::contents(path, i + 1, format!("{message}: {found}")).or_hint(advice)
                    );
                }
                _ => {}
            }
        }
        Ok(log)
    }

    fn sentence(&mut self, line: usize, fields: &[&str]) -> Result<(), &'static str> {
        let field = |i: usize| fields.get(i).copied().unwrap_or_default();
        let number = |i: usize| field(i).parse::<f64>().ok();
        let kind = field(0).get(2..).unwrap_or_default();
        // proprietary ones begin with P
        let epoch = match kind {
            "ZDA" | "RMC" | "GGA" | "GST" if !field(1).is_empty() && !field(0).starts_with('P') => {
                let time_s = time_of_day(field(1)).ok_or("not a time of day hhmmss.ss")?;
                self.at(line, time_s)
            }
            // without a time: of the sentences before it
            "VTG" => match self.epochs.last_mut() {
                Some(epoch) => epoch,
                None => return Ok(()),
            },
            _ => return Ok(()),
        };
        let day_s = DAY_S * epoch.day;
        match kind {
            "GGA" if epoch.position.is_none() => return self.position(line, fields),
            "GST" => {
                epoch.sigma = number(6)
                    .zip(number(7))
                    .zip(number(8))
                    .map(|((n, e), d)| DVec3::new(n, e, d))
            }
            "VTG" if epoch.velocity.is_none() => {
                let knots = number(5).or(number(7).map(|km_h| km_h / 1.852));
                epoch.velocity = knots.map(|knots| horizontal(knots, number(1)));
            }
            "RMC" => {
                if field(2) == "A" {
                    epoch.velocity = number(7).map(|knots| horizontal(knots, number(8)));
                }
                self.date(date_of_rmc(field(9)).map(|s| s - day_s));
            }
            "ZDA" => {
                let date = number(4).zip(number(3)).zip(number(2));
                let date = date.and_then(|((y, m), d)| midnight(y as i32, m as u32, d as u32));
                self.date(date.map(|s| s - day_s));
            }
            _ => {}
        }
        Ok(())
    }

    fn date(&mut self, midnight_s: Option<f64>) {
        if let Some(midnight_s) = midnight_s {
            *self.dates.entry(midnight_s as i64).or_default() += 1;
        }
    }

    /// The epoch of a time of day: the last one, or a new one, after midnight a day later.
    fn at(&mut self, line: usize, time_s: f64) -> &mut Epoch {
        let last = self.epochs.last().map(|e| (e.time_s, e.day));
        if last.is_none_or(|(last_s, _)| last_s != time_s) {
            let day = last.map_or(0.0, |(last_s, day)| {
                day + f64::from(last_s - time_s > DAY_S / 2.0)
            });
            self.epochs.push(Epoch {
                line,
                time_s,
                day,
                ..Epoch::default()
            });
        }
        let newest = self.epochs.len() - 1;
        &mut self.epochs[newest]
    }

    /// `GGA`: the position of the newest epoch.
    fn position(&mut self, line: usize, fields: &[&str]) -> Result<(), &'static str> {
        let field = |i: usize| fields.get(i).copied().unwrap_or_default();
        let number = |i: usize| field(i).parse::<f64>().ok();
        // 0: none, 6: dead reckoning, 7: typed in by hand
        if matches!(field(6), "" | "0" | "6" | "7") {
            self.left_out += 1;
            return Ok(());
        }
        let lat = angle(field(2), field(3), 90.0).ok_or("not a latitude ddmm.mmmm,N or S")?;
        let lon = angle(field(4), field(5), 180.0).ok_or("not a longitude dddmm.mmmm,E or W")?;
        let altitude = number(9).ok_or("not an altitude")?;
        self.has_separation |= number(11).is_some();
        let newest = self
            .epochs
            .last_mut()
            .ok_or("not a time of day hhmmss.ss")?;
        newest.line = line;
        newest.hdop = number(8).filter(|hdop| *hdop > 0.0);
        newest.position = Some([lat, lon, altitude + number(11).unwrap_or(0.0)]);
        Ok(())
    }
}

/// The fixes of a log, each with its line, and what is to be said of it. `unsaid` are the standard deviations where `GST` states none;
/// `clock_s` is when the IMU begins and ends.
///
/// # Errors
/// A damaged sentence, no position at all, standard deviations that nobody states.
pub(super) fn fixes(
    path: &str,
    text: &str,
    unsaid: Option<&FixSigma>,
    clock_s: Option<(f64, f64)>,
) -> Result<Fixes, Error> {
    let log = Log::read(path, text)?;
    let clock = log.clock(clock_s);
    let hdop = log.middle_hdop();
    let mut fixes = Vec::new();
    for epoch in &log.epochs {
        let Some([lat, lon, h]) = epoch.position else {
            continue;
        };
        // a receiver's deviations as given are those of its middle HDOP
        let worse = epoch
            .hdop
            .zip(hdop)
            .map_or(1.0, |(epoch_hdop, middle)| epoch_hdop / middle);
        let given = unsaid.map(|s| DVec3::from(s.pos_m) * worse);
        let stated = epoch.sigma.filter(|sigma| sigma.min_element() > 0.0);
        let Some(pos_sigma_n) = stated.or(given) else {
            let message =
                "a fix without standard deviations: no GST sentence of its time states them";
            return Err(Error::contents(path, epoch.line, message).or(help::FIX_SIGMA));
        };
        let velocity =
            epoch
                .velocity
                .zip(unsaid.and_then(|s| s.vel_m_s))
                .map(|((v, course), [n, e, _])| {
                    let horizontal_sigma = DVec2::new(n.hypot(course), e.hypot(course));
                    GnssVelocity {
                        horizontal: v,
                        horizontal_sigma,
                        down: None,
                    }
                });
        let t_s = clock.origin_s + DAY_S * epoch.day + epoch.time_s;
        fixes.push((
            epoch.line as u64,
            GnssFix {
                t_s,
                lat,
                lon,
                h,
                pos_sigma_n,
                velocity,
            },
        ));
    }
    if fixes.is_empty() {
        let message = "NMEA sentences without a position: no GGA with a fix";
        return Err(Error::contents(path, 1_u64, message)
            .or_hint("let the receiver write GGA, RMC and GST"));
    }
    let remarks = log.remarks(&fixes, unsaid, &clock);
    Ok((fixes, remarks))
}

impl Log {
    fn middle_hdop(&self) -> Option<f64> {
        let mut all: Vec<f64> = self.epochs.iter().filter_map(|e| e.hdop).collect();
        all.sort_by(f64::total_cmp);
        all.get(all.len() / 2).copied()
    }

    fn remarks(
        &self,
        fixes: &[(u64, GnssFix)],
        unsaid: Option<&FixSigma>,
        clock: &Clock,
    ) -> Vec<Note> {
        let moving = fixes
            .iter()
            .filter(|(_, fix)| fix.velocity.is_some())
            .count();
        let count = fixes.len();
        let mut remarks = vec![remark(format!(
            "NMEA sentences: {count} fixes, {moving} with a horizontal velocity, {} left out, times are {}",
            self.left_out, clock.words
        ))];
        let is_unsaid = |e: &Epoch| e.position.is_some() && e.sigma.is_none();
        if self.epochs.iter().any(is_unsaid) {
            remarks.push(remark(
                "standard deviations without GST as given, in proportion to HDOP",
            ));
        }
        let is_unused = moving == 0 && self.epochs.iter().any(|e| e.velocity.is_some());
        let doubts = [
            (
                clock.is_rolled,
                "the dates are 1024 weeks or more before the IMU's: a week counter has rolled over",
            ),
            (
                !self.has_checksums,
                "no sentence has a checksum: damaged digits go unseen",
            ),
            (
                is_unused && unsaid.is_none_or(|s| s.vel_m_s.is_none()),
                "speed and course are not used without standard deviations: --gnss-sigma 2,2,4:0.1",
            ),
            (
                !self.has_separation,
                "GGA states no geoid separation: heights are above the sea, up to 100 m off",
            ),
        ];
        remarks.extend(
            doubts
                .into_iter()
                .filter(|(is, _)| *is)
                .map(|(_, text)| doubt(text)),
        );
        remarks
    }
}

/// What a receiver is off that counts GPS weeks in ten bits (s).
const ROLLOVER_S: f64 = 1024.0 * WEEK_S;
/// The clock of a log.
#[derive(Debug, Default)]
struct Clock {
    /// What is added to seconds of the first day (s).
    origin_s: f64,
    /// Times of the fixes then.
    words: String,
    /// Whether the receiver's week counter has rolled over.
    is_rolled: bool,
}

impl Log {
    /// Unix time where the IMU runs in it from one time to the other, else seconds of the first day, else GPS time. A receiver whose week
    /// counter has rolled over is known by dates that are the IMU's after 1024 weeks, or twice that.
    fn clock(&self, imu_s: Option<(f64, f64)>) -> Clock {
        let time_of_epoch = |e: &Epoch| DAY_S * e.day + e.time_s;
        let [first, last] = [self.epochs.first(), self.epochs.last()].map(|e| e.map(time_of_epoch));
        let day = Clock {
            words: "seconds of the day (UTC)".to_owned(),
            ..Clock::default()
        };
        // before a receiver has found the time, it states any date
        let midnight = self.dates.iter().max_by_key(|(_, count)| **count);
        let (Some((midnight_s, _)), Some(first), Some(last), Some(imu)) =
            (midnight, first, last, imu_s)
        else {
            return day;
        };
        let is_of_day = imu.0 <= last && first <= imu.1;
        for (n, is_rolled) in [(0.0, false), (1.0, true), (2.0, true)] {
            let midnight_s = *midnight_s as f64 + n * ROLLOVER_S;
            let found = rtklib::clock((midnight_s + first, midnight_s + last), imu_s);
            match found {
                Some(clock) if clock.origin_s == 0.0 || !is_of_day && !is_rolled => {
                    return Clock {
                        origin_s: midnight_s - clock.origin_s,
                        words: clock.name,
                        is_rolled,
                    };
                }
                _ => {}
            }
        }
        day
    }
}

/// A knot (m/s).
const KNOT: f64 = 1852.0 / 3600.0;

/// Fields of a sentence with its address, at the least (NMEA 0183, version 2).
const LEAST_FIELDS: [(&str, usize); 5] =
    [("GGA", 15), ("RMC", 12), ("VTG", 9), ("GST", 9), ("ZDA", 7)];

/// What stands between `$` and the end of a line; before it, a logger may have written when it came.
fn body(line: &str) -> Result<&str, &'static str> {
    line.find(['$', '!'])
        .map(|start| &line[start + 1..])
        .ok_or("not a sentence: it has no $")
}

/// The address of the sentence in a line, such as `GPGGA`.
fn address(line: &str) -> Option<&str> {
    let address = body(line).ok()?.split(',').next()?;
    (address.len() == 5 && address.bytes().all(|b| b.is_ascii_uppercase())).then_some(address)
}

/// The fields of a sentence in a log without checksums: whole by its number of fields.
fn unchecked_fields(line: &str) -> Result<Vec<&str>, &'static str> {
    let body = body(line)?;
    if body.contains(['$', '!']) {
        return Err("a sentence within a sentence");
    }
    let fields: Vec<&str> = body.split(',').collect();
    let is_cut = |(kind, least): &(&str, usize)| fields[0].ends_with(kind) && fields.len() < *least;
    if LEAST_FIELDS.iter().any(is_cut) {
        Err("a sentence that is cut")
    } else {
        Ok(fields)
    }
}

/// The fields of a sentence whose checksum is right: what is between `$` and `*`, a XOR of its bytes.
fn fields(line: &str) -> Result<Vec<&str>, &'static str> {
    let body = body(line)?;
    let (body, sum) = body
        .rsplit_once('*')
        .ok_or("a sentence without its checksum")?;
    let sum = u8::from_str_radix(sum, 16).map_err(|_| "a sentence without its checksum")?;
    let right = sum == body.bytes().fold(0, |all, byte| all ^ byte);
    if right {
        Ok(body.split(',').collect())
    } else {
        Err("a sentence whose checksum is wrong")
    }
}

/// `hhmmss.ss` (s of the day).
fn time_of_day(text: &str) -> Option<f64> {
    let two = |start: usize| {
        text.get(start..start + 2)?
            .parse::<u8>()
            .ok()
            .map(f64::from)
    };
    let seconds: f64 = text.get(4..)?.parse().ok()?;
    let (hours, minutes) = (two(0)?, two(2)?);
    (hours < 24.0 && minutes < 60.0 && (0.0..61.0).contains(&seconds))
        .then_some(3600.0 * hours + 60.0 * minutes + seconds)
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

/// Midnight of a date (Unix s).
fn midnight(year: i32, month: u32, day: u32) -> Option<f64> {
    let date = NaiveDate::from_ymd_opt(year, month, day)?;
    Some(date.and_hms_opt(0, 0, 0)?.and_utc().timestamp() as f64)
}

/// `ddmmyy`; years from 80 on are of the last century, as receivers count GPS.
fn date_of_rmc(text: &str) -> Option<f64> {
    let two = |start: usize| text.get(start..start + 2)?.parse::<u8>().ok();
    let year = i32::from(two(4)?);
    midnight(
        year + if year < 80 { 2000 } else { 1900 },
        two(2)?.into(),
        two(0)?.into(),
    )
}

/// Speed and course as north and east; without a course, as receivers have none at rest, nothing but as slow as that.
fn horizontal(knots: f64, course_deg: Option<f64>) -> (DVec2, f64) {
    let speed = knots * KNOT;
    course_deg.map_or((DVec2::ZERO, speed), |course| {
        (speed * DVec2::from_angle(course * DEG), 0.0)
    })
}

#[cfg(test)]
mod tests;
