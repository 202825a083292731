//! The document of a run: verdict, outages, notes, charts and tables.

use super::{Navigation, RunAnswer};
use crate::report::verdict::requirement_line;
use crate::report::verdict::verdict_lines;
use crate::report::{
    STATES, error_of, reduction_doubt, reduction_line, tone, unexpected_in_words, unexpected_line,
};
use nav_sim_document::{
    Axis, Cell, Chart, Colour, Document, Importance, Interval, Mark, Panel, Series, Table, Tone,
    readable, window,
};
use nav_sim_navigation::ekf::{FixUpdate, InitialSettings};
use nav_sim_navigation::metrics::{
    Budget, EpochMetrics, FanEpoch, Met, OutageSummary, PerState, Summary, VerdictKind,
};
use nav_sim_navigation::scenario::{Method, Unexpected};
use nav_sim_navigation::sensors::aiding::{Aid, AidingSettings};
use nav_sim_navigation::sensors::defects::{Defect, ImuSettings};
use nav_sim_navigation::sensors::gnss::GnssSettings;
use nav_sim_navigation::simulation::{REPORTED, REPORTED_NAMES};
use nav_sim_signal::imu::Sensor;
use nav_sim_signal::units::DEG;

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

// What the results of a run rest on: models, true IMU, receiver, start.

/// What the results rest on.
pub(super) fn assumptions(summary: &Summary, answer: &RunAnswer) -> Vec<(&'static str, String)> {
    let input = |role: &str| {
        answer
            .inputs
            .iter()
            .find(|i| i.role == role)
            .map_or("", |i| i.path.as_str())
    };
    let truth = match (input("static"), input("truth")) {
        ("", "") => format!("{} (the model of the filter)", input("model")),
        ("", model) => model.to_owned(),
        (recording, _) => format!("windows of {recording}"),
    };
    let scenario = &answer.origin.configuration;
    let mut facts = vec![
        ("trajectory", input("trajectory").to_owned()),
        (
            "model of the filter",
            format!("{}, {} states", input("model"), summary.filter_states),
        ),
        ("what makes the errors", truth),
        ("IMU", defects(&scenario.imu)),
        ("GNSS", receiver(&scenario.gnss)),
        ("start (1 σ)", start(&scenario.initial)),
    ];
    if let Some(baro) = &scenario.baro {
        facts.push((
            "barometer",
            format!("{} Hz; 1 σ {} m", baro.rate_hz, readable(baro.sigma_m)),
        ));
    }
    let aids: Vec<String> = scenario
        .aiding
        .rates()
        .map(|aid| aided(&scenario.aiding, aid))
        .collect();
    if !aids.is_empty() {
        facts.push(("aiding (1 σ)", aids.join("; ")));
    }
    if summary.runs > 0 {
        let worth = readable(summary.independent_runs);
        facts.push((
            "runs",
            format!(
                "{} ({} diverged), worth {worth} independent ones",
                summary.runs, summary.diverged
            ),
        ));
    }
    facts.extend(summary.seed.map(|seed| ("seed", seed.to_string())));
    facts
}

fn three(sigma: &[f64; 3]) -> String {
    sigma.map(readable).join(", ")
}

/// What the true IMU has beside its noise.
fn defects(imu: &ImuSettings) -> String {
    let [bias_a, bias_g] = Sensor::ALL.map(|sensor| readable(imu.deviations(sensor).0));
    let [ppm_a, ppm_g] = Sensor::ALL.map(|sensor| readable(imu.deviations(sensor).1));
    let mut facts = vec![
        format!("{} Hz", imu.rate_hz),
        format!("1 σ: turn-on bias {bias_a} m/s², {bias_g} rad/s"),
        format!("scale factors {ppm_a}, {ppm_g} ppm"),
    ];
    let of = |defect: Defect| format!("{} {} {}", defect.key, readable(defect.sigma), defect.unit);
    facts.extend(imu.without_states().map(of));
    facts.extend(
        imu.output
            .as_ref()
            .map(|_| "samples of a range and a resolution".to_owned()),
    );
    facts.join("; ")
}

/// `nhc 0.2 m/s at 1 Hz`
fn aided(aiding: &AidingSettings, (aid, rate_hz): (Aid, f64)) -> String {
    let [sigma, _] = aiding.sigmas(aid);
    let (sigma, unit) = if aid == Aid::Heading {
        (sigma / DEG, "°")
    } else {
        (sigma, "m/s")
    };
    format!("{} {} {unit} at {rate_hz} Hz", aid.name(), readable(sigma))
}

