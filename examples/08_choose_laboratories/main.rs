//! How often `nav-sim choose` finds what is truly best: simulated laboratories of K recordings of the virtual consumer
//! IMU, whose parameters differ from recording to recording, clean or contaminated as in the paper's scenarios II and
//! III. The true value of each candidate is measured on fresh recordings, of the same kind and clean.
//!
//! `cargo run --release --example 08_choose_laboratories -- LABORATORIES RECORDINGS CASE` (default 100 6 clean). Cases:
//! `clean`; `II`, `III`: the recordings are contaminated, operation too; `II-clean`, `III-clean`: operation is clean.
#![expect(clippy::print_stdout, reason = "an example shows its results")]

use nav_sim::calibration::{Settings, replicates};
use nav_sim::choose::{Candidate, Contender, Drive, Fold, Laboratory, Ranking, Unit};
use nav_sim::formats::{contamination_file, model_file};
use nav_sim::prelude::*;
use nav_sim::signal::imu::{Channel, Recording};
use nav_sim::signal::noise::VirtualImu;
use nav_sim::signal::noise::contamination::Contamination;
use rayon::prelude::*;
use std::error::Error;
use std::path::{Path, PathBuf};

type Failure = Box<dyn Error + Send + Sync>;

const SAMPLES: usize = 1 << 16;
const SCALES: u32 = 13;
/// Fresh recordings on which the truth about a candidate is measured.
const FRESH: u64 = 24;
const RUNS: u64 = 16;

/// What a laboratory says and what is true.
struct Outcome {
    /// Whether the winner is truly best, or not told from what is.
    right: bool,
    /// Whether the winner is truly best.
    best: bool,
    /// Whether the data told anything.
    tells: bool,
    /// Of each other candidate, whether the 95 % interval of its difference to the winner holds the truth.
    held: Vec<bool>,
    /// True scores of the candidates.
    truth: Vec<f64>,
}

struct Study {
    file: model_file::ModelFile,
    drive: Drive,
    candidates: Vec<Candidate>,
    recorded: Option<Contamination>,
    operated: Option<Contamination>,
    recordings: u64,
}

impl Study {
    fn recording(
        &self,
        seed: u64,
        replicate: u64,
        contamination: Option<&Contamination>,
    ) -> Result<Recording, Failure> {
        let (model, spread) = (&self.file.model, self.file.spread.as_ref());
        let imu = VirtualImu {
            model,
            spread,
            contamination,
            seed,
        };
        Ok(imu.recording(replicate, &Channel::ALL, SAMPLES)?)
    }

    /// Laboratory `seed`: leave-one-out, and what is true of every fold's models on fresh recordings.
    fn outcome(&self, seed: u64) -> Result<Outcome, Failure> {
        let settings = Settings {
            rate_hz: self.file.model.rate_hz,
            ..Settings::default()
        };
        let recordings: Vec<Recording> = (1..=self.recordings)
            .map(|k| self.recording(seed, k, self.recorded.as_ref()))
            .collect::<Result<_, _>>()?;
        let unit = |r: &Recording| {
            let replicates = replicates(r, Some(SCALES), &settings.tuning)?;
            Ok::<_, Failure>(Unit {
                name: r.name.clone(),
                replicates,
            })
        };
        let units = recordings.iter().map(unit).collect::<Result<_, _>>()?;
        let laboratory = Laboratory::new(units, settings, None);
        let leave_out = |k: usize, r: &Recording| {
            self.drive.leave_out(
                &laboratory,
                k,
                std::slice::from_ref(r),
                &self.candidates,
                RUNS,
                &|_| (),
            )
        };
        let folds: Vec<(String, Fold)> = recordings
            .iter()
            .enumerate()
            .map(|(k, r)| Ok((r.name.clone(), leave_out(k, r)?)))
            .collect::<Result<_, Failure>>()?;
        let contenders: Vec<Contender> = self.candidates.iter().map(Contender::from).collect();
        let ranking = Ranking::new(&contenders, &folds);
        let truth = self.truth(seed, &laboratory)?;
        Ok(self.judged(&ranking, truth))
    }

