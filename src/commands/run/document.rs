//! The document of a run: verdict, outages, notes, charts and tables.

use super::{Navigation, RunAnswer};
use crate::report::trajectory::track_map;
use crate::report::verdict::{requirement_line, verdict_lines, windows};
use crate::report::{
    ErrorRow, error_charts, integration_line, reduction_doubt, reduction_line, tone,
};
use nav_sim_document::{
    Chart, ChartAxis, Colour, Document, Importance, Mark, Panel, PointInterval, Series, Table,
    Tone, window,
};
use nav_sim_navigation::ekf::FixUpdate;
use nav_sim_navigation::metrics::{EpochMetrics, OutageSummary, Summary, VerdictKind};
use nav_sim_navigation::simulation::{GainsUsed, REPORTED_NAMES};

/// Outages whose tables are shown: of more, those with the largest errors.
const OUTAGES: usize = 3;
/// Sources of errors that a line names.
const SOURCES: usize = 3;

const HORIZONTAL: &str = "Horizontal RMSE and the filter's standard deviation (ASEE), shaded up to 3 σ. Dots: median at the end of an outage; bars: up to the 95 % quantile.";
const STATES_SHOWN: &str = "RMSE: true error. ASEE (averaged standard estimation error): the filter's own standard deviation. Their ratio is 1 if the filter is right.";
const CONSISTENCY: &str = "NEES: normalised estimation error squared of position, velocity and attitude. Coverage: share of errors inside the filter's ellipsoid.";
const FIRST: &str = "Lines: estimate minus truth in one run. Bands: ± 3 ASEE.";

/// The document of an answer.
pub(super) fn document(answer: &RunAnswer) -> Document {
    let Navigation {
        epochs, summary, ..
    } = &answer.navigation;
    let windows = windows(summary);
    let tone = if summary.require.iter().all(|met| met.met) {
        tone(summary.verdict.kind)
    } else {
        Tone::Bad
    };
    let required = summary.require.iter();
    // What was asked for comes before the filter.
    let mut lines: Vec<String> = required.map(|met| requirement_line(met, summary)).collect();
    let mut verdict = verdict_lines(summary);
    verdict[0] = format!("verdict: {}", verdict[0]);
    lines.extend(verdict);
    let mut page = Document::new(&format!("INS/GNSS {}", summary.method), tone, lines);
    notes(summary, answer, &mut page);
    page.chart(
        &track_map("reference", &answer.track, "Reference trajectory", &windows),
        "",
    );
    page.chart(&horizontal(epochs, summary), HORIZONTAL);
    let shown = largest(summary, OUTAGES);
    outages(answer, &shown, &mut page);
    page.section("Errors over time");
    page.charts(&states(epochs, &windows), STATES_SHOWN);
    let error = |e: &EpochMetrics| Some((e.t_s, e.first_error?, e.asee.0.map(|asee| asee.value)));
    let first: Vec<ErrorRow> = epochs.iter().filter_map(error).collect();
    if !first.is_empty() {
        let first = (first, ["stated", "error"], [Colour::BELIEVED, Colour::REAL]);
        let charts = error_charts(&[first], &windows);
        page.folded("Errors of run 0", |page| page.charts(&charts, FIRST));
    }
    page.section("Consistency");
    page.chart(&nees(epochs, summary), CONSISTENCY);
    page.table(consistency(answer));
    budgets(answer, &shown, &mut page);
    let configuration = toml::to_string_pretty(&answer.origin.configuration);
    page.folded("Configuration", |page| {
        page.text(&configuration.unwrap_or_default())
    });
    page
}

