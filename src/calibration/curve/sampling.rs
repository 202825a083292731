//! Large-sample law of the wavelet variance: its scatter from recording to recording of the same noise.
//!
//! For Gaussian coefficients cov(nu_j, nu_k) ≈ 2/√(M_j M_k) ∫ |H_j|² |H_k|² S² df, H the Haar filters, S the spectrum
//! of the model ([Percival](crate::bibliography::Percival95)). Each nu_j is taken as chi-square with the degrees of
//! freedom 2 nu²/var that follow, joined by the correlations that follow; where the record has few lengths of the
//! scale, with those of var = 2/M² Σ (M − |k|) s_k² over the lags there are, s_k the autocovariance of the
//! coefficients, and of a shape of its own ([`Shape`]). Drift is not noise: it adds to nu and, but for its product with
//! the mean of the coefficients, not to its scatter. Quantization noise is not Gaussian: what that leaves of the scatter
//! of a robust variance is in [`SamplingLaw::robust_edof`].

use super::implied::quantization_share;
use super::shape::Shape;
use crate::noise::{Composite, Process};
use crate::rng::Generator;
use crate::wavelet::Tuning;
use crate::wavelet::interval::edof_robust;
use nalgebra::{DMatrix, DVector};
use rand::RngExt;
use rand_distr::StandardNormal;
use std::f64::consts::PI;

/// The law of the wavelet variances of one model at levels 1, 2, …
#[derive(Debug, Clone)]
pub(crate) struct SamplingLaw {
    /// Degrees of freedom per coefficient, of each level.
    per_coefficient: Vec<f64>,
    /// The part of the wavelet variance that is quantization noise, of each level.
    pub(crate) quantization: Vec<f64>,
    /// Squares of the autocorrelations of the coefficients of the last levels ([`squared_autocorrelations`]); none of others.
    autocorrelations: Vec<Vec<f64>>,
    /// Shape of the law of each level: a chi-square's but at the last levels.
    pub(crate) shapes: Vec<Shape>,
    /// Correlations between levels, and the lower Cholesky factor.
    pub(crate) correlation: DMatrix<f64>,
    factor: DMatrix<f64>,
}

impl SamplingLaw {
    /// The law for a model, at levels 1 … `levels`.
    pub(crate) fn new(model: &Composite, levels: usize) -> Self {
        let products = products(model, levels);
        let per_coefficient = (0..levels)
            .map(|i| {
                let nu = model.haar_wv(i as u32 + 1);
                let plain = 0.5_f64.powi(i as i32 + 1);
                // var nu_hat = 2/M ∫(|H|² S)² df, so 2 nu²/var over M is this quotient. A drift alone does
                // not scatter and gets those of eta3, 1/tau.
                if products[(i, i)] > 0.0 { nu * nu / products[(i, i)] } else { plain }
            })
            .collect();
        let mut correlation = DMatrix::from_fn(levels, levels, |i, j| {
            let scale = (products[(i, i)] * products[(j, j)]).sqrt();
            if scale > 0.0 { products[(i, j)] / scale } else { 0.0 }
        });
        // Also for a level without noise, whose row is zero: the matrix must stay positive definite.
        correlation.fill_diagonal(1.0);
        let factor = factor(&correlation);
        let quantization = (1..=levels as u32).map(|level| quantization_share(model, level)).collect();
        let autocorrelations =
            (1..=levels).map(|level| squared_autocorrelations(model, level, levels)).collect();
        let shapes = (1..=levels).map(|level| shape(model, level, levels)).collect();
        Self { per_coefficient, quantization, autocorrelations, shapes, correlation, factor }
    }

    /// The law of the first so many levels.
    pub(crate) fn first(&self, levels: usize) -> Self {
        let correlation = self.correlation.view((0, 0), (levels, levels)).into_owned();
        // The leading block of a lower triangular factor is the factor of the leading block.
        let factor = self.factor.view((0, 0), (levels, levels)).into_owned();
        let per_coefficient = self.per_coefficient[..levels].to_vec();
        let quantization = self.quantization[..levels].to_vec();
        let autocorrelations = self.autocorrelations[..levels].to_vec();
        let shapes = self.shapes[..levels].to_vec();
        Self { per_coefficient, quantization, autocorrelations, shapes, correlation, factor }
    }

