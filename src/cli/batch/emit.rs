//! `nav-sim batch emit`: scripts for schedulers.

use super::Place;
use super::plan::duration;
use crate::cli::{Failure, Session};
use nav_sim::formats::study_directory;
use std::fmt::Write;
use std::path::Path;

/// Print a script that runs a planned study on a cluster or here
///
/// Paths are as seen from the directory in which the script is submitted; it must be shared by all machines.
/// Every script may be submitted again and again: what is done is skipped. If the study is planned already, a
/// --time too short for a unit is refused.
#[derive(clap::Args, Debug)]
#[command(before_help = "\
Examples:
  nav-sim batch emit slurm examples/quick_study.toml --shards 16 --time 4h > study.sh
  nav-sim batch emit hyperqueue examples/quick_study.toml --shards 64 > study.py
  nav-sim batch emit local examples/quick_study.toml --shards 2 > study.sh && bash -n study.sh")]
pub(crate) struct Args {
    /// For what
    #[arg(value_enum)]
    target: Target,
    #[command(flatten)]
    place: Place,
    /// Tasks
    #[arg(long, value_name = "N", default_value_t = 16, value_parser = clap::value_parser!(u64).range(1..=1_000_000))]
    shards: u64,
    /// Processors of a task
    #[arg(long, value_name = "C", default_value_t = 2, value_parser = clap::value_parser!(u16).range(1..))]
    cpus: u16,
    /// Longest time of a task: seconds, or with s, m, h
    #[arg(long, value_name = "TIME", default_value = "1h", value_parser = super::run::time)]
    time: std::time::Duration,
}

#[derive(clap::ValueEnum, Clone, Copy, Debug, PartialEq, Eq)]
enum Target {
    /// HyperQueue, by its Python package: server and workers here, or a server that runs already
    Hyperqueue,
    /// A Slurm job array
    Slurm,
    /// A PBS job array
    Pbs,
    /// A Kubernetes Indexed Job
    K8s,
    /// Processes on this machine
    Local,
}

pub(crate) fn run(args: &Args, session: &Session) -> Result<(), Failure> {
    args.place.read()?;
    let script = Script::of(args, session.asked_seed());
    let is_planned = study_directory::plan(&args.place.directory())?.is_some();
    if is_planned && args.target != Target::Local {
        let planned = args.place.planned(session.asked_seed())?;
        long_enough(script.limit_s() as f64, planned.unit_s(u64::from(args.cpus)), session)?;
    }
    session.printer.result(script.text(args.target).trim_end());
    Ok(())
}

/// A task must be able to finish a unit, or it would be started again for ever.
fn long_enough(limit_s: f64, unit_s: f64, session: &Session) -> Result<(), Failure> {
    let unit = format!("a unit takes about {} by the plan", duration(unit_s));
    if limit_s < unit_s {
        let message = format!("--time: a task works for {}, but {unit}", duration(limit_s));
        return Err(Failure::input(message).hint("a longer --time, or a study with fewer unit_runs"));
    }
    if limit_s < 3.0 * unit_s {
        session.printer.warn(&format!("a task works for {}, and {unit}", duration(limit_s)));
    }
    Ok(())
}

/// What goes into every script.
struct Script {
    seed: Option<u64>,
    study: String,
    directory: String,
    name: String,
    shards: u64,
    cpus: u16,
    seconds: u64,
}

impl Script {
    fn of(args: &Args, seed: Option<u64>) -> Self {
        let text = |path: &Path| path.to_string_lossy().into_owned();
        let stem = args.place.study.file_stem().unwrap_or_default().to_string_lossy();
        let tame = |c: char| if c.is_ascii_alphanumeric() { c.to_ascii_lowercase() } else { '-' };
        Self {
            seed,
            study: text(&args.place.study),
            directory: text(&args.place.directory()),
            name: stem.chars().map(tame).collect::<String>().trim_matches('-').to_owned(),
            shards: args.shards,
            cpus: args.cpus,
            seconds: args.time.as_secs().max(1),
        }
    }

    fn text(&self, target: Target) -> String {
        match target {
            Target::Hyperqueue => self.hyperqueue(),
            Target::Slurm => self.slurm(),
            Target::Pbs => self.pbs(),
            Target::K8s => self.k8s(),
            Target::Local => self.local(),
        }
    }

