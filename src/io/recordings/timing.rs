//! Sample rate, unit of time, gaps and duplicates, from the time column or the packet counter.

use super::{FileReport, Gaps, ReadOptions, too_short};
use crate::io::table::{Column, InputTable, TICKS};
use crate::io::{Failure, Place, help};
use crate::report::six_digits;

/// When the samples were taken.
#[derive(Default)]
pub(super) struct Timing {
    pub(super) rate_hz: f64,
    /// First samples of the stretches after a gap, if the file is to be split.
    pub(super) breaks: Vec<usize>,
    /// Samples before which others are missing, and how many, if they are to be kept apart.
    pub(super) holes: Vec<(usize, usize)>,
}

/// Finds the rate and checks the steps; frees the time column.
pub(super) fn timing(
    raw: &mut InputTable,
    options: &ReadOptions,
    report: &mut FileReport,
) -> Result<Timing, Failure> {
    let [time, counter] = ["t_s", "counter"].map(|clock| raw.take(clock));
    let wrong_rate = |message: String| {
        Err(Failure::contents(&raw.path, Place::Within, message).or_option(help::WRONG_RATE))
    };
    if let Some(rate_hz) = options.rate_hz.filter(|r| !(r.is_finite() && *r > 0.0)) {
        return wrong_rate(format!("{rate_hz} Hz is not a sample rate"));
    }
    let known = options.rate_hz.map(|rate_hz| (rate_hz, "given"));
    let is_rate_known = known.or(raw.rate_hz).is_some();
    let time = time.filter(|t| !(is_rate_known && t.quantity.stems == TICKS));
    let clock = match (time, known.or(raw.rate_hz)) {
        (Some(time), _) => {
            let mut clock = SampleClock::new(time, options.gaps, "time column".to_owned());
            if clock.unit_s.is_nan() {
                let (unit_s, unit) = unit_of_step(clock.step);
                let text = format!("column \"{}\" taken as {unit}", clock.name);
                let is_told = !clock.steps.is_empty();
                report.assumptions.extend(is_told.then_some(text));
                clock.unit_s = unit_s;
            }
            clock.start_s *= clock.unit_s;
            clock
        }
        (None, Some((rate_hz, source))) => {
            let stated = raw.rate_hz.map(|(stated, of)| (six_digits(stated), of));
            let is_other = |(stated, _): &(f64, _)| (stated / rate_hz - 1.0).abs() > DISAGREEING;
            if let Some((stated, of)) = stated.filter(is_other) {
                let message = format!("the {of} says {stated} Hz, but {rate_hz} Hz is given");
                return wrong_rate(message);
            }
            let Some(mut counter) = counter else {
                report.rate_from = source.into();
                return Ok(Timing {
                    rate_hz,
                    ..Timing::default()
                });
            };
            let (mut last, mut turned) = (0.0, 0.0);
            for value in &mut counter.values {
                turned += 65_536.0 * f64::from(*value - last < -32_768.0);
                last = *value;
                *value += turned;
            }
            let clock =
                SampleClock::new(counter, options.gaps, format!("{source}, packet counter"));
            // The counter tells what was lost, not the rate: with a skip factor it counts by more than one.
            let unit_s = 1.0 / (rate_hz * clock.median.max(1.0));
            let start_s = 0.0;
            SampleClock {
                unit_s,
                start_s,
                ..clock
            }
        }
        (None, None) => {
            let message = "no time column, and no rate given";
            return Err(Failure::contents(&raw.path, Place::Within, message)
                .or_option(("rate-hz", "give the rate with --rate-hz")));
        }
    };
    clock.check(raw, options, report)
}

/// A rate that is given may differ from the clock's by so much without a word: it was rounded.
const ROUNDED: f64 = 1e-3;

/// A rate that differs by more than this is another.
const DISAGREEING: f64 = 0.01;

/// Share of gaps, and of samples lost in them, up to which gaps are those of lost samples: coarse stamps jump more often.
const MOST_LOST: f64 = 0.1;

