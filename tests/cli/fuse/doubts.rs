//! Results that are refused or not to be believed.

use super::*;

/// Nobody's files are replaced: neither by a fusion nor by a recording.
#[test]
fn a_directory_of_something_else_is_refused() {
    let place = recorded();
    fs::create_dir(place.path().join("mine")).unwrap();
    fs::write(place.path().join("mine/imu.csv"), "precious").unwrap();
    for command in [
        "trajectory record drive.toml imu.toml --seed 3 -o mine",
        "fuse rec/imu.csv rec/gnss.csv imu.toml -o mine",
        "run drive.toml imu.toml --runs 1 --outage none --seed 1 -o mine",
    ] {
        let ran = nav_sim(place.path(), command);
        assert_eq!(ran.code, 2, "{command}\n{}", ran.stderr);
        assert!(ran.stderr.contains("mine is not "), "{}", ran.stderr);
    }
    assert_eq!(
        fs::read_to_string(place.path().join("mine/imu.csv")).unwrap(),
        "precious"
    );
    done(
        place.path(),
        "trajectory record drive.toml imu.toml --seed 3 -o rec",
    ); // its own is replaced
}

/// What is not to be believed ends with exit code 3, its files written and the verdict first: a start that is
/// half a turn off, a reference of another heading.
#[test]
fn what_is_not_to_be_believed_ends_with_3() {
    let place = recorded();
    let at = |name: &str| place.path().join(name);
    let initial = fs::read_to_string(at("rec/initial.toml")).unwrap();
    let turned = |line: &str| match line.strip_prefix("yaw_deg = ") {
        Some(yaw) => format!("yaw_deg = {}\n", yaw.parse::<f64>().unwrap() - 180.0),
        None => format!("{line}\n"),
    };
    fs::write(
        at("turned.toml"),
        initial.lines().map(turned).collect::<String>(),
    )
    .unwrap();
    let reference = fs::read_to_string(at("rec/reference.csv")).unwrap();
    fs::write(at("off.csv"), turned_reference(&reference)).unwrap();
    for (flags, why) in [
        ("--initial turned.toml", "NIS"),
        ("--initial rec/initial.toml --reference off.csv", "NEES"),
    ] {
        let ran = nav_sim(
            place.path(),
            &format!("fuse rec/imu.csv rec/gnss.csv imu.toml {flags} -o out"),
        );
        assert_eq!(ran.code, 3, "{flags}\n{}", ran.stderr);
        assert!(ran.stdout.starts_with("overconfident: "), "{}", ran.stdout);
        assert!(
            ran.stdout.lines().next().unwrap().contains(why),
            "{flags}\n{}",
            ran.stdout
        );
        assert!(ran.stderr.contains("hint: "), "{}", ran.stderr);
        let summary: serde_json::Value =
            serde_json::from_str(&fs::read_to_string(at("out/summary.json")).unwrap()).unwrap();
        assert_eq!(summary["verdict"]["kind"], "overconfident");
        assert!(at("out/solution.csv").exists() && at("out/manifest.json").exists());
    }
    let ran = done(
        place.path(),
        "fuse rec/imu.csv rec/gnss.csv imu.toml -o out",
    );
    assert!(ran.stdout.starts_with("consistent: NIS "), "{}", ran.stdout);
}

/// The reference with its yaw 20° off.
fn turned_reference(text: &str) -> String {
    let header = text.lines().next().unwrap();
    let column = header
        .split(',')
        .position(|name| name == "yaw_deg")
        .unwrap();
    let row = |line: &str| {
        let mut cells: Vec<String> = line.split(',').map(str::to_owned).collect();
        cells[column] = (cells[column].parse::<f64>().unwrap() + 20.0).to_string();
        cells.join(",") + "\n"
    };
    format!("{header}\n") + &text.lines().skip(1).map(row).collect::<String>()
}
