use super::*;
use crate::io::Failure;
use crate::io::tests::{answers, told};
use crate::io::toml_file::TomlSource;
use approx::assert_abs_diff_eq;
use nav_sim_signal::imu::{Axis, Sensor};
use nav_sim_signal::noise::{Composite, ParameterDistribution, Process, Variation};

const ACCEL_X: Channel = Channel {
    sensor: Sensor::Accel,
    axis: Axis::X,
};

fn read_text(text: &str) -> Result<ModelFile, Failure> {
    parse(&TomlSource::new("m.toml", text))
}

/// One process of a file otherwise sound, on line 4.
fn process_text(process: &str) -> String {
    format!("schema = 1\nrate_hz = 100.0\n[accel]\nprocesses = [{{ {process} }}]\n")
}

fn turn_on_text(turn_on: &str) -> String {
    format!("rate_hz = 100\n[turn_on]\n{turn_on}\n[gyro]\nprocesses = []\n")
}

fn process(code: &str, values: &[f64]) -> Process {
    Process::of_values(ProcessKind::named(code).unwrap(), values, 100.0).unwrap()
}

fn n2() -> Composite {
    Composite::new(vec![
        process("WN", &[5.195_192e-5]),
        process("QN", &[1e-7]),
        process("AR1", &[0.983_548_9, 1.286_053e-8]),
        process("AR1", &[0.999_9, 1.0e-11]),
        process("RW", &[2.904_098e-11]),
    ])
}

#[test]
fn what_is_written_reads_back_to_the_same_bits() {
    let mut gyro = n2();
    gyro.processes.extend([
        process("DR", &[-1e-300]),
        process("GM", &[1.0 / 3.0, 0.1 + 0.2]),
    ]);
    gyro.processes.push(process("MA1", &[-0.5, 2e22]));
    let mut file = ModelFile::new(Model::pooled(100.0 / 3.0, &n2(), &gyro));
    // A GM belongs to its rate.
    let gm = Process::gauss_markov(1.0 / 3.0, 0.1 + 0.2, 100.0 / 3.0).unwrap();
    for axis in &mut file.model.axes[3..] {
        axis.processes[6] = gm;
    }
    file.model.axes[4].processes[0] = process("WN", &[7e-7]);
    file.intervals.push(Interval {
        channel: ACCEL_X,
        process: "AR1_2".into(),
        parameter: "phi".into(),
        low: 0.999,
        high: 1.0,
    });
    let beta = ParameterDistribution::Beta {
        a: 6.0,
        b: 2.0,
        low: 0.98,
        width: 1e-3,
    };
    let pooled = Variation::new(&n2(), "AR1_1", "phi", beta).unwrap();
    let normal = Variation::new(
        &n2(),
        "WN",
        "sigma2",
        ParameterDistribution::Normal { sd: 1e-7 },
    )
    .unwrap();
    let mut spread = Spread::default();
    let lognormal = ParameterDistribution::Lognormal {
        median: 0.9999,
        sd: 0.45,
        median_ci95: Some([0.9998, 0.99995]),
        sd_ci95: Some([0.1 + 0.2, 0.7]),
    };
    let lognormal = Variation::new(&n2(), "AR1_2", "phi", lognormal).unwrap();
    let plain = ParameterDistribution::Lognormal {
        median: 2e-11,
        sd: 0.0,
        median_ci95: None,
        sd_ci95: None,
    };
    let plain = Variation::new(&n2(), "RW", "gamma2", plain).unwrap();
    spread.axes[..3].fill(vec![pooled, normal.clone(), lognormal, plain]);
    spread.axes[5].push(normal);
    file.spread = Some(spread);
    file.turn_on = Some(TurnOn {
        accel_m_s2: Some([0.02; 3]),
        gyro_rad_s: Some([1e-3, 0.1 + 0.2, 0.0]),
    });
    file.provenance = Some(
        toml::from_str("estimator = \"dr-awv\"\nobjective = 1.5e-9\n[inputs]\na = 1").unwrap(),
    );
    let text = to_toml(&file);
    assert_eq!(read_text(&text).unwrap(), file, "{text}");
    assert_eq!(to_toml(&read_text(&text).unwrap()), text);
}

#[test]
fn the_layout_is_the_published_one() {
    let model = Model::pooled(100.0, &n2(), &Composite::default());
    insta::assert_snapshot!(to_toml(&ModelFile::new(model)));
}

#[test]
fn axes_may_differ_or_be_absent() {
    let text = "rate_hz = 200\n[gyro.x]\nprocesses = [{ type = \"WN\", sigma2 = 1 }]\n[gyro.z]\nprocesses = []\n";
    let file = read_text(text).unwrap();
    let missing: Vec<String> = file.missing.iter().map(Channel::to_string).collect();
    assert_eq!(missing, ["accel.x", "accel.y", "accel.z", "gyro.y"]);
    assert_eq!(file.model.axes[3].processes, [process("WN", &[1.0])]);
    assert!(file.model.axes[5].processes.is_empty());
    assert_eq!(read_text(&to_toml(&file)).unwrap(), file);
}

#[test]
fn intervals_stand_beside_their_parameters() {
    let text = process_text("type = \"AR1\", phi = 0.9, sigma2 = 1, phi_ci95 = [0.8, 0.95]");
    let intervals = read_text(&text).unwrap().intervals;
    let expected = Interval {
        channel: ACCEL_X,
        process: "AR1".into(),
        parameter: "phi".into(),
        low: 0.8,
        high: 0.95,
    };
    assert!(
        intervals
            .iter()
            .filter(|i| i.channel == ACCEL_X)
            .eq([&expected])
    );
}

