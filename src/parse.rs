//! Values of flags.

use clap::builder::{PossibleValuesParser, TypedValueParser};
use nav_sim_signal::imu::MAX_RATE_HZ;
use std::fmt::Debug;
use std::str::FromStr;

/// A seed of random numbers.
pub(crate) fn seed(text: &str) -> Result<u64, String> {
    text.parse()
        .map_err(|_| format!("not a whole number from 0 to {}", u64::MAX))
}

/// A finite number ≥ 0.
pub(crate) fn non_negative(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(x) if x.is_finite() && x >= 0.0 => Ok(x),
        _ => Err("not a finite number ≥ 0".into()),
    }
}

/// A sample rate (Hz).
pub(crate) fn rate_hz(text: &str) -> Result<f64, String> {
    match positive(text)? {
        x if x <= MAX_RATE_HZ => Ok(x),
        _ => Err(format!("more than {MAX_RATE_HZ} samples a second")),
    }
}

/// A finite number > 0.
pub(crate) fn positive(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(x) if x.is_finite() && x > 0.0 => Ok(x),
        _ => Err("not a finite number > 0".into()),
    }
}

/// A time (s): `90`, `90s`, `1.5m` or `1.5min`, `2h`.
pub(crate) fn seconds(text: &str) -> Result<f64, String> {
    let text = text.trim();
    let units = [("min", 60.0), ("s", 1.0), ("m", 60.0), ("h", 3600.0)];
    let mut units = units.into_iter();
    let said = units.find_map(|(name, unit_s)| Some((text.strip_suffix(name)?, unit_s)));
    let (number, unit_s) = said.unwrap_or((text, 1.0));
    let expected = |_| "expected a time such as 3000, 50m or 1.5h".to_owned();
    let number = non_negative(number.trim()).map_err(expected)?;
    Ok(number * unit_s)
}

/// Two times (s): `1s:100s`, also without the unit.
pub(crate) fn seconds_range(text: &str) -> Result<(f64, f64), String> {
    let time = |text| seconds(text).ok().filter(|time| *time > 0.0);
    let range = text.split_once(':');
    let range = range.and_then(|(from, to)| time(from).zip(time(to)));
    range.ok_or_else(|| "expected two times, such as 1s:100s or 1min:2h".into())
}

/// Numbers between commas.
pub(crate) fn numbers<const N: usize>(text: &str) -> Option<[f64; N]> {
    let parsed: Option<Vec<f64>> = text
        .split(',')
        .map(|x| x.trim().parse().ok().filter(|x: &f64| x.is_finite()))
        .collect();
    parsed?.try_into().ok()
}

/// `A,B`.
pub(crate) fn pair(text: &str) -> Result<[f64; 2], String> {
    let pair = numbers::<2>(text).filter(|p| p.iter().all(|x| *x >= 0.0));
    pair.ok_or_else(|| "expected two numbers ≥ 0, such as 0.1,0.002".into())
}

/// A member of a closed set by its name; help and completions list the names.
pub(crate) fn one_of<T>(names: &'static [&'static str]) -> impl TypedValueParser<Value = T>
where
    T: FromStr<Err: Debug> + Clone + Send + Sync + 'static,
{
    PossibleValuesParser::new(names).map(|name| name.parse().expect("a name of the list"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_are_understood() {
        let found = ["90", "90s", "1.5m", "2h"].map(|t| seconds(t).unwrap());
        assert_eq!(found, [90.0, 90.0, 90.0, 7200.0]);
        assert!(
            ["", "m", "-1", "1d", "nan"]
                .iter()
                .all(|t| seconds(t).is_err())
        );
    }
}
