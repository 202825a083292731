//! Recordings that are read, and what is said of them.

use super::*;

/// What is no error and yet not as it seems: told, and read.
#[test]
fn doubts_are_told() {
    let warnings = |text: &str, options: &ReadOptions| {
        let (_files, path) = Files::with("a.csv", text);
        read(&[path], options).unwrap().1.files.remove(0).warnings
    };
    // seven levels in an order that does not come again
    let level = |k: usize| (k * k % 1009 % 7) as f64 * 1e-3;
    let rows = |step: f64| {
        (0..1000)
            .map(|k| format!("{},{},{}\n", k as f64 * step, level(k), (k % 5) as f64))
            .collect::<String>()
    };
    let plain = ReadOptions::default();
    assert_eq!(
        warnings(
            &format!("t_s,gyro_x_rad_s,temperature\n{}", rows(0.01)),
            &plain
        ),
        [""; 0]
    );
    assert_eq!(
        warnings(&format!("t_s,gyro_x_rad_s,b\n{}", rows(10.0)), &plain),
        ["0.1 Hz is no usual rate of an IMU: is the unit of \"t_s\" right?"]
    );
    // A stretch of 30 beside one of 969 would cost all the long scales.
    let gap = |k: usize| k as f64 * 0.01 + if k >= 970 { 1.0 } else { 0.0 };
    let text: String = (0..1000)
        .map(|k| format!("{},{}\n", gap(k), level(k)))
        .collect();
    let split = ReadOptions {
        gaps: Gaps::Split,
        ..plain
    };
    assert_eq!(
        warnings(&format!("t_s,gyro_x_rad_s\n{text}"), &split),
        [
            "split at 1 gaps or duplicates in time, the first in line 972",
            "1 stretches between gaps have fewer than 60 samples: left out"
        ]
    );
}

/// Independent samples of a triad, three axes in m/s² and three in rad/s, `change`d row by row.
fn triads(rows: usize, change: impl Fn(usize, [f64; 6]) -> [f64; 6]) -> Vec<String> {
    use rand::{Rng, SeedableRng};
    let mut generator = rand_xoshiro::Xoshiro256PlusPlus::seed_from_u64(1);
    let mut noise = || {
        (0..12)
            .map(|_| (generator.next_u32() as f64) / 2f64.powi(32))
            .sum::<f64>()
            - 6.0
    };
    let row = |k: usize| {
        let means = [0.1, -0.2, STANDARD_GRAVITY, 0.0, 0.0, 0.0];
        let sizes = [0.02, 0.02, 0.02, 1e-3, 1e-3, 1e-3];
        let values = change(k, std::array::from_fn(|i| means[i] + sizes[i] * noise()));
        values.map(|v| format!("{v:.6}")).join(",")
    };
    (0..rows).map(row).collect()
}

const TRIADS: &str =
    "accel_x_m_s2,accel_y_m_s2,accel_z_m_s2,gyro_x_rad_s,gyro_y_rad_s,gyro_z_rad_s\n";

/// Warnings about rows without a time column, at 100 Hz.
fn warnings_of(rows: &[String]) -> Vec<String> {
    let (_files, path) = Files::with("a.csv", format!("{TRIADS}{}\n", rows.join("\n")));
    read(&[path], &at_100_hz())
        .unwrap()
        .1
        .files
        .remove(0)
        .warnings
}

/// Sound samples, quantized ones and such of which an axis has three levels only are not clipped.
#[test]
fn clipped_axes_are_told() {
    let sound = triads(4000, |_, v| v);
    assert_eq!(warnings_of(&sound), [""; 0]);
    for (accel, gyro) in [(0.01, 5e-4), (0.04, 2e-3)] {
        let steps = [accel, accel, accel, gyro, gyro, gyro];
        let coarse = triads(4000, |_, v| {
            std::array::from_fn(|i| (v[i] / steps[i]).round() * steps[i])
        });
        assert_eq!(warnings_of(&coarse), [""; 0]);
    }
    let clipped = triads(4000, |_, mut v| {
        v[0] = v[0].min(0.11);
        v[1] = v[1].clamp(-0.21, -0.19);
        v
    });
    let said = warnings_of(&clipped);
    let parts = [
        "accel.x is clipped: 3",
        " are 0.11",
        " are -0.19",
        " are -0.21",
    ];
    assert!(
        said.len() == 3 && parts.iter().all(|part| said.concat().contains(part)),
        "{said:?}"
    );
}

#[test]
fn a_rate_beside_that_of_the_time_column_is_told() {
    let (_files, path) = Files::with("a.csv", sound(20).join("\n"));
    let report = |rate_hz| {
        let options = ReadOptions {
            rate_hz: Some(rate_hz),
            ..ReadOptions::default()
        };
        read(std::slice::from_ref(&path), &options)
            .unwrap()
            .1
            .files
            .remove(0)
    };
    assert_eq!(
        (report(100.0).warnings.len(), report(100.05).warnings.len()),
        (0, 0)
    );
    let found = report(100.9);
    assert_eq!(
        found.warnings,
        ["100.9 Hz is given, but the file runs at 100 Hz: the rate given is taken"]
    );
    assert_eq!(
        (found.rate_hz, found.rate_from.as_str()),
        (100.9, "given; the time column has 100 Hz")
    );
}
