//! Texts that are not quite tables.

use super::*;

fn outcome(contents: impl AsRef<[u8]>) -> (Recording, FileReport) {
    let (_files, path) = Files::with("a.csv", contents);
    let (mut recordings, mut report) = read(&[path], &ReadOptions::default()).unwrap();
    (recordings.remove(0), report.files.remove(0))
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
        assert_close(
            &samples_with_mean(&recording.signals[0]),
            &[1.1e-4, -2.2e-4],
        );
        assert_eq!(
            report.assumptions,
            ["line 4, the last, is cut off: left out"]
        );
    }
    let within = WHOLE.replace(",-2.2e-04", "");
    assert_eq!(refusal(within), "a.csv, line 3: 1 values, but 2 columns");
}

#[test]
fn columns_that_blanks_align_are_read() {
    let (recording, _) =
        outcome("t_s   gyro_x_rad_s  gyro_y_rad_s\n 0.00   1e-3 -2e-3 \n 0.01  -4e-3  5e-3\n");
    assert_close(&samples_with_mean(&recording.signals[0]), &[1e-3, -4e-3]);
    assert_close(&samples_with_mean(&recording.signals[1]), &[-2e-3, 5e-3]);
    assert_close(&[recording.rate_hz], &[100.0]);
}

#[test]
fn units_below_the_names_are_passed_over_and_numbers_are_not() {
    let (recording, report) = outcome("t_s,gx_dps\ns,deg/s\n0,1\n0.01,2\n");
    assert_close(&samples_with_mean(&recording.signals[0]), &[DEG, 2.0 * DEG]);
    assert_eq!(
        report.assumptions,
        ["line 2 has words and no numbers: passed over"]
    );
    assert_eq!(
        refusal("t_s,gx_dps\ns,deg/s\ns,deg/s\n0,1\n"),
        "a.csv, line 3: column \"t_s\": \"s\" is not a number"
    );
    assert_eq!(
        refusal("t_s,gx_dps\n0,abc\n"),
        "a.csv, line 2: column \"gx_dps\": \"abc\" is not a number"
    );
}

#[test]
fn a_header_in_iso_8859_1_has_its_units() {
    let header = b"time [s];Acc X [m/s\xb2];Gyr X [\xb0/s]\n".to_vec();
    let (recording, report) = outcome([header, b"0;9.8;1\n0.01;9.7;2\n".to_vec()].concat());
    assert_close(&samples_with_mean(&recording.signals[0]), &[9.8, 9.7]);
    assert_close(&samples_with_mean(&recording.signals[1]), &[DEG, 2.0 * DEG]);
    assert_eq!(
        report.assumptions,
        ["header not in UTF-8, taken as ISO-8859-1"]
    );
}
