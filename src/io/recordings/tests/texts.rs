//! Texts that are not quite tables.

use super::*;

fn outcome(contents: impl AsRef<[u8]>) -> (Recording, FileReport) {
    super::outcome(contents, &ReadOptions::default())
}

/// A logger that lost its power within a row.
#[test]
fn a_last_line_with_too_few_columns_is_left_out() {
    const WHOLE: &str = "t_s,gyro_x_rad_s\n0.00,1.1e-04\n0.01,-2.2e-04\n0.02,-5.1e-04";
    assert_eq!(
        (outcome(WHOLE).0.len(), outcome(WHOLE).1.assumptions.len()),
        (3, 0)
    );
    for end in ["", "\n"] {
        let (recording, report) = outcome(format!("{}{end}", &WHOLE[..WHOLE.len() - 9]));
        assert_samples(&recording, 0, &[1.1e-4, -2.2e-4]);
        assert_eq!(
            report.assumptions,
            ["line 4, the last, is cut off: left out"]
        );
    }
}

#[test]
fn columns_that_blanks_align_are_read() {
    let (recording, _) =
        outcome("t_s   gyro_x_rad_s  gyro_y_rad_s\n 0.00   1e-3 -2e-3 \n 0.01  -4e-3  5e-3\n");
    assert_samples(&recording, 0, &[1e-3, -4e-3]);
    assert_samples(&recording, 1, &[-2e-3, 5e-3]);
    assert_close(&[recording.rate_hz], &[100.0]);
}

#[test]
fn units_below_the_names_are_theirs() {
    let (recording, report) = outcome("t_s,gx_dps\ns,deg/s\n0,1\n0.01,2\n");
    assert_samples(&recording, 0, &[DEG, 2.0 * DEG]);
    assert_eq!(report.assumptions, ["units by line 2"]);
    let (recording, _) = outcome("time;gyro x;gyro y\n[ms];[deg/s];[rad/s]\n0;1;1\n10;2;2\n");
    assert_samples(&recording, 0, &[DEG, 2.0 * DEG]);
    assert_samples(&recording, 1, &[1.0, 2.0]);
    assert_close(&[recording.rate_hz], &[100.0]);
}

#[test]
fn a_header_in_iso_8859_1_has_its_units() {
    let header = b"time [s];Acc X [m/s\xb2];Gyr X [\xb0/s]\n".to_vec();
    let (recording, report) = outcome([header, b"0;9.8;1\n0.01;9.7;2\n".to_vec()].concat());
    assert_samples(&recording, 0, &[9.8, 9.7]);
    assert_samples(&recording, 1, &[DEG, 2.0 * DEG]);
    assert_eq!(
        report.assumptions,
        ["header not in UTF-8, read as ISO-8859-1"]
    );
}

/// With a comma for the point, three ways to separate.
#[test]
fn a_decimal_comma_is_read_where_no_comma_separates() {
    for separator in [";", "\t", "  "] {
        let rows = [["t_s", "gyro_x_rad_s"], ["0,00", "1,5e-3"], ["0,01", "-2"]];
        let text = rows.map(|row| row.join(separator)).join("\n");
        let (recording, _) = outcome(text);
        assert_samples(&recording, 0, &[1.5e-3, -2.0]);
        assert_close(&[recording.rate_hz], &[100.0]);
    }
}

/// The header is the first line with as many cells as the rows, or one that names a quantity.
#[test]
fn lines_before_the_header_are_passed_over() {
    for before in [
        "Sensor: LSM6DSL\nVendor: STM\n",
        "Recorded on 27 November 2026 with a range of 4 g in x y z\n\n",
        "Device,Phone\nRate,100\n",
        ",,,\n\"a, b\"\n",
    ] {
        for header in ["TimestampGyro [ns]; GyroX [rad/s]", "t_ns; gyro_x_rad_s"] {
            let text = format!("{before}{header}\n473995414320987;1;\n473995424320987;2;\n");
            let (recording, _) = outcome(text);
            assert_samples(&recording, 0, &[1.0, 2.0]);
            assert_close(&[recording.rate_hz], &[100.0]);
        }
    }
}

/// With a checksum as the sensor writes it, and no time.
#[test]
fn sentences_of_an_imu_are_read() {
    let rows = "$VNIMU,-00.0350,+00.4222,-00.6643,+000.087,-000.138,-009.794,+00.000359,+00.001511,-00.001786,+20.7,+084.322*5E\n\
                $VNIMU,-00.0350,+00.4222,-00.6643,+000.102,-000.151,-009.803,+00.001687,-00.000047,-00.000800,+20.7,+084.322*5A\n";
    let signals = read_one("a.txt", rows, &at(100.0)).unwrap().signals;
    assert_eq!(signals.len(), 6);
    assert_close(&samples_with_mean(&signals[0]), &[0.087, 0.102]);
    assert_close(&samples_with_mean(&signals[5]), &[-1.786e-3, -0.8e-3]);
}

/// Sensor Logger names the sensor in the file's name; beside what the accelerometer measures, it writes what is left without
/// gravity, which is no recording of its own.
#[test]
fn files_named_after_their_sensor_are_read() {
    let gyro = "time,seconds_elapsed,z,y,x\n1760565906248623000,0.10,3,2,1\n1760565906258623000,0.11,-3,-2,-1\n";
    let accel = "time,seconds_elapsed,z,y,x\n1760565906248623000,0.10,9.8,0,1\n1760565906258623000,0.11,9.82,0.1,0\n";
    let files = Files::new();
    files.add("Gyroscope.csv", gyro);
    files.add("TotalAcceleration.csv", accel);
    let estimate = files.add("Accelerometer.csv", accel);
    files.add("Gravity.csv", accel);
    let (recordings, report) = read(&[files.path()], &ReadOptions::default()).unwrap();
    assert_eq!(channels(&recordings[0]), ["gyro.x", "gyro.y", "gyro.z"]);
    assert_eq!(channels(&recordings[1]), ["accel.x", "accel.y", "accel.z"]);
    assert_samples(&recordings[0], 2, &[3.0, -3.0]);
    assert_samples(&recordings[1], 0, &[1.0, 0.0]);
    assert_close(&[recordings[1].rate_hz], &[100.0]);
    let [without, other] = &report.warnings[..] else {
        panic!("{:?}", report.warnings);
    };
    assert!(without.ends_with("Accelerometer.csv: skipped, it is without gravity"));
    assert!(other.ends_with("Gravity.csv: skipped, no column is a known one"));
    let refusal = read(&[estimate], &ReadOptions::default()).unwrap_err();
    assert_eq!(refusal.advice().unwrap(), "name TotalAcceleration.csv");

    let files = Files::new();
    files.add("Gravity.csv", accel);
    let refusal = files.told(&read(&[files.path()], &ReadOptions::default()).unwrap_err());
    assert!(
        refusal.starts_with("Gravity.csv, line 1: no accelerometer"),
        "{refusal}"
    );
}
