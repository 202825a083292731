mod clocks;
mod doubts;
mod facts;
mod garbage;
mod gravity;
mod texts;

use super::*;
use crate::io::property_tests::npy;
use nav_sim_signal::imu::{Channel, Signal};
use nav_sim_signal::units::{DEG, STANDARD_GRAVITY};
use std::fs;
use tempfile::TempDir;

/// Files of a directory of their own.
struct Files(TempDir);

impl Files {
    fn new() -> Self {
        Self(tempfile::tempdir().unwrap())
    }
    fn with(name: &str, contents: impl AsRef<[u8]>) -> (Self, PathBuf) {
        let files = Self::new();
        let path = files.add(name, contents);
        (files, path)
    }
    fn add(&self, name: &str, contents: impl AsRef<[u8]>) -> PathBuf {
        let path = self.0.path().join(name);
        fs::write(&path, contents).unwrap();
        path
    }
    fn path(&self) -> PathBuf {
        self.0.path().to_owned()
    }
}

fn read_one(
    name: &str,
    contents: impl AsRef<[u8]>,
    options: &ReadOptions,
) -> Result<Recording, Failure> {
    let (_files, path) = Files::with(name, contents);
    read(&[path], options).map(|(mut r, _)| r.remove(0))
}

/// The message without the directory, and the hint.
fn refusal_with(name: &str, contents: impl AsRef<[u8]>, options: &ReadOptions) -> (String, String) {
    let (files, path) = Files::with(name, contents);
    let e = read(&[path], options).unwrap_err();
    let directory = format!("{}/", files.path().display());
    (
        e.to_string().replace(&directory, ""),
        e.advice().unwrap_or_default(),
    )
}

