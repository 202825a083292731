//! Theory and estimators against numbers from independent implementations (`tests/data/README.md`).

use nav_sim::calibration::{Termination, Weighting, fit};
use nav_sim::signal::noise::{Composite, Process};
use nav_sim::signal::wavelet;
use nav_sim::signal::wavelet::{Curve, Tuning};
use nav_sim_signal::wavelet::{coefficient_count, interval};
use serde_json::Value;

fn truth(file: &str) -> Value {
    let path = format!("{}/tests/data/{file}", env!("CARGO_MANIFEST_DIR"));
    serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap()
}

fn numbers(value: &Value) -> Vec<f64> {
    value
        .as_array()
        .unwrap()
        .iter()
        .map(|v| v.as_f64().unwrap())
        .collect()
}

fn composite(components: &Value, theta: &[f64], rate_hz: f64) -> Composite {
    let mut parameters = theta.iter().copied();
    let mut next = || parameters.next().unwrap();
    let process = |code: &Value| match code.as_str().unwrap() {
        "WN" => Process::white(next()).unwrap(),
        "QN" => Process::quantization(next()).unwrap(),
        "AR1" => Process::ar1(next(), next()).unwrap(),
        "RW" => Process::random_walk(next()).unwrap(),
        "DR" => Process::drift(next()).unwrap(),
        "GM" => Process::gauss_markov(next(), next(), rate_hz).unwrap(),
        "MA1" => Process::ma1(next(), next()).unwrap(),
        other => panic!("{other}"),
    };
    let composite = Composite::new(components.as_array().unwrap().iter().map(process).collect());
    assert!(parameters.next().is_none());
    composite
}

#[track_caller]
fn assert_relative(actual: f64, expected: f64, tolerance: f64, what: &str) {
    let error = ((actual - expected) / expected).abs();
    assert!(
        error <= tolerance,
        "{what}: {actual:e}, truth {expected:e}, relative error {error:e}"
    );
}

#[test]
fn theoretical_wavelet_variance_and_derivatives() {
    let truth = truth("theoretical_wv.json");
    let mut rows = 0;
    for case in truth["cases"].as_array().unwrap() {
        let name = case["name"].as_str().unwrap();
        let theta = numbers(&case["theta"]);
        let model = composite(&case["components"], &theta, case["freq"].as_f64().unwrap());
        let nu = numbers(&case["nu"]);
        for (i, row) in case["dnu_dtheta"].as_array().unwrap().iter().enumerate() {
            let level = i as u32 + 1;
            assert_relative(
                model.haar_wv(level),
                nu[i],
                1e-13,
                &format!("{name}, level {level}"),
            );
            let gradient = model.haar_wv_gradient(level);
            assert_eq!(gradient.len(), theta.len());
            for (p, (actual, expected)) in gradient.iter().zip(numbers(row)).enumerate() {
                let what = format!("{name}, level {level}, parameter {p}");
                assert_relative(*actual, expected, 1e-12, &what);
            }
            rows += 1;
        }
    }
    assert_eq!(rows, 9 * 20);
}

#[test]
fn robust_constants() {
    let truth = truth("robust_constants.json");
    let values = truth["values"].as_object().unwrap();
    assert_eq!(values.len(), 6);
    for (efficiency, row) in values {
        let tuning = Tuning::new(efficiency.parse().unwrap()).unwrap();
        assert_relative(tuning.c(), row["c"].as_f64().unwrap(), 1e-12, efficiency);
        assert_relative(tuning.a(), row["a"].as_f64().unwrap(), 1e-12, efficiency);
    }
}

