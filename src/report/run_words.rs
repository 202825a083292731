//! What a run found, in words and tables: the verdict first.

use super::markdown_table as table;
use super::number::{readable, window};
use super::requirement::requirement_line;
use super::verdict::verdict_lines;
use nav_sim_navigation::metrics::{Agreement, Budget, OutageSummary, PerState, Summary};
use nav_sim_navigation::scenario::Method;
use nav_sim_navigation::simulation::REPORTED_NAMES;

/// The summary for people, the verdict first.
pub(crate) fn text(summary: &Summary) -> String {
    let mut text = format!("verdict: {}\n", verdict_lines(summary).join("\n"));
    summary.require.iter().for_each(|met| text += &format!("{}\n", requirement_line(met, summary)));
    text += &format!("{}\n", how(summary));
    if summary.runs > 0 && summary.diverged == summary.runs {
        return text.trim_end().to_owned();
    }
    text += &if summary.outages.is_empty() {
        format!(
            "{}\nmeans over the run (the verdict rests on the root mean square of error over sigma, epoch by epoch): RMSE and ",
            whole_run_table(summary)
        )
    } else {
        format!("{}\njust before the first fix after the outage: RMSE and ", outage_table(&summary.outages))
    };
    text += "ASEE (averaged standard estimation error: the filter's own standard deviation)\n";
    let (nees, coverage) = (&summary.nees, &summary.coverage);
    let inside = |share: f64, low: f64, high: f64| match share.is_finite() {
        true => format!(", {:.0} % of epochs within [{low:.2}, {high:.2}]", share * 100.0),
        false => String::new(),
    };
    text += &format!(
        "NEES {:.2} ({} if the filter is right){}\n",
        nees.mean,
        nees.dof,
        inside(nees.fraction_inside, nees.lower95, nees.upper95)
    );
    text += &format!(
        "coverage {:.3} at level {}{}",
        coverage.mean,
        coverage.level,
        inside(coverage.fraction_inside, coverage.lower95, coverage.upper95)
    );
    text += &calibration_lines(&summary.outages);
    text += &budget_table(summary);
    if let Some(agreement) = &summary.agreement {
        text += &format!("\nruns against the covariance analysis: {}", agreement_line(agreement));
    }
    text
}

/// What the calibrations leave open: a line for each of the first outages.
fn calibration_lines(outages: &[OutageSummary]) -> String {
    let shown = |value: f64, (low, high): (f64, f64)| {
        let [value, low, high] = [value, low, high].map(readable);
        format!("{value} [{low}, {high}]")
    };
    let line = |o: &OutageSummary| {
        let h = &o.horizontal_error_end_m;
        let p95 =
            (h.p95_ci95.0.zip(h.p95_ci95.1)).map(|ends| format!("horizontal p95 {} m", shown(h.p95, ends)));
        let interval_words = |name: &str, value: &PerState<f64>, interval: &Option<PerState<(f64, f64)>>| {
            interval.map(|interval| format!("{name} pos_e_m {}", shown(value.0[1], interval.0[1])))
        };
        let rmse = interval_words("RMSE", &o.rmse_end, &o.rmse_end_ci95);
        let asee = interval_words("ASEE", &o.asee_end, &o.asee_end_ci95);
        let all: Vec<String> = [p95, rmse, asee].into_iter().flatten().collect();
        let window = window(o.start_s, o.end_s);
        (!all.is_empty()).then(|| format!("\nby the calibration, 95 %, {window}: {}", all.join(", ")))
    };
    outages
        .iter()
        .filter(|o| o.asee_end_ci95.is_some() || o.rmse_end_ci95.is_some())
        .take(BUDGETS)
        .filter_map(line)
        .collect()
}

/// Most outages whose sources are shown; of more, those with the largest errors.
const BUDGETS: usize = 3;
/// Sources that are shown of a state.
const SOURCES: usize = 3;

/// The three largest sources of the horizontal position and of yaw at the ends of outages.
fn budget_table(summary: &Summary) -> String {
    let horizontal = |b: &Budget| b.total[0] + b.total[1];
    let mut known: Vec<(&OutageSummary, &Budget)> =
        summary.outages.iter().filter_map(|o| Some((o, o.budget.as_ref()?))).collect();
    if known.is_empty() {
        return String::new();
    }
    known.sort_by(|a, b| horizontal(b.1).total_cmp(&horizontal(a.1)));
    known.truncate(BUDGETS);
    known.sort_by(|a, b| a.0.start_s.total_cmp(&b.0.start_s));
    let sources = |budget: &Budget, states: &[usize]| -> String {
        let shares = budget.ranked(states).into_iter().take(SOURCES);
        shares.map(|(name, share)| format!("{name} {:.0} %", 100.0 * share)).collect::<Vec<_>>().join(", ")
    };
    let mut rows = vec![["sources of errors", "horizontal position", "yaw"].map(str::to_owned).to_vec()];
    for (o, budget) in known {
        let window = window(o.start_s, o.end_s);
        rows.push(vec![window, sources(budget, &[0, 1]), sources(budget, &[8])]);
    }
    format!("\n{}", table(&rows))
}

