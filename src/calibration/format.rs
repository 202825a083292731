//! Numbers for people.

/// A part of a whole, in per cent: `12 %`, `3.4 %`, `0.05 %`.
pub fn percent(part: f64) -> String {
    match 100.0 * part {
        p if p >= 9.5 => format!("{p:.0} %"),
        p if p >= 0.95 => format!("{p:.1} %"),
        p => format!("{p:.2} %"),
    }
}

/// A time for people: seconds, minutes or hours.
pub fn duration(seconds: f64) -> String {
    match seconds {
        s if s < 120.0 => format!("{} s", three_digits(s)),
        s if s < 7200.0 => format!("{} min", three_digits(s / 60.0)),
        s => format!("{} h", three_digits(s / 3600.0)),
    }
}

/// Three digits, without zeros at the end.
fn three_digits(x: f64) -> String {
    if x >= 1e6 || (x > 0.0 && x < 1e-3) {
        return format!("{x:.2e}");
    }
    let decimals = (2 - x.max(1e-3).log10().floor() as i32).clamp(0, 6) as usize;
    let text = format!("{x:.decimals$}");
    if text.contains('.') {
        text.trim_end_matches('0').trim_end_matches('.').to_owned()
    } else {
        text
    }
}
