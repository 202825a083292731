//! The answer of a run, and its directory.

use super::{Navigation, charts, document};
use crate::formats::FileError;
use crate::formats::atomic::AtomicDir;
use crate::report::tables::{epochs_csv, fan_csv, runs_csv};
use crate::report::{Answer, Manifest, OutputFile, TrajectorySeries, json};
use nav_sim_document::{Document, svg};
use serde::Serialize;
use std::path::Path;

/// What a run found, and where it comes from. As JSON it is `summary.json`.
#[derive(Debug)]
#[non_exhaustive]
pub struct RunAnswer {
    /// Runs, statistics and summary.
    pub navigation: Navigation,
    /// Where they come from; of a library call without command, threads and times.
    pub manifest: Manifest,
    pub(super) track: TrajectorySeries,
}

impl Serialize for RunAnswer {
    /// The summary, and how fast it was found: its only number that the seed does not determine.
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        #[derive(Serialize)]
        struct WithThroughput<'a> {
            #[serde(flatten)]
            summary: &'a nav_sim_navigation::metrics::Summary,
            throughput_epochs_per_s: f64,
        }
        let throughput_epochs_per_s = self.manifest.throughput_epochs_per_s;
        WithThroughput {
            summary: &self.navigation.summary,
            throughput_epochs_per_s,
        }
        .serialize(serializer)
    }
}

impl Answer for RunAnswer {
    fn document(&self) -> Document {
        document::document(self)
    }
}

/// Names of the files of a run directory.
pub(crate) const RUN_FILES: [&str; 6] = [
    "epochs.csv",
    "fan.csv",
    "runs.csv",
    "summary.json",
    "report.html",
    "manifest.json",
];

impl RunAnswer {
    /// From what was found, where it comes from, and the way.
    #[must_use]
    pub const fn new(navigation: Navigation, manifest: Manifest, track: TrajectorySeries) -> Self {
        Self {
            navigation,
            manifest,
            track,
        }
    }

    /// Its words, tables and charts: what the terminal shows a part of and the page all.
    #[must_use]
    pub fn document(&self) -> Document {
        document::document(self)
    }

    /// The horizontal error, its percentiles and the NEES over time, as SVG.
    pub(crate) fn svg(&self) -> String {
        let Navigation {
            epochs,
            fan,
            summary,
            ..
        } = &self.navigation;
        let shown = [
            charts::horizontal(epochs, summary),
            charts::fan_chart(fan, summary),
            charts::nees(epochs, summary),
        ];
        svg("Navigation errors", &shown)
    }

    /// Puts how long the runs took (s) on record.
    pub fn took(&mut self, wall_s: f64) {
        let epochs = self
            .navigation
            .runs
            .as_ref()
            .map_or(0, |runs| runs.run_epochs) as f64;
        self.manifest.wall_s = wall_s;
        self.manifest.throughput_epochs_per_s = if wall_s > 0.0 { epochs / wall_s } else { 0.0 };
    }

    /// Writes a run directory, whole or not at all.
    ///
    /// # Errors
    /// When the disk is full or the directory cannot be written to.
    pub fn write(&self, directory: &Path) -> Result<(), FileError> {
        let mut files = AtomicDir::create(directory)?;
        for file in self.files() {
            files.write_parts(file.name, file.parts)?;
        }
        files.commit()
    }

    /// The files of a run directory, the manifest last: where it is, the rest is whole. Without runs (covariance analysis)
    /// there is no table of them.
    pub(super) fn files(&self) -> Vec<OutputFile<'_>> {
        let [
            epochs_name,
            fan_name,
            runs_name,
            summary_name,
            page_name,
            manifest_name,
        ] = RUN_FILES;
        let Navigation {
            runs, epochs, fan, ..
        } = &self.navigation;
        let texts = [
            (epochs_name, epochs_csv(epochs)),
            (fan_name, fan_csv(fan)),
            (summary_name, json(self)),
        ];
        let hashes = texts.iter().map(|(name, text)| (*name, digest([text])));
        let runs_hash = runs
            .as_ref()
            .map(|result| (runs_name, digest(runs_csv(result))));
        let outputs = hashes
            .chain(runs_hash)
            .map(|(name, hash)| (name.to_owned(), hash))
            .collect();
        let manifest = Manifest {
            outputs,
            ..self.manifest.clone()
        };
        let mut files: Vec<OutputFile<'_>> = texts
            .into_iter()
            .map(|(name, text)| OutputFile::whole(name, text))
            .collect();
        let table = runs.as_ref().map(|result| OutputFile {
            name: runs_name,
            parts: Box::new(runs_csv(result)),
        });
        files.splice(2..2, table);
        files.push(OutputFile::whole(page_name, self.document().html()));
        files.push(OutputFile::whole(manifest_name, json(&manifest)));
        files
    }
}

