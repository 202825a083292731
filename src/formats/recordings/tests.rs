use super::*;
use crate::formats::npy;
use crate::imu::Signal;
use crate::units::{DEG, STANDARD_GRAVITY};
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

fn read_one(name: &str, contents: impl AsRef<[u8]>, options: &ReadOptions) -> Result<Recording, FileError> {
    let (_files, path) = Files::with(name, contents);
    read(&[path], options).map(|(mut r, _)| r.remove(0))
}

/// The message without the directory, and the hint.
fn refusal_with(name: &str, contents: impl AsRef<[u8]>, options: &ReadOptions) -> (String, String) {
    let (files, path) = Files::with(name, contents);
    let e = read(&[path], options).unwrap_err();
    let directory = format!("{}/", files.path().display());
    (e.to_string().replace(&directory, ""), e.hint().unwrap_or_default())
}

fn refusal(contents: impl AsRef<[u8]>) -> String {
    refusal_with("a.csv", contents, &ReadOptions::default()).0
}

/// A sound file of `n` rows at 100 Hz: time and x-gyro.
fn sound(n: usize) -> Vec<String> {
    let rows = (0..n).map(|k| format!("{},{}", k as f64 / 100.0, (k % 7) as f64 * 1e-3));
    std::iter::once("t_s,gyro_x_rad_s".to_owned()).chain(rows).collect()
}

fn changed(line: usize, to: &str) -> String {
    let mut lines = sound(20);
    lines[line - 1] = to.to_owned();
    lines.join("\n") + "\n"
}

fn at_100_hz() -> ReadOptions {
    ReadOptions { rate_hz: Some(100.0), ..ReadOptions::default() }
}

fn samples_with_mean(signal: &Signal) -> Vec<f64> {
    signal.samples.iter().map(|v| v + signal.mean).collect()
}

fn channels(recording: &Recording) -> Vec<String> {
    recording.signals.iter().map(|s| s.channel.to_string()).collect()
}

