//! Holds the import rule of the architecture (crate documentation): a module names only modules that
//! stand above it, and of those only the ones listed here.

#![allow(clippy::unwrap_used, reason = "a test")]

use std::{fs, path::Path};

/// (module, what it may name of the crate besides itself).
const MAY_NAME: &[(&str, &[&str])] = &[
    ("bibliography", &[]),
    ("units", &[]),
    ("linalg", &[]),
    ("lanes", &[]),
    ("rng", &[]),
    ("frames", L0),
    ("earth", &["bibliography", "units", "linalg", "lanes", "rng", "frames"]),
    ("imu", L0),
    ("gnss", L0),
    ("noise", L1),
    ("wavelet", L1),
    ("trajectory", L1),
    ("calibration", &["bibliography", "units", "linalg", "lanes", "rng", "imu", "noise", "wavelet"]),
    ("sensors", &["@L1", "trajectory", "noise", "wavelet"]),
    ("strapdown", &["@L1", "noise"]),
    ("ekf", &["@L1", "strapdown", "noise"]),
    ("closure", &["@L1", "trajectory", "sensors", "strapdown"]),
    ("fusion", &["@L1", "noise", "trajectory", "sensors", "strapdown", "ekf"]),
    ("simulation", &["@L1", "noise", "trajectory", "sensors", "strapdown", "ekf"]),
    ("scenario", &["@L1", "noise", "trajectory", "sensors", "strapdown", "ekf", "simulation"]),
    ("throughput", &["@L1", "noise", "sensors", "strapdown", "ekf"]),
    ("monte_carlo", &["@L1", "noise", "trajectory", "sensors", "strapdown", "ekf", "simulation"]),
    ("metrics", &["@L1", "noise", "ekf", "simulation", "monte_carlo"]),
    (
        "batch",
        &[
            "@L1",
            "noise",
            "wavelet",
            "trajectory",
            "calibration",
            "sensors",
            "ekf",
            "scenario",
            "simulation",
            "monte_carlo",
        ],
    ),
    ("study", &["bibliography", "rng", "imu", "noise", "wavelet", "calibration"]),
    (
        "report",
        &[
            "@L1",
            "noise",
            "wavelet",
            "calibration",
            "ekf",
            "fusion",
            "scenario",
            "simulation",
            "monte_carlo",
            "metrics",
            "batch",
            "study",
        ],
    ),
    (
        "data",
        &[
            "@L1",
            "noise",
            "wavelet",
            "trajectory",
            "calibration",
            "ekf",
            "strapdown",
            "sensors",
            "fusion",
            "scenario",
            "simulation",
            "metrics",
            "batch",
            "report",
            "study",
        ],
    ),
];
const L0: &[&str] = &["bibliography", "units", "linalg", "lanes", "rng"];
const L1: &[&str] = &["bibliography", "units", "linalg", "lanes", "rng", "earth", "frames", "gnss", "imu"];

fn sources(path: &Path, into: &mut Vec<(String, String)>) {
    for entry in fs::read_dir(path).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            sources(&path, into);
        } else if path.extension().is_some_and(|e| e == "rs") {
            into.push((path.display().to_string(), fs::read_to_string(&path).unwrap()));
        }
    }
}

/// The crate modules a source text names: every `crate::module`, also inside braces.
fn named(text: &str) -> Vec<String> {
    let code: String =
        text.lines().filter(|l| !l.trim_start().starts_with("//")).collect::<Vec<_>>().join("\n");
    let code = code.split("#[cfg(test)]").next().unwrap().to_owned();
    let mut names = Vec::new();
    for rest in code.split("crate::").skip(1) {
        let word = |s: &str| s.chars().take_while(|c| c.is_alphanumeric() || *c == '_').collect::<String>();
        match rest.strip_prefix('{') {
            None => names.push(word(rest)),
            Some(group) => {
                let mut depth = 0;
                let mut item = String::new();
                for c in group.chars() {
                    match c {
                        '{' => depth += 1,
                        '}' if depth == 0 => break,
                        '}' => depth -= 1,
                        ',' if depth == 0 => names.push(word(item.drain(..).as_str().trim())),
                        _ => item.push(c),
                    }
                }
                names.push(word(item.trim()));
            }
        }
    }
    names.retain(|n| !n.is_empty());
    names
}

#[test]
fn modules_name_only_what_the_architecture_allows() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let mut violations = Vec::new();
    for (module, allowed) in MAY_NAME {
        let mut files = Vec::new();
        if root.join(module).is_dir() {
            sources(&root.join(module), &mut files);
        }
        let single = root.join(format!("{module}.rs"));
        if single.exists() {
            files.push((single.display().to_string(), fs::read_to_string(&single).unwrap()));
        }
        assert!(!files.is_empty(), "no source for module {module}");
        for (file, text) in files {
            for name in named(&text) {
                let in_l1 = allowed.contains(&"@L1") && L1.contains(&name.as_str());
                if name != *module && !in_l1 && !allowed.contains(&name.as_str()) {
                    violations.push(format!("{file} names crate::{name}"));
                }
            }
        }
    }
    assert!(violations.is_empty(), "{}", violations.join("\n"));
}

#[test]
fn every_module_is_in_the_table() {
    let lib = fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("src/lib.rs")).unwrap();
    for line in lib.lines().filter_map(|l| l.strip_prefix("pub mod ")) {
        let module = line.trim_end_matches(';');
        assert!(MAY_NAME.iter().any(|(m, _)| *m == module), "{module} has no row in the table");
    }
}

#[test]
fn only_the_command_line_sees_clock_environment_terminal() {
    let mut files = Vec::new();
    sources(&Path::new(env!("CARGO_MANIFEST_DIR")).join("src"), &mut files);
    for (file, text) in files
        .iter()
        .filter(|(f, _)| !f.contains("/cli/") && !f.ends_with("main.rs") && !f.ends_with("tests.rs"))
    {
        for word in ["std::env", "std::time", "Instant::now", "println!", "rand::rng()", "num_threads"] {
            assert!(!text.contains(word), "{file} uses {word}");
        }
    }
}
