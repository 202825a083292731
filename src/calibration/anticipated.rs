//! Anticipated calibration: the intervals that recordings of a known IMU would give, of a given number and
//! length.
//!
//! The wavelet variances of each recording are drawn by the law of those of the model (as behind the intervals of a
//! calibration that was made, `uncertainty::bootstrap`); where parameters vary between recordings, those of each are drawn
//! first. The estimator and the fit are applied to the draws, whose scatter is that of estimates from such recordings. A
//! calibration that was made draws with the scatter that its own few recordings show, which varies, and is more often less than
//! more: the interval anticipated is the one that half of such calibrations exceed. Where a parameter hangs on the last scales
//! two in three are narrower.

use crate::curve::{CalibrationError, Estimator, Group, Replicate, Scope, average, implied};
use crate::fit::Fit;
use crate::imu::{Axis, Channel, Sensor};
use crate::model::ModelSpec;
use crate::noise::{Composite, Model, Process, ProcessKind, Spread};
use crate::outcome::{Bootstrap, CalibrationSettings, Inference, ModelChoice, Outcome};
use crate::pipeline::fit_curve;
use crate::uncertainty::bootstrap::{CurveSampler, ScatterSource, with_variances};
use crate::uncertainty::intervals::{intervals, practical_intervals, stretch};
use crate::wavelet::default_levels;
use rayon::prelude::*;

/// Recordings of an IMU that are planned.
#[derive(Debug, Clone, Copy)]
pub struct PlannedRecordings<'a> {
    /// The noise.
    pub model: &'a Model,
    /// Variation of its parameters between recordings; none: they do not vary.
    pub spread: Option<&'a Spread>,
    /// Number of recordings.
    pub recordings: usize,
    /// Samples of each.
    pub samples: usize,
}