#[test]
fn mistakes_are_refused_with_line_key_value_and_hint() {
    let processes = [
        "type = \"AR1\", phi = 1.0, sigma2 = 1",
        "type = \"WN\", sigma2 = -5e-5",
        "type = \"RW\", gamma2 = 1e150",
        "type = \"QN\", q2 = nan",
        "type = \"WN\", sigma2 = \"1\"",
        "type = \"WN\", sigma2 = 1, sigma2_ci95 = [-1, 2]",
        "type = \"WN\", sigma2 = 1, sigma2_ci95 = [0.5, inf]",
        "type = \"WN\", sigma2 = 1, sigma2_ci95 = [1]",
        "type = \"WN\", sigma = 1",
        "type = \"ARI\", phi = 0.5, sigma2 = 1",
        "type = \"flicker\"",
        "sigma2 = 1",
        "type = \"AR1\", phi = 0.5",
    ]
    .map(process_text);
    let laws = [
        "process = \"AR1_1\"\nparameter = \"phi\"\ndistribution = \"normal\"\nsd = 0.1",
        "process = \"AR1\"\nparameter = \"phi\"\ndistribution = \"normal\"\nsd = -0.1",
        "process = \"AR1\"\nparameter = \"phi\"\ndistribution = \"gamma\"",
        "process = \"AR1\"\nparameter = \"phi\"\ndistribution = \"beta\"\na = 1\nb = 1\nlow = 0.9\nwidth = 0.2",
    ]
    .map(|law| {
        let model = process_text("type = \"AR1\", phi = 0.9, sigma2 = 1");
        format!("{model}[[spread.accel]]\n{law}")
    });
    let turn_on = [
        "accel_m_s2 = -1",
        "gyro_rad_s = 2",
        "gyro_rad_s = [1.0, 2.0, 3.0, 4.0]",
        "gyro_rad_s = [1e-3, 2e-3]",
        "gyro_deg_h = 1",
    ]
    .map(turn_on_text);
    let others = [
        "rate_hz = 0",
        "rate_hz = 1e300",
        "rate_hz = 1\nrate_hz = 2",
        "schema = 2",
        "rate = 100",
        "rate_hz = 1",
        "rate_hz = 100.0\n[gyro.z.processes]\ntype = \"WN\"",
        "[accel]\nprocesses = []",
        "rate_hz = 1\n[accel]",
        "rate_hz = 1\n[accel]\nprocesses = []\n[accel.x]\nprocesses = []",
        "rate_hz = 1\n[accel]\nreading = [{ type = \"WN\", sigma2 = 1 }]",
    ]
    .map(str::to_owned);
    let all = [&processes[..], &laws, &turn_on, &others].concat();
    insta::assert_snapshot!(answers(
        all.iter()
            .map(|text| (text, read_text(text).map_err(|e| told(&e))))
    ));
}

mod garbage {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        /// No text makes the reader panic; sound files survive a change of any one byte.
        #[test]
        fn never_panics(at in 0usize..2000, byte in any::<char>(), cut in 0usize..2000) {
            let file = ModelFile::new(Model::pooled(100.0, &n2(), &n2()));
            let mut text: Vec<char> = to_toml(&file).chars().collect();
            let n = text.len();
            text[at % n] = byte;
            let text: String = text.into_iter().skip(cut % 50).collect();
            let _ = read_text(&text);
        }

        #[test]
        fn never_panics_on_noise(text in ".{0,200}") {
            let _ = read_text(&text);
        }
    }
}

#[test]
fn turn_on_biases_are_one_or_three_standard_deviations() {
    let read = |text: &str| read_text(&turn_on_text(text)).unwrap().turn_on.unwrap();
    let turn_on = read("gyro_rad_s = [3e-3, 0, 4e-3]");
    let of_accel = (turn_on.sigma(Sensor::Accel), turn_on.axes(Sensor::Accel));
    assert_eq!(of_accel, (None, None));
    // the variances 9, 0 and 16 (1e-6) have the mean 25/3
    assert_abs_diff_eq!(
        turn_on.sigma(Sensor::Gyro).unwrap().powi(2) / 25e-6,
        1.0 / 3.0,
        epsilon = 1e-15
    );
    assert_eq!(read("accel_m_s2 = 0.1").accel_m_s2, Some([0.1; 3]));
}

/// A reading of one axis is written beside its processes, reads back to the same bits, and stands for this axis alone.
#[test]
fn a_reading_stands_for_its_axis_in_navigation() {
    let mut file = ModelFile::new(Model::pooled(100.0, &n2(), &n2()));
    let mut reading = ModelFile::empty(100.0);
    let read = Composite::new(vec![process("WN", &[4e-5]), process("RW", &[3e-11])]);
    reading.model.axes[ACCEL_X.index()] = read.clone();
    reading.missing.retain(|channel| *channel != ACCEL_X);
    file.reading = Some(Box::new(reading));
    let text = to_toml(&file);
    assert_eq!(read_text(&text).unwrap(), file);
    let navigated = file.for_navigation();
    let of = |channel: Channel| navigated.model.axis(channel).clone();
    let expected = |channel| {
        if channel == ACCEL_X {
            read.clone()
        } else {
            n2()
        }
    };
    assert!(Channel::ALL.iter().all(|c| of(*c) == expected(*c)));
}
