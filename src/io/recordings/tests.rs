mod clocks;
mod doubts;
mod facts;
mod gravity;
mod texts;

use super::*;
use crate::io::property_tests::npy;
use crate::io::tests::{Files, answers};
use approx::assert_relative_eq;
use nav_sim_signal::imu::{Channel, Signal};
use nav_sim_signal::units::{DEG, STANDARD_GRAVITY};

fn read_one(
    name: &str,
    contents: impl AsRef<[u8]>,
    options: &ReadOptions,
) -> Result<Recording, String> {
    let (files, path) = Files::with(name, contents);
    let found = read(&[path], options).map_err(|e| files.told(&e))?;
    Ok(found.0.into_iter().next().unwrap())
}

/// A table of the name `a.csv` that is read as it is.
fn read_csv(contents: impl AsRef<[u8]>) -> Recording {
    read_one("a.csv", contents, &ReadOptions::default()).unwrap()
}

/// The message without the directory, and the hint.
fn refusal(name: &str, contents: impl AsRef<[u8]>, options: &ReadOptions) -> String {
    read_one(name, contents, options).unwrap_err()
}

fn with_gaps(gaps: Gaps) -> ReadOptions {
    ReadOptions {
        gaps,
        ..ReadOptions::default()
    }
}

#[track_caller]
fn assert_close(found: &[f64], expected: &[f64]) {
    assert_relative_eq!(found, expected, max_relative = 1e-13, epsilon = 1e-13);
}

/// Of a recording that is given without a time column, or whose rate must be this one.
fn at(rate_hz: f64) -> ReadOptions {
    ReadOptions {
        rate_hz: Some(rate_hz),
        ..ReadOptions::default()
    }
}

/// A sound file of `n` rows at 100 Hz: time and x-gyro.
fn sound(n: usize) -> Vec<String> {
    let rows = (0..n).map(|k| format!("{},{}", k as f64 / 100.0, (k % 7) as f64 * 1e-3));
    std::iter::once("t_s,gyro_x_rad_s".to_owned())
        .chain(rows)
        .collect()
}

fn changed(line: usize, to: &str) -> String {
    let mut lines = sound(20);
    lines[line - 1] = to.to_owned();
    lines.join("\n") + "\n"
}

#[track_caller]
fn assert_samples(recording: &Recording, signal: usize, expected: &[f64]) {
    assert_close(&samples_with_mean(&recording.signals[signal]), expected);
}

/// The one recording of a table, and what is said of it.
fn outcome(contents: impl AsRef<[u8]>, options: &ReadOptions) -> (Recording, FileReport) {
    let (_files, path) = Files::with("a.csv", contents);
    let (mut recordings, mut report) = read(&[path], options).unwrap();
    (recordings.remove(0), report.files.remove(0))
}

fn samples_with_mean(signal: &Signal) -> Vec<f64> {
    signal.samples.iter().map(|v| v + signal.mean).collect()
}

fn channels(recording: &Recording) -> Vec<String> {
    recording
        .signals
        .iter()
        .map(|s| s.channel.to_string())
        .collect()
}

#[test]
fn our_columns_in_any_order_and_unit() {
    let text = "gyro_z_deg_s,t_ms,accel_x_g,note\n1,0,0.5,a\n3,10,0.25,b\n2,20,0.5,c\n";
    let r = read_csv(text);
    assert_eq!(channels(&r), ["accel.x", "gyro.z"]);
    assert_close(&[r.rate_hz], &[100.0]);
    let accel: Vec<f64> = [0.5, 0.25, 0.5].map(|v| v * STANDARD_GRAVITY).to_vec();
    assert_samples(&r, 0, &accel);
    assert_samples(&r, 1, &[DEG, 3.0 * DEG, 2.0 * DEG]);
    assert_close(&[r.signals[1].mean], &[2.0 * DEG]);
    assert!(
        r.signals
            .iter()
            .all(|s| s.samples.iter().sum::<f64>().abs() < 1e-12)
    );
}

