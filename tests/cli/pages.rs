//! Pages and pictures beside results: where they appear, what they hold, what they never replace. How they look is held by
//! `tests/browser/pages.py`.

use crate::common::drive::*;
use serde_json::Value;
use std::fs;
use std::path::Path;

fn text(path: &Path) -> String {
    fs::read_to_string(path).unwrap_or_else(|e| panic!("{}: {e}", path.display()))
}

/// Every number of the page that says where it stands in the results stands there; returns how many there are.
fn numbers_as_in(page: &str, results: &Value) -> usize {
    let cells: Vec<(&str, &str)> = page
        .split("data-json=\"")
        .skip(1)
        .map(|rest| {
            (
                rest.split('"').next().unwrap(),
                rest.split(['>', '<']).nth(1).unwrap(),
            )
        })
        .collect();
    for (source, shown) in &cells {
        let value = results
            .pointer(source)
            .unwrap_or_else(|| panic!("{source} is not in the results"));
        let value = value.as_f64().unwrap_or(f64::NAN);
        let expected = match shown.strip_suffix(" %") {
            Some(_) => format!("{:.0} %", 100.0 * value),
            None => nav_sim::report::readable(value),
        };
        assert_eq!(*shown, expected, "{source}");
    }
    cells.len()
}

fn is_whole(page: &str) {
    assert!(page.starts_with("<!DOCTYPE html>") && page.ends_with("</html>\n"));
    assert!(
        !page.contains("NaN") && !page.contains("inf ") && !page.contains("=\"http"),
        "not a number, or a link"
    );
}

/// Noise of 4096 samples, three recordings.
fn recordings(place: &Path) {
    done(
        place,
        "synthesize imu.toml --replicates 3 --samples 4096 --seed 1 -o static",
    );
}

#[test]
fn calibrate_writes_its_page_beside_the_model_the_same_on_any_number_of_threads() {
    let place = place_with(DRIVE, MODEL);
    let dir = place.path();
    recordings(dir);
    let command = "calibrate static --model WN+RW --seed 1 --bootstrap 20 --format json -o m.toml";
    let ran = done(dir, &format!("{command} -j 1"));
    assert!(
        ran.stderr
            .contains("wrote m.draws.json, m.wv.json, m.toml, m.html, m.svg"),
        "{}",
        ran.stderr
    );
    let page = text(&dir.join("m.html"));
    is_whole(&page);
    assert!(page.contains("Accelerometer, all axes") && page.contains("data / model"));
    let results: Value = serde_json::from_str(&ran.stdout).unwrap();
    // what of N, B and K there is; objective and two probabilities of two fits
    let fits = results["fits"].as_array().unwrap();
    let figures = |fit: &Value| fit["figures"].as_object().unwrap().clone();
    let stated = fits
        .iter()
        .flat_map(figures)
        .filter(|f| f.1["value"].is_number());
    assert_eq!(numbers_as_in(&page, &results), stated.count() + 6);
    let picture = text(&dir.join("m.svg"));
    assert!(picture.starts_with("<svg xmlns=") && picture.ends_with("</svg>\n"));
    done(dir, &format!("{command} -j 2"));
    assert_eq!(
        (page, picture),
        (text(&dir.join("m.html")), text(&dir.join("m.svg")))
    );
}

#[test]
fn a_page_of_somebody_else_is_not_replaced() {
    let place = place_with(DRIVE, MODEL);
    let dir = place.path();
    recordings(dir);
    fs::write(dir.join("m.html"), "<p>mine</p>").unwrap();
    let ran = nav_sim(
        dir,
        "calibrate static --model WN --seed 1 --bootstrap 0 -o m.toml",
    );
    assert!(
        ran.code == 2 && ran.stderr.contains("m.html is not of this command"),
        "{}",
        ran.stderr
    );
    assert!(text(&dir.join("m.html")) == "<p>mine</p>" && !dir.join("m.toml").exists());
}

