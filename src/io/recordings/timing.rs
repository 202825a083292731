//! Sample rate, unit of time, gaps and duplicates, from the time column or the packet counter.

use super::{FileReport, Gaps, ReadOptions, too_short};
use crate::io::table::{Column, Table};
use crate::io::{Failure, Place, help};
use crate::report::six_digits;

/// When the samples were taken.
#[derive(Default)]
pub(super) struct Timing {
    pub(super) rate_hz: f64,
    /// The clock's own rate (Hz).
    found_hz: f64,
    /// First samples of the stretches after a gap, if the file is to be split.
    pub(super) breaks: Vec<usize>,
    /// Samples before which others are missing, and how many, if they are to be kept apart.
    pub(super) holes: Vec<(usize, usize)>,
}

/// Finds the rate and checks the steps; frees the time column.
pub(super) fn timing(
    raw: &mut Table,
    options: &ReadOptions,
    report: &mut FileReport,
) -> Result<Timing, Failure> {
    let wrong_rate = |raw: &Table, message: String| {
        Err(Failure::contents(&raw.path, Place::Within, message).or(help::WRONG_RATE))
    };
    if let Some(rate_hz) = options.rate_hz.filter(|r| !(r.is_finite() && *r > 0.0)) {
        return wrong_rate(raw, format!("{rate_hz} Hz is not a sample rate"));
    }
    let [time, counter, ticks] = ["t_s", "counter", "ticks"].map(|clock| raw.take(clock));
    if let (None, None, Some(given), Some((stated, source))) =
        (&time, &ticks, options.rate_hz, raw.rate_hz)
        && (stated / given - 1.0).abs() > DISAGREEING
    {
        let stated = six_digits(stated);
        let message = format!("the {source} says {stated} Hz, but {given} Hz is given");
        return wrong_rate(raw, message);
    }
    let known = options
        .rate_hz
        .map(|rate_hz| (rate_hz, "given"))
        .or(raw.rate_hz);
    let clock = match (time, counter, ticks, known) {
        (Some(time), ..) => Clock::of_time(time, raw, options, report),
        (None, Some(counter), _, Some((rate_hz, source))) => {
            let mut clock = Clock::counting(counter, 65536.0, 1.0);
            // The counter tells what was lost, not the rate: with a skip factor it counts by more than one.
            clock.unit_s = 1.0 / (rate_hz * median_step(&clock.since).max(1.0));
            Clock {
                source: format!("{source}, packet counter"),
                ..clock
            }
        }
        (None, _, Some(ticks), _) => Clock::counting(ticks, 4_294_967_296.0, 1e-4),
        (None, _, None, Some((rate_hz, source))) => {
            report.rate_from = source.into();
            return Ok(Timing {
                rate_hz,
                ..Timing::default()
            });
        }
        (None, _, None, None) => {
            let message = "no time column, and no rate is given";
            return Err(Failure::contents(&raw.path, Place::Within, message).or(help::RATE));
        }
    };
    let mut timing = clock.check(raw, options)?;
    report.rate_from = clock.source;
    doubt(&timing, &clock.name, raw, options, report);
    if options.gaps != Gaps::Split {
        timing.breaks.clear();
    }
    Ok(timing)
}

/// Says what is doubtful about a clock.
fn doubt(
    timing: &Timing,
    column: &str,
    raw: &Table,
    options: &ReadOptions,
    report: &mut FileReport,
) {
    if let Some(given) = options
        .rate_hz
        .filter(|given| (timing.found_hz / given - 1.0).abs() > ROUNDED)
    {
        let found = six_digits(timing.found_hz);
        report.rate_from = format!("given; the {} has {found} Hz", report.rate_from);
        report.warn(format!(
            "{given} Hz is given, but the file runs at {found} Hz: the rate given is taken"
        ));
    }
    if !USUAL_RATES_HZ.contains(&timing.rate_hz) {
        let rate_hz = six_digits(timing.rate_hz);
        report.warn(format!(
            "{rate_hz} Hz is no usual rate of an IMU: is the unit of \"{column}\" right?"
        ));
    }
    if !timing.breaks.is_empty() {
        let first = raw.line(timing.breaks[0]);
        let n = timing.breaks.len();
        report.warn(match options.gaps {
            Gaps::Ignore => {
                format!("{n} gaps or duplicates in time ignored, the first in line {first}")
            }
            Gaps::Keep => {
                let lost: usize = timing.holes.iter().map(|(_, lost)| lost).sum();
                let there = raw.columns.first().map_or(0, |c| c.values.len());
                let share = 100.0 * lost as f64 / (there + lost) as f64;
                format!(
                    "{lost} samples ({share:.2} %) are missing in {n} gaps, the first before line {first}"
                )
            }
            Gaps::Refuse | Gaps::Split => {
                format!("split at {n} gaps or duplicates in time, the first in line {first}")
            }
        });
    }
}

