//! All the numbers of an export, with units.

use super::{Entry, Export, Quantity, SensorExport};
use nav_sim_signal::imu::Sensor;
use nav_sim_signal::noise::practical::{AxisParameters, CorrelatedProcess, Markov, Pair, Ratio};
use serde_json::{Map, Value, json};

impl Export {
    /// As a JSON document.
    pub(crate) fn json(&self, model: &str) -> Value {
        let horizon = self.settings.horizon;
        let sensors: Map<String, Value> = self
            .sensors
            .iter()
            .map(|s| (s.sensor.name().to_owned(), sensor(s)))
            .collect();
        json!({
            "schema_version": 1,
            "target": self.target.name(),
            "model": model,
            "rate_hz": self.rate_hz,
            "policy": self.settings.policy.name(),
            "horizon_s": [horizon.from_s, horizon.to_s],
            "entries": self.entries.iter().map(entry).collect::<Vec<_>>(),
            "sensors": sensors,
            "warnings": self.doubts(),
        })
    }
}

fn entry(e: &Entry) -> Value {
    json!({ "key": e.key, "value": e.value, "unit": e.unit, "meaning": e.meaning, "model_value": e.wanted })
}

fn sensor(s: &SensorExport) -> Value {
    let axis =
        |((channel, p), deviation): (&(nav_sim_signal::imu::Channel, AxisParameters), &f64)| {
            let mut value = parameters(p, s.sensor);
            value["allan_deviation_at_1_s"] =
                json!({ "value": deviation, "unit": s.sensor.unit() });
            (channel.axis.name().to_owned(), value)
        };
    let axes: Map<String, Value> = s.axes.iter().zip(&s.deviation_at_1_s).map(axis).collect();
    let ratio = |r: Ratio| json!({ "ratio": r.ratio, "tau_s": r.tau_s });
    json!({
        "exported": pair(&s.exported, s.sensor),
        "closure": { "lowest": ratio(s.closure.lowest), "highest": ratio(s.closure.highest) },
        "bias_sd": { "value": s.bias_sd, "unit": s.sensor.unit() },
        "largest": parameters(&s.largest, s.sensor),
        "axes": axes,
    })
}

/// The parameters of an axis, each in SI and in the unit of data sheets.
pub(crate) fn parameters(p: &AxisParameters, sensor: Sensor) -> Value {
    let minimum = p.minimum.map(|m| {
        let b = m.bias_instability();
        json!({ "tau_s": m.tau_s, "allan_deviation": m.deviation, "bias_instability": bias(b, sensor) })
    });
    let process = |c: &CorrelatedProcess| {
        let mut value = markov(&c.markov, sensor);
        value["process"] = json!(c.label);
        value
    };
    json!({
        "white_and_walk": pair(&p.walk, sensor),
        "white_and_markov": pair(&p.markov, sensor),
        "minimum": minimum,
        "correlated": p.correlated.iter().map(process).collect::<Vec<_>>(),
    })
}

fn pair(p: &Pair, sensor: Sensor) -> Value {
    let crossover = p.crossover_s();
    let governs = |from: Option<f64>, to: Option<f64>| json!({ "from_s": from, "to_s": to });
    let density = |x: f64, what: Quantity, governs: Value| {
        let mut value = quantity(x, what, sensor);
        value["governs"] = governs;
        value
    };
    json!({
        "n": density(p.density, Quantity::Density, governs(None, crossover)),
        "k": density(p.walk, Quantity::Walk, governs(crossover, None)),
        "markov": p.markov.as_ref().map(|m| markov(m, sensor)),
    })
}

fn markov(m: &Markov, sensor: Sensor) -> Value {
    json!({ "sigma": bias(m.sigma, sensor), "t_corr_s": m.t_corr_s })
}

fn bias(x: f64, sensor: Sensor) -> Value {
    quantity(x, Quantity::Bias, sensor)
}

/// In SI and in the unit of data sheets.
fn quantity(x: f64, what: Quantity, sensor: Sensor) -> Value {
    let (unit, factor) = what.sheet(sensor);
    json!({
        "value": x, "unit": what.si_unit(sensor),
        "data_sheet": { "value": x * factor, "unit": unit },
    })
}
