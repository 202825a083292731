//! Eight replicates, one of them abnormal: three estimators, three models.
#![expect(clippy::print_stdout, reason = "an example shows its results")]

use nav_sim::calibration::{Estimator, ModelSpec, Replicate, Trim, Weighting, average, fit};
use nav_sim::signal::noise::{Composite, Process, ProcessKind, Synthesizer};
use nav_sim::signal::rng::StreamKey;
use nav_sim::signal::wavelet::{Tuning, classical_and_robust};

const SAMPLES: usize = 1 << 16;
const LEVELS: u32 = 15;

fn n1(gamma2: f64) -> Result<Composite, Box<dyn std::error::Error>> {
    Ok(Composite::new(vec![
        Process::white(5.2e-5)?,
        Process::ar1(0.986, 1.5e-8)?,
        Process::random_walk(gamma2)?,
    ]))
}

/// The wavelet variances of one recording; the last has a random walk a hundred times as strong.
fn replicate(k: u64, tuning: &Tuning) -> Result<Replicate, Box<dyn std::error::Error>> {
    let noise = n1(if k == 7 { 3.3e-9 } else { 3.3e-11 })?;
    let key = StreamKey {
        seed: 1,
        scenario: "",
        run: k,
        source: "accel.x",
        process: "",
    };
    let mut signal = vec![0.0; SAMPLES];
    Synthesizer::new(&noise, key).fill(&mut signal);
    let (classical, robust) = classical_and_robust(&signal, LEVELS, tuning)?;
    Ok(Replicate {
        name: format!("replicate {}", k + 1),
        axis: None,
        samples: SAMPLES,
        classical,
        robust,
        coverage: Vec::new(),
        trend: f64::NAN,
        mean: f64::NAN,
    })
}

pub(crate) fn main() -> Result<(), Box<dyn std::error::Error>> {
    let tuning = Tuning::new(0.6)?;
    let replicates = (0..8)
        .map(|k| replicate(k, &tuning))
        .collect::<Result<Vec<_>, _>>()?;
    let mut gamma2 = Vec::new();
    println!("random-walk variance of seven replicates: 3.3e-11, of the eighth: 3.3e-9");
    for estimator in [Estimator::Awv, Estimator::SrAwv, Estimator::DrAwv] {
        let curve = average(&replicates, estimator, Trim::Count(2), &tuning)?;
        let fitted = fit(&curve, &ModelSpec::n1(), 100.0, Weighting::Edof)?;
        let walk = fitted.composite.amplitude_of(ProcessKind::RandomWalk);
        println!("{:8} finds {:.1e}", estimator.name(), walk);
        gamma2.push(walk);
    }
    // The mean over replicates is pulled away by the abnormal one, the trimmed mean is not.
    assert!(gamma2[0] > 1e-10 && gamma2[2] < 1e-10);
    Ok(())
}
