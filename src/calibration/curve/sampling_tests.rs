//! The law against signals that are made, and against closed forms.

use super::*;
use crate::noise::Process;
use crate::wavelet::classical;
use approx::{assert_abs_diff_eq, assert_relative_eq};
use rand::SeedableRng;

/// White noise, levels 1 and 2, by hand: W at level 1 is (x' − x)/2, with autocovariances ½, −¼ (σ² = 1),
/// so Σ s² = ¼ + 2/16 = 3/8; per coefficient nu²/Σ s² = (½)²/(3/8) = 2/3. Level 2 has ¼, 1/16·(…): the
/// autocovariances are (4, 1, −2, −1)/16, Σ s² = (16 + 2·6)/256, per coefficient (1/16)/(28/256) = 4/7.
#[test]
fn white_noise_by_hand() {
    let model = Composite::new(vec![Process::white(1.0).unwrap()]);
    let law = SamplingDistribution::new(&model, 6);
    assert_relative_eq!(law.per_coefficient[0], 2.0 / 3.0, max_relative = 1e-12);
    assert_relative_eq!(law.per_coefficient[1], 4.0 / 7.0, max_relative = 1e-12);
    assert_relative_eq!(law.edof(1000)[1], 997.0 * 4.0 / 7.0, max_relative = 1e-12);
}

/// 2000 records of twice the scale, and of four times: 2/var of nu/mean(nu), known to √(2·(2 + 12/eta)/2000)·… or so: a
/// variance of chi-squares of eta degrees, from n, is known to √((2 + 12/eta)/n) relative, 6.4 % at eta = 2; four of
/// which are allowed, and 5 % for the lags. That of ln nu, whose tails are lighter, is known to √((2 + 1)/n) = 3.9 %, of which
/// four are allowed, and 8 % for the spectrum in place of the eigenvalues; the chi-square's would be off by 40 %.
#[test]
fn few_coefficients_scatter_as_said() {
    const RECORDS: usize = 2000;
    let mut generator = Generator::seed_from_u64(4);
    let processes = [
        Process::white(1.0).unwrap(),
        Process::random_walk(1.0).unwrap(),
    ];
    for process in processes {
        let law = SamplingDistribution::new(&Composite::new(vec![process]), 8);
        let mut nu = vec![Vec::new(); 2];
        for _ in 0..RECORDS {
            let mut walk = 0.0;
            let walks = process.kind() == ProcessKind::RandomWalk;
            let signal: Vec<f64> = (0..512)
                .map(|_| {
                    let step = generator.sample::<f64, _>(StandardNormal);
                    walk = if walks { walk + step } else { step };
                    walk
                })
                .collect();
            let all = classical(&signal, 8).unwrap();
            nu.iter_mut()
                .zip([all[7], all[6]])
                .for_each(|(list, value)| list.push(value));
        }
        for (list, level) in nu.iter().zip([8, 7]) {
            let mean = list.iter().sum::<f64>() / RECORDS as f64;
            let variance =
                list.iter().map(|v| (v / mean - 1.0).powi(2)).sum::<f64>() / RECORDS as f64;
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

/// 1000 signals of 2048 samples: the scatter of ln of the robust variance up to level 6, where 32 lengths of the scale are in the
/// record and its expansion is good. A variance from n is known to √(2/n) = 4.5 %, of which four are allowed, and 5 % for the
/// polynomials beyond the fourth. Independent coefficients of efficiency 0.6 would scatter by 28 % more.
#[test]
fn robust_variances_scatter_as_said() {
    use crate::wavelet::classical_and_robust;
    const SIGNALS: usize = 1000;
    let tuning = Tuning::new(0.6).unwrap();
    let law = SamplingDistribution::new(&Composite::new(vec![Process::white(1.0).unwrap()]), 6);
    let mut generator = Generator::seed_from_u64(8);
    let mut logs = vec![Vec::new(); 6];
    for _ in 0..SIGNALS {
        let signal: Vec<f64> = (0..2048)
            .map(|_| generator.sample::<f64, _>(StandardNormal))
            .collect();
        let (_, robust) = classical_and_robust(&signal, 6, &tuning).unwrap();
        logs.iter_mut()
            .zip(robust)
            .for_each(|(list, nu)| list.push(nu.value.ln()));
    }
    for (i, (logs, edof)) in logs.iter().zip(law.robust_edof(2048, &tuning)).enumerate() {
        let mean = logs.iter().sum::<f64>() / SIGNALS as f64;
        let variance = logs.iter().map(|ln| (ln - mean).powi(2)).sum::<f64>() / SIGNALS as f64;
        let ratio = variance / law.shapes[i].variance_of_log(edof);
        assert!(
            (ratio - 1.0).abs() < 4.0 * 0.045 + 0.05,
            "level {}: {ratio}",
            i + 1
        );
    }
}

/// 600 signals of white noise plus AR1: the scatter of log nu and its correlation from level to level.
/// A variance estimated from n draws is known to √(2/n) = 5.8 %, a correlation to 1/√n = 0.041; four
/// deviations are allowed, and log nu's variance is 2/edof·(1 + 1/edof + …), under 3 % off from edof 30.
#[test]
fn simulated_signals_scatter_so() {
    const SIGNALS: usize = 600;
    let model = Composite::new(vec![
        Process::white(1.0).unwrap(),
        Process::ar1(0.8, 0.5).unwrap(),
    ]);
    let law = SamplingDistribution::new(&model, 5);
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
        ratios
            .iter()
            .zip(&mut drawn)
            .for_each(|(r, l)| l.push(r.ln()));
    }
    let covariance = |a: &[f64], b: &[f64]| {
        let mean = |x: &[f64]| x.iter().sum::<f64>() / SIGNALS as f64;
        let (ma, mb) = (mean(a), mean(b));
        a.iter()
            .zip(b)
            .map(|(x, y)| (x - ma) * (y - mb))
            .sum::<f64>()
            / (SIGNALS - 1) as f64
    };
    for logs in [&logs, &drawn] {
        for i in 0..5 {
            let ratio = covariance(&logs[i], &logs[i]) * edof[i] / 2.0;
            assert!(
                (ratio - 1.0).abs() < 4.0 * 0.058 + 0.03,
                "level {}: {ratio}",
                i + 1
            );
            for j in 0..i {
                let scale =
                    (covariance(&logs[i], &logs[i]) * covariance(&logs[j], &logs[j])).sqrt();
                let r = covariance(&logs[i], &logs[j]) / scale;
                assert_abs_diff_eq!(r, law.correlation[(i, j)], epsilon = 4.0 * 0.041);
            }
        }
    }
}
