//! The page of a run directory.

use super::run_budgets::budgets;
use super::run_charts::{fan_chart, horizontal, horizontal_caption, nees, rmse_and_asee, states, windows};
use super::{STATES, sentence, tone, window};
use crate::report::manifest::Manifest;
use crate::report::number::readable;
use crate::report::page::{Cell, Page, Table, Tone};
use crate::report::requirement::requirement_line;
use crate::report::trajectory::TrajectorySeries;
use crate::report::verdict::verdict_lines;
use nav_sim_navigation::ekf::InitialSettings;
use nav_sim_navigation::metrics::{EpochMetrics, FanEpoch, Met, PerState, Summary};
use nav_sim_navigation::sensors::defects::ImuSettings;
use nav_sim_navigation::sensors::gnss::GnssSettings;
use nav_sim_navigation::simulation::REPORTED_NAMES;
use nav_sim_signal::imu::Sensor;

/// Outages whose tables are shown: of more, those with the largest errors.
const OUTAGES: usize = 3;

/// The page of a run directory.
pub(crate) fn run_page(
    epochs: &[EpochMetrics],
    fan: &[FanEpoch],
    summary: &Summary,
    manifest: &Manifest,
    track: &TrajectorySeries,
) -> String {
    let windows = windows(summary);
    let verdict = verdict_lines(summary).join(". ");
    let title = if summary.runs > 0 { "INS/GNSS Monte-Carlo run" } else { "INS/GNSS covariance analysis" };
    let (kept, missed): (Vec<&Met>, Vec<&Met>) = summary.require.iter().partition(|met| met.met);
    let line = |met: &Met| sentence(&requirement_line(met, summary));
    // What the command ends with is what the reader asked for: it comes before the filter.
    let missed_lines: String = missed.iter().map(|met| format!("{} ", line(met))).collect();
    let tone = if missed.is_empty() { tone(summary.verdict.kind) } else { Tone::Bad };
    let mut page = Page::new(title, tone, [format!("{missed_lines}{}", sentence(&verdict))]);
    kept.into_iter().for_each(|met| page.text(&line(met)));
    page.facts(&assumptions(summary, manifest));
    page.chart(&track.map("Reference trajectory", &windows), "");
    page.chart(&horizontal(epochs, summary), horizontal_caption(summary));
    page.chart(&fan_chart(fan, summary), &fan_caption(fan, summary));
    outages(summary, &mut page);
    page.section("Errors over time");
    page.charts(&states(epochs, &windows), rmse_and_asee(summary));
    consistency(epochs, summary, &mut page);
    budgets(summary, &largest(summary), &mut page);
    provenance(manifest, &mut page);
    page.checked(
        "the filter's standard deviations to 2e-4 of an independent implementation, relative (tests/truth/covariance_truth.rs); \
         NEES of filters whose model is right by chi-square at p = 0.001, and that wrong models show \
         (tests/truth/consistency.rs).",
    );
    page.html()
}