impl PlannedRecordings<'_> {
    /// The outcomes of each sensor (of each axis where the axes differ): the model itself, with the intervals that
    /// would be expected, in the inference.
    ///
    /// # Errors
    /// When the recordings are too few for the estimator or too short for the model.
    pub fn outcomes(
        &self,
        estimator: Estimator,
        settings: &CalibrationSettings,
        scattering: ScatterSource,
        bootstrap: Bootstrap,
    ) -> Result<Vec<Outcome>, CalibrationError> {
        let settings = CalibrationSettings {
            estimators: vec![estimator],
            rate_hz: self.model.rate_hz,
            ..settings.clone()
        };
        let scopes = self.scopes();
        let of_scope =
            |scope: &Scope| self.outcome(*scope, estimator, &settings, scattering, bootstrap);
        scopes.par_iter().map(of_scope).collect()
    }

    /// The sensors, or their axes where these differ; those without noise are left out.
    fn scopes(&self) -> Vec<Scope> {
        let axis = |sensor, axis| self.model.axis(Channel { sensor, axis });
        let of_sensor = |sensor: Sensor| {
            let alike = Axis::ALL
                .iter()
                .all(|a| axis(sensor, *a) == axis(sensor, Axis::X));
            match alike {
                true => vec![Scope { sensor, axis: None }],
                false => Axis::ALL
                    .map(|a| Scope {
                        sensor,
                        axis: Some(a),
                    })
                    .to_vec(),
            }
        };
        let all = Sensor::ALL.into_iter().flat_map(of_sensor);
        all.filter(|scope| !self.model.axis(scope.channels()[0]).processes.is_empty())
            .collect()
    }

    fn outcome(
        &self,
        scope: Scope,
        estimator: Estimator,
        settings: &CalibrationSettings,
        scattering: ScatterSource,
        bootstrap: Bootstrap,
    ) -> Result<Outcome, CalibrationError> {
        let composite = in_order(self.model.axis(scope.channels()[0]));
        let group = self.expected(scope, &composite, estimator, settings)?;
        let spec = ModelSpec::of(composite.processes.iter().map(Process::kind));
        let settings = &CalibrationSettings {
            model: ModelChoice::Given(spec),
            ..settings.clone()
        };
        let curve = average(
            &group.replicates,
            estimator,
            settings.trim,
            &settings.tuning,
        )
        .map_err(group.named(estimator))?;
        let mut outcome = fit_curve(&group, estimator, curve, settings, &|_| {})?;
        // The fit is kept for its minima, from which the draws are fitted; the centre of the draws is the
        // model itself.
        outcome.fit.composite = composite;
        let name = scope.name();
        let sampler = CurveSampler::new(&name, &group.replicates, &outcome, settings);
        let draw = |run: usize| -> Result<Option<Fit>, CalibrationError> {
            let between = self.between(scope, run, &outcome, bootstrap)?;
            let generator = sampler.generator(bootstrap.seed, "anticipated", run);
            let curve = sampler.draw_with(generator, &between, scattering);
            Ok(curve.and_then(|curve| outcome.estimate_again(&curve, settings).ok()))
        };
        let fits: Vec<Option<Fit>> = (0..bootstrap.draws)
            .into_par_iter()
            .map(draw)
            .collect::<Result<_, _>>()?;
        let mut fits: Vec<Fit> = fits.into_iter().flatten().collect();
        let differ = self.differ_by(scope, &outcome, bootstrap)?;
        let spread = sampler.spread.as_ref().expect("of recordings");
        let stretches = spread.stated_where(&outcome.fit.composite, &outcome.curve, &differ);
        stretch(&mut fits, &stretches);
        outcome.inference = Some(Inference {
            draws: bootstrap.draws,
            fitted: fits.len(),
            drawn: fits.iter().map(|fit| fit.composite.clone()).collect(),
            intervals: intervals(&outcome, &fits, &stretches),
            practical: practical_intervals(&outcome, &fits, settings.rate_hz),
            goodness: None,
            spread: Vec::new(),
            alike: None,
            varying: Vec::new(),
            indistinct: None,
        });
        Ok(outcome)
    }

    /// Recordings whose wavelet variances are the expected ones.
    fn expected(
        &self,
        scope: Scope,
        composite: &Composite,
        estimator: Estimator,
        settings: &CalibrationSettings,
    ) -> Result<Group, CalibrationError> {
        let levels = 1..=default_levels(self.samples);
        let classical: Vec<f64> = levels.map(|level| composite.haar_wv(level)).collect();
        let template = Replicate {
            name: String::new(),
            axis: None,
            samples: self.samples,
            classical: Vec::new(),
            robust: Vec::new(),
            coverage: Vec::new(),
            trend: f64::NAN,
            mean: f64::NAN,
        };
        let group = |values: &[f64]| {
            let expected_replicate = |k: usize, channel: &Channel| Replicate {
                name: (k + 1).to_string(),
                axis: Some(channel.axis),
                ..with_variances(&template, values.to_vec())
            };
            let channels = scope.channels();
            let replicates = channels
                .iter()
                .flat_map(|c| (0..self.recordings).map(move |k| (k, c)));
            Group {
                scope,
                replicates: replicates.map(|(k, c)| expected_replicate(k, c)).collect(),
            }
        };
        let first = group(&classical);
        // what a robust variance reads of quantization noise is known once there is a curve
        let curve = average(
            &first.replicates,
            estimator,
            settings.trim,
            &settings.tuning,
        )
        .map_err(first.named(estimator))?;
        Ok(group(&implied(composite, &curve)))
    }

    /// Standard deviation of ln nu by which recordings differ, level by level, from a few draws of them.
    fn differ_by(
        &self,
        scope: Scope,
        outcome: &Outcome,
        bootstrap: Bootstrap,
    ) -> Result<Vec<f64>, CalibrationError> {
        // 50 sets of K signals give each deviation to 1/√(100 K), at most 10 %: enough for the degrees of
        // freedom.
        const DRAWS: usize = 50;
        let drawn = (0..DRAWS).map(|run| self.between(scope, run, outcome, bootstrap));
        let signals: Vec<Vec<f64>> = drawn.collect::<Result<Vec<_>, _>>()?.concat();
        let deviation = |j: usize| {
            // About the model and not about their own mean, so that a departure common to all counts as well.
            let squares: f64 = signals.iter().map(|ratios| ratios[j].ln().powi(2)).sum();
            (squares / signals.len() as f64).sqrt()
        };
        Ok((0..outcome.curve.levels.len()).map(deviation).collect())
    }

    /// Wavelet variance of each signal of a draw over that of the model, `[signal][level]`.
    fn between(
        &self,
        scope: Scope,
        run: usize,
        outcome: &Outcome,
        bootstrap: Bootstrap,
    ) -> Result<Vec<Vec<f64>>, CalibrationError> {
        let curve = &outcome.curve;
        let centre = implied(&outcome.fit.composite, curve);
        let Some(spread) = self.spread else {
            return Ok(vec![
                vec![1.0; centre.len()];
                self.recordings * scope.channels().len()
            ]);
        };
        let recorded = (0..self.recordings).map(|k| {
            spread.draw(
                self.model,
                bootstrap.seed,
                (run * self.recordings + k) as u64,
            )
        });
        let recorded: Vec<Model> = recorded.collect();
        let ratio = |model: &Model, channel: Channel| {
            let own = implied(&in_order(model.axis(channel)), curve);
            own.iter()
                .zip(&centre)
                .map(|(own, centre)| own / centre)
                .collect()
        };
        let channels = scope.channels();
        Ok(channels
            .iter()
            .flat_map(|c| recorded.iter().map(move |m| ratio(m, *c)))
            .collect())
    }
}

