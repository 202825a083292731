//! Verdicts in words.

use super::number::{readable, window};
use nav_sim_navigation::metrics::{ALL_STATES, StateName, Verdict, VerdictKind};

/// One line: the verdict, by how much and where, the figures it rests on. `outages` are those of the
/// experiment (start, end) in seconds; `runs` and `diverged` count its runs.
pub(crate) fn verdict_line(verdict: &Verdict, outages: &[(f64, f64)], runs: u64, diverged: u64) -> String {
    let figures = format!(
        "NEES {} (9 if right), coverage {:.3}",
        with_error(verdict.nees, verdict.nees_std_error),
        verdict.coverage
    );
    let by = if verdict.is_expected() { ", by covariance analysis" } else { "" };
    let beyond = beyond(verdict, outages);
    let departure = departure(verdict, outages);
    match verdict.kind {
        VerdictKind::Diverged if diverged == runs => format!("diverged: all {runs} runs"),
        VerdictKind::Diverged => {
            format!("diverged: {diverged} of {runs} runs; of the others, {departure}; {figures}{beyond}")
        }
        VerdictKind::Overconfident if verdict.is_lost() => {
            format!("OVERCONFIDENT BY FAR, the filter is lost: {departure}; {figures}")
        }
        VerdictKind::Overconfident => format!("overconfident: {departure}; {figures}{by}{beyond}"),
        VerdictKind::Underconfident => format!("underconfident: {departure}; {figures}{by}{beyond}"),
        VerdictKind::Ok if verdict.is_expected() => format!(
            "{}: {figures}; by covariance analysis no state is off by more than {:.0} %, over the run or at the \
             end of an outage{beyond}",
            Grade::of(verdict).words(),
            100.0 * verdict.tolerance
        ),
        VerdictKind::Ok => {
            let percent = |ratio: f64| readable(100.0 * (ratio - 1.0));
            format!(
                "consistent: {figures}; {} can detect errors {} % above the filter's standard deviations, {} % in one \
                 state alone{beyond}",
                independent(verdict.independent_runs),
                percent(verdict.detectable_ratio),
                percent(verdict.detectable_state_ratio)
            )
        }
    }
}

/// Until where a verdict of linear theory holds, and what decides then.
fn beyond(verdict: &Verdict, outages: &[(f64, f64)]) -> String {
    let Some((start_s, end_s)) = verdict.beyond_linear.and_then(|k| outages.get(k)) else {
        return String::new();
    };
    let window = window(*start_s, *end_s);
    match verdict.is_expected() {
        true => format!(
            "; this holds until the outage {window}, in which errors grow beyond linear theory: confirm with --method both"
        ),
        false => format!("; the runs decide, since errors grow beyond linear theory in the outage {window}"),
    }
}

fn independent(runs: f64) -> String {
    let shown = if runs.fract() == 0.0 { format!("{runs}") } else { format!("{runs:.1}") };
    if runs == 1.0 { "one run".to_owned() } else { format!("{shown} independent runs") }
}

/// How far errors are from what the filter believes, in which state and when.
fn departure(verdict: &Verdict, outages: &[(f64, f64)]) -> String {
    let place = match verdict.worst_outage.and_then(|k| outages.get(k)) {
        Some((start_s, end_s)) => {
            format!("at the end of the outage {}", window(*start_s, *end_s))
        }
        None => "over the run".to_owned(),
    };
    let times = with_error(verdict.ratio, verdict.ratio_std_error);
    match verdict.worst_state {
        ALL_STATES => format!(
            "errors are {times} times what the filter believes of all states together, and of no single one, {place} (NEES \
             {} there)",
            readable(9.0 * verdict.ratio.powi(2))
        ),
        state => format!("errors are {times} times the filter's standard deviation in {state} {place}"),
    }
}

fn with_error(value: f64, error: f64) -> String {
    if error.is_finite() { format!("{} ± {}", readable(value), readable(error)) } else { readable(value) }
}

/// A state, or all of them, in words.
pub(crate) fn state_in_words(name: StateName) -> &'static str {
    if name == ALL_STATES { "all states together" } else { name }
}