/// Notes after the verdict: remedies, unmodelled errors, the largest error sources.
fn notes(summary: &Summary, answer: &RunAnswer, page: &mut Document) {
    let scenario = &answer.origin.configuration;
    let mut unexpected = scenario.unexpected();
    unexpected.extend(integration_line(
        scenario.imu.rate_hz,
        summary.strapdown_over_sigma,
    ));
    let (own, analysed) = (summary.verdict.kind, summary.verdict.by_covariance_analysis);
    let is_undecided =
        own == VerdictKind::Undecided && analysed == Some(VerdictKind::Overconfident);
    if own == VerdictKind::Overconfident || is_undecided {
        let remedy = remedy(summary, &unexpected, answer);
        page.note(
            Importance::Warning,
            format!("the filter is overconfident: {remedy}"),
        );
    }
    for found in unexpected {
        page.note(Importance::Detail, found);
    }
    if let Some(quality) = &summary.reduction {
        page.note(Importance::Detail, reduction_line(quality));
        reduction_doubt(quality)
            .into_iter()
            .for_each(|doubt| page.note(Importance::Detail, doubt));
    }
    if let Some(gains) = summary.gains {
        let importance = if gains.disagree() {
            Importance::Warning
        } else {
            Importance::Detail
        };
        page.note(importance, gains_line(gains));
    }
    for outage in largest(summary, 1).iter().map(|k| &summary.outages[*k]) {
        sources(outage)
            .into_iter()
            .for_each(|line| page.note(Importance::Remark, line));
    }
}

/// `gains shared by all runs; eight runs with their own differ by up to 0.4 %`
fn gains_line(gains: GainsUsed) -> String {
    let [kind, compared] = if gains.is_shared {
        [
            "gains shared by all runs",
            "eight runs with their own differ by up to",
        ]
    } else {
        [
            "gains of each run's own covariance",
            "eight runs with shared ones differ by up to",
        ]
    };
    let compared = |difference: f64| format!("; {compared} {:.1} %", 100.0 * difference);
    let compared = gains.largest_difference.map_or(String::new(), compared);
    let remedy = if gains.disagree() {
        ": --gains own is exact"
    } else {
        ""
    };
    format!("{kind}{compared}{remedy}")
}

/// `sources of the horizontal error at the end of 300–390 s: gyro.AR1 78 %, gyro.WN 11 %, gnss.velocity 10 %`
fn sources(outage: &OutageSummary) -> Option<String> {
    let shares: Vec<String> = outage
        .budget
        .as_ref()?
        .ranked(&[0, 1])
        .into_iter()
        .take(SOURCES)
        .map(|(name, share)| format!("{name} {:.0} %", 100.0 * share))
        .collect();
    let window = window(outage.start_s, outage.end_s);
    (!shares.is_empty()).then(|| {
        let shares = shares.join(", ");
        format!("sources of the horizontal error at the end of {window}: {shares}")
    })
}

/// Positions of the outages with the largest errors, in time order.
fn largest(summary: &Summary, count: usize) -> Vec<usize> {
    let error =
        |i: &usize| summary.outages[*i].rmse_end.0[0].hypot(summary.outages[*i].rmse_end.0[1]);
    let mut all: Vec<usize> = (0..summary.outages.len()).collect();
    all.sort_by(|a, b| error(b).total_cmp(&error(a)));
    all.truncate(count);
    all.sort_unstable();
    all
}

