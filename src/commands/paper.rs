//! The figures of Minaretzis et al. 2024 from the files of a case study: what it shows of each, in the paper's order.

use crate::commands::calibrate::{CAPTION as FITTED, variance_chart as fitted_chart};
use crate::report::curves::{CurvesFile, FittedCurve};
use crate::report::curves::{curve, scale_axis, sensor_name, variance_axis};
use crate::report::trajectory::TrajectorySeries;
use nav_sim_document::{Chart, Colour, Document as Page, Panel, Series, Tone, svg};
use nav_sim_signal::imu::Sensor;

/// A figure of the paper.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct PaperFigure {
    /// Its number.
    pub number: u32,
    /// What it shows.
    pub caption: String,
    charts: Vec<Chart>,
}

impl PaperFigure {
    /// `fig1.svg`
    pub(crate) fn file_name(&self) -> String {
        format!("fig{}.svg", self.number)
    }

    /// As a picture.
    pub(crate) fn svg(&self) -> String {
        svg(
            &format!("Fig. {}: {}", self.number, self.caption),
            &self.charts,
        )
    }

    pub(crate) fn new(number: u32, caption: &str, charts: Vec<Chart>) -> Self {
        Self {
            number,
            caption: caption.to_owned(),
            charts,
        }
    }
}

/// The curves behind one model of the study.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct StudyCurves {
    /// `I`, `II`, `III`.
    pub scenario: String,
    /// `awv`, `sr-awv`, `dr-awv`.
    pub estimator: String,
    /// The curves.
    pub file: CurvesFile,
}

/// Figures 1 and 3 to 6; 2 is of a study of the estimators, 7 of a comparison. `curves`: all models of the study.
pub(crate) fn paper_figures(
    curves: &[StudyCurves],
    track: &TrajectorySeries,
    outages: &[(f64, f64)],
) -> Vec<PaperFigure> {
    let fitted_curve = |scenario: &str, estimator: &str, sensor: Sensor| {
        let result = curves
            .iter()
            .find(|c| c.scenario == scenario && c.estimator == estimator)?;
        result.file.curves.iter().find(|c| c.sensor == sensor)
    };
    let replicates = |scenario: &str| {
        let kinds = [
            ("robust", fitted_curve(scenario, "sr-awv", Sensor::Accel)),
            ("classical", fitted_curve(scenario, "awv", Sensor::Accel)),
        ];
        let panels = kinds
            .into_iter()
            .filter_map(|(kind, fitted)| Some(recordings(kind, fitted?)));
        vec![Chart::new(
            "Accelerometer recordings",
            scale_axis(),
            panels.collect(),
        )]
    };
    let fit = fitted_curve("I", "awv", Sensor::Accel).map(|fitted| fitted_chart(fitted, &[]));
    vec![
        PaperFigure::new(1, ABNORMAL, replicates("III")),
        PaperFigure::new(
            3,
            TRAJECTORY,
            vec![
                track.map("Reference trajectory", outages),
                track.over_time(outages),
            ],
        ),
        PaperFigure::new(4, CLEAN, replicates("I")),
        PaperFigure::new(
            5,
            &format!("Fit of N2 to the accelerometers of scenario I. {FITTED}"),
            fit.into_iter().collect(),
        ),
        PaperFigure::new(6, AVERAGES, averages(&fitted_curve)),
    ]
}

const ABNORMAL: &str = "Robust (above) and classical (below) wavelet variance of the recordings of scenario III, two of which are abnormal.";
const TRAJECTORY: &str = "Reference trajectory of a land vehicle on the horizontal plane, its height, speed and attitude.";
const CLEAN: &str =
    "Robust (above) and classical (below) wavelet variance of the clean recordings (scenario I).";
const AVERAGES: &str = "The wavelet variances that AWV, SR-AWV and DR-AWV are fitted to, in scenarios II and III; dashed: AWV of scenario I.";

/// The page of all of them.
pub(crate) fn paper_page(figures: &[PaperFigure]) -> String {
    let verdict = "The figures of Minaretzis et al. 2024 from this study, beside what the paper's show; Figure 2 is of a study of the \
                   estimators (examples/paper_section4.rs).";
    let mut page = Page::new("The paper's figures", Tone::Good, [verdict]);
    for figure in figures {
        page.section(&format!("Figure {}", figure.number));
        page.text(&figure.caption);
        figure.charts.iter().for_each(|chart| page.chart(chart, ""));
    }
    page.html()
}