fn receiver(gnss: &GnssSettings) -> String {
    let velocity = gnss.vel_sigma_m_s.map_or("no velocity".to_owned(), |v| {
        format!("velocity {} m/s", three(&v))
    });
    let position = three(&gnss.pos_sigma_m);
    let mut words = format!(
        "{} Hz; 1 σ north, east, down: position {position} m, {velocity}",
        gnss.rate_hz
    );
    if gnss.correlated_pos_sigma_m.iter().any(|sigma| *sigma > 0.0) {
        let (sigma, time) = (
            three(&gnss.correlated_pos_sigma_m),
            readable(gnss.correlation_time_s),
        );
        words +=
            &format!("; in truth a correlated position error of {sigma} m over {time} s beside it");
    }
    if gnss.lever_arm_m.iter().any(|x| *x != 0.0) {
        words += &format!(
            "; antenna {} m front, right, down of the IMU",
            three(&gnss.lever_arm_m)
        );
    }
    words
}

/// What the filter knows at the start.
fn start(initial: &InitialSettings) -> String {
    if initial.perfect {
        return "the true state".to_owned();
    }
    format!(
        "position {} m, velocity {} m/s, attitude {} °",
        three(&initial.pos_sigma_m),
        three(&initial.vel_sigma_m_s),
        three(&initial.att_sigma_deg)
    )
}

// The sources of errors on the page of a run directory.

/// What the errors at the ends of the outages that are shown are made of, beside what the filter believes.
pub(super) fn budgets(summary: &Summary, shown: &[usize], page: &mut Document) {
    let kinds = |o: &'_ OutageSummary| {
        [
            ("true errors", o.budget.clone(), "budget"),
            (
                "what the filter believes",
                o.believed_budget.clone(),
                "believed_budget",
            ),
        ]
    };
    let mut bars: Vec<(String, Budget)> = Vec::new();
    for i in shown {
        let o = &summary.outages[*i];
        let word = |kind: &str| {
            if kind == "true errors" {
                "true"
            } else {
                "believed"
            }
        };
        let known = kinds(o).into_iter().filter_map(|(kind, budget, _)| {
            Some((
                format!("{}, {}", window(o.start_s, o.end_s), word(kind)),
                budget?,
            ))
        });
        bars.extend(known);
    }
    if bars.is_empty() {
        return;
    }
    page.section("Sources of errors");
    page.chart(&budget_chart(&bars), "Shares in the mean square at the end of each outage: of the true errors, by covariance analysis, and of those that the filter believes in.");
    for i in shown {
        let o = &summary.outages[*i];
        for (kind, budget, key) in kinds(o) {
            let Some(budget) = budget else { continue };
            let title = format!(
                "Sources of errors at the end of {}: {kind} (shares)",
                window(o.start_s, o.end_s)
            );
            let table = budget_table(&budget, &format!("/outages/{i}/{key}"));
            page.folded(&title, |page| page.table(&table));
        }
    }
}

fn budget_table(budget: &Budget, place: &str) -> Table {
    let names = STATES
        .iter()
        .map(|state| state.split(" (").next().unwrap_or(state).to_owned());
    let mut table = Table::new(["source"]).and(names);
    for (source, shares) in &budget.shares {
        let key = source.replace('~', "~0").replace('/', "~1");
        let cell =
            |(share, state): (&f64, &&str)| Cell::number(*share, &format!("{place}/{key}/{state}"));
        table.row(
            std::iter::once(Cell::from(source.clone()))
                .chain(shares.0.iter().zip(&REPORTED_NAMES).map(cell)),
        );
    }
    table
}

// The figures of a run.

/// The outages (start, end) (s).
pub(super) fn windows(summary: &Summary) -> Vec<(f64, f64)> {
    summary
        .outages
        .iter()
        .map(|o| (o.start_s, o.end_s))
        .collect()
}

fn over_time(epochs: &[EpochMetrics], value: impl Fn(&EpochMetrics) -> f64) -> Vec<(f64, f64)> {
    epochs.iter().map(|e| (e.t_s, value(e))).collect()
}

