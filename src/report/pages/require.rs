//! Pages of `require`: the IMU that a limit needs, what a given one makes of it, a ranking.

use super::sentence;
use crate::report::page::{Axis, Cell, Chart, Colour, Mark, Page, Panel, Series, Table, Tone};
use crate::report::require::{
    Bridged, CURVE_S, GivenImu, NeededImu, Question, RULE, RankedUnit, catalogue_beyond_linear,
    catalogue_rows, parts_in_words, quantity_in_words, what_decides,
};
use nav_sim_navigation::require::{Answer, IMU_PARAMETERS, ImuParameters, Margins, Quantity};

const CHECKED: &str = "the IMU that a limit needs meets it in sampled runs, and a larger error of the IMU never makes a smaller one of \
                       navigation (tests/truth/require.rs).";
const DRIFT: &str = "The error at the end of an outage against its length, at the worst of the places; the limit is the level line.";

/// The page of the IMU that is needed.
pub(crate) fn needed_page(needed: &NeededImu, question: &Question) -> Page {
    let mut page = Page::new("The IMU that a limit needs", Tone::Good, [sentence(&needed.verdict(question))]);
    page.section("Figures, at most");
    page.text(
        "Allocated: with equal shares of what GNSS and start leave. If alone: if there were no other error of the IMU. Others 10 × \
         better: if every other figure were ten times smaller.",
    );
    page.table(&figures(needed));
    page.chart(&shares(needed), "Parts of the variance at the limit, with the allocated figures.");
    if let Some(curve) = &needed.iso_drift {
        page.section("Equal drift");
        page.text(&sentence(&needed.iso_drift_in_words()));
        page.chart(&iso_drift(&curve.points), ISO_DRIFT);
        page.table(&iso_table(&curve.points));
    }
    page.checked(CHECKED);
    page
}

const ISO_DRIFT: &str =
    "Every point of the curve keeps the limit exactly; what is below and left of it keeps it with room.";

fn figures(needed: &NeededImu) -> Table {
    let mut table = Table::new(["figure", "allocated", "share", "if alone", "others 10 × better"]);
    for i in 0..IMU_PARAMETERS {
        let source_of = |key: &str| format!("/figures/{i}/{key}");
        table.row([
            ImuParameters::NAMES[i].into(),
            Cell::number(ImuParameters::in_datasheets(i, needed.imu.values[i]), &source_of("allocated")),
            Cell::share(needed.shares[i], &source_of("share")),
            answer(i, &needed.alone[i], &source_of("alone")),
            answer(i, &needed.others_better[i], &source_of("others_10_times_better")),
        ]);
    }
    table.row([
        "GNSS and start".into(),
        Cell::figures(""),
        Cell::share(needed.shares[IMU_PARAMETERS], "/share_of_gnss_and_start"),
        Cell::figures(""),
        Cell::figures(""),
    ]);
    table
}

fn answer(which: usize, found: &Answer, source: &str) -> Cell {
    match found {
        Answer::AtMost(value) => Cell::number(ImuParameters::in_datasheets(which, *value), source),
        Answer::Any => Cell::figures("any"),
        Answer::Never => Cell::figures("–"),
    }
}

fn shares(needed: &NeededImu) -> Chart {
    let names = ImuParameters::NAMES.map(|name| name.split(" (").next().unwrap_or(name).to_owned());
    let names = names.into_iter().chain(["GNSS and start".to_owned()]).collect();
    let bars = needed.shares.iter().enumerate().map(|(k, share)| (k as f64, 0.0, 100.0 * share)).collect();
    let series = vec![Series::new("", Colour::BELIEVED, Mark::Bars(bars))];
    let panel = Panel { height: 0.7, ..Panel::new(Axis::linear("share of the variance (%)"), series) };
    Chart::new("What makes the error", Axis::names(names), vec![panel])
}

fn iso_drift(points: &[(f64, Answer)]) -> Chart {
    let point = |(bias, walk): &(f64, Answer)| match walk {
        Answer::AtMost(walk) => {
            Some((ImuParameters::in_datasheets(3, *bias), ImuParameters::in_datasheets(0, *walk)))
        }
        Answer::Any | Answer::Never => None,
    };
    let line: Vec<(f64, f64)> = points.iter().filter_map(point).collect();
    let series = Series::dotted_line("limit kept exactly", Colour::REAL, line).into();
    let panel = Panel::new(Axis::log(ImuParameters::NAMES[0]), series);
    Chart::new("IMUs of equal drift", Axis::log(ImuParameters::NAMES[3]), vec![panel])
}

fn iso_table(points: &[(f64, Answer)]) -> Table {
    let mut table = Table::new([ImuParameters::NAMES[3], ImuParameters::NAMES[0]]);
    for (k, (bias, walk)) in points.iter().enumerate() {
        table.row([
            Cell::number(ImuParameters::in_datasheets(3, *bias), &format!("/iso_drift/{k}/0")),
            answer(0, walk, &format!("/iso_drift/{k}/1")),
        ]);
    }
    table
}

