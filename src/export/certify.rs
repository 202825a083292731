//! The closure certificate of an export: recordings of the exported pair, as long as those that were calibrated, against the
//! model's own curve.

use super::Export;
use crate::formats::model_file::ModelFile;
use crate::jobs::JobError;
use nav_sim_signal::imu::{Channel, Sensor};
use nav_sim_signal::noise::practical::Pair;
use nav_sim_signal::noise::{
    Composite, GaussMarkov, Model, ParameterError, Process, RandomWalk, Synthesizer, White,
    continuous,
};
use nav_sim_signal::rng::StreamKey;
use nav_sim_signal::wavelet::{classical, default_levels, interval};
use rayon::prelude::*;

/// The recordings that are made.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Recorded {
    /// How many.
    pub recordings: u64,
    /// Samples of each.
    pub samples: usize,
    /// Seed of their noise.
    pub seed: u64,
}

impl Recorded {
    /// As many recordings, and as long, as the calibration of a model had; else four of 16 times the horizon (s).
    #[must_use]
    pub(crate) fn like(file: &ModelFile, seed: u64, horizon_s: f64) -> Self {
        const MOST: usize = 1 << 22;
        let recordings = file
            .most_of_fits("recordings")
            .filter(|n| *n > 0)
            .map_or(4, i64::unsigned_abs);
        // A recording has one scale more than is used.
        let samples = file
            .most_of_fits("scales")
            .filter(|n| (1..40).contains(n))
            .map_or_else(
                || ((16.0 * horizon_s * file.model.rate_hz) as usize).next_power_of_two(),
                |scales| 1_usize << (scales + 1),
            );
        Self {
            recordings,
            samples: samples.min(MOST),
            seed,
        }
    }
}

/// What recordings of the exported pair say at one scale.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct CertifiedScale {
    /// Averaging time (s), half the scale.
    pub average_s: f64,
    /// Allan deviation of the model (its largest axis) over that of the recordings.
    pub ratio: f64,
    /// Whether the model lies within their band.
    pub inside: bool,
}

/// The certificate of one sensor.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub(crate) struct Certificate {
    /// The sensor.
    pub sensor: Sensor,
    /// The scales whose averaging times the horizon holds.
    pub scales: Vec<CertifiedScale>,
}

impl Certificate {
    /// Of the scales at which the model lies outside the band, the one with the ratio furthest from 1.
    #[must_use]
    pub(crate) fn worst(&self) -> Option<CertifiedScale> {
        let outside = self.scales.iter().copied().filter(|s| !s.inside);
        outside.max_by(|a, b| a.ratio.ln().abs().total_cmp(&b.ratio.ln().abs()))
    }
}

/// Synthesises recordings of the exported pairs, takes the average of their classical wavelet variances with its band, and sees
/// whether the model lies within. The band holds 95 % of all scales together (Bonferroni).
///
/// # Errors
/// When a pair is no noise model, or the recordings are too short.
pub(crate) fn certify(
    export: &Export,
    model: &Model,
    missing: &[Channel],
    recorded: Recorded,
) -> Result<Vec<Certificate>, JobError> {
    let of_sensor = |s: &crate::export::SensorExport| {
        let is_of_sensor = |c: &Channel| c.sensor == s.sensor && !missing.contains(c);
        let axes: Vec<&Composite> = Channel::ALL
            .iter()
            .filter(|c| is_of_sensor(c))
            .map(|c| model.axis(*c))
            .collect();
        let pair = composite(&s.exported, model.rate_hz).map_err(JobError::Pair)?;
        let levels = default_levels(recorded.samples);
        let horizon = export.settings.horizon;
        let average_s = |level: u32| f64::from(level - 1).exp2() / model.rate_hz;
        let usable: Vec<u32> = (1..=levels)
            .filter(|level| (horizon.from_s..=horizon.to_s).contains(&average_s(*level)))
            .collect();
        let variances = variances(&pair, s.sensor, levels, recorded)?;
        let confidence = 1.0 - 0.05 / usable.len().max(1) as f64;
        let scale = |level: u32| {
            let mean = variances
                .iter()
                .map(|nu| nu[level as usize - 1])
                .sum::<f64>()
                / variances.len() as f64;
            let edof = recorded.recordings as f64 * interval::edof_eta3(recorded.samples, level);
            let (low, high) = interval::interval(mean, edof, confidence);
            let largest = axes
                .iter()
                .map(|axis| axis.haar_wv(level))
                .fold(0.0, f64::max);
            CertifiedScale {
                average_s: average_s(level),
                ratio: (largest / mean).sqrt(),
                inside: (low..=high).contains(&largest),
            }
        };
        Ok(Certificate {
            sensor: s.sensor,
            scales: usable.into_iter().map(scale).collect(),
        })
    };
    export.sensors.iter().map(of_sensor).collect()
}