pub(super) fn horizontal(epochs: &[EpochMetrics], summary: &Summary) -> Chart {
    let rmse = over_time(epochs, |e| e.rmse.0[0].value.hypot(e.rmse.0[1].value));
    let believed = over_time(epochs, |e| e.asee.0[0].value.hypot(e.asee.0[1].value));
    let three = believed
        .iter()
        .map(|(t, sigma)| (*t, *sigma, 3.0 * sigma))
        .collect();
    let end = |o: &OutageSummary| {
        let h = &o.horizontal_error_end_m;
        Interval {
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
            if summary.runs > 0 {
                "median and 95 % of runs"
            } else {
                "median and 95 %"
            },
            Colour::Ink,
            Mark::Points(summary.outages.iter().map(end).collect()),
        ),
    ];
    let panel = Panel {
        height: 1.2,
        ..Panel::new(Axis::log("horizontal error (m)"), series)
    };
    timed("Horizontal position error", panel, &windows(summary))
}

/// What stands beneath the horizontal error.
pub(super) const fn horizontal_caption(summary: &Summary) -> &'static str {
    if summary.runs > 0 {
        "Horizontal RMSE of the runs, and what the filter believes: its own standard deviation (ASEE, north and east together) \
         and the range up to three times that. Dots: median of the runs at the end of an outage, the bar up to their 95 % \
         quantile."
    } else {
        "Horizontal RMSE by covariance analysis, and what the filter believes: its own standard deviation (ASEE, north and east \
         together) and the range up to three times that. Dots: median at the end of an outage, the bar up to the 95 % quantile."
    }
}

/// What ASEE and RMSE are, where they are shown.
pub(super) const fn rmse_and_asee(summary: &Summary) -> &'static str {
    if summary.runs > 0 {
        "RMSE: how wrong the runs were. ASEE (averaged standard estimation error): the filter's own standard deviation, averaged \
         over the runs. Their ratio is 1 if the filter is right."
    } else {
        "RMSE: how wrong the filter is, by covariance analysis. ASEE (averaged standard estimation error): its own standard \
         deviation. Their ratio is 1 if the filter is right."
    }
}

/// Quantiles of the horizontal error over time, those of a covariance analysis beside the runs dashed.
pub(super) fn fan_chart(fan: &[FanEpoch], summary: &Summary) -> Chart {
    let between = |low: usize, high: usize| -> Vec<(f64, f64, f64)> {
        fan.iter()
            .map(|e| (e.t_s, e.quantiles_m[low], e.quantiles_m[high]))
            .collect()
    };
    let median = fan.iter().map(|e| (e.t_s, e.quantiles_m[2])).collect();
    let mut series = vec![
        Series::new("5 to 95 %", Colour::REAL, Mark::Band(between(0, 4))),
        Series::new("25 to 75 %", Colour::REAL, Mark::InnerBand(between(1, 3))),
        Series::line("median", Colour::REAL, median),
    ];
    if fan.iter().any(|e| e.lincov_m.is_some()) {
        let expected = |i: usize| {
            fan.iter()
                .filter_map(|e| Some((e.t_s, e.lincov_m?[i])))
                .collect()
        };
        // the outermost and the median: five more lines would hide the bands
        series.extend(
            [0, 2, 4].map(|i| Series::dashed("covariance analysis", Colour::BELIEVED, expected(i))),
        );
    }
    let panel = Panel::new(Axis::log("horizontal error (m)"), series);
    timed(
        "Percentiles of the horizontal position error",
        panel,
        &windows(summary),
    )
}

fn timed(title: &str, panel: Panel, outages: &[(f64, f64)]) -> Chart {
    Chart::new(title, Axis::linear("time (s)"), vec![panel])
        .with_outages(outages)
        .in_group("time")
}

/// Every state: what the filter believes and how wrong it is.
pub(super) fn states(epochs: &[EpochMetrics], outages: &[(f64, f64)]) -> Vec<Chart> {
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
        timed(&error_of(state), Panel::new(Axis::log(""), series), outages).small()
    };
    STATES.iter().enumerate().map(chart).collect()
}

