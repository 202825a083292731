//! Study files of `nav-sim batch` (TOML): see [`Study`].

use super::description::{GnssEntry, ScenarioEntry, Study, TruthEntry};
use super::error::DescriptionError;
use crate::formats::toml_file::Source;
use crate::formats::{FileError, Kind};
use crate::formats::{recordings, scenario_file};
use nav_sim_navigation::scenario::Scenario;
use nav_sim_navigation::sensors::gnss::GnssSettings;
use serde::Deserialize;
use std::path::{Path, PathBuf};

/// A study, read, with the scenario and receiver files it names.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct StudyFile {
    /// The study, names and defaults filled in.
    pub study: Study,
    /// Its scenarios, in order (empty: the default).
    pub scenarios: Vec<Scenario>,
    /// Its receivers, in order (empty: those of the scenarios).
    pub gnss: Vec<GnssSettings>,
    /// What its scenarios say that no study uses, a sentence each.
    pub unused: Vec<String>,
}

/// What a path of a study file means: it is relative to the file.
pub(crate) fn beside(study: &Path, path: &Path) -> PathBuf {
    study.parent().unwrap_or(Path::new("")).join(path)
}

/// Reads and checks a study and the scenario files it names.
///
/// # Errors
/// File, line, key and value of what is refused; a mistyped key with the nearest legal one.
pub(crate) fn read(path: &Path) -> Result<StudyFile, FileError> {
    let source = Source::read(path)?;
    let mut study: Study = source.get()?;
    let empty = [
        ("filters", study.filters.is_empty()),
        ("scenario", study.scenario.is_empty()),
        ("gnss", study.gnss.is_empty()),
        ("outages", study.outages.is_empty()),
    ];
    if let Some((key, _)) = empty
        .into_iter()
        .find(|(key, is_empty)| *is_empty && source.has(key))
    {
        return Err(source.refused(key, "makes no cell; leave the key out for the default"));
    }
    let written = one_truth_each(&mut study, path)?;
    let checked = study
        .resolve()
        .and_then(|()| study.reference())
        .and_then(|_| single(&study, path));
    checked.map_err(|e| located(&e, &written, &source))?;
    let scenarios = scenarios(&study, path, &source)?;
    let gnss = receivers(&study, path, &source)?;
    let unused = unused(&study, path, &source)?;
    Ok(StudyFile {
        study,
        scenarios,
        gnss,
        unused,
    })
}

/// Puts a truth for each recording in the place of one that says so.
///
/// Returns, for each truth, the number of its entry in the file.
fn one_truth_each(study: &mut Study, path: &Path) -> Result<Vec<usize>, FileError> {
    let (mut truths, mut written) = (Vec::new(), Vec::new());
    for (number, entry) in (1..).zip(study.truth.drain(..)) {
        if !entry.each || entry.recordings.is_empty() {
            truths.push(entry);
            written.push(number);
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
                let stem = named
                    .file_stem()
                    .map(|s| s.to_string_lossy().into_owned())
                    .unwrap_or_default();
                let name = if entry.name.is_empty() {
                    stem
                } else {
                    format!("{}/{stem}", entry.name)
                };
                truths.push(TruthEntry {
                    name,
                    recordings: vec![named],
                    each: false,
                    ..entry.clone()
                });
                written.push(number);
            }
        }
    }
    study.truth = truths;
    Ok(written)
}

/// Refuses several recordings for an estimator that takes one. How many a calibration without those of a truth has is
/// known when it is made.
fn single(study: &Study, path: &Path) -> Result<(), DescriptionError> {
    for (i, entry) in (1..).zip(&study.candidate) {
        let Some(step) = entry.calibrate.as_ref().filter(|step| !step.leave_out) else {
            continue;
        };
        let Some(estimator) = step.estimators.iter().find(|e| e.is_single()) else {
            continue;
        };
        let recordings = step.synthesize.as_ref().map_or_else(
            || {
                let places: Vec<PathBuf> =
                    step.recordings.iter().map(|r| beside(path, r)).collect();
                // what is not there is told later, by its key
                recordings::listed(&places).map_or(places.len(), |files| files.len()) as u64
            },
            |synthesis| synthesis.replicates,
        );
        if recordings > 1 {
            let key = format!("candidate[{i}].calibrate.estimators");
            return Err(DescriptionError::NotSingle {
                key,
                estimator: *estimator,
                recordings,
            });
        }
    }
    Ok(())
}

