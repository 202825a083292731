//! Study files of `nav-sim batch` (TOML): see [`Study`].

use super::description::{GnssEntry, ScenarioEntry, Study, TruthEntry};
use super::error::DescriptionError;
use crate::formats::suggest::nearest;
use crate::formats::toml_described;
use crate::formats::toml_file::{Section, Source};
use crate::formats::{FileError, Kind};
use crate::formats::{recordings, scenario_file};
use crate::scenario::Scenario;
use crate::sensors::gnss::GnssSettings;
use crate::units::SettingError;
use std::path::{Path, PathBuf};

/// A study, read, with the scenario and receiver files it names.
#[derive(Debug, Clone, PartialEq)]
pub struct StudyFile {
    /// The study, names and defaults filled in.
    pub study: Study,
    /// Its scenarios, in order (empty: the default).
    pub scenarios: Vec<Scenario>,
    /// Its receivers, in order (empty: those of the scenarios).
    pub gnss: Vec<GnssSettings>,
}

/// What a path of a study file means: it is relative to the file.
#[must_use]
pub fn beside(study: &Path, path: &Path) -> PathBuf {
    study.parent().unwrap_or(Path::new("")).join(path)
}

/// Reads and checks a study and the scenario files it names.
///
/// # Errors
/// File, line, key and value of what is refused; a mistyped key with the nearest legal one.
pub fn read(path: &Path) -> Result<StudyFile, FileError> {
    let source = Source::read(path)?;
    let table = source.parse()?;
    let root = source.root(&table);
    let written: toml::Table = source.text().parse().unwrap_or_default();
    let mut study: Study = toml_described::read(&source)?;
    for key in ["filters", "scenario", "gnss", "outages"] {
        let is_empty = |value: &toml::Value| value.as_array().is_some_and(Vec::is_empty);
        if written.get(key).is_some_and(is_empty) {
            let e = DescriptionError::refused(key, "[]", "makes no cell; leave the key out for the default");
            return Err(located(&e, &source, &root));
        }
    }
    one_truth_each(&mut study, path)?;
    study.resolve().map_err(|e| located(&e, &source, &root))?;
    study.reference().map_err(|e| located(&e, &source, &root))?;
    let scenarios = scenarios(&study, path, &source)?;
    let gnss = receivers(&study, path, &source)?;
    Ok(StudyFile { study, scenarios, gnss })
}

/// Puts a truth for each recording in the place of one that says so.
fn one_truth_each(study: &mut Study, path: &Path) -> Result<(), FileError> {
    let mut truths = Vec::new();
    for entry in study.truth.drain(..) {
        if !entry.each || entry.recordings.is_empty() {
            truths.push(entry);
            continue;
        }
        for given in &entry.recordings {
            let place = beside(path, given);
            let is_directory = place.is_dir();
            for file in recordings::listed(&[place])? {
                let named = match file.file_name() {
                    Some(name) if is_directory => given.join(name),
                    _ => given.clone(),
                };
                let stem = named.file_stem().map(|s| s.to_string_lossy().into_owned()).unwrap_or_default();
                let name = if entry.name.is_empty() { stem } else { format!("{}/{stem}", entry.name) };
                truths.push(TruthEntry { name, recordings: vec![named], each: false, ..entry.clone() });
            }
        }
    }
    study.truth = truths;
    Ok(())
}

fn scenarios(study: &Study, path: &Path, source: &Source) -> Result<Vec<Scenario>, FileError> {
    let one = |(i, entry): (usize, &ScenarioEntry)| {
        let scenario = match (&entry.file, &entry.settings) {
            (Some(file), _) => scenario_file::read(&beside(path, file))?,
            (None, settings) => settings.clone().unwrap_or_default(),
        };
        let section = format!("scenario[{}].settings", i + 1);
        scenario.validate().map_err(|e| refused(&e, &section, source))?;
        match analysable(study, &scenario) {
            Err(e) => Err(refused(&e, &section, source).advice(SAMPLE)),
            Ok(()) => Ok(scenario),
        }
    };
    study.scenario.iter().enumerate().map(one).collect()
}

