//! Files of estimator studies (TOML), the input of `nav-sim efficiency`.
//!
//! ```toml
//! schema = 1
//! model = "n1.toml"                        # model file with [spread]; relative to this file
//! axis = "accel.x"                         # the axis studied (default)
//! fit = "N1"                               # what is fitted
//! replicates = 8                           # K, a set
//! samples = 524284                         # T, of a replicate
//! levels = 17                              # J (default: floor(log2 T) − 1)
//! sets = 500                               # H
//! seed = 1                                 # default: --seed, or drawn
//! scenarios = ["section4-I", "clean.toml"] # contaminations: names, or files relative to this one
//! estimators = ["awv", "sr-awv", "dr-awv"] # default: these; also avlr (models of WN, QN, RW, DR)
//! trim = 2                                 # replicates that dr-awv drops at each end (default: 30 %)
//! efficiency = 0.6                         # of the robust wavelet variance (default)
//! weighting = "model"                      # weights of the scales, as of calibrate (default)
//! ```

use crate::formats::toml_file::{Source, Version};
use crate::formats::{FileError, contamination_file, model_file};
use nav_sim_calibration::efficiency::Design;
use nav_sim_calibration::{AverageError, Estimator, Trim, Weighting};
use nav_sim_signal::imu::Channel;
use nav_sim_signal::noise::Kind;
use nav_sim_signal::noise::contamination::Contamination;
use nav_sim_signal::wavelet::{Convention, Tuning, default_levels, max_levels};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

/// A study, read.
#[derive(Debug, Clone, PartialEq)]
pub struct StudyFile {
    /// The design; its seed is the file's, or 0.
    pub design: Design,
    /// The seed of the file.
    pub seed: Option<u64>,
    /// Sets of replicates, H.
    pub sets: u64,
    /// The model file.
    pub model: PathBuf,
}

/// Monte-Carlo study of estimators: nav-sim efficiency
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(title = "Study")]
struct Description {
    /// Version of the layout
    #[serde(rename = "schema")]
    _schema: Option<Version>,
    /// Model file with `[spread]`, relative to this file
    model: String,
    /// The axis studied: accel.x (default) … gyro.z
    axis: Option<String>,
    /// What is fitted, such as N1
    fit: String,
    /// Replicates of a set, K
    #[schemars(range(min = 1, max = MOST))]
    replicates: u64,
    /// Samples of a replicate, T
    #[schemars(range(min = 4, max = MOST))]
    samples: u64,
    /// Scales, J (default: floor(log2 T) - 1)
    #[schemars(range(min = 1))]
    levels: Option<u64>,
    /// Sets of replicates, H
    #[schemars(range(min = 1, max = MOST))]
    sets: u64,
    /// Seed (default: --seed, or drawn)
    seed: Option<u64>,
    /// Contaminations: names, or files relative to this one
    #[schemars(length(min = 1), extend("uniqueItems" = true))]
    scenarios: Vec<String>,
    /// Estimators (default: awv, sr-awv, dr-awv)
    #[serde(default = "default_estimators")]
    #[schemars(length(min = 1), extend("uniqueItems" = true))]
    estimators: Vec<AveragingEstimator>,
    /// Replicates that dr-awv drops at each end (default: 30 %)
    trim: Option<u64>,
    /// Efficiency of the robust wavelet variance
    #[serde(default = "efficiency")]
    #[schemars(range(min = Tuning::EFFICIENCIES.0, max = Tuning::EFFICIENCIES.1))]
    efficiency: f64,
    /// Weights of the scales (default: as of calibrate)
    #[serde(default)]
    weighting: Weights,
}

/// Weights of the scales that can be studied.
#[derive(Debug, Clone, Copy, Default, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
#[schemars(inline)]
enum Weights {
    #[default]
    Model,
    Edof,
}

impl From<Weights> for Weighting {
    fn from(weights: Weights) -> Self {
        match weights {
            Weights::Model => Self::Model,
            Weights::Edof => Self::Edof,
        }
    }
}

/// An estimator that averages several replicates.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize, Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
#[schemars(inline)]
enum AveragingEstimator {
    Awv,
    SrAwv,
    DrAwv,
    Avlr,
}