/// What scenarios say of the runs beside the level of coverage: a study has its own.
fn unused(study: &Study, path: &Path, source: &Source) -> Result<Vec<String>, FileError> {
    /// Of a scenario file or of settings, the keys of `[run]`.
    #[derive(Deserialize)]
    struct OfRun {
        #[serde(default)]
        run: toml::Table,
    }
    #[derive(Deserialize)]
    struct Entry {
        settings: Option<OfRun>,
    }
    #[derive(Deserialize)]
    struct Entries {
        #[serde(default)]
        scenario: Vec<Entry>,
    }
    let written: Entries = source.get()?;
    let mut said = Vec::new();
    for (entry, written) in study.scenario.iter().zip(written.scenario) {
        let of_run = match &entry.file {
            Some(file) => Some(Source::read(&beside(path, file))?.get()?),
            None => written.settings,
        };
        let keys = of_run
            .into_iter()
            .flat_map(|OfRun { run }| run.into_iter().map(|(key, _)| key));
        let keys: Vec<String> = keys.filter(|key| key != "coverage_level").collect();
        if !keys.is_empty() {
            said.push(format!(
                "scenario \"{}\": of its [run] a study uses coverage_level alone, not {}; the study has its own",
                entry.name,
                keys.join(", ")
            ));
        }
    }
    Ok(said)
}

fn scenarios(study: &Study, path: &Path, source: &Source) -> Result<Vec<Scenario>, FileError> {
    let possible = |scenario: &Scenario| {
        if study.is_sampled() {
            Ok(())
        } else {
            scenario.analysable()
        }
    };
    let scenario = |(i, entry): (usize, &ScenarioEntry)| match (&entry.file, &entry.settings) {
        (Some(file), _) => scenario_file::read_for(&beside(path, file), possible),
        (None, settings) => {
            let scenario = settings.clone().unwrap_or_default();
            let checked = scenario.validate().and_then(|()| possible(&scenario));
            let section = format!("scenario[{}].settings", i + 1);
            checked.map_err(|e| source.setting(&e.in_section(&section)))?;
            Ok(scenario)
        }
    };
    study.scenario.iter().enumerate().map(scenario).collect()
}

fn receivers(study: &Study, path: &Path, source: &Source) -> Result<Vec<GnssSettings>, FileError> {
    let receiver = |(i, entry): (usize, &GnssEntry)| match (&entry.file, &entry.settings) {
        (Some(file), _) => Ok(scenario_file::read(&beside(path, file))?.gnss),
        (None, settings) => {
            let gnss = settings.clone().unwrap_or_default();
            let section = format!("gnss[{}].settings", i + 1);
            gnss.validate()
                .map_err(|e| source.setting(&e.in_section(&section)))?;
            Ok(gnss)
        }
    };
    study.gnss.iter().enumerate().map(receiver).collect()
}