/// A rate that is given may differ from the clock's by so much without a word: it was rounded.
const ROUNDED: f64 = 1e-3;

/// A rate that differs by more than this is another.
const DISAGREEING: f64 = 0.01;

/// Time of each sample.
struct Clock {
    name: String,
    /// Time of the first sample (s).
    start: f64,
    /// Times since then, in units.
    since: Vec<f64>,
    unit_s: f64,
    source: String,
}

impl Clock {
    fn of_time(
        column: Column,
        raw: &Table,
        options: &ReadOptions,
        report: &mut FileReport,
    ) -> Self {
        let (name, mut since) = (column.name, column.values);
        let first = since.first().copied().unwrap_or(0.0);
        if let Some(week) = week_of(&since, column.factor) {
            report.assumptions.push(format!(
                "column \"{name}\" taken as time of the week, which starts again"
            ));
            unwrap(&mut since, week);
        } else {
            since.iter_mut().for_each(|t| *t -= first);
        }
        let unit_s = match column.factor {
            Some(unit_s) => unit_s,
            None => {
                let step = step_of(&since, options.gaps);
                let known = options.rate_hz.or(raw.rate_hz.map(|(rate_hz, _)| rate_hz));
                let (unit_s, unit) = guess(step, first, known);
                let text = format!("column \"{name}\" taken as {unit}");
                report.assumptions.extend((since.len() > 1).then_some(text));
                unit_s
            }
        };
        Self {
            name,
            start: first * unit_s,
            since,
            unit_s,
            source: "time column".into(),
        }
    }

    /// A counter that starts again at 0 when it reaches `modulus`.
    fn counting(column: Column, modulus: f64, unit_s: f64) -> Self {
        let mut since = column.values;
        unwrap(&mut since, modulus);
        let source = format!("column \"{}\"", column.name);
        Self {
            source,
            name: column.name,
            start: 0.0,
            since,
            unit_s,
        }
    }

    fn time_of(&self, sample: usize) -> f64 {
        // Nanoseconds are enough to tell one sample from the next.
        ((self.start + self.since[sample] * self.unit_s) * 1e9).round() / 1e9
    }

    fn check(&self, raw: &Table, options: &ReadOptions) -> Result<Timing, Failure> {
        let steps = || self.since.windows(2).map(|w| w[1] - w[0]);
        let step_at = |i: usize| (raw.line(i + 1), self.time_of(i), self.time_of(i + 1));
        if let Some(i) = steps().position(|s| s < 0.0) {
            let (line, from, to) = step_at(i);
            let message = format!("time goes back from {from} s to {to} s");
            return Err(Failure::contents(&raw.path, line, message)
                .or_hint("sort the rows by time, or split the file where the clock was set back"));
        }
        let median = median_step(&self.since);
        if self.since.len() < 2 {
            return Err(too_short(&raw.path, self.since.len(), 2));
        }
        let step = step_of(&self.since, options.gaps);
        if step <= 0.0 {
            return Err(self.still(&raw.path));
        }
        let irregular = |s: f64| is_gap(s, median) || s < 0.5 * median;
        let breaks: Vec<usize> = steps()
            .enumerate()
            .filter(|(_, s)| irregular(*s))
            .map(|(i, _)| i + 1)
            .collect();
        let holes = if options.gaps == Gaps::Keep {
            self.holes(&breaks)
        } else {
            None
        };
        let is_refused =
            options.gaps == Gaps::Refuse || options.gaps == Gaps::Keep && holes.is_none();
        if let (true, Some(first)) = (is_refused, breaks.first()) {
            let (line, from, to) = step_at(first - 1);
            let step = rounded(median * self.unit_s);
            let what = if self.since[*first] - self.since[*first - 1] > median {
                format!("gap in time from {from} s to {to} s")
            } else {
                format!("duplicate in time: {from} s to {to} s")
            };
            let more = match breaks.len() {
                0 | 1 => String::new(),
                n => format!(" ({n} such steps in all)"),
            };
            let message = format!("{what}, the median step is {step} s{more}");
            return Err(Failure::contents(&raw.path, line, message)
                .or(help::GAPS)
                .or(help::GAPS_ELSEWHERE));
        }
        let rate = |step: f64| rounded(1.0 / (step * self.unit_s));
        if let Some([first, last]) =
            drift(&self.since).map(|steps| steps.map(|s| six_digits(rate(s))))
        {
            let message = format!(
                "the rate changes from {first} Hz in the first tenth to {last} Hz in the last"
            );
            return Err(
                Failure::contents(&raw.path, Place::Within, message).or_hint(
                    "split the file where the rate changes: a wavelet variance is of one rate",
                ),
            );
        }
        // The whole span averages the jitter.
        let found = rate(match &holes {
            Some(holes) => {
                let lost: usize = holes.iter().map(|(_, lost)| lost).sum();
                mean_step(&self.since) * (self.since.len() - 1) as f64
                    / (self.since.len() - 1 + lost) as f64
            }
            None if breaks.is_empty() => mean_step(&self.since),
            None => step,
        });
        let given = options.rate_hz.unwrap_or(found);
        if options.gaps != Gaps::Ignore && (found / given - 1.0).abs() > DISAGREEING {
            let message = format!(
                "the time column runs at {} Hz, but {given} Hz is given",
                six_digits(found)
            );
            return Err(Failure::contents(&raw.path, Place::Within, message).or(help::WRONG_RATE));
        }
        Ok(Timing {
            rate_hz: given,
            found_hz: found,
            breaks,
            holes: holes.unwrap_or_default(),
        })
    }