fn assert_close(found: &[f64], expected: &[f64]) {
    assert_eq!(found.len(), expected.len());
    for (f, e) in found.iter().zip(expected) {
        assert!((f - e).abs() <= 1e-13 * e.abs().max(1.0), "{found:?}, expected {expected:?}");
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
    assert_close(&samples_with_mean(&r.signals[1]), &[DEG, 3.0 * DEG, 2.0 * DEG]);
    assert_close(&[r.signals[1].mean], &[2.0 * DEG]);
    assert!(r.signals.iter().all(|s| s.samples.iter().sum::<f64>().abs() < 1e-12));
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
    let (message, _) = refusal_with("a.csv.gz", &bytes[..bytes.len() - 12], &ReadOptions::default());
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
    let head = format!("// Start Time: Unknown\n{rate}// Filter Profile: general\n// Option Flags: none\n");
    let row = |c: u32| {
        format!("{}\t{}\t{}\t\n", c % 65536, (4_294_967_000 + 100 * u64::from(c)) % (1 << 32), c % 5)
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
    assert_eq!(message, "mt.txt, line 12: gap in time from 0.1 s to 0.16 s, the median step is 0.02 s");
    assert!(hint.contains("split the recording at its gaps"));
    // Every second packet written: the rate is still the head's.
    let r = read_one("mt.txt", xsens(RATE, (65530..65560).step_by(2)), &ReadOptions::default()).unwrap();
    assert_close(&[r.rate_hz], &[50.0]);
    // A fine clock that is not filled in is passed over.
    let empty = "// MT Manager version: 2022.2.0\nPacketCounter\tSampleTimeFine\tGyr_X\n51400\tNaN\t0.1\n51401\t\t0.2\n";
    assert_eq!(read_one("mt.txt", empty, &at_100_hz()).unwrap().len(), 2);
    // No rate in the head: the fine clock has it, over its own wrap.
    let r = read_one("mt.txt", xsens("", 0..12), &ReadOptions::default()).unwrap();
    assert_close(&[r.rate_hz], &[100.0]);
}

#[test]
fn arrays() {
    let array = |rows: usize, columns: usize| {
        let mut bytes = Vec::new();
        npy::write_header(&mut bytes, rows, columns).unwrap();
        (0..rows * columns).for_each(|i| bytes.extend((i as f64 * 1e-3).to_le_bytes()));
        bytes
    };
    let r = read_one("a.npy", array(4, 6), &at_100_hz()).unwrap();
    assert_eq!(channels(&r).len(), 6);
    assert_close(&samples_with_mean(&r.signals[5]), &[5e-3, 11e-3, 17e-3, 23e-3]);
    assert_eq!(
        refusal_with("a.npy", array(4, 6), &ReadOptions::default()).0,
        "a.npy: no time column, and no rate is given"
    );
    assert_eq!(
        refusal_with("a.npy", array(4, 3), &at_100_hz()).0,
        "a.npy: an array of 3 columns, which names are not known"
    );
    let names = ["gyro_x_deg_s", "gyro_y_deg_s", "temperature"].map(String::from).to_vec();
    let named = ReadOptions { columns: Some(names), ..at_100_hz() };
    let r = read_one("a.npy", array(4, 3), &named).unwrap();
    assert_close(&samples_with_mean(&r.signals[0]), &[0.0, 3e-3 * DEG, 6e-3 * DEG, 9e-3 * DEG]);
    let mut nan = array(4, 6);
    let at = nan.len() - 8 * 7;
    nan[at..at + 8].copy_from_slice(&f64::NAN.to_le_bytes());
    assert_eq!(
        refusal_with("a.npy", nan, &at_100_hz()).0,
        "a.npy, line 3: column \"gyro_z_rad_s\": \"NaN\" is not finite"
    );
}

#[test]
fn bad_cells_are_named() {
    assert_eq!(
        refusal(changed(7, "0.05,abc")),
        "a.csv, line 7: column \"gyro_x_rad_s\": \"abc\" is not a number"
    );
    assert_eq!(refusal(changed(7, "0.05,")), "a.csv, line 7: column \"gyro_x_rad_s\": \"\" is not a number");
    assert_eq!(refusal(changed(3, "nan,1")), "a.csv, line 3: column \"t_s\": \"nan\" is not finite");
    assert_eq!(
        refusal(changed(3, "0.01,-inf")),
        "a.csv, line 3: column \"gyro_x_rad_s\": \"-inf\" is not finite"
    );
    assert_eq!(refusal(changed(21, "0.19")), "a.csv, line 21: 1 values, but 2 columns");
    assert_eq!(refusal(changed(4, "0.02,1,5")), "a.csv, line 4: 3 values, but 2 columns");
    assert_eq!(
        refusal(changed(4, "\n\n0.02,x")),
        "a.csv, line 6: column \"gyro_x_rad_s\": \"x\" is not a number"
    );
    let (message, hint) = refusal_with("a.csv", "t_s;gyro_x_rad_s\n0,00;1\n", &ReadOptions::default());
    assert_eq!(message, "a.csv, line 2: column \"t_s\": \"0,00\" is not a number");
    assert!(hint.contains("with a point"));
}

#[test]
fn headers_that_do_not_help() {
    assert_eq!(
        refusal("0,1\n0.01,2\n"),
        "a.csv, line 1: a header that names the columns is missing, found \"0,1\""
    );
    assert_eq!(
        refusal("time,lat_deg\n0,1\n"),
        "a.csv, line 1: no accelerometer or gyroscope column among \"time\", \"lat_deg\""
    );
    assert_eq!(refusal("t_s,gx,gy\n0,1,2\n"), "a.csv, line 1: column \"gx\" has no unit in its name");
    assert_eq!(
        refusal("t_s,accel_x_g,ax_mps2\n0,1,2\n"),
        "a.csv, line 1: columns \"accel_x_g\" and \"ax_mps2\" are both accel.x"
    );
    assert_eq!(refusal(""), "a.csv: no samples in it");
    assert_eq!(refusal("t_s,gyro_x_rad_s\n"), "a.csv: no samples in it");
    let named =
        ReadOptions { columns: Some(vec!["t_s".into(), "gyro_x_rad_s".into()]), ..Default::default() };
    for text in ["0,1\n0.01,2\n", "time,speed\n0,1\n0.01,2\n"] {
        assert_close(&samples_with_mean(&read_one("a.csv", text, &named).unwrap().signals[0]), &[1.0, 2.0]);
    }
}

#[test]
fn time_is_checked() {
    assert_eq!(refusal(changed(7, "0.03,1")), "a.csv, line 7: time goes back from 0.04 s to 0.03 s");
    assert_eq!(
        refusal(changed(7, "0.04,1")),
        "a.csv, line 7: duplicate in time: 0.04 s to 0.04 s, the median step is 0.01 s (2 such steps in all)"
    );
    let gap: String =
        sound(20).into_iter().enumerate().filter(|(i, _)| *i != 10).map(|(_, l)| l + "\n").collect();
    assert_eq!(refusal(&gap), "a.csv, line 11: gap in time from 0.08 s to 0.1 s, the median step is 0.01 s");
    assert_eq!(
        refusal("t_s,gyro_x_rad_s\n1,1\n1,2\n1,3\n"),
        "a.csv: column \"t_s\" does not advance: its median step is 0"
    );

    let with = |gaps| ReadOptions { gaps, ..ReadOptions::default() };
    let (_files, path) = Files::with("a.csv", &gap);
    let (split, report) = read(std::slice::from_ref(&path), &with(Gaps::Split)).unwrap();
    assert_eq!(split.iter().map(Recording::len).collect::<Vec<_>>(), [9, 10]);
    assert!(
        report.files[0].warnings[0].contains("split at 1 gaps or duplicates in time, the first in line 11")
    );
    let (whole, _) = read(&[path], &with(Gaps::Ignore)).unwrap();
    assert_eq!((whole.len(), whole[0].len()), (1, 19));
    assert_close(&[whole[0].rate_hz], &[100.0]);
}

#[test]
fn rates() {
    let text = sound(20).join("\n");
    let given = |rate_hz| ReadOptions { rate_hz: Some(rate_hz), ..ReadOptions::default() };
    assert_eq!(
        refusal_with("a.csv", &text, &given(200.0)).0,
        "a.csv: the time column runs at 100 Hz, but 200 Hz is given"
    );
    assert_eq!(refusal_with("a.csv", &text, &given(-1.0)).0, "a.csv: -1 Hz is not a sample rate");
    assert_eq!(refusal("gyro_x_rad_s\n1\n2\n"), "a.csv: no time column, and no rate is given");
    // Stamps rounded to 1 ms at 128 Hz: the span knows the rate, no single step does.
    let rounded: String = (0..1000).map(|k| format!("{:.3},{}\n", k as f64 / 128.0, k % 3)).collect();
    let r = read_one("a.csv", format!("t_s,gyro_x_rad_s\n{rounded}"), &ReadOptions::default()).unwrap();
    assert!((r.rate_hz - 128.0).abs() < 0.01, "{}", r.rate_hz);

    let files = Files::new();
    files.add("a.csv", &text);
    files.add("b.csv", text.replace("t_s", "t_ms"));
    let message = read(&[files.path()], &ReadOptions::default()).unwrap_err().to_string();
    assert!(
        message.ends_with(&format!("b.csv has 100000 Hz, but {}/a.csv has 100 Hz", files.path().display())),
        "{message}"
    );
}

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
        "a.csv: static |f| is 1.0003 m/s², far from 9.81 m/s²: it looks like g"
    );
    assert_eq!(
        message(six_axes(1.0, "_g")),
        "a.csv: static |f| is 96.1954 m/s², far from 9.81 m/s²: it looks like m/s² named g"
    );
    assert_eq!(
        message(six_axes(0.5, "_m_s2")),
        "a.csv: static |f| is 4.9046 m/s², far from 9.81 m/s²: wrong unit, or the sensor was moving"
    );
    // A mean removed before is no gravity at all.
    read_one("a.csv", six_axes(0.0, "_m_s2"), &at_100_hz()).unwrap();
}