pub(super) fn nees(epochs: &[EpochMetrics], summary: &Summary) -> Chart {
    // of expected values there is no scatter, and no band for it
    let zone = |low: f64, high: f64| {
        let zone = Series::new(
            "95 % band of a right filter",
            Colour::RIGHT,
            Mark::Zone(low, high),
        );
        (summary.runs > 0).then_some(zone)
    };
    let beside = |zone: Option<Series>, line: Series| zone.into_iter().chain([line]).collect();
    let nees = beside(
        zone(summary.nees.lower95, summary.nees.upper95),
        Series::line("NEES", Colour::Ink, over_time(epochs, |e| e.nees.value)),
    );
    let coverage = beside(
        zone(summary.coverage.lower95, summary.coverage.upper95),
        Series::line("coverage", Colour::Ink, over_time(epochs, |e| e.coverage)),
    );
    let title = format!("coverage at level {}", summary.coverage.level);
    let panels = vec![
        Panel::new(
            Axis::log(&format!("NEES ({} if right)", summary.nees.dof)),
            nees,
        ),
        Panel {
            height: 0.6,
            ..Panel::new(Axis::linear(&title).including(0.8, 1.0), coverage)
        },
    ];
    Chart::new("Consistency", Axis::linear("time (s)"), panels)
        .with_outages(&windows(summary))
        .in_group("time")
}

/// Sources with a colour of their own.
const SOURCES_DRAWN: usize = 7;

/// A bar an outage and kind, for horizontal position and for yaw.
pub(super) fn budget_chart(bars: &[(String, Budget)]) -> Chart {
    let mut weight: Vec<(&str, f64)> = Vec::new();
    for (source, share) in bars
        .iter()
        .flat_map(|(_, b)| b.ranked(&[0, 1]).into_iter().chain(b.ranked(&[8])))
    {
        match weight.iter_mut().find(|(name, _)| *name == source) {
            Some((_, sum)) => *sum += share,
            None => weight.push((source, share)),
        }
    }
    weight.sort_by(|a, b| b.1.total_cmp(&a.1));
    let named: Vec<&str> = weight
        .iter()
        .take(SOURCES_DRAWN)
        .map(|(name, _)| *name)
        .collect();
    let panel = |label: &str, states: &[usize]| {
        let mut series: Vec<Vec<(f64, f64, f64)>> = vec![Vec::new(); named.len() + 1];
        for (x, (_, budget)) in bars.iter().enumerate() {
            let ranked = budget.ranked(states);
            let share = |name: &str| {
                100.0
                    * ranked
                        .iter()
                        .find(|(source, _)| *source == name)
                        .map_or(0.0, |r| r.1)
            };
            let mut from = 0.0;
            for (k, name) in named.iter().enumerate() {
                series[k].push((x as f64, from, from + share(name)));
                from += share(name);
            }
            series[named.len()].push((x as f64, from, 100.0_f64.max(from)));
        }
        let others = (weight.len() > SOURCES_DRAWN).then_some(("others", Colour::Soft));
        let names = named
            .iter()
            .enumerate()
            .map(|(k, name)| (*name, Colour::Hue(k)))
            .chain(others);
        let series = names
            .zip(series)
            .map(|((name, colour), bars)| Series::new(name, colour, Mark::Bars(bars)));
        Panel {
            height: 0.8,
            ..Panel::new(Axis::linear(label).including(0.0, 100.0), series.collect())
        }
    };
    let names = bars.iter().map(|(name, _)| name.clone()).collect();
    Chart::new(
        "Sources of errors",
        Axis::names(names),
        vec![
            panel("horizontal position (%)", &[0, 1]),
            panel("yaw (%)", &[8]),
        ],
    )
}

// What helps a filter that is overconfident.

const TOO_LARGE: &str =
    "errors too large for a linear filter; another MODEL or nav-sim tune does not help";

/// The same, with the update that helps: where errors are too large after fixes that follow an outage, not before them.
fn too_large(summary: &Summary, answer: &RunAnswer) -> String {
    let verdict = &summary.verdict;
    let is_after = |first: usize| {
        let is_met_again = summary.outages[first].reconvergence_s.p50.is_finite();
        is_met_again && verdict.worst_outage.is_none_or(|outage| outage > first)
    };
    let is_linear = answer.origin.configuration.filter.update == FixUpdate::Ekf;
    match is_linear && verdict.beyond_linear.is_some_and(is_after) {
        true => format!("{TOO_LARGE}; filter.update = \"iterated\" does"),
        false => TOO_LARGE.to_owned(),
    }
}