impl From<AveragingEstimator> for Estimator {
    fn from(estimator: AveragingEstimator) -> Self {
        match estimator {
            AveragingEstimator::Awv => Self::Awv,
            AveragingEstimator::SrAwv => Self::SrAwv,
            AveragingEstimator::DrAwv => Self::DrAwv,
            AveragingEstimator::Avlr => Self::Avlr,
        }
    }
}

fn default_estimators() -> Vec<AveragingEstimator> {
    vec![
        AveragingEstimator::Awv,
        AveragingEstimator::SrAwv,
        AveragingEstimator::DrAwv,
    ]
}

const fn efficiency() -> f64 {
    Tuning::DEFAULT_EFFICIENCY
}

/// The JSON schema of a study file.
#[must_use]
pub(crate) fn schema() -> serde_json::Value {
    schemars::schema_for!(Description).to_value()
}

/// Reads a study, its model and its contaminations.
///
/// # Errors
/// When a file cannot be read, has unknown keys, lacks some, or has values that mean no study.
pub fn read(path: &Path) -> Result<StudyFile, FileError> {
    let source = Source::read(path)?;
    let d: Description = source.get()?;
    at_least(&source, "samples", d.samples, 4)?;
    at_least(&source, "replicates", d.replicates, 1)?;
    at_least(&source, "sets", d.sets, 1)?;
    let beside = |name: &str| path.parent().unwrap_or(Path::new("")).join(name);
    let model = beside(&d.model);
    let file = model_file::read(&model)?;
    let samples = d.samples as usize;
    let design = Design {
        seed: 0,
        channel: channel(&source, d.axis.as_deref(), &file.missing)?,
        replicates: d.replicates,
        samples,
        levels: levels(&source, d.levels, samples)?,
        scenarios: scenarios(&source, &d.scenarios, file.model.rate_hz, beside)?,
        estimators: estimators(&source, d.estimators)?,
        spec: d
            .fit
            .parse()
            .map_err(|e| source.refused("fit", format!("is not a model: {e}")))?,
        trim: d.trim.map_or(Trim::default(), |a| Trim::Count(a as usize)),
        tuning: Tuning::new(d.efficiency, Convention::Exact)
            .map_err(|_| source.refused("efficiency", "is not between 0.3 and 0.99"))?,
        weighting: d.weighting.into(),
        spread: file.spread.unwrap_or_default(),
        model: file.model,
    };
    enough(&source, &design)?;
    fit_has_slopes(&source, &design)?;
    has_targets(&source, &design)?;
    Ok(StudyFile {
        design,
        seed: d.seed,
        sets: d.sets,
        model,
    })
}

/// More than fits memory and file formats.
const MOST: u64 = 1 << 40;

/// Refuses a whole number that is too small, or too large.
fn at_least(source: &Source, key: &str, value: u64, least: u64) -> Result<(), FileError> {
    if (least..=MOST).contains(&value) {
        return Ok(());
    }
    Err(source.refused(key, format!("is not a whole number ≥ {least}")))
}

fn channel(source: &Source, name: Option<&str>, missing: &[Channel]) -> Result<Channel, FileError> {
    let names = || Channel::ALL.map(|c| c.to_string()).join(", ");
    let Some(channel) = Channel::ALL
        .into_iter()
        .find(|c| c.to_string() == name.unwrap_or("accel.x"))
    else {
        return Err(source
            .refused("axis", "is no axis")
            .advice(format!("axes: {}", names())));
    };
    if missing.contains(&channel) {
        let key = if name.is_some() { "axis" } else { "model" };
        return Err(source.refused(key, format!("has no noise of {channel}")));
    }
    Ok(channel)
}

fn levels(source: &Source, levels: Option<u64>, samples: usize) -> Result<u32, FileError> {
    let most = max_levels(samples);
    match levels {
        None => Ok(default_levels(samples)),
        Some(levels) if (1..=u64::from(most)).contains(&levels) => Ok(levels as u32),
        Some(_) => {
            let reason =
                format!("is not between 1 and {most}, the most that {samples} samples allow");
            Err(source.refused("levels", reason))
        }
    }
}