/// An array with the gyroscopes first: gravity stands in the columns that are taken for theirs.
#[test]
fn exchanged_sensors_are_refused() {
    let mut bytes = Vec::new();
    npy::write_header(&mut bytes, 200, 6).unwrap();
    for i in 0..200 {
        let small = f64::from(i % 7) * 1e-4;
        for x in [small, -small, small, small, -small, 9.8 + small] {
            bytes.extend(x.to_le_bytes());
        }
    }
    let (message, hint) = refusal_with("a.npy", &bytes, &at_100_hz());
    assert!(
        message.starts_with("a.npy: static |f| is 0.000") && message.ends_with("gyroscopes are exchanged"),
        "{message}"
    );
    assert!(hint.contains("give the names of the columns"), "{hint}");
    let named = |sensor: &str, unit: &str| ["x", "y", "z"].map(|axis| format!("{sensor}_{axis}_{unit}"));
    let columns = [named("gyro", "rad_s"), named("accel", "m_s2")].concat();
    read_one("a.npy", bytes, &ReadOptions { columns: Some(columns), ..at_100_hz() }).unwrap();
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
    assert_eq!(message, "a.csv: gyro.y (column \"gyro_y_rad_s\") is dead: every sample is 0.5");
    assert!(hint.contains("leave the channel out"));
    let x = Channel { sensor: crate::imu::Sensor::Gyro, axis: crate::imu::Axis::X };
    let only_x = ReadOptions { channels: Some(vec![x]), ..at_100_hz() };
    assert_eq!(read_one("a.csv", dead, &only_x).unwrap().signals.len(), 1);

    let needed = ReadOptions { min_samples: 64, ..ReadOptions::default() };
    assert_eq!(
        refusal_with("a.csv", sound(20).join("\n"), &needed).0,
        "a.csv: 20 samples, but 64 are needed"
    );
    assert_eq!(refusal(sound(1).join("\n")), "a.csv: 1 samples, but 2 are needed");
    let skip = ReadOptions { skip_s: 0.05, ..ReadOptions::default() };
    assert_eq!(read_one("a.csv", sound(20).join("\n"), &skip).unwrap().len(), 15);
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
        files.add(&format!("replicate_{i}.csv"), sound(20 + i).join("\n"));
    }
    files.add("manifest.json", "{}");
    files.add(".hidden.csv", "x");
    files.add("gps.csv", "t_s,lat_deg\n0,1\n");
    let (r, report) = read(&[files.path()], &ReadOptions::default()).unwrap();
    assert_eq!(r.iter().map(Recording::len).collect::<Vec<_>>(), [21, 29, 30]);
    assert_eq!(report.warnings.len(), 1);
    assert!(report.all_warnings()[0].ends_with("gps.csv: passed over, no column is a known one"));
    let line = report.files[0].to_string();
    assert!(line.ends_with("replicate_1.csv: 21 samples at 100 Hz (time column), 0.21 s; means removed: gyro x 0.003000 rad/s"), "{line}");

    let again = files.path().join("replicate_1.csv");
    let e = read(&[files.path(), again], &ReadOptions::default()).unwrap_err();
    assert!(e.to_string().ends_with("replicate_1.csv is given twice: it would count as two replicates"));
    let empty = Files::new();
    let e = read(&[empty.path()], &ReadOptions::default()).unwrap_err();
    assert!(e.to_string().ends_with(": no recordings in it"));
    let e = read(&["/no/such".into()], &ReadOptions::default()).unwrap_err();
    assert_eq!(e.to_string(), "/no/such: No such file or directory (os error 2)");
    assert!(e.is_system());
}

