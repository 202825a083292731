//! The files of a run directory.

use super::manifest::Manifest;
use super::pages::run_page;
use super::tables::{epochs_csv, fan_csv, runs_csv};
use super::trajectory::TrajectorySeries;
use nav_sim_navigation::metrics::{EpochMetrics, FanEpoch, Summary};
use nav_sim_navigation::simulation::RunResult;

/// A file to be written.
pub struct OutputFile<'a> {
    /// Name in the directory.
    pub name: &'static str,
    /// Its text, part by part: the table of many runs is never whole in memory.
    pub parts: Box<dyn Iterator<Item = String> + 'a>,
}

impl OutputFile<'_> {
    /// A small file.
    pub(crate) fn whole(name: &'static str, text: String) -> Self {
        Self { name, parts: Box::new(std::iter::once(text)) }
    }
}

/// Names of the files of a run directory.
pub(crate) const RUN_FILES: [&str; 6] =
    ["epochs.csv", "fan.csv", "runs.csv", "summary.json", "report.html", "manifest.json"];

/// The files of a run directory, the manifest last: where it is, the rest is whole. Without runs (covariance
/// analysis) there is no table of them. `track`: the reference trajectory.
#[must_use]
pub fn run_directory<'a>(
    runs: Option<&'a RunResult>,
    epochs: &[EpochMetrics],
    fan: &[FanEpoch],
    summary: &Summary,
    manifest: &Manifest,
    track: &TrajectorySeries,
) -> Vec<OutputFile<'a>> {
    let [epochs_name, fan_name, runs_name, summary_name, page_name, manifest_name] = RUN_FILES;
    let summary_text = summary_json(summary, manifest.throughput_epochs_per_s);
    let epochs_text = epochs_csv(epochs);
    let fan_text = fan_csv(fan);
    let texts = [(epochs_name, &epochs_text), (fan_name, &fan_text), (summary_name, &summary_text)];
    let tables = texts.map(|(name, text)| (name, digest([text])));
    let runs_digest = runs.map(|result| (runs_name, digest(runs_csv(result))));
    let outputs = tables.into_iter().chain(runs_digest).map(|(name, hash)| (name.to_owned(), hash)).collect();
    let with_outputs = Manifest { outputs, ..manifest.clone() };
    let runs = runs.map(|result| OutputFile { name: runs_name, parts: Box::new(runs_csv(result)) });
    let mut files = vec![OutputFile::whole(epochs_name, epochs_text), OutputFile::whole(fan_name, fan_text)];
    files.extend(runs);
    files.extend([
        OutputFile::whole(summary_name, summary_text),
        OutputFile::whole(page_name, run_page(epochs, fan, summary, manifest, track)),
        OutputFile::whole(manifest_name, json(&with_outputs)),
    ]);
    files
}

/// BLAKE3 of a text, part by part, in hexadecimal.
fn digest(parts: impl IntoIterator<Item = impl AsRef<str>>) -> String {
    let mut hasher = blake3::Hasher::new();
    for part in parts {
        hasher.update(part.as_ref().as_bytes());
    }
    hasher.finalize().to_hex().to_string()
}

/// `summary.json`, with how fast it was found (IMU epochs a second, all runs together): its only number that the
/// seed does not determine.
pub(crate) fn summary_json(summary: &Summary, throughput_epochs_per_s: f64) -> String {
    #[derive(serde::Serialize)]
    struct WithThroughput<'a> {
        #[serde(flatten)]
        summary: &'a Summary,
        throughput_epochs_per_s: f64,
    }
    json(&WithThroughput { summary, throughput_epochs_per_s })
}

/// Indented JSON with a final newline; NaN is null.
pub(crate) fn json(value: &impl serde::Serialize) -> String {
    serde_json::to_string_pretty(value).expect("plain structs with text keys are always JSON") + "\n"
}

#[cfg(test)]
mod tests {
    use super::super::{Input, ModelNote, sample};
    use super::*;
    use nav_sim_navigation::metrics;
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
            inputs: vec![Input { role: "trajectory".into(), path: "a<b.toml".into(), blake3: "ab".into() }],
            outputs: Default::default(),
            model: ModelNote { estimator: Some("dr-awv".into()) },
            threads: 2,
            independent_windows: None,
            wall_s: 2.0,
            throughput_epochs_per_s: 2400.0,
        };
        let quantiles_m = [0.1, 0.2, 0.4, 0.8, 1.6];
        let fan = [4.0, 8.0].map(|t_s| FanEpoch { t_s, quantiles_m, lincov_m: None });
        let track = TrajectorySeries::default();
        let files = run_directory(Some(&result), &epochs, &fan, &summary, &manifest, &track);
        files.into_iter().map(|file| (file.name, file.parts.collect())).collect()
    }

    #[test]
    fn the_manifest_comes_last_and_reads_back() {
        let files = files();
        assert_eq!(files.iter().map(|f| f.0).collect::<Vec<_>>(), RUN_FILES);
        let manifest: Manifest = serde_json::from_str(&files[5].1).unwrap();
        assert_eq!(manifest.hashes("trajectory"), ["ab"]);
        assert_eq!(manifest.configuration, Scenario::default());
        for (name, text) in files.iter().filter(|(name, _)| !["report.html", "manifest.json"].contains(name))
        {
            assert_eq!(manifest.outputs[*name], blake3::hash(text.as_bytes()).to_hex().as_str(), "{name}");
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
            .map(|rest| (rest.split('"').next().unwrap(), rest.split(['>', '<']).nth(1).unwrap()))
            .collect();
        assert!(cells.len() > 40, "{}", cells.len());
        for (source, shown) in cells {
            let value = summary.pointer(source).unwrap_or_else(|| panic!("{source} is not in summary.json"));
            assert_eq!(shown, crate::report::readable(value.as_f64().unwrap_or(f64::NAN)), "{source}");
        }
    }
}