fn scenarios(
    source: &Source,
    names: &[String],
    rate_hz: f64,
    beside: impl Fn(&str) -> PathBuf,
) -> Result<Vec<Contamination>, FileError> {
    if names.is_empty() {
        return Err(source.refused("scenarios", "names none"));
    }
    if let Some(twice) = (1..names.len()).find(|i| names[..*i].contains(&names[*i])) {
        return Err(source.refused("scenarios", format!("names {} twice", names[twice])));
    }
    let find = |name: &String| {
        let file = beside(name);
        let preset = contamination_file::names().contains(&name.as_str());
        if !preset && !file.is_file() {
            let hint = contamination_file::meant(name).map(|m| format!("did you mean \"{m}\"?"));
            return Err(source
                .refused("scenarios", format!("names {name}, which is not there"))
                .advice_if(hint));
        }
        let place = if preset {
            name.clone()
        } else {
            file.display().to_string()
        };
        Ok(Contamination {
            name: name.clone(),
            ..contamination_file::find(&place, rate_hz)?
        })
    };
    names.iter().map(find).collect()
}

fn estimators(
    source: &Source,
    named: Vec<AveragingEstimator>,
) -> Result<Vec<Estimator>, FileError> {
    let repeated = (1..named.len()).any(|i| named[..i].contains(&named[i]));
    if named.is_empty() || repeated {
        return Err(source.refused("estimators", "is not a list of different estimators"));
    }
    Ok(named.into_iter().map(Estimator::from).collect())
}

fn enough(source: &Source, design: &Design) -> Result<(), FileError> {
    let replicates = usize::try_from(design.replicates).unwrap_or(usize::MAX);
    let trim = design.trim.count(replicates);
    // Not 2·trim: the number is the user's.
    if design.estimators.contains(&Estimator::DrAwv) && trim >= replicates.div_ceil(2) {
        let reason = format!("are too few: {}", AverageError::Trim { trim, replicates });
        return Err(source
            .refused("replicates", reason)
            .advice("a smaller \"trim\""));
    }
    Ok(())
}

/// AVLR reads slopes, and some processes have none.
fn fit_has_slopes(source: &Source, design: &Design) -> Result<(), FileError> {
    let without = design.spec.kinds().iter().find(|k| k.shape().is_some());
    match without {
        Some(kind) if design.estimators.contains(&Estimator::Avlr) => {
            let reason = format!(
                "has avlr, which cannot tell {}: it has no slope of its own",
                kind.code()
            );
            Err(source
                .refused("estimators", reason)
                .advice("fit = \"WN+RW\", a sum of WN, QN, RW, DR"))
        }
        _ => Ok(()),
    }
}

/// Refuses a fit that holds the model and a process more: what is estimated has no true value, and no error relative to it.
/// One of a kind that is there may have one where parameters vary: the expected variance is not that of a single one.
fn has_targets(source: &Source, design: &Design) -> Result<(), FileError> {
    let axis = design.channel.index();
    // one process in two forms
    let alike = |kind: Kind| {
        if kind == Kind::GaussMarkov {
            Kind::Ar1
        } else {
            kind
        }
    };
    let there: Vec<Kind> = design.model.axes[axis]
        .processes
        .iter()
        .map(|p| alike(p.kind()))
        .collect();
    let fitted: Vec<Kind> = design.spec.kinds().iter().copied().map(alike).collect();
    let count = |kinds: &[Kind], kind: Kind| kinds.iter().filter(|k| **k == kind).count();
    if there
        .iter()
        .any(|kind| count(&there, *kind) > count(&fitted, *kind))
    {
        return Ok(()); // another model: its target is what comes nearest
    }
    let is_varied = !design.spread.axes[axis].is_empty();
    let is_extra = |kind: &&Kind| match count(&there, alike(**kind)) {
        0 => true,
        of_kind => !is_varied && count(&fitted, alike(**kind)) > of_kind,
    };
    let Some(extra) = design.spec.kinds().iter().find(is_extra) else {
        return Ok(());
    };
    let has = match count(&there, alike(*extra)) {
        0 => format!("no {}", extra.code()),
        of_kind => format!("{of_kind} {} only", extra.code()),
    };
    let reason = format!(
        "is more than the model: {} has {has}, so that there is no true value",
        design.channel
    );
    let codes: Vec<&str> = there.iter().map(|kind| kind.code()).collect();
    let advice = format!(
        "fit = \"{}\", or a model with such a process",
        codes.join("+")
    );
    Err(source.refused("fit", reason).advice(advice))
}

