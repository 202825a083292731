use super::*;
use crate::noise::Process;
use crate::units::DEG;
use approx::assert_relative_eq;

const RATE: f64 = 100.0;

fn wn(density: f64) -> Process {
    Process::white(density * density * RATE).unwrap()
}

fn rw(density: f64) -> Process {
    Process::random_walk(density * density / RATE).unwrap()
}

fn gm(sigma: f64, t_corr_s: f64) -> Process {
    Process::gauss_markov(1.0 / t_corr_s, sigma * sigma, RATE).unwrap()
}

fn pair(density: f64, walk: f64) -> NoiseDensities {
    NoiseDensities {
        density,
        walk,
        markov: None,
    }
}

fn curve(processes: Vec<Process>) -> AllanCurve {
    AllanCurve::largest(&[&Composite::new(processes)], RATE, Horizon::default()).unwrap()
}

/// No WN, a fast AR1 and slow biases: what calibrations of real recordings look like.
fn without_wn() -> Vec<Process> {
    let fast = Process::ar1(0.6, 4e-5).unwrap();
    vec![
        fast,
        gm(3e-4, 20.0),
        rw(5e-6),
        Process::quantization(1e-8).unwrap(),
    ]
}

#[test]
fn a_pair_comes_back_from_every_policy() {
    let (n, k) = (0.15 * DEG / 60.0, 2e-7);
    for policy in [Policy::Strict, Policy::Matched, Policy::Envelope] {
        let pair = curve(vec![wn(n), rw(k)]).pair(policy, BiasModel::Walk);
        assert_relative_eq!(pair.density, n, max_relative = 1e-12);
        assert_relative_eq!(pair.walk, k, max_relative = 1e-12);
    }
}

/// The search itself finds such a pair too: white noise and random walk under other names, an AR1 without memory and one
/// of 10⁴ times the horizon (a random walk over it to 1e-4).
#[test]
fn the_search_finds_a_pair_by_another_name() {
    let (n, k, t): (f64, f64, f64) = (2e-3, 4e-4, 1e6);
    let white = Process::ar1(0.0, n * n * RATE).unwrap();
    let slow = gm(k * (0.5 * t).sqrt(), t);
    for policy in [Policy::Matched, Policy::Envelope] {
        let pair = curve(vec![white, slow]).pair(policy, BiasModel::Walk);
        assert_relative_eq!(pair.density, n, max_relative = 1e-4);
        assert_relative_eq!(pair.walk, k, max_relative = 1e-4);
    }
}

#[test]
fn a_gauss_markov_bias_comes_back() {
    let (n, sigma, t) = (2e-3, 3e-3, 30.0);
    for policy in [Policy::Strict, Policy::Matched, Policy::Envelope] {
        let pair = curve(vec![wn(n), gm(sigma, t)]).pair(policy, BiasModel::Markov);
        let markov = pair.markov.unwrap();
        let found = [pair.density, markov.sigma, markov.t_corr_s, markov.drive()];
        let expected = [n, sigma, t, sigma * (2.0 / t).sqrt()];
        assert_relative_eq!(found[..], expected[..], max_relative = 1e-3);
    }
}

/// Where a fast AR1 is the white noise, N is the square root of its density at low frequencies, sigma √dt/(1 − phi), and the
/// Allan deviation at 1 s is the model's. 1 − (3/2)(T/τ) of it, T = 20 ms: 3 % below at 1 s.
#[test]
fn a_fast_ar1_is_the_white_noise() {
    let axis = vec![Process::ar1(0.6, 4e-5).unwrap()];
    let pair = curve(axis).pair(Policy::Matched, BiasModel::Walk);
    let n = (4e-5_f64 / RATE).sqrt() / (1.0 - 0.6);
    assert_relative_eq!(pair.density, n, max_relative = 0.03);
}

#[test]
fn matched_is_exact_at_one_second() {
    let model = without_wn();
    let carried = Composite::new(model[..3].to_vec());
    for kind in [
        BiasModel::Walk,
        BiasModel::Markov,
        BiasModel::MarkovOf(50.0),
    ] {
        let pair = curve(model.clone()).pair(Policy::Matched, kind);
        let ratio = pair.allan_variance(100, RATE) / carried.allan_variance(100);
        assert!((ratio - 1.0).abs() < 1e-9, "{kind:?}: {ratio}");
    }
}

/// No other share of the white noise is closer over the horizon.
#[test]
fn matched_is_the_least_squares_pair() {
    let curve = curve(without_wn());
    let pair = curve.pair(Policy::Matched, BiasModel::Walk);
    let misfit = |pair: &NoiseDensities| -> f64 {
        let log = |p: &Point| 0.5 * (pair.allan_variance(p.samples, RATE) / p.carried).ln();
        curve.points.iter().map(|p| log(p).powi(2)).sum()
    };
    let found = misfit(&pair);
    let target = curve.reference.carried;
    for i in 0..=2000 {
        let density2 = target * f64::from(i) / 2000.0;
        let unit = self::pair(0.0, 1.0).allan_variance(100, RATE);
        let walk = ((target - density2) / unit).max(0.0).sqrt();
        let other = misfit(&self::pair(density2.sqrt(), walk));
        assert!(found <= other * (1.0 + 1e-9), "{i}: {found} {other}");
    }
}