fn outages(answer: &RunAnswer, shown: &[usize], page: &mut Document) {
    let summary = &answer.navigation.summary;
    if summary.outages.is_empty() {
        page.section("Accuracy over the run");
        page.table(Table::of(
            answer,
            "/accuracy/rmse_mean/*",
            &[
                ("state", "@"),
                ("RMSE, mean", "."),
                ("ASEE, mean", "../../asee_mean/@"),
            ],
        ));
        return;
    }
    page.section("At the ends of outages");
    page.text("Just before the first fix after the outage.");
    let columns = [
        ("outage", "{start_s}–{end_s} s"),
        ("horizontal p50 (m)", "horizontal_error_end_m/p50"),
        ("p95 (m)", "horizontal_error_end_m/p95"),
        ("95 % from", "horizontal_error_end_m/p95_ci95/0"),
        ("to", "horizontal_error_end_m/p95_ci95/1"),
        ("p99.9 (m)", "horizontal_error_end_m/p999"),
        ("max (m)", "horizontal_error_end_m/max"),
        ("RMSE pos_e_m", "rmse_end/pos_e_m"),
        ("ASEE pos_e_m", "asee_end/pos_e_m"),
        ("error/σ", "verdict/ratio"),
        ("state", "verdict/worst_state"),
    ];
    page.table(Table::of(answer, "/outages/*", &columns).without_unknown());
    let columns = [
        ("state", "@"),
        ("RMSE, end", "."),
        ("ASEE, end", "../../asee_end/@"),
        ("RMSE, mean", "../../rmse_mean/@"),
        ("ASEE, mean", "../../asee_mean/@"),
    ];
    for k in shown {
        let outage = &summary.outages[*k];
        let table = Table::of(answer, &format!("/outages/{k}/rmse_end/*"), &columns);
        page.folded(
            &format!("States, {}", window(outage.start_s, outage.end_s)),
            |page| page.table(table),
        );
    }
}

fn consistency(answer: &RunAnswer) -> Table {
    let head = ["", "mean", "95 % from", "to", "epochs inside"];
    let rows = [
        (
            "NEES ({nees/dof} if right)",
            "nees/mean nees/lower95 nees/upper95 nees/fraction_inside",
        ),
        (
            "NIS of {nis/fixes} fixes ({nis/dof} if right)",
            "nis/mean nis/lower95 nis/upper95 nis/inside",
        ),
        (
            "coverage ({coverage/level} if right)",
            "coverage/mean coverage/lower95 coverage/upper95 coverage/fraction_inside",
        ),
    ];
    Table::of_keys(answer, &head, &rows).without_unknown()
}

/// The sources of the errors at the ends of the outages that are shown.
fn budgets(answer: &RunAnswer, shown: &[usize], page: &mut Document) {
    let outages = &answer.navigation.summary.outages;
    if shown.iter().all(|k| outages[*k].budget.is_none()) {
        return;
    }
    page.section("Sources of errors");
    page.text("Shares of the mean square at the end of each outage, by covariance analysis.");
    let columns = [
        ("source", "@"),
        ("north", "pos_n_m"),
        ("east", "pos_e_m"),
        ("down", "pos_d_m"),
        ("yaw", "yaw_deg"),
    ];
    for k in shown {
        let table = Table::of(answer, &format!("/outages/{k}/budget/*"), &columns);
        let title = window(outages[*k].start_s, outages[*k].end_s);
        page.folded(&title, |page| page.table(table));
    }
}

// The figures of a run.

fn over_time(epochs: &[EpochMetrics], value: impl Fn(&EpochMetrics) -> f64) -> Vec<(f64, f64)> {
    epochs.iter().map(|e| (e.t_s, value(e))).collect()
}

fn horizontal(epochs: &[EpochMetrics], summary: &Summary) -> Chart {
    let rmse = over_time(epochs, |e| e.rmse.0[0].value.hypot(e.rmse.0[1].value));
    let believed = over_time(epochs, |e| e.asee.0[0].value.hypot(e.asee.0[1].value));
    let three = believed
        .iter()
        .map(|(t, sigma)| (*t, *sigma, 3.0 * sigma))
        .collect();
    let end = |o: &OutageSummary| {
        let h = &o.horizontal_error_end_m;
        PointInterval {
            x: o.end_s,
            y: h.p50,
            low: f64::NAN,
            high: h.p95,
        }
    };
    let series = vec![
        Series::new("believed, up to 3 σ", Colour::BELIEVED, Mark::Band(three)),
        Series::line("believed (ASEE)", Colour::BELIEVED, believed),
        Series::line("true (RMSE)", Colour::REAL, rmse),
        Series::new(
            "median and 95 %",
            Colour::Ink,
            Mark::Points(summary.outages.iter().map(end).collect()),
        ),
    ];
    Chart::over_time(
        "Horizontal position error",
        vec![Panel::new(ChartAxis::log("horizontal error (m)"), series).of_height(1.2)],
        &windows(summary),
    )
}

