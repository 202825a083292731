//! Ranges, ticks and their labels.

use crate::chart::{Axis, Scale};
use crate::number::readable;

/// From values to pixels along one axis.
pub(crate) struct Ruler {
    /// First and last value shown.
    pub(crate) range: (f64, f64),
    pub(crate) is_log: bool,
    /// Pixels of the first and the last value.
    pub(crate) pixels: (f64, f64),
}

impl Ruler {
    pub(crate) fn at(&self, value: f64) -> f64 {
        let along = |v: f64| if self.is_log { v.log10() } else { v };
        let (low, high) = (along(self.range.0), along(self.range.1));
        self.pixels.0 + (along(value) - low) / (high - low) * (self.pixels.1 - self.pixels.0)
    }

    /// The same, no farther than the ends.
    pub(crate) fn within(&self, value: f64) -> f64 {
        self.at(value.clamp(self.range.0, self.range.1))
    }

    /// `log 1e-3 100`, for the script.
    pub(crate) fn data(&self) -> String {
        let word = if self.is_log { "log" } else { "linear" };
        format!("{word} {:e} {:e}", self.range.0, self.range.1)
    }
}

/// Whether a value can be shown on an axis, which may be logarithmic.
pub(crate) fn is_shown(value: f64, is_log: bool) -> bool {
    value.is_finite() && (!is_log || value > 0.0)
}

/// What an axis shows: the values with some air, none without a value.
pub(crate) fn range(
    axis: &Axis,
    values: impl Iterator<Item = f64>,
    air: f64,
) -> Option<(f64, f64)> {
    if let Scale::Names(names) = &axis.scale {
        return Some((-0.5, names.len() as f64 - 0.5));
    }
    let extra = axis.include.into_iter().flat_map(|(low, high)| [low, high]);
    let shown = values
        .chain(extra)
        .filter(|v| is_shown(*v, axis.scale == Scale::Log));
    let (low, high) = extremes(shown)?;
    Some(match axis.scale {
        Scale::Log => {
            let air = if low == high {
                2.0
            } else {
                (high / low).powf(air).max(1.0 + 2.0 * air)
            };
            (low / air, high * air)
        }
        _ if low == high => (
            low - 0.1 * low.abs().max(1.0),
            high + 0.1 * high.abs().max(1.0),
        ),
        _ => (low - air * (high - low), high + air * (high - low)),
    })
}

/// Least and largest.
pub(crate) fn extremes(values: impl Iterator<Item = f64>) -> Option<(f64, f64)> {
    values.fold(None, |range, v| {
        let (low, high) = range.unwrap_or((v, v));
        Some((low.min(v), high.max(v)))
    })
}

/// Places of an axis that have a label, and the labels; `most`: about how many.
pub(crate) fn ticks(axis: &Axis, range: (f64, f64), most: usize) -> Vec<(f64, String)> {
    match &axis.scale {
        Scale::Names(names) => names
            .iter()
            .enumerate()
            .map(|(k, name)| (k as f64, name.clone()))
            .collect(),
        Scale::Log if range.1 / range.0 >= 6.0 => decades(range, most),
        _ => steps(range, most),
    }
}

/// Powers of ten, with their halves and fifths where there are few.
fn decades((low, high): (f64, f64), most: usize) -> Vec<(f64, String)> {
    let exponents = low.log10().floor() as i32..=high.log10().ceil() as i32;
    let spanned = (high / low).log10();
    let factors: &[i32] = if spanned < 1.6 { &[1, 2, 5] } else { &[1] };
    let every = (spanned / most as f64).ceil().max(1.0) as i32;
    let all = exponents
        .filter(|e| e.rem_euclid(every) == 0)
        .flat_map(|e| {
            factors
                .iter()
                .map(move |f| (f64::from(*f) * 10f64.powi(e), *f, e))
        });
    let shown: Vec<_> = all.filter(|(v, ..)| (low..=high).contains(v)).collect();
    let is_plain = shown.iter().all(|(v, ..)| (1e-3..2e4).contains(v));
    shown
        .into_iter()
        .map(|(v, f, e)| (v, if is_plain { plain(v) } else { power(f, e) }))
        .collect()
}