    /// The samples after which time went on for longer than to the next one, and how many are missing before them; none where they
    /// are a tenth or more, or time stands still somewhere.
    fn holes(&self, breaks: &[usize]) -> Option<Vec<(usize, usize)>> {
        let median = median_step(&self.since);
        let step = |i: usize| self.since[i] - self.since[i - 1];
        if breaks.iter().any(|i| !is_gap(step(*i), median)) {
            return None;
        }
        // Coarse stamps round single steps; their mean is that of the samples.
        let regular =
            self.since[self.since.len() - 1] - breaks.iter().map(|i| step(*i)).sum::<f64>();
        let regular = regular / (self.since.len() - 1 - breaks.len()) as f64;
        let lost = |i: &usize| (*i, ((step(*i) / regular).round() as usize).max(2) - 1);
        let holes: Vec<(usize, usize)> = breaks.iter().map(lost).collect();
        let lost: usize = holes.iter().map(|(_, lost)| lost).sum();
        ((lost as f64) < MOST_LOST * (lost + self.since.len()) as f64).then_some(holes)
    }

    /// A clock that does not advance, or by coarser steps than those of the samples.
    fn still(&self, path: &str) -> Failure {
        let message = format!(
            "column \"{}\" does not advance: its median step is 0",
            self.name
        );
        let error = Failure::contents(path, Place::Within, message);
        if mean_step(&self.since) > 0.0 {
            error.or(help::GAPS).or(help::GAPS_ELSEWHERE)
        } else {
            error
        }
    }
}

/// From values that start again at 0 when they reach `modulus` to what they rose since the first.
fn unwrap(values: &mut [f64], modulus: f64) {
    let (mut last, mut total) = (values.first().copied().unwrap_or(0.0), 0.0);
    for value in values {
        let step = *value - last;
        last = *value;
        // A fall of more than half the range is the counter starting again.
        total += if step < -0.5 * modulus {
            step + modulus
        } else {
            step
        };
        *value = total;
    }
}