/// What is no error and yet not as it seems: told, and read.
#[test]
fn doubts_are_told() {
    let warnings = |text: &str, options: &ReadOptions| {
        let (_files, path) = Files::with("a.csv", text);
        read(&[path], options).unwrap().1.files.remove(0).warnings
    };
    // seven levels in an order that does not come again
    let level = |k: usize| (k * k % 1009 % 7) as f64 * 1e-3;
    let rows = |step: f64, stands_from: usize| {
        let value = |k: usize| level(k.min(stands_from));
        (0..1000)
            .map(|k| format!("{},{},{}\n", k as f64 * step, value(k), (k % 5) as f64))
            .collect::<String>()
    };
    let plain = ReadOptions::default();
    assert_eq!(warnings(&format!("t_s,gyro_x_rad_s,temperature\n{}", rows(0.01, 1000)), &plain), [""; 0]);
    assert_eq!(
        warnings(&format!("t_s,gyro_x_rad_s,gryo_y_rad_s\n{}", rows(0.01, 1000)), &plain),
        ["column \"gryo_y_rad_s\" is passed over: is it gyro_y_rad_s?"]
    );
    assert_eq!(
        warnings(&format!("t_s,gyro_x_rad_s,b\n{}", rows(10.0, 1000)), &plain),
        ["0.1 Hz is no usual rate of an IMU: is the unit of \"t_s\" right?"]
    );
    assert_eq!(
        warnings(&format!("t_s,gyro_x_rad_s,b\n{}", rows(0.01, 249)), &plain),
        ["gyro.x (column \"gyro_x_rad_s\") stands at 0.004 for 75 % of the record, from line 251 on"]
    );
    // A stretch of 30 beside one of 969 would cost all the long scales.
    let gap = |k: usize| k as f64 * 0.01 + if k >= 970 { 1.0 } else { 0.0 };
    let text: String = (0..1000).map(|k| format!("{},{}\n", gap(k), level(k))).collect();
    let split = ReadOptions { gaps: Gaps::Split, ..plain };
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
    let mut noise = || (0..12).map(|_| (generator.next_u32() as f64) / 2f64.powi(32)).sum::<f64>() - 6.0;
    let row = |k: usize| {
        let means = [0.1, -0.2, STANDARD_GRAVITY, 0.0, 0.0, 0.0];
        let sizes = [0.02, 0.02, 0.02, 1e-3, 1e-3, 1e-3];
        let values = change(k, std::array::from_fn(|i| means[i] + sizes[i] * noise()));
        values.map(|v| format!("{v:.6}")).join(",")
    };
    (0..rows).map(row).collect()
}