/// The limit where stamps stray from even ones, which coarse stamps do not.
const MOST_STRAYED: f64 = 0.4;

/// Samples of a stretch from which on it is a recording.
const STRETCH: usize = 64;

/// Time of each sample.
struct SampleClock {
    name: String,
    source: String,
    /// Time of the first sample (s).
    start_s: f64,
    /// Times since then, in units, and their steps.
    since: Vec<f64>,
    steps: Vec<f64>,
    unit_s: f64,
    median: f64,
    /// Step of the samples: gaps do not change the median. Where the stamps are late (coarse, in bursts) and no sample is
    /// lost, no single step is that of the samples, but the span is theirs.
    step: f64,
    /// True if the irregular steps are gaps that lost samples leave; late samples are followed by short steps.
    is_lossy: bool,
    /// Share of samples lost up to which they are left out.
    most_lost: f64,
}

impl SampleClock {
    fn new(column: Column, gaps: Gaps, source: String) -> Self {
        let mut since = column.values;
        let first = since.first().copied().unwrap_or(0.0);
        since.iter_mut().for_each(|value| *value -= first);
        let steps: Vec<f64> = since.windows(2).map(|w| w[1] - w[0]).collect();
        let median = median_step(&since);
        let long = steps.iter().filter(|s| **s > 1.5 * median).count();
        let even = since.last().unwrap_or(&0.0) / steps.len().max(1) as f64;
        let mut strays = (0..).zip(&since).map(|(k, s)| s - f64::from(k) * even);
        // samples that come in bursts have short steps
        let is_lost = even < 4.0 * median && strays.any(|s| s.abs() > 4.0 * median);
        let most_lost = if is_lost { MOST_STRAYED } else { MOST_LOST };
        let is_lossy = long > 0
            && (long as f64) < most_lost * since.len() as f64
            && !steps.iter().any(|s| *s < 0.5 * median);
        let step = match gaps {
            Gaps::Ignore if !is_lossy => even,
            _ => median,
        };
        Self {
            name: column.name,
            source,
            start_s: first,
            since,
            steps,
            unit_s: column.factor.unwrap_or(f64::NAN),
            median,
            step,
            is_lossy,
            most_lost,
        }
    }

    fn time_of(&self, sample: usize) -> f64 {
        // Nanoseconds are enough to tell one sample from the next.
        ((self.start_s + self.since[sample] * self.unit_s) * 1e9).round() / 1e9
    }

    fn rate_hz(&self, step: f64) -> f64 {
        rounded(1.0 / (step * self.unit_s))
    }