    /// Words of a command of the study.
    fn words(&self, command: &str) -> Vec<String> {
        let words = ["nav-sim", "batch", command, &self.study, "--out", &self.directory].map(str::to_owned);
        let seed = self.seed.map(|seed| ["--seed".to_owned(), seed.to_string()]);
        words.into_iter().chain(seed.into_iter().flatten()).collect()
    }

    /// How long a task works (s): it stops in time to be counted.
    fn limit_s(&self) -> u64 {
        self.seconds - (self.seconds / 10).min(120)
    }

    fn shell(&self, command: &str) -> String {
        self.words(command).iter().map(|w| shell_quoted(w)).collect::<Vec<_>>().join(" ")
    }

    /// The working command of a task whose index the scheduler gives.
    fn task(&self) -> String {
        let limit = self.limit_s();
        format!(
            "{} --shards {} -j {} --time-limit {limit}s --no-progress",
            self.shell("run"),
            self.shards,
            self.cpus
        )
    }

    const fn last(&self) -> u64 {
        self.shards - 1
    }

    fn clock(&self) -> String {
        format!("{:02}:{:02}:{:02}", self.seconds / 3600, self.seconds / 60 % 60, self.seconds % 60)
    }

    fn slurm(&self) -> String {
        format!(
            "#!/usr/bin/env bash\n\
             # sbatch this file after `{plan}`; then `{merge}`.\n\
             #SBATCH --job-name={name}\n\
             #SBATCH --array=0-{last}\n\
             #SBATCH --cpus-per-task={cpus}\n\
             #SBATCH --time={clock}\n\
             #SBATCH --requeue\n\
             #SBATCH --open-mode=append\n\
             #SBATCH --output=%x_%a.log\n\
             {task}\n\
             code=$?\n\
             # 75: stopped in time, to be resumed\n\
             if [ $code -eq 75 ]; then scontrol requeue \"${{SLURM_ARRAY_JOB_ID}}_${{SLURM_ARRAY_TASK_ID}}\"; fi\n\
             exit $code\n",
            plan = self.shell("plan"),
            merge = self.shell("merge"),
            name = self.name,
            last = self.last(),
            cpus = self.cpus,
            clock = self.clock(),
            task = self.task(),
        )
    }

    fn pbs(&self) -> String {
        // an array of one is no array to PBS
        let array = if self.shards > 1 { format!("#PBS -J 0-{}\n", self.last()) } else { String::new() };
        let index = if self.shards > 1 { "" } else { "export PBS_ARRAY_INDEX=0\n" };
        format!(
            "#!/usr/bin/env bash\n\
             # qsub this file after `{plan}`; then `{merge}`.\n\
             #PBS -N {name}\n\
             {array}\
             #PBS -l select=1:ncpus={cpus}\n\
             #PBS -l walltime={clock}\n\
             #PBS -r y\n\
             cd \"$PBS_O_WORKDIR\" || exit 1\n\
             {index}\
             {task}\n\
             # exit code 75: stopped in time; qsub the file again to go on\n",
            plan = self.shell("plan"),
            merge = self.shell("merge"),
            name = self.name.chars().take(15).collect::<String>(),
            cpus = self.cpus,
            clock = self.clock(),
            task = self.task(),
        )
    }

