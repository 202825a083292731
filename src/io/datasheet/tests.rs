use super::*;
use crate::io::model_file;
use crate::io::tests::{Files, answers, told};
use crate::io::toml_file::TomlSource;
use approx::assert_relative_eq;
use nav_sim_signal::noise::practical::AllanMinimum;
use std::path::Path;

const CLASSES: [&str; 4] = ["consumer", "industrial", "tactical", "navigation"];

fn sheet(entries: &[(Sensor, Figure, &str)]) -> Datasheet {
    let mut sheet = Datasheet::default();
    for (sensor, figure, text) in entries {
        let quantity = StatedQuantity::parse(text, figure.units(*sensor)).unwrap();
        sheet.set(DatasheetEntry {
            sensor: *sensor,
            figure: *figure,
            quantity,
            source: None,
            quote: None,
        });
    }
    sheet
}

/// Allan deviation of averages over 2^(level − 1) samples: twice the Haar wavelet variance is its square.
fn allan_deviation(noise: &Composite, level: u32) -> f64 {
    (2.0 * noise.haar_wv(level)).sqrt()
}

/// At 1 s the Allan deviation of white noise is its density, that of a random walk its density over √3.
#[test]
fn densities_are_where_the_allan_deviation_is_read() {
    let sheet = sheet(&[
        (Sensor::Gyro, Figure::Noise, "0.15 deg/sqrt(h)"),
        (Sensor::Accel, Figure::Walk, "60 ug/sqrt(h)"),
    ]);
    // 128 samples a second: 1 s is 2^7 samples, level 8
    let made = sheet.model_file(128.0).unwrap().file.model;
    let density = 0.15 / 60.0 * std::f64::consts::PI / 180.0;
    assert_relative_eq!(
        allan_deviation(&made.axes[3], 8),
        density,
        max_relative = 1e-12
    );
    // K² τ/3 in continuous time; sampled, a share 1/(2·128²) more
    let walk = 1e-6 * 9.806_65;
    let expected = walk * (1.0_f64 / 3.0).sqrt();
    assert_relative_eq!(
        allan_deviation(&made.axes[0], 8),
        expected,
        max_relative = 1e-4
    );
}

/// The figure is the lowest point of the Allan deviation (IEEE 952), for every entry of the catalogue: over averages of 1 s
/// to 568 s, every 1/16 octave, the model is nowhere below it and at its lowest at most 1.08 times what the closed form says,
/// the root of B² and the white noise's N²/568 s. A sum of processes below 2.2 s is not level: there white noise must hold
/// it, which it does where N²/1 s is above (B/2)².
#[test]
fn no_model_of_a_datasheet_is_below_its_bias_instability() {
    for (name, _) in CATALOGUE {
        let sheet = catalogued(name).unwrap().unwrap();
        let model = sheet.model_file(100.0).unwrap().file.model;
        for sensor in Sensor::ALL {
            let [floor, density] =
                [Figure::Bias, Figure::Noise].map(|figure| sheet.value(sensor, figure));
            let (Some(floor), Some(density)) = (floor, density) else {
                continue;
            };
            let noise = &model.axes[3 * sensor as usize];
            let times = (0..=146).map(|k| 2.0_f64.powf(f64::from(k) / 16.0));
            let deviation =
                |t: f64| noise.allan_variance((100.0 * t).round() as u32).sqrt() / floor;
            let (at_s, lowest) = times
                .map(|t| (t, deviation(t)))
                .min_by(|a, b| a.1.total_cmp(&b.1))
                .unwrap();
            let at_most = 1.08 * (density / floor / 567.8_f64.sqrt()).hypot(1.0);
            assert!(
                (0.999..at_most).contains(&lowest),
                "{name} {sensor:?}: {lowest} at {at_s} s"
            );
        }
    }
}