fn refusal(contents: impl AsRef<[u8]>) -> String {
    refusal_with("a.csv", contents, &ReadOptions::default()).0
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

fn at_100_hz() -> ReadOptions {
    ReadOptions {
        rate_hz: Some(100.0),
        ..ReadOptions::default()
    }
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

fn assert_close(found: &[f64], expected: &[f64]) {
    assert_eq!(found.len(), expected.len());
    for (f, e) in found.iter().zip(expected) {
        assert!(
            (f - e).abs() <= 1e-13 * e.abs().max(1.0),
            "{found:?}, expected {expected:?}"
        );
    }
}

#[test]
fn our_columns_in_any_order_and_unit() {
    let text = "gyro_z_deg_s,t_ms,accel_x_g,note\n1,0,0.5,a\n3,10,0.25,b\n2,20,0.5,c\n";
    let r = read_one("a.csv", text, &ReadOptions::default()).unwrap();
    assert_eq!(channels(&r), ["accel.x", "gyro.z"]);
    assert_close(&[r.rate_hz], &[100.0]);
    let accel: Vec<f64> = [0.5, 0.25, 0.5].map(|v| v * STANDARD_GRAVITY).to_vec();
    assert_close(&samples_with_mean(&r.signals[0]), &accel);
    assert_close(
        &samples_with_mean(&r.signals[1]),
        &[DEG, 3.0 * DEG, 2.0 * DEG],
    );
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
        let r = read_one("a.txt", text, &ReadOptions::default()).unwrap();
        assert_close(&samples_with_mean(&r.signals[0]), &[1.0, 2.0]);
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
    assert_close(&samples_with_mean(&r.signals[0]), &[1.0, 2.0]);
    let (message, _) = refusal_with(
        "a.csv.gz",
        &bytes[..bytes.len() - 12],
        &ReadOptions::default(),
    );
    assert!(message.starts_with("a.csv.gz: "), "{message}");
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
        let r = read_one("a.csv", text, &ReadOptions::default()).unwrap();
        assert_eq!(r.signals.len(), expected);
        assert!((r.rate_hz / 200.0 - 1.0).abs() < 1e-4, "{}", r.rate_hz);
        assert_eq!(r.signals[0].channel.to_string(), first.0);
        assert_close(&samples_with_mean(&r.signals[0])[..1], &[first.1]);
    }
    let gnss_ins_sim = "gyro_x (deg/s),gyro_y (deg/s),gyro_z (deg/s)\n1,2,3\n2,3,4\n";
    let r = read_one("gyro-0.csv", gnss_ins_sim, &at_100_hz()).unwrap();
    assert_close(&samples_with_mean(&r.signals[2]), &[3.0 * DEG, 4.0 * DEG]);
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
    let r = read_one("mt.txt", &whole, &ReadOptions::default()).unwrap();
    assert_eq!((channels(&r), r.len()), (vec!["gyro.x".to_owned()], 12));
    assert_close(&[r.rate_hz], &[50.0]);
    let lost = xsens(RATE, (65530..65536).chain(65538..65542));
    let (message, hint) = refusal_with("mt.txt", &lost, &ReadOptions::default());
    assert_eq!(
        message,
        "mt.txt, line 12: gap in time from 0.1 s to 0.16 s, the median step is 0.02 s"
    );
    assert!(hint.contains("--gaps split takes"));
    // Every second packet written: the rate is still the head's.
    let r = read_one(
        "mt.txt",
        xsens(RATE, (65530..65560).step_by(2)),
        &ReadOptions::default(),
    )
    .unwrap();
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
    let r = read_one("a.npy", array(4, 6), &at_100_hz()).unwrap();
    assert_eq!(channels(&r).len(), 6);
    assert_close(
        &samples_with_mean(&r.signals[5]),
        &[5e-3, 11e-3, 17e-3, 23e-3],
    );
    assert_eq!(
        refusal_with("a.npy", array(4, 6), &ReadOptions::default()).0,
        "a.npy: no time column, and no rate given"
    );
    assert_eq!(
        refusal_with("a.npy", array(4, 3), &at_100_hz()).0,
        "a.npy: an array of 3 columns of unknown names"
    );
    let names = ["gyro_x_deg_s", "gyro_y_deg_s", "temperature"]
        .map(String::from)
        .to_vec();
    let named = ReadOptions {
        columns: Some(names),
        ..at_100_hz()
    };
    let r = read_one("a.npy", array(4, 3), &named).unwrap();
    assert_close(
        &samples_with_mean(&r.signals[0]),
        &[0.0, 3e-3 * DEG, 6e-3 * DEG, 9e-3 * DEG],
    );
    let mut nan = array(4, 6);
    let offset = nan.len() - 8 * 7;
    nan[offset..offset + 8].copy_from_slice(&f64::NAN.to_le_bytes());
    assert_eq!(
        refusal_with("a.npy", nan, &at_100_hz()).0,
        "a.npy, line 3: column \"gyro_z_rad_s\": \"NaN\" is not a finite number"
    );
}

#[test]
fn bad_cells_are_named() {
    assert_eq!(
        refusal(changed(7, "0.05,abc")),
        "a.csv, line 7: column \"gyro_x_rad_s\": \"abc\" is not a number"
    );
    assert_eq!(
        refusal(changed(7, "0.05,")),
        "a.csv, line 7: column \"gyro_x_rad_s\": \"\" is not a number"
    );
    assert_eq!(
        refusal(changed(3, "nan,1")),
        "a.csv, line 3: column \"t_s\": \"nan\" is not a finite number"
    );
    assert_eq!(
        refusal(changed(3, "0.01,-inf")),
        "a.csv, line 3: column \"gyro_x_rad_s\": \"-inf\" is not a finite number"
    );
    assert_eq!(
        refusal(changed(20, "0.18")),
        "a.csv, line 20: 1 values, but 2 columns"
    );
    assert_eq!(
        refusal(changed(4, "0.02,1,5")),
        "a.csv, line 4: 3 values, but 2 columns"
    );
    assert_eq!(
        refusal(changed(4, "\n\n0.02,x")),
        "a.csv, line 6: column \"gyro_x_rad_s\": \"x\" is not a number"
    );
    let (message, hint) = refusal_with(
        "a.csv",
        "t_s,gyro_x_rad_s\n\"0,00\",1\n",
        &ReadOptions::default(),
    );
    assert_eq!(
        message,
        "a.csv, line 2: column \"t_s\": \"0,00\" is not a number"
    );
    assert!(hint.contains("with a point"));
}

#[test]
fn headers_that_do_not_help() {
    assert_eq!(
        refusal("0,1\n0.01,2\n"),
        "a.csv, line 1: no header with column names, found \"0,1\""
    );
    assert_eq!(
        refusal("time,lat_deg\n0,1\n"),
        "a.csv, line 1: no accelerometer or gyroscope column among \"time\", \"lat_deg\""
    );
    assert_eq!(
        refusal("time,ticks\n0,1\n"),
        "a.csv, line 1: no accelerometer or gyroscope column among \"time\", \"ticks\""
    );
    assert_eq!(
        refusal("t_s,gx,gy\n0,1,2\n"),
        "a.csv, line 1: column \"gx\" has no unit in its name"
    );
    assert_eq!(
        refusal("t_s,accel_x_g,ax_mps2\n0,1,2\n"),
        "a.csv, line 1: columns \"accel_x_g\" and \"ax_mps2\" both give accel.x"
    );
    assert_eq!(refusal(""), "a.csv: no rows in it");
    assert_eq!(refusal("t_s,gyro_x_rad_s\n"), "a.csv: no rows in it");
    let named = ReadOptions {
        columns: Some(vec!["t_s".into(), "gyro_x_rad_s".into()]),
        ..Default::default()
    };
    for text in ["0,1\n0.01,2\n", "time,speed\n0,1\n0.01,2\n"] {
        assert_close(
            &samples_with_mean(&read_one("a.csv", text, &named).unwrap().signals[0]),
            &[1.0, 2.0],
        );
    }
}

#[test]
fn increments_become_rates() {
    let text = "t_s,dtheta_x_rad,dv_z_m_s\n0,0.001,0.098\n0.01,0.002,0.097\n0.02,0.003,0.099\n";
    let r = read_one("a.csv", text, &ReadOptions::default()).unwrap();
    assert_close(&samples_with_mean(&r.signals[1]), &[0.1, 0.2, 0.3]);
    assert_close(&samples_with_mean(&r.signals[0]), &[9.8, 9.7, 9.9]);
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
    assert_eq!(report.warnings.len(), 1);
    assert!(report.all_warnings()[0].ends_with("gps.csv: skipped, no column is a known one"));
    let line = report.files[0].to_string();
    assert!(line.ends_with("replicate_1.csv: 21 samples at 100 Hz (time column), 0.21 s; means removed: gyro x 0.003000 rad/s"), "{line}");

    let again = files.path().join("replicate_1.csv");
    let e = read(&[files.path(), again], &ReadOptions::default()).unwrap_err();
    assert!(e.to_string().ends_with("replicate_1.csv is given twice"));
    let empty = Files::new();
    let e = read(&[empty.path()], &ReadOptions::default()).unwrap_err();
    assert!(e.to_string().ends_with(": no recordings in it"));
    let e = read(&["/no/such".into()], &ReadOptions::default()).unwrap_err();
    assert_eq!(e.to_string(), "/no/such: No such file or directory");
    assert!(e.code() == 2);
}

/// Finite, and yet no measurement: its square overflows.
#[test]
fn absurd_numbers_are_refused_with_their_place() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("a.csv");
    std::fs::write(&path, "gyro_x_rad_s\n0.1\n1e308\n0.2\n").unwrap();
    let options = ReadOptions {
        rate_hz: Some(1.0),
        ..ReadOptions::default()
    };
    let message = read(&[path], &options).unwrap_err().to_string();
    assert!(
        message.ends_with(
            "a.csv, line 3: column \"gyro_x_rad_s\": 1e308 is beyond 1e100, no measurement"
        ),
        "{message}"
    );
}

