//! N, K and B of a fit, and their intervals from the draws of the bootstrap.

use super::intervals::scale_interval;
use crate::fit::Fit;
use crate::noise::Composite;
use crate::noise::practical::{AxisParameters, Bias, Curve, Horizon, Minimum, Policy};
use crate::outcome::{Outcome, Practical, PracticalIntervals};

/// Longest averaging time that the scales of a fit tell of (s): a scale is two averages long.
fn observed_s(outcome: &Outcome, rate_hz: f64) -> Option<f64> {
    let longest = outcome.counted_levels().into_iter().max()?;
    Some(f64::from(longest - 1).exp2() / rate_hz)
}

impl Outcome {
    /// N, K, B and T of practitioners, as exports have them; none at a rate without averages of 1 s, nor
    /// without noise.
    #[must_use]
    pub fn practical(&self, rate_hz: f64) -> Option<Practical> {
        let (horizon, policy) = (Horizon::default(), Policy::Matched);
        let range_s = observed_s(self, rate_hz)?;
        let model = &self.fit.composite;
        let parameters = AxisParameters::of(&[model], rate_hz, horizon, policy, range_s).ok()?;
        let intervals = self
            .inference
            .as_ref()
            .map_or(PracticalIntervals::default(), |i| i.practical);
        let walk_until_s = parameters
            .walk
            .departs_s(model, rate_hz, range_s, Practical::BESIDE);
        Some(Practical {
            parameters,
            intervals,
            range_s,
            walk_until_s,
        })
    }
}

/// The 95 % intervals from the fits of the draws; `stretch` as in [`super::intervals::intervals`].
pub(crate) fn intervals(
    outcome: &Outcome,
    fits: &[Fit],
    stretch: f64,
    rate_hz: f64,
) -> PracticalIntervals {
    let none = PracticalIntervals::default();
    let Some(range_s) = observed_s(outcome, rate_hz) else {
        return none;
    };
    let reading = |model: &Composite| Reading::of(model, rate_hz, range_s);
    let Some(own) = reading(&outcome.fit.composite) else {
        return none;
    };
    let drawn: Vec<Reading> = fits
        .iter()
        .filter_map(|fit| reading(&fit.composite))
        .collect();
    let interval = |value: &dyn Fn(&Reading) -> Option<f64>| {
        let there: Vec<f64> = drawn
            .iter()
            .filter_map(value)
            .filter(|x| *x > 0.0)
            .collect();
        scale_interval(value(&own)?, there, fits.len(), stretch)
    };
    PracticalIntervals {
        density: interval(&|r| Some(r.density)),
        walk: interval(&|r| Some(r.walk)),
        instability: interval(&|r| r.instability),
    }
}

/// N, K and B read off one model.
struct Reading {
    density: f64,
    walk: f64,
    instability: Option<f64>,
}

impl Reading {
    fn of(model: &Composite, rate_hz: f64, range_s: f64) -> Option<Self> {
        let curve = Curve::largest(&[model], rate_hz, Horizon::default()).ok()?;
        let pair = curve.pair(Policy::Matched, Bias::Walk);
        let minimum = Minimum::of(&[model], rate_hz, range_s);
        Some(Self {
            density: pair.density,
            walk: pair.walk,
            instability: minimum.map(|m| m.bias_instability()),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::noise::{GaussMarkov, Process, RandomWalk, White};

    fn practical(processes: Vec<Process>) -> Practical {
        let (model, rate_hz, range_s) = (Composite::new(processes), 100.0, 1e4);
        let parameters = AxisParameters::of(
            &[&model],
            rate_hz,
            Horizon::default(),
            Policy::Matched,
            range_s,
        )
        .unwrap();
        let walk_until_s = parameters
            .walk
            .departs_s(&model, rate_hz, range_s, Practical::BESIDE);
        let intervals = PracticalIntervals::default();
        Practical {
            parameters,
            intervals,
            range_s,
            walk_until_s,
        }
    }

    /// White noise of N = 1e-3 with a random walk that takes over at √3·1e-3/1e-5 = 173 s; with a Gauss-Markov process of 30 s,
    /// which the pair over 1 s to 100 s follows on its rise and not on its fall (from 1.9·30 s on); with one that
    /// adds 3 % to the Allan variance at 30 s: the random walk that follows it over 1 s to 100 s would take over beyond,
    /// where nothing rises.
    #[test]
    fn a_random_walk_is_observed_where_the_model_rises_as_it_does() {
        let white = Process::White(White::new(1e-4).unwrap());
        let walk = Process::RandomWalk(RandomWalk::new(1e-12).unwrap());
        let markov = |sigma: f64| {
            Process::GaussMarkov(GaussMarkov::new(1.0 / 30.0, sigma * sigma, 100.0).unwrap())
        };
        let with_walk = practical(vec![white, walk]);
        assert!(with_walk.walk_is_observed() && with_walk.walk_until_s.is_none());
        let hump = practical(vec![white, markov(3e-3)]);
        let until = hump.walk_until_s.unwrap();
        assert!(
            hump.walk_is_observed() && (60.0..600.0).contains(&until),
            "{until}"
        );
        let trace = practical(vec![white, markov(5e-5)]);
        assert!(!trace.walk_is_observed(), "{trace:?}");
        assert!(trace.parameters.walk.crossover_s().unwrap() < trace.range_s);
    }
}