/// Classical wavelet variances of recordings of a pair.
fn variances(
    pair: &Composite,
    sensor: Sensor,
    levels: u32,
    recorded: Recorded,
) -> Result<Vec<Vec<f64>>, JobError> {
    let recording_variances = |run: u64| {
        let (seed, source) = (recorded.seed, sensor.name());
        let key = StreamKey {
            seed,
            scenario: "certify",
            run,
            source,
            process: "",
        };
        let mut signal = vec![0.0; recorded.samples];
        Synthesizer::new(pair, key).fill(&mut signal);
        Ok(classical(&signal, levels)?)
    };
    (0..recorded.recordings)
        .into_par_iter()
        .map(recording_variances)
        .collect()
}

/// The pair as a noise model.
fn composite(pair: &Pair, rate_hz: f64) -> Result<Composite, ParameterError> {
    let mut processes = vec![Process::White(White::new(
        pair.density * pair.density * rate_hz,
    )?)];
    if pair.walk > 0.0 {
        processes.push(Process::RandomWalk(RandomWalk::new(
            continuous::walk_gamma2(pair.walk, rate_hz),
        )?));
    }
    if let Some(m) = pair.markov.filter(|m| m.sigma > 0.0) {
        let (beta, s2) = (m.t_corr_s.recip(), m.sigma * m.sigma);
        processes.push(Process::GaussMarkov(GaussMarkov::new(beta, s2, rate_hz)?));
    }
    Ok(Composite::new(processes))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::export::{Settings, Target};
    use nav_sim_signal::noise::Ar1;
    use nav_sim_signal::noise::practical::{Horizon, Policy};

    /// As many and as long as those of the calibration; a recording of 2^(J+1) samples has J scales that are used. Else 16
    /// horizons, so that the longest average is seen eight times and more.
    #[test]
    fn recordings_are_like_those_of_the_calibration() {
        let axis = Composite::new(vec![Process::White(White::new(1e-4).unwrap())]);
        let mut file = ModelFile {
            model: Model::pooled(100.0, &axis, &axis),
            missing: Vec::new(),
            turn_on: None,
            spread: None,
            intervals: Vec::new(),
            provenance: None,
        };
        assert_eq!(
            Recorded::like(&file, 7, 100.0),
            Recorded {
                recordings: 4,
                samples: 1 << 18,
                seed: 7
            }
        );
        file.provenance =
            toml::from_str("fits = [{ recordings = 6, scales = 14 }, { scales = 15 }]").ok();
        assert_eq!(
            Recorded::like(&file, 7, 100.0),
            Recorded {
                recordings: 6,
                samples: 1 << 16,
                seed: 7
            }
        );
    }

    /// White noise and random walk are the pair: within its band. With an AR1 of ten times the white noise's variance at 10 s left
    /// out (strict) the model is above it there: Allan deviation ratio by the closed forms.
    #[test]
    fn a_pair_certifies_itself_and_nothing_else() {
        let white = Process::White(White::new(1e-4).unwrap());
        let walk = Process::RandomWalk(RandomWalk::new(1e-10).unwrap());
        let bias = Process::Ar1(Ar1::new(0.999, 2e-9).unwrap());
        let settings = Settings {
            policy: Policy::Strict,
            horizon: Horizon::default(),
            range_s: 1e3,
            turn_on: [None; 2],
            misfit: None,
        };
        let recorded = Recorded {
            recordings: 4,
            samples: 1 << 18,
            seed: 1,
        };
        let certificates = |processes: Vec<Process>| {
            let axis = Composite::new(processes);
            let model = Model::pooled(100.0, &axis, &axis);
            let export = Export::new(Target::Kalibr, &model, &[], settings.clone()).unwrap();
            (certify(&export, &model, &[], recorded).unwrap(), axis)
        };
        for certificate in certificates(vec![white, walk]).0 {
            assert_eq!((certificate.scales.len(), certificate.worst()), (7, None));
        }
        let (found, axis) = certificates(vec![white, walk, bias]);
        let pair = Composite::new(vec![white, walk]);
        for certificate in found {
            let worst = certificate.worst().unwrap();
            let samples = (worst.average_s * 100.0).round() as u32;
            let exact = (axis.allan_variance(samples) / pair.allan_variance(samples)).sqrt();
            // Known to √(1/(2·edof)) of four recordings: at the longest, 2^14 samples, edof = 4·15.
            assert!(
                (worst.ratio / exact - 1.0).abs() < 4.0 * (1.0_f64 / (2.0 * 60.0)).sqrt(),
                "{worst:?} {exact}"
            );
        }
    }
}