/// A curve a recording.
fn recordings(kind: &str, fitted: &FittedCurve) -> Panel {
    let series_of_recording = |(k, replicate): (usize, &crate::report::ReplicateCurve)| {
        Series::line(
            &replicate.file,
            Colour::Hue(k),
            curve(&fitted.tau_s, &replicate.wv),
        )
    };
    let mut axis = variance_axis(fitted.sensor);
    axis.label = format!("{kind} {}", axis.label);
    Panel::new(
        axis,
        fitted
            .replicates
            .iter()
            .enumerate()
            .map(series_of_recording)
            .collect(),
    )
}

/// A chart a sensor, a panel a scenario.
fn averages<'a>(
    fitted_curve: &dyn Fn(&str, &str, Sensor) -> Option<&'a FittedCurve>,
) -> Vec<Chart> {
    let chart = |sensor: Sensor| {
        let panel =
            |scenario: &&str| {
                let names = [("awv", "AWV"), ("sr-awv", "SR-AWV"), ("dr-awv", "DR-AWV")];
                let mut series: Vec<Series> = fitted_curve("I", "awv", sensor)
                    .map(|clean| {
                        Series::dashed(
                            "AWV, scenario I",
                            Colour::Ink,
                            curve(&clean.tau_s, &clean.wv),
                        )
                    })
                    .into_iter()
                    .collect();
                series.extend(names.into_iter().enumerate().filter_map(
                    |(hue, (estimator, name))| {
                        let fitted = fitted_curve(scenario, estimator, sensor)?;
                        Some(Series::line(
                            name,
                            Colour::Hue(hue),
                            curve(&fitted.tau_s, &fitted.wv),
                        ))
                    },
                ));
                let mut axis = variance_axis(sensor);
                axis.label = format!("scenario {scenario}: {}", axis.label);
                Panel::new(axis, series)
            };
        let title = sensor_name(sensor);
        Chart::new(
            title,
            scale_axis(),
            ["II", "III"].iter().map(panel).collect(),
        )
    };
    Sensor::ALL.map(chart).into()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::ReplicateCurve;

    fn study() -> Vec<StudyCurves> {
        let curve = |sensor: Sensor, factor: f64| FittedCurve {
            sensor,
            axis: "all".into(),
            tau_s: vec![0.02, 0.04, 0.08],
            wv: [4.0, 2.0, 1.0].map(|x| x * factor).into(),
            ci_low: [3.0, 1.5, 0.7].map(|x| x * factor).into(),
            ci_high: [5.0, 3.0, 2.0].map(|x| x * factor).into(),
            implied: [4.0, 2.0, 1.0].map(|x| x * factor).into(),
            processes: [("WN".to_owned(), vec![4.0, 2.0, 1.0])].into(),
            replicates: ["a.csv", "b.csv"]
                .map(|file| ReplicateCurve {
                    file: file.into(),
                    axis: None,
                    samples: 8,
                    wv: vec![4.0, 2.0, 1.0],
                })
                .into(),
            ..FittedCurve::default()
        };
        let model = |scenario: &str, estimator: &str, factor: f64| StudyCurves {
            scenario: scenario.into(),
            estimator: estimator.into(),
            file: CurvesFile {
                schema_version: 1,
                rate_hz: 100.0,
                curves: vec![curve(Sensor::Accel, factor), curve(Sensor::Gyro, factor)],
            },
        };
        let scenarios = [("I", 1.0), ("II", 2.0), ("III", 3.0)];
        let estimators = ["awv", "sr-awv", "dr-awv"];
        scenarios
            .iter()
            .flat_map(|(s, f)| estimators.map(|e| model(s, e, *f)))
            .collect()
    }

    #[test]
    fn every_figure_has_its_curves() {
        let figures = paper_figures(&study(), &TrajectorySeries::default(), &[(1.0, 2.0)]);
        assert_eq!(
            figures.iter().map(|f| f.number).collect::<Vec<_>>(),
            [1, 3, 4, 5, 6]
        );
        let drawn = |k: usize, name: &str| {
            figures[k]
                .svg()
                .matches(&format!("data-name=\"{name}\""))
                .count()
        };
        // in the robust and in the classical panel
        for figure in [0, 2] {
            assert_eq!(drawn(figure, "a.csv"), 2);
        }
        assert!(drawn(3, "model") > 1 && drawn(3, "WN") > 0);
        // two sensors, each with two scenarios
        assert_eq!((drawn(4, "SR-AWV"), drawn(4, "AWV, scenario I")), (4, 4));
        assert_eq!(figures[4].file_name(), "fig6.svg");
        let page = paper_page(&figures);
        assert!(page.contains("<h2>Figure 6</h2>") && !page.contains("NaN"));
    }
}
