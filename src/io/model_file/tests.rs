use super::*;
use crate::io::Failure;
use crate::io::toml_file::TomlSource;
use nav_sim_signal::imu::{Axis, Sensor};
use nav_sim_signal::noise::{Composite, Law, Process, Variation};

const ACCEL_X: Channel = Channel {
    sensor: Sensor::Accel,
    axis: Axis::X,
};

fn read_text(text: &str) -> Result<ModelFile, Failure> {
    parse(&TomlSource::new("m.toml", text))
}

/// One process of a file otherwise sound, on line 4.
fn with_process(process: &str) -> Result<ModelFile, Failure> {
    read_text(&format!(
        "schema = 1\nrate_hz = 100.0\n[accel]\nprocesses = [{{ {process} }}]\n"
    ))
}

fn refusal(text: &str) -> String {
    let e = read_text(text).unwrap_err();
    format!("{e} | {}", e.advice().unwrap_or_default())
}

fn process_refusal(process: &str) -> String {
    let e = with_process(process).unwrap_err();
    format!("{e} | {}", e.advice().unwrap_or_default())
}

fn process(code: &str, values: &[f64]) -> Process {
    Process::of_values(Kind::named(code).unwrap(), values, 100.0).unwrap()
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
    let beta = Law::Beta {
        a: 6.0,
        b: 2.0,
        low: 0.98,
        width: 1e-3,
    };
    let pooled = Variation::new(&n2(), "AR1_1", "phi", beta).unwrap();
    let normal = Variation::new(&n2(), "WN", "sigma2", Law::Normal { sd: 1e-7 }).unwrap();
    let mut spread = Spread::default();
    let lognormal = Law::Lognormal {
        median: 0.9999,
        sd: 0.45,
        median_ci95: Some([0.9998, 0.99995]),
        sd_ci95: Some([0.1 + 0.2, 0.7]),
    };
    let lognormal = Variation::new(&n2(), "AR1_2", "phi", lognormal).unwrap();
    let plain = Law::Lognormal {
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
    let text = to_toml(&ModelFile::new(Model::pooled(
        100.0,
        &n2(),
        &Composite::default(),
    )));
    let expected = "#:schema schemas/model.schema.json
schema = 1
rate_hz = 100.0

[accel]
processes = [
  { type = \"WN\", sigma2 = 5.195192e-5 }, # (m/s²)², per sample
  { type = \"QN\", q2 = 1e-7 }, # (m/s²)²
  { type = \"AR1\", phi = 0.9835489, sigma2 = 1.286053e-8 }, # (m/s²)², innovation variance per sample
  { type = \"AR1\", phi = 0.9999, sigma2 = 1e-11 }, # (m/s²)², innovation variance per sample
  { type = \"RW\", gamma2 = 2.904098e-11 }, # (m/s²)², increment variance per sample
]

[gyro]
processes = [
]
";
    assert_eq!(text, expected);
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
    let file =
        with_process("type = \"AR1\", phi = 0.9, sigma2 = 1, phi_ci95 = [0.8, 0.95]").unwrap();
    let of_x: Vec<_> = file
        .intervals
        .iter()
        .filter(|i| i.channel == ACCEL_X)
        .collect();
    assert_eq!(of_x.len(), 1);
    assert_eq!(
        (of_x[0].process.as_str(), of_x[0].parameter.as_str()),
        ("AR1", "phi")
    );
    assert_eq!((of_x[0].low, of_x[0].high), (0.8, 0.95));
}

#[test]
fn wrong_values_are_refused_with_line_key_and_value() {
    assert_eq!(
        process_refusal("type = \"AR1\", phi = 1.0, sigma2 = 1"),
        "m.toml, line 4: \"accel.processes[1].phi\" = 1.0 is refused: it must be a finite number > -1 and < 1 | phi = exp(−1/(T·rate_hz)) for a correlation time of T seconds; for phi = 1 use RW"
    );
    assert_eq!(
        process_refusal("type = \"WN\", sigma2 = -5e-5"),
        "m.toml, line 4: \"accel.processes[1].sigma2\" = -5e-5 is refused: it must be a finite number ≥ 0 | a variance is ≥ 0; 0 switches the process off"
    );
    assert_eq!(
        process_refusal("type = \"RW\", gamma2 = 1e150"),
        "m.toml, line 4: \"accel.processes[1].gamma2\" = 1e150 is more than 1e30 | "
    );
    assert_eq!(
        process_refusal("type = \"QN\", q2 = nan"),
        "m.toml, line 4: \"accel.processes[1].q2\" = nan is refused: it must be a finite number ≥ 0 | a variance is ≥ 0; 0 switches the process off"
    );
    assert_eq!(
        process_refusal("type = \"WN\", sigma2 = \"1\""),
        "m.toml, line 4: \"accel.processes[1].sigma2\" = \"1\" is not a number | "
    );
    for ends in ["[-1, 2]", "[0.5, inf]"] {
        let refusal = process_refusal(&format!("type = \"WN\", sigma2 = 1, sigma2_ci95 = {ends}"));
        assert!(refusal.contains("sigma2_ci95\" = "), "{refusal}");
        assert!(
            refusal.contains("is refused: it must be a finite number ≥ 0"),
            "{refusal}"
        );
    }
    assert_eq!(
        process_refusal("type = \"WN\", sigma2 = 1, sigma2_ci95 = [1]"),
        "m.toml, line 4: \"accel.processes[1].sigma2_ci95\" = [1] is not a list of 2 | "
    );
    assert_eq!(
        refusal("rate_hz = 0\n"),
        "m.toml, line 1: \"rate_hz\" = 0 is refused: it must be a finite number > 0 and ≤ 100000 | "
    );
    let in_one_bracket = refusal("rate_hz = 100.0\n[gyro.z.processes]\ntype = \"WN\"\n");
    let hint = "write [[gyro.z.processes]], in double brackets";
    assert!(in_one_bracket.ends_with(hint), "{in_one_bracket}");
    assert!(
        refusal("rate_hz = 1e300\n")
            .contains("\"rate_hz\" = 1e300 is refused: it must be a finite number > 0")
    );
    let twice = refusal("rate_hz = 1\nrate_hz = 2\n");
    assert_eq!(twice, "m.toml, line 2: duplicate key: \"rate_hz\" | ");
    assert_eq!(
        refusal("schema = 2\n"),
        "m.toml, line 1: \"schema\" = 2 is refused: it must be 1 | "
    );
}

#[test]
fn wrong_keys_are_refused_with_what_was_meant() {
    assert_eq!(
        process_refusal("type = \"WN\", sigma = 1"),
        "m.toml, line 4: unknown key \"accel.processes[1].sigma\" | did you mean \"sigma2\"?"
    );
    assert_eq!(
        process_refusal("type = \"ARI\", phi = 0.5, sigma2 = 1"),
        "m.toml, line 4: \"accel.processes[1].type\" = \"ARI\" is not one of \"WN\", \"QN\", \"AR1\", \"GM\", \"MA1\", \"FN\", \"RW\", \"DR\" | did you mean \"AR1\"?"
    );
    assert_eq!(
        process_refusal("type = \"flicker\""),
        "m.toml, line 4: \"accel.processes[1].type\" = \"flicker\" is not one of \"WN\", \"QN\", \"AR1\", \"GM\", \"MA1\", \"FN\", \"RW\", \"DR\" | "
    );
    assert_eq!(
        process_refusal("sigma2 = 1"),
        "m.toml, line 4: \"accel.processes[1].type\" is missing | add type to accel.processes[1]"
    );
    assert_eq!(
        process_refusal("type = \"AR1\", phi = 0.5"),
        "m.toml, line 4: \"accel.processes[1].sigma2\" is missing | add sigma2 to accel.processes[1]"
    );
    assert_eq!(
        refusal("rate = 100\n"),
        "m.toml, line 1: unknown key \"rate\" | did you mean \"rate_hz\"?"
    );
    assert_eq!(
        refusal("[accel]\nprocesses = []\n"),
        "m.toml, line 1: \"rate_hz\" is missing | add rate_hz = 100.0, the sample rate (Hz)"
    );
    assert_eq!(
        refusal("rate_hz = 1\n"),
        "m.toml, line 1: \"accel\" or \"gyro\" is missing | add accel or gyro"
    );
    assert_eq!(
        refusal("rate_hz = 1\n[accel]\n"),
        "m.toml, line 2: \"accel.processes\" is missing | add processes to accel"
    );
    assert_eq!(
        refusal("rate_hz = 1\n[accel]\nprocesses = []\n[accel.x]\nprocesses = []\n"),
        "m.toml, line 4: \"accel.x\" = [accel.x] is given for all axes and for this one | write either [accel] or one table per axis"
    );
}

#[test]
fn laws_of_spread_are_checked_against_the_model() {
    let spread = |law: &str| {
        refusal(&format!(
            "rate_hz = 100\n[accel]\nprocesses = [{{ type = \"AR1\", phi = 0.9, sigma2 = 1 }}]\n[[spread.accel]]\n{law}"
        ))
    };
    assert_eq!(
        spread("process = \"AR1_1\"\nparameter = \"phi\"\ndistribution = \"normal\"\nsd = 0.1\n"),
        "m.toml, line 5: \"spread.accel[1].process\" = \"AR1_1\" is refused: the model has no process \"AR1_1\" there, only AR1 | "
    );
    assert_eq!(
        spread("process = \"AR1\"\nparameter = \"phi\"\ndistribution = \"normal\"\nsd = -0.1\n"),
        "m.toml, line 8: \"spread.accel[1].sd\" = -0.1 is refused: sd = -0.1 is not between 0 and 1 | "
    );
    assert_eq!(
        spread("process = \"AR1\"\nparameter = \"phi\"\ndistribution = \"gamma\"\n"),
        "m.toml, line 7: \"spread.accel[1].distribution\" = \"gamma\" is not one of \"beta\", \"normal\", \"lognormal\" | "
    );
    assert_eq!(
        spread(
            "process = \"AR1\"\nparameter = \"phi\"\ndistribution = \"beta\"\na = 1\nb = 1\nlow = 0.9\nwidth = 0.2\n"
        ),
        "m.toml, line 7: \"spread.accel[1].distribution\" = \"beta\" is refused: the distribution reaches refused values: AR1: phi = 1.1 is not between −1 and 1 (exclusive) | "
    );
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
    let with = |turn_on: &str| {
        read_text(&format!(
            "rate_hz = 100\n[turn_on]\n{turn_on}\n[gyro]\nprocesses = []\n"
        ))
    };
    let turn_on = with("gyro_rad_s = [3e-3, 0, 4e-3]")
        .unwrap()
        .turn_on
        .unwrap();
    assert_eq!(
        (turn_on.sigma(Sensor::Accel), turn_on.axes(Sensor::Accel)),
        (None, None)
    );
    // the variances 9, 0 and 16 (1e-6) have the mean 25/3
    assert!((turn_on.sigma(Sensor::Gyro).unwrap().powi(2) / 25e-6 - 1.0 / 3.0).abs() < 1e-15);
    assert_eq!(
        with("accel_m_s2 = 0.1")
            .unwrap()
            .turn_on
            .unwrap()
            .accel_m_s2,
        Some([0.1; 3])
    );
    for (text, reason) in [
        (
            "accel_m_s2 = -1",
            "\"turn_on.accel_m_s2\" = -1 is refused: it must be a finite number ≥ 0 and ≤ 10 (mg or g named m/s²?)",
        ),
        (
            "gyro_rad_s = 2",
            "\"turn_on.gyro_rad_s\" = 2 is refused: it must be a finite number ≥ 0 and ≤ 1 (degrees named radians?)",
        ),
        (
            "gyro_rad_s = [1.0, 2.0, 3.0, 4.0]",
            "\"turn_on.gyro_rad_s\" = [1.0, 2.0, 3.0, 4.0] is not a list of 3",
        ),
        (
            "gyro_rad_s = [1e-3, 2e-3]",
            "\"turn_on.gyro_rad_s\" = [1e-3, 2e-3] is not a list of 3",
        ),
        ("gyro_deg_h = 1", "unknown key \"turn_on.gyro_deg_h\""),
    ] {
        let message = with(text).unwrap_err().to_string();
        assert!(message.ends_with(reason), "{message}");
    }
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
    let alone = refusal("rate_hz = 100.0\n[accel]\nreading = [{ type = \"WN\", sigma2 = 1.0 }]\n");
    assert!(alone.contains("processes"), "{alone}");
}
