//! Facts that no noise explains: none in clean recordings, and what becomes of those that have some.

use super::*;
use approx::assert_relative_eq;
use nav_sim_signal::noise::{Composite, Model, Process, ProcessKind, VirtualImu};
use nav_sim_signal::rng::Generator;
use rand::{RngExt, SeedableRng};
use std::fmt::Write;

/// A sensor of white noise N (units·√s) and walk K (units/√s), as N2 or white noise alone.
fn noise(n: f64, k: f64, rate_hz: f64, kind: usize, phi: f64) -> Composite {
    let white = n * n * rate_hz;
    let all = [
        Process::white(white),
        Process::random_walk(k * k / rate_hz),
        Process::quantization(white),
        Process::ar1(phi, white * (1.0 - phi * phi)),
        Process::ar1(0.99, 0.02 * white),
    ];
    let count = [1, 2, 3, 5][kind];
    Composite::new(all.into_iter().take(count).map(Result::unwrap).collect())
}

/// A clean recording: white noise or N2, of a navigation-grade unit to a consumer's, with steps from none to three standard
/// deviations, at 10 Hz to 1 kHz, in one of four units.
fn clean(seed: u64, rows: usize) -> String {
    let mut generator = Generator::seed_from_u64(seed);
    let mut of = |all: &[f64]| all[generator.random_range(0..all.len())];
    let rate_hz = of(&[10.0, 50.0, 62.5, 100.0, 125.0, 200.0, 400.0, 1000.0]);
    let grade = of(&[1.0, 20.0, 200.0]);
    let (kind, phi) = (of(&[0.0, 1.0, 2.0, 3.0]) as usize, of(&[0.5, 0.95, 0.999]));
    let (walk, step) = (of(&[0.01, 0.1, 0.5]), of(&[0.0, 0.01, 0.1, 0.3, 1.0, 3.0]));
    let [per_g, per_deg] = [of(&[1.0, STANDARD_GRAVITY]), of(&[1.0, DEG])];
    let gyro_grade = of(&[1.0, 10.0]) * grade;
    let [accel_n, gyro_n] = [0.001 / 60.0 * grade, 0.001 * DEG / 60.0 * gyro_grade];
    let [accel, gyro] = [accel_n, gyro_n].map(|n| noise(n, walk * n, rate_hz, kind, phi));
    let model = Model::pooled(rate_hz, &accel, &gyro);
    let imu = VirtualImu {
        model: &model,
        spread: None,
        contamination: None,
        seed,
    };
    let recording = imu.recording(1, &Channel::ALL, rows).unwrap();
    let gravity = [0.3, -0.7, 9.78, 2e-3, -1e-3, 5e-4];
    let mut text = String::from("t_s");
    for (sensor, unit) in [
        ("accel", ["_m_s2", "_g"][usize::from(per_g > 1.0)]),
        ("gyro", ["_rad_s", "_deg_s"][usize::from(per_deg < 1.0)]),
    ] {
        for axis in ["x", "y", "z"] {
            let _ = write!(text, ",{sensor}_{axis}{unit}");
        }
    }
    for k in 0..rows {
        let _ = write!(text, "\n{:.6}", k as f64 / rate_hz);
        for (i, signal) in recording.signals.iter().enumerate() {
            let (n, unit) = if i < 3 {
                (accel_n, per_g)
            } else {
                (gyro_n, per_deg)
            };
            let value = (gravity[i] + signal.mean + signal.samples[k]) / unit;
            // the coarsest in use: 5 mg and 0.05 °/s
            let coarsest = if i < 3 { 0.05 } else { 0.05 * DEG };
            let step = (step * n * rate_hz.sqrt()).min(coarsest) / unit;
            let value = if step > 0.0 {
                (value / step).round() * step
            } else {
                value
            };
            let _ = match seed % 3 {
                0 => write!(text, ",{value:.7e}"),
                1 => write!(text, ",{value:.9}"),
                _ => write!(text, ",{value}"),
            };
        }
    }
    text + "\n"
}

