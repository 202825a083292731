//! Verdicts in words.

use nav_sim_document::{Tone, readable, short_names, window};
use nav_sim_navigation::metrics::{
    ALL_STATES, Basis, ReductionQuality, RequirementResult, Summary, Verdict, VerdictKind,
};
use nav_sim_navigation::simulation::{REPORTED, REPORTED_NAMES};
use serde::Deserialize;
use serde_json::Value;
use std::collections::BTreeMap;

/// Most characters of a line, of which "verdict: " takes some.
const WIDTH: usize = 111;

/// The verdict on the filter of a run, what it rests on, and the word of covariance analysis beside it; a contradiction of
/// the two comes first.
pub(crate) fn verdict_lines(summary: &Summary) -> Vec<String> {
    let verdict = &summary.verdict;
    let mut lines = vec![words(summary)];
    let Some(analysed) = verdict.by_covariance_analysis else {
        return lines;
    };
    if summary.is_contradicted {
        let line = format!(
            "{} in the runs, {analysed} by covariance analysis: errors beyond linear theory",
            verdict.kind
        );
        lines.insert(0, line);
        return lines;
    }
    let beside = format!("covariance analysis: {analysed}");
    match format!("{}; {beside}", lines[0]) {
        both if both.chars().count() <= WIDTH => lines[0] = both,
        _ => lines.push(beside),
    }
    lines
}

/// The outages (start, end) (s).
pub(crate) fn windows(summary: &Summary) -> Vec<(f64, f64)> {
    summary
        .outages
        .iter()
        .map(|o| (o.start_s, o.end_s))
        .collect()
}

/// The verdict on a drive by a reference that knows so many states.
pub(crate) fn drive_line(verdict: &Verdict, states: usize, outages: &[(f64, f64)]) -> String {
    sentence(verdict, (1, 0), states, outages)
}

fn words(summary: &Summary) -> String {
    let runs = (summary.runs, summary.diverged);
    sentence(&summary.verdict, runs, REPORTED, &windows(summary))
}

/// A verdict on so many runs, of which some diverged.
fn sentence(
    verdict: &Verdict,
    (runs, diverged): (u64, u64),
    states: usize,
    windows: &[(f64, f64)],
) -> String {
    let nees = format!(
        "NEES {} ({states} if right)",
        with_error(verdict.nees, verdict.nees_std_error)
    );
    let by = if verdict.is_expected() {
        " by covariance analysis"
    } else {
        ""
    };
    let kind = verdict.kind;
    match kind {
        VerdictKind::Diverged if diverged == runs => format!("diverged: all {runs} runs"),
        VerdictKind::Diverged => {
            format!(
                "diverged: {diverged} of {runs} runs; of the others, {}",
                departure(verdict, windows)
            )
        }
        VerdictKind::Overconfident | VerdictKind::Underconfident => {
            let far = if verdict.is_far_off() { " by far" } else { "" };
            format!(
                "{kind}{far}{by}: {}; NEES {}",
                departure(verdict, windows),
                readable(verdict.nees)
            )
        }
        VerdictKind::Undecided => {
            let ratio = verdict.detectable_state_ratio;
            let (samples, decides) = (samples(verdict), deciding(verdict));
            format!(
                "undecided: {samples} may miss an error/σ of {ratio:.2} in one state; {decides}"
            )
        }
        VerdictKind::Doubtful => {
            format!(
                "doubtful: NEES {}{by}, {}",
                readable(verdict.nees),
                beyond(verdict, windows)
            )
        }
        VerdictKind::Consistent | VerdictKind::NotMet => {
            let rest = if verdict.is_expected() {
                "by covariance analysis".to_owned()
            } else {
                samples(verdict)
            };
            format!("{kind}: {nees}, coverage {:.3}; {rest}", verdict.coverage)
        }
    }
}

