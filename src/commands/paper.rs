//! The figures of Minaretzis et al. 2024 from the files of a case study: what it shows of each, in the paper's order.

use crate::commands::calibrate::variance_chart as fitted_chart;
use crate::report::curves::{CurvesFile, FittedCurve, ReplicateCurve};
use crate::report::curves::{curve, scale_axis, sensor_name, variance_axis};
use crate::report::trajectory::TrajectorySeries;
use nav_sim_document::{Chart, Colour, Document as Page, Panel, Series, Tone, svg};
use nav_sim_signal::imu::Sensor;

/// A figure of the paper.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct PaperFigure {
    pub number: u32,
    pub caption: String,
    pub charts: Vec<Chart>,
}

impl PaperFigure {
    pub(crate) fn new(number: u32, caption: &str, charts: Vec<Chart>) -> Self {
        let caption = caption.to_owned();
        Self {
            number,
            caption,
            charts,
        }
    }

    pub(crate) fn svg(&self) -> String {
        svg(
            &format!("Fig. {}: {}", self.number, self.caption),
            &self.charts,
        )
    }
}

/// The curves behind one model of the study.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct StudyCurves {
    /// `I`, `II`, `III`.
    pub scenario: String,
    /// `awv`, `sr-awv`, `dr-awv`.
    pub estimator: String,
    pub file: CurvesFile,
}

/// Figures 1 and 3 to 6; 2 is of a study of the estimators, 7 of a comparison. `curves`: all models of the study.
pub(crate) fn paper_figures(
    curves: &[StudyCurves],
    track: &TrajectorySeries,
    outages: &[(f64, f64)],
) -> Vec<PaperFigure> {
    let of = |scenario: &str, estimator: &str, sensor: Sensor| {
        let mut models = curves.iter();
        let model = models.find(|c| c.scenario == scenario && c.estimator == estimator)?;
        model.file.curves.iter().find(|c| c.sensor == sensor)
    };
    let replicates = |scenario: &str| {
        let kinds = [("robust", "sr-awv"), ("classical", "awv")];
        let panels = kinds.into_iter().filter_map(|(kind, estimator)| {
            let FittedCurve {
                tau_s, replicates, ..
            } = of(scenario, estimator, Sensor::Accel)?;
            let line = |(k, r): (usize, &ReplicateCurve)| {
                Series::line(&r.file, Colour::Hue(k), curve(tau_s, &r.wv))
            };
            Some(panel(
                kind,
                Sensor::Accel,
                replicates.iter().enumerate().map(line).collect(),
            ))
        });
        vec![Chart::new(
            "Accelerometer recordings",
            scale_axis(),
            panels.collect(),
        )]
    };
    let averages = |sensor: Sensor| {
        let panels = ["II", "III"].map(|scenario| {
            let clean = of("I", "awv", sensor);
            let clean = clean
                .map(|c| Series::dashed("AWV, scenario I", Colour::Ink, curve(&c.tau_s, &c.wv)));
            let lines = (0..)
                .zip(["awv", "sr-awv", "dr-awv"])
                .filter_map(|(hue, estimator)| {
                    let FittedCurve { tau_s, wv, .. } = of(scenario, estimator, sensor)?;
                    let name = estimator.to_uppercase();
                    Some(Series::line(&name, Colour::Hue(hue), curve(tau_s, wv)))
                });
            let series = clean.into_iter().chain(lines).collect();
            panel(&format!("scenario {scenario}:"), sensor, series)
        });
        Chart::new(sensor_name(sensor), scale_axis(), panels.into())
    };
    let fit = of("I", "awv", Sensor::Accel).map(|fitted| fitted_chart(fitted, &[]));
    let tracks = vec![
        track.map("Reference trajectory", outages),
        track.over_time(outages),
    ];
    vec![
        PaperFigure::new(1, ABNORMAL, replicates("III")),
        PaperFigure::new(3, TRAJECTORY, tracks),
        PaperFigure::new(4, CLEAN, replicates("I")),
        PaperFigure::new(5, FIT, fit.into_iter().collect()),
        PaperFigure::new(6, AVERAGES, Sensor::ALL.map(averages).into()),
    ]
}

/// A panel of wavelet variances, with words before the name of its axis.
fn panel(words: &str, sensor: Sensor, series: Vec<Series>) -> Panel {
    let mut axis = variance_axis(sensor);
    axis.label = format!("{words} {}", axis.label);
    Panel::new(axis, series)
}

const ABNORMAL: &str = "Robust (above) and classical (below) wavelet variance of the recordings of scenario III, two of which are abnormal.";
const TRAJECTORY: &str = "Reference trajectory of a land vehicle on the horizontal plane, its height, speed and attitude.";
const CLEAN: &str =
    "Robust (above) and classical (below) wavelet variance of the clean recordings (scenario I).";
const FIT: &str = "Fit of N2 to the accelerometers of scenario I: wavelet variance with its 95 % band, recordings, model and processes; below: data over model.";
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

#[cfg(test)]
mod tests {
    use super::*;

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
        assert_eq!(figures[4].number, 6);
        let page = paper_page(&figures);
        assert!(page.contains("<h2>Figure 6</h2>") && !page.contains("NaN"));
    }
}
