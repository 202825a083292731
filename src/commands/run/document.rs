//! The document of a run: verdict, outages, notes, charts and tables.

use super::Navigation;
use super::RunAnswer;
use super::assumptions::assumptions;
use super::budgets::budgets;
use super::charts::{
    fan_chart, horizontal, horizontal_caption, nees, rmse_and_asee, states, windows,
};
use super::remedy::remedy;
use crate::report::requirement::requirement_line;
use crate::report::verdict::verdict_lines;
use crate::report::{STATES, reduction_doubt, reduction_line, tone, unexpected_line};
use nav_sim_document::{Cell, Document, Importance, Table, Tone, readable, window};
use nav_sim_navigation::metrics::{
    EpochMetrics, FanEpoch, Met, OutageSummary, PerState, Summary, VerdictKind,
};
use nav_sim_navigation::simulation::{REPORTED, REPORTED_NAMES};

/// Outages whose tables are shown: of more, those with the largest errors.
const OUTAGES: usize = 3;
/// Outages in the table of a terminal: of more, those with the largest errors.
const LISTED: usize = 6;
/// Sources of errors that a line names.
const SOURCES: usize = 3;

/// The document of an answer.
pub(super) fn document(answer: &RunAnswer) -> Document {
    let RunAnswer {
        navigation:
            Navigation {
                epochs,
                fan,
                summary,
                ..
            },
        track,
        ..
    } = answer;
    let windows = windows(summary);
    let title = if summary.runs > 0 {
        "INS/GNSS Monte-Carlo run"
    } else {
        "INS/GNSS covariance analysis"
    };
    let (kept, missed): (Vec<&Met>, Vec<&Met>) = summary.require.iter().partition(|met| met.met);
    let tone = if missed.is_empty() {
        tone(summary.verdict.kind)
    } else {
        Tone::Bad
    };
    // What the command ends with is what the reader asked for: it comes before the filter.
    let mut lines: Vec<String> = missed
        .iter()
        .map(|met| requirement_line(met, summary))
        .collect();
    let mut verdict = verdict_lines(summary);
    verdict[0] = format!("verdict: {}", verdict[0]);
    lines.extend(verdict);
    lines.extend(kept.iter().map(|met| requirement_line(met, summary)));
    let mut page = Document::new(title, tone, lines);
    notes(summary, answer, &mut page);
    page.facts(&assumptions(summary, answer));
    page.chart(&track.map("Reference trajectory", &windows), "");
    page.chart(&horizontal(epochs, summary), horizontal_caption(summary));
    page.chart(&fan_chart(fan, summary), &fan_caption(fan, summary));
    outages(summary, &mut page);
    page.section("Errors over time");
    page.charts(&states(epochs, &windows), rmse_and_asee(summary));
    consistency(epochs, summary, &mut page);
    budgets(summary, &largest(summary, OUTAGES), &mut page);
    provenance(answer, &mut page);
    page.checked(
        "The filter's standard deviations agree to 2e-4 with an independent implementation; the NEES of filters whose model is right \
         with chi-square at p = 0.001.",
    );
    page
}

/// Sentences beside the verdict: what helps a filter that is overconfident, where errors come from, what is left to know.
fn notes(summary: &Summary, answer: &RunAnswer, page: &mut Document) {
    let scenario = &answer.origin.configuration;
    let mut unexpected = scenario.unexpected();
    unexpected.extend(scenario.unexpected_integration(summary.strapdown_over_sigma));
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
    unexpected
        .iter()
        .for_each(|found| page.note(Importance::Detail, unexpected_line(found)));
    let quality = summary
        .reduction
        .as_ref()
        .and_then(|reduction| reduction.quality.as_ref());
    if let Some(quality) = quality {
        page.note(Importance::Detail, reduction_line(quality));
        reduction_doubt(quality)
            .into_iter()
            .for_each(|doubt| page.note(Importance::Detail, doubt));
    }
    let shown = largest(summary, 1);
    for outage in shown.iter().map(|k| &summary.outages[*k]) {
        sources(outage)
            .into_iter()
            .for_each(|line| page.note(Importance::Remark, line));
        by_calibration(outage)
            .into_iter()
            .for_each(|line| page.note(Importance::Remark, line));
    }
    if summary.outages.len() > LISTED {
        let all = summary.outages.len();
        let text = format!(
            "the table has the {LISTED} of {all} outages with the largest errors, the page all"
        );
        page.note(Importance::Remark, text);
    }
}