/// How horizontal position (east) and yaw at the end of the outage with the largest errors follow from each parameter.
pub(crate) fn sensitivity_table(summary: &Summary) -> String {
    let known = summary.outages.iter().filter_map(|o| Some((o, o.sensitivity.as_ref()?)));
    let east = |o: &OutageSummary| o.rmse_end.0[1];
    let Some((outage, of)) = known.max_by(|a, b| east(a.0).total_cmp(&east(b.0))) else {
        return String::new();
    };
    let states = [1, 6, 8];
    let window = window(outage.start_s, outage.end_s);
    let head = std::iter::once("d ln RMSE / d ln parameter".to_owned());
    let mut rows: Vec<Vec<String>> = vec![head.chain(states.map(|i| REPORTED_NAMES[i].to_owned())).collect()];
    for (name, slopes) in &of.0 {
        let slopes = states.map(|i| format!("{:+.3}", slopes.0[i]));
        rows.push(std::iter::once(name.clone()).chain(slopes).collect());
    }
    format!("at the end of the outage {window}\n{}", table(&rows))
}

/// How the figures were found.
fn how(summary: &Summary) -> String {
    if summary.method == Method::Lincov.name() {
        return format!("covariance analysis without runs, {} states", summary.filter_states);
    }
    let shared = match summary.independent_runs < (summary.runs - summary.diverged) as f64 {
        true => format!(", worth {:.1} independent ones", summary.independent_runs),
        false => String::new(),
    };
    let seed = summary.seed.map_or_else(String::new, |seed| format!(", seed {seed}"));
    format!(
        "{} runs ({} diverged){shared}, {} states{seed}",
        summary.runs, summary.diverged, summary.filter_states
    )
}

/// Most outages in the table.
const OUTAGES: usize = 6;

/// The outages, of many those with the largest errors, in time order.
fn outage_table(all: &[OutageSummary]) -> String {
    let is_expected = all.iter().any(|o| o.horizontal_error_end_m.p999.is_some());
    let mut outages: Vec<&OutageSummary> = all.iter().collect();
    outages.sort_by(|a, b| b.horizontal_error_end_m.p95.total_cmp(&a.horizontal_error_end_m.p95));
    outages.truncate(OUTAGES);
    outages.sort_by(|a, b| a.start_s.total_cmp(&b.start_s));
    let left_out = match all.len() > OUTAGES {
        true => {
            format!("\nthe {OUTAGES} of {} outages with the largest errors; summary.json has all", all.len())
        }
        false => String::new(),
    };
    let head = [
        "outage",
        "horizontal p50 (m)",
        "p95",
        if is_expected { "p99.9" } else { "max" },
        "RMSE pos_e_m",
        "ASEE",
        "ratio",
        "RMSE roll_deg",
        "ASEE",
        "ratio",
        "ratio farthest from 1",
    ];
    let mut rows = vec![head.map(str::to_owned).to_vec()];
    for o in outages {
        let h = &o.horizontal_error_end_m;
        let mut row = vec![window(o.start_s, o.end_s)];
        row.extend([h.p50, h.p95, h.p999.unwrap_or(h.max)].map(|v| format!("{v:.1}")));
        let ratios = ratios(&o.rmse_end, &o.asee_end);
        for state in [1, 6] {
            let values = [o.rmse_end.0[state], o.asee_end.0[state]].map(|v| format!("{v:.3}"));
            row.extend(values.into_iter().chain([format!("{:.2}", ratios[state])]));
        }
        let distance = |state: &usize| ratios[*state].ln().abs();
        let farthest = (0..ratios.len()).max_by(|a, b| distance(a).total_cmp(&distance(b))).unwrap_or(0);
        row.push(format!("{:.2} {}", ratios[farthest], REPORTED_NAMES[farthest]));
        rows.push(row);
    }
    format!("{}{left_out}", table(&rows))
}

fn ratios(rmse: &PerState<f64>, asee: &PerState<f64>) -> Vec<f64> {
    rmse.0.iter().zip(&asee.0).map(|(rmse, asee)| rmse / asee).collect()
}

fn whole_run_table(summary: &Summary) -> String {
    let (rmse, asee) = (&summary.accuracy.rmse_mean, &summary.accuracy.asee_mean);
    let row = |name: &str, values: &[f64]| {
        std::iter::once(name.to_owned()).chain(values.iter().map(|v| format!("{v:.3}"))).collect::<Vec<_>>()
    };
    let head = std::iter::once("").chain(REPORTED_NAMES).map(str::to_owned).collect();
    table(&[head, row("RMSE", &rmse.0), row("ASEE", &asee.0), row("ratio", &ratios(rmse, asee))])
}

/// `largest z -2.31 (RMSE of yaw_deg at the end of outage 1) of 22 figures, up to 4.4 by chance; NEES z +0.52, …`
pub(crate) fn agreement_line(a: &Agreement) -> String {
    if a.figures == 0 {
        return "too few to compare: a scatter takes two runs".to_owned();
    }
    format!(
        "largest z {:+.2} ({}) of {} figures, up to {:.1} by chance; NEES z {:+.2}, coverage z {:+.2}",
        a.largest_z, a.largest, a.figures, a.bound_z, a.nees_z, a.coverage_z
    )
}
