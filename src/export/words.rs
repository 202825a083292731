//! What people are told: the head of the file, and doubts.

use super::{Export, Quantity, SensorExport};
use nav_sim_calibration::percent;
use nav_sim_document::readable;
use nav_sim_signal::noise::practical::{Pair, Policy, Ratio};

/// A pair is in doubt when its Allan deviation is off by more than this.
const TOLERANCE: f64 = 1.5;
/// Shares of the Allan variance, and differences of axes, that are told.
const NOTABLE: f64 = 0.1;

impl Export {
    /// What stands at the head of the file.
    pub(super) fn head(&self, model: &str) -> Vec<String> {
        let (horizon, name) = (self.settings.horizon, self.target.name());
        let mut lines = vec![format!(
            "{name}: {model}, {} Hz, policy {} over averages of {} s to {} s (nav-sim export)",
            self.rate_hz,
            self.settings.policy.name(),
            horizon.from_s,
            horizon.to_s
        )];
        lines.extend(self.summary());
        lines.extend(self.doubts().into_iter().map(|d| format!("Warning: {d}")));
        lines
    }

    /// A line for each sensor: its parameters in the units of data sheets, and how far the pair is from the model.
    pub(crate) fn summary(&self) -> Vec<String> {
        let line = |s: &SensorExport| {
            let (low, high) = (s.closure.lowest.ratio, s.closure.highest.ratio);
            let off = format!("{low:.2} to {high:.2} × the model");
            format!("{}: {}; {off}", s.sensor.name(), parameters(s))
        };
        self.sensors.iter().map(line).collect()
    }

    /// What a user should know before pasting, the most important first.
    pub(crate) fn doubts(&self) -> Vec<String> {
        let mut doubts: Vec<String> = self
            .settings
            .misfit
            .iter()
            .map(|misfit| format!("the model {misfit}"))
            .collect();
        doubts.extend(self.sensors.iter().flat_map(|s| self.doubts_of(s)));
        doubts.extend(self.entries.iter().filter_map(|e| {
            let wanted = e.wanted?;
            Some(format!(
                "{} is {:.3e}, the end of its range; the model says {wanted:.3e}",
                e.key, e.value
            ))
        }));
        if self.target.is_autopilot() {
            doubts.push(
                "a recording at rest has no vibration: these values are a lower bound".to_owned(),
            );
        }
        doubts
    }

    fn doubts_of(&self, s: &SensorExport) -> Vec<String> {
        let mut doubts = Vec::new();
        if s.exported.density <= 0.0 {
            doubts.push("N is 0, with which many filters fail: try --policy matched".to_owned());
        }
        if s.exported.walk <= 0.0 && s.exported.markov.is_none_or(|m| m.sigma <= 0.0) {
            doubts.push("K is 0: a filter will hold its bias estimate for certain".to_owned());
        }
        let off = |Ratio { ratio, tau_s }: Ratio, trust: &str| {
            format!(
                "{ratio:.2} times the model's Allan deviation at {}: trusted too {trust} there",
                seconds(tau_s)
            )
        };
        if s.closure.lowest.ratio < 1.0 / TOLERANCE {
            doubts.push(off(s.closure.lowest, "much"));
        }
        if s.closure.highest.ratio > TOLERANCE {
            doubts.push(off(s.closure.highest, "little"));
        }
        if s.left_out.ratio > NOTABLE && self.settings.policy != Policy::Envelope {
            let (share, at) = (percent(s.left_out.ratio), seconds(s.left_out.tau_s));
            doubts.push(format!(
                "quantization noise or drift, {share} of the Allan variance at {at}, is left out"
            ));
        }
        doubts.extend(axes_differ(s));
        doubts
            .into_iter()
            .map(|doubt| format!("{}: {doubt}", s.sensor.name()))
            .collect()
    }
}

/// The axes beside the largest, where they differ or some are missing.
fn axes_differ(s: &SensorExport) -> Option<String> {
    let largest = s.deviation_at_1_s.iter().copied().fold(0.0, f64::max);
    if s.deviation_at_1_s
        .iter()
        .all(|d| *d >= (1.0 - NOTABLE) * largest)
    {
        return (s.axes.len() < 3).then(|| format!("the model has {} of three axes", s.axes.len()));
    }
    let ratio = |((channel, _), d): (&(nav_sim_signal::imu::Channel, _), &f64)| {
        format!("{} {:.2}", channel.axis.name(), d / largest)
    };
    let ratios: Vec<String> = s.axes.iter().zip(&s.deviation_at_1_s).map(ratio).collect();
    Some(format!(
        "axes differ (Allan deviation at 1 s: {}); the largest is exported",
        ratios.join(", ")
    ))
}

/// `N 0.42 deg/sqrt(h), K 12 deg/h/sqrt(h), B 8.3 deg/h at 160 s`.
fn parameters(s: &SensorExport) -> String {
    let figure = |what: Quantity, x: f64| {
        let (unit, factor) = what.sheet(s.sensor);
        format!("{} {unit}", readable(x * factor))
    };
    let Pair {
        density,
        walk,
        markov,
    } = s.exported;
    let bias = markov.map_or_else(
        || format!("K {}", figure(Quantity::Walk, walk)),
        |m| {
            format!(
                "bias {} with T = {}",
                figure(Quantity::Bias, m.sigma),
                seconds(m.t_corr_s)
            )
        },
    );
    let floor = s.largest.minimum.map_or_else(
        || "B not reached".to_owned(),
        |m| {
            format!(
                "B {} at {}",
                figure(Quantity::Bias, m.bias_instability()),
                seconds(m.tau_s)
            )
        },
    );
    format!("N {}, {bias}, {floor}", figure(Quantity::Density, density))
}

fn seconds(t_s: f64) -> String {
    format!("{} s", readable(t_s))
}