/// `sources of the horizontal error at the end of 300–390 s: gyro.AR1 78 %, gyro.WN 11 %, gnss.velocity 10 %`
fn sources(outage: &OutageSummary) -> Option<String> {
    let ranked = outage
        .budget
        .as_ref()?
        .ranked(&[0, 1])
        .into_iter()
        .take(SOURCES);
    let shares: Vec<String> = ranked
        .map(|(name, share)| format!("{name} {:.0} %", 100.0 * share))
        .collect();
    let place = window(outage.start_s, outage.end_s);
    Some(format!(
        "sources of the horizontal error at the end of {place}: {}",
        shares.join(", ")
    ))
}

/// Intervals that the calibrations of the models leave.
fn by_calibration(outage: &OutageSummary) -> Option<String> {
    let shown = |name: &str, value: f64, (low, high): (f64, f64)| {
        format!(
            "{name} {} m [{}, {}]",
            readable(value),
            readable(low),
            readable(high)
        )
    };
    let h = &outage.horizontal_error_end_m;
    let p95 = h
        .p95_ci95
        .0
        .zip(h.p95_ci95.1)
        .map(|ends| shown("p95", h.p95, ends));
    let of_east = |name: &str, value: &PerState<f64>, interval: &Option<PerState<(f64, f64)>>| {
        interval.map(|interval| shown(name, value.0[1], interval.0[1]))
    };
    let rmse = of_east("RMSE east", &outage.rmse_end, &outage.rmse_end_ci95);
    let asee = of_east("ASEE east", &outage.asee_end, &outage.asee_end_ci95);
    let is_known = outage.asee_end_ci95.is_some() || outage.rmse_end_ci95.is_some();
    let all: Vec<String> = [p95, rmse, asee].into_iter().flatten().collect();
    let place = window(outage.start_s, outage.end_s);
    (is_known && !all.is_empty()).then(|| {
        format!(
            "95 % by the calibration, end of {place}: {}",
            all.join(", ")
        )
    })
}

/// A table of figures, of which a covariance analysis does not have all: no draw, hence no interval.
fn known(table: Table, summary: &Summary) -> Table {
    if summary.runs > 0 {
        table
    } else {
        table.without_unknown()
    }
}

