//! Theory and estimators against numbers from independent implementations (`tests/truth/README.md`).

use nav_sim::noise::{Ar1, Composite, Drift, GaussMarkov, Ma1, Process, Quantization, RandomWalk, White};
use serde_json::Value;

fn truth(file: &str) -> Value {
    let path = format!("{}/tests/truth/{file}", env!("CARGO_MANIFEST_DIR"));
    serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap()
}

fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().unwrap().iter().map(|v| v.as_f64().unwrap()).collect()
}

fn composite(components: &Value, theta: &[f64], rate_hz: f64) -> Composite {
    let mut parameters = theta.iter().copied();
    let mut next = || parameters.next().unwrap();
    let process = |code: &Value| match code.as_str().unwrap() {
        "WN" => Process::White(White::new(next()).unwrap()),
        "QN" => Process::Quantization(Quantization::new(next()).unwrap()),
        "AR1" => Process::Ar1(Ar1::new(next(), next()).unwrap()),
        "RW" => Process::RandomWalk(RandomWalk::new(next()).unwrap()),
        "DR" => Process::Drift(Drift::new(next()).unwrap()),
        "GM" => Process::GaussMarkov(GaussMarkov::new(next(), next(), rate_hz).unwrap()),
        "MA1" => Process::Ma1(Ma1::new(next(), next()).unwrap()),
        other => panic!("{other}"),
    };
    let composite = Composite::new(components.as_array().unwrap().iter().map(process).collect());
    assert!(parameters.next().is_none());
    composite
}

#[track_caller]
fn assert_relative(actual: f64, expected: f64, tolerance: f64, what: &str) {
    let error = ((actual - expected) / expected).abs();
    assert!(error <= tolerance, "{what}: {actual:e}, truth {expected:e}, relative error {error:e}");
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
            assert_relative(model.haar_wv(level), nu[i], 1e-13, &format!("{name}, level {level}"));
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
