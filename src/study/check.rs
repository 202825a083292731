//! Whether a study means a grid.

use super::description::{CalibrateStep, Study, Synthesis};
use super::error::DescriptionError;
use super::rules::{exactly_one, unique};
use nav_sim_calibration::{Estimator, ModelSpec};
use nav_sim_navigation::scenario::{MAX_RUNS, Method};
use nav_sim_signal::imu::MAX_RATE_HZ;
use nav_sim_signal::wavelet::Tuning;
use std::path::PathBuf;

impl Study {
    /// Fills in names and defaults, and checks all that can be checked without opening another file.
    ///
    /// # Errors
    /// The key that is refused.
    pub(crate) fn resolve(&mut self) -> Result<(), DescriptionError> {
        self.name_all();
        self.check_numbers()?;
        self.check_axes()?;
        for (axis, names) in self.names() {
            unique(axis, &names.into_iter().enumerate().collect::<Vec<_>>())?;
        }
        self.check_filters()?;
        self.outage_sets().map(|_| ())
    }

    fn name_all(&mut self) {
        self.trajectory
            .iter_mut()
            .for_each(|e| name_after(&mut e.name, Some(&e.file)));
        for e in &mut self.truth {
            let synthesised = e.synthesize.as_ref().map(|s| &s.model);
            name_after(
                &mut e.name,
                e.model.as_ref().or(e.recordings.first()).or(synthesised),
            );
        }
        for e in &mut self.candidate {
            let synthesised = e
                .calibrate
                .as_ref()
                .and_then(|c| c.synthesize.as_ref())
                .map(|s| &s.model);
            let recorded = e.calibrate.as_ref().and_then(|c| c.recordings.first());
            name_after(&mut e.name, e.model.as_ref().or(recorded).or(synthesised));
        }
        self.scenario
            .iter_mut()
            .for_each(|e| name_after(&mut e.name, e.file.as_ref()));
        self.gnss
            .iter_mut()
            .for_each(|e| name_after(&mut e.name, e.file.as_ref()));
        for e in self.outages.iter_mut().filter(|e| e.name.is_empty()) {
            let kinds = [
                ("windows", e.windows.is_some()),
                ("sweep", e.sweep.is_some()),
                ("periodic", e.periodic.is_some()),
                ("random", e.random.is_some()),
            ];
            e.name = kinds
                .iter()
                .find(|(_, is_given)| *is_given)
                .map_or(String::new(), |(n, _)| (*n).to_owned());
        }
    }

    fn check_numbers(&self) -> Result<(), DescriptionError> {
        let refuse = |key: &str, value: String, reason: &str| {
            Err(DescriptionError::refused(key, value, reason))
        };
        if self.schema != 1 {
            return refuse(
                "schema",
                self.schema.to_string(),
                "is not a layout this version reads: it reads 1",
            );
        }
        if self.runs == 0 || self.runs > MAX_RUNS {
            let reason = format!("must lie between 1 and {MAX_RUNS}");
            return refuse("runs", self.runs.to_string(), &reason);
        }
        if self.unit_runs == Some(0) {
            return refuse("unit_runs", "0".into(), "must be at least 1");
        }
        if self.method == Method::Both {
            let reason = "is not a method of studies; use \"monte-carlo\" or \"lincov\"";
            return refuse("method", format!("\"{}\"", self.method.name()), reason);
        }
        if self.metrics.is_empty() {
            return refuse(
                "metrics",
                "[]".into(),
                "is empty; choose of outages, ratios, epochs",
            );
        }
        Ok(())
    }