/// Every state: what the filter states and how wrong it is.
fn states(epochs: &[EpochMetrics], outages: &[(f64, f64)]) -> Vec<Chart> {
    let chart = |(i, state): (usize, &&str)| {
        let series = vec![
            Series::line(
                "RMSE",
                Colour::REAL,
                over_time(epochs, |e| e.rmse.0[i].value),
            ),
            Series::line(
                "ASEE",
                Colour::BELIEVED,
                over_time(epochs, |e| e.asee.0[i].value),
            ),
        ];
        Chart::over_time(state, vec![Panel::new(ChartAxis::log(""), series)], outages).small()
    };
    REPORTED_NAMES.iter().enumerate().map(chart).collect()
}

fn nees(epochs: &[EpochMetrics], summary: &Summary) -> Chart {
    let panel = |axis: ChartAxis, band: [f64; 2], value: fn(&EpochMetrics) -> f64| {
        let mut series = vec![Series::line("", Colour::Ink, over_time(epochs, value))];
        // of expected values there is no scatter, and no band for it
        if summary.runs > 0 {
            series.insert(
                0,
                Series::new(
                    "95 % band of a right filter",
                    Colour::RIGHT,
                    Mark::Zone(band[0], band[1]),
                ),
            );
        }
        Panel::new(axis, series).of_height(0.8)
    };
    let (nees, coverage) = (&summary.nees, &summary.coverage);
    let title = format!("coverage at level {}", coverage.level);
    let panels = vec![
        panel(
            ChartAxis::log(&format!("NEES ({} if right)", nees.dof)),
            [nees.lower95, nees.upper95],
            |e| e.nees.value,
        ),
        panel(
            ChartAxis::linear(&title).including(0.8, 1.0),
            [coverage.lower95, coverage.upper95],
            |e| e.coverage,
        ),
    ];
    Chart::over_time("Consistency", panels, &windows(summary))
}

/// Advice by what the belief lacks, where linear analysis finds the filter wrong already; errors that are large are then its
/// consequence.
fn remedy(summary: &Summary, unexpected: &[String], answer: &RunAnswer) -> String {
    let verdict = &summary.verdict;
    let has_input = |role| answer.inputs.iter().any(|input| input.role == role);
    let [is_recorded, has_truth] = ["static", "truth"].map(has_input);
    let is_other = is_recorded || has_truth || answer.origin.spread;
    let ratios = summary.reduction.iter().flat_map(|quality| {
        quality
            .outage_end
            .iter()
            .chain([&quality.mean])
            .flat_map(|state| state.0)
    });
    let is_far = verdict.beyond_linear.is_some();
    // what recordings contain is unknown, and so is whether linear analysis would find the filter wrong
    match unexpected.first() {
        _ if summary.is_contradicted || is_recorded && is_far => {}
        Some(found) => return found.clone(),
        // where the reduced filter is right about the errors of its own model, the errors are of something else
        None if ratios.fold(0.0, f64::max) > 1.0 + verdict.tolerance => {
            return "--filter full models each process".to_owned();
        }
        None if is_other || !is_far => {
            let how = if is_other { "" } else { " --scenario" };
            return format!(
                "MODEL is not the truth: nav-sim tune{how} finds variances that cover it"
            );
        }
        None => {}
    }
    // the iterated update helps where errors are too large after fixes that follow an outage, not before them
    let is_after = |first: usize| {
        let is_met_again = summary.outages[first].reconvergence_s.p50.is_finite();
        is_met_again && verdict.worst_outage.is_none_or(|outage| outage > first)
    };
    let is_linear = answer.origin.configuration.filter.update == FixUpdate::Ekf;
    let iterated = if is_linear && verdict.beyond_linear.is_some_and(is_after) {
        "; filter.update = \"iterated\" does"
    } else {
        ""
    };
    format!(
        "errors too large for a linear filter: another MODEL or nav-sim tune does not help{iterated}"
    )
}