/// At every whole number of samples of the horizon; between the averaging times of the search the curves bend away by
/// less than (ln 2/32)²/2·(3/2) = 4e-4.
#[test]
fn the_envelope_is_nowhere_below() {
    let drift = Process::drift(2e-9).unwrap();
    for model in [
        without_wn(),
        vec![wn(1e-4), gm(1e-3, 5.0), drift],
        vec![rw(1e-5)],
        vec![wn(1e-3)],
    ] {
        let composite = Composite::new(model.clone());
        for kind in [
            BiasModel::Walk,
            BiasModel::Markov,
            BiasModel::MarkovOf(50.0),
        ] {
            let curve = curve(model.clone());
            let pair = curve.pair(Policy::Envelope, kind);
            for m in 100..=10_000 {
                let ratio = (pair.allan_variance(m, RATE) / composite.allan_variance(m)).sqrt();
                assert!(ratio > 1.0 - 4e-4, "{kind:?} {m}: {ratio}");
            }
            // it is the smallest
            assert_relative_eq!(pair.closure(&curve).lowest.ratio, 1.0, max_relative = 1e-6);
        }
    }
}

/// Ramp of slope c: its Allan deviation is c τ/√2, so at some time any white noise and random walk fall behind.
#[test]
fn what_a_pair_cannot_carry_is_told() {
    let drift = Process::drift(1e-7).unwrap();
    let with_drift = curve(vec![wn(1e-4), drift]);
    let pair = with_drift.pair(Policy::Matched, BiasModel::Walk);
    let expected =
        (1e-8 / 100.0_f64).sqrt() / (1e-8 / 100.0 + 0.5 * (1e-5_f64 * 100.0).powi(2)).sqrt();
    let closure = pair.closure(&with_drift);
    assert_relative_eq!(closure.lowest.ratio, expected, max_relative = 1e-6);
    assert!((closure.lowest.tau_s - 100.0).abs() < 1e-9 && with_drift.left_out().ratio > 0.99);
    assert_eq!(curve(vec![wn(1e-4)]).left_out().ratio, 0.0);
}

#[test]
fn the_largest_axis_rules() {
    let (small, large) = (
        Composite::new(vec![wn(1e-3), rw(4e-5)]),
        Composite::new(vec![wn(2e-3), rw(1e-5)]),
    );
    let both = AllanCurve::largest(&[&small, &large], RATE, Horizon::default()).unwrap();
    let strict = both.pair(Policy::Strict, BiasModel::Walk);
    assert_relative_eq!(strict.density, 2e-3, max_relative = 1e-12);
    assert_relative_eq!(strict.walk, 4e-5, max_relative = 1e-12);
    let pair = both.pair(Policy::Envelope, BiasModel::Walk);
    for m in (100..=10_000).step_by(50) {
        for axis in [&small, &large] {
            assert!(pair.allan_variance(m, RATE) > axis.allan_variance(m) * (1.0 - 1e-3));
        }
    }
}

/// N²/τ + K²τ/3 is least at τ = √3 N/K: 2NK/√3. A Gauss-Markov process has no minimum, white noise falls forever.
#[test]
fn the_bias_instability_is_the_minimum() {
    let (n, k) = (1e-3, 1e-5);
    let parameters = |processes| {
        let axis = Composite::new(processes);
        AxisParameters::of(&[&axis], RATE, Horizon::default(), Policy::Matched, 1e4).unwrap()
    };
    let minimum = parameters(vec![wn(n), rw(k)]).minimum.unwrap();
    assert_relative_eq!(minimum.tau_s, 3.0_f64.sqrt() * n / k, max_relative = 0.05);
    let floor = (2.0 * n * k / 3.0_f64.sqrt()).sqrt();
    assert_relative_eq!(minimum.deviation, floor, max_relative = 1e-3);
    assert_eq!(parameters(vec![wn(n)]).minimum, None);
    assert_eq!(parameters(vec![rw(n)]).minimum, None);
}

#[test]
fn horizons_that_cannot_be_are_refused() {
    let axis = Composite::new(vec![wn(1e-3)]);
    for (from_s, to_s) in [
        (0.001, 10.0),
        (10.0, 20.0),
        (1.0, 1e9),
        (f64::NAN, 10.0),
        (100.0, 1.0),
    ] {
        assert!(
            AllanCurve::largest(&[&axis], RATE, Horizon { from_s, to_s }).is_err(),
            "{from_s} {to_s}"
        );
    }
    let silent =
        AllanCurve::largest(&[&Composite::default()], RATE, Horizon::default()).unwrap_err();
    assert_eq!(
        silent.to_string(),
        "the model has no noise at an averaging time of 1 s"
    );
}

/// Beside white noise of the same N the pair has 1 + (Kτ/N)²/3 times the Allan variance: 4 at τ = 3 N/K, found on a grid of
/// 1/16 octave (4.4 %); beside itself it departs nowhere.
#[test]
fn a_pair_departs_from_a_model_without_its_random_walk() {
    let (n, k) = (1e-3, 1e-5);
    let pair = pair(n, k);
    let departs = |processes, to_s| pair.departs_s(&Composite::new(processes), RATE, to_s, 2.0);
    let found = departs(vec![wn(n)], 1e4).unwrap() / (3.0 * n / k);
    assert!((1.0..1.045).contains(&found), "{found}");
    assert_eq!(departs(vec![wn(n)], 250.0), None);
    assert_eq!(departs(vec![wn(n), rw(k)], 1e4), None);
    let white = NoiseDensities { walk: 0.0, ..pair };
    assert_eq!(
        white.departs_s(&Composite::new(vec![wn(0.1 * n)]), RATE, 1e4, 2.0),
        None
    );
}

/// N²/τ = K²τ/3 at τ = √3 N/K: 173.2 s for N = 1e-3 and K = 1e-5.
#[test]
fn white_noise_and_random_walk_are_equal_at_the_crossover() {
    let tau_s = pair(1e-3, 1e-5).crossover_s().unwrap();
    assert_relative_eq!(tau_s, 173.205_080_756_887_7, max_relative = 1e-12);
    assert_eq!(pair(1e-3, 0.0).crossover_s(), None);
}
