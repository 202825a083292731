//! What stands in a sentence.

use crate::units::DEG;
use chrono::NaiveDate;
use glam::DVec2;

/// A knot (m/s).
pub(super) const KNOT: f64 = 1852.0 / 3600.0;

/// The fields of a sentence whose checksum is right: what is between `$` and `*`, a XOR of its bytes.
pub(super) fn fields(line: &str) -> Result<Vec<&str>, &'static str> {
    let body = line.strip_prefix(['$', '!']).ok_or("not a sentence: it does not begin with $")?;
    let (body, sum) = body.rsplit_once('*').ok_or("a sentence without its checksum")?;
    let sum = u8::from_str_radix(sum, 16).map_err(|_| "a sentence without its checksum")?;
    let right = sum == body.bytes().fold(0, |all, byte| all ^ byte);
    if right { Ok(body.split(',').collect()) } else { Err("a sentence whose checksum is wrong") }
}

/// `hhmmss.ss` (s of the day).
pub(super) fn time_of_day(text: &str) -> Option<f64> {
    let two = |at: usize| text.get(at..at + 2)?.parse::<u8>().ok().map(f64::from);
    let seconds: f64 = text.get(4..)?.parse().ok()?;
    let (hours, minutes) = (two(0)?, two(2)?);
    (hours < 24.0 && minutes < 60.0 && (0.0..61.0).contains(&seconds))
        .then_some(3600.0 * hours + 60.0 * minutes + seconds)
}

/// `ddmm.mmmm` or `dddmm.mmmm` and its hemisphere (rad).
pub(super) fn angle(text: &str, hemisphere: &str, limit_deg: f64) -> Option<f64> {
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
pub(super) fn midnight(year: i32, month: u32, day: u32) -> Option<f64> {
    let date = NaiveDate::from_ymd_opt(year, month, day)?;
    Some(date.and_hms_opt(0, 0, 0)?.and_utc().timestamp() as f64)
}

/// `ddmmyy`; years from 80 on are of the last century, as receivers count GPS.
pub(super) fn date_of_rmc(text: &str) -> Option<f64> {
    let two = |at: usize| text.get(at..at + 2)?.parse::<u8>().ok();
    let year = i32::from(two(4)?);
    midnight(year + if year < 80 { 2000 } else { 1900 }, two(2)?.into(), two(0)?.into())
}

/// Speed and course as north and east; without a course, as receivers have none at rest, nothing but as slow as that.
pub(super) fn horizontal(knots: f64, course_deg: Option<f64>) -> (DVec2, f64) {
    let speed = knots * KNOT;
    course_deg.map_or((DVec2::ZERO, speed), |course| (speed * DVec2::from_angle(course * DEG), 0.0))
}