/// What is said of clean recordings.
fn said(seeds: std::ops::Range<u64>, rows: usize) -> Vec<String> {
    let one = |seed| {
        let (_files, path) = Files::with("a.csv", clean(seed, rows));
        match read(&[path], &ReadOptions::default()) {
            Ok((_, report)) => report.files[0].warnings.clone(),
            Err(e) => vec![e.to_string()],
        }
    };
    let all = seeds.into_par_iter();
    all.flat_map_iter(|seed| {
        one(seed)
            .into_iter()
            .map(move |text| format!("{seed}: {text}"))
    })
    .collect()
}

/// Nine facts at 1e-4 each: 0.18 alarms are expected of 200 recordings, and one has a probability of 16 %; the recordings are
/// always the same.
#[test]
fn nothing_is_said_of_clean_recordings() {
    assert_eq!(said(0..200, 1500), [""; 0]);
}

/// A walk that two axes share, as a common temperature makes it, and a ramp: each named with its axes and its size; the same walk in
/// one axis alone is not.
#[test]
fn shared_noise_and_drift_are_told() {
    let plain = rows(9, 40_000);
    let walk: Vec<f64> = rows(10, 40_000)
        .iter()
        .scan(0.0, |sum, row| {
            *sum += 0.04 * (row[5] - 0.005);
            Some(*sum)
        })
        .collect();
    let with = |change: &dyn Fn(usize, &mut [f64; 6])| {
        let mut rows = plain.clone();
        let each = rows.iter_mut().enumerate();
        each.for_each(|(k, row)| change(k, row));
        kept(&written(100.0, &rows), None).1
    };
    assert_eq!(with(&|k, row| row[3] += walk[k]), [""; 0]);
    let shared = with(&|k, row| {
        row[3] += walk[k];
        row[5] -= 0.5 * walk[k];
    });
    assert!(
        shared.len() == 1
            && shared[0].starts_with("gyro.x and gyro.z share noise (correlation -0."),
        "{shared:?}"
    );
    // 4e-5 rad/s a second; 39 differences of means of 512 samples know it to 10 %, four deviations
    let ramp = with(&|k, row| row[4] += 4e-7 * k as f64);
    let [said] = &ramp[..] else {
        panic!("{ramp:?}")
    };
    let words: Vec<&str> = said.split(' ').collect();
    let slope: f64 = words[3].parse().unwrap();
    assert_eq!((words[0], words[4]), ("gyro.y", "deg/h"));
    assert_relative_eq!(slope * DEG / 3600.0_f64.powi(2), 4e-5, max_relative = 0.4);
}

/// Rows of white noise of six axes at 100 Hz about gravity, 2 cm/s² and 2 mrad/s.
fn rows(seed: u64, count: usize) -> Vec<[f64; 6]> {
    let mut generator = Generator::seed_from_u64(seed);
    let mut normal = || generator.sample::<f64, _>(rand_distr::StandardNormal);
    let means = [0.1, -0.2, 9.8, 0.01, -0.02, 0.005];
    let mut row = || std::array::from_fn(|k| means[k] + [0.02, 0.002][k / 3] * normal());
    (0..count).map(|_| row()).collect()
}

fn table(stamps: impl Iterator<Item = f64>, rows: &[[f64; 6]]) -> String {
    let mut text = SEVEN.replace(' ', ",") + "\n";
    for (t, row) in stamps.zip(rows) {
        let cells: Vec<String> = row.iter().map(|x| format!("{x:.6}")).collect();
        let _ = writeln!(text, "{t:.6},{}", cells.join(","));
    }
    text
}

fn written(rate_hz: f64, rows: &[[f64; 6]]) -> String {
    table((0..rows.len()).map(|k| k as f64 / rate_hz), rows)
}

fn kept(text: &str, channels: Option<&str>) -> (Recording, Vec<String>) {
    let options = ReadOptions {
        channels: channels.map(Channel::named),
        ..with_gaps(Gaps::Keep)
    };
    let (recording, report) = outcome(text, &options);
    (recording, report.warnings)
}

/// Rows some of which, at random, have the values of the row before: the logger had no new sample.
fn repeated(rows: &[[f64; 6]], share: f64) -> Vec<[f64; 6]> {
    let mut generator = Generator::seed_from_u64(2);
    let mut rows = rows.to_vec();
    for k in 1..rows.len() {
        if generator.random_bool(share) {
            rows[k] = rows[k - 1];
        }
    }
    rows
}

