//! Figures of `require`; what it says and refuses is in `transcripts/plans.md`.

use crate::common::drive::*;
use serde_json::{Value, json};

/// A drive whose middle is the worst place of an outage.
const TURNS: &str = r#"
start = { lat_deg = 46.5, lon_deg = 6.5, h_m = 400, heading_deg = 40 }
segment = [
  { kind = "straight", duration_s = 20 },
  { kind = "accelerate", to_speed_m_s = 10, duration_s = 10 },
  { kind = "turn", angle_deg = 90, duration_s = 10 },
  { kind = "straight", duration_s = 20 },
  { kind = "turn", angle_deg = -90, duration_s = 10 },
  { kind = "straight", duration_s = 45 },
  { kind = "accelerate", to_speed_m_s = 20, duration_s = 5 },
  { kind = "turn", angle_deg = 120, duration_s = 15 },
  { kind = "straight", duration_s = 45 },
]
"#;
const EIGHT: &str = "trajectories/figure_eight.toml";
const TACTICAL: &str = "calib_data/tactical.toml";
const CONSUMER: &str = "calib_data/consumer_mems.toml";
const NAMES: [&str; 2] = ["consumer_mems", "tactical"];

fn place() -> Place {
    let place = Place::checkout();
    place.write("turns.toml", TURNS);
    for name in NAMES {
        place.write(
            &format!("units/{name}.toml"),
            place.read(&format!("calib_data/{name}.toml")),
        );
    }
    place
}

/// The answer to a question, whether the limits are kept or not.
fn answer(place: &Place, question: &str) -> Value {
    let ran = place.judged(&format!("require {question} --format json"));
    serde_json::from_str(&ran.stdout).unwrap()
}

fn unit<'a>(ranking: &'a Value, name: &str) -> &'a Value {
    let mut units = ranking["units"].as_array().unwrap().iter();
    units.find(|unit| unit["unit"] == name).unwrap()
}

#[test]
fn the_imu_that_is_named_meets_the_limit_and_a_tighter_one_not() {
    let place = place();
    let question = format!("{EIGHT} --outage 60:90 --require p95_m<=10 -o needed.toml");
    assert_eq!(
        answer(&place, &question)["figures"]
            .as_array()
            .unwrap()
            .len(),
        4
    );
    // met: the longest is no shorter than the one that is asked for; not met: it is
    let judged = |outage: &str, limit: f64| {
        let limit = format!("--require p95_m<={limit}");
        answer(
            &place,
            &format!("{EIGHT} needed.toml --outage {outage} {limit}"),
        )
    };
    for (limit, is_met) in [(10.0, true), (9.97, false)] {
        let found = judged("60:90", limit);
        let seconds = number(&found, "/outage/longest_s");
        assert!(
            found["met"] == is_met && (seconds >= 30.0) == is_met,
            "{limit}: {found}"
        );
    }
    // the outage that it bridges is the one that it was made for, to the second
    let seconds = number(&judged("60:61", 10.0), "/outage/longest_s");
    assert!((29.0..=31.0).contains(&seconds), "{seconds}");
    // `run` takes steps of a fifth of a second where the search takes one: its reserve covers that
    place.done(&format!(
        "run {EIGHT} needed.toml --filter full --method lincov --outage 60:90 --require p95_m<=10"
    ));
}

/// The turn-on biases that an answer takes for granted stand in the model file that is written: it keeps the
/// limit by itself. An IMU that has them may have less noise.
#[test]
fn the_turn_on_biases_of_a_needed_imu_are_written() {
    let place = place();
    place.write("biased.toml", "[imu]\nturn_on_bias_accel_m_s2 = 0.02\n");
    let question = "--outage 60:90 --require p95_m<=10";
    let needed = |options: &str| {
        place.done(&format!(
            "require {EIGHT} {question} -o needed.toml {options}"
        ));
        let model: toml::Table = place.read("needed.toml").parse().unwrap();
        let walk = &model["provenance"]["velocity random walk (m/s/√h)"];
        (walk.as_float().unwrap(), model.get("turn_on").cloned())
    };
    let (unbiased, turn_on) = needed("");
    assert_eq!(turn_on, None);
    let (biased, turn_on) = needed("--scenario biased.toml");
    assert!(biased < unbiased, "{biased} {unbiased}");
    assert_eq!(turn_on.unwrap()["accel_m_s2"].as_float(), Some(0.02));
    place.done(&format!("require {EIGHT} needed.toml {question}"));
}