fn receivers(study: &Study, path: &Path, source: &Source) -> Result<Vec<GnssSettings>, FileError> {
    let one = |(i, entry): (usize, &GnssEntry)| {
        let gnss = match (&entry.file, &entry.settings) {
            (Some(file), _) => scenario_file::read(&beside(path, file))?.gnss,
            (None, settings) => settings.clone().unwrap_or_default(),
        };
        gnss.validate().map_err(|e| refused(&e, &format!("gnss[{}].settings", i + 1), source))?;
        Ok(gnss)
    };
    study.gnss.iter().enumerate().map(one).collect()
}

const SAMPLE: &str = "leave it out, or sample with method = \"monte-carlo\"";

/// Gains that depend on what is drawn have no covariance analysis.
fn analysable(study: &Study, scenario: &Scenario) -> Result<(), SettingError> {
    match scenario.filter.nis_gate {
        Some(p) if !study.is_sampled() => {
            let reason =
                "a gate makes the gains depend on what is drawn, and covariance analysis has no draws";
            Err(SettingError::new("filter.nis_gate", p, reason))
        }
        _ => Ok(()),
    }
}

/// A refusal by the rules of settings.
fn refused(error: &SettingError, section: &str, source: &Source) -> FileError {
    let last = error.key.rsplit('.').next().unwrap_or_default();
    let kind = Kind::Value {
        key: format!("{section}.{}", error.key).into(),
        value: error.value.as_str().into(),
        reason: format!("is refused: {}", error.requirement).into(),
    };
    source.error(line_of(source, last), kind)
}

/// The first line that sets a key; 1 if none does.
fn line_of(source: &Source, key: &str) -> usize {
    let sets = |line: &str| line.split('=').next().is_some_and(|left| left.trim_end().ends_with(key));
    source.text().lines().position(sets).map_or(1, |i| i + 1)
}

/// A refusal by [`Study::resolve`] at the line its key stands in.
fn located(error: &DescriptionError, source: &Source, root: &Section<'_>) -> FileError {
    let hint = match error {
        DescriptionError::NoReference { reference, candidates } => {
            let meant = nearest(reference, candidates.iter().map(String::as_str));
            meant.map(|m| format!("did you mean \"{m}\"?")).or(error.hint())
        }
        _ => error.hint(),
    };
    let key = error.key();
    let (axis, entry) = match key.split_once('[') {
        Some((axis, rest)) => (axis, rest.split(']').next().and_then(|i| i.parse::<usize>().ok())),
        None => (key, None),
    };
    let first = axis.split('.').next().unwrap_or(axis);
    let entry = entry.or(match error {
        DescriptionError::Unnamed { entry, .. }
        | DescriptionError::NotOne { entry, .. }
        | DescriptionError::NoModel { entry } => Some(*entry),
        _ => None,
    });
    let line = if let (DescriptionError::Duplicate { name, .. }, true) = (error, root.has(first)) {
        second(source, name)
    } else if let Some(i) = entry {
        root.sections(first).ok().and_then(|all| all.get(i - 1).map(Section::line)).unwrap_or(1)
    } else if root.has(first) {
        root.line_of(first)
    } else {
        1
    };
    source.error(line, Kind::Contents(error.to_string().into())).advice_if(hint)
}

/// The line in which a text in quotes stands for the second time (else the first; else 1).
fn second(source: &Source, text: &str) -> usize {
    let quoted = [format!("\"{text}\""), format!("'{text}'")];
    let with = |line: &&str| quoted.iter().any(|q| line.contains(q.as_str()));
    let lines: Vec<usize> =
        source.text().lines().enumerate().filter(|(_, l)| with(l)).map(|(i, _)| i + 1).collect();
    lines.get(1).or(lines.first()).copied().unwrap_or(1)
}

#[cfg(test)]
mod tests {
    use super::*;