/// The processes in the order of fitted models: by kind, those of a kind by correlation time.
fn in_order(composite: &Composite) -> Composite {
    let mut processes = composite.processes.clone();
    processes.sort_by(|a, b| {
        // phi rises with the correlation time, beta falls.
        let time = |p: &Process| match p.kind() {
            ProcessKind::GaussMarkov => -p.shape(),
            _ => p.shape(),
        };
        a.kind().cmp(&b.kind()).then(time(a).total_cmp(&time(b)))
    });
    Composite::new(processes)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::calibrate;
    use crate::noise::{ParameterDistribution, Variation};
    use crate::tests::*;

    const RECORDINGS: usize = 4;
    const SAMPLES: usize = 2048;

    fn model() -> Model {
        let axis = white_and_walk(1.0, 1e-3);
        Model::pooled(1.0, &axis, &axis)
    }

    /// Parameters that differ from recording to recording, on each axis for itself.
    fn spread(parameters: &[(&str, &str)], law: ParameterDistribution) -> Spread {
        let axis = model().axes[0].clone();
        let variation = |(p, key): &(&str, &str)| Variation::new(&axis, p, key, law).unwrap();
        let laws: Vec<Variation> = parameters.iter().map(variation).collect();
        Spread {
            axes: std::array::from_fn(|_| laws.clone()),
        }
    }

    /// Half the width of the logarithm of an interval.
    fn half(outcome: &Outcome) -> f64 {
        let interval = &outcome.inference.as_ref().unwrap().intervals[0];
        0.5 * (interval.high / interval.low).ln()
    }

    /// Standard deviations of the logarithms of sigma2 and gamma2.
    fn scatter(composites: &[Composite]) -> [f64; 2] {
        std::array::from_fn(|i| {
            let logs = composites.iter().map(|c| c.processes[i].values()[0].ln());
            let n = composites.len() as f64;
            let mean = logs.clone().sum::<f64>() / n;
            (logs.map(|x| (x - mean).powi(2)).sum::<f64>() / (n - 1.0)).sqrt()
        })
    }

    fn anticipated(spread: Option<&Spread>, samples: usize, scattering: ScatterSource) -> Outcome {
        let model = model();
        let plan = PlannedRecordings {
            model: &model,
            spread,
            recordings: RECORDINGS,
            samples,
        };
        let bootstrap = Bootstrap {
            draws: 400,
            seed: 1,
        };
        plan.outcomes(Estimator::Awv, &settings("WN+RW"), scattering, bootstrap)
            .unwrap()
            .remove(0)
    }

    /// By force: recordings made and calibrated, 150 times. Its scatter is known to 1/√300 = 5.8 %, that of 400 draws to
    /// 3.5 %: four of both together are 27 %.
    #[test]
    fn fits_scatter_as_those_of_recordings_that_are_made() {
        let model = model();
        let settings = settings("WN+RW");
        let made = |seed: u64| {
            let (imu, accel) = (imu(&model, None, seed), Channel::named("accel"));
            let groups = recorded(&imu, RECORDINGS as u64, &accel, SAMPLES, &settings);
            calibrate(&groups, &settings)
                .unwrap()
                .remove(0)
                .fit
                .composite
        };
        let forced = scatter(&(0..150).map(made).collect::<Vec<_>>());
        let planned = anticipated(None, SAMPLES, ScatterSource::All);
        let drawn = scatter(&planned.inference.unwrap().drawn);
        // Stretched by Student's quantile of 11 degrees and the median deviation that 12 signals show.
        let stretch = 2.200_985 / 1.959_964 * (10.340_998_f64 / 11.0).sqrt();
        let expected = forced.map(|deviation| stretch * deviation);
        assert_relative_eq!(drawn[..], expected[..], max_relative = 0.27);
    }

    /// Where four recordings differ at every scale, their differences are known to 3 degrees of freedom: an interval is t₀.₉₇₅(3) = 3.1824 deviations
    /// either way, of a deviation of which half of all calibrations show √(2.3660/3) or less. With 0.1/√12 for the mean of 12,
    /// 0.0816; the ends by 400 draws are known to √(p(1 − p)/400)/f(z) = 0.134 deviations, half their distance to 4.8 %.
    #[test]
    fn few_recordings_widen_intervals_by_students_law() {
        let both = [("WN", "sigma2"), ("RW", "gamma2")];
        let spread = spread(&both, ParameterDistribution::Normal { sd: 0.1 });
        let endless = anticipated(Some(&spread), 1 << 16, ScatterSource::BetweenRecordings);
        let stretch = 3.182_446 / 1.959_964 * (2.365_974_f64 / 3.0).sqrt();
        let expected = 1.959_964 * stretch * 0.1 / 12.0_f64.sqrt();
        assert_relative_eq!(half(&endless), expected, max_relative = 4.0 * 0.048);
    }

    /// Half widths of the logarithm of sigma2: anticipated, and in the median of 120 laboratories of 4 recordings of three axes whose
    /// white noise differs by a log-sd of 0.3. Deviations from 3 degrees of freedom scatter by 0.39/0.92 = 42 %, the median of 120
    /// by 1.25·42 %/√120 = 5 %; the ends by 400 draws by 7 %: twice both are 17 %.
    #[test]
    fn laboratories_state_what_was_anticipated() {
        let law = ParameterDistribution::Lognormal {
            median: 1.0,
            sd: 0.3,
            median_ci95: None,
            sd_ci95: None,
        };
        let spread = spread(&[("WN", "sigma2")], law);
        let planned = half(&anticipated(Some(&spread), SAMPLES, ScatterSource::All));
        let model = model();
        let laboratory = |seed: u64| {
            let (imu, accel) = (imu(&model, Some(&spread), seed), Channel::named("accel"));
            let settings = settings("WN+RW");
            let groups = recorded(&imu, RECORDINGS as u64, &accel, SAMPLES, &settings);
            half(&inferred(&groups, &settings, 100, 1))
        };
        let mut stated: Vec<f64> = (0..120).into_par_iter().map(laboratory).collect();
        stated.sort_by(f64::total_cmp);
        assert_relative_eq!(planned, stated[60], max_relative = 0.17);
    }
}