    /// Degrees of freedom of the classical wavelet variance of a signal of so many samples.
    pub(crate) fn edof(&self, samples: usize) -> Vec<f64> {
        let count = |i: usize| crate::wavelet::coefficient_count(samples, i as u32 + 1) as f64;
        let of_level = |(i, e): (usize, &f64)| {
            (e * count(i)).max(of_few(&self.autocorrelations[i], count(i), i as u32 + 1)).max(1.0)
        };
        self.per_coefficient.iter().enumerate().map(of_level).collect()
    }

    /// The same of the robust one, at least 1.
    pub(crate) fn robust_edof(&self, samples: usize, tuning: &Tuning) -> Vec<f64> {
        let robust = |(edof, share): (f64, &f64)| {
            edof_robust(edof, tuning.efficiency() * tuning.quantization().degrees(*share))
        };
        self.edof(samples).into_iter().zip(&self.quantization).map(robust).collect()
    }

    /// Draws nu*/nu of every level, given the degrees of freedom.
    pub(crate) fn draw(&self, edof: &[f64], generator: &mut Generator) -> Vec<f64> {
        let z = DVector::from_fn(edof.len(), |_, _| generator.sample::<f64, _>(StandardNormal));
        let correlated = &self.factor * z;
        let scores = self.shapes.iter().zip(&correlated);
        scores.zip(edof).map(|((shape, z), edof)| shape.ratio(*z, *edof)).collect()
    }
}

/// The last levels, whose scale a record may hold few times.
const LAST: usize = 4;
/// Lengths of the scale from which on the large-sample law is used.
const MANY: f64 = 8.0;
/// Number of lags into which the scale is divided.
const LAGS: usize = 16;

/// Squares of the autocorrelations of a level's coefficients at [`LAGS`] lags up to the scale, beyond which they are
/// uncorrelated or nearly so; none for a level that is not among the last.
fn squared_autocorrelations(model: &Composite, level: usize, levels: usize) -> Vec<f64> {
    if !is_last(level, levels) {
        return Vec::new();
    }
    let half = 1_usize << levels;
    let m = f64::from(level as u32 - 1).exp2();
    // The gain falls as 1/f² or faster: beyond 32/tau there is a hundredth of it.
    let frequencies = (64_usize << (levels - level)).min(half);
    let mut sums = [0.0; LAGS + 1];
    for k in 0..frequencies {
        let f = 0.5 * (k as f64 + 0.5) / half as f64;
        let gain = gain(model, f, m);
        for (lag, sum) in sums.iter_mut().enumerate() {
            *sum += gain * (2.0 * PI * f * 2.0 * m * lag as f64 / LAGS as f64).cos();
        }
    }
    sums.iter().map(|s| (s / sums[0]).powi(2)).collect()
}

/// The shape of the law of a level's wavelet variance; a chi-square's for a level that is not among the last.
fn shape(model: &Composite, level: usize, levels: usize) -> Shape {
    /// Frequencies to a gain's main lobe, 1/tau wide: eight make the sums of powers of it integrals.
    const TO_A_LOBE: usize = 8;
    if !is_last(level, levels) {
        return Shape::default();
    }
    let m = f64::from(level as u32 - 1).exp2();
    // Up to 8/tau, beyond which there is a thousandth of a random walk's power and a hundredth of white noise's.
    let weight = |k: usize| gain(model, (k as f64 + 0.5) / (TO_A_LOBE as f64 * 2.0 * m), m);
    Shape::new(&(0..8 * TO_A_LOBE).map(weight).collect::<Vec<f64>>())
}

