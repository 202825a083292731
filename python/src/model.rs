//! Noise models: what their files hold, recordings of them, the figures that other programs ask for.

use crate::error;
use crate::work::work;
use nav_sim::app::Reporter;
use nav_sim::io::contamination_file;
use nav_sim::io::model_file::{self, ModelFile};
use nav_sim::prelude::{AxisParameters, Channel, Composite, Horizon, Policy, Sensor};
use nav_sim::signal::noise::{ReplicateError, VirtualImu};
use numpy::PyArray1;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use serde_json::{Map, Value, json};
use std::path::Path;

/// Name of the file that a model is in, where it is in none.
const IN_MEMORY: &str = "model";

fn read(py: Python<'_>, text: &str, path: Option<&str>) -> PyResult<ModelFile> {
    let path = Path::new(path.unwrap_or(IN_MEMORY));
    model_file::from_text(path, text).map_err(|e| error::of_failure(py, &e, ""))
}

/// Contents of a model file in JSON: `rate_hz`, and for each channel the list of its processes.
#[pyfunction]
#[pyo3(signature = (text, path))]
pub(crate) fn model_contents(py: Python<'_>, text: &str, path: Option<&str>) -> PyResult<String> {
    let file = read(py, text, path)?;
    let mut channels = Map::new();
    for channel in file.present() {
        let processes = json!(file.model.axis(channel).processes);
        channels.insert(channel.to_string(), processes);
    }
    Ok(json!({ "rate_hz": file.model.rate_hz, "channels": channels }).to_string())
}

/// One recording of a model, counted from 1: a column a channel.
#[pyfunction]
#[pyo3(signature = (text, samples, replicate, seed, spread, contaminate))]
pub(crate) fn model_recording<'py>(
    py: Python<'py>,
    text: &str,
    samples: usize,
    replicate: u64,
    seed: u64,
    spread: bool,
    contaminate: Option<&str>,
) -> PyResult<Bound<'py, PyDict>> {
    let file = read(py, text, None)?;
    let found = contaminate
        .map(|name| contamination_file::find(name, file.model.rate_hz))
        .transpose();
    let contamination = found.map_err(|e| error::of_failure(py, &e, ""))?;
    let made = work(py, None, None, move |meter| {
        let spread = file.spread.as_ref().filter(|_| spread);
        let imu = VirtualImu {
            model: &file.model,
            spread,
            contamination: contamination.as_ref(),
            seed,
        };
        let model = imu.model_of(replicate)?;
        let signal = |channel| {
            meter.advance(1);
            Ok((channel, imu.signal(&model, replicate, channel, samples)?))
        };
        let signals = file.present().map(signal);
        signals.collect::<Result<Vec<_>, ReplicateError>>()
    })?;
    let made = made.map_err(|e| error::refused(py, &e.to_string()))?;
    let columns = PyDict::new(py);
    for (channel, samples) in made {
        let Channel { sensor, axis } = channel;
        let name = format!("{sensor}_{axis}_{}", units(sensor)[0]);
        columns.set_item(name, PyArray1::from_vec(py, samples))?;
    }
    Ok(columns)
}

/// Allan variance that each channel of the model implies for averages over these numbers of samples (units²).
#[pyfunction]
#[pyo3(signature = (text, samples))]
pub(crate) fn model_allan<'py>(
    py: Python<'py>,
    text: &str,
    samples: Vec<u32>,
) -> PyResult<Bound<'py, PyDict>> {
    let file = read(py, text, None)?;
    let columns = PyDict::new(py);
    for channel in file.present() {
        let noise = file.model.axis(channel);
        let variances = samples.iter().map(|m| noise.allan_variance(*m)).collect();
        columns.set_item(channel.to_string(), PyArray1::from_vec(py, variances))?;
    }
    Ok(columns)
}

/// The pairs that stand for the sensors of a model over averages from `from_s` to `to_s`, as JSON, SI units in the names.
#[pyfunction]
#[pyo3(signature = (text, policy, from_s, to_s))]
pub(crate) fn model_practical(
    py: Python<'_>,
    text: &str,
    policy: &str,
    from_s: f64,
    to_s: f64,
) -> PyResult<String> {
    let file = read(py, text, None)?;
    let policy: Result<Policy, _> = policy.parse();
    let policy = policy.map_err(|e| error::refused(py, &format!("policy: {e}")))?;
    let mut sensors = Map::new();
    for sensor in Sensor::ALL {
        let present = file.present().filter(|c| c.sensor == sensor);
        let axes: Vec<&Composite> = present.map(|channel| file.model.axis(channel)).collect();
        if axes.is_empty() {
            continue;
        }
        let horizon = Horizon { from_s, to_s };
        let found = AxisParameters::of(
            &axes,
            file.model.rate_hz,
            horizon,
            policy,
            LONGEST_S.max(to_s),
        );
        let found = found.map_err(|e| error::refused(py, &format!("{sensor}: {e}")))?;
        sensors.insert(sensor.name().to_owned(), figures(sensor, &found));
    }
    Ok(Value::Object(sensors).to_string())
}

/// Longest averaging time at which a minimum of the Allan deviation is trusted (s).
const LONGEST_S: f64 = 10_000.0;

/// Units of a sensor and of its rate, as columns have them.
const fn units(sensor: Sensor) -> [&'static str; 2] {
    match sensor {
        Sensor::Accel => ["m_s2", "m_s3"],
        Sensor::Gyro => ["rad_s", "rad_s2"],
    }
}

fn figures(sensor: Sensor, found: &AxisParameters) -> Value {
    let [unit, rate] = units(sensor);
    let (pair, markov) = (found.walk, found.markov.markov);
    json!({
        format!("density_{unit}_per_sqrt_hz"): pair.density,
        format!("walk_{rate}_per_sqrt_hz"): pair.walk,
        format!("bias_sigma_{unit}"): markov.map(|m| m.sigma),
        "bias_correlation_time_s": markov.map(|m| m.t_corr_s),
        format!("bias_instability_{unit}"): found.minimum.as_ref().map(|m| m.deviation),
    })
}
