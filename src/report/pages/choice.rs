//! The page of a choice: scores of the candidates with their intervals, recording by recording, and what decides.

use super::sentence;
use crate::choose::{Influence, Mean, Placed, ScaleInfluence};
use crate::report::choose::ChoiceReport;
use crate::report::comparison::in_order;
use crate::report::page::{
    Axis, Cell, Chart, Colour, Interval, Mark, Page, Panel, Series, Stroke, Table, Tone,
};
use nav_sim_navigation::simulation::NEES_DOF;

/// The page.
pub(crate) fn choice_page(report: &ChoiceReport<'_>) -> Page {
    let placed = &report.ranking.candidates;
    let tone = if report.ranking.tells { Tone::Good } else { Tone::Doubtful };
    let mut verdict = report.verdict();
    let mut page = Page::new("Which noise model", tone, [sentence(&verdict.remove(0))]);
    verdict.iter().for_each(|line| page.text(&sentence(line)));
    page.facts(&[
        ("trajectory", report.trajectory.to_owned()),
        ("recordings", placed[0].folds.len().to_string()),
        ("seed", report.seed.to_string()),
    ]);
    page.section("Candidates");
    page.text(&sentence(&report.legend()));
    page.chart(&scores(placed), SCORE);
    page.chart(&honesty(placed), HONESTY);
    page.table(&Table::of_rows(&report.rows()));
    page.section("Recording by recording");
    page.text(
        "Each recording judges models of the others; NEES at the ends of outages, in brackets the mean log score (nats).",
    );
    page.chart(&folds(placed), "A recording whose points all stand high is described by no candidate.");
    page.table(&Table::of_rows(&report.fold_rows()));
    if let Some(influence) = report.influence {
        decides(&mut page, report, influence);
    }
    page
}

/// Which scales and recordings decide.
fn decides(page: &mut Page, report: &ChoiceReport<'_>, influence: &Influence) {
    page.section("What decides");
    report.decisive_scales().iter().for_each(|line| page.text(&sentence(line)));
    if !influence.scales.is_empty() {
        page.chart(&over_scales(&influence.scales), INFLUENCE);
    }
    page.text(
        "What the presence of each recording adds to the expected horizontal error at the end of an outage (%), to first order, \
         with each way of averaging:",
    );
    let mut table = Table::new(["recording", "awv", "sr-awv", "dr-awv"]);
    for (i, r) in influence.recordings.iter().enumerate() {
        let cell = |value: f64, key: &str| Cell::number(value, &format!("/influence/recordings/{i}/{key}"));
        table.row([
            r.recording.clone().into(),
            cell(r.awv_pct, "awv_pct"),
            cell(r.sr_awv_pct, "sr_awv_pct"),
            cell(r.dr_awv_pct, "dr_awv_pct"),
        ]);
    }
    page.table(&table);
}

const SCORE: &str = "Log score: the mean logarithm of the density of the true errors under the filter's belief, less that of the best; \
                     bars are 95 % intervals over recordings. Candidates whose bar reaches 0 are hardly told from the best.";
const HONESTY: &str = "NEES: the squared error in units of the filter's own covariance. Above 9 a filter is overconfident, below it \
                       timid. Horizontal error: what it is and what the filter believes.";
const INFLUENCE: &str = "Growth of the horizontal error at the ends of outages with the wavelet variance of each scale (% for 1 %): the fit \
                         passes a change of the curve on to the parameters, covariance analysis these to the error.";

fn names(placed: &[Placed]) -> Axis {
    Axis::names(placed.iter().map(|p| p.candidate.clone()).collect())
}

fn points(placed: &[Placed], value: impl Fn(&Placed) -> Mean, beside: f64) -> Vec<Interval> {
    let point = |(k, p): (usize, &Placed)| {
        let Mean { value, ci95: (low, high) } = value(p);
        Interval { x: k as f64 + beside, y: value, low, high }
    };
    placed.iter().enumerate().map(point).collect()
}

/// Log scores less that of the best.
fn scores(placed: &[Placed]) -> Chart {
    let series = vec![
        Series::new("", Colour::Soft, Mark::Level(0.0)),
        Series::new("", Colour::BELIEVED, Mark::Points(points(placed, |p| p.difference.log_score, 0.0))),
    ];
    Chart::new("Log score against the best", names(placed), vec![Panel::new(Axis::linear("nats"), series)])
}

/// NEES, and errors beside what is believed of them.
fn honesty(placed: &[Placed]) -> Chart {
    let right = NEES_DOF as f64;
    let nees = vec![
        Series::new("right", Colour::RIGHT, Mark::Level(right)),
        Series::new("NEES", Colour::Ink, Mark::Points(points(placed, |p| p.nees, 0.0))),
    ];
    let alone = |value: f64| Mean { value, ci95: (f64::NAN, f64::NAN) };
    let errors = vec![
        Series::new("true RMSE", Colour::REAL, Mark::Points(points(placed, |p| alone(p.rmse_m), -0.1))),
        Series::new("believed", Colour::BELIEVED, Mark::Points(points(placed, |p| alone(p.believed_m), 0.1))),
    ];
    let panels =
        vec![Panel::new(Axis::log("NEES"), nees), Panel::new(Axis::log("horizontal error (m)"), errors)];
    Chart::new("Honesty and accuracy at the ends of outages", names(placed), panels)
}

/// NEES of each candidate on each recording.
fn folds(placed: &[Placed]) -> Chart {
    let recordings = placed[0].folds.iter().map(|fold| fold.recording.clone()).collect();
    let mut series = vec![Series::new("right", Colour::RIGHT, Mark::Level(NEES_DOF as f64))];
    for (hue, p) in placed.iter().enumerate() {
        let beside = 0.6 * ((hue as f64 + 0.5) / placed.len() as f64 - 0.5);
        let point = |(k, fold): (usize, &crate::choose::FoldScore)| {
            let (x, y) = (k as f64 + beside, fold.score.nees);
            Interval { x, y, low: f64::NAN, high: f64::NAN }
        };
        let points = p.folds.iter().enumerate().map(point).collect();
        series.push(Series::new(&p.candidate, Colour::Hue(hue), Mark::Points(points)));
    }
    let panel = Panel::new(Axis::log("NEES"), series);
    Chart::new("NEES on the recording left out", Axis::names(recordings), vec![panel])
}

/// Influence over scales, a line a sensor or axis.
fn over_scales(scales: &[ScaleInfluence]) -> Chart {
    let signals = in_order(scales.iter().map(|s| s.signals.as_str()));
    let mut series = vec![Series::new("", Colour::Soft, Mark::Level(0.0))];
    series.extend(signals.iter().enumerate().map(|(hue, name)| {
        let of_signals = scales.iter().filter(|s| s.signals == **name);
        let line = of_signals.map(|s| (s.tau_s, s.on_error)).collect();
        Series::new(name, Colour::Hue(hue), Mark::Line(line, Stroke::Plain))
    }));
    let panel = Panel::new(Axis::linear("% of error for 1 %"), series);
    Chart::new("Influence of the wavelet variance", Axis::log("scale (s)"), vec![panel])
}