/// Standard deviation of x of the accelerometer, of 0.02 with 6000 samples to 3 % (three deviations), and the missing ones.
fn level(recording: &Recording) -> (f64, usize) {
    let samples = &recording.signals[0].samples;
    let there: Vec<f64> = samples.iter().copied().filter(|x| !x.is_nan()).collect();
    let square = there.iter().map(|x| x * x).sum::<f64>() / there.len() as f64;
    (square.sqrt(), samples.len() - there.len())
}

#[test]
fn rows_that_are_no_measurements_are_left_out_and_counted() {
    let clean = rows(1, 6000);
    let twice: Vec<[f64; 6]> = clean.iter().flat_map(|row| [*row, *row]).collect();
    let stamps = (0..12_000).map(|k| f64::from(k / 2) / 100.0);
    let (copied, said) = kept(&table(stamps, &twice), None);
    assert_eq!(
        said,
        ["6000 rows left out: copies of the row before, stamp and values"]
    );
    assert_eq!((copied.rate_hz, copied.len()), (100.0, 6000));

    let mut lost = clean.clone();
    (0..6000).step_by(60).for_each(|k| lost[k] = [0.0; 6]);
    let (lost, said) = kept(&written(100.0, &lost), None);
    assert_eq!(
        said,
        ["100 rows (1.7 %) zero in all columns: missing samples"]
    );
    assert_eq!(level(&lost).1, 100);

    let mut frozen = clean.clone();
    frozen[3000..4200].iter_mut().for_each(|row| row[0] = 0.125);
    let (frozen, said) = kept(&written(100.0, &frozen), None);
    assert_eq!(
        said,
        ["accel.x holds 0.125 from 30 s to 42 s: left out as missing"]
    );
    assert_eq!(level(&frozen).1, 1200);

    let (repeated, said) = kept(&written(100.0, &repeated(&clean, 0.05)), None);
    assert!(
        said[0].ends_with("of its rows repeat the row before, taken as missing samples"),
        "{said:?}"
    );
    for recording in [&copied, &lost, &frozen, &repeated] {
        let (sigma, _) = level(recording);
        assert_relative_eq!(sigma, 0.02, max_relative = 0.03);
    }
}

/// 50 of 100 Hz, 80 of 100 Hz, and 62.5 of 200 Hz for one sensor alone; also where half of the neighbours are equal by chance.
#[test]
fn held_sensors_are_taken_at_their_own_rate() {
    let clean = rows(3, 6000);
    let held = |native_hz: f64, rate_hz: f64| -> Vec<[f64; 6]> {
        let rows = (6000.0 * rate_hz / native_hz) as usize;
        (0..rows)
            .map(|k| clean[(k as f64 * native_hz / rate_hz) as usize])
            .collect()
    };
    let coarse = |rows: Vec<[f64; 6]>| -> Vec<[f64; 6]> {
        let round = |k: usize, x: f64| (x / [0.02, 0.002][k / 3]).round() * [0.02, 0.002][k / 3];
        rows.iter()
            .map(|row| std::array::from_fn(|k| round(k, row[k])))
            .collect()
    };
    // rounding to one deviation adds a twelfth of the variance
    for (native_hz, rows, sigma) in [
        (50.0, held(50.0, 100.0), 0.02),
        (80.0, held(80.0, 100.0), 0.02),
        (
            50.0,
            coarse(held(50.0, 100.0)),
            0.02 * (13.0_f64 / 12.0).sqrt(),
        ),
    ] {
        let (recording, said) = kept(&written(100.0, &rows), None);
        let taken = format!("a sensor of {native_hz:.1} Hz written at 100 Hz, taken");
        assert!(said[0].contains(&taken), "{said:?}");
        assert_relative_eq!(recording.rate_hz, native_hz, max_relative = 1e-3);
        assert_relative_eq!(level(&recording).0, sigma, max_relative = 0.03);
    }

    let (slow, fast) = (held(62.5, 200.0), rows(4, 19_200));
    let both: Vec<[f64; 6]> = slow
        .iter()
        .zip(&fast)
        .map(|(a, b)| [a[0], a[1], a[2], b[3], b[4], b[5]])
        .collect();
    let text = written(200.0, &both);
    insta::assert_snapshot!(refusal("a.csv", &text, &ReadOptions::default()));
    let (accel, _) = kept(&text, Some("accel"));
    assert_relative_eq!(accel.rate_hz, 62.5, max_relative = 1e-3);
    assert_relative_eq!(level(&accel).0, 0.02, max_relative = 0.03);
    assert_eq!(kept(&text, Some("gyro")).1, [""; 0]);
}