/// The longest outage is looked for as far as the drive goes, not up to half of the rest of it: of 180 s, 100 s are left from 80 s on.
#[test]
fn the_longest_outage_is_sought_to_the_end_of_a_short_drive() {
    let place = place();
    let question = format!("turns.toml {TACTICAL} --require p95_m<=8 --outage");
    let found = answer(&place, &format!("{question} longest --start 80"));
    let seconds = number(&found, "/outage/longest_s");
    assert!(50.0 < seconds && seconds < 100.0, "{found}");
    place.done(&format!("require {question} 80:{}", 80.0 + seconds));
}

/// Aids of a car bridge more; without them the answer is that of the IMU alone.
#[test]
fn a_car_has_a_table_of_the_worth_of_its_aiding() {
    let place = place();
    let question = format!("turns.toml {CONSUMER} --outage 60 --require rmse_m<=200");
    let free = answer(&place, &question);
    let car = answer(&place, &format!("{question} --vehicle car"));
    assert!(free["aidings"].is_null());
    let names = [0, 1, 2].map(|i| &car["aidings"][i]["aiding"]);
    assert_eq!(names, ["none", "nhc", "nhc, odometer"]);
    let [none, nhc, odometer] = [0, 1, 2].map(|i| number(&car, &format!("/aidings/{i}/value")));
    assert!(off(none, number(&free, "/value")) < 1e-9);
    assert!(off(nhc, number(&car, "/value")) < 1e-9);
    assert!(none > nhc && nhc > odometer, "{car}");
}

/// Nothing shows the heading on a straight road, where gyroscope noise adds to it: it grows with each outage from the same starts.
/// Of all starts that leave room, the worst of short outages is the last one, which long ones do not have.
#[test]
fn a_drift_curve_is_of_the_same_starts_at_all_lengths() {
    let place = place_with(&DRIVE.replace("duration_s = 35", "duration_s = 160"), MODEL);
    let found = answer(
        &place,
        "drive.toml imu.toml --outage 3 --require yaw_deg<=50",
    );
    let points = found["curves"][0]["points"].as_array().unwrap().iter();
    let yaw: Vec<f64> = points.filter_map(|p| p["value"].as_f64()).collect();
    assert_eq!(yaw.len(), 5);
    assert!(
        yaw.windows(2).all(|pair| pair[1] > 1.005 * pair[0]),
        "{yaw:?}"
    );
}

/// Every second, and the same figures to the last digit, whether a unit is judged alone or among others: one meets the
/// limit and one does not, both worst at a place in the middle.
#[test]
fn a_unit_alone_is_judged_as_in_a_catalogue() {
    let place = place();
    let question = "turns.toml --outage 20 --start 70 --require p95_m<=6";
    let ranked = answer(&place, &format!("{question} --catalogue units"));
    assert_eq!(ranked["question"]["outages"].as_array().unwrap().len(), 91);
    for (name, is_met) in NAMES.into_iter().zip([false, true]) {
        let alone = answer(&place, &format!("{question} units/{name}.toml"));
        assert_eq!(alone["question"], ranked["question"]);
        for key in ["met", "quantity", "value", "place", "outage"] {
            assert_eq!(alone[key], unit(&ranked, name)[key], "{name}: {key}");
        }
        assert!(
            (1..90).contains(&alone["place"].as_u64().unwrap()),
            "{alone}"
        );
        assert_eq!(alone["met"], is_met);
    }
}