const TRIADS: &str = "accel_x_m_s2,accel_y_m_s2,accel_z_m_s2,gyro_x_rad_s,gyro_y_rad_s,gyro_z_rad_s\n";

/// Warnings about rows without a time column, at 100 Hz.
fn warnings_of(rows: &[String]) -> Vec<String> {
    let (_files, path) = Files::with("a.csv", format!("{TRIADS}{}\n", rows.join("\n")));
    read(&[path], &at_100_hz()).unwrap().1.files.remove(0).warnings
}

/// What no sensor gives though every number is one. Sound samples, quantized ones and such of which an axis has
/// three levels only raise none of these doubts.
#[test]
fn numbers_that_no_sensor_gives_are_told() {
    let sound = triads(4000, |_, v| v);
    assert_eq!(warnings_of(&sound), [""; 0]);
    for (accel, gyro) in [(0.01, 5e-4), (0.04, 2e-3)] {
        let steps = [accel, accel, accel, gyro, gyro, gyro];
        let coarse = triads(4000, |_, v| std::array::from_fn(|i| (v[i] / steps[i]).round() * steps[i]));
        assert_eq!(warnings_of(&coarse), [""; 0]);
    }
    let twice: Vec<String> = sound.iter().flat_map(|row| [row.clone(), row.clone()]).collect();
    let said = warnings_of(&twice);
    assert_eq!(said.len(), 1, "{said:?}");
    assert!(
        said[0].starts_with("accel.x, accel.y, accel.z, gyro.x, gyro.y, gyro.z: of every 2 rows"),
        "{said:?}"
    );

    let mut block = sound.clone();
    block.splice(3000..3000, sound[1000..2000].to_vec());
    assert_eq!(
        warnings_of(&block),
        ["lines 3002 to 4001 are the same as lines 1002 to 2001: a block written twice? Remove one of them"]
    );

    let clipped = triads(4000, |_, mut v| {
        v[1] = v[1].clamp(-0.21, -0.19);
        v
    });
    let said = warnings_of(&clipped);
    assert_eq!(said.len(), 2, "{said:?}");
    let largest = "accel.y (column \"accel_y_m_s2\") stands at its largest value, -0.19, in 3";
    assert!(said[0].starts_with(largest), "{said:?}");

    let x_in_g = triads(4000, |_, mut v| {
        v[0] /= STANDARD_GRAVITY;
        v
    });
    let said = warnings_of(&x_in_g);
    assert_eq!(said.len(), 1, "{said:?}");
    assert!(
        said[0].starts_with("accel.x: its steps from row to row are 9.") && said[0].contains("smaller"),
        "{said:?}"
    );

    let said = warnings_of(&triads(4000, |_, v| v.map(|v| v / 100.0)));
    assert_eq!(said.len(), 1, "{said:?}");
    assert!(said[0].contains("which is what gravity adds in one sample interval"), "{said:?}");
}

