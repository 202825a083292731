//! The effect of one shock on the classical wavelet variance, and its absence in the robust one.
#![expect(clippy::print_stdout, reason = "an example shows its results")]

use nav_sim::signal::noise::{Composite, Process, Synthesizer};
use nav_sim::signal::rng::StreamKey;
use nav_sim::signal::wavelet::{Tuning, classical_and_robust};

pub(crate) fn main() -> Result<(), Box<dyn std::error::Error>> {
    // N1 of Minaretzis et al. 2024 for an accelerometer, per sample at 100 Hz
    let noise = Composite::new(vec![
        Process::white(5.2e-5)?,
        Process::ar1(0.986, 1.5e-8)?,
        Process::random_walk(3.3e-11)?,
    ]);
    let key = StreamKey {
        seed: 1,
        scenario: "",
        run: 0,
        source: "accel.x",
        process: "",
    };
    let mut signal = vec![0.0; 1 << 17];
    Synthesizer::new(&noise, key).fill(&mut signal);
    signal[60_000..60_020].fill(1.0); // someone knocks at the table: 1 m/s² for 0.2 s

    let tuning = Tuning::new(0.6)?;
    let (classical, robust) = classical_and_robust(&signal, 14, &tuning)?;
    println!(
        "{:>8} {:>12} {:>12} {:>12}",
        "tau (s)", "theory", "classical", "robust"
    );
    for level in 1..=14_u32 {
        let (tau_s, i) = (f64::from(level).exp2() / 100.0, level as usize - 1);
        let theory = noise.haar_wv(level);
        println!(
            "{tau_s:8.2} {theory:12.3e} {:12.3e} {:12.3e}",
            classical[i], robust[i].value
        );
    }
    // At the scale of the shock the classical one is off by an order of magnitude.
    let theory = noise.haar_wv(5);
    assert!(classical[4] > 3.0 * theory && (robust[4].value / theory - 1.0).abs() < 0.2);
    Ok(())
}