#[test]
fn what_is_assumed_is_said() {
    let bias = [
        (Sensor::Gyro, Figure::Bias, "10 deg/h"),
        (Sensor::Gyro, Figure::Noise, "0.3 deg/sqrt(h)"),
    ];
    let doubts = |t_corr: Option<&str>| {
        let t_corr = t_corr.map(|text| (Sensor::Gyro, Figure::CorrelationTime, text));
        let sheet = sheet(&bias.into_iter().chain(t_corr).collect::<Vec<_>>());
        sheet.model_file(100.0).unwrap().doubts.join("\n")
    };
    // 0.3 °/√h is above 10 °/h until (0.3·60/10)² = 3.24 s: a floor that ends at 1.89·1 s is below that, and one of 1.71 s =
    // 3.24 s/1.8926 would not be; one that ends at 1.8926·3 s is √(1 + 3.24/5.678) = 1.25 times the figure
    let times = [None, Some("1 s"), Some("0.001 s"), Some("3 s")];
    insta::assert_snapshot!(times.map(doubts).join("\n"));
}

#[test]
fn provenance_holds_every_figure_as_given() {
    let made = sheet(&[
        (Sensor::Gyro, Figure::Noise, "0.3 °/√h"),
        (Sensor::Gyro, Figure::TurnOn, "0.1 deg/s"),
        (Sensor::Gyro, Figure::Scale, "300 ppm"),
    ]);
    let file = made.model_file(100.0).unwrap().file;
    let provenance = file.provenance.as_ref().unwrap();
    let figures = provenance["figures"].as_array().unwrap();
    let given: Vec<&str> = figures
        .iter()
        .map(|f| f["given"].as_str().unwrap())
        .collect();
    assert_eq!(given, ["0.3 °/√h", "0.1 deg/s", "300 ppm"]);
    assert_eq!(provenance["estimator"].as_str(), Some("datasheet"));
    let sigma = 0.1 * std::f64::consts::PI / 180.0;
    assert_relative_eq!(
        file.turn_on.unwrap().gyro_rad_s.unwrap()[2],
        sigma,
        max_relative = 1e-14
    );
    assert_eq!(file.missing.len(), 3);
}

/// Every entry of the catalogue: known by its name, sourced, positive, and a model file that reads back.
#[test]
fn the_catalogue_is_sound() {
    let directory = Path::new(env!("CARGO_MANIFEST_DIR")).join("calib_data/catalogue");
    let files = std::fs::read_dir(&directory)
        .unwrap()
        .map(|f| f.unwrap().path());
    let mut names: Vec<String> = files
        .map(|f| f.file_stem().unwrap().to_str().unwrap().to_owned())
        .collect();
    names.sort();
    assert!(names.len() >= 10, "{}", names.len());
    assert_eq!(
        names,
        CATALOGUE.iter().map(|(name, _)| *name).collect::<Vec<_>>()
    );
    for name in &names {
        let sheet = read(&directory.join(format!("{name}.toml"))).unwrap();
        assert_eq!(catalogued(&name.to_uppercase()).unwrap().unwrap(), sheet);
        assert!(CLASSES.contains(&sheet.class.as_deref().unwrap()), "{name}");
        assert!(!sheet.assumptions.is_empty(), "{name}");
        for entry in sheet.entries.iter().filter(|e| !e.is_of_grade()) {
            let place = format!("{name} {:?}", entry.figure);
            assert!(entry.quantity.value > 0.0, "{place}");
            assert!(
                entry.source.as_ref().is_some_and(|s| s.contains("read ")),
                "{place}: where was it read?"
            );
            // the figure as given stands in the line that was read, whatever the unit's spelling
            let number = entry.quantity.given.split(' ').next().unwrap();
            assert!(
                entry.quote.as_ref().is_some_and(|q| q.contains(number)),
                "{place}: {number}"
            );
        }
        for sensor in Sensor::ALL {
            assert!(sheet.value(sensor, Figure::Noise).is_some(), "{name}");
            // one rule for all: what is removed before use is no turn-on bias, and the entry says so
            if sheet.value(sensor, Figure::Offset).is_some() {
                let mut turn_on = sheet.entries.iter().filter(|e| e.figure == Figure::TurnOn);
                assert!(turn_on.all(DatasheetEntry::is_of_grade), "{name}");
                assert!(
                    sheet
                        .assumptions
                        .iter()
                        .any(|text| text.contains("removed before use")),
                    "{name}"
                );
            }
        }
        let file = sheet.model_file(100.0).unwrap().file;
        assert!(file.missing.is_empty());
        let text = model_file::to_toml(&file);
        let place = tempfile::tempdir().unwrap();
        let path = place.path().join("model.toml");
        model_file::write(&path, &file).unwrap();
        assert_eq!(model_file::read(&path).unwrap(), file, "{text}");
    }
}