#[test]
fn tabs_semicolons_crlf_bom_and_missing_last_newline() {
    for text in [
        "t_s\tgyro_x_rad_s\r\n0\t1\r\n0.01\t2",
        "\u{feff}t_s;gyro_x_rad_s\n0; 1 \n0.01;2;\n",
        "# t_s gyro_x_rad_s\n0 1\n0.01 2\n",
        "sep=,\n\"t_s\",\"gyro_x_rad_s\"\n0,\"1\"\n\n0.01,2\n\n",
    ] {
        let r = read_csv(text);
        assert_samples(&r, 0, &[1.0, 2.0]);
        assert_close(&[r.rate_hz], &[100.0]);
    }
}

#[test]
fn gzip_is_read_also_in_members() {
    use flate2::{Compression, write::GzEncoder};
    use std::io::Write;
    let pack = |text: &str| {
        let mut encoder = GzEncoder::new(Vec::new(), Compression::fast());
        encoder.write_all(text.as_bytes()).unwrap();
        encoder.finish().unwrap()
    };
    let bytes = [pack("t_s,gyro_x_rad_s\n0,1\n"), pack("0.01,2\n")].concat();
    let r = read_one("a.csv.gz", &bytes, &ReadOptions::default()).unwrap();
    assert_samples(&r, 0, &[1.0, 2.0]);
    let cut = refusal(
        "a.csv.gz",
        &bytes[..bytes.len() - 12],
        &ReadOptions::default(),
    );
    assert!(cut.starts_with("a.csv.gz: "), "{cut}");
}

#[test]
fn files_of_other_tools() {
    let euroc = "#timestamp [ns],w_RS_S_x [rad s^-1],w_RS_S_y [rad s^-1],w_RS_S_z [rad s^-1],a_RS_S_x [m s^-2],a_RS_S_y [m s^-2],a_RS_S_z [m s^-2]
1403636579758555392,-0.09,0.14,0.07,8.17,-0.35,-4.93
1403636579763555584,-0.09,0.14,0.06,8.17,-0.35,-4.94
1403636579768555520,-0.10,0.15,0.07,8.18,-0.36,-4.93\n";
    let kalibr = "timestamp,omega_x,omega_y,omega_z,alpha_x,alpha_y,alpha_z
1385030208736607488,0.1,0.2,0.3,0.4,0.5,9.8
1385030208741607488,0.2,0.1,0.2,0.3,0.4,9.7\n";
    let ros = "%time,field.header.seq,field.header.stamp,field.header.frame_id,field.angular_velocity.x,field.linear_acceleration.z
1500000000006000000,1,1500000000000000000,imu,0.1,9.8
1500000000010000000,2,1500000000005000000,imu,0.2,9.7\n";
    let xio = "Time (s),Gyroscope X (deg/s),Accelerometer Z (g)\n0.000,1,1.0\n0.005,2,1.01\n";
    for (text, expected, first) in [
        (euroc, 6, ("accel.x", 8.17)),
        (kalibr, 6, ("accel.x", 0.4)),
        (ros, 2, ("accel.z", 9.8)),
        (xio, 2, ("accel.z", STANDARD_GRAVITY)),
    ] {
        let r = read_csv(text);
        assert_eq!(r.signals.len(), expected);
        assert_relative_eq!(r.rate_hz, 200.0, max_relative = 1e-4);
        assert_eq!(r.signals[0].channel.to_string(), first.0);
        assert_close(&samples_with_mean(&r.signals[0])[..1], &[first.1]);
    }
    let gnss_ins_sim = "gyro_x (deg/s),gyro_y (deg/s),gyro_z (deg/s)\n1,2,3\n2,3,4\n";
    let r = read_one("gyro-0.csv", gnss_ins_sim, &at(100.0)).unwrap();
    assert_samples(&r, 2, &[3.0 * DEG, 4.0 * DEG]);
}