/// Whether a record may hold a level's scale few times. Below level 4 a sixteenth of the scale is less than a sample.
const fn is_last(level: usize, levels: usize) -> bool {
    level + LAST > levels && level >= 4
}

/// |H|² S of a frequency, with the Haar gain |H|² = sin⁴(πfm)/(m² sin²(πf)).
fn gain(model: &Composite, f: f64, m: f64) -> f64 {
    let sin2 = (PI * f).sin().powi(2);
    let density = model.processes.iter().map(|p| spectrum(p, sin2)).sum::<f64>();
    density * (PI * f * m).sin().powi(4) / (m * m * sin2)
}

/// Degrees of freedom of a mean of `count` squares with these squared autocorrelations; 0 where the large-sample law holds.
fn of_few(squared: &[f64], count: f64, level: u32) -> f64 {
    let step = f64::from(level).exp2() / LAGS as f64;
    // Counted in steps of the lag, so that each lag kept stands for a step of them.
    let n = count / step;
    if squared.is_empty() || n > MANY * LAGS as f64 {
        return 0.0;
    }
    let lags = squared.iter().enumerate().skip(1);
    let sum = n * squared[0] + 2.0 * lags.map(|(lag, s)| (n - lag as f64).max(0.0) * s).sum::<f64>();
    // Of a process without noise (a drift) nothing is known.
    if sum > 0.0 { n * n / sum } else { 0.0 }
}

/// The Cholesky factor; where rounding leaves no positive definite matrix, that of independent levels.
fn factor(correlation: &DMatrix<f64>) -> DMatrix<f64> {
    let n = correlation.nrows();
    correlation.clone().cholesky().map_or_else(|| DMatrix::identity(n, n), |c| c.l())
}

/// ∫ |H_j|² |H_k|² S² df over −½ … ½, for all pairs of levels (units⁴).
///
/// A sum over 2^(levels + 1) frequencies: exact where the autocovariance of the coefficients of the longest
/// scale ends within that scale, as it does for WN, QN, MA1 and RW.
fn products(model: &Composite, levels: usize) -> DMatrix<f64> {
    let half = 1_usize << levels;
    let mut sums = DMatrix::zeros(levels, levels);
    let mut gains = vec![0.0; levels];
    for k in 0..half {
        // sin²(πf) of the midpoint; then sin²(2x) = 4 sin²x (1 − sin²x) from level to level.
        let base = (0.5 * PI * (k as f64 + 0.5) / half as f64).sin().powi(2);
        let density = model.processes.iter().map(|p| spectrum(p, base)).sum::<f64>();
        let mut sin2 = base;
        for (i, gain) in gains.iter_mut().enumerate() {
            let m = f64::from(i as u32).exp2();
            // sin2 is sin²(πfm) here, base sin²(πf). Midpoints leave out f = 0, where a random walk has no
            // density.
            *gain = density * sin2 * sin2 / (m * m * base);
            sin2 = 4.0 * sin2 * (1.0 - sin2);
        }
        for j in 0..levels {
            for i in j..levels {
                sums[(i, j)] += gains[i] * gains[j];
            }
        }
    }
    // The midpoint rule with step ½/half over 0 … ½, doubled for the negative frequencies.
    sums /= half as f64;
    sums.fill_upper_triangle_with_lower_triangle();
    sums
}