    fn check(
        self,
        raw: &InputTable,
        options: &ReadOptions,
        report: &mut FileReport,
    ) -> Result<Timing, Failure> {
        let refused = |message: String| Failure::contents(&raw.path, Place::Within, message);
        let step_at = |i: usize| (raw.line(i + 1), self.time_of(i), self.time_of(i + 1));
        if let Some(i) = self.steps.iter().position(|s| *s < 0.0) {
            let (line, from, to) = step_at(i);
            let message = format!("time goes back from {from} s to {to} s");
            return Err(Failure::contents(&raw.path, line, message)
                .or_hint("remove repeated rows, sort by time, or split the file where the clock was set back"));
        }
        let Some(end) = self.since.last().filter(|_| !self.steps.is_empty()) else {
            return Err(too_short(&raw.path, self.since.len(), 2));
        };
        // Coarse stamps: half of the rows or more have that of the row before.
        let stands_still = self.step <= 0.0;
        if stands_still && (options.gaps != Gaps::Ignore || *end <= 0.0) {
            let name = &self.name;
            let error = refused(format!(
                "column \"{name}\" does not advance: its median step is 0"
            ));
            let ignore = "take the samples as evenly spaced: --gaps ignore";
            return Err(match *end > 0.0 {
                true => error.or_option(("gaps", ignore)),
                false => error,
            });
        }
        let is_irregular = |s: f64| s > 1.5 * self.median || s < 0.5 * self.median;
        let mut breaks: Vec<usize> = (1..self.since.len())
            .filter(|i| is_irregular(self.steps[i - 1]))
            .collect();
        let count = breaks.len();
        let is_kept = options.gaps == Gaps::Keep;
        let holes = is_kept.then(|| self.holes(&breaks)).flatten();
        let is_refused = match options.gaps {
            Gaps::Refuse => true,
            Gaps::Keep => holes.is_none(),
            Gaps::Split | Gaps::Ignore => false,
        };
        if let (true, Some(first)) = (is_refused, breaks.first()) {
            let (line, from, to) = step_at(first - 1);
            let what = match self.steps[first - 1] > self.median {
                true => format!("gap in time from {from} s to {to} s"),
                false => format!("duplicate in time: {from} s to {to} s"),
            };
            let more = match count {
                1 => String::new(),
                n => format!(" ({n} such steps in all)"),
            };
            let step = rounded(self.median * self.unit_s);
            let message = format!("{what}, the median step is {step} s{more}");
            let refusal = Failure::contents(&raw.path, line, message);
            let ends = [0].into_iter().chain(breaks.iter().copied());
            let after = breaks.iter().copied().chain([self.since.len()]);
            let longest = ends.zip(after).map(|(from, to)| to - from).max();
            let is_lost = self.most_lost == MOST_STRAYED;
            return Err(match longest.is_some_and(|n| n >= STRETCH) {
                _ if !is_lost => refusal
                    .or_option(help::GAPS)
                    .or_hint_without(help::GAPS_ELSEWHERE),
                true => refusal
                    .or_option(help::GAPS_LOST)
                    .or_hint_without(help::GAPS_LOST_ELSEWHERE),
                false if self.is_lossy => refusal
                    .or_option(help::GAPS_KEEP)
                    .or_hint_without(help::GAPS_LOST_ELSEWHERE),
                false => refusal.or_hint("record again: too many samples are lost"),
            });
        }
        if let Some(means) = self.drift().filter(|_| !stands_still) {
            let [first, last] = means.map(|step| six_digits(self.rate_hz(step)));
            let message = format!(
                "the rate changes from {first} Hz in the first tenth to {last} Hz in the last"
            );
            return Err(refused(message).or_hint("split the file where the rate changes"));
        }
        let lost: usize = holes.iter().flatten().map(|(_, lost)| lost).sum();
        // The whole span averages the jitter.
        let found_hz = self.rate_hz(match holes.is_none() && count > 0 && !stands_still {
            true => self.step,
            false => end / (self.steps.len() + lost) as f64,
        });
        let rate_hz = options.rate_hz.unwrap_or(found_hz);
        let found = six_digits(found_hz);
        let apart = (found_hz / rate_hz - 1.0).abs();
        if options.gaps != Gaps::Ignore && apart > DISAGREEING {
            let message = format!("the time column runs at {found} Hz, but {rate_hz} Hz is given");
            return Err(refused(message).or_option(help::WRONG_RATE));
        }
        report.rate_from = self.source;
        if apart > ROUNDED {
            report.rate_from = format!("given; the {} has {found} Hz", report.rate_from);
            report.warn(format!(
                "{rate_hz} Hz as given, although the file has {found} Hz"
            ));
        }
        if !USUAL_RATES_HZ.contains(&rate_hz) {
            let (rate_hz, name) = (six_digits(rate_hz), &self.name);
            report.warn(format!(
                "{rate_hz} Hz is an unusual IMU rate: is the unit of \"{name}\" right?"
            ));
        }
        if let Some(first) = breaks.first().map(|first| raw.line(*first)) {
            let share = 100.0 * lost as f64 / (self.since.len() + lost) as f64;
            report.warn(match options.gaps {
                Gaps::Ignore => {
                    format!("gaps or duplicates in time ignored: {count}, the first in line {first}")
                }
                Gaps::Keep => format!(
                    "{lost} samples ({share:.2} %) are missing in {count} gaps, the first before line {first}"
                ),
                Gaps::Refuse | Gaps::Split => format!(
                    "split at gaps or duplicates in time: {count}, the first in line {first}"
                ),
            });
        }
        breaks.retain(|_| options.gaps == Gaps::Split);
        Ok(Timing {
            rate_hz,
            breaks,
            holes: holes.unwrap_or_default(),
        })
    }

