//! What people are told: the head of the file, and doubts.

use super::{Export, SensorExport};
use nav_sim_signal::imu::Sensor;
use nav_sim_signal::noise::practical::{Closure, Pair, Policy};
use nav_sim_signal::units::{DEG, DEG_PER_HOUR, STANDARD_GRAVITY};

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

    /// A line for each sensor: its parameters in the units of data sheets, and how well the pair stands for the model.
    pub(crate) fn summary(&self) -> Vec<String> {
        self.sensors
            .iter()
            .map(|s| format!("{}: {}; {}", s.sensor.name(), parameters(s), closure_in_words(s.closure)))
            .collect()
    }

    /// What a user should know before pasting.
    pub(crate) fn doubts(&self) -> Vec<String> {
        let mut doubts: Vec<String> = self.sensors.iter().flat_map(|s| self.doubts_of(s)).collect();
        for entry in self.entries.iter().filter(|e| e.wanted.is_some()) {
            doubts.push(format!(
                "{} is set to {:.3e}, the end of its documented range; the model says {:.3e}",
                entry.key,
                entry.value,
                entry.wanted.unwrap_or_default()
            ));
        }
        if self.target.is_autopilot() {
            doubts.push(
                "a recording at rest contains no vibration, and the autopilot's defaults allow for it: these values are a \
                 lower bound"
                    .to_owned(),
            );
        }
        doubts
    }

    fn doubts_of(&self, s: &SensorExport) -> Vec<String> {
        let name = s.sensor.name();
        let mut doubts = Vec::new();
        let Closure { lowest, highest } = s.closure;
        if lowest.ratio < 1.0 / TOLERANCE {
            doubts.push(format!(
                "{name}: at {} the exported pair has {:.2} times the Allan deviation of the model: a filter with it trusts \
                 the sensor too much over such times; --policy envelope is cautious, another --horizon weighs other times",
                seconds(lowest.tau_s),
                lowest.ratio
            ));
        }
        if highest.ratio > TOLERANCE {
            doubts.push(format!(
                "{name}: at {} the exported pair has {:.2} times the Allan deviation of the model: a filter with it trusts \
                 the sensor less than it could over such times",
                seconds(highest.tau_s),
                highest.ratio
            ));
        }
        if s.exported.density <= 0.0 {
            let why = match self.settings.policy {
                Policy::Strict => "the model has no WN; an AR1 may carry the white noise: --policy matched",
                _ => "the bias alone explains the model at 1 s",
            };
            doubts.push(format!("{name}: N is 0, with which many filters fail: {why}"));
        }
        if s.exported.walk <= 0.0 && s.exported.markov.is_none_or(|m| m.sigma <= 0.0) {
            doubts.push(format!(
                "{name}: the bias does not move (K is 0): a filter will hold its estimate for certain"
            ));
        }
        if s.left_out.ratio > NOTABLE && self.settings.policy != Policy::Envelope {
            doubts.push(format!(
                "{name}: quantization noise or drift is {:.0} % of the Allan variance at {} and is not in the pair",
                100.0 * s.left_out.ratio,
                seconds(s.left_out.tau_s)
            ));
        }
        doubts.extend(axes_differ(s));
        doubts
    }
}

/// The axes beside the largest, where they differ.
fn axes_differ(s: &SensorExport) -> Option<String> {
    let name = s.sensor.name();
    let largest = s.deviation_at_1_s.iter().copied().fold(0.0, f64::max);
    let smallest = s.deviation_at_1_s.iter().copied().fold(f64::INFINITY, f64::min);
    if smallest >= (1.0 - NOTABLE) * largest {
        return (s.axes.len() < 3).then(|| format!("{name}: the model has {} of three axes", s.axes.len()));
    }
    let ratios: Vec<String> = s
        .axes
        .iter()
        .zip(&s.deviation_at_1_s)
        .map(|((channel, _), d)| format!("{} {:.2}", channel.axis.name(), d / largest))
        .collect();
    Some(format!(
        "{name}: the axes differ (Allan deviation at 1 s over the largest: {}); the largest at each averaging time is exported",
        ratios.join(", ")
    ))
}

/// "0.97 (at 3.2 s) to 1.04 (at 80 s) times the model's Allan deviation".
pub(crate) fn closure_in_words(closure: Closure) -> String {
    let Closure { lowest, highest } = closure;
    format!(
        "{:.2} (at {}) to {:.2} (at {}) times the Allan deviation of the model",
        lowest.ratio,
        seconds(lowest.tau_s),
        highest.ratio,
        seconds(highest.tau_s)
    )
}

/// `N 0.42 deg/sqrt(h), K …, B 8.3 deg/h at 160 s`.
fn parameters(s: &SensorExport) -> String {
    let gyro = s.sensor == Sensor::Gyro;
    let Pair { density, walk, markov } = s.exported;
    let mut parts = vec![if gyro {
        format!("N {} deg/sqrt(h)", short(density / DEG * 60.0))
    } else {
        format!("N {} m/s/sqrt(h) ({} ug/sqrt(Hz))", short(density * 60.0), short(density / MICRO_G))
    }];
    let bias = |x: f64| {
        if gyro { format!("{} deg/h", short(x / DEG_PER_HOUR)) } else { format!("{} ug", short(x / MICRO_G)) }
    };
    match markov {
        Some(m) => parts.push(format!("bias {}, correlation time {}", bias(m.sigma), seconds(m.t_corr_s))),
        // over an hour a random walk of K makes K √3600
        None => parts.push(format!("K {}/sqrt(h)", bias(walk * 60.0))),
    }
    parts.push(s.largest.minimum.map_or_else(
        || "B not reached".to_owned(),
        |m| format!("B {} (minimum at {})", bias(m.bias_instability()), seconds(m.tau_s)),
    ));
    if let Some(crossover) = s.exported.crossover_s() {
        parts.push(format!("N dominates below {}, K above", seconds(crossover)));
    }
    parts.join(", ")
}

/// One millionth of standard gravity (m/s²).
const MICRO_G: f64 = STANDARD_GRAVITY * 1e-6;

/// Three significant digits.
fn short(x: f64) -> String {
    match x.abs() {
        0.0 => "0".to_owned(),
        m if !(1e-3..1e5).contains(&m) => format!("{x:.2e}"),
        m => format!("{x:.*}", (2.0 - m.log10().floor()).max(0.0) as usize),
    }
}

fn seconds(t_s: f64) -> String {
    format!("{} s", short(t_s))
}
