//! Scatter of recordings by noise alone, over windows of neighbouring scales.

use crate::curve::sampling::SamplingLaw;
use crate::rng::Generator;
use rand::RngExt;
use rand_distr::StandardNormal;

/// Numbers of neighbouring scales that are taken together.
const WIDTHS: [usize; 3] = [1, 3, 5];

/// Neighbouring scales.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Window {
    /// Index of the first.
    pub(super) first: usize,
    /// Number of scales.
    pub(super) width: usize,
}

impl Window {
    /// All windows over so many scales.
    pub(super) fn all(levels: usize) -> Vec<Self> {
        let of_width = |width: usize| {
            (0..(levels + 1).saturating_sub(width)).map(move |first| Self { first, width })
        };
        WIDTHS.into_iter().flat_map(of_width).collect()
    }

    pub(super) fn range(self) -> std::ops::Range<usize> {
        self.first..self.first + self.width
    }
}

/// Scatter of one axis by noise alone.
#[derive(Debug, Clone)]
pub(super) struct Noise {
    kind: NoiseKind,
    /// Degrees of freedom, `[file][level]`.
    edof: Vec<Vec<f64>>,
    /// Variance of the contrast of each window, `[window][file]`.
    pub(super) variances: Vec<Vec<f64>>,
}

/// Law of the values of a file.
#[derive(Debug, Clone)]
enum NoiseKind {
    /// Logarithms of wavelet variances.
    Law(SamplingLaw),
    /// One Gaussian number of unit variance, times what its deviation differs by from file to file: the standard deviation of
    /// its logarithm.
    Normal(f64),
}

impl Noise {
    /// Noise of files of one Gaussian number each, whose standard deviation is log-normal about 1 with `log_deviation`.
    pub(super) fn normal(files: usize, log_deviation: f64) -> Self {
        let kind = NoiseKind::Normal(log_deviation);
        Self {
            kind,
            edof: vec![vec![1.0]; files],
            variances: vec![vec![1.0; files]],
        }
    }

    /// Levels that its files have at most.
    pub(super) fn levels(&self) -> usize {
        self.edof.first().map_or(0, Vec::len)
    }

    /// Draws the values of a file by noise alone, level by level.
    pub(super) fn draw(&self, file: usize, generator: &mut Generator) -> Vec<f64> {
        match &self.kind {
            NoiseKind::Law(law) => law
                .draw(&self.edof[file], generator)
                .into_iter()
                .map(f64::ln)
                .collect(),
            NoiseKind::Normal(log_deviation) => {
                let mut normal = || generator.sample::<f64, _>(StandardNormal);
                // A normal number whose standard deviation is itself log-normal: recordings differ in how far they move.
                vec![(log_deviation * normal()).exp() * normal()]
            }
        }
    }

    /// Noise of files with these degrees of freedom, `[file][level]`.
    pub(super) fn new(law: SamplingLaw, edof: Vec<Vec<f64>>) -> Self {
        let levels = edof.first().map_or(0, Vec::len);
        let deviations: Vec<Vec<f64>> = edof
            .iter()
            .map(|e| {
                e.iter()
                    .zip(&law.shapes)
                    .map(|(e, shape)| shape.variance_of_log(*e).sqrt())
                    .collect()
            })
            .collect();
        let of_window = |window: Window| {
            let of_file = |s: &Vec<f64>| {
                let pair = |i: usize| {
                    window
                        .range()
                        .map(|j| law.correlation[(i, j)] * s[i] * s[j])
                        .sum::<f64>()
                };
                window.range().map(pair).sum::<f64>() / (window.width * window.width) as f64
            };
            deviations.iter().map(of_file).collect()
        };
        let variances = Window::all(levels).into_iter().map(of_window).collect();
        Self {
            kind: NoiseKind::Law(law),
            edof,
            variances,
        }
    }
}
