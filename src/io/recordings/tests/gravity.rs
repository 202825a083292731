//! What gravity tells of units and axes.

use super::*;
use approx::assert_abs_diff_eq;

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
    let cases = [
        (1.0 / STANDARD_GRAVITY, "_m_s2"),
        (1.0, "_g"),
        (0.5, "_m_s2"),
        (0.5, ""),
    ];
    insta::assert_snapshot!(answers(cases.map(|(scale, unit)| {
        let name = format!("{scale:.4} m/s² named {unit}");
        (name, read_one("a.csv", six_axes(scale, unit), &at(100.0)))
    })));
    // A mean removed before is no gravity at all.
    read_one("a.csv", six_axes(0.0, "_m_s2"), &at(100.0)).unwrap();
}

/// An array with the gyroscopes first: gravity stands in the columns that are taken for theirs.
#[test]
fn exchanged_sensors_are_refused() {
    let row = |i: u32| {
        let small = f64::from(i % 7) * 1e-4;
        [small, -small, small, small, -small, 9.8 + small]
    };
    let bytes = npy([200, 6], (0..200).flat_map(row));
    insta::assert_snapshot!(refusal("a.npy", &bytes, &at(100.0)));
    let named =
        |sensor: &str, unit: &str| ["x", "y", "z"].map(|axis| format!("{sensor}_{axis}_{unit}"));
    let columns = [named("gyro", "rad_s"), named("accel", "m_s2")].concat();
    let named = ReadOptions {
        columns: Some(columns),
        ..at(100.0)
    };
    read_one("a.npy", bytes, &named).unwrap();
}

#[test]
fn gravity_tells_units_that_are_not_said() {
    for scale in [1.0, 1.0 / STANDARD_GRAVITY, 1000.0 / STANDARD_GRAVITY] {
        let r = read_one("a.csv", six_axes(scale, ""), &at(100.0)).unwrap();
        assert_abs_diff_eq!(
            r.signals[2].mean,
            STANDARD_GRAVITY,
            epsilon = 1e-9 * scale.max(1.0)
        );
    }
}

#[test]
fn dead_axes_and_short_recordings() {
    let dead = "gyro_x_rad_s,gyro_y_rad_s\n1,0.5\n2,0.5\n3,0.5\n";
    let x = Channel {
        sensor: nav_sim_signal::imu::Sensor::Gyro,
        axis: nav_sim_signal::imu::Axis::X,
    };
    let only_x = ReadOptions {
        channels: Some(vec![x]),
        ..at(100.0)
    };
    assert_eq!(read_one("a.csv", dead, &only_x).unwrap().signals.len(), 1);
    let needed = ReadOptions {
        min_samples: 64,
        ..ReadOptions::default()
    };
    let [one, twenty] = [1, 20].map(|n| sound(n).join("\n"));
    insta::assert_snapshot!(answers(
        [
            (dead, dead, at(100.0)),
            ("20 samples", &twenty, needed),
            ("1 sample", &one, ReadOptions::default()),
        ]
        .map(|(name, text, options)| (name, read_one("a.csv", text, &options)))
    ));
    let skip = ReadOptions {
        skip_s: 0.05,
        ..ReadOptions::default()
    };
    assert_eq!(read_one("a.csv", twenty, &skip).unwrap().len(), 15);
}