#[test]
fn what_makes_a_model_worthless_is_refused() {
    let clean = rows(5, 6000);
    let between = |k: usize| -> [f64; 6] {
        let [a, b] = [clean[k / 2], clean[k.div_ceil(2)]];
        std::array::from_fn(|i| 0.5 * (a[i] + b[i]))
    };
    // a hand that never rests
    let mut moving = clean.clone();
    for (k, row) in moving.iter_mut().enumerate() {
        let t_s = k as f64 / 100.0;
        row[0] += 1.2 * (1.9 * t_s).sin() * (1.0 + 0.3 * (0.05 * t_s).sin());
        row[4] += 0.4 * (1.4 * t_s).sin();
    }
    let increments = clean.iter().map(|row| row.map(|x| 0.01 * x)).collect();
    insta::assert_snapshot!(answers(
        [
            ("interpolated", (0..11_998).map(between).collect()),
            ("increments", increments),
            ("repeated", repeated(&clean, 0.3)),
            ("moving", moving),
        ]
        .map(|(name, rows): (_, Vec<_>)| {
            let text = written(100.0, &rows);
            (name, read_one("a.csv", text, &ReadOptions::default()))
        })
    ));
    let files = Files::new();
    let (first, later) = (
        written(100.0, &clean[..4000]),
        written(100.0, &clean[3000..]),
    );
    let paths = [files.add("a.csv", first), files.add("b.csv", later)];
    let message = files.told(&read(&paths, &ReadOptions::default()).unwrap_err());
    assert!(
        message.contains("b.csv shares 32 % of its samples with"),
        "{message}"
    );
}

/// Beyond two standard deviations a gyroscope stays at the end of its range, 2.3 % of its samples at either.
#[test]
fn a_range_that_is_exceeded_is_told() {
    let mut rows = rows(11, 6000);
    let end = |x: f64| x.clamp(0.01 - 0.004, 0.01 + 0.004);
    rows.iter_mut().for_each(|row| row[3] = end(row[3]));
    let (_, warnings) = kept(&written(100.0, &rows), None);
    let [clipped] = &warnings[..] else {
        panic!("{warnings:?}");
    };
    assert!(clipped.starts_with("gyro.x is clipped: 2"), "{clipped}");
}

#[test]
fn a_knock_a_dead_band_and_a_misspelt_column_are_told() {
    let mut knocked = rows(7, 6000);
    knocked[3050..3060].iter_mut().for_each(|row| row[2] += 3.0);
    assert_eq!(
        kept(&written(100.0, &knocked), None).1,
        ["moves in 2 of 60 seconds, or was knocked"]
    );
    let mut dead = rows(8, 6000);
    for x in dead.iter_mut().map(|row| &mut row[5]) {
        *x = if x.abs() < 0.004 { 0.0 } else { *x };
    }
    let said = kept(&written(100.0, &dead), None).1;
    assert!(
        said[0].contains("of gyro.z is exactly 0, more than its step explains"),
        "{said:?}"
    );
    let slip = written(100.0, &rows(9, 600)).replace("gyro_y", "gryo_y");
    assert_eq!(
        kept(&slip, None).1,
        ["column \"gryo_y_rad_s\" is not used: did you mean \"gyro_y_rad_s\"?"]
    );
    assert_eq!(kept(&slip, Some("accel")).1, [""; 0]);
    // a hundredth of the white noise of a ring laser
    let quiet = rows(10, 600).into_iter().enumerate();
    let quiet = quiet.map(|(k, row)| format!("{},{:e}\n", k as f64 / 100.0, 1e-6 * row[3]));
    let text = format!("t_s,gyro_x_rad_s\n{}", quiet.collect::<String>());
    let said = kept(&text, None).1;
    assert!(
        said[0].contains("below a tenth of the quietest units' 0.00100 deg/√h"),
        "{said:?}"
    );
}

