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
//! ```

use super::FileError;
use super::contamination_file;
use super::model_file;
use super::suggest::nearest;
use super::toml_file::{Section, Source};
use crate::calibration::{AverageError, Estimator, ModelSpec, Trim, Weighting};
use crate::efficiency::Design;
use crate::imu::Channel;
use crate::noise::contamination::Contamination;
use crate::wavelet::{Convention, Tuning, default_levels, max_levels};
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

const KEYS: [&str; 13] = [
    "schema",
    "model",
    "axis",
    "fit",
    "replicates",
    "samples",
    "levels",
    "sets",
    "seed",
    "scenarios",
    "estimators",
    "trim",
    "efficiency",
];

/// Reads a study, its model and its contaminations.
///
/// # Errors
/// When a file cannot be read, has unknown keys, lacks some, or has values that mean no study.
pub fn read(path: &Path) -> Result<StudyFile, FileError> {
    let source = Source::read(path)?;
    let table = source.parse()?;
    let root = source.root(&table);
    root.only(&KEYS)?;
    if root.u64("schema")?.is_some_and(|s| s != 1) {
        return Err(root.refuse("schema", "is not a schema this version reads: it reads 1", None));
    }
    let beside = |name: &str| path.parent().unwrap_or(Path::new("")).join(name);
    let model = beside(root.require_str("model")?);
    let file = model_file::read(&model)?;
    let channel = channel(&root, &file.missing)?;
    let samples = at_least(&root, "samples", 4)? as usize;
    let design = Design {
        seed: 0,
        channel,
        replicates: at_least(&root, "replicates", 1)?,
        samples,
        levels: levels(&root, samples)?,
        scenarios: scenarios(&root, file.model.rate_hz, beside)?,
        estimators: estimators(&root)?,
        spec: spec(&root)?,
        trim: root.u64("trim")?.map_or(Trim::default(), |a| Trim::Count(a as usize)),
        tuning: tuning(&root)?,
        weighting: Weighting::Edof,
        spread: file.spread.unwrap_or_default(),
        model: file.model,
    };
    enough(&root, &design)?;
    has_slopes(&root, &design)?;
    Ok(StudyFile { design, seed: root.u64("seed")?, sets: at_least(&root, "sets", 1)?, model })
}

/// The JSON schema of a study file.
#[must_use]
pub fn schema() -> serde_json::Value {
    use serde_json::json;
    let whole = |least: u64| json!({ "type": "integer", "minimum": least });
    let described = |text: &str, mut of: serde_json::Value| {
        of["description"] = text.into();
        of
    };
    let text = || json!({ "type": "string" });
    let several: Vec<&str> = ["awv", "sr-awv", "dr-awv", "avlr"].to_vec();
    json!({
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "Study",
        "description": "Monte-Carlo study of estimators: nav-sim efficiency",
        "type": "object",
        "properties": {
            "schema": { "const": 1 },
            "model": described("Model file with [spread], relative to this file", text()),
            "axis": described("The axis studied: accel.x (default) … gyro.z", text()),
            "fit": described("What is fitted, such as N1", text()),
            "replicates": described("Replicates of a set, K", whole(1)),
            "samples": described("Samples of a replicate, T", whole(4)),
            "levels": described("Scales, J (default: floor(log2 T) - 1)", whole(1)),
            "sets": described("Sets of replicates, H", whole(1)),
            "seed": whole(0),
            "scenarios": described("Contaminations: names, or files relative to this one",
                json!({ "type": "array", "items": text(), "minItems": 1, "uniqueItems": true })),
            "estimators": json!({ "type": "array", "items": { "enum": several }, "minItems": 1, "uniqueItems": true }),
            "trim": described("Replicates that dr-awv drops at each end (default: 30 %)", whole(0)),
            "efficiency": { "type": "number", "minimum": 0.3, "maximum": 0.99,
                "description": "Efficiency of the robust wavelet variance (default 0.6)" }
        },
        "required": ["model", "fit", "replicates", "samples", "sets", "scenarios"],
        "additionalProperties": false
    })
}

/// A required whole number in a range that fits memory and file formats.
fn at_least(root: &Section<'_>, key: &str, least: u64) -> Result<u64, FileError> {
    let value = root.u64(key)?.ok_or_else(|| root.missing(key))?;
    if (least..=1 << 40).contains(&value) {
        Ok(value)
    } else {
        Err(root.refuse(key, format!("is not a whole number ≥ {least}"), None))
    }
}

fn channel(root: &Section<'_>, missing: &[Channel]) -> Result<Channel, FileError> {
    let name = root.str("axis")?.unwrap_or("accel.x");
    let names = || Channel::ALL.map(|c| c.to_string()).join(", ");
    let Some(channel) = Channel::ALL.into_iter().find(|c| c.to_string() == name) else {
        return Err(root.refuse("axis", "is no axis", Some(format!("axes: {}", names()))));
    };
    if missing.contains(&channel) {
        let key = if root.has("axis") { "axis" } else { "model" };
        return Err(root.refuse(key, format!("has no noise of {channel}"), None));
    }
    Ok(channel)
}

fn levels(root: &Section<'_>, samples: usize) -> Result<u32, FileError> {
    let most = max_levels(samples);
    match root.u64("levels")? {
        None => Ok(default_levels(samples)),
        Some(levels) if (1..=u64::from(most)).contains(&levels) => Ok(levels as u32),
        Some(_) => {
            let reason = format!("is not between 1 and {most}, the most that {samples} samples allow");
            Err(root.refuse("levels", reason, None))
        }
    }
}

