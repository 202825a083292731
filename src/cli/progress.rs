//! Progress of a long computation: a bar on a terminal, a line every 10 % elsewhere.

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use std::io::{IsTerminal, Write};
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Instant;

/// Counts units done, from any thread.
#[derive(Debug)]
pub(crate) enum Progress {
    Silent,
    Bar(ProgressBar),
    Lines(Lines),
}

/// A line every 10 %.
#[derive(Debug)]
pub(crate) struct Lines {
    unit: String,
    total: u64,
    done: AtomicU64,
    start: Instant,
}

impl Progress {
    pub(super) const fn silent() -> Self {
        Self::Silent
    }

    pub(super) fn new(unit: &str, total: u64) -> Self {
        if !std::io::stderr().is_terminal() {
            let (unit, done) = (unit.to_owned(), AtomicU64::new(0));
            return Self::Lines(Lines {
                unit,
                total,
                done,
                start: Instant::now(),
            });
        }
        let bar = ProgressBar::with_draw_target(Some(total), ProgressDrawTarget::stderr());
        let template = "{bar:30} {pos}/{len} {msg}, {per_sec}, {eta} left";
        bar.set_style(ProgressStyle::with_template(template).expect("the template is a constant"));
        bar.set_message(unit.to_owned());
        Self::Bar(bar)
    }

    /// That many more units are done.
    pub(crate) fn add(&self, units: u64) {
        match self {
            Self::Silent => {}
            Self::Bar(bar) => bar.inc(units),
            Self::Lines(lines) => lines.add(units),
        }
    }
}

impl Drop for Progress {
    fn drop(&mut self) {
        if let Self::Bar(bar) = self {
            bar.finish_and_clear();
        }
    }
}

impl Lines {
    fn add(&self, units: u64) {
        let before = self.done.fetch_add(units, Ordering::Relaxed);
        let tenth = |done: u64| done * 10 / self.total.max(1);
        if tenth(before + units) > tenth(before) {
            let _ = writeln!(std::io::stderr(), "{}", self.line(before + units));
        }
    }

    fn line(&self, done: u64) -> String {
        let elapsed = self.start.elapsed().as_secs_f64().max(1e-9);
        let rate = done as f64 / elapsed;
        let left = self.total.saturating_sub(done) as f64 / rate;
        let percent = done * 100 / self.total.max(1);
        format!(
            "{percent:3} %  {done}/{} {}, {rate:.3}/s, {left:.0} s left",
            self.total, self.unit
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_says_share_rate_and_time_left() {
        let lines = Lines {
            unit: "runs".into(),
            total: 40,
            done: AtomicU64::new(0),
            start: Instant::now()
                .checked_sub(std::time::Duration::from_secs(10))
                .unwrap(),
        };
        let line = lines.line(20);
        assert!(line.starts_with(" 50 %  20/40 runs, "), "{line}");
        assert!(line.ends_with(" 10 s left"), "{line}");
    }
}