#[test]
fn entries_are_refused_with_line_key_and_value() {
    let head = "[unit]\nmanufacturer = \"A\"\nname = \"B\"\nclass = \"consumer\"\n";
    insta::assert_snapshot!(answers(
        [
            "[gyro]\nbias = { value = \"10\", source = \"s\" }\n",
            "[accel]\nnoise = { value = \"1 deg/h\", source = \"s\" }\n",
            "[gyro]\nnoises = { value = \"1 deg/sqrt(h)\", source = \"s\" }\n",
            "[gyro]\nnoise = { value = \"1 deg/sqrt(h)\" }\n",
        ]
        .map(|text| {
            let source = TomlSource::new("u.toml", &format!("{head}{text}"));
            (text, parse(&source).map_err(|e| told(&e)))
        })
    ));
}

/// The figures and the rate of a file of another program.
fn read_measured(text: &str, rate_hz: Option<f64>) -> (Datasheet, Option<f64>) {
    let (_files, path) = Files::with("imu.yaml", text);
    measured(&path, rate_hz).unwrap()
}

const KALIBR: &str = "%YAML:1.0 # of a chain\nimu0:\n  T_i_b:\n    - [1.0, 0.0, 0.0, 0.0]\n  accelerometer_noise_density: 0.0025 # m/s^2/sqrt(Hz)\n  \
     accelerometer_random_walk: 7e-05\n  gyroscope_noise_density: np.float64(0.00019)\n  gyroscope_random_walk: 0.0\n  \
     rostopic: \"/imu: raw\"\n  update_rate: 256.0\n";
const IMU_UTILS: &str = "%YAML:1.0\n---\ntype: IMU\nname: A3\nGyr:\n   unit: \" rad/s\"\n   avg-axis:\n      gyr_n: 2e-3\n      gyr_w: 3e-5\n   x-axis:\n      \
     gyr_n: 9e-3\n      gyr_w: 9e-5\nAcc:\n   unit: \" m/s^2\"\n   avg-axis:\n      acc_n: 2e-2\n      acc_w: 4e-4\n";

/// Kalibr reads N off the Allan deviation at 1 s and K at 3 s (of K²τ/3); both are there again, N exactly.
#[test]
fn figures_of_kalibr_are_where_it_reads_them() {
    let (sheet, rate_hz) = read_measured(KALIBR, None);
    assert_eq!(rate_hz, Some(256.0));
    assert_eq!(sheet.value(Sensor::Gyro, Figure::Walk), None);
    assert_eq!(sheet.value(Sensor::Gyro, Figure::Noise), Some(0.00019));
    assert_eq!(
        sheet.not_stated(),
        ["gyro bias", "accel turn_on", "gyro turn_on"]
    );
    let model = sheet.model_file(256.0).unwrap().file.model;
    let of =
        |axis: usize, process: usize| Composite::new(vec![model.axes[axis].processes[process]]);
    let near = |value: f64, expected: f64, error: f64| {
        assert_relative_eq!(value, expected, max_relative = error);
    };
    near(of(0, 0).allan_variance(256).sqrt(), 0.0025, 1e-12);
    near(of(3, 0).allan_variance(256).sqrt(), 0.00019, 1e-12);
    // sampled, a share 1/(2·768²) more than K²τ/3
    near(of(0, 1).allan_variance(768).sqrt(), 7e-5, 1e-6);
}