    /// Mean scores of the models of all recordings on fresh ones.
    fn truth(&self, seed: u64, laboratory: &Laboratory) -> Result<Vec<f64>, Failure> {
        // each has the part that one of the laboratory's has in a scenario, and noise of its own
        let one = |k: u64| {
            let seed = seed + 1_000_000 * (1 + k / self.recordings);
            self.recording(seed, 1 + k % self.recordings, self.operated.as_ref())
        };
        let fresh: Vec<Recording> = (0..FRESH).map(one).collect::<Result<_, _>>()?;
        let models = self.drive.models(laboratory, None, &self.candidates)?;
        let scores = self
            .drive
            .scores(&self.candidates, &models, &fresh, RUNS * FRESH)?;
        let scores = scores.ok_or("a recording is shorter than the drive")?;
        Ok(scores.iter().map(|s| s.log_score).collect())
    }

    fn judged(&self, ranking: &Ranking, truth: Vec<f64>) -> Outcome {
        let eligible = || (0..truth.len()).filter(|c| self.candidates[*c].is_eligible());
        let best = eligible()
            .max_by(|a, b| truth[*a].total_cmp(&truth[*b]))
            .unwrap_or(0);
        let winner = ranking.winner().index;
        let tied = |c: usize| ranking.candidates.iter().any(|p| p.index == c && p.tied);
        let others = ranking.candidates.iter().filter(|p| p.index != winner);
        let held = others.map(|p| {
            let (low, high) = p.difference.log_score.ci95;
            let difference = truth[p.index] - truth[winner];
            low <= difference && difference <= high
        });
        Outcome {
            right: tied(best),
            best: best == winner,
            tells: ranking.tells,
            held: held.collect(),
            truth,
        }
    }
}

fn contamination(name: &str, rate_hz: f64) -> Result<Contamination, Failure> {
    Ok(contamination_file::find(name, rate_hz)?)
}

fn main() -> Result<(), Failure> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let number =
        |i: usize, default: u64| arguments.get(i).map_or(Ok(default), |a| a.parse::<u64>());
    let (laboratories, recordings) = (number(0, 100)?, number(1, 6)?);
    let case = arguments.get(2).map_or("clean", String::as_str);
    let here = |name: &str| -> PathBuf { Path::new(env!("CARGO_MANIFEST_DIR")).join(name) };
    let file = model_file::read(&here("calib_data/consumer_mems.toml"))?;
    let rate_hz = file.model.rate_hz;
    let recorded = match case.trim_end_matches("-clean") {
        "clean" => None,
        scenario => Some(contamination(&format!("section5-{scenario}"), rate_hz)?),
    };
    let operated = if case.ends_with("clean") {
        None
    } else {
        recorded.clone()
    };
    let (trajectory, _) = load_trajectory(
        &here("trajectories/figure_eight.toml"),
        &TrajectoryOptions::default(),
    )?;
    let outage = Outage {
        start_s: 60.0,
        end_s: 90.0,
    };
    let drive = Drive::new(&trajectory, Scenario::default(), vec![outage], rate_hz, 1)?;
    let candidates: Vec<Candidate> = ["awv N2", "sr-awv N2", "dr-awv N2", "awv WN+RW"]
        .iter()
        .map(|name| {
            let (estimator, model) = name.split_once(' ').ok_or("estimator and model")?;
            Ok::<_, Failure>(Candidate::new(estimator.parse()?, model.parse()?))
        })
        .collect::<Result<_, _>>()?;
    let study = Study {
        file,
        drive,
        candidates,
        recorded,
        operated,
        recordings,
    };
    let all: Vec<Outcome> = (1..=laboratories)
        .into_par_iter()
        .map(|seed| study.outcome(seed))
        .collect::<Result<_, _>>()?;
    let percent = |count: usize, of: usize| 100.0 * count as f64 / of as f64;
    let share = |of: fn(&Outcome) -> bool| percent(all.iter().filter(|o| of(o)).count(), all.len());
    let held: Vec<bool> = all.iter().flat_map(|o| o.held.clone()).collect();
    println!("{case}: {laboratories} laboratories of {recordings} recordings of {SAMPLES} samples");
    println!(
        "the winner is truly best, or not told from what is: {:.1} %",
        share(|o| o.right)
    );
    println!(
        "the winner is truly best: {:.1} %; the data tell: {:.1} %",
        share(|o| o.best),
        share(|o| o.tells)
    );
    println!(
        "intervals of differences to the winner that hold the truth: {:.1} % of {}",
        percent(held.iter().filter(|h| **h).count(), held.len()),
        held.len()
    );
    for (c, candidate) in study.candidates.iter().enumerate() {
        let mean = all.iter().map(|o| o.truth[c]).sum::<f64>() / all.len() as f64;
        println!("{candidate}: true log score {mean:.3} nats");
    }
    Ok(())
}