fn scenarios(
    root: &Section<'_>,
    rate_hz: f64,
    beside: impl Fn(&str) -> PathBuf,
) -> Result<Vec<Contamination>, FileError> {
    let names = root.strs("scenarios")?.ok_or_else(|| root.missing("scenarios"))?;
    if names.is_empty() {
        return Err(root.refuse("scenarios", "names none", None));
    }
    if let Some(twice) = (1..names.len()).find(|i| names[..*i].contains(&names[*i])) {
        return Err(root.refuse("scenarios", format!("names {} twice", names[twice]), None));
    }
    let find = |name: &&str| {
        let file = beside(name);
        if !contamination_file::names().contains(name) && !file.is_file() {
            let hint = contamination_file::meant(name).map(|m| format!("did you mean \"{m}\"?"));
            return Err(root.refuse("scenarios", format!("names {name}, which is not there"), hint));
        }
        let preset = contamination_file::names().contains(name);
        let place = if preset { (*name).to_owned() } else { file.display().to_string() };
        Ok(Contamination { name: (*name).to_owned(), ..contamination_file::find(&place, rate_hz)? })
    };
    names.iter().map(find).collect()
}

fn estimators(root: &Section<'_>) -> Result<Vec<Estimator>, FileError> {
    let several = || Estimator::ALL.into_iter().filter(|e| !e.is_single() || *e == Estimator::Avlr);
    let Some(names) = root.strs("estimators")? else {
        return Ok(several().filter(|e| !e.is_single()).collect());
    };
    let find = |name: &&str| {
        several().find(|e| e.name() == *name).ok_or_else(|| {
            let hint = nearest(name, several().map(Estimator::name)).map_or_else(
                || format!("estimators: {}", several().map(Estimator::name).collect::<Vec<_>>().join(", ")),
                |meant| format!("did you mean \"{meant}\"?"),
            );
            root.refuse("estimators", format!("names {name}, which is no average of replicates"), Some(hint))
        })
    };
    let found: Vec<Estimator> = names.iter().map(find).collect::<Result<_, _>>()?;
    let repeated = (1..found.len()).any(|i| found[..i].contains(&found[i]));
    if found.is_empty() || repeated {
        return Err(root.refuse("estimators", "is not a list of different estimators", None));
    }
    Ok(found)
}

fn spec(root: &Section<'_>) -> Result<ModelSpec, FileError> {
    let text = root.require_str("fit")?;
    text.parse().map_err(|e| root.refuse("fit", format!("is no model: {e}"), None))
}

fn tuning(root: &Section<'_>) -> Result<Tuning, FileError> {
    let efficiency = root.f64("efficiency")?.unwrap_or(Tuning::DEFAULT_EFFICIENCY);
    Tuning::new(efficiency, Convention::Exact)
        .map_err(|_| root.refuse("efficiency", "is not between 0.3 and 0.99", None))
}

fn enough(root: &Section<'_>, design: &Design) -> Result<(), FileError> {
    let replicates = usize::try_from(design.replicates).unwrap_or(usize::MAX);
    let trim = design.trim.count(replicates);
    // Not 2·trim: the number is the user's.
    if design.estimators.contains(&Estimator::DrAwv) && trim >= replicates.div_ceil(2) {
        let reason = format!("are too few: {}", AverageError::Trim { trim, replicates });
        return Err(root.refuse("replicates", reason, Some("a smaller \"trim\"".into())));
    }
    Ok(())
}

/// AVLR reads slopes, and some processes have none.
fn has_slopes(root: &Section<'_>, design: &Design) -> Result<(), FileError> {
    let without = design.spec.kinds().iter().find(|k| k.shape().is_some());
    match without {
        Some(kind) if design.estimators.contains(&Estimator::Avlr) => {
            let reason = format!("has avlr, which cannot tell {}: it has no slope of its own", kind.code());
            Err(root.refuse("estimators", reason, Some("fit = \"WN+RW\", a sum of WN, QN, RW, DR".into())))
        }
        _ => Ok(()),
    }
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
        read(&path).map_err(|e| format!("{e} | {}", e.hint().unwrap_or_default()).replace(&place, ""))
    }

    #[test]
    fn defaults_are_the_papers() {
        let s = study(STUDY).unwrap();
        assert_eq!((s.sets, s.seed, s.design.levels), (3, None, 5));
        assert_eq!(s.design.estimators, [Estimator::Awv, Estimator::SrAwv, Estimator::DrAwv]);
        assert_eq!(s.design.trim.count(8), 2);
        assert!((s.design.tuning.efficiency() - 0.6).abs() < 1e-9);
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
        assert_eq!(with("fit = ", "fits = "), "s.toml, line 2: unknown key \"fits\" | did you mean \"fit\"?");
        assert_eq!(with("sets = 3\n", ""), "s.toml, line 1: \"sets\" is missing | add the key \"sets\"");
        assert_eq!(with("sets = 3", "sets = 0"), "s.toml, line 5: \"sets\" = 0 is not a whole number ≥ 1 | ");
        assert_eq!(
            with("samples = 64", "samples = 64\nlevels = 7"),
            "s.toml, line 5: \"levels\" = 7 is not between 1 and 6, the most that 64 samples allow | "
        );
        assert_eq!(
            with("sets", "estimators = [\"gmwm\"]\nsets"),
            "s.toml, line 5: \"estimators\" = [\"gmwm\"] names gmwm, which is no average of replicates | estimators: awv, sr-awv, dr-awv, avlr"
        );
        assert_eq!(
            with("sets", "axis = \"gyro.x\"\nsets"),
            "s.toml, line 5: \"axis\" = \"gyro.x\" has no noise of gyro.x | "
        );
    }
}
