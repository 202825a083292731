//! The unit of a time column whose name does not say it.

use super::report::FileReport;
use crate::report::six_digits;

/// Rates beyond these are looked at twice (Hz).
pub(super) const USUAL_RATES_HZ: std::ops::RangeInclusive<f64> = 0.5..=20_000.0;

/// The units of time and their length (s).
pub(super) const UNITS: [(f64, &str); 4] = [(1.0, "s"), (1e-3, "ms"), (1e-6, "µs"), (1e-9, "ns")];

/// Unix time of the years 2000 to 2100 (s): in no two units of a thousand are the numbers of these the same.
const UNIX_S: std::ops::Range<f64> = 9.4e8..4.2e9;

/// The unit in which a step is that of 10 Hz … 10 kHz: the four ranges do not overlap.
pub(in crate::formats) fn unit_of_step(step: f64) -> (f64, &'static str) {
    UNITS[match step {
        s if s >= 1e5 => 3,
        s if s >= 100.0 => 2,
        s if s > 0.1 => 1,
        _ => 0,
    }]
}

/// The unit that is assumed.
pub(super) struct Guess {
    pub(super) unit_s: f64,
    word: &'static str,
    /// Other units in which the step would be that of an IMU too.
    others: Vec<(f64, &'static str)>,
}

impl Guess {
    /// From the step, the first time and a rate that is known otherwise (Hz).
    pub(super) fn new(step: f64, first: f64, known_hz: Option<f64>) -> Self {
        let usual = |(unit_s, _): &(f64, &str)| USUAL_RATES_HZ.contains(&(1.0 / (step * unit_s)));
        let plausible: Vec<(f64, &str)> = UNITS.into_iter().filter(usual).collect();
        if let Some(rate_hz) = known_hz.filter(|_| step > 0.0) {
            // The units are thousands apart: the nearest ratio is the one that is meant.
            let apart = |(unit_s, _): &(f64, &str)| (rate_hz * step * unit_s).ln().abs();
            let nearest = UNITS
                .into_iter()
                .min_by(|a, b| apart(a).total_cmp(&apart(b)));
            let (unit_s, word) = nearest.unwrap_or(UNITS[0]);
            return Self {
                unit_s,
                word,
                others: Vec::new(),
            };
        }
        if let Some(&(unit_s, word)) = plausible
            .iter()
            .find(|(unit_s, _)| UNIX_S.contains(&(first * unit_s)))
        {
            return Self {
                unit_s,
                word,
                others: Vec::new(),
            };
        }
        let (unit_s, word) = unit_of_step(step);
        let others = plausible
            .into_iter()
            .filter(|(_, other)| *other != word)
            .collect();
        Self {
            unit_s,
            word,
            others,
        }
    }

    /// Tells what is assumed, and warns where it may as well be another unit.
    pub(super) fn tell(&self, column: &str, step: f64, report: &mut FileReport) {
        let Self {
            unit_s,
            word,
            others,
        } = self;
        report
            .assumptions
            .push(format!("column \"{column}\" taken as {word}"));
        if !others.is_empty() {
            let rate = |unit_s: &f64, word: &str| {
                format!("{} Hz in {word}", six_digits(1.0 / (step * unit_s)))
            };
            let others: Vec<String> = others
                .iter()
                .map(|(unit_s, word)| rate(unit_s, word))
                .collect();
            report.warn(format!(
                "column \"{column}\" has no unit: taken as {}, but it would be {}; name it t_s, t_ms, t_us or t_ns",
                rate(unit_s, word),
                others.join(", ")
            ));
        }
    }
}
