//! Figures of `tune`; what it refuses is in `transcripts/plans.md`.

use crate::common::drive::*;

const BIASED: &str = r#"rate_hz = 100.0
[accel]
processes = [{ type = "WN", sigma2 = 1e-4 }, { type = "RW", gamma2 = 1e-10, gamma2_ci95 = [8e-11, 2e-10] }]
[gyro]
processes = [{ type = "WN", sigma2 = 1e-8 }, { type = "RW", gamma2 = 1e-12 }]
[turn_on]
gyro_rad_s = 1e-4
"#;

#[test]
fn the_tuned_file_has_the_factor_and_says_where_it_came_from() {
    let place = place_with(DRIVE, BIASED);
    place.write(
        "truth.toml",
        BIASED.replace("1e-8", "4e-8").replace("1e-12", "4e-12"),
    );
    let tune = "tune imu.toml --truth truth.toml -o tuned.toml";
    let found = place.answer(tune);
    let ratio = |filter: usize| number(&found, &format!("/filters/{filter}/largest_ratio"));
    assert!(ratio(0) > 1.5 && (ratio(1) - 1.0).abs() < 5e-3, "{found}");
    // two outages as long as the default, 90 s, on the built-in drive: after 300 s, and 240 s later
    let ends = found["filters"][1]["outage_end"].as_array().unwrap().iter();
    let ends: Vec<f64> = ends.map(|end| number(end, "/after_s")).collect();
    assert_eq!(ends, [390.0, 720.0]);
    let tuned: toml::Table = place.read("tuned.toml").parse().unwrap();
    let walk = &tuned["gyro"]["processes"][1];
    assert!(
        off(walk["gamma2"].as_float().unwrap(), 4e-12) < 0.05,
        "{walk}"
    );
    // a tuned amplitude is no estimate with an interval
    assert!(tuned["accel"]["processes"][1].get("gamma2_ci95").is_none());
    assert!(tuned["turn_on"].is_table());
    assert_eq!(tuned["provenance"]["inputs"].as_array().unwrap().len(), 2);
    let shown = place.done(tune).stdout;
    assert!(shown.contains("gyro × 4.0"), "{shown}");
    assert!(shown.lines().count() <= 20 && shown.lines().all(|l| l.chars().count() <= 120));
}

/// `--filter` wins over the scenario, as with `run`; a filter that `run` makes anyway is judged once.
#[test]
fn the_filter_that_is_asked_for_is_tuned_and_named() {
    let place = place_with(DRIVE, BIASED);
    place.write("truth.toml", BIASED.replace("1e-12", "4e-12"));
    place.write("states.toml", "[filter]\nstates = \"21\"\n");
    let tune = "tune imu.toml --truth truth.toml --trajectory drive.toml --outage 20:30 --filter";
    for (filter, named, default, filters) in [
        ("15", "the filter of 15 states is ", "", 3),
        (
            "15 --scenario states.toml",
            "the filter of 15 states is ",
            "the filter of 21 states, the default",
            4,
        ),
        (
            "21",
            "the filter of 21 states is ",
            "the filter of 15 states, the default",
            4,
        ),
    ] {
        let found = place.answer(&format!("{tune} {filter}"));
        let verdict = found["verdict"].as_str().unwrap();
        assert!(
            verdict.contains(named) && verdict.contains(default),
            "{verdict}"
        );
        assert_eq!(
            found["filters"].as_array().unwrap().len(),
            filters,
            "{verdict}"
        );
    }
}

/// A filter is judged by the errors that `run` makes of the same files: biases of a truth's `[turn_on]` and defects of a
/// scenario count beside the noise, and a filter that does not expect them is not called consistent.
#[test]
fn defects_beside_the_noise_are_judged_as_run_judges_them() {
    let silent = BIASED.split("[turn_on]").next().unwrap();
    let place = place_with(DRIVE, silent);
    let turned_on = format!("{silent}[turn_on]\naccel_m_s2 = 0.02\ngyro_rad_s = 3e-4\n");
    place.write("turned_on.toml", turned_on);
    place.write(
        "defects.toml",
        "[imu]\nscale_ppm_gyro = 3000.0\nmisalignment_rad = 0.002\n",
    );
    place.write(
        "coloured.toml",
        "[gnss]\ncorrelated_pos_sigma_m = [5.0, 5.0, 9.0]\ncorrelation_time_s = 60.0\n",
    );
    for (options, cause) in [
        (
            "--truth turned_on.toml",
            "turn-on bias of 0.02 m/s², the filter expects 0",
        ),
        (
            "--truth imu.toml --scenario defects.toml",
            "scale-factor error of 3000 ppm, the filter expects 0",
        ),
        ("--truth imu.toml --scenario coloured.toml", ""),
    ] {
        let rest = format!("{options} --outage 30:40 --filter full --seed 1");
        let tune = place.judged(&format!(
            "tune imu.toml --trajectory drive.toml {rest} --format json"
        ));
        assert!(tune.stderr.contains(cause), "{}", tune.stderr);
        let tuned = serde_json::from_str(&tune.stdout).unwrap();
        let tuned = number(&tuned, "/filters/0/nees");
        place.judged(&format!(
            "run drive.toml imu.toml {rest} --method lincov -o out"
        ));
        let ran = number(&place.json("out/summary.json"), "/nees/mean");
        assert!(
            ran > 12.0 && off(tuned, ran) < 1e-6,
            "{rest}: tune {tuned}, run {ran}"
        );
    }
}

/// No noise of the IMU stands for a mounting that the filter leaves out: the sigma of the constraint does,
/// and with the sigma that is found `run` calls the filter what it is.
#[test]
fn the_sigma_that_covers_the_errors_of_aiding_is_found() {
    let place = Place::checkout();
    let scenario = |sigma: f64| {
        let truth = "truth = { mounting_sigma_deg = 0.5 }";
        place.write(
            "car.toml",
            format!("[aiding.nhc]\nsigma_m_s = {sigma}\n{truth}\n"),
        );
    };
    scenario(0.1);
    let (model, drive) = ("calib_data/tactical.toml", "examples/quick_drive.toml");
    let common = "--scenario car.toml --outage 25:55";
    let found = place.answer(&format!("tune {model} --trajectory {drive} {common}"));
    let factor = number(&found, "/aiding_sigma_factor");
    assert!(factor > 1.5, "{found}");
    let kind = |sigma: f64| {
        scenario(sigma);
        let run = format!("run {drive} {model} --method lincov --filter full -o out {common}");
        place.answer(&run)["verdict"]["kind"].clone()
    };
    assert_eq!(kind(0.1), "overconfident");
    assert_ne!(kind(0.1 * factor), "overconfident");
}
