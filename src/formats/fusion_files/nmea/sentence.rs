//! What stands in a sentence.

use chrono::NaiveDate;
use glam::DVec2;
use nav_sim_signal::units::DEG;

/// A knot (m/s).
pub(super) const KNOT: f64 = 1852.0 / 3600.0;

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
pub(super) fn address(line: &str) -> Option<&str> {
    let address = body(line).ok()?.split(',').next()?;
    (address.len() == 5 && address.bytes().all(|b| b.is_ascii_uppercase())).then_some(address)
}

/// The fields of a sentence in a log without checksums: whole by its number of fields.
pub(super) fn unchecked_fields(line: &str) -> Result<Vec<&str>, &'static str> {
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
pub(super) fn fields(line: &str) -> Result<Vec<&str>, &'static str> {
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
pub(super) fn time_of_day(text: &str) -> Option<f64> {
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
    let two = |start: usize| text.get(start..start + 2)?.parse::<u8>().ok();
    let year = i32::from(two(4)?);
    midnight(
        year + if year < 80 { 2000 } else { 1900 },
        two(2)?.into(),
        two(0)?.into(),
    )
}

/// Speed and course as north and east; without a course, as receivers have none at rest, nothing but as slow as that.
pub(super) fn horizontal(knots: f64, course_deg: Option<f64>) -> (DVec2, f64) {
    let speed = knots * KNOT;
    course_deg.map_or((DVec2::ZERO, speed), |course| {
        (speed * DVec2::from_angle(course * DEG), 0.0)
    })
}
