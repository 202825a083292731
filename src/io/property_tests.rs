//! What every file of ours that is written and read keeps: what is read is what was written, and a file that is cut is refused
//! or read whole.

use super::draws_file::{self, DrawsFile, SignalDraws};
use super::model_file::{self, ModelFile, TurnOn};
use super::recordings::{ReadOptions, csv, read};
use super::tests::Files;
use super::trajectory_file;
use nav_sim_signal::imu::Channel;
use nav_sim_signal::noise::{Composite, Model, Process};
use proptest::prelude::*;

/// An array of `f64` as NumPy writes it: rows, columns, and its numbers row by row.
pub(super) fn npy([rows, columns]: [usize; 2], values: impl Iterator<Item = f64>) -> Vec<u8> {
    let head =
        format!("{{'descr': '<f8', 'fortran_order': False, 'shape': ({rows}, {columns}), }}");
    let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
    bytes.extend((head.len() as u16).to_le_bytes());
    bytes.extend(head.as_bytes());
    values.for_each(|x| bytes.extend(x.to_le_bytes()));
    bytes
}

/// A positive number of any size that a variance has.
fn variance() -> impl Strategy<Value = f64> {
    (-25.0..2.0_f64).prop_map(|power| 10_f64.powf(power))
}

fn composite() -> impl Strategy<Value = Composite> {
    let white = variance().prop_map(|v| Process::white(v).unwrap());
    let ar1 =
        (0.01..0.999_999_9_f64, variance()).prop_map(|(phi, v)| Process::ar1(phi, v).unwrap());
    let walk = variance().prop_map(|v| Process::random_walk(v).unwrap());
    let steps = variance().prop_map(|v| Process::quantization(v).unwrap());
    (white, ar1, walk, steps)
        .prop_map(|(white, ar1, walk, steps)| Composite::new(vec![white, ar1, walk, steps]))
}

fn draws() -> impl Strategy<Value = DrawsFile> {
    let row = || prop::collection::vec(any::<f64>().prop_filter("finite", |x| x.is_finite()), 3);
    (1e-3..1e4_f64, row(), prop::collection::vec(row(), 0..5)).prop_map(
        |(rate_hz, estimate, draws)| {
            let parameters = vec!["WN sigma2".to_owned(); 3];
            let signals = SignalDraws {
                signals: "accel".to_owned(),
                parameters,
                estimate,
                draws,
            };
            DrawsFile {
                schema_version: 1,
                rate_hz,
                signals: vec![signals],
            }
        },
    )
}

fn signals() -> impl Strategy<Value = Vec<(Channel, Vec<f64>)>> {
    prop::collection::vec(-0.1..0.1_f64, 8 * 6).prop_map(|all| {
        // at rest and level: the third axis of the accelerometer has gravity
        let gravity = |c: usize| if c == 2 { -9.81 } else { 0.0 };
        let column = |c: usize| {
            all.iter()
                .skip(c)
                .step_by(6)
                .map(|x| x + gravity(c))
                .collect()
        };
        Channel::ALL
            .iter()
            .enumerate()
            .map(|(c, channel)| (*channel, column(c)))
            .collect()
    })
}

