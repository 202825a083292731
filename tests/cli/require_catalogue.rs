//! `require --catalogue` as a user runs it.

use super::require::{ROOT, TURNS, require, stdout};
use assert_cmd::Command;
use serde_json::Value;

/// Of two units, the one whose figure is beyond linear theory is named below the table, by what it says of itself alone.
#[test]
fn a_catalogue_names_the_units_beyond_linear_theory() {
    let dir = tempfile::tempdir().unwrap();
    let drive = format!("{ROOT}/trajectories/land_vehicle.toml");
    std::fs::create_dir(dir.path().join("units")).unwrap();
    for file in ["consumer_mems.toml", "tactical.toml"] {
        std::fs::copy(
            format!("{ROOT}/calib_data/{file}"),
            dir.path().join("units").join(file),
        )
        .unwrap();
    }
    let judged = |arguments: &[&str]| {
        let asked = [
            "require",
            &drive,
            "--outage",
            "300:600",
            "--require",
            "p95_m<=20000",
        ];
        let mut command = Command::cargo_bin("nav-sim").unwrap();
        let ran = command
            .current_dir(dir.path())
            .args(asked)
            .args(arguments)
            .assert()
            .success();
        let said = String::from_utf8_lossy(&ran.get_output().stderr).into_owned();
        let units = ["consumer_mems", "in outage 300–600 s"];
        let is_told = units.iter().any(|unit| {
            said.contains(&format!("beyond linear theory: {unit}: confirm with"))
                || said.contains(&format!("beyond linear theory {unit}: confirm with"))
        });
        assert!(is_told != arguments[0].ends_with("tactical.toml"), "{said}");
        stdout(&ran)
    };
    let json = |arguments: &[&str]| -> Value {
        serde_json::from_str(&judged(&[arguments, &["--format", "json"]].concat())).unwrap()
    };
    for unit in json(&["--catalogue", "units"])["units"].as_array().unwrap() {
        let name = unit["unit"].as_str().unwrap();
        let alone = json(&[&format!("units/{name}.toml")]);
        assert_eq!(unit["beyond_linear"], alone["beyond_linear"], "{name}");
        assert_eq!(
            unit["beyond_linear"].is_null(),
            name == "tactical",
            "{unit}"
        );
    }
}

#[test]
fn a_directory_of_models_is_ranked() {
    let dir = tempfile::tempdir().unwrap();
    let units = dir.path().join("units");
    std::fs::create_dir(&units).unwrap();
    for name in ["consumer_mems", "tactical"] {
        let file = format!("{name}.toml");
        std::fs::copy(format!("{ROOT}/calib_data/{file}"), units.join(file)).unwrap();
    }
    // a catalogue entry that states no bias: as good as it looks it cannot be called
    std::fs::write(units.join("silent.toml"), entry_with(["", ""])).unwrap();
    let arguments = |limit| {
        [
            "--outage",
            "60:90",
            "--require",
            limit,
            "--catalogue",
            "units",
            "--verbose",
        ]
    };
    let shown = stdout(&require(dir.path(), &arguments("p95_m<=10")).success());
    let place = |name: &str| shown.find(&format!("  {name} ")).unwrap();
    // it is not ranked, however good its figures
    assert!(
        place("tactical") < place("consumer_mems") && place("consumer_mems") < place("silent"),
        "{shown}"
    );
    assert!(
        shown.starts_with("tactical is the best of 1 units that keep the limit"),
        "{shown}"
    );
    assert!(
        shown.contains("  open ") && shown.contains("bias, turn-on by grade\n"),
        "{shown}"
    );
    // the unit that states too little is within 1.9 m: none meets the limit
    let none = stdout(&require(dir.path(), &arguments("p95_m<=1.9")).code(3));
    assert!(
        none.contains("  open ") && !none.contains("  met "),
        "{none}"
    );
}

/// Curves of a ranking are of one quantity, that of the first limit, whichever limit is the hardest for a unit.
#[test]
fn the_curves_of_a_ranking_are_of_one_quantity() {
    let dir = tempfile::tempdir().unwrap();
    let file = "tactical.toml";
    std::fs::create_dir(dir.path().join("units")).unwrap();
    std::fs::copy(
        format!("{ROOT}/calib_data/{file}"),
        dir.path().join("units").join(file),
    )
    .unwrap();
    let ranked = |limits: &[&str]| -> Value {
        let asked = [
            "--outage",
            "60:90",
            "--catalogue",
            "units",
            "--format",
            "json",
        ];
        serde_json::from_str(&stdout(&require(
            dir.path(),
            &[&asked[..], limits].concat(),
        )))
        .unwrap()
    };
    let (alone, both) = (
        ranked(&["--require", "p95_m<=100"]),
        ranked(&["--require", "p95_m<=100", "--require", "yaw_deg<=0.01"]),
    );
    assert_eq!(
        (
            &both["question"]["limits"][0]["quantity"],
            &both["units"][0]["quantity"],
        ),
        (&"p95_m".into(), &"yaw_deg".into())
    );
    let [alone, both] = [&alone, &both].map(|found| &found["units"][0]["curves"][0]);
    assert_eq!((alone, &alone["quantity"]), (both, &"p95_m".into()));
}

/// A catalogue entry of hardly any noise, with more figures of accelerometer and gyroscope.
fn entry_with([accel, gyro]: [&str; 2]) -> String {
    format!(
        "[unit]\nmanufacturer = \"A\"\nname = \"B\"\nclass = \"navigation\"\n\
         [accel]\nnoise = {{ value = \"1e-6 m/s/sqrt(h)\", source = \"s\" }}\n{accel}\
         [gyro]\nnoise = {{ value = \"1e-6 deg/sqrt(h)\", source = \"s\" }}\n{gyro}"
    )
}