/// The length of a week, if that is where times start again: they lie in one, and fall by more than half of it. No two
/// units have both.
fn week_of(times: &[f64], said: Option<f64>) -> Option<f64> {
    const WEEK_S: f64 = 604_800.0;
    let units = UNITS
        .iter()
        .map(|(unit_s, _)| *unit_s)
        .filter(|unit_s| said.is_none_or(|own| own == *unit_s));
    let mut weeks = units.map(|unit_s| WEEK_S / unit_s);
    weeks.find(|week| {
        times.iter().all(|t| (0.0..=*week).contains(t))
            && times.windows(2).any(|w| w[1] - w[0] < -0.5 * week)
    })
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

/// The step over the whole span; 0 of fewer than two.
fn mean_step(times: &[f64]) -> f64 {
    match times {
        [first, .., last] => (last - first) / (times.len() - 1) as f64,
        _ => 0.0,
    }
}

/// The step of the samples: gaps do not change the median. Where the stamps are late (coarse, in bursts) and no sample is
/// lost, no single step is that of the samples, but the span is theirs.
fn step_of(times: &[f64], gaps: Gaps) -> f64 {
    if gaps == Gaps::Ignore && !has_lost_samples(times) {
        mean_step(times)
    } else {
        median_step(times)
    }
}

fn is_gap(step: f64, median: f64) -> bool {
    step > 1.5 * median
}

/// Share of gaps up to which samples are lost; coarse stamps jump more often, and late ones are followed by short steps.
const MOST_LOST: f64 = 0.1;

/// Whether the irregular steps are gaps that lost samples leave, and the others those of the samples.
fn has_lost_samples(times: &[f64]) -> bool {
    let median = median_step(times);
    let steps = || times.windows(2).map(|w| w[1] - w[0]);
    let gaps = steps().filter(|s| is_gap(*s, median)).count();
    gaps > 0 && (gaps as f64) < MOST_LOST * times.len() as f64 && !steps().any(|s| s < 0.5 * median)
}

/// Steps of the first and the last tenth, where they differ by more than 1 % and what single stamps may be off by.
fn drift(times: &[f64]) -> Option<[f64; 2]> {
    /// Steps of a tenth from which on its mean tells.
    const LEAST: usize = 10;
    let tenth = times.len() / 10;
    if tenth < LEAST {
        return None;
    }
    let (median, lost) = (median_step(times), has_lost_samples(times));
    let ends = [&times[..=tenth], &times[times.len() - tenth - 1..]];
    let regular = |part: &[f64]| -> Vec<f64> {
        part.windows(2)
            .map(|w| w[1] - w[0])
            .filter(|s| !(lost && is_gap(*s, median)))
            .collect()
    };
    let [first, last] = ends.map(regular);
    let mean = |steps: &[f64]| steps.iter().sum::<f64>() / steps.len() as f64;
    let longest = first.iter().chain(&last).copied().fold(0.0, f64::max);
    let means = [mean(&first), mean(&last)];
    // A stamp at either end of a tenth may be late by as much as the longest step.
    let allowed = DISAGREEING + 2.0 * longest / (means[0].min(means[1]) * tenth as f64);
    ((means[1] / means[0]).ln().abs() > allowed).then_some(means)
}

/// Rates beyond these are looked at twice (Hz).
const USUAL_RATES_HZ: std::ops::RangeInclusive<f64> = 0.5..=20_000.0;

/// The units of time and their length (s).
const UNITS: [(f64, &str); 4] = [(1.0, "s"), (1e-3, "ms"), (1e-6, "µs"), (1e-9, "ns")];

/// Unix time of the years 2000 to 2100 (s): in no two units of a thousand are the numbers of these the same.
const UNIX_S: std::ops::Range<f64> = 9.4e8..4.2e9;

/// The unit in which a step is that of 10 Hz … 10 kHz: the four ranges do not overlap.
pub(crate) fn unit_of_step(step: f64) -> (f64, &'static str) {
    UNITS[match step {
        s if s >= 1e5 => 3,
        s if s >= 100.0 => 2,
        s if s > 0.1 => 1,
        _ => 0,
    }]
}

/// The unit that is assumed from the step, the first time and a rate that is known otherwise (Hz).
fn guess(step: f64, first: f64, known_hz: Option<f64>) -> (f64, &'static str) {
    // The units are thousands apart: the nearest ratio is the one that is meant.
    let apart = |unit_s: f64| known_hz.map_or(0.0, |hz| (hz * step * unit_s).ln().abs());
    let is_known = known_hz.is_some() && step > 0.0;
    let is_meant = |(unit_s, _): &(f64, &str)| match is_known {
        true => UNITS.iter().all(|other| apart(*unit_s) <= apart(other.0)),
        false => {
            let is_usual = USUAL_RATES_HZ.contains(&(1.0 / (step * unit_s)));
            is_usual && UNIX_S.contains(&(first * unit_s))
        }
    };
    let found = UNITS.into_iter().find(is_meant);
    found.unwrap_or_else(|| unit_of_step(step))
}
