//! Pages and pictures beside results: where they appear, the numbers that they show. How they look is held by
//! `tests/browser/pages.py`.

use crate::common::drive::*;
use serde_json::Value;

/// Every number of the page that says where it stands in the results stands there; returns how many there are.
fn numbers_as_in(page: &str, results: &Value) -> usize {
    assert!(page.starts_with("<!DOCTYPE html>") && page.ends_with("</html>\n"));
    // a number that is none, or a link
    assert!(
        !["NaN", "inf ", "=\"http"]
            .iter()
            .any(|text| page.contains(text)),
        "{page}"
    );
    let cells = page.split("data-json=\"").skip(1);
    let check = |cell: &str| {
        let (source, rest) = cell.split_once('"').unwrap();
        let shown = rest.split(['>', '<']).nth(1).unwrap();
        let value = results
            .pointer(source)
            .unwrap_or_else(|| panic!("{source} is no result"));
        let value = value.as_f64().unwrap_or(f64::NAN);
        let expected = match shown.strip_suffix(" %") {
            Some(_) => format!("{:.0} %", 100.0 * value),
            None => nav_sim::report::readable(value),
        };
        assert_eq!(shown, expected, "{source}");
    };
    cells.map(check).count()
}

fn assert_picture(svg: &str) {
    assert!(
        svg.starts_with("<svg") && svg.ends_with("</svg>\n"),
        "{svg}"
    );
}

/// Three recordings of 4096 samples in `static`.
fn recordings() -> Place {
    let place = place_with(DRIVE, MODEL);
    place.done("synthesize imu.toml --replicates 3 --samples 4096 --seed 1 -o static");
    place
}

#[test]
fn calibrate_writes_its_page_beside_the_model_the_same_on_any_number_of_threads() {
    let place = recordings();
    let command = "calibrate static --model WN+RW --seed 1 --bootstrap 20 -o m.toml";
    let results = place.answer(&format!("{command} -j 1"));
    let [page, picture] = ["m.html", "m.svg"].map(|name| place.read(name));
    // figures N, B and K where there are any; objective and two probabilities of two fits
    let fits = results["fits"].as_array().unwrap().iter();
    let figures = fits.flat_map(|fit| fit["figures"].as_object().unwrap().values());
    let stated = figures.filter(|figure| figure["value"].is_number()).count();
    assert_eq!(numbers_as_in(&page, &results), stated + 6);
    assert_picture(&picture);
    place.done(&format!("{command} -j 2"));
    assert!([page, picture] == ["m.html", "m.svg"].map(|name| place.read(name)));
}

#[test]
fn wv_writes_a_page_and_a_picture_where_it_is_told() {
    let place = recordings();
    place.done("wv static --plot curves.html --plot curves.svg");
    numbers_as_in(&place.read("curves.html"), &Value::Null);
    assert!(place.read("curves.svg").contains("Gyroscope"));
    let png = place.run("wv static --plot curves.PNG");
    if cfg!(feature = "pictures") {
        assert_eq!(
            std::fs::read(place.at("curves.PNG")).unwrap()[..4],
            *b"\x89PNG"
        );
    } else {
        let message = "error: curves.PNG: neither page nor picture\n\nhint: end the name in .html or .svg (.png with feature `pictures`)\n";
        assert!(png.code == 2 && png.stderr.ends_with(message), "{png:?}");
    }
    for file in ["curves", "static/replicate_1.csv"] {
        let refused = place.ends(&format!("wv static --plot {file}"), 2).stderr;
        assert!(refused.contains("neither page nor picture"), "{refused}");
    }
}

#[test]
fn runs_and_their_comparison_have_pages_with_the_numbers_of_their_results() {
    let place = place_with(DRIVE, MODEL);
    let run = "run drive.toml imu.toml --runs 4 --outage 30:40 --seed 5";
    place.done(&format!("{run} -o I_awv --plot run.svg"));
    place.done(&format!("{run} --filter full -o I_dr-awv"));
    let page = place.read("I_awv/report.html");
    assert!(numbers_as_in(&page, &place.json("I_awv/summary.json")) > 40);
    let charts = ["Horizontal position error", "NEES (9 if right)"];
    let inputs = ["att_sigma_deg", "Reference trajectory", "30–40 s"];
    assert!(
        charts
            .iter()
            .chain(&inputs)
            .all(|words| page.contains(words)),
        "{page}"
    );
    let svg = place.read("run.svg");
    assert!(charts.iter().all(|words| svg.contains(words)), "{svg}");
    place.done("compare I_dr-awv --reference I_awv -o out/c.json --plot c.svg");
    let page = place.read("out/c.html");
    // one run, one outage: NEES, its reference, coverage, two RMSE
    assert_eq!(numbers_as_in(&page, &place.json("out/c.json")), 5);
    assert!(page.contains("30–40 s") && place.read("c.svg").contains("East position"));
}

#[test]
fn tune_require_and_design_write_a_page_with_the_numbers_they_print() {
    let place = place_with(DRIVE, MODEL);
    place.write("worse.toml", MODEL.replace("sigma2 = ", "sigma2 = 4"));
    for (k, (command, least)) in [
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
    ]
    .into_iter()
    .enumerate()
    {
        let plots = format!("--plot {k}.html --plot {k}.svg");
        let ran = place.judged(&format!("{command} --format json {plots}"));
        let results = serde_json::from_str(&ran.stdout).unwrap();
        let count = numbers_as_in(&place.read(&format!("{k}.html")), &results);
        assert!(count >= least, "{command}: {count}");
        // an answer without a figure is an empty picture
        assert_picture(&place.read(&format!("{k}.svg")));
    }
}