/// An axis that was written twice, and sensors under the names of each other: white noises of 1 in 3.4 to 1 in 143 in the
/// catalogue.
#[test]
fn copied_axes_and_exchanged_sensors_are_told() {
    let mut copied = rows(13, 6000);
    copied.iter_mut().for_each(|row| row[4] = row[3]);
    let text = "gyro.y repeats gyro.x: one axis was written twice";
    assert_eq!(kept(&written(100.0, &copied), None).1, [text]);
    let degrees: Vec<[f64; 6]> = rows(14, 6000)
        .iter()
        .map(|row| std::array::from_fn(|k| if k < 3 { row[k] } else { 57.3 * row[k] }))
        .collect();
    let said = kept(&written(100.0, &degrees), None).1;
    let is_told = said
        .iter()
        .any(|text| text.ends_with("sensors exchanged, or deg/s named rad/s?"));
    assert!(is_told, "{said:?}");
}

/// No unit of the catalogue and no shipped model is out of range; mistakes in one are.
#[test]
fn models_of_no_unit_are_told() {
    use crate::io::datasheet::{CATALOGUE, catalogued};
    use crate::io::model_file;
    use crate::io::recordings;
    for (name, _) in CATALOGUE {
        let model = catalogued(name)
            .unwrap()
            .unwrap()
            .model_file(100.0)
            .unwrap()
            .file
            .model;
        assert_eq!(recordings::facts::out_of_range(&model), [""; 0], "{name}");
    }
    let root = std::path::Path::new(env!("CARGO_MANIFEST_DIR"));
    let read = |name: &str| {
        model_file::read(&root.join("calib_data").join(name))
            .unwrap()
            .model
    };
    let scaled = |model: &Model, of: [f64; 2], kind: ProcessKind, power: f64| {
        let mut model = model.clone();
        for (axis, noise) in model.axes.iter_mut().enumerate() {
            for process in noise.processes.iter_mut().filter(|p| p.kind() == kind) {
                let amplitude = of[axis / 3] * process.amplitude().powf(power);
                *process = match kind {
                    ProcessKind::White => Process::white(amplitude).unwrap(),
                    _ => Process::random_walk(amplitude).unwrap(),
                };
            }
        }
        model
    };
    for name in ["consumer_mems.toml", "tactical.toml"] {
        let model = read(name);
        let said = |model: &Model| recordings::facts::out_of_range(model).join("\n");
        assert_eq!(said(&model), "", "{name}");
        let mut exchanged = model.clone();
        exchanged.axes.rotate_left(3);
        assert!(said(&exchanged).contains("sensors exchanged"), "{name}");
        let degrees = scaled(&model, [1.0, 57.3 * 57.3], ProcessKind::White, 1.0);
        assert!(said(&degrees).contains("deg/s named rad/s"), "{name}");
        let root = scaled(&model, [1.0; 2], ProcessKind::RandomWalk, 0.5);
        assert!(!said(&root).is_empty(), "{name}");
        let louder = scaled(&model, [1e3; 2], ProcessKind::White, 1.0);
        assert!(said(&louder).contains("accel N"), "{name}");
    }
    // a floor is noise over 1 s, too
    let floor = |bias: f64| {
        let slow = Process::ar1(0.999, 2e-3 * bias * bias).unwrap();
        let gyro = Composite::new(vec![Process::white(1e-6).unwrap(), slow]);
        recordings::facts::out_of_range(&Model::pooled(100.0, &Composite::default(), &gyro))
    };
    assert_eq!(floor(0.01 * DEG), [""; 0]);
    assert!(
        floor(5.0 * DEG)[0].starts_with("gyro N"),
        "{:?}",
        floor(5.0 * DEG)
    );
}