/// What helps: by what the belief lacks, where linear analysis finds the filter wrong already; errors that are large are then
/// its consequence.
pub(super) fn remedy(summary: &Summary, unexpected: &[Unexpected], answer: &RunAnswer) -> String {
    let quality = summary
        .reduction
        .as_ref()
        .and_then(|reduction| reduction.quality.as_ref());
    let ratios = quality.into_iter().flat_map(|q| {
        q.outage_end
            .iter()
            .chain([&q.mean])
            .flat_map(|state| state.0)
    });
    if summary.is_contradicted {
        return too_large(summary, answer);
    }
    if let Some(largest) = largest_unexpected(summary, unexpected) {
        return largest;
    }
    let is_too_large = summary.verdict.beyond_linear.is_some();
    let [is_recorded, is_modelled] = ["static", "truth"].map(|role| answer.has_input(role));
    // what recordings contain is unknown, and so is whether linear analysis would find the filter wrong
    if is_recorded && is_too_large {
        return too_large(summary, answer);
    }
    // where the reduced filter is right about the errors of its own model, the errors are of something else
    if ratios.fold(0.0, f64::max) > 1.0 + summary.verdict.tolerance {
        return "--filter full has a state for each process of the model".to_owned();
    }
    if is_recorded || is_modelled {
        return "the errors are not those of MODEL: nav-sim tune finds variances that cover them"
            .to_owned();
    }
    // linear analysis, which draws nothing, finds the filter wrong already: it has no state for one of the errors
    let is_expected = summary.method == Method::Lincov.name();
    let is_analysed =
        is_expected || summary.verdict.by_covariance_analysis == Some(VerdictKind::Overconfident);
    match unexpected.first() {
        Some(found) if is_analysed => unexpected_line(found),
        None if is_expected && !is_too_large => beside_the_states(summary).to_owned(),
        _ => too_large(summary, answer),
    }
}

/// What covers an error that is in the budgets and that no state of the filter is for.
fn beside_the_states(summary: &Summary) -> &'static str {
    let sources = summary
        .outages
        .iter()
        .filter_map(|o| o.budget.as_ref())
        .flat_map(|budget| &budget.shares);
    let no_filter_has = |name: &String| name.contains(".QN") || name.contains(".MA1");
    if sources.map(|(name, _)| name).any(no_filter_has) {
        return "MODEL has noise that no filter contains: nav-sim tune --truth MODEL covers it";
    }
    "the errors are not those of MODEL: nav-sim tune --scenario finds variances that cover them"
}

/// The source with the largest share of the worst error, of those that the filter does not expect, where it makes at least
/// half of what is too much there; without an outage, which has the shares, the first.
fn largest_unexpected(summary: &Summary, unexpected: &[Unexpected]) -> Option<String> {
    let verdict = &summary.verdict;
    let outage = verdict
        .worst_outage
        .or_else(|| summary.outages.len().checked_sub(1));
    let known =
        outage.and_then(|k| Some((&summary.outages[k], summary.outages[k].budget.as_ref()?)));
    let Some((outage, budget)) = known else {
        return unexpected.first().map(unexpected_line);
    };
    let worst = REPORTED_NAMES
        .iter()
        .position(|name| *name == verdict.worst_state);
    // the state, and the share in its mean square
    let share = |cause: &Unexpected| {
        let sources = cause.sources();
        let of_cause = budget
            .shares
            .iter()
            .filter(|(name, _)| sources.contains(name));
        let shares = of_cause.fold([0.0; REPORTED], |sum, (_, of)| {
            std::array::from_fn(|i| sum[i] + of.0[i])
        });
        let states = worst.map_or(0..REPORTED, |state| state..state + 1);
        states
            .map(|state| (state, shares[state]))
            .max_by(|a, b| a.1.total_cmp(&b.1))
    };
    let shares = unexpected
        .iter()
        .filter_map(|cause| Some((cause, share(cause)?)));
    let (largest, (state, share)) = shares.max_by(|a, b| a.1.1.total_cmp(&b.1.1))?;
    // of a mean square that is ratio² times what is believed, this share is too much
    let excess = 1.0 - verdict.ratio.powi(-2);
    let place = format!(
        "{} at the end of {}",
        REPORTED_NAMES[state],
        window(outage.start_s, outage.end_s)
    );
    let told = || {
        let (what, remedy) = unexpected_in_words(largest);
        format!(
            "{what} ({:.0} % of the mean square of {place}): {remedy}",
            100.0 * share
        )
    };
    (share > 0.5 * excess).then(told)
}