fn fan_caption(fan: &[FanEpoch], summary: &Summary) -> String {
    let whose = if summary.runs > 0 {
        "the runs' horizontal position errors"
    } else {
        "the horizontal position error by covariance analysis"
    };
    let beside = match fan.iter().any(|e| e.lincov_m.is_some()) {
        true => " Dashed: 5, 50 and 95 % by covariance analysis.",
        false => "",
    };
    let left_out = match summary.diverged {
        0 => String::new(),
        n => format!(" The {n} runs that diverged are left out."),
    };
    format!(
        "Quantiles of {whose} over time: half of all errors in the dark band, nine in ten in both.{beside}{left_out} The numbers are in fan.csv."
    )
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

fn outages(summary: &Summary, page: &mut Document) {
    if summary.outages.is_empty() {
        page.section("Accuracy over the run");
        let a = &summary.accuracy;
        page.lead(pairs(
            &[("mean", "/accuracy".to_owned(), &a.rmse_mean, &a.asee_mean)],
            "mean",
        ));
        return;
    }
    page.section("At the ends of outages");
    page.lead(lead(summary));
    let has_intervals = summary.runs > 0
        || summary.outages.iter().any(|o| {
            let h = &o.horizontal_error_end_m;
            [h.p50_ci95, h.p95_ci95].iter().any(|ci| ci.0.is_some())
        });
    let brackets = if has_intervals {
        "; brackets are 95 % intervals"
    } else {
        ""
    };
    page.text(&format!(
        "Just before the first fix after the outage{brackets}."
    ));
    page.table(&known(ends(summary), summary));
    by_state(summary, page);
}

/// Horizontal errors at the ends of outages, and how soon fixes mend them.
fn ends(summary: &Summary) -> Table {
    let is_expected = summary
        .outages
        .iter()
        .any(|o| o.horizontal_error_end_m.p999.is_some());
    let (last, key) = if is_expected {
        ("99.9 % (m)", "p999")
    } else {
        ("largest (m)", "max")
    };
    let mut table = Table::new([
        "outage",
        "horizontal, median (m)",
        "95 % interval",
        "horizontal, 95 % (m)",
        "95 % interval",
        last,
        "re-convergence, median (s)",
    ]);
    let interval = |ci: (Option<f64>, Option<f64>)| {
        let bound = |b: Option<f64>| b.map_or("–".to_owned(), readable);
        Cell::figures(format!("[{}, {}]", bound(ci.0), bound(ci.1)))
    };
    for (i, o) in summary.outages.iter().enumerate() {
        let h = &o.horizontal_error_end_m;
        let source_of = |key: &str| format!("/outages/{i}/{key}");
        table.row([
            window(o.start_s, o.end_s).into(),
            Cell::number(h.p50, &source_of("horizontal_error_end_m/p50")),
            interval(h.p50_ci95),
            Cell::number(h.p95, &source_of("horizontal_error_end_m/p95")),
            interval(h.p95_ci95),
            Cell::number(
                h.p999.unwrap_or(h.max),
                &source_of(&format!("horizontal_error_end_m/{key}")),
            ),
            Cell::number(o.reconvergence_s.p50, &source_of("reconvergence_s/p50")),
        ]);
    }
    table
}

/// State by state, the outages with the largest errors.
fn by_state(summary: &Summary, page: &mut Document) {
    let shown = largest(summary, OUTAGES);
    let names: Vec<String> = shown
        .iter()
        .map(|i| &summary.outages[*i])
        .map(|o| window(o.start_s, o.end_s))
        .collect();
    let table = |suffix: &str| {
        let errors_of_outage = |i: &usize| {
            let o = &summary.outages[*i];
            let (rmse, asee) = if suffix == "end" {
                (&o.rmse_end, &o.asee_end)
            } else {
                (&o.rmse_mean, &o.asee_mean)
            };
            (format!("/outages/{i}"), rmse, asee)
        };
        let columns: Vec<Pair<'_>> = names
            .iter()
            .zip(shown.iter().map(errors_of_outage))
            .map(|(name, (place, rmse, asee))| (name.as_str(), place, rmse, asee))
            .collect();
        pairs(&columns, suffix)
    };
    page.heading("RMSE and ASEE at the end");
    page.table(&table("end"));
    page.text(rmse_and_asee(summary));
    page.folded("Means over the outage", |page| page.table(&table("mean")));
    if summary.outages.len() > shown.len() {
        page.text(&format!(
            "The {OUTAGES} outages with the largest errors of {}; summary.json has all.",
            summary.outages.len()
        ));
    }
}

/// A name, where the figures stand in summary.json, RMSE, ASEE.
type Pair<'a> = (&'a str, String, &'a PerState<f64>, &'a PerState<f64>);