/// For a line or a cell among several: "NEES 1189, 34.6 × in yaw_deg"; of runs that found nothing, what they would have found:
/// "NEES 8.7, 0.91 × in yaw_deg, 57 % detectable".
pub(crate) fn verdict_in_short(verdict: &Verdict) -> String {
    let figures = format!(
        "NEES {}, {} × in {}",
        readable(verdict.nees),
        readable(verdict.ratio),
        state_in_words(verdict.worst_state)
    );
    match verdict.kind {
        VerdictKind::Ok if verdict.independent_runs.is_finite() => {
            format!("{figures}, {} % detectable", readable(100.0 * (verdict.detectable_state_ratio - 1.0)))
        }
        VerdictKind::Overconfident if verdict.is_lost() => format!("the filter is lost, {figures}"),
        _ => figures,
    }
}

/// What a verdict says of a filter, the gravest first.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Grade {
    /// At least one run came to nothing.
    Diverged,
    /// Errors are larger than the filter believes.
    Overconfident,
    /// Errors are smaller than the filter believes.
    Underconfident,
    /// Linear theory finds no fault, and errors are beyond it.
    LinearOnly,
    /// Nothing speaks against the filter.
    Consistent,
}

impl Grade {
    /// All of them.
    pub(crate) const ALL: [Self; 5] =
        [Self::Diverged, Self::Overconfident, Self::Underconfident, Self::LinearOnly, Self::Consistent];

    /// Of a verdict.
    pub(crate) fn of(verdict: &Verdict) -> Self {
        match verdict.kind {
            VerdictKind::Diverged => Self::Diverged,
            VerdictKind::Overconfident => Self::Overconfident,
            VerdictKind::Underconfident => Self::Underconfident,
            VerdictKind::Ok if verdict.is_expected() && verdict.beyond_linear.is_some() => Self::LinearOnly,
            VerdictKind::Ok => Self::Consistent,
        }
    }

    /// The gravest of several.
    pub(crate) fn gravest<'a>(verdicts: impl Iterator<Item = &'a Verdict>) -> Self {
        verdicts.map(Self::of).min().unwrap_or(Self::Consistent)
    }

    /// In a word, or a few.
    pub(crate) const fn words(self) -> &'static str {
        match self {
            Self::Diverged => "diverged",
            Self::Overconfident => "overconfident",
            Self::Underconfident => "underconfident",
            Self::LinearOnly => "consistent in linear theory only",
            Self::Consistent => "consistent",
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nav_sim_navigation::simulation::{OutageRecord, RunRecord};

    /// Runs whose errors are `scale` times what the filter believes, in every state and at every time.
    fn verdict(runs: u64, scale: f64) -> Verdict {
        let square = scale * scale;
        let outage = OutageRecord {
            see_end: [1.0; 9],
            error_end: [scale; 9],
            nees_end: 9.0 * square,
            ..Default::default()
        };
        let run = |run| RunRecord {
            run,
            outages: vec![outage.clone()],
            nees_mean: 9.0 * square,
            covered: 0.5,
            normalised_sq: [square; 9],
            ..RunRecord::default()
        };
        Verdict::of(&(0..runs).map(run).collect::<Vec<_>>(), 1, None)
    }

    #[test]
    fn verdicts_are_told_in_words() {
        let outages = [(300.123_456_789, 390.0)];
        let line = |scale: f64| verdict_line(&verdict(100, scale), &outages, 100, 0);
        assert!(
            line(1.0)
                .starts_with("consistent: NEES 9.00 ± 0 (9 if right), coverage 0.500; 100 independent runs")
        );
        let over = line(1.5);
        let expected = "overconfident: errors are 1.50 ± 0 times the filter's standard deviation in ";
        assert!(
            over.starts_with(expected) && over.contains("at the end of the outage 300.12–390 s"),
            "{over}"
        );
        assert!(line(0.5).starts_with("underconfident: errors are 0.500"), "{}", line(0.5));
        let short = |runs: u64, scale: f64| verdict_in_short(&verdict(runs, scale));
        assert!(
            short(100, 1.0).contains(" × in ") && short(100, 1.0).ends_with(" % detectable"),
            "{}",
            short(100, 1.0)
        );
        assert!(
            !short(100, 1.5).contains("detectable")
                && short(100, 12.0).starts_with("the filter is lost, NEES")
        );
        assert!(line(12.0).starts_with("OVERCONFIDENT BY FAR, the filter is lost: "), "{}", line(12.0));
    }
}
