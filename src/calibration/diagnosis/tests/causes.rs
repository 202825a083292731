//! What classical and robust variances differ by, and recordings drift by, without an outlier or another noise.

use super::*;

/// Four recordings of Gaussian numbers, of a deviation in steps and a bias that differs, rounded to whole steps; `glitches` of
/// 30 steps.
fn rounded(deviation: f64, glitches: usize) -> Vec<Diagnosis> {
    let signal = |file: usize, axis: Axis| {
        let run = file as u64;
        let mut generator =
            StreamKey { seed: 6, scenario: "", run, source: axis.name(), process: "" }.generator();
        let bias = 0.3 * file as f64;
        let mut number = || (bias + deviation * generator.sample::<f64, _>(StandardNormal)).round();
        let mut signal: Vec<f64> = (0..32 * SAMPLES).map(|_| number()).collect();
        signal.iter_mut().skip(50).step_by(600).take(glitches).for_each(|x| *x += 30.0);
        signal
    };
    let recording = |file: usize| Axis::ALL.map(|axis| signal(file, axis));
    let model = ModelChoice::Given("WN".parse().unwrap());
    diagnosed((0..4).map(recording), &Settings { model, ..settings() })
}

/// Rounding without an outlier: none is told, in all recordings or in one whose bias lies elsewhere between the steps. At half a
/// step the two variances agree (by the exact law to 2 %), and nothing is said. Real outliers are told on coarse steps too.
#[test]
fn coarse_steps_are_not_taken_for_outliers() {
    for deviation in [0.25, 0.3, 0.4] {
        let all = rounded(deviation, 0);
        assert!(
            all.iter().all(|d| d.common.is_none() && d.outliers.is_none()),
            "{deviation}: {:?}",
            all[0].common
        );
        let steps = all[0].coarse_steps.as_ref().unwrap();
        assert!(steps.excess.abs() > 0.02 && steps.tau_s.iter().all(|tau| *tau <= 256.0), "{steps:?}");
        let words = advice(&all, Sensor::Accel);
        assert!(words.iter().any(|line| line.contains("use awv")), "{words:?}");
        assert!(words.iter().all(|line| !line.starts_with("outliers")), "{words:?}");
    }
    let half = &rounded(0.6, 0)[0];
    assert!(half.common.is_none() && half.coarse_steps.is_none(), "{:?}", half.coarse_steps);
    for deviation in [0.3, 1.0] {
        let glitched = &rounded(deviation, 100)[0];
        assert!(glitched.common.is_some() && glitched.coarse_steps.is_none(), "{deviation}: {glitched:?}");
    }
}
