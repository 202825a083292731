//! Turn-on biases that the means of recordings show, as a user meets them.

use crate::common::drive::*;
use nav_sim::io::model_file;
use nav_sim::signal::imu::Sensor;

/// Biases with which the gyroscopes of four recordings were switched on (rad/s).
const BIASES: [f64; 4] = [3e-3, -2e-3, 1e-3, -4e-3];

/// Four recordings; the gyroscopes of each with a constant bias times this.
fn recordings(place: &Place, times: f64) {
    place.done("synthesize imu.toml --replicates 4 --samples 4096 --seed 1 -o static");
    for (k, bias) in (1..).zip(BIASES) {
        let name = format!("static/replicate_{k}.csv");
        place.edit(&name, &name, |row, line| {
            let mut cells: Vec<String> = line.split(',').map(str::to_owned).collect();
            for cell in cells.iter_mut().skip(4).filter(|_| row > 0) {
                *cell = format!("{:e}", cell.parse::<f64>().unwrap() + times * bias);
            }
            cells.join(",")
        });
    }
}

const CALIBRATE: &str = "calibrate static --model WN+AR1 --bootstrap 0 --seed 1 -o m.toml";

fn place() -> Place {
    place_with(DRIVE, &MODEL.replace("phi = 0.9999", "phi = 0.99"))
}

#[test]
fn a_turn_on_bias_is_stored_said_and_expected_by_run() {
    let place = place();
    recordings(&place, 1.0);
    let ran = place.done(CALIBRATE);
    assert!(ran.stderr.contains("gyro: turn-on bias "), "{}", ran.stderr);
    let stored = model_file::read(&place.at("m.toml"))
        .unwrap()
        .turn_on
        .unwrap();
    // 3.1e-3 rad/s; the noise of a mean (WN 2.2e-5, AR1 3e-6 rad/s) moves it by 0.7 % at one deviation
    let mean = BIASES.iter().sum::<f64>() / 4.0;
    let sigma = (BIASES.iter().map(|b| (b - mean).powi(2)).sum::<f64>() / 3.0).sqrt();
    let axes = stored.axes(Sensor::Gyro).unwrap();
    assert!(
        axes.iter().all(|s| off(*s, sigma) < 0.03) && axes[0] != axes[1],
        "{axes:?} {sigma}"
    );
    assert_eq!(stored.axes(Sensor::Accel), None);
    let turn_on = &place.answer(CALIBRATE)["turn_on"];
    let findings = [0, 1].map(|sensor| &turn_on[sensor]["finding"]);
    assert_eq!(findings, ["within_noise", "seen"]);
    assert_eq!(number(turn_on, "/1/sigmas/0"), axes[0]);
    place.done("run drive.toml m.toml --runs 2 --outage 30:40 --seed 1 -o out");
    let initial = &place.json("out/manifest.json")["configuration"]["initial"];
    assert!(
        off(number(initial, "/gyro_bias_sigma_rad_s"), sigma) < 0.03,
        "{initial}"
    );
    // a design has it on the same drive, and so the same errors
    let outage = "--outage 30:40";
    let design = "design m.toml --recordings 4 --hours 0.1 --draws 40 --trajectory drive.toml";
    let planned = place.answer(&format!("{design} {outage}"));
    let run = "run drive.toml m.toml --method lincov --filter full";
    let made = place.answer(&format!("{run} {outage}"));
    assert_eq!(
        number(&planned, "/designs/0/horizontal_p95/0/p95_m"),
        number(&made, "/outages/0/horizontal_error_end_m/p95")
    );
}

#[test]
fn recordings_of_one_bias_have_none_and_those_of_another_mounting_tell_nothing() {
    let place = place();
    for (times, note) in [
        (0.0, "gyro: no turn-on bias: the means"),
        (40.0, "gyro: no turn-on bias stored: means differ"),
    ] {
        recordings(&place, times);
        let ran = place.done(&format!("{CALIBRATE} --verbose"));
        assert!(ran.stderr.contains(note), "{}", ran.stderr);
        assert_eq!(model_file::read(&place.at("m.toml")).unwrap().turn_on, None);
    }
}