fn xsens(rate: &str, counters: impl Iterator<Item = u32>) -> String {
    let head = format!(
        "// Start Time: Unknown\n{rate}// Filter Profile: general\n// Option Flags: none\n"
    );
    let row = |c: u32| {
        format!(
            "{}\t{}\t{}\t\n",
            c % 65536,
            (4_294_967_000 + 100 * u64::from(c)) % (1 << 32),
            c % 5
        )
    };
    let rows: String = counters.map(row).collect();
    format!("{head}PacketCounter\tSampleTimeFine\tGyr_X\t\n{rows}")
}

#[test]
fn xsens_counter_wraps_and_tells_what_was_lost() {
    const RATE: &str = "// Update Rate: 50.0Hz\n";
    let whole = xsens(RATE, 65530..65542);
    let r = read_csv(&whole);
    assert_eq!((channels(&r), r.len()), (vec!["gyro.x".to_owned()], 12));
    assert_close(&[r.rate_hz], &[50.0]);
    let lost = xsens(RATE, (65530..65536).chain(65538..65542));
    insta::assert_snapshot!(refusal("mt.txt", &lost, &ReadOptions::default()));
    // Every second packet written: the rate is still the head's.
    let r = read_csv(xsens(RATE, (65530..65560).step_by(2)));
    assert_close(&[r.rate_hz], &[50.0]);
}

#[test]
fn arrays() {
    let array = |rows: usize, columns: usize| {
        npy(
            [rows, columns],
            (0..rows * columns).map(|i| i as f64 * 1e-3),
        )
    };
    let r = read_one("a.npy", array(4, 6), &at(100.0)).unwrap();
    assert_eq!(channels(&r).len(), 6);
    assert_samples(&r, 5, &[5e-3, 11e-3, 17e-3, 23e-3]);

    let names = ["gyro_x_deg_s", "gyro_y_deg_s", "temperature"]
        .map(String::from)
        .to_vec();
    let named = ReadOptions {
        columns: Some(names),
        ..at(100.0)
    };
    let r = read_one("a.npy", array(4, 3), &named).unwrap();
    assert_samples(&r, 0, &[0.0, 3e-3 * DEG, 6e-3 * DEG, 9e-3 * DEG]);
    let mut nan = array(4, 6);
    let offset = nan.len() - 8 * 7;
    nan[offset..offset + 8].copy_from_slice(&f64::NAN.to_le_bytes());
    insta::assert_snapshot!(answers(
        [
            ("no rate", array(4, 6), ReadOptions::default()),
            ("three columns", array(4, 3), at(100.0)),
            ("NaN", nan, at(100.0)),
        ]
        .map(|(name, array, options)| (name, read_one("a.npy", array, &options)))
    ));
}

#[test]
fn bad_cells_and_headers_are_named() {
    let cells = [
        (7, "0.05,abc"),
        (7, "0.05,"),
        (3, "nan,1"),
        (3, "0.01,-inf"),
        (3, "0.01,1e308"),
        (20, "0.18"),
        (4, "0.02,1,5"),
        (4, "\n\n0.02,x"),
    ]
    .map(|(line, row)| (format!("line {line}: {row}"), changed(line, row)));
    let texts = [
        "t_s,gyro_x_rad_s\n\"0,00\",1\n",
        "0,1\n0.01,2\n",
        "time,lat_deg\n0,1\n",
        "time,ticks\n0,1\n",
        "t_s,gx,gy\n0,1,2\n",
        "t_s,accel_x_g,ax_mps2\n0,1,2\n",
        "",
        "t_s,gyro_x_rad_s\n",
        "t_s,gyro_x\ns,turns/s\n0,1\n0.01,2\n",
        "t_s,gx_dps\ns,deg/s\ns,deg/s\n0,1\n",
        "t_s,gx_dps\n0,abc\n",
        "t_s,gyro_x_rad_s\n0.00,1.1e-04\n0.01\n0.02,-5.1e-04",
        "$GPRMC,,V,,,,,,,,,,N*53\n",
    ]
    .map(|text| (text.to_owned(), text.to_owned()));
    let all = cells.into_iter().chain(texts);
    insta::assert_snapshot!(answers(
        all.map(|(name, text)| (name, read_one("a.csv", text, &ReadOptions::default())))
    ));
    let named = ReadOptions {
        columns: Some(vec!["t_s".into(), "gyro_x_rad_s".into()]),
        ..Default::default()
    };
    for text in ["0,1\n0.01,2\n", "time,speed\n0,1\n0.01,2\n"] {
        let r = read_one("a.csv", text, &named).unwrap();
        assert_samples(&r, 0, &[1.0, 2.0]);
    }
}