/// Two-sided spectral density per sample (units²), at the frequency whose sin²(πf) is given.
fn spectrum(process: &Process, sin2: f64) -> f64 {
    // |1 − r e^(−2πif)|²
    let distance = |r: f64| (1.0 - r) * (1.0 - r) + 4.0 * r * sin2;
    match process {
        Process::White(p) => p.sigma2(),
        Process::Quantization(p) => 4.0 * p.q2() * sin2,
        Process::Ar1(p) => p.sigma2() / distance(p.phi()),
        Process::GaussMarkov(p) => p.ar1().sigma2() / distance(p.ar1().phi()),
        Process::Ma1(p) => p.sigma2() * distance(-p.theta()),
        Process::RandomWalk(p) => p.gamma2() / (4.0 * sin2),
        Process::Drift(_) => 0.0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::noise::{Ar1, Quantization, RandomWalk, White};
    use crate::wavelet::classical;
    use approx::assert_relative_eq;
    use rand::SeedableRng;

    /// White noise, levels 1 and 2, by hand: W at level 1 is (x' − x)/2, with autocovariances ½, −¼ (σ² = 1),
    /// so Σ s² = ¼ + 2/16 = 3/8; per coefficient nu²/Σ s² = (½)²/(3/8) = 2/3. Level 2 has ¼, 1/16·(…): the
    /// autocovariances are (4, 1, −2, −1)/16, Σ s² = (16 + 2·6)/256, per coefficient (1/16)/(28/256) = 4/7.
    #[test]
    fn white_noise_by_hand() {
        let model = Composite::new(vec![Process::White(White::new(1.0).unwrap())]);
        let law = SamplingLaw::new(&model, 6);
        assert_relative_eq!(law.per_coefficient[0], 2.0 / 3.0, max_relative = 1e-12);
        assert_relative_eq!(law.per_coefficient[1], 4.0 / 7.0, max_relative = 1e-12);
        assert_relative_eq!(law.edof(1000)[1], 997.0 * 4.0 / 7.0, max_relative = 1e-12);
    }

    /// The spectrum and the filters agree with the closed forms: ∫ |H_j|² S df = nu_j.
    #[test]
    fn spectra_integrate_to_the_wavelet_variance() {
        let processes = [
            Process::White(White::new(2.0).unwrap()),
            Process::Quantization(Quantization::new(3.0).unwrap()),
            Process::Ar1(Ar1::new(0.9, 0.5).unwrap()),
            Process::RandomWalk(RandomWalk::new(0.1).unwrap()),
            Process::Ma1(crate::noise::Ma1::new(0.5, 1.0).unwrap()),
            Process::GaussMarkov(crate::noise::GaussMarkov::new(10.0, 0.3, 100.0).unwrap()),
        ];
        let half = 1 << 14;
        for process in &processes {
            for level in 1..=6 {
                let m = f64::from(level - 1).exp2();
                let term = |k: usize| {
                    let x = 0.5 * PI * (k as f64 + 0.5) / half as f64;
                    spectrum(process, x.sin().powi(2)) * (m * x).sin().powi(4) / (m * x.sin()).powi(2)
                };
                let integral = (0..half).map(term).sum::<f64>() / half as f64;
                assert_relative_eq!(integral, process.haar_wv(level), max_relative = 1e-9);
            }
        }
    }

    /// 2000 records of twice the scale, and of four times: 2/var of nu/mean(nu), known to √(2·(2 + 12/eta)/2000)·… or so: a
    /// variance of chi-squares of eta degrees, from n, is known to √((2 + 12/eta)/n) relative, 6.4 % at eta = 2; four of
    /// which are allowed, and 5 % for the lags. That of ln nu, whose tails are lighter, is known to √((2 + 1)/n) = 3.9 %, of which
    /// four are allowed, and 8 % for the spectrum in place of the eigenvalues; the chi-square's would be off by 40 %.
    #[test]
    fn few_coefficients_scatter_as_said() {
        const RECORDS: usize = 2000;
        let mut generator = Generator::seed_from_u64(4);
        let processes =
            [Process::White(White::new(1.0).unwrap()), Process::RandomWalk(RandomWalk::new(1.0).unwrap())];
        for process in processes {
            let law = SamplingLaw::new(&Composite::new(vec![process]), 8);
            let mut nu = vec![Vec::new(); 2];
            for _ in 0..RECORDS {
                let mut walk = 0.0;
                let walks = matches!(process, Process::RandomWalk(_));
                let signal: Vec<f64> = (0..512)
                    .map(|_| {
                        let step = generator.sample::<f64, _>(StandardNormal);
                        walk = if walks { walk + step } else { step };
                        walk
                    })
                    .collect();
                let all = classical(&signal, 8).unwrap();
                nu.iter_mut().zip([all[7], all[6]]).for_each(|(list, value)| list.push(value));
            }
            for (list, level) in nu.iter().zip([8, 7]) {
                let mean = list.iter().sum::<f64>() / RECORDS as f64;
                let variance = list.iter().map(|v| (v / mean - 1.0).powi(2)).sum::<f64>() / RECORDS as f64;
                let (found, said) = (2.0 / variance, law.edof(512)[level - 1]);
                let allowed = 4.0 * ((2.0 + 12.0 / said) / RECORDS as f64).sqrt() + 0.05;
                assert!(
                    (found / said - 1.0).abs() < allowed,
                    "{} level {level}: {found} {said}",
                    process.code()
                );
                let logs: Vec<f64> = list.iter().map(|nu| nu.ln()).collect();
                let centre = logs.iter().sum::<f64>() / RECORDS as f64;
                let found = logs.iter().map(|ln| (ln - centre).powi(2)).sum::<f64>() / RECORDS as f64;
                let of_law = law.shapes[level - 1].variance_of_log(said);
                let allowed = 4.0 * (3.0 / RECORDS as f64).sqrt() + 0.08;
                assert!(
                    (of_law / found - 1.0).abs() < allowed,
                    "ln, {} level {level}: {found} {of_law}",
                    process.code()
                );
            }
        }
    }

    /// 600 signals of white noise plus AR1: the scatter of log nu and its correlation from level to level.
    /// A variance estimated from n draws is known to √(2/n) = 5.8 %, a correlation to 1/√n = 0.041; four
    /// deviations are allowed, and log nu's variance is 2/edof·(1 + 1/edof + …), under 3 % off from edof 30.
    #[test]
    fn simulated_signals_scatter_so() {
        const SIGNALS: usize = 600;
        let model = Composite::new(vec![
            Process::White(White::new(1.0).unwrap()),
            Process::Ar1(Ar1::new(0.8, 0.5).unwrap()),
        ]);
        let law = SamplingLaw::new(&model, 5);
        let edof = law.edof(2048);
        let mut generator = Generator::seed_from_u64(11);
        let mut logs = vec![Vec::new(); 5];
        let mut drawn = vec![Vec::new(); 5];
        for _ in 0..SIGNALS {
            let mut normal = || generator.sample::<f64, _>(StandardNormal);
            let mut ar1 = (0.5_f64 / 0.36).sqrt() * normal();
            let signal: Vec<f64> = (0..2048)
                .map(|_| {
                    ar1 = 0.8 * ar1 + 0.5_f64.sqrt() * normal();
                    ar1 + normal()
                })
                .collect();
            let nu = classical(&signal, 5).unwrap();
            nu.iter().zip(&mut logs).for_each(|(nu, l)| l.push(nu.ln()));
            let ratios = law.draw(&edof, &mut generator);
            ratios.iter().zip(&mut drawn).for_each(|(r, l)| l.push(r.ln()));
        }
        let covariance = |a: &[f64], b: &[f64]| {
            let mean = |x: &[f64]| x.iter().sum::<f64>() / SIGNALS as f64;
            let (ma, mb) = (mean(a), mean(b));
            a.iter().zip(b).map(|(x, y)| (x - ma) * (y - mb)).sum::<f64>() / (SIGNALS - 1) as f64
        };
        for logs in [&logs, &drawn] {
            for i in 0..5 {
                let ratio = covariance(&logs[i], &logs[i]) * edof[i] / 2.0;
                assert!((ratio - 1.0).abs() < 4.0 * 0.058 + 0.03, "level {}: {ratio}", i + 1);
                for j in 0..i {
                    let scale = (covariance(&logs[i], &logs[i]) * covariance(&logs[j], &logs[j])).sqrt();
                    let r = covariance(&logs[i], &logs[j]) / scale;
                    assert!((r - law.correlation[(i, j)]).abs() < 4.0 * 0.041, "{i} {j}: {r}");
                }
            }
        }
    }
}
