//! The model that is true is the one chosen.

use super::*;
use crate::imu::{Axis, Channel, Sensor};
use crate::noise::{Ar1, Composite, Process, RandomWalk, Synthesizer, White};
use crate::wavelet::{Convention, Tuning, both};
use crate::{ModelChoice, Outcome, Pool, Replicate, Trim, Weighting, calibrate, grouped, reasons};

fn settings() -> Settings {
    Settings {
        estimators: vec![Estimator::Awv],
        model: ModelChoice::Auto,
        limits: Vec::new(),
        trim: Trim::Count(0),
        tuning: Tuning::new(0.6, Convention::Exact).unwrap(),
        weighting: Weighting::Edof,
        fit_range: None,
        rate_hz: 1.0,
    }
}

fn outcome(set: u64, noise: &Composite) -> Outcome {
    let settings = settings();
    let channel = Channel { sensor: Sensor::Gyro, axis: Axis::X };
    let replicate = |run: u64| {
        let key = StreamKey { seed: set, scenario: "", run, source: "", process: "" };
        let mut signal = vec![0.0; 4096];
        Synthesizer::new(noise, key).fill(&mut signal);
        let (classical, robust) = both(&signal, 9, &settings.tuning).unwrap();
        (
            channel,
            Replicate {
                name: format!("run{run}"),
                axis: None,
                samples: 4096,
                classical,
                robust,
                trend: f64::NAN,
                mean: f64::NAN,
            },
        )
    };
    let groups = grouped((0..4).map(replicate).collect(), Pool::Axes);
    calibrate(&groups, &settings).unwrap().remove(0)
}

/// 8 sets each. The true model is refused with a probability of 1 % against one larger model, up to 5 % against the best
/// of five;
/// anything simpler is far off (the parts differ by factors at several scales). So 0.95·8 = 7.6 ± 0.62 sets choose
/// the truth; four deviations below are 5.1.
#[test]
fn the_truth_is_chosen() {
    let white = Process::White(White::new(1.0).unwrap());
    let walk = Process::RandomWalk(RandomWalk::new(1e-3).unwrap());
    let correlated = Process::Ar1(Ar1::new(0.95, 0.05).unwrap());
    for truth in [vec![white], vec![white, walk], vec![white, correlated]] {
        let noise = Composite::new(truth);
        let name = noise.processes.iter().map(Process::code).collect::<Vec<_>>().join("+");
        let chosen: Vec<String> = (0..8).map(|set| outcome(set, &noise).spec.to_string()).collect();
        let right = chosen.iter().filter(|c| **c == name).count();
        assert!(right >= 6, "{name}: {chosen:?}");
    }
}

#[test]
fn reasons_are_given() {
    let noise = Composite::new(vec![
        Process::White(White::new(1.0).unwrap()),
        Process::RandomWalk(RandomWalk::new(1e-3).unwrap()),
    ]);
    let ranking = outcome(3, &noise).ranking.unwrap();
    assert!(ranking.candidates.windows(2).all(|c| c[0].wvic() <= c[1].wvic()));
    let chosen = &ranking.candidates[ranking.chosen];
    assert!(chosen.optimism > 0.0 && chosen.objective > 0.0, "{chosen:?}");
    assert!(reasons(&ranking, 1.0)[0].contains("WN+RW"), "{ranking:?}");
    assert!(ranking.not_identifiable > 0);
}
