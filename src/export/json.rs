//! All the numbers of an export, with units.

use super::{Entry, Export, SensorExport};
use crate::imu::Sensor;
use crate::noise::practical::{AxisParameters, CorrelatedProcess, Markov, Pair, Ratio};
use crate::units::{DEG, DEG_PER_HOUR, STANDARD_GRAVITY};
use serde_json::{Map, Value, json};

impl Export {
    /// As a JSON document.
    #[must_use]
    pub fn json(&self, model: &str) -> Value {
        let horizon = self.settings.horizon;
        let sensors: Map<String, Value> =
            self.sensors.iter().map(|s| (s.sensor.name().to_owned(), sensor(s))).collect();
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
    let axis = |((channel, p), deviation): (&(crate::imu::Channel, AxisParameters), &f64)| {
        let mut value = parameters(p, s.sensor);
        value["allan_deviation_at_1_s"] = json!({ "value": deviation, "unit": s.sensor.unit() });
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

fn parameters(p: &AxisParameters, sensor: Sensor) -> Value {
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
    let (n_unit, n_sheet, k_unit, k_sheet) = match sensor {
        Sensor::Accel => (
            "m/s^2/sqrt(Hz)",
            ("m/s/sqrt(h)", p.density * 60.0),
            "m/s^3/sqrt(Hz)",
            ("m/s^2/sqrt(h)", p.walk * 60.0),
        ),
        Sensor::Gyro => (
            "rad/s/sqrt(Hz)",
            ("deg/sqrt(h)", p.density / DEG * 60.0),
            "rad/s^2/sqrt(Hz)",
            ("deg/h/sqrt(h)", p.walk / DEG_PER_HOUR * 60.0),
        ),
    };
    let governs = |from: Option<f64>, to: Option<f64>| json!({ "from_s": from, "to_s": to });
    json!({
        "n": { "value": p.density, "unit": n_unit, "data_sheet": { "value": n_sheet.1, "unit": n_sheet.0 },
               "governs": governs(None, crossover) },
        "k": { "value": p.walk, "unit": k_unit, "data_sheet": { "value": k_sheet.1, "unit": k_sheet.0 },
               "governs": governs(crossover, None) },
        "markov": p.markov.as_ref().map(|m| markov(m, sensor)),
    })
}

fn markov(m: &Markov, sensor: Sensor) -> Value {
    json!({ "sigma": bias(m.sigma, sensor), "t_corr_s": m.t_corr_s })
}

/// In SI and in the unit of data sheets.
fn bias(x: f64, sensor: Sensor) -> Value {
    let (value, unit) = match sensor {
        Sensor::Accel => (x / STANDARD_GRAVITY * 1e6, "ug"),
        Sensor::Gyro => (x / DEG_PER_HOUR, "deg/h"),
    };
    json!({ "value": x, "unit": sensor.unit(), "data_sheet": { "value": value, "unit": unit } })
}
