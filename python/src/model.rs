//! Noise models: what their files hold, recordings of them, the figures that other programs ask for.

use crate::error;
use crate::work::work;
use nav_sim::commands::datasheet::catalogue_json;
use nav_sim::commands::export::exported;
use nav_sim::io::contamination_file;
use nav_sim::io::model_file::{self, ModelFile};
use nav_sim::prelude::{AxisParameters, Channel, Composite, Horizon, Pair, Policy, Sensor, Target};
use nav_sim::signal::noise::practical::Minimum;
use nav_sim::signal::noise::{ReplicateError, VirtualImu};
use numpy::PyArray1;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use serde_json::{Map, Value, json};
use std::fmt::Display;
use std::path::Path;
use std::str::FromStr;

/// Name of the file that a model is in, where it is in none.
const IN_MEMORY: &str = "model";

fn read(py: Python<'_>, text: &str, path: Option<&str>) -> PyResult<ModelFile> {
    let path = Path::new(path.unwrap_or(IN_MEMORY));
    model_file::from_text(path, text).map_err(|e| error::of_failure(py, &e, ""))
}

fn parsed<T: FromStr<Err: Display>>(py: Python<'_>, argument: &str, word: &str) -> PyResult<T> {
    let refused = |e| error::refused(py, &format!("{argument}: {e}"));
    word.parse().map_err(refused)
}

/// What a model file holds, as JSON: `rate_hz`, and for each channel the list of its processes.
#[pyfunction]
#[pyo3(signature = (text, path))]
pub(crate) fn model_contents(py: Python<'_>, text: &str, path: Option<&str>) -> PyResult<String> {
    let file = read(py, text, path)?;
    let mut channels = Map::new();
    for channel in Channel::ALL
        .into_iter()
        .filter(|channel| !file.missing.contains(channel))
    {
        channels.insert(
            channel.to_string(),
            json!(file.model.axis(channel).processes),
        );
    }
    Ok(json!({ "rate_hz": file.model.rate_hz, "channels": channels }).to_string())
}

/// The catalogue of data sheets, as JSON.
#[pyfunction]
pub(crate) fn catalogue(py: Python<'_>) -> PyResult<String> {
    let catalogue = catalogue_json().map_err(|e| error::of_failure(py, &e, ""))?;
    Ok(catalogue.to_string())
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
    let made = work(py, None, move |meter| {
        let spread = file.spread.as_ref().filter(|_| spread);
        let imu = VirtualImu {
            model: &file.model,
            spread,
            contamination: contamination.as_ref(),
            seed,
        };
        let model = imu.model_of(replicate)?;
        let present = Channel::ALL
            .into_iter()
            .filter(|channel| !file.missing.contains(channel));
        let signal = |channel| {
            meter.advance(1);
            Ok((channel, imu.signal(&model, replicate, channel, samples)?))
        };
        present
            .map(signal)
            .collect::<Result<Vec<_>, ReplicateError>>()
    })?;
    let made = made.map_err(|e| error::refused(py, &e.to_string()))?;
    let columns = PyDict::new(py);
    for (channel, samples) in made {
        let unit = if channel.sensor == Sensor::Accel {
            "m_s2"
        } else {
            "rad_s"
        };
        let name = format!("{}_{}_{unit}", channel.sensor.name(), channel.axis.name());
        columns.set_item(name, PyArray1::from_vec(py, samples))?;
    }
    Ok(columns)
}

/// The wavelet variance that a channel of the model implies at the first scales (units²).
#[pyfunction]
#[pyo3(signature = (text, channel, scales))]
pub(crate) fn model_wavelet<'py>(
    py: Python<'py>,
    text: &str,
    channel: &str,
    scales: u32,
) -> PyResult<Bound<'py, PyArray1<f64>>> {
    let file = read(py, text, None)?;
    let [channel] = Channel::named(channel)[..] else {
        let message = format!("channel: \"{channel}\" is not one, such as \"gyro.x\"");
        return Err(error::refused(py, &message));
    };
    let noise = file.model.axis(channel);
    let wv = (1..=scales).map(|level| noise.processes.iter().map(|p| p.haar_wv(level)).sum());
    Ok(PyArray1::from_vec(py, wv.collect()))
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
    let policy: Policy = parsed(py, "policy", policy)?;
    let mut sensors = Map::new();
    for sensor in Sensor::ALL {
        let present = Channel::ALL
            .into_iter()
            .filter(|c| c.sensor == sensor && !file.missing.contains(c));
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
        let name = sensor.name();
        let found = found.map_err(|e| error::refused(py, &format!("{name}: {e}")))?;
        sensors.insert(sensor.name().to_owned(), figures(sensor, &found));
    }
    Ok(Value::Object(sensors).to_string())
}

/// A model as the file of another program; `name` is that of the model in its head.
#[pyfunction]
#[pyo3(signature = (text, name, target, policy, from_s, to_s))]
pub(crate) fn model_export(
    py: Python<'_>,
    text: &str,
    name: &str,
    target: &str,
    policy: &str,
    from_s: f64,
    to_s: f64,
) -> PyResult<String> {
    let file = read(py, text, None)?;
    let target: Target = parsed(py, "target", target)?;
    let policy: Policy = parsed(py, "policy", policy)?;
    let export = exported(&file, target, policy, Horizon { from_s, to_s });
    let export = export.map_err(|e| error::refused(py, &format!("{name}: {e}")))?;
    Ok(export.text(name))
}

/// Longest averaging time at which a minimum of the Allan deviation is believed (s).
const LONGEST_S: f64 = 10_000.0;

fn figures(sensor: Sensor, found: &AxisParameters) -> Value {
    // of an accelerometer, of a gyroscope
    let [density, walk, bias, floor] = match sensor {
        Sensor::Accel => [
            "density_m_s2_per_sqrt_hz",
            "walk_m_s3_per_sqrt_hz",
            "bias_sigma_m_s2",
            "bias_instability_m_s2",
        ],
        Sensor::Gyro => [
            "density_rad_s_per_sqrt_hz",
            "walk_rad_s2_per_sqrt_hz",
            "bias_sigma_rad_s",
            "bias_instability_rad_s",
        ],
    };
    let Pair {
        density: n,
        walk: k,
        ..
    } = found.walk;
    let (sigma, t_corr_s) = found
        .markov
        .markov
        .map(|markov| (markov.sigma, markov.t_corr_s))
        .unzip();
    let instability = found.minimum.as_ref().map(Minimum::bias_instability);
    json!({ density: n, walk: k, bias: sigma, "bias_correlation_time_s": t_corr_s, floor: instability })
}