/// Until where covariance analysis holds, and what decides then.
fn beyond(verdict: &Verdict, outages: &[(f64, f64)]) -> String {
    let place = verdict
        .beyond_linear
        .and_then(|k| outages.get(k))
        .map_or_else(String::new, |(start_s, end_s)| {
            format!(" in outage {}", window(*start_s, *end_s))
        });
    format!("beyond linear theory{place}: confirm with --method both")
}

/// The samples of a verdict.
fn samples(verdict: &Verdict) -> String {
    let worth = readable(verdict.independent_samples);
    match verdict.basis {
        Basis::Drive => format!("a drive worth {worth} independent samples"),
        Basis::Windows => format!("runs on {worth} independent windows of the recording"),
        Basis::Withheld => format!("withheld windows ({worth})"),
        Basis::Expectation => "covariance analysis".to_owned(),
        Basis::Runs if verdict.independent_samples == 1.0 => "1 run".to_owned(),
        Basis::Runs => format!("{} runs", verdict.independent_samples),
    }
}

/// The samples that would decide.
pub(crate) fn deciding(verdict: &Verdict) -> String {
    let times = verdict.times_to_decide.unwrap_or(1.0);
    let longer = (10.0 * times).ceil() / 10.0;
    match verdict.basis {
        Basis::Runs | Basis::Expectation => {
            // a whole number is met to rounding
            let runs = (times * verdict.independent_samples - 1e-6).ceil();
            format!("{runs} would decide")
        }
        Basis::Windows => format!("a recording {longer:.1} times as long would decide"),
        Basis::Drive | Basis::Withheld => format!("a drive {longer:.1} times as long would decide"),
    }
}

/// Largest ratio of errors to the filter's sigma, with its state and time.
fn departure(verdict: &Verdict, outages: &[(f64, f64)]) -> String {
    let place = match verdict.worst_outage.and_then(|k| outages.get(k)) {
        Some((start_s, end_s)) => format!("at the end of outage {}", window(*start_s, *end_s)),
        None => "over the run".to_owned(),
    };
    let times = with_error(verdict.ratio, verdict.ratio_std_error);
    format!(
        "errors {times} times sigma in {} {place}",
        state_in_words(verdict.worst_state)
    )
}

fn with_error(value: f64, error: f64) -> String {
    if error > 0.0 {
        let error = if error < 10.0 {
            format!("{error:.2}")
        } else {
            readable(error)
        };
        format!("{} ± {error}", readable(value))
    } else {
        readable(value)
    }
}

/// A state, or all of them, in words.
fn state_in_words(name: &str) -> &str {
    if name == ALL_STATES {
        "all states together"
    } else {
        name
    }
}

/// The gravest of several verdicts with names, and a line a kind, the gravest first:
/// `1 of 2 filters overconfident, most: b (NEES 24.1, 2.10 × in yaw_deg)`; of runs too few to decide, how many would.
pub(crate) fn verdict_counts(verdicts: &[(&str, &Value)]) -> (VerdictKind, Vec<String>) {
    let runs: Vec<&str> = verdicts.iter().map(|(run, _)| *run).collect();
    let names = short_names(&runs);
    let mut kinds: BTreeMap<VerdictKind, Vec<(&String, &Value)>> = BTreeMap::new();
    for (name, (_, verdict)) in names.iter().zip(verdicts) {
        kinds
            .entry(VerdictKind::deserialize(&verdict["kind"]).unwrap_or_default())
            .or_default()
            .push((name, verdict));
    }
    let number = |verdict: &Value, key: &str| verdict[key].as_f64().unwrap_or(f64::NAN);
    let line = |(kind, of_kind): (&VerdictKind, &Vec<(&String, &Value)>)| {
        let nees = |(_, verdict): &(&String, &Value)| number(verdict, "nees");
        let (name, worst) = of_kind.iter().max_by(|a, b| nees(a).total_cmp(&nees(b)))?;
        let (count, all) = (of_kind.len(), verdicts.len());
        let [nees, ratio] = ["nees", "ratio"].map(|key| readable(number(worst, key)));
        let state = state_in_words(worst["worst_state"].as_str().unwrap_or_default());
        let decide = worst["times_to_decide"].as_f64().map(|times| Verdict {
            basis: Basis::deserialize(&worst["basis"]).unwrap_or_default(),
            independent_samples: number(worst, "independent_samples"),
            times_to_decide: Some(times),
            ..Verdict::default()
        });
        let decide = decide.map_or_else(String::new, |v| format!(", {}", deciding(&v)));
        Some(format!(
            "{count} of {all} filters {kind}, most: {name} (NEES {nees}, {ratio} × in {state}{decide})"
        ))
    };
    (
        kinds.keys().last().copied().unwrap_or_default(),
        kinds.iter().rev().filter_map(line).collect(),
    )
}

