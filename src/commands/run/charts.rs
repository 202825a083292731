//! The figures of a run.

use crate::report::{STATES, error_of};
use nav_sim_document::{Axis, Chart, Colour, Interval, Mark, Panel, Series};
use nav_sim_navigation::metrics::{Budget, EpochMetrics, FanEpoch, OutageSummary, Summary};

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
const SOURCES: usize = 7;

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
    let named: Vec<&str> = weight.iter().take(SOURCES).map(|(name, _)| *name).collect();
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
        let others = (weight.len() > SOURCES).then_some(("others", Colour::Soft));
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