/// Twelve rows one second apart, each within 20 m of a straight drive.
fn drive() -> impl Strategy<Value = String> {
    prop::collection::vec((-1e-4..1e-4_f64, -1e-4..1e-4_f64, -5.0..5.0_f64), 12).prop_map(|rows| {
        let row = |(k, (lat, lon, h)): (usize, &(f64, f64, f64))| {
            format!(
                "{k},{},{},{},0.5,-0.25,{}\n",
                46.5 + 1e-3 * k as f64 + lat,
                6.5 + lon,
                400.0 + h,
                3 * k
            )
        };
        let rows: String = rows.iter().enumerate().map(row).collect();
        format!("t_s,lat_deg,lon_deg,h_m,roll_deg,pitch_deg,yaw_deg\n{rows}")
    })
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 48, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn a_model_comes_back_bit_by_bit(accel in composite(), gyro in composite(), turn_on in 0.0..1.0_f64, rate_hz in 1.0..2000.0_f64) {
        let mut model = Model::pooled(rate_hz, &accel, &gyro);
        model.axes[4] = accel;
        let turn_on = TurnOn { accel_m_s2: Some([turn_on; 3]), gyro_rad_s: Some([turn_on, 0.0, 0.1]) };
        let file = ModelFile { turn_on: Some(turn_on), ..ModelFile::new(model) };
        let read = model_file::from_text("a.toml".as_ref(), &model_file::to_toml(&file)).unwrap();
        prop_assert_eq!((read.model, read.turn_on), (file.model, file.turn_on));
    }

    #[test]
    fn draws_come_back_bit_by_bit_and_a_part_of_them_is_refused(file in draws(), cut in 0.0..1.0_f64) {
        let case = Files::new();
        let json = serde_json::to_string_pretty(&file).unwrap();
        let model = case.path().join("a.toml");
        prop_assert!(draws_file::read(&model).unwrap().is_none());
        case.add("a.draws.json", &json);
        prop_assert_eq!(draws_file::read(&model).unwrap().unwrap(), file);
        case.add("a.draws.json", &json[..(cut * json.len() as f64) as usize]);
        prop_assert!(draws_file::read(&model).is_err());
    }

    #[test]
    fn an_array_comes_back_bit_by_bit_and_a_part_of_it_is_refused(signals in signals(), cut in 0.0..1.0_f64) {
        let case = Files::new();
        let rows = (0..8).flat_map(|k| signals.iter().map(move |(_, x)| x[k]));
        let bytes = npy([8, 6], rows);
        let array = nav_sim_logs::npy::read(&case.add("a.npy", &bytes)).unwrap();
        prop_assert_eq!(array.values.len(), 8 * 6);
        let of_row = |(i, x): (usize, &f64)| signals[i % 6].1[i / 6].to_bits() == x.to_bits();
        prop_assert!(array.values.iter().enumerate().all(of_row));
        let part = case.add("b.npy", &bytes[..(cut * bytes.len() as f64) as usize]);
        let options = ReadOptions { rate_hz: Some(100.0), ..ReadOptions::default() };
        prop_assert!(read(&[part], &options).is_err());
    }

    /// Packed, the end is known: a part is refused. Ten digits of every sample come back.
    #[test]
    fn a_packed_recording_comes_back_and_a_part_of_it_is_refused(signals in signals(), cut in 0.0..1.0_f64) {
        let case = Files::new();
        let mut packed = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::fast());
        std::io::Write::write_all(&mut packed, csv(100.0, &signals).as_bytes()).unwrap();
        let bytes = packed.finish().unwrap();
        let options = ReadOptions::default();
        let (recordings, _) = read(&[case.add("a.csv.gz", &bytes)], &options).unwrap();
        for (found, (channel, written)) in recordings[0].signals.iter().zip(&signals) {
            prop_assert_eq!(found.channel, *channel);
            for (a, b) in found.samples.iter().zip(written) {
                prop_assert!((a + found.mean - b).abs() <= 5.1e-10 * b.abs() + 1e-14, "{} {}", a + found.mean, b);
            }
        }
        let part = case.add("b.csv.gz", &bytes[..(cut * bytes.len() as f64) as usize]);
        prop_assert!(read(&[part], &options).is_err());
    }

    /// A table of the program, read and written again, is the same to the digits that positions from the centre of the Earth have:
    /// 2^-30 m each, a few of them; 1e-13 degrees are 11 nm.
    #[test]
    fn a_trajectory_comes_back(drive in drive()) {
        let case = Files::new();
        let again = |name: &str, text: &str| {
            let (trajectory, _) = trajectory_file::load(&case.add(name, text), None).unwrap();
            trajectory_file::csv(&trajectory, None)
        };
        let numbers = |text: &str| -> Vec<f64> {
            text.lines().skip(1).flat_map(|line| line.split(',').map(|cell| cell.parse().unwrap())).collect()
        };
        let written = again("a.csv", &drive);
        let [first, second] = [written.clone(), again("b.csv", &written)].map(|text| numbers(&text));
        prop_assert_eq!(first.len(), second.len());
        let digits = [0.0, 1e-13, 1e-13, 2e-8, 1e-7, 1e-7, 1e-7, 1e-11, 1e-11, 1e-11];
        for ((a, b), digit) in first.iter().zip(&second).zip(digits.iter().cycle()) {
            prop_assert!((a - b).abs() <= *digit, "{} {}", a, b);
        }
    }
}