    const STUDY: &str = "runs = 8\n\
        trajectory = [{ file = \"a/land.toml\" }]\n\
        truth = [{ model = \"m.toml\" }]\n\
        [[candidate]]\nmodel = \"m.toml\"\n\
        [[candidate]]\nname = \"II\"\ncalibrate = { recordings = [\"r.csv\"], estimators = [\"awv\", \"dr-awv\"] }\n\
        [[outages]]\nsweep = { start_s = 300, duration_s = [10, 20] }\n";

    fn study(text: &str) -> Result<StudyFile, String> {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("s.toml");
        std::fs::write(&path, text).unwrap();
        let place = format!("{}/", dir.path().display());
        read(&path).map_err(|e| format!("{e} | {}", e.hint().unwrap_or_default()).replace(&place, ""))
    }

    #[test]
    fn names_and_defaults_are_filled_in() {
        let file = study(STUDY).unwrap();
        let s = &file.study;
        assert_eq!((s.trajectory[0].name.as_str(), s.truth[0].name.as_str()), ("land", "m"));
        let candidates: Vec<String> = s.candidates().into_iter().map(|(name, ..)| name).collect();
        assert_eq!(candidates, ["m", "II/awv", "II/dr-awv"]);
        let sets: Vec<String> = s.outage_sets().unwrap().into_iter().map(|o| o.name).collect();
        assert_eq!(sets, ["sweep(300,10)", "sweep(300,20)"]);
        assert!(file.scenarios.is_empty() && file.gnss.is_empty());
    }

    #[test]
    fn mistakes_are_named() {
        let with = |from: &str, to: &str| study(&STUDY.replace(from, to)).unwrap_err();
        for key in ["filters", "scenario", "gnss", "outages"] {
            let text = format!("{key} = []\n{}", STUDY.split("[[outages]]").next().unwrap());
            let refusal =
                format!("s.toml, line 1: \"{key}\" = [] makes no cell; leave the key out for the default | ");
            assert_eq!(study(&text).unwrap_err(), refusal);
        }
        assert_eq!(
            with("runs = 8", "filters = [15, \"full\", \"15\"]"),
            "s.toml, line 1: \"filters\" = [\"15\",\"full\",\"15\"] names \"15\" twice | "
        );
        assert_eq!(
            with("runs = 8", "rums = 8"),
            "s.toml, line 1: unknown key \"rums\" | did you mean \"runs\"?"
        );
        assert_eq!(
            with("runs = 8", "runs = 0"),
            "s.toml, line 1: \"runs\" = 0 must lie between 1 and 10000000 | "
        );
        assert_eq!(
            with("name = \"II\"", "name = \"m\""),
            "s.toml, line 7: two candidate entries are named \"m\" | give each entry a \"name\""
        );
        assert_eq!(
            with("{ file = \"a/land.toml\" }", ""),
            "s.toml, line 2: the grid is empty: no trajectory | add a [[trajectory]] to the study"
        );
        assert_eq!(
            with("[10, 20]", "[]"),
            "s.toml, line 9: the grid is empty: no outages[1] | a list without values makes no cell"
        );
        assert_eq!(
            with("runs = 8", "reference = \"II/avw\""),
            "s.toml, line 1: \"reference\" = \"II/avw\" is no candidate | did you mean \"II/awv\"?"
        );
        assert_eq!(
            with("recordings = [\"r.csv\"], ", ""),
            "s.toml, line 6: candidate.calibrate[2] needs exactly one of recordings, synthesize | "
        );
        assert_eq!(
            with("sweep = {", "swep = {"),
            "s.toml, line 10: unknown key \"outages.swep\" | did you mean \"sweep\"?"
        );
        assert_eq!(
            with("[[outages]]", "[[gnss]]\nname = \"a\"\nsettings.rate_hz = -1\n[[outages]]"),
            "s.toml, line 11: \"gnss[1].settings.rate_hz\" = -1 is refused: it must be a finite number > 0 | "
        );
    }
}