#[cfg(test)]
mod tests {
    use super::*;

    const MODEL: &str = "rate_hz = 100.0\n[accel]\nprocesses = [{ type = \"WN\", sigma2 = 1.0 }]\n";
    const STUDY: &str = "model = \"m.toml\"\nfit = \"WN\"\nreplicates = 5\nsamples = 64\nsets = 3\nscenarios = [\"section4-I\"]\n";

    fn study(text: &str) -> Result<StudyFile, String> {
        let dir = tempfile::tempdir().unwrap();
        std::fs::write(dir.path().join("m.toml"), MODEL).unwrap();
        let path = dir.path().join("s.toml");
        std::fs::write(&path, text).unwrap();
        let place = format!("{}/", dir.path().display());
        read(&path)
            .map_err(|e| format!("{e} | {}", e.hint().unwrap_or_default()).replace(&place, ""))
    }

    #[test]
    fn defaults_are_the_papers() {
        let s = study(STUDY).unwrap();
        assert_eq!((s.sets, s.seed, s.design.levels), (3, None, 5));
        assert_eq!(
            s.design.estimators,
            [Estimator::Awv, Estimator::SrAwv, Estimator::DrAwv]
        );
        assert_eq!(s.design.trim.count(8), 2);
        assert!((s.design.tuning.efficiency() - 0.6).abs() < 1e-9);
        assert_eq!(s.design.weighting, Weighting::default());
        let edof = study(&format!("weighting = \"edof\"\n{STUDY}")).unwrap();
        assert_eq!(edof.design.weighting, Weighting::Edof);
    }

    #[test]
    fn mistakes_are_named() {
        let with = |from: &str, to: &str| study(&STUDY.replace(from, to)).unwrap_err();
        assert_eq!(
            with("replicates = 5", "replicates = 5\ntrim = 3"),
            "s.toml, line 3: \"replicates\" = 5 are too few: trimming 3 replicates at each end needs at least 7 replicates; there are 5 | a smaller \"trim\""
        );
        assert_eq!(
            with("section4-I", "section4-2"),
            "s.toml, line 6: \"scenarios\" = [\"section4-2\"] names section4-2, which is not there | did you mean \"section4-I\"?"
        );
        let more = |fit: &str, has: &str| {
            format!(
                "s.toml, line 2: \"fit\" = \"{fit}\" is more than the model: accel.x has {has}, so that there is no true value | \
                 fit = \"WN\", or a model with such a process"
            )
        };
        assert_eq!(
            with("fit = \"WN\"", "fit = \"WN+AR1\""),
            more("WN+AR1", "no AR1")
        );
        assert_eq!(
            with("fit = \"WN\"", "fit = \"WN+GM\""),
            more("WN+GM", "no GM")
        );
        // another model than that of the data has the nearest as its target
        assert!(study(&STUDY.replace("fit = \"WN\"", "fit = \"QN\"")).is_ok());
        assert_eq!(
            with("fit = ", "fits = "),
            "s.toml, line 2: unknown key \"fits\" | did you mean \"fit\"?"
        );
        assert_eq!(
            with("sets = 3\n", ""),
            "s.toml, line 1: \"sets\" is missing | add the key \"sets\""
        );
        assert_eq!(
            with("sets = 3", "sets = -1"),
            "s.toml, line 5: \"sets\" = -1 is not a whole number ≥ 0 | "
        );
        assert_eq!(
            with("sets = 3", "sets = 0"),
            "s.toml, line 5: \"sets\" = 0 is not a whole number ≥ 1 | "
        );
        assert_eq!(
            with("samples = 64", "samples = 64\nlevels = 7"),
            "s.toml, line 5: \"levels\" = 7 is not between 1 and 6, the most that 64 samples allow | "
        );
        assert_eq!(
            with("sets", "estimators = [\"gmwm\"]\nsets"),
            "s.toml, line 5: \"estimators\" = \"gmwm\" is not one of \"awv\", \"sr-awv\", \"dr-awv\", \"avlr\" | "
        );
        assert_eq!(
            with("sets", "axis = \"gyro.x\"\nsets"),
            "s.toml, line 5: \"axis\" = \"gyro.x\" has no noise of gyro.x | "
        );
    }
}