/// The answer of `require` and the ranking of a catalogue call the same outages beyond linear theory as `run` does, for each IMU.
#[test]
fn an_answer_is_beyond_linear_theory_where_run_is() {
    let place = place();
    place.write("start.toml", "[initial]\natt_sigma_deg = [0.5, 0.5, 10]\n");
    let drive = "trajectories/land_vehicle.toml";
    for (outage, scenario, beyond) in [
        ("300:700", "--scenario start.toml", Some("consumer_mems")),
        ("300:360", "--scenario start.toml", None),
        ("300:600", "", Some("consumer_mems")),
    ] {
        let question = format!("{drive} --outage {outage} --require p95_m<=20000 {scenario}");
        let ranked = answer(&place, &format!("{question} --catalogue units"));
        for name in NAMES {
            let alone = answer(&place, &format!("{question} units/{name}.toml"));
            assert_eq!(
                unit(&ranked, name)["beyond_linear"],
                alone["beyond_linear"],
                "{name}"
            );
            let run = format!("run {drive} units/{name}.toml --outage {outage} {scenario}");
            place.judged(&format!("{run} --method lincov --filter full -o run"));
            let found = &place.json("run/summary.json")["verdict"]["beyond_linear"];
            let is_linear = [&alone["beyond_linear"], found].map(Value::is_null);
            assert_eq!(is_linear, [beyond != Some(name); 2], "{name} {outage}");
        }
    }
}

/// Curves of a ranking are of one quantity, that of the first limit, whichever limit is the hardest for a unit.
#[test]
fn the_curves_of_a_ranking_are_of_one_quantity() {
    let place = place();
    let question = format!("{EIGHT} --outage 60:90 --catalogue units --require p95_m<=100");
    let alone = answer(&place, &question);
    let both = answer(&place, &format!("{question} --require yaw_deg<=0.01"));
    assert_eq!(both["question"]["limits"][0]["quantity"], "p95_m");
    let tactical = unit(&both, "tactical");
    assert_eq!(tactical["quantity"], "yaw_deg");
    assert_eq!(tactical["curves"][0]["quantity"], "p95_m");
    assert_eq!(tactical["curves"][0], unit(&alone, "tactical")["curves"][0]);
}

/// A unit whose turn-on bias is not stated is open, as an entry and as the model that is made of it; a tolerance of its zero
/// offset, however small, does not stand for it. Stated, it counts: the unit that states a large one is behind.
#[test]
fn a_unit_whose_turn_on_bias_is_not_stated_is_open() {
    let place = Place::checkout();
    let figure = |(key, value): (&str, &str)| match key {
        "" => String::new(),
        _ => format!("{key} = {{ value = \"{value}\", source = \"s\" }}\n"),
    };
    // hardly any noise, and these figures of accelerometer and gyroscope
    let entry = |name: &str, key: &str, accel: &str| {
        let accel = [
            ("noise", "1e-6 m/s/sqrt(h)"),
            ("bias", "1 ug"),
            (key, accel),
        ]
        .map(figure);
        let gyro = [
            ("noise", "1e-6 deg/sqrt(h)"),
            ("bias", "0.001 deg/h"),
            (key, "0.001 deg/h"),
        ];
        let unit = "[unit]\nmanufacturer = \"A\"\nname = \"B\"\nclass = \"navigation\"\n";
        let (accel, gyro) = (accel.concat(), gyro.map(figure).concat());
        place.write(
            &format!("units/{name}.toml"),
            format!("{unit}[accel]\n{accel}[gyro]\n{gyro}"),
        );
    };
    entry("silent", "", "");
    entry("removed", "offset", "1 ug");
    entry("small", "turn_on", "1 ug");
    entry("large", "turn_on", "20 mg");
    place.done("datasheet units/silent.toml -o units/made.toml");
    let question = format!("{EIGHT} --outage 60:120 --require p95_m<=20");
    let ranked = answer(&place, &format!("{question} --catalogue units"));
    for name in ["silent", "removed", "made"] {
        let open = json!(["accel turn_on by grade", "gyro turn_on by grade"]);
        assert_eq!(unit(&ranked, name)["not_stated"], open, "{name}");
        assert_eq!(unit(&ranked, name)["met"], false);
    }
    assert_eq!(unit(&ranked, "small")["met"], true);
    assert_eq!(ranked["units"][0]["unit"], "small");
    // filters tell a bias from a tilt in turns only: 20 mg leave more than any of the others
    let value = |name: &str| number(unit(&ranked, name), "/value");
    assert!(value("large") > value("silent"), "{ranked}");
    let alone = place.done(&format!("require {question} units/made.toml"));
    let note =
        "units/made.toml: figures not stated count as zero, unless by grade: turn-on by grade";
    assert!(alone.stderr.contains(note), "{}", alone.stderr);
}