/// A refusal by [`Study::resolve`] at the line its key stands in; `truths`: the entry of the file that each truth is of.
fn located(error: &DescriptionError, truths: &[usize], source: &Source) -> FileError {
    let mut key = error.key();
    if let Some((number, rest)) = key
        .strip_prefix("truth[")
        .and_then(|rest| rest.split_once(']'))
    {
        let written = number
            .parse()
            .ok()
            .and_then(|i: usize| truths.get(i.checked_sub(1)?));
        key = written.map_or_else(
            || "truth".to_owned(),
            |number| format!("truth[{number}]{rest}"),
        );
    }
    source
        .error(&key, Kind::Contents(error.to_string().into()))
        .advice_if(error.hint())
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
        read(&path)
            .map_err(|e| format!("{e} | {}", e.hint().unwrap_or_default()).replace(&place, ""))
    }

    #[test]
    fn names_and_defaults_are_filled_in() {
        let file = study(STUDY).unwrap();
        let s = &file.study;
        assert_eq!(
            (s.trajectory[0].name.as_str(), s.truth[0].name.as_str()),
            ("land", "m")
        );
        let candidates: Vec<String> = s.candidates().into_iter().map(|(name, ..)| name).collect();
        assert_eq!(candidates, ["m", "II/awv", "II/dr-awv"]);
        let sets: Vec<String> = s
            .outage_sets()
            .unwrap()
            .into_iter()
            .map(|o| o.name)
            .collect();
        assert_eq!(sets, ["sweep(300,10)", "sweep(300,20)"]);
        assert!(file.scenarios.is_empty() && file.gnss.is_empty());
    }

    /// Of `[run]` a study uses the level of coverage alone, of a file as of settings.
    #[test]
    fn runs_of_a_scenario_are_said_to_be_unused() {
        let with = |scenario: &str| {
            let dir = tempfile::tempdir().unwrap();
            std::fs::write(
                dir.path().join("own.toml"),
                "[run]\nruns = 3\nseed = 4\ncoverage_level = 0.9\n",
            )
            .unwrap();
            let path = dir.path().join("s.toml");
            std::fs::write(&path, format!("{STUDY}[[scenario]]\n{scenario}\n")).unwrap();
            read(&path).unwrap().unused
        };
        let told = |name: &str, keys: &str| {
            vec![format!(
                "scenario \"{name}\": of its [run] a study uses coverage_level alone, not {keys}; the study has its own"
            )]
        };
        assert_eq!(with("file = \"own.toml\""), told("own", "runs, seed"));
        assert_eq!(
            with("name = \"a\"\nsettings.run.runs = 3"),
            told("a", "runs")
        );
        assert_eq!(
            with("name = \"a\"\nsettings.run.coverage_level = 0.9"),
            [""; 0]
        );
    }

    #[test]
    fn mistakes_are_named() {
        let with = |from: &str, to: &str| study(&STUDY.replace(from, to)).unwrap_err();
        for key in ["filters", "scenario", "gnss", "outages"] {
            let text = format!("{key} = []\n{}", STUDY.split("[[outages]]").next().unwrap());
            let refusal = format!(
                "s.toml, line 1: \"{key}\" = [] makes no cell; leave the key out for the default | "
            );
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
            with("runs = 8", "sweep = {}"),
            "s.toml, line 1: unknown key \"sweep\" | legal here: schema, runs, seed, method, metrics, reference, unit_runs, filters, trajectory, truth, candidate, scenario, gnss, outages"
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
            with("[10, 20]", "[0, 20]"),
            "s.toml, line 10: \"outages[1].sweep.duration_s\" = 0 is refused: it must be a finite number > 0 | "
        );
        assert_eq!(
            with("runs = 8", "reference = \"II/avw\""),
            "s.toml, line 1: \"reference\" = \"II/avw\" is no candidate | did you mean \"II/awv\"?"
        );
        assert_eq!(
            with("recordings = [\"r.csv\"], ", ""),
            "s.toml, line 8: candidate[2].calibrate needs exactly one of recordings, synthesize | "
        );
        assert_eq!(
            with("\"awv\", \"dr-awv\"", "\"dr_awv\""),
            "s.toml, line 8: \"candidate[2].calibrate.estimators\" = [\"dr_awv\"] is not one of \"awv\", \"sr-awv\", \
             \"dr-awv\", \"gmwm\", \"rgmwm\", \"avlr\", \"given\" | did you mean \"dr-awv\"?"
        );
        assert_eq!(
            with("estimators", "fit = \"N7\", estimators"),
            "s.toml, line 8: \"candidate[2].calibrate.fit\" = \"N7\" is not a model: model \"N7\": \"N7\" is no process | \
             did you mean \"N1\"?"
        );
        let two = with(
            "[\"r.csv\"], estimators = [\"awv\", \"dr-awv\"]",
            "[\"r.csv\", \"q.csv\"], estimators = [\"gmwm\"]",
        );
        assert_eq!(
            two,
            "s.toml, line 8: \"candidate[2].calibrate.estimators\": gmwm takes a single recording; there are 2 | \
             give it one recording, or take awv, sr-awv or dr-awv, which average several"
        );
        assert_eq!(
            with(
                "recordings = [\"r.csv\"], estimators = [\"awv\", \"dr-awv\"]",
                "estimators = [\"avlr\"], synthesize = { model = \"m.toml\", replicates = 4 }"
            )
            .split(" | ")
            .next(),
            Some(
                "s.toml, line 8: \"candidate[2].calibrate.estimators\": avlr takes a single recording; there are 4"
            )
        );
        assert_eq!(
            with("\"awv\", \"dr-awv\"", "\"given\""),
            "s.toml, line 8: \"candidate[2].calibrate.estimators\" = \"given\" is of curves that come from elsewhere | "
        );
        assert_eq!(
            with("sweep = {", "swep = {"),
            "s.toml, line 10: unknown key \"outages[1].swep\" | did you mean \"sweep\"?"
        );
        assert_eq!(
            with(
                "[[outages]]",
                "[[scenario]]\nname = \"a\"\nsettings.gnss.rate_hz = 1\n[[scenario]]\nname = \"b\"\nsettings.gnss.rate_hz = -1\n[[outages]]"
            ),
            "s.toml, line 14: \"scenario[2].settings.gnss.rate_hz\" = -1 is refused: it must be a finite number > 0 | "
        );
        assert_eq!(
            with(
                "[[outages]]",
                "[[gnss]]\nname = \"a\"\nsettings.rate_hz = -1\n[[outages]]"
            ),
            "s.toml, line 11: \"gnss[1].settings.rate_hz\" = -1 is refused: it must be a finite number > 0 | "
        );
    }
}