/// imu_utils states the Allan deviation at 1 s times √rate, and the lowest: the model's at 1 s is N or more by its bias, and
/// its lowest is between the floor and what [`no_model_of_a_datasheet_is_below_its_bias_instability`] derives.
#[test]
fn figures_of_imu_utils_are_those_of_a_sample_and_the_lowest() {
    let (sheet, rate_hz) = read_measured(IMU_UTILS, Some(400.0));
    assert_eq!(rate_hz, Some(400.0));
    assert_eq!(sheet.value(Sensor::Accel, Figure::Noise), Some(2e-2 / 20.0));
    assert_eq!(sheet.value(Sensor::Gyro, Figure::Noise), Some(2e-3 / 20.0));
    let model = sheet.model_file(400.0).unwrap().file.model;
    assert_eq!(
        model.axes[3].amplitude_of(nav_sim_signal::noise::ProcessKind::White),
        2e-3 * 2e-3
    );
    for (axis, floor, density) in [(0, 4e-4, 1e-3), (3, 3e-5, 1e-4)] {
        let minimum = AllanMinimum::of(&[&model.axes[axis]], 400.0, 1e4).unwrap();
        let most = 1.08 * (density / floor / 567.8_f64.sqrt()).hypot(1.0);
        let lowest = minimum.deviation / floor;
        assert!((0.999..most).contains(&lowest), "{lowest}");
    }
    let said = sheet.assumptions.join(" ");
    assert!(said.contains("_w the lowest Allan deviation"), "{said}");
}

#[test]
fn figures_of_others_are_refused_with_line_key_and_value() {
    let cases = [
        ("no rate", IMU_UTILS.to_owned(), None),
        ("other unit", IMU_UTILS.replace(" m/s^2", "g"), Some(1.0)),
        (
            "twice",
            format!("{KALIBR}imu1:\n  gyroscope_noise_density: 1e-3\n"),
            None,
        ),
        ("negative", KALIBR.replace("7e-05", "-1"), None),
        ("absurd", KALIBR.replace("7e-05", "1e30"), None),
        ("bad rate", KALIBR.replace("256.0", "fast"), None),
        (
            "of VINS",
            "gyr_n: 0.01\nacc_n: 0.1\n".to_owned(),
            Some(200.0),
        ),
    ];
    insta::assert_snapshot!(answers(cases.map(|(name, text, rate_hz)| {
        let (files, path) = Files::with("imu.yaml", text);
        (name, measured(&path, rate_hz).map_err(|e| files.told(&e)))
    })));
}

/// A turn-on bias that no document states is that of the grade, and said to be; a grade that nobody knows has none.
#[test]
fn a_turn_on_bias_is_by_grade_where_a_sheet_has_none() {
    let sheet_of = |class: &str, more: &str| {
        let text =
            format!("[unit]\nmanufacturer = \"A\"\nname = \"B\"\nclass = \"{class}\"\n{more}");
        parse(&TomlSource::new("u.toml", &text)).unwrap()
    };
    let stated = "[accel]\nturn_on = { value = \"2 mg\", source = \"s\" }\n";
    let sheet = sheet_of("tactical", stated);
    assert_eq!(
        sheet.value(Sensor::Accel, Figure::TurnOn),
        Some(2e-3 * 9.806_65)
    );
    let gyro = sheet.value(Sensor::Gyro, Figure::TurnOn).unwrap();
    assert_relative_eq!(gyro, 10.0_f64.to_radians() / 3600.0, max_relative = 1e-12);
    let lacking = [
        "accel noise",
        "gyro noise",
        "accel bias",
        "gyro bias",
        "gyro turn_on by grade",
    ];
    assert_eq!(sheet.not_stated(), lacking);
    assert_eq!(
        sheet_of("toy", "").value(Sensor::Gyro, Figure::TurnOn),
        None
    );
}