    /// The samples after which time went on for longer than to the next one, and how many are missing before them; none where they
    /// are a tenth or more, or time stands still somewhere.
    fn holes(&self, breaks: &[usize]) -> Option<Vec<(usize, usize)>> {
        let step = |i: &usize| self.steps[i - 1];
        if breaks.iter().any(|i| step(i) < self.median) {
            return None;
        }
        // Coarse stamps round single steps; their mean is that of the samples.
        let regular = self.since.last()? - breaks.iter().map(step).sum::<f64>();
        let regular = regular / (self.steps.len() - breaks.len()) as f64;
        let lost = |i: &usize| (*i, ((step(i) / regular).round() as usize).max(2) - 1);
        let holes: Vec<(usize, usize)> = breaks.iter().map(lost).collect();
        let lost: usize = holes.iter().map(|(_, lost)| lost).sum();
        ((lost as f64) < self.most_lost * (lost + self.since.len()) as f64).then_some(holes)
    }

    /// Steps of the first and the last tenth, where they differ by more than 1 % and what single stamps may be off by.
    fn drift(&self) -> Option<[f64; 2]> {
        /// Steps of a tenth from which on its mean tells.
        const LEAST: usize = 10;
        let tenth = Some(self.since.len() / 10).filter(|tenth| *tenth >= LEAST)?;
        let is_regular = |s: &&f64| !(self.is_lossy && **s > 1.5 * self.median);
        let ends = [
            &self.steps[..tenth],
            &self.steps[self.steps.len() - tenth..],
        ];
        let ends = ends.map(|part| part.iter().filter(is_regular).copied());
        let longest = ends.iter().cloned().flatten().fold(0.0, f64::max);
        let means = ends.map(|part| part.clone().sum::<f64>() / part.count() as f64);
        // A stamp at either end of a tenth may be late by as much as the longest step.
        let allowed = DISAGREEING + 2.0 * longest / (means[0].min(means[1]) * tenth as f64);
        ((means[1] / means[0]).ln().abs() > allowed).then_some(means)
    }
}

/// Six significant digits where the value is that within 1e-7 (stamps are rounded), else as it is.
fn rounded(value: f64) -> f64 {
    let short = six_digits(value);
    if (short / value - 1.0).abs() < 1e-7 {
        short
    } else {
        value
    }
}

pub(crate) fn median_step(times: &[f64]) -> f64 {
    let mut steps: Vec<f64> = times.windows(2).map(|w| w[1] - w[0]).collect();
    if steps.is_empty() {
        return 0.0;
    }
    let middle = steps.len() / 2;
    *steps.select_nth_unstable_by(middle, f64::total_cmp).1
}

/// Rates beyond these (Hz) make a warning.
pub(crate) const USUAL_RATES_HZ: std::ops::RangeInclusive<f64> = 0.5..=20_000.0;

/// The units of time and their length (s).
pub(crate) const UNITS: [(f64, &str); 4] = [(1.0, "s"), (1e-3, "ms"), (1e-6, "µs"), (1e-9, "ns")];

/// The unit in which a step is that of 10 Hz … 10 kHz: the four ranges do not overlap.
pub(crate) fn unit_of_step(step: f64) -> (f64, &'static str) {
    UNITS[match step {
        s if s >= 1e5 => 3,
        s if s >= 100.0 => 2,
        s if s > 0.1 => 1,
        _ => 0,
    }]
}