/// BLAKE3 of a text, part by part, in hexadecimal.
fn digest(parts: impl IntoIterator<Item = impl AsRef<str>>) -> String {
    let mut hasher = blake3::Hasher::new();
    for part in parts {
        hasher.update(part.as_ref().as_bytes());
    }
    hasher.finalize().to_hex().to_string()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::{Input, ModelNote, sample};
    use nav_sim_navigation::metrics::{self, FanEpoch, Summary};
    use nav_sim_navigation::scenario::Scenario;

    /// Names and texts.
    fn files() -> Vec<(&'static str, String)> {
        let result = sample::result();
        let epochs = metrics::epochs(&result);
        let summary = Summary::of(&result, &epochs, 7);
        let manifest = Manifest {
            schema_version: Manifest::SCHEMA_VERSION,
            version: "0.1.0".into(),
            command: ["nav-sim", "run", "a<b.toml"].map(str::to_owned).to_vec(),
            seed: Some(7),
            configuration: Scenario::default(),
            spread: false,
            inputs: vec![Input {
                role: "trajectory".into(),
                path: "a<b.toml".into(),
                blake3: "ab".into(),
            }],
            outputs: Default::default(),
            model: ModelNote {
                estimator: Some("dr-awv".into()),
            },
            threads: 2,
            independent_windows: None,
            wall_s: 2.0,
            throughput_epochs_per_s: 2400.0,
        };
        let quantiles_m = [0.1, 0.2, 0.4, 0.8, 1.6];
        let fan = [4.0, 8.0].map(|t_s| FanEpoch {
            t_s,
            quantiles_m,
            lincov_m: None,
        });
        let navigation = Navigation {
            runs: Some(result),
            epochs,
            fan: fan.to_vec(),
            summary,
        };
        let answer = RunAnswer {
            navigation,
            manifest,
            track: TrajectorySeries::default(),
        };
        answer
            .files()
            .into_iter()
            .map(|file| (file.name, file.parts.collect()))
            .collect()
    }

    #[test]
    fn the_manifest_comes_last_and_reads_back() {
        let files = files();
        assert_eq!(files.iter().map(|f| f.0).collect::<Vec<_>>(), RUN_FILES);
        let manifest: Manifest = serde_json::from_str(&files[5].1).unwrap();
        assert_eq!(manifest.hashes("trajectory"), ["ab"]);
        assert_eq!(manifest.configuration, Scenario::default());
        for (name, text) in files
            .iter()
            .filter(|(name, _)| !["report.html", "manifest.json"].contains(name))
        {
            assert_eq!(
                manifest.outputs[*name],
                blake3::hash(text.as_bytes()).to_hex().as_str(),
                "{name}"
            );
        }
    }

    /// Every number that says where it stands in summary.json stands there.
    #[test]
    fn the_page_has_the_numbers_of_the_summary() {
        let files = files();
        let (summary, page) = (&files[3].1, &files[4].1);
        let summary: serde_json::Value = serde_json::from_str(summary).unwrap();
        assert!(page.contains("a&lt;b.toml") && page.contains("<svg") && !page.contains("a<b"));
        let cells: Vec<(&str, &str)> = page
            .split("data-json=\"")
            .skip(1)
            .map(|rest| {
                (
                    rest.split('"').next().unwrap(),
                    rest.split(['>', '<']).nth(1).unwrap(),
                )
            })
            .collect();
        assert!(cells.len() > 40, "{}", cells.len());
        for (source, shown) in cells {
            let value = summary
                .pointer(source)
                .unwrap_or_else(|| panic!("{source} is not in summary.json"));
            assert_eq!(
                shown,
                crate::report::readable(value.as_f64().unwrap_or(f64::NAN)),
                "{source}"
            );
        }
    }
}