/// A copy of a recording is known by any large part of it, wherever it begins; other recordings share nothing.
#[test]
fn recordings_that_share_samples_are_known() {
    let rows = triads(8000, |_, v| v);
    let overlap = |a: &[String], b: &[String]| {
        let files = Files::new();
        let add = |name, rows: &[String]| files.add(name, format!("{TRIADS}{}\n", rows.join("\n")));
        let paths = [add("a.csv", a), add("b.csv", b)];
        read(&paths, &at_100_hz()).unwrap().1.overlap().map(|(_, _, share)| share)
    };
    assert_eq!(overlap(&rows[..4000], &rows[4000..]), None);
    assert!(overlap(&rows[..4000], &rows[1..4000]).unwrap() > 0.95);
    // a half: of 64 hashes 21 ± 4 are shared, a third of the union
    let half = overlap(&rows[..4000], &rows[2000..6000]).unwrap();
    assert!((0.2..0.8).contains(&half), "{half}");
}

#[test]
fn a_rate_beside_that_of_the_time_column_is_told() {
    let (_files, path) = Files::with("a.csv", sound(20).join("\n"));
    let report = |rate_hz| {
        let options = ReadOptions { rate_hz: Some(rate_hz), ..ReadOptions::default() };
        read(std::slice::from_ref(&path), &options).unwrap().1.files.remove(0)
    };
    assert_eq!((report(100.0).warnings.len(), report(100.05).warnings.len()), (0, 0));
    let found = report(100.9);
    assert_eq!(found.warnings, ["100.9 Hz is given, but the file runs at 100 Hz: the rate given is taken"]);
    assert_eq!((found.rate_hz, found.rate_from.as_str()), (100.9, "given; the time column has 100 Hz"));
}

mod garbage {
    use super::*;
    use proptest::prelude::*;
    use std::io::Cursor;

