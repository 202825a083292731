//! NMEA 0183 sentences of a receiver, as it logs them: `GGA` (position), `RMC` or `VTG` (speed and course), `GST`
//! (standard deviations), `RMC` or `ZDA` (date), from any talker. What has one time is one fix.
//!
//! The layout of the sentences is that of the receivers' manuals (Trimble R6/R7/R8, appendix A; u-blox protocol
//! specifications).

mod clock;
mod sentence;

use super::Remark;
use super::fixes::Fixes;
use crate::formats::{Failure as Error, help};
use clock::{Clock, Dates};
use glam::{DVec2, DVec3};
use nav_sim_navigation::gnss::{FixSigma, GnssFix, GnssVelocity};
use sentence::{
    address, angle, date_of_rmc, fields, horizontal, midnight, time_of_day, unchecked_fields,
};

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
    /// Midnights before the first sentence, by the dates that are stated.
    dates: Dates,
    /// Positions that are none: no fix, dead reckoning, typed in by hand.
    left_out: usize,
    has_separation: bool,
    has_checksums: bool,
}

/// Whether a text is such a log: one of its first lines has a sentence of a receiver in it.
pub(in crate::formats) fn is_nmea(text: &str) -> bool {
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
                self.dates.add(date_of_rmc(field(9)).map(|s| s - day_s));
            }
            "ZDA" => {
                let date = number(4).zip(number(3)).zip(number(2));
                let date = date.and_then(|((y, m), d)| midnight(y as i32, m as u32, d as u32));
                self.dates.add(date.map(|s| s - day_s));
            }
            _ => {}
        }
        Ok(())
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
    let remarks = log.remarks(&fixes, unsaid, clock);
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
        clock: Clock,
    ) -> Vec<Remark> {
        let moving = fixes
            .iter()
            .filter(|(_, fix)| fix.velocity.is_some())
            .count();
        let count = fixes.len();
        let mut remarks = vec![Remark::note(format!(
            "NMEA sentences: {count} fixes, {moving} with a horizontal velocity, {} left out, times are {}",
            self.left_out, clock.words
        ))];
        let is_unsaid = |e: &Epoch| e.position.is_some() && e.sigma.is_none();
        if self.epochs.iter().any(is_unsaid) {
            remarks.push(Remark::note(
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
                .map(|(_, text)| Remark::doubt(text)),
        );
        remarks
    }
}

#[cfg(test)]
mod tests;