// Limits that errors must keep, in words.

/// `required p95_m<=5: NOT MET, 7.41 m at the end of the outage 300–390 s`
pub(crate) fn requirement_line(met: &RequirementResult, summary: &Summary) -> String {
    if met.name == "consistent" {
        let word = if met.met { "met" } else { "NOT MET" };
        return format!(
            "required consistent: {word}, the filter is {}",
            summary.verdict.kind
        );
    }
    let outage = |k: usize| {
        format!(
            "outage {}",
            window(summary.outages[k].start_s, summary.outages[k].end_s)
        )
    };
    let place = met.outage.map_or_else(
        || "over the run".to_owned(),
        |k| format!("at the end of the {}", outage(k)),
    );
    let is_shown = met.met || met.value > met.limit;
    let word = match met.met {
        true => "met",
        // within the limit, by a figure that proves nothing
        false if !is_shown => "NOT SHOWN",
        false => "NOT MET",
    };
    let by = match met.beyond_linear.map(outage) {
        None => String::new(),
        Some(outage) if is_shown => {
            format!(" by the runs, beyond linear theory from the {outage} on")
        }
        Some(outage) => {
            format!(" beyond linear theory from the {outage} on: confirm with --method both")
        }
    };
    let (name, limit, value, unit) = (&met.name, met.limit, readable(met.value), unit(&met.name));
    format!("required {name}<={limit}: {word}, {value} {unit} {place}{by}")
}

/// The unit that the name of a figure ends with.
fn unit(name: &str) -> &'static str {
    [("_m_s", "m/s"), ("_deg", "°"), ("_m", "m")]
        .iter()
        .find(|(end, _)| name.ends_with(end))
        .map_or("", |(_, unit)| unit)
}

// The reported states in words; the colour of a verdict.

/// Names in a sentence.
pub(crate) const SPOKEN: [&str; REPORTED] = [
    "North position",
    "East position",
    "Down position",
    "North velocity",
    "East velocity",
    "Down velocity",
    "roll",
    "pitch",
    "yaw",
];

/// Names in the head of a table.
pub(crate) fn axis_of(state: usize) -> &'static str {
    SPOKEN[state].trim_end_matches(" position")
}

/// The colour of a verdict.
pub(crate) const fn tone(kind: VerdictKind) -> Tone {
    match kind {
        VerdictKind::Consistent => Tone::Good,
        VerdictKind::Undecided => Tone::Undecided,
        VerdictKind::Doubtful | VerdictKind::Underconfident => Tone::Doubtful,
        VerdictKind::Overconfident | VerdictKind::NotMet | VerdictKind::Diverged => Tone::Bad,
    }
}

// Words on what a filter does not expect, and on what a reduction costs it.

/// The integration error of the strapdown, where the largest is a tenth of sigma: a hundredth of a mean square.
pub(crate) fn integration_line(rate_hz: f64, over_sigma: f64) -> Option<String> {
    let errs = readable(over_sigma);
    (over_sigma > 0.1).then(|| {
        format!(
            "at {rate_hz} Hz the strapdown alone errs by {errs} sigma on this motion: raise imu.rate_hz"
        )
    })
}