/// A table of figures, of which a covariance analysis does not have all: no draw, hence no interval.
fn known(table: Table, summary: &Summary) -> Table {
    if summary.runs > 0 { table } else { table.without_unknown() }
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

/// What the results rest on.
fn assumptions(summary: &Summary, manifest: &Manifest) -> Vec<(&'static str, String)> {
    let input = |role: &str| manifest.inputs.iter().find(|i| i.role == role).map_or("", |i| i.path.as_str());
    let truth = match (input("static"), input("truth")) {
        ("", "") => format!("{} (the model of the filter)", input("model")),
        ("", model) => model.to_owned(),
        (recording, _) => format!("windows of {recording}"),
    };
    let scenario = &manifest.configuration;
    let mut facts = vec![
        ("trajectory", input("trajectory").to_owned()),
        ("model of the filter", format!("{}, {} states", input("model"), summary.filter_states)),
        ("what makes the errors", truth),
        ("IMU", defects(&scenario.imu)),
        ("GNSS", receiver(&scenario.gnss)),
        ("start (1 σ)", start(&scenario.initial)),
    ];
    if let Some(baro) = &scenario.baro {
        facts.push(("barometer", format!("{} Hz; 1 σ {} m", baro.rate_hz, readable(baro.sigma_m))));
    }
    if summary.runs > 0 {
        let worth = readable(summary.independent_runs);
        facts.push((
            "runs",
            format!("{} ({} diverged), worth {worth} independent ones", summary.runs, summary.diverged),
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
    format!(
        "{} Hz; turn-on bias {bias_a} m/s², {bias_g} rad/s (1 σ); scale factors {}, {} ppm; misalignment {} rad",
        imu.rate_hz,
        readable(imu.scale_ppm_accel),
        readable(imu.scale_ppm_gyro),
        readable(imu.misalignment_rad)
    )
}

fn receiver(gnss: &GnssSettings) -> String {
    let velocity =
        gnss.vel_sigma_m_s.map_or("no velocity".to_owned(), |v| format!("velocity {} m/s", three(&v)));
    let position = three(&gnss.pos_sigma_m);
    let mut words = format!("{} Hz; 1 σ north, east, down: position {position} m, {velocity}", gnss.rate_hz);
    if gnss.correlated_pos_sigma_m.iter().any(|sigma| *sigma > 0.0) {
        let (sigma, time) = (three(&gnss.correlated_pos_sigma_m), readable(gnss.correlation_time_s));
        words += &format!("; in truth a correlated position error of {sigma} m over {time} s beside it");
    }
    if gnss.lever_arm_m.iter().any(|x| *x != 0.0) {
        words += &format!("; antenna {} m front, right, down of the IMU", three(&gnss.lever_arm_m));
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

/// Positions of the outages with the largest errors, in time order.
fn largest(summary: &Summary) -> Vec<usize> {
    let error = |i: &usize| summary.outages[*i].rmse_end.0[0].hypot(summary.outages[*i].rmse_end.0[1]);
    let mut all: Vec<usize> = (0..summary.outages.len()).collect();
    all.sort_by(|a, b| error(b).total_cmp(&error(a)));
    all.truncate(OUTAGES);
    all.sort_unstable();
    all
}

fn outages(summary: &Summary, page: &mut Page) {
    if summary.outages.is_empty() {
        page.section("Accuracy over the run");
        let a = &summary.accuracy;
        page.table(&pairs(&[("mean", "/accuracy".to_owned(), &a.rmse_mean, &a.asee_mean)], "mean"));
        return;
    }
    page.section("At the ends of outages");
    let has_intervals = summary.runs > 0
        || summary.outages.iter().any(|o| {
            let h = &o.horizontal_error_end_m;
            [h.p50_ci95, h.p95_ci95].iter().any(|ci| ci.0.is_some())
        });
    let brackets = if has_intervals { "; brackets are 95 % intervals" } else { "" };
    page.text(&format!("Just before the first fix after the outage{brackets}."));
    page.table(&known(ends(summary), summary));
    by_state(summary, page);
}

/// Horizontal errors at the ends of outages, and how soon fixes mend them.
fn ends(summary: &Summary) -> Table {
    let is_expected = summary.outages.iter().any(|o| o.horizontal_error_end_m.p999.is_some());
    let (last, key) = if is_expected { ("99.9 % (m)", "p999") } else { ("largest (m)", "max") };
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
            window((o.start_s, o.end_s)).into(),
            Cell::number(h.p50, &source_of("horizontal_error_end_m/p50")),
            interval(h.p50_ci95),
            Cell::number(h.p95, &source_of("horizontal_error_end_m/p95")),
            interval(h.p95_ci95),
            Cell::number(h.p999.unwrap_or(h.max), &source_of(&format!("horizontal_error_end_m/{key}"))),
            Cell::number(o.reconvergence_s.p50, &source_of("reconvergence_s/p50")),
        ]);
    }
    table
}

/// State by state, the outages with the largest errors.
fn by_state(summary: &Summary, page: &mut Page) {
    let shown = largest(summary);
    let names: Vec<String> = shown.iter().map(|i| window(windows(summary)[*i])).collect();
    let table = |suffix: &str| {
        let errors_of_outage = |i: &usize| {
            let o = &summary.outages[*i];
            let (rmse, asee) =
                if suffix == "end" { (&o.rmse_end, &o.asee_end) } else { (&o.rmse_mean, &o.asee_mean) };
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
    let heads =
        columns.iter().flat_map(|(name, ..)| ["RMSE", "ASEE", "ratio"].map(|what| format!("{what}, {name}")));
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

fn consistency(epochs: &[EpochMetrics], summary: &Summary, page: &mut Page) {
    page.section("Consistency");
    let covered = if summary.runs > 0 { "share of runs" } else { "share of errors" };
    page.chart(
        &nees(epochs, summary),
        &format!(
            "NEES: normalised estimation error squared of position, velocity and attitude. Coverage: {covered} inside the filter's \
             ellipsoid of position and attitude."
        ),
    );
    let (nees, nis, coverage) = (&summary.nees, &summary.nis, &summary.coverage);
    let share = |x: f64| if x.is_finite() { format!("{:.0} %", x * 100.0) } else { "–".to_owned() };
    let mut table =
        Table::new(["", "mean", "if the filter is right", "95 % band from", "to", "epochs inside"]);
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
        (&all_fixes, "nis", nis.mean, nis.dof as f64, [nis.lower95, nis.upper95], f64::NAN),
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

fn provenance(manifest: &Manifest, page: &mut Page) {
    page.section("Provenance");
    // the command, the threads and the time taken are in manifest.json: this page is the same for the same seed
    page.text(&format!("nav-sim {}; the command is in manifest.json.", manifest.version));
    let mut table = Table::new(["input", "file", "BLAKE3"]);
    for i in &manifest.inputs {
        table.row([i.role.clone(), i.path.clone(), i.blake3.clone()].map(Cell::from));
    }
    page.table(&table);
    let configuration = toml::to_string_pretty(&manifest.configuration).unwrap_or_default();
    page.folded("Configuration", |page| page.code(&configuration));
}