    fn k8s(&self) -> String {
        let command = ["sh", "-c", &format!("exec {}", self.task())].map(json_quoted).join(", ");
        format!(
            "# kubectl apply -f this file, after `{plan}` in the volume; then `{merge}` there.\n\
             # Put your image with nav-sim and the claim of a volume that all pods can write to.\n\
             apiVersion: batch/v1\n\
             kind: Job\n\
             metadata:\n  name: {name}\n\
             spec:\n\
             \x20 completionMode: Indexed\n\
             \x20 completions: {shards}\n\
             \x20 parallelism: {shards}\n\
             \x20 backoffLimitPerIndex: 3\n\
             \x20 podFailurePolicy:\n\
             \x20   rules:\n\
             \x20     # stopped in time, or a node drained: start the pod again without counting a failure\n\
             \x20     - action: Ignore\n\
             \x20       onExitCodes: {{ containerName: nav-sim, operator: In, values: [75] }}\n\
             \x20     - action: Ignore\n\
             \x20       onPodConditions: [{{ type: DisruptionTarget }}]\n\
             \x20 template:\n\
             \x20   spec:\n\
             \x20     restartPolicy: Never\n\
             \x20     terminationGracePeriodSeconds: 60\n\
             \x20     containers:\n\
             \x20       - name: nav-sim\n\
             \x20         image: nav-sim:latest\n\
             \x20         workingDir: /study\n\
             \x20         command: [{command}]\n\
             \x20         resources: {{ requests: {{ cpu: \"{cpus}\" }} }}\n\
             \x20         volumeMounts: [{{ name: study, mountPath: /study }}]\n\
             \x20     volumes:\n\
             \x20       - name: study\n\
             \x20         persistentVolumeClaim: {{ claimName: study }}\n",
            plan = self.shell("plan"),
            merge = self.shell("merge"),
            name = self.name,
            shards = self.shards,
            cpus = self.cpus,
        )
    }

    fn local(&self) -> String {
        format!(
            "#!/usr/bin/env bash\n\
             # {shards} processes on this machine, then the tables. Stop and repeat at will.\n\
             set -eu\n\
             {plan}\n\
             for i in $(seq 0 {last}); do\n\
             \x20 {run} --shard \"$i/{shards}\" -j {cpus} --no-progress &\n\
             done\n\
             wait\n\
             {merge}\n",
            shards = self.shards,
            last = self.last(),
            plan = self.shell("plan"),
            run = self.shell("run"),
            cpus = self.cpus,
            merge = self.shell("merge"),
        )
    }

    fn hyperqueue(&self) -> String {
        let mut words = self.words("run");
        let limit = self.limit_s();
        words.extend([
            "--shards".to_owned(),
            self.shards.to_string(),
            "-j".to_owned(),
            self.cpus.to_string(),
        ]);
        words.extend(["--time-limit".to_owned(), format!("{limit}s"), "--no-progress".to_owned()]);
        let list = |words: &[String]| words.iter().map(|w| json_quoted(w)).collect::<Vec<_>>().join(", ");
        let mut text = String::new();
        let _ = write!(
            text,
            "#!/usr/bin/env python3\n\
             \"\"\"pip install hyperqueue, then run this file where the study is: with the directory of a running\n\
             HyperQueue server as argument, or without, and a server and a worker are started here.\"\"\"\n\
             import subprocess\n\
             import sys\n\
             from pathlib import Path\n\n\
             from hyperqueue import Client, Job, LocalCluster\n\
             from hyperqueue.cluster import WorkerConfig\n\
             from hyperqueue.ffi.protocol import ResourceRequest\n\n\
             RUN = [{run}]\n\n\n\
             def work(client):\n\
             \x20   job = Job(default_workdir=Path.cwd(), max_fails={shards})\n\
             \x20   for _ in range({shards}):  # HQ_TASK_ID counts them from 0\n\
             \x20       job.program(RUN, resources=ResourceRequest(cpus={cpus}))\n\
             \x20   return client.wait_for_jobs([client.submit(job)], raise_on_error=False)\n\n\n\
             subprocess.run([{plan}], check=True)\n\
             if len(sys.argv) > 1:\n\
             \x20   work(Client(sys.argv[1]))\n\
             else:\n\
             \x20   with LocalCluster() as cluster:\n\
             \x20       cluster.start_worker(WorkerConfig())\n\
             \x20       work(cluster.client())\n\
             # exit code 75 of the merge: units are missing; run this file again\n\
             sys.exit(subprocess.run([{merge}]).returncode)\n",
            run = list(&words),
            shards = self.shards,
            cpus = self.cpus,
            plan = list(&self.words("plan")),
            merge = list(&self.words("merge")),
        );
        text
    }
}

fn shell_quoted(word: &str) -> String {
    let plain = |c: char| c.is_ascii_alphanumeric() || "-_./:,+=".contains(c);
    if !word.is_empty() && word.chars().all(plain) {
        word.to_owned()
    } else {
        format!("'{}'", word.replace('\'', "'\\''"))
    }
}

/// Also a Python and a YAML text.
fn json_quoted(word: &str) -> String {
    serde_json::Value::from(word).to_string()
}
