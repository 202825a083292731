//! Recordings that are read, and what is said of them.

use super::*;

/// What is no error and yet not as it seems: told, and read.
#[test]
fn doubts_are_told() {
    let warnings = |text: &str, options: &ReadOptions| outcome(text, options).1.warnings;
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
        ["0.1 Hz is an unusual IMU rate: is the unit of \"t_s\" right?"]
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
            "split at gaps or duplicates in time: 1, the first in line 972",
            "1 piece of fewer than 60 samples between gaps: left out"
        ]
    );
}

/// Rows are taken out twice: where all is zero, then where a channel holds its value, or where each sample is repeated.
#[test]
fn recordings_are_split_where_rows_were_taken_out() {
    let noise = |k: usize| {
        let x = (k as u64).wrapping_mul(0x9E37_79B9_7F4A_7C15);
        let x = (x ^ (x >> 29)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        9.8 + ((x >> 40) % 10_007) as f64 * 1e-6
    };
    let pieces = |row: &dyn Fn(usize) -> [f64; 2]| {
        let row = |k: usize| row(k).map(|x| format!("{x}")).join(",") + "\n";
        let rows: String = (0..2000).map(row).collect();
        let options = ReadOptions {
            gaps: Gaps::Split,
            ..at(100.0)
        };
        outcome(format!("accel_y_m_s2,accel_z_m_s2\n{rows}"), &options)
            .1
            .samples
    };
    let frozen = pieces(&|k| match k {
        1500..1503 => [0.0; 2],
        500..700 => [9.804, noise(k + 2000)],
        _ => [noise(k), noise(k + 2000)],
    });
    assert_eq!(frozen, [500, 800, 497]);
    let repeated = pieces(&|k| match k {
        1200..1204 => [0.0; 2],
        _ => [noise(k / 2), noise(k / 2 + 2000)],
    });
    assert_eq!(repeated, [600, 398]);
}

#[test]
fn a_rate_beside_that_of_the_time_column_is_told() {
    let report = |rate_hz| outcome(sound(20).join("\n"), &at(rate_hz)).1;
    assert_eq!(
        (report(100.0).warnings.len(), report(100.05).warnings.len()),
        (0, 0)
    );
    let found = report(100.9);
    assert_eq!(
        found.warnings,
        ["100.9 Hz as given, although the file has 100 Hz"]
    );
    assert_eq!(
        (found.rate_hz, found.rate_from.as_str()),
        (100.9, "given; the time column has 100 Hz")
    );
}