#[test]
fn wavelet_variance_of_a_signal() {
    let root = env!("CARGO_MANIFEST_DIR");
    let text = std::fs::read_to_string(format!("{root}/tests/data/signal_clean_4096.csv")).unwrap();
    let signal: Vec<f64> = text.lines().skip(1).map(|l| l.parse().unwrap()).collect();
    assert_eq!(signal.len(), 4096);
    let truth = &truth("wv_4096.json")["signals"]["clean"];
    let tuning = Tuning::new(0.6).unwrap();
    let (classical, robust) = wavelet::classical_and_robust(&signal, 11, &tuning).unwrap();
    for (together, alone) in classical
        .iter()
        .zip(wavelet::classical(&signal, 11).unwrap())
    {
        // The same squares, summed in another order.
        assert_relative(*together, alone, 1e-14, "classical beside robust");
    }
    let comparable = truth["robust_comparable"].as_array().unwrap();
    for i in 0..11 {
        let level = i as u32 + 1;
        let expected = |key: &str| truth[key][i].as_f64().unwrap();
        assert_relative(
            classical[i],
            expected("classical"),
            1e-12,
            &format!("classical {level}"),
        );
        assert_eq!(
            coefficient_count(4096, level) as u64,
            truth["M"][i].as_u64().unwrap()
        );
        let edof = interval::edof_eta3(4096, level);
        assert_relative(edof, expected("edof"), 1e-15, "edof");
        let (low, high) = interval::interval(classical[i], edof, 0.95);
        assert_relative(low, expected("ci_low"), 1e-9, &format!("low {level}"));
        assert_relative(high, expected("ci_high"), 1e-9, &format!("high {level}"));
        if comparable[i].as_bool().unwrap() {
            assert_relative(
                robust[i].value,
                expected("robust"),
                1e-12,
                &format!("robust {level}"),
            );
            assert_eq!(
                robust[i].status.name(),
                truth["robust_status"][i].as_str().unwrap()
            );
        }
    }
}

#[test]
fn exact_curves_give_back_their_parameters() {
    let truth = truth("fit_exact.json");
    let samples = truth["T"].as_u64().unwrap() as usize;
    let tolerance = truth["tolerance_rel"].as_f64().unwrap();
    let cases = truth["cases"].as_array().unwrap();
    assert_eq!(cases.len(), 4);
    for case in cases {
        let wv = numbers(&case["nu_hat"]);
        let levels: Vec<u32> = (1..=wv.len() as u32).collect();
        let edof = levels
            .iter()
            .map(|j| interval::edof_eta3(samples, *j))
            .collect();
        let spec: String = case["components"]
            .as_array()
            .unwrap()
            .iter()
            .map(|c| c.as_str().unwrap())
            .collect::<Vec<_>>()
            .join("+");
        let curve = Curve {
            levels,
            wv,
            edof,
            ..Curve::default()
        };
        let fit = fit(&curve, &spec.parse().unwrap(), 1.0, Weighting::Edof).unwrap();
        // The truth lists AR1s by descending correlation time, the fit by ascending.
        let expected = composite(&case["components"], &numbers(&case["theta"]), 1.0);
        for code in ["WN", "QN", "AR1", "RW"] {
            let of = |c: &Composite| -> Vec<f64> {
                let mut found: Vec<_> = c
                    .processes
                    .iter()
                    .filter(|p| p.code() == code)
                    .map(Process::parameters)
                    .collect();
                found.sort_by(|a, b| a[0].1.total_cmp(&b[0].1));
                found.concat().into_iter().map(|(_, v)| v).collect()
            };
            for (actual, expected) in of(&fit.composite).iter().zip(of(&expected)) {
                assert_relative(
                    *actual,
                    expected,
                    1e-3 * tolerance,
                    &format!("{spec} {code}"),
                );
            }
        }
        assert_eq!(fit.termination, Termination::Converged);
        assert!(
            fit.objective < 1e-15 && fit.zero.is_empty() && fit.at_end.is_empty(),
            "{fit:?}"
        );
        let phis: Vec<f64> = fit
            .composite
            .processes
            .iter()
            .filter(|p| p.code() == "AR1")
            .map(|p| p.parameters()[0].1)
            .collect();
        assert!(phis.is_sorted());
    }
}