#[test]
fn increments_become_rates() {
    let r =
        read_csv("t_s,dtheta_x_rad,dv_z_m_s\n0,0.001,0.098\n0.01,0.002,0.097\n0.02,0.003,0.099\n");
    assert_samples(&r, 1, &[0.1, 0.2, 0.3]);
    assert_samples(&r, 0, &[9.8, 9.7, 9.9]);
}

#[test]
fn a_directory_is_all_its_recordings_in_name_order() {
    let files = Files::new();
    for i in [10, 9, 1] {
        files.add(
            &format!("replicate_{i}.csv"),
            sound(20 + i).join("\n") + "\n",
        );
    }
    files.add("manifest.json", "{}");
    files.add(".hidden.csv", "x");
    files.add("gps.csv", "t_s,lat_deg\n0,1\n");
    let (r, report) = read(&[files.path()], &ReadOptions::default()).unwrap();
    assert_eq!(
        r.iter().map(Recording::len).collect::<Vec<_>>(),
        [21, 29, 30]
    );
    let line = report.files[0].to_string();
    assert!(line.ends_with("replicate_1.csv: 21 samples at 100 Hz (time column), 0.21 s; means removed: gyro x 0.003000 rad/s"), "{line}");
    let warnings = report.all_warnings().join("\n");
    assert!(
        warnings.ends_with("gps.csv: skipped, no column is a known one"),
        "{warnings}"
    );

    let again = files.path().join("replicate_1.csv");
    let empty = Files::new();
    for (paths, expected) in [
        (vec![files.path(), again], "replicate_1.csv is given twice"),
        (vec![empty.path()], ": no recordings in it"),
        (
            vec!["/no/such".into()],
            "/no/such: No such file or directory",
        ),
    ] {
        let e = read(&paths, &ReadOptions::default()).unwrap_err();
        assert!(e.to_string().ends_with(expected) && e.code() == 2, "{e}");
    }
}

/// A time column in ms with a gap, one without, and an array, from each of which a warm-up is left out.
#[test]
fn warm_up_and_gaps_are_left_out_of_every_kind_of_file() {
    let table = |gap: usize| {
        let row = |k: usize| {
            let t = if k > 9000 { k + gap } else { k };
            format!("{},{}\n", 10 * t, 1e-3 * ((k * 5) % 11) as f64)
        };
        format!(
            "t_ms,gyro_x_rad_s\n{}",
            (0..20_000).map(row).collect::<String>()
        )
    };
    let array = npy([9000, 1], (0..9000).map(|i| f64::from(i % 13) * 1e-3));
    let files = Files::new();
    let options = ReadOptions {
        gaps: Gaps::Split,
        skip_s: 1.5,
        columns: None,
        ..at(100.0)
    };
    let of_tables = [files.add("a.csv", table(40)), files.add("b.csv", table(0))];
    let (tables, _) = read(&of_tables, &options).unwrap();
    let named = ReadOptions {
        columns: Some(vec!["gyro_x_rad_s".into()]),
        ..options
    };
    let (arrays, _) = read(&[files.add("c.npy", array)], &named).unwrap();
    let lengths = tables.iter().chain(&arrays).map(Recording::len);
    assert!(lengths.eq([8851, 10_999, 19_850, 8850]));
}