    /// Every axis has something, and every entry says one thing.
    fn check_axes(&self) -> Result<(), DescriptionError> {
        let empty = |key: &str, is_given: bool| match is_given {
            true => Ok(()),
            false => Err(DescriptionError::Empty {
                axis: key.to_owned(),
            }),
        };
        empty("trajectory", !self.trajectory.is_empty())?;
        empty("truth", !self.truth.is_empty())?;
        empty("candidate", !self.candidate.is_empty())?;
        for (i, e) in self.truth.iter().enumerate() {
            let said = [
                e.model.is_some(),
                !e.recordings.is_empty(),
                e.synthesize.is_some(),
            ];
            let key = format!("truth[{}]", i + 1);
            exactly_one(key.clone(), &said, "model, recordings, synthesize")?;
            check_rate(&key, e.rate_hz)?;
            if e.each && e.recordings.is_empty() {
                return Err(DescriptionError::refused(
                    &format!("{key}.each"),
                    true,
                    "is of recordings",
                ));
            }
        }
        self.check_truth_is_modelled()?;
        for (i, e) in self.candidate.iter().enumerate() {
            let key = format!("candidate[{}]", i + 1);
            exactly_one(
                key.clone(),
                &[e.model.is_some(), e.calibrate.is_some()],
                "model, calibrate",
            )?;
            let Some(step) = &e.calibrate else { continue };
            let said = [!step.recordings.is_empty(), step.synthesize.is_some()];
            exactly_one(format!("{key}.calibrate"), &said, "recordings, synthesize")?;
            self.check_leave_out(&format!("{key}.calibrate.leave_out"), step)?;
            check_rate(&format!("{key}.calibrate"), step.rate_hz)?;
            let (least, most) = Tuning::EFFICIENCIES;
            if !(least..=most).contains(&step.efficiency) {
                let reason = format!("is not between {least} and {most}");
                let key = format!("{key}.calibrate.efficiency");
                return Err(DescriptionError::refused(&key, step.efficiency, reason));
            }
            if let Err(source) = step.fit.parse::<ModelSpec>() {
                let (key, fit) = (format!("{key}.calibrate.fit"), step.fit.clone());
                return Err(DescriptionError::NotModel {
                    key,
                    fit,
                    source: Box::new(source),
                });
            }
            let key = format!("{key}.calibrate.estimators");
            empty(&key, !step.estimators.is_empty())?;
            if step.estimators.contains(&Estimator::Given) {
                let reason = "is of curves that come from elsewhere";
                return Err(DescriptionError::refused(&key, "\"given\"", reason));
            }
        }
        for (i, e) in self.scenario.iter().enumerate() {
            let said = [e.file.is_some(), e.settings.is_some()];
            exactly_one(format!("scenario[{}]", i + 1), &said, "file, settings")?;
        }
        for (i, e) in self.gnss.iter().enumerate() {
            let said = [e.file.is_some(), e.settings.is_some()];
            exactly_one(format!("gnss[{}]", i + 1), &said, "file, settings")?;
        }
        let syntheses = self.syntheses();
        match syntheses
            .iter()
            .find(|(_, s)| s.replicates == 0 || s.samples < Synthesis::LEAST_SAMPLES)
        {
            Some((key, s)) => {
                let value = format!("{} of {} samples", s.replicates, s.samples);
                Err(DescriptionError::refused(
                    key,
                    value,
                    "cannot be made: at least 1 of 2 samples",
                ))
            }
            None => Ok(()),
        }
    }

    /// What is left out of recordings must be recordings.
    fn check_leave_out(&self, key: &str, step: &CalibrateStep) -> Result<(), DescriptionError> {
        let refuse = |reason: &str| Err(DescriptionError::refused(key, true, reason));
        match step.leave_out {
            true if step.recordings.is_empty() => {
                refuse("is of recordings; those of synthesize have no files")
            }
            true if self.truth.iter().any(|e| e.recordings.is_empty()) => {
                refuse("needs recordings in every truth: they are what is left out")
            }
            _ => Ok(()),
        }
    }

    /// Covariance analysis needs the law of the errors, which recordings do not have.
    fn check_truth_is_modelled(&self) -> Result<(), DescriptionError> {
        let recorded = self.truth.iter().position(|e| e.model.is_none());
        match recorded {
            Some(i) if !self.is_sampled() => Err(DescriptionError::NoModel { entry: i + 1 }),
            _ => Ok(()),
        }
    }

    /// No filter twice: its columns could not be told apart.
    fn check_filters(&self) -> Result<(), DescriptionError> {
        match self
            .filters
            .iter()
            .enumerate()
            .find(|(i, f)| self.filters[..*i].contains(f))
        {
            Some((_, filter)) => {
                let twice = serde_json::to_string(filter).unwrap_or_default();
                let shown = serde_json::to_string(&self.filters).unwrap_or_default();
                Err(DescriptionError::refused(
                    "filters",
                    shown,
                    format!("names {twice} twice"),
                ))
            }
            None => Ok(()),
        }
    }

    /// Names of every axis.
    fn names(&self) -> [(&'static str, Vec<&str>); 6] {
        [
            (
                "trajectory",
                self.trajectory.iter().map(|e| e.name.as_str()).collect(),
            ),
            (
                "truth",
                self.truth.iter().map(|e| e.name.as_str()).collect(),
            ),
            (
                "candidate",
                self.candidate.iter().map(|e| e.name.as_str()).collect(),
            ),
            (
                "scenario",
                self.scenario.iter().map(|e| e.name.as_str()).collect(),
            ),
            ("gnss", self.gnss.iter().map(|e| e.name.as_str()).collect()),
            (
                "outages",
                self.outages.iter().map(|e| e.name.as_str()).collect(),
            ),
        ]
    }
}

/// The file's name without its ending, where no name was given.
fn name_after(name: &mut String, file: Option<&PathBuf>) {
    if name.is_empty()
        && let Some(stem) = file.and_then(|f| f.file_stem())
    {
        *name = stem.to_string_lossy().into_owned();
    }
}

/// Refuses what is no rate of recordings.
fn check_rate(entry: &str, rate_hz: Option<f64>) -> Result<(), DescriptionError> {
    match rate_hz {
        Some(rate_hz) if !(rate_hz > 0.0 && rate_hz <= MAX_RATE_HZ) => {
            let reason = format!("is not a rate: it must be > 0 and at most {MAX_RATE_HZ}");
            Err(DescriptionError::refused(
                &format!("{entry}.rate_hz"),
                rate_hz,
                reason,
            ))
        }
        _ => Ok(()),
    }
}
