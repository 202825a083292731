//! What gravity tells of units and axes.

use super::*;

fn six_axes(scale: f64, unit: &str) -> String {
    let row = |k: usize| {
        let v = |base: f64| scale * base + 1e-3 * ((k % 5) as f64 - 2.0);
        format!("{},{},{}\n", v(0.1), v(-0.2), v(STANDARD_GRAVITY))
    };
    let rows: String = (0..20).map(row).collect();
    format!("accel_x{unit},accel_y{unit},accel_z{unit}\n{rows}")
}

#[test]
fn gravity_tells_wrong_units() {
    let message = |text| refusal_with("a.csv", text, &at_100_hz()).0;
    assert_eq!(
        message(six_axes(1.0 / STANDARD_GRAVITY, "_m_s2")),
        "a.csv: static |f| is 1.0003 m/s², not 9.81 m/s²: it looks like g"
    );
    assert_eq!(
        message(six_axes(1.0, "_g")),
        "a.csv: static |f| is 96.1954 m/s², not 9.81 m/s²: it looks like m/s² named g"
    );
    assert_eq!(
        message(six_axes(0.5, "_m_s2")),
        "a.csv: static |f| is 4.9046 m/s², not 9.81 m/s²: wrong unit, or moving"
    );
    // A mean removed before is no gravity at all.
    read_one("a.csv", six_axes(0.0, "_m_s2"), &at_100_hz()).unwrap();
}

/// An array with the gyroscopes first: gravity stands in the columns that are taken for theirs.
#[test]
fn exchanged_sensors_are_refused() {
    let row = |i: u32| {
        let small = f64::from(i % 7) * 1e-4;
        [small, -small, small, small, -small, 9.8 + small]
    };
    let bytes = npy([200, 6], (0..200).flat_map(row));
    let (message, hint) = refusal_with("a.npy", &bytes, &at_100_hz());
    assert!(
        message.starts_with("a.npy: accelerometers and gyroscopes are exchanged: |f| is 0.000"),
        "{message}"
    );
    assert!(hint.contains("--columns"), "{hint}");
    let named =
        |sensor: &str, unit: &str| ["x", "y", "z"].map(|axis| format!("{sensor}_{axis}_{unit}"));
    let columns = [named("gyro", "rad_s"), named("accel", "m_s2")].concat();
    read_one(
        "a.npy",
        bytes,
        &ReadOptions {
            columns: Some(columns),
            ..at_100_hz()
        },
    )
    .unwrap();
}

#[test]
fn gravity_tells_units_that_are_not_said() {
    for scale in [1.0, 1.0 / STANDARD_GRAVITY, 1000.0 / STANDARD_GRAVITY] {
        let r = read_one("a.csv", six_axes(scale, ""), &at_100_hz()).unwrap();
        assert!((r.signals[2].mean - STANDARD_GRAVITY).abs() < 1e-9 * scale.max(1.0));
    }
    assert_eq!(
        refusal_with("a.csv", six_axes(0.5, ""), &at_100_hz()).0,
        "a.csv, line 1: column \"accel_x\" has no unit in its name"
    );
}

#[test]
fn dead_axes_and_short_recordings() {
    let dead = "gyro_x_rad_s,gyro_y_rad_s\n1,0.5\n2,0.5\n3,0.5\n";
    let (message, hint) = refusal_with("a.csv", dead, &at_100_hz());
    assert_eq!(
        message,
        "a.csv: gyro.y (column \"gyro_y_rad_s\") is dead: every sample is 0.5"
    );
    assert!(hint.contains("--axes"));
    let x = Channel {
        sensor: nav_sim_signal::imu::Sensor::Gyro,
        axis: nav_sim_signal::imu::Axis::X,
    };
    let only_x = ReadOptions {
        channels: Some(vec![x]),
        ..at_100_hz()
    };
    assert_eq!(read_one("a.csv", dead, &only_x).unwrap().signals.len(), 1);

    let needed = ReadOptions {
        min_samples: 64,
        ..ReadOptions::default()
    };
    assert_eq!(
        refusal_with("a.csv", sound(20).join("\n"), &needed).0,
        "a.csv: 20 samples, but 64 are needed"
    );
    assert_eq!(
        refusal(sound(1).join("\n")),
        "a.csv: 1 samples, but 2 are needed"
    );
    let skip = ReadOptions {
        skip_s: 0.05,
        ..ReadOptions::default()
    };
    assert_eq!(
        read_one("a.csv", sound(20).join("\n"), &skip)
            .unwrap()
            .len(),
        15
    );
}