/// The page of what a given IMU makes of the limits; without margins, of the longest outage that it bridges.
pub(crate) fn model_page(judged: &GivenImu) -> Page {
    let GivenImu { margins, question, bridged, .. } = judged;
    let mut page =
        Page::new("An IMU against its limits", Tone::from(judged.is_good()), [sentence(&judged.verdict())]);
    page.section("Error against the length of an outage");
    for (i, limit) in question.limits.iter().enumerate() {
        let Some(curve) = bridged.curves.get(i) else { continue };
        let mut series = vec![Series::new("limit", Colour::RIGHT, Mark::Level(limit.most))];
        series.extend(Series::dotted_line("this IMU", Colour::REAL, points(curve)));
        page.chart(&drift_chart(limit.quantity, series), DRIFT);
    }
    page.table(&drift_table(question, bridged));
    if let Some(margins) = margins {
        page.section("What decides, and what is slack");
        page.table(&parts(margins));
        page.text(&sentence(&what_decides(margins, question)));
    }
    page.checked(CHECKED);
    page
}

fn drift_table(question: &Question, bridged: &Bridged) -> Table {
    let names = question.limits.iter().map(|l| quantity_in_words(l.quantity).to_owned());
    let mut table = Table::new(["outage (s)"]).and(names);
    for (k, length_s) in CURVE_S.iter().enumerate() {
        let cell = |(i, curve): (usize, &[Option<f64>; CURVE_S.len()])| {
            value(curve[k], &format!("/curves/{i}/points/{k}/value"))
        };
        let first = Cell::figures(length_s.to_string());
        table.row(std::iter::once(first).chain(bridged.curves.iter().enumerate().map(cell)));
    }
    table
}

/// Shares of the error, and the factor on each part that alone meets the limit.
fn parts(margins: &Margins) -> Table {
    let mut table = Table::new(["part of the error", "share", "factor on its σ that alone meets the limit"]);
    for (i, (name, p, factor)) in parts_in_words(margins).enumerate() {
        let number = |factor| Cell::number(factor, &format!("/parts/{i}/factor"));
        let share = Cell::share(p.share, &format!("/parts/{i}/share"));
        table.row([name.into(), share, p.factor.map_or_else(|| Cell::figures(factor), number)]);
    }
    table
}

/// The page of a ranking.
pub(crate) fn catalogue_page(units: &[RankedUnit], question: &Question) -> Page {
    let met: Vec<&str> = units.iter().filter(|u| u.is_met()).map(|u| u.name.as_str()).collect();
    let verdict = match met.as_slice() {
        [] => format!("No unit keeps the limits by figures that are all stated: {}.", question.in_words()),
        [best, ..] => {
            format!(
                "{} of {} units keep {}; the best is {best}.",
                met.len(),
                units.len(),
                question.in_words()
            )
        }
    };
    let mut page = Page::new("IMUs against a limit", Tone::from(!met.is_empty()), [verdict]);
    page.section("Error against the length of an outage");
    page.chart(&drift_chart(question.curve_of(), unit_curves(units, question)), DRIFT);
    page.section("Ranking");
    let mut rows = catalogue_rows(units);
    // the errors are in the table below, with all their sources
    rows.iter_mut().for_each(|row| drop(row.drain(3..3 + CURVE_S.len())));
    page.table(&Table::of_rows(&rows));
    if let Some(line) = catalogue_beyond_linear(units) {
        page.text(&sentence(&line));
    }
    if units.iter().any(|unit| !unit.not_stated.is_empty()) {
        page.text("Figures that are not stated count as none: such a unit looks better than it is (open).");
        page.text(&sentence(RULE.join(" ").trim_end_matches('.')));
    }
    page.heading(&format!("Error after an outage: {}", quantity_in_words(question.curve_of())));
    let mut table = Table::new(["unit"]).and(CURVE_S.iter().map(|s| format!("after {s} s")));
    for (i, unit) in units.iter().enumerate() {
        let cell = |(k, x): (usize, &Option<f64>)| value(*x, &format!("/units/{i}/curve/{k}/value"));
        table.row(std::iter::once(unit.name.clone().into()).chain(unit.curve.iter().enumerate().map(cell)));
    }
    page.table(&table);
    page.checked(CHECKED);
    page
}

/// Units beyond so many are drawn grey: more hues cannot be told apart.
const COLOURED: usize = 6;

fn unit_curves(units: &[RankedUnit], question: &Question) -> Vec<Series> {
    let limit = Series::new("limit", Colour::Ink, Mark::Level(question.limits[0].most));
    let curve = |(k, unit): (usize, &RankedUnit)| {
        if k < COLOURED {
            Series::line(&unit.name, Colour::Hue(k), points(&unit.curve))
        } else {
            Series::thin("others", Colour::Soft, points(&unit.curve))
        }
    };
    let mut curves: Vec<Series> = units.iter().enumerate().map(curve).collect();
    // what stands behind is drawn first
    curves.reverse();
    curves.insert(0, limit);
    curves
}

fn drift_chart(quantity: Quantity, series: Vec<Series>) -> Chart {
    let panel = Panel { height: 1.3, ..Panel::new(Axis::log(quantity_in_words(quantity)), series) };
    Chart::new("Drift without fixes", Axis::log("length of the outage (s)"), vec![panel])
}

fn points(curve: &[Option<f64>; CURVE_S.len()]) -> Vec<(f64, f64)> {
    CURVE_S.iter().zip(curve).map(|(s, x)| (f64::from(*s), x.unwrap_or(f64::NAN))).collect()
}

fn value(x: Option<f64>, source: &str) -> Cell {
    x.map_or_else(|| Cell::figures("–"), |x| Cell::number(x, source))
}