    fn parse(bytes: Vec<u8>) {
        let options = ReadOptions::default();
        if let Ok(raw) = text::parse("a.csv", Box::new(Cursor::new(bytes)), &options) {
            let _ = Prepared::new(raw, &options).and_then(|(prepared, _)| prepared.recordings());
        }
    }

    proptest! {
        #[test]
        fn never_panics_on_bytes(bytes in prop::collection::vec(any::<u8>(), 0..300)) {
            parse(bytes);
        }

        /// Sound files with some bytes overwritten, among them the dangerous ones.
        #[test]
        fn never_panics_on_damage(
            damage in prop::collection::vec((0usize..300, prop::sample::select(&b"\"\n\r,;\t-e9.#/\0\xff "[..])), 1..8),
        ) {
            let mut bytes = sound(20).join("\n").into_bytes();
            let n = bytes.len();
            for (at, byte) in damage {
                bytes[at % n] = byte;
            }
            parse(bytes);
        }
    }
}

/// Finite, and yet no measurement: its square overflows.
#[test]
fn absurd_numbers_are_refused_with_their_place() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("a.csv");
    std::fs::write(&path, "gyro_x_rad_s\n0.1\n1e308\n0.2\n").unwrap();
    let options = ReadOptions { rate_hz: Some(1.0), ..ReadOptions::default() };
    let message = read(&[path], &options).unwrap_err().to_string();
    assert!(
        message.ends_with("a.csv, line 3: column \"gyro_x_rad_s\": 1e308 is beyond 1e100, no measurement"),
        "{message}"
    );
}

/// Files that wait on disk show the same signals as files that are held, one by one: a time column in ms, increments,
/// units told from gravity, stretches between gaps, a warm-up; a gzipped table and arrays.
#[test]
fn what_is_not_held_reads_the_same() {
    let g = [0.1, -0.05, 0.99];
    let row = |k: usize, t: usize| {
        let noise = |i: usize| 1e-3 * ((k * (i + 3)) % 11) as f64;
        let (f, w): (Vec<_>, Vec<_>) = (0..3).map(|i| (g[i] + noise(i), 1e-4 * noise(i + 5))).unzip();
        format!("{},{},{},{},{},{},{}", 10 * t, f[0], f[1], f[2], w[0], w[1], w[2])
    };
    let head = "t_ms,acc_x,acc_y,acc_z,dtheta_x_rad,dtheta_y_rad,dtheta_z_rad".to_owned();
    let table = |gaps: bool| {
        let at = |k: usize| k + if gaps && k > 9000 { 40 } else { 0 };
        std::iter::once(head.clone()).chain((0..20_000).map(|k| row(k, at(k)))).collect::<Vec<_>>().join("\n")
    };
    let mut array = Vec::new();
    npy::write_header(&mut array, 9000, 6).unwrap();
    (0..54_000).for_each(|i| array.extend((f64::from(i % 13) * 1e-3).to_le_bytes()));
    let files = Files::new();
    let paths =
        [files.add("a.csv", table(true)), files.add("b.csv", table(false)), files.add("c.npy", array)];
    let options =
        ReadOptions { gaps: Gaps::Split, skip_s: 1.5, rate_hz: Some(100.0), ..ReadOptions::default() };
    let (held, report) = read(&paths, &options).unwrap();
    assert_eq!(held.iter().map(Recording::len).collect::<Vec<_>>(), [8851, 10_999, 19_850, 8850]);
    let on_disk = ReadOptions { hold_bytes: 0, ..options };
    let (mut shown, same) = visit(&paths, &on_disk, &|r| r, &|_, _| {}).unwrap();
    assert_eq!(same, report);
    assert!(shown.iter().all(|r| r.signals.len() == 1) && shown.len() == 4 * 6);
    for whole in &held {
        let signals: Vec<Signal> = shown.drain(..6).flat_map(|r| r.signals).collect();
        assert_eq!(signals, whole.signals);
    }
}