/// A unit whose turn-on bias is not stated is open, as an entry and as the model that is made of it; a tolerance of its zero
/// offset, however small, does not stand for it. Stated, it counts: the unit that states a large one is behind.
#[test]
fn a_unit_whose_turn_on_bias_is_not_stated_is_open() {
    let dir = tempfile::tempdir().unwrap();
    let units = dir.path().join("units");
    std::fs::create_dir(&units).unwrap();
    let figure =
        |key: &str, value: &str| format!("{key} = {{ value = \"{value}\", source = \"s\" }}\n");
    let biases = [figure("bias", "1 ug"), figure("bias", "0.001 deg/h")];
    let entry = |name: &str, key: &str, more: [&str; 2]| {
        let more = [0, 1].map(|i| {
            let figure = if key.is_empty() {
                String::new()
            } else {
                figure(key, more[i])
            };
            format!("{}{figure}", biases[i])
        });
        let text = entry_with([&more[0], &more[1]]);
        std::fs::write(units.join(format!("{name}.toml")), text).unwrap();
    };
    entry("silent", "", ["", ""]);
    entry("removed", "offset", ["1 ug", "0.001 deg/h"]);
    entry("small", "turn_on", ["1 ug", "0.001 deg/h"]);
    entry("large", "turn_on", ["20 mg", "0.001 deg/h"]);
    let mut command = Command::cargo_bin("nav-sim").unwrap();
    let made = ["datasheet", "units/silent.toml", "-o", "units/made.toml"];
    command
        .current_dir(dir.path())
        .args(made)
        .assert()
        .success();
    let asked = [
        "--outage",
        "60:120",
        "--require",
        "p95_m<=20",
        "--catalogue",
        "units",
        "--format",
        "json",
    ];
    let ranked: Value =
        serde_json::from_str(&stdout(&require(dir.path(), &asked).success())).unwrap();
    let units = ranked["units"].as_array().unwrap();
    let unit = |name: &str| units.iter().find(|unit| unit["unit"] == name).unwrap();
    for name in ["silent", "removed", "made"] {
        assert_eq!(
            unit(name)["not_stated"],
            serde_json::json!(["accel turn_on by grade", "gyro turn_on by grade"]),
            "{name}"
        );
        assert_eq!(unit(name)["met"], false);
    }
    assert!(
        unit("small")["met"] == true && units[0]["unit"] == "small",
        "{ranked}"
    );
    // filters tell a bias from a tilt in turns only: 20 mg leave more than any of the others
    assert!(
        unit("large")["value"].as_f64() > unit("silent")["value"].as_f64(),
        "{ranked}"
    );
    let alone = require(
        dir.path(),
        &[
            "units/made.toml",
            "--outage",
            "60:120",
            "--require",
            "p95_m<=20",
        ],
    )
    .success();
    let said = String::from_utf8(alone.get_output().stderr.clone()).unwrap();
    assert!(
        said.contains(
            "units/made.toml: figures not stated count as zero, unless by grade: turn-on by grade"
        ),
        "{said}"
    );
}

/// Every second, and the same figures to the last digit, whether a unit is judged alone or among others: one meets the
/// limit and one does not, both worst at a place in the middle.
#[test]
fn a_unit_alone_is_judged_as_in_a_catalogue() {
    let dir = tempfile::tempdir().unwrap();
    std::fs::write(dir.path().join("drive.toml"), TURNS).unwrap();
    std::fs::create_dir(dir.path().join("units")).unwrap();
    let names = ["consumer_mems", "tactical"];
    for file in names.map(|name| format!("{name}.toml")) {
        std::fs::copy(
            format!("{ROOT}/calib_data/{file}"),
            dir.path().join("units").join(file),
        )
        .unwrap();
    }
    let judged = |arguments: &[&str]| -> Value {
        let asked = [
            "require",
            "drive.toml",
            "--outage",
            "20",
            "--start",
            "70",
            "--require",
            "p95_m<=6",
            "--format",
            "json",
        ];
        let mut command = Command::cargo_bin("nav-sim").unwrap();
        let ran = command
            .current_dir(dir.path())
            .args(asked)
            .args(arguments)
            .assert();
        serde_json::from_str(&stdout(&ran)).unwrap()
    };
    let ranked = judged(&["--catalogue", "units"]);
    assert_eq!(ranked["question"]["outages"].as_array().unwrap().len(), 91);
    let verdicts = names.map(|name| {
        let alone = judged(&[&format!("units/{name}.toml")]);
        let among = ranked["units"]
            .as_array()
            .unwrap()
            .iter()
            .find(|unit| unit["unit"] == name)
            .unwrap();
        assert_eq!(alone["question"], ranked["question"]);
        for key in ["met", "quantity", "value", "place", "outage"] {
            assert_eq!(alone[key], among[key], "{name}: {key}");
        }
        assert!(
            (1..90).contains(&alone["place"].as_u64().unwrap()),
            "{alone}"
        );
        alone["met"].as_bool().unwrap()
    });
    assert_eq!(verdicts, [false, true]);
}

#[test]
fn the_catalogue_is_ranked_without_a_directory() {
    let dir = tempfile::tempdir().unwrap();
    let asked = ["--outage", "60:90", "--require", "p95_m<=20", "--catalogue"];
    let shown = stdout(&require(dir.path(), &asked).success());
    // the other units leave figures out
    assert!(
        shown.starts_with("hg4930 is the best of 2 units that keep the limit\n"),
        "{shown}"
    );
    assert!(
        shown.contains("\n15 units not ranked") && shown.contains("\n  stim300    met "),
        "{shown}"
    );
    assert!(
        shown.lines().count() <= 20 && shown.lines().all(|line| line.chars().count() <= 120),
        "{shown}"
    );
}