/// Even steps of 1, 2 or 5 times a power of ten.
fn steps((low, high): (f64, f64), most: usize) -> Vec<(f64, String)> {
    let raw = (high - low) / most as f64;
    let exponent = raw.log10().floor();
    let choice = [1.0, 2.0, 5.0, 10.0]
        .into_iter()
        .find(|m| m * 10f64.powf(exponent) >= raw * 0.999);
    let step = choice.unwrap_or(10.0) * 10f64.powf(exponent);
    let (first, last) = (
        (low / step - 1e-9).ceil() as i64,
        (high / step + 1e-9).floor() as i64,
    );
    let largest = low.abs().max(high.abs());
    let label = |v: f64| match largest {
        m if !(1e-4..1e6).contains(&m) => readable(v).replace('-', "−"),
        _ => plain((v / step).round() * step),
    };
    (first..=last)
        .map(|k| k as f64 * step)
        .map(|v| (v, label(v)))
        .collect()
}

/// A number without an exponent.
fn plain(value: f64) -> String {
    let rounded = format!("{value:.6}");
    let short = rounded.trim_end_matches('0').trim_end_matches('.');
    if short == "-0" {
        "0".to_owned()
    } else {
        short.replace('-', "−")
    }
}

/// `10⁻³` or `2·10⁻³`.
fn power(factor: i32, exponent: i32) -> String {
    const DIGITS: [char; 10] = ['⁰', '¹', '²', '³', '⁴', '⁵', '⁶', '⁷', '⁸', '⁹'];
    let raised = |c: char| c.to_digit(10).map_or('⁻', |d| DIGITS[d as usize]);
    let exponent: String = exponent.to_string().chars().map(raised).collect();
    if factor == 1 {
        format!("10{exponent}")
    } else {
        format!("{factor}·10{exponent}")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn labels(axis: &Axis, range: (f64, f64)) -> Vec<String> {
        ticks(axis, range, 8)
            .into_iter()
            .map(|(_, label)| label)
            .collect()
    }

    #[test]
    fn ticks_are_round_numbers() {
        assert_eq!(
            labels(&Axis::linear(""), (0.0, 900.0)),
            ["0", "200", "400", "600", "800"]
        );
        assert_eq!(
            labels(&Axis::linear(""), (-0.021, 0.02)),
            ["−0.02", "−0.01", "0", "0.01", "0.02"]
        );
        assert_eq!(
            labels(&Axis::log(""), (0.4, 12.0)),
            ["0.5", "1", "2", "5", "10"]
        );
        assert_eq!(
            labels(&Axis::log(""), (0.02, 3e3)),
            ["0.1", "1", "10", "100", "1000"]
        );
        assert_eq!(
            labels(&Axis::log(""), (3e-9, 2e-6)),
            ["10⁻⁸", "10⁻⁷", "10⁻⁶"]
        );
        assert_eq!(
            labels(&Axis::log(""), (0.9, 1.3))
                .first()
                .map(String::as_str),
            Some("0.9")
        );
        assert_eq!(
            labels(&Axis::names(vec!["a".into(), "b".into()]), (-0.5, 1.5)),
            ["a", "b"]
        );
    }

    #[test]
    fn many_decades_are_labelled_now_and_then() {
        let shown = ticks(&Axis::log(""), (1e-12, 1e3), 5);
        assert_eq!(
            shown
                .iter()
                .map(|t| t.0.log10().round())
                .collect::<Vec<_>>(),
            [-12., -9., -6., -3., 0., 3.]
        );
    }

    #[test]
    fn ends_of_the_range_are_ends_of_the_axis() {
        let ruler = Ruler {
            range: (1.0, 100.0),
            is_log: true,
            pixels: (200.0, 0.0),
        };
        assert_eq!(
            (ruler.at(1.0), ruler.at(10.0), ruler.at(100.0)),
            (200.0, 100.0, 0.0)
        );
        assert_eq!(ruler.within(1e9), 0.0);
    }

    #[test]
    fn a_range_holds_what_can_be_shown() {
        let values = [f64::NAN, -1.0, 0.0, 1.0, 100.0];
        let (low, high) = range(&Axis::log(""), values.into_iter(), 0.0).unwrap();
        assert_eq!((low, high), (1.0, 100.0));
        assert_eq!(
            range(
                &Axis::linear("").including(-3.0, 5.0),
                values.into_iter(),
                0.0
            ),
            Some((-3.0, 100.0))
        );
        assert_eq!(range(&Axis::linear(""), [f64::NAN].into_iter(), 0.0), None);
        let (low, high) = range(&Axis::linear(""), [2.0].into_iter(), 0.0).unwrap();
        assert!(low < 2.0 && high > 2.0);
    }
}