/// State by state, both at the same time.
fn pairs(columns: &[Pair<'_>], suffix: &str) -> Table {
    let heads = columns
        .iter()
        .flat_map(|(name, ..)| ["RMSE", "ASEE", "ratio"].map(|what| format!("{what}, {name}")));
    let mut table = Table::new(["state"]).and(heads);
    for (i, state) in STATES.iter().enumerate() {
        let cells = columns.iter().flat_map(|(_, place, rmse, asee)| {
            let source = |what: &str| format!("{place}/{what}_{suffix}/{}", REPORTED_NAMES[i]);
            let (rmse, asee) = (rmse.0[i], asee.0[i]);
            [
                Cell::number(rmse, &source("rmse")),
                Cell::number(asee, &source("asee")),
                Cell::figures(readable(rmse / asee)),
            ]
        });
        table.row(std::iter::once(Cell::from(*state)).chain(cells));
    }
    table
}

fn consistency(epochs: &[EpochMetrics], summary: &Summary, page: &mut Document) {
    page.section("Consistency");
    let covered = if summary.runs > 0 {
        "share of runs"
    } else {
        "share of errors"
    };
    page.chart(
        &nees(epochs, summary),
        &format!(
            "NEES: normalised estimation error squared of position, velocity and attitude. Coverage: {covered} inside the filter's \
             ellipsoid of position and attitude."
        ),
    );
    let (nees, nis, coverage) = (&summary.nees, &summary.nis, &summary.coverage);
    let share = |x: f64| {
        if x.is_finite() {
            format!("{:.0} %", x * 100.0)
        } else {
            "–".to_owned()
        }
    };
    let mut table = Table::new([
        "",
        "mean",
        "if the filter is right",
        "95 % band from",
        "to",
        "epochs inside",
    ]);
    let all_fixes = format!("NIS, all {} fixes", nis.fixes);
    let rows = [
        (
            "NEES, per epoch",
            "nees",
            nees.mean,
            nees.dof as f64,
            [nees.lower95, nees.upper95],
            nees.fraction_inside,
        ),
        (
            &all_fixes,
            "nis",
            nis.mean,
            nis.dof as f64,
            [nis.lower95, nis.upper95],
            f64::NAN,
        ),
        (
            "coverage, per epoch",
            "coverage",
            coverage.mean,
            coverage.level,
            [coverage.lower95, coverage.upper95],
            coverage.fraction_inside,
        ),
    ];
    for (name, key, mean, right, [low, high], inside) in rows {
        table.row([
            name.into(),
            Cell::number(mean, &format!("/{key}/mean")),
            Cell::figures(right.to_string()),
            Cell::number(low, &format!("/{key}/lower95")),
            Cell::number(high, &format!("/{key}/upper95")),
            Cell::figures(share(inside)),
        ]);
    }
    page.table(&known(table, summary));
}

fn provenance(answer: &RunAnswer, page: &mut Document) {
    page.section("Provenance");
    // the command, the threads and the time taken are in manifest.json: this page is the same for the same seed
    page.text(&format!(
        "nav-sim {}; the command is in manifest.json.",
        env!("CARGO_PKG_VERSION")
    ));
    let mut table = Table::new(["input", "file", "BLAKE3"]);
    for i in &answer.inputs {
        table.row([i.role.clone(), i.path.clone(), i.blake3.clone()].map(Cell::from));
    }
    page.table(&table);
    let configuration = toml::to_string_pretty(&answer.origin.configuration).unwrap_or_default();
    page.folded("Configuration", |page| page.code(&configuration));
}

/// The outages with the largest errors in one line each.
fn lead(summary: &Summary) -> Table {
    let is_expected = summary
        .outages
        .iter()
        .any(|o| o.horizontal_error_end_m.p999.is_some());
    let (last, key) = if is_expected {
        ("p99.9 (m)", "p999")
    } else {
        ("max (m)", "max")
    };
    let mut table = Table::new([
        "outage",
        "horizontal p50 (m)",
        "p95 (m)",
        last,
        "RMSE pos_e_m",
        "ASEE pos_e_m",
        "farthest RMSE/ASEE",
    ]);
    for i in largest(summary, LISTED) {
        let o = &summary.outages[i];
        let h = &o.horizontal_error_end_m;
        let ratio = |state: usize| o.rmse_end.0[state] / o.asee_end.0[state];
        let farther = |a: &usize, b: &usize| ratio(*a).ln().abs().total_cmp(&ratio(*b).ln().abs());
        let farthest = (0..REPORTED).max_by(farther).unwrap_or_default();
        let number = |value: f64, key: &str| Cell::number(value, &format!("/outages/{i}/{key}"));
        table.row([
            window(o.start_s, o.end_s).into(),
            number(h.p50, "horizontal_error_end_m/p50"),
            number(h.p95, "horizontal_error_end_m/p95"),
            number(
                h.p999.unwrap_or(h.max),
                &format!("horizontal_error_end_m/{key}"),
            ),
            number(o.rmse_end.0[1], "rmse_end/pos_e_m"),
            number(o.asee_end.0[1], "asee_end/pos_e_m"),
            Cell::figures(format!(
                "{} {}",
                readable(ratio(farthest)),
                REPORTED_NAMES[farthest]
            )),
        ]);
    }
    table
}
