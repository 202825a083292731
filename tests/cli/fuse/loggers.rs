//! Samples and references that loggers spoil.

use super::{end, recorded};

/// One impossible sample of a gyroscope or an accelerometer is as good as missing: the solution is that of a
/// recording without it, to a hundredth of its deviation (one sample in ten thousand is bridged).
#[test]
fn a_glitch_is_taken_as_missing() {
    let place = recorded();
    let fused = |imu: &str| {
        end(
            &place,
            &format!("{imu} rec/gnss.csv --initial rec/initial.toml"),
        )
    };
    let sound = fused("rec/imu.csv");
    for (column, value) in [(3, "30"), (1, "1e6"), (4, "-2e4")] {
        place.edit("rec/imu.csv", "glitch.csv", |k, line| {
            let mut cells: Vec<&str> = line.split(',').collect();
            if k == 3500 {
                cells[column] = value;
            }
            cells.join(",")
        });
        let end = fused("glitch.csv");
        for i in 4..10 {
            let off = (end[i] - sound[i]).abs();
            assert!(off < 0.01 * sound[9 + i], "{value} {i}: {end:?}");
        }
    }
}

/// A reference that jumps is compared with where it does not.
#[test]
fn a_reference_that_jumps_makes_no_error() {
    let place = recorded();
    place.edit("rec/reference.csv", "glitch.csv", |k, line| match k {
        400..405 => line.replacen(",46.", ",47.", 1),
        _ => line.to_owned(),
    });
    place.done("fuse rec/imu.csv rec/gnss.csv imu.toml --reference glitch.csv -o out");
    let errors = place.table("out/errors.csv");
    let largest = errors.iter().map(|e| e[1].hypot(e[2])).fold(0.0, f64::max);
    assert!(largest < 30.0, "{largest}");
}
