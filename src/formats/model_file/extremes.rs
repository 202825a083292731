//! Models at the ends of the intervals of their parameters.

use super::ModelFile;
use nav_sim_signal::imu::Channel;
use nav_sim_signal::noise::Model;

/// An end of an interval.
#[derive(Clone, Copy, PartialEq, Eq)]
enum End {
    Low,
    High,
}

impl End {
    const fn name(self) -> &'static str {
        match self {
            Self::Low => "low",
            Self::High => "high",
        }
    }
}

impl ModelFile {
    /// The model itself, and the four with all amplitudes at one end of their intervals and all shapes (phi, beta,
    /// theta) at one end, by name. The errors of a filter are linear in every amplitude: whatever holds at both
    /// ends holds between. None where no parameter has an interval.
    pub(crate) fn extremes(&self) -> Option<Vec<(String, Model)>> {
        if self.intervals.is_empty() {
            return None;
        }
        let mut models = vec![("as estimated".to_owned(), self.model.clone())];
        for amplitudes in [End::High, End::Low] {
            for shapes in [End::High, End::Low] {
                let name = format!("amplitudes {}, shapes {}", amplitudes.name(), shapes.name());
                models.push((name, self.extreme(amplitudes, shapes)));
            }
        }
        models.dedup_by(|a, b| a.1 == b.1);
        Some(models)
    }

    fn extreme(&self, amplitudes: End, shapes: End) -> Model {
        let mut model = self.model.clone();
        for channel in Channel::ALL {
            let axis = &mut model.axes[channel.index()];
            for (process, label) in axis.processes.iter_mut().zip(self.model.axis(channel).labels()) {
                let is_of_process = |i: &&super::Interval| i.channel == channel && i.process == label;
                for interval in self.intervals.iter().filter(is_of_process) {
                    let is_shape = matches!(interval.parameter.as_str(), "phi" | "beta" | "theta");
                    let end = if is_shape { shapes } else { amplitudes };
                    let value = if end == End::High { interval.high } else { interval.low };
                    // an end outside the domain of the parameter is open: the estimate stays
                    let changed = process.with_parameter(&interval.parameter, value, self.model.rate_hz);
                    *process = changed.and_then(Result::ok).unwrap_or(*process);
                }
            }
        }
        model
    }
}

#[cfg(test)]
mod tests {
    use super::super::Interval;
    use super::*;
    use nav_sim_signal::noise::{Ar1, Composite, Process};

    #[test]
    fn amplitudes_and_shapes_go_to_either_end_together() {
        let axis = Composite::new(vec![Process::Ar1(Ar1::new(0.99, 1e-8).unwrap())]);
        let mut file = ModelFile::new(Model::pooled(100.0, &axis, &axis));
        assert_eq!(file.extremes(), None);
        let interval = |parameter: &str, low, high| {
            Channel::ALL.map(|channel| Interval {
                channel,
                process: "AR1".to_owned(),
                parameter: parameter.to_owned(),
                low,
                high,
            })
        };
        // an open end is not a value: the estimate stays
        file.intervals = [interval("phi", 0.98, 0.995), interval("sigma2", 5e-9, f64::INFINITY)].concat();
        let found = file.extremes().unwrap();
        let values: Vec<_> = found.iter().map(|(_, m)| m.axes[5].processes[0].parameters()).collect();
        let expected = [(0.99, 1e-8), (0.995, 1e-8), (0.98, 1e-8), (0.995, 5e-9), (0.98, 5e-9)];
        assert_eq!(values, expected.map(|(phi, sigma2)| vec![("phi", phi), ("sigma2", sigma2)]));
    }
}