/// Quality of a filter reduced to 15 states, in one line: its NEES, its errors above those of the
/// full filter.
pub(crate) fn reduction_line(quality: &ReductionQuality) -> String {
    let more = |ratio: f64| format!("{:+.1} %", 100.0 * (ratio - 1.0));
    let cost = quality
        .cost()
        .map_or(String::new(), |(horizontal, (state, most))| {
            let largest = if most > horizontal {
                format!(", {} {}", REPORTED_NAMES[state], more(most))
            } else {
                String::new()
            };
            format!(
                "; RMSE over --filter full at outages: horizontal {}{largest}",
                more(horizontal)
            )
        });
    format!(
        "reduced filter: NEES {} (9 if right){cost}",
        readable(quality.nees)
    )
}

/// A standard deviation of the reduced filter that is too small or too large at an outage's end.
pub(crate) fn reduction_doubt(quality: &ReductionQuality) -> Option<String> {
    let (state, outage, ratio) = quality.worst()?;
    let size = if ratio > 1.0 { "small" } else { "large" };
    let full = if quality.rmse_over_full.is_some() {
        "; --filter full reduces nothing"
    } else {
        ""
    };
    Some(format!(
        "reduced filter: sigma of {} at the end of outage {} is {:.0} % too {size}{full}",
        REPORTED_NAMES[state],
        outage + 1,
        100.0 * (1.0 / ratio - 1.0).abs()
    ))
}

#[cfg(test)]
mod verdict_tests {
    use super::*;
    use nav_sim_navigation::metrics::epochs;
    use nav_sim_navigation::simulation::{OutageRecord, RunRecord, RunResult};

    /// Runs whose errors are `scale` times what the filter states, in every state and at every time.
    fn summary(runs: u64, scale: f64) -> Summary {
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
        let result = RunResult {
            runs: (0..runs).map(run).collect(),
            outages: vec![(300.123_456_789, 390.0)],
            ..RunResult::default()
        };
        Summary::of(&result, &epochs(&result), 1)
    }

    #[test]
    fn verdicts_are_told_in_one_line() {
        let line = |runs: u64, scale: f64| {
            let lines = verdict_lines(&summary(runs, scale));
            assert!(
                lines.len() == 1 && lines[0].chars().count() <= WIDTH,
                "{lines:?}"
            );
            lines[0].clone()
        };
        assert_eq!(
            line(100, 1.0),
            "consistent: NEES 9.00 (9 if right), coverage 0.500; 100 runs"
        );
        let over = line(100, 1.5);
        assert!(
            over.starts_with("overconfident: errors 1.50 times sigma in "),
            "{over}"
        );
        assert!(over.contains("at the end of outage 300.12–390 s"), "{over}");
        assert!(
            line(100, 0.5).starts_with("underconfident: errors 0.500"),
            "{}",
            line(100, 0.5)
        );
        assert!(
            line(100, 12.0).starts_with("overconfident by far: "),
            "{}",
            line(100, 12.0)
        );
        let few = line(8, 1.0);
        assert!(
            few.starts_with("undecided: 8 runs may miss") && few.ends_with(" would decide"),
            "{few}"
        );
    }

    /// The word of covariance analysis stands beside the verdict; what the runs contradict comes first.
    #[test]
    fn covariance_analysis_has_a_word_beside_the_runs() {
        let mut found = summary(8, 1.0);
        found.verdict.by_covariance_analysis = Some(VerdictKind::Overconfident);
        let lines = verdict_lines(&found);
        assert!(
            lines
                .join("\n")
                .ends_with("covariance analysis: overconfident"),
            "{lines:?}"
        );
        found.is_contradicted = true;
        assert!(
            verdict_lines(&found)[0].starts_with("undecided in the runs, overconfident by"),
            "{lines:?}"
        );
    }
}
