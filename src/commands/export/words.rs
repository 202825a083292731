//! Head of an exported file, its warnings and its JSON.

use super::{Entry, Export, SensorExport};
use nav_sim_calibration::percent;
use nav_sim_document::readable;
use nav_sim_signal::imu::Sensor;
use nav_sim_signal::noise::practical::{Pair, Policy, Ratio};
use nav_sim_signal::units::{DEG, DEG_PER_HOUR, STANDARD_GRAVITY};

/// A pair is in doubt when its Allan deviation is off by more than this.
const TOLERANCE: f64 = 1.5;
/// Shares of the Allan variance, and differences of axes, that are told.
const NOTABLE: f64 = 0.1;

/// A quantity of a sensor.
pub(crate) enum Quantity {
    /// White noise density N: velocity or angle random walk.
    Density,
    /// Random-walk density K: acceleration or rate random walk.
    Walk,
    /// A bias: its instability, its standard deviation.
    Bias,
}

impl Quantity {
    /// Unit of data sheets, and the factor from SI to it.
    pub(crate) const fn sheet(self, sensor: Sensor) -> (&'static str, f64) {
        const ROOT_HOUR: f64 = 60.0;
        match (self, sensor) {
            (Self::Density, Sensor::Accel) => ("m/s/sqrt(h)", ROOT_HOUR),
            (Self::Density, Sensor::Gyro) => ("deg/sqrt(h)", ROOT_HOUR / DEG),
            (Self::Walk, Sensor::Accel) => ("m/s^2/sqrt(h)", ROOT_HOUR),
            (Self::Walk, Sensor::Gyro) => ("deg/h/sqrt(h)", ROOT_HOUR / DEG_PER_HOUR),
            (Self::Bias, Sensor::Accel) => ("ug", 1e6 / STANDARD_GRAVITY),
            (Self::Bias, Sensor::Gyro) => ("deg/h", 1.0 / DEG_PER_HOUR),
        }
    }

    fn text(self, x: f64, sensor: Sensor) -> String {
        let (unit, factor) = self.sheet(sensor);
        format!("{} {unit}", readable(x * factor))
    }
}

impl Export {
    /// The comment at the head of the file.
    pub(super) fn head(&self, model: &str) -> Vec<String> {
        let (horizon, name) = (self.horizon, self.target.name);
        let mut lines = vec![format!(
            "{name}: {model}, {} Hz, policy {} over averages of {} s to {} s (nav-sim export)",
            self.rate_hz, self.policy, horizon.from_s, horizon.to_s
        )];
        lines.extend(self.summary());
        lines.extend(self.doubts().into_iter().map(|d| format!("Warning: {d}")));
        lines
    }

    /// A line for each sensor: its parameters in the units of data sheets, and how far the pair is from the model.
    pub(crate) fn summary(&self) -> Vec<String> {
        let line = |s: &SensorExport| {
            let (low, high) = (s.closure.lowest.ratio, s.closure.highest.ratio);
            format!(
                "{}: {}; {low:.2} to {high:.2} × the model",
                s.sensor.name(),
                s.parameters()
            )
        };
        self.sensors.iter().map(line).collect()
    }

    /// Warnings before pasting, the most important first.
    pub(crate) fn doubts(&self) -> Vec<String> {
        let misfit = self.misfit.iter();
        let mut doubts: Vec<String> = misfit.map(|misfit| format!("the model {misfit}")).collect();
        for s in &self.sensors {
            doubts.extend(
                s.doubts(self.policy)
                    .into_iter()
                    .map(|doubt| format!("{}: {doubt}", s.sensor.name())),
            );
        }
        doubts.extend(self.filled(&[]).0.iter().filter_map(|e| {
            let (Entry { key, value, .. }, wanted) = (e, e.wanted?);
            Some(format!(
                "{key} is {value:.3e}, the end of its range; the model says {wanted:.3e}"
            ))
        }));
        if self.target.vibrates {
            doubts.push(
                "a recording at rest has no vibration: these values are a lower bound".into(),
            );
        }
        doubts
    }
}

impl SensorExport {
    fn doubts(&self, policy: Policy) -> Vec<String> {
        let mut doubts = Vec::new();
        let Pair {
            density,
            walk,
            markov,
        } = self.exported;
        if density <= 0.0 {
            doubts.push("N is 0, with which many filters fail: try --policy matched".to_owned());
        }
        if walk <= 0.0 && markov.is_none_or(|m| m.sigma <= 0.0) {
            doubts.push("K is 0: a filter will hold its bias estimate for certain".to_owned());
        }
        let (lowest, highest) = (self.closure.lowest, self.closure.highest);
        let is_far = [lowest.ratio < 1.0 / TOLERANCE, highest.ratio > TOLERANCE];
        for ((Ratio { ratio, tau_s }, trust), is_far) in [(lowest, "much"), (highest, "little")]
            .into_iter()
            .zip(is_far)
        {
            if is_far {
                let at = seconds(tau_s);
                doubts.push(format!(
                    "{ratio:.2} times the model's Allan deviation at {at}: trusted too {trust} there"
                ));
            }
        }
        if self.left_out.ratio > NOTABLE && policy != Policy::Envelope {
            let (share, at) = (percent(self.left_out.ratio), seconds(self.left_out.tau_s));
            doubts.push(format!(
                "quantization noise or drift, {share} of the Allan variance at {at}, is left out"
            ));
        }
        let largest = self.axes.iter().map(|(_, d)| *d).fold(0.0, f64::max);
        let shares = self.axes.iter().map(|(axis, d)| (axis, d / largest));
        if shares.clone().any(|(_, share)| share < 1.0 - NOTABLE) {
            let shares: Vec<String> = shares.map(|(axis, d)| format!("{axis} {d:.2}")).collect();
            let shares = shares.join(", ");
            doubts.push(format!(
                "axes differ (Allan deviation at 1 s: {shares}); the largest is exported"
            ));
        } else if self.axes.len() < 3 {
            doubts.push(format!("the model has {} of three axes", self.axes.len()));
        }
        doubts
    }

    /// `N 0.42 deg/sqrt(h), K 12 deg/h/sqrt(h), B 8.3 deg/h at 160 s`.
    fn parameters(&self) -> String {
        let figure = |what: Quantity, x: f64| what.text(x, self.sensor);
        let pair = self.exported;
        let bias = match pair.markov {
            None => format!("K {}", figure(Quantity::Walk, pair.walk)),
            Some(m) => {
                let sigma = figure(Quantity::Bias, m.sigma);
                format!("bias {sigma} with T = {}", seconds(m.t_corr_s))
            }
        };
        let floor = match self.largest.minimum {
            None => "B not reached".to_owned(),
            Some(m) => {
                let floor = figure(Quantity::Bias, m.bias_instability());
                format!("B {floor} at {}", seconds(m.tau_s))
            }
        };
        format!(
            "N {}, {bias}, {floor}",
            figure(Quantity::Density, pair.density)
        )
    }
}

fn seconds(t_s: f64) -> String {
    format!("{} s", readable(t_s))
}