/// Files that wait on disk show the same signals as files that are held, one by one: a time column in ms, increments,
/// units told from gravity, stretches between gaps, a warm-up; a gzipped table and arrays.
#[test]
fn warm_up_and_gaps_are_left_out_of_every_kind_of_file() {
    let g = [0.1, -0.05, 0.99];
    let row = |k: usize, t: usize| {
        let noise = |i: usize| 1e-3 * ((k * (i + 3)) % 11) as f64;
        let (f, w): (Vec<_>, Vec<_>) = (0..3)
            .map(|i| (g[i] + noise(i), 1e-4 * noise(i + 5)))
            .unzip();
        format!(
            "{},{},{},{},{},{},{}",
            10 * t,
            f[0],
            f[1],
            f[2],
            w[0],
            w[1],
            w[2]
        )
    };
    let head = "t_ms,acc_x,acc_y,acc_z,dtheta_x_rad,dtheta_y_rad,dtheta_z_rad".to_owned();
    let table = |gaps: bool| {
        let rows = (0..20_000).map(|k| row(k, if gaps && k > 9000 { k + 40 } else { k }));
        std::iter::once(head.clone())
            .chain(rows)
            .collect::<Vec<_>>()
            .join("\n")
            + "\n"
    };
    let array = npy([9000, 6], (0..54_000).map(|i| f64::from(i % 13) * 1e-3));
    let files = Files::new();
    let paths = [
        files.add("a.csv", table(true)),
        files.add("b.csv", table(false)),
        files.add("c.npy", array),
    ];
    let options = ReadOptions {
        gaps: Gaps::Split,
        skip_s: 1.5,
        rate_hz: Some(100.0),
        ..ReadOptions::default()
    };
    let (held, _) = read(&paths, &options).unwrap();
    assert_eq!(
        held.iter().map(Recording::len).collect::<Vec<_>>(),
        [8851, 10_999, 19_850, 8850]
    );
}