#[test]
fn wv_writes_a_page_and_a_picture_where_it_is_told() {
    let place = place_with(DRIVE, MODEL);
    let dir = place.path();
    recordings(dir);
    done(dir, "wv static --plot curves.html --plot curves.svg");
    is_whole(&text(&dir.join("curves.html")));
    assert!(text(&dir.join("curves.svg")).contains("Gyroscope"));
    let ran = nav_sim(dir, "wv static --plot curves.PNG");
    if cfg!(feature = "pictures") {
        assert!(
            fs::read(dir.join("curves.PNG"))
                .unwrap()
                .starts_with(b"\x89PNG\r\n\x1a\n")
        );
    } else {
        let said = "curves.PNG: neither page nor picture\n\nhint: end the name in .html or .svg (.png with";
        assert!(ran.code == 2 && ran.stderr.contains(said), "{}", ran.stderr);
    }
    let ran = nav_sim(dir, "wv static --plot curves");
    assert!(
        ran.code == 2 && ran.stderr.contains("curves: neither page nor picture"),
        "{}",
        ran.stderr
    );
    let ran = nav_sim(dir, "wv static --plot static/replicate_1.csv");
    assert!(
        ran.code == 2 && ran.stderr.contains("neither page nor picture"),
        "{}",
        ran.stderr
    );
}

#[test]
fn runs_and_their_comparison_have_pages_with_the_numbers_of_their_results() {
    let place = place_with(DRIVE, MODEL);
    let dir = place.path();
    let run = "run drive.toml imu.toml --runs 4 --outage 30:40 --seed 5";
    done(dir, &format!("{run} -o I_awv --plot run.svg"));
    done(dir, &format!("{run} --filter full -o I_dr-awv"));
    let page = text(&dir.join("I_awv/report.html"));
    is_whole(&page);
    let summary: Value = serde_json::from_str(&text(&dir.join("I_awv/summary.json"))).unwrap();
    assert!(numbers_as_in(&page, &summary) > 40);
    for word in [
        "GNSS",
        "att_sigma_deg",
        "Reference trajectory",
        "Horizontal position error",
        "NEES (9 if right)",
        "30–40 s",
    ] {
        assert!(page.contains(word), "{word}");
    }
    let svg = text(&dir.join("run.svg"));
    assert!(svg.contains("Horizontal position error") && svg.contains("NEES (9 if right)"));
    let ran = done(
        dir,
        "compare I_dr-awv --reference I_awv -o out/c.json --plot c.svg",
    );
    assert!(
        ran.stderr.contains("wrote out/c.json, out/c.html"),
        "{}",
        ran.stderr
    );
    let page = text(&dir.join("out/c.html"));
    is_whole(&page);
    let comparison: Value = serde_json::from_str(&text(&dir.join("out/c.json"))).unwrap();
    assert_eq!(numbers_as_in(&page, &comparison), 5); // one run, one outage: NEES, its reference, coverage, two RMSE
    assert!(page.contains("30–40 s") && text(&dir.join("c.svg")).contains("East position"));
}

#[test]
fn tune_require_and_design_write_a_page_with_the_numbers_they_print() {
    let place = place_with(DRIVE, MODEL);
    let dir = place.path();
    fs::write(
        dir.join("worse.toml"),
        MODEL.replace("sigma2 = ", "sigma2 = 4"),
    )
    .unwrap();
    let commands = [
        (
            "tune imu.toml --truth worse.toml --trajectory drive.toml --outage 30:40",
            4 * 3 + 2,
        ),
        ("require drive.toml --outage 10 --require p95_m<=50", 4 * 3),
        (
            "require drive.toml imu.toml --outage 30:40 --require p95_m<=50",
            2,
        ),
        (
            "require drive.toml imu.toml --outage longest --require p95_m<=50",
            2,
        ),
        (
            "require drive.toml --outage 10 --require p95_m<=50 --catalogue",
            17 * 2,
        ),
        ("design imu.toml --recordings 3 --hours 0.2 --draws 40", 2),
    ];
    for (k, (command, least)) in commands.into_iter().enumerate() {
        let ran = nav_sim(
            dir,
            &format!("{command} --format json --plot {k}.html --plot {k}.svg"),
        );
        assert!(ran.code == 0 || ran.code == 3, "{command}: {}", ran.stderr);
        assert!(
            ran.stderr.contains(&format!("wrote {k}.html")),
            "{}",
            ran.stderr
        );
        let page = text(&dir.join(format!("{k}.html")));
        is_whole(&page);
        // what has no figure is an empty picture
        let svg = text(&dir.join(format!("{k}.svg")));
        assert!(
            svg.starts_with("<svg") && svg.ends_with("</svg>\n"),
            "{svg}"
        );
        let numbers = numbers_as_in(&page, &serde_json::from_str(&ran.stdout).unwrap());
        assert!(numbers >= least, "{command}: {numbers}");
    }
    fs::write(dir.join("worse.html"), MODEL).unwrap();
    let ran = nav_sim(dir, "tune imu.toml --truth worse.html --plot worse.html");
    assert!(
        ran.code == 2 && ran.stderr.contains("would be overwritten"),
        "{}",
        ran.stderr
    );
}
