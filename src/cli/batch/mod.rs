//! `nav-sim batch`: grids of experiments in units that survive, resume and spread over machines.

mod emit;
mod inputs;
mod merge;
mod plan;
mod run;
mod shard;
mod status;
mod verify;

use super::{Failure, Session};
use nav_sim::formats::study_directory::{self, BatchDirectoryError};
use nav_sim::formats::study_file::{self, BatchFile};
use nav_sim::study::{Grid, Plan, PrepareError, StudyError, Unit, fingerprint};
use std::path::{Path, PathBuf};

/// Studies: grids of Monte-Carlo experiments, planned, run in pieces anywhere, merged
///
/// A study (TOML, see `nav-sim schema study`) is the product of trajectories, truths, scenarios, receivers and
/// outage sets, with several candidate models and filters on the same noise in each cell. `plan` cuts it into
/// units of work, `run` does those that are not done yet (any number of processes, on any machines that share
/// the directory; kill and repeat at will), `merge` makes the tables, the same bytes however it was run.
#[derive(clap::Args, Debug)]
#[command(before_help = "\
Examples:
  nav-sim batch plan examples/quick_study.toml --seed 1 -o out/quick
  nav-sim batch run examples/quick_study.toml -o out/quick
  nav-sim batch merge examples/quick_study.toml -o out/quick")]
pub(crate) struct Args {
    #[command(subcommand)]
    command: Command,
}

#[derive(clap::Subcommand, Debug)]
enum Command {
    Plan(plan::Args),
    Run(run::Args),
    Merge(merge::Args),
    Status(status::Args),
    Verify(verify::Args),
    Emit(emit::Args),
}

impl Args {
    /// Whether the command ends in good order at a signal, to be resumed.
    pub(crate) const fn heeds_signals(&self) -> bool {
        matches!(self.command, Command::Run(_))
    }
}

pub(crate) fn run(args: &Args, session: &Session) -> Result<(), Failure> {
    match &args.command {
        Command::Plan(args) => plan::run(args, session),
        Command::Run(args) => run::run(args, session),
        Command::Merge(args) => merge::run(args, session),
        Command::Status(args) => status::run(args, session),
        Command::Verify(args) => verify::run(args, session),
        Command::Emit(args) => emit::run(args, session),
    }
}

/// The study and its directory.
#[derive(clap::Args, Debug)]
pub(super) struct Place {
    /// The study (TOML)
    #[arg(value_name = "STUDY")]
    study: PathBuf,
    /// Directory of the study (default: out/ and the study's name)
    #[arg(long, short, value_name = "DIR")]
    out: Option<PathBuf>,
}

impl Place {
    fn directory(&self) -> PathBuf {
        let stem = || Path::new("out").join(self.study.file_stem().unwrap_or_default());
        self.out.clone().unwrap_or_else(stem)
    }

    fn read(&self) -> Result<BatchFile, Failure> {
        Ok(study_file::read(&self.study)?)
    }

    /// The plan in the directory, which must be that of the study, and have the seed if one is asked for.
    fn planned(&self, seed: Option<u64>) -> Result<Planned, Failure> {
        let (directory, file) = (self.directory(), self.read()?);
        let plan = study_directory::plan_of(&directory, &file.study, seed)?;
        let grid = Grid::of(&plan).map_err(|e| unusable(&self.study, &e))?;
        Ok(Planned { plan, grid, directory })
    }
}

/// A plan, read.
struct Planned {
    plan: Plan,
    grid: Grid,
    directory: PathBuf,
}

impl Planned {
    /// Refuses to compute with a build or on a machine that makes other numbers than the one that planned.
    fn same_numbers(&self) -> Result<(), Failure> {
        let (version, numerics) = (env!("CARGO_PKG_VERSION"), fingerprint());
        let same = self.plan.version == version && self.plan.numerics == numerics;
        if same {
            return Ok(());
        }
        let failure = Failure::input(format!(
            "the plan was made by nav-sim {} whose numbers are {}; this is {version}, whose numbers are {numerics}",
            self.plan.version, self.plan.numerics
        ));
        Err(failure.hint(
            "use one build on machines of one kind (same processor features and system library), or plan anew",
        ))
    }
}

impl Planned {
    /// What the longest unit takes by the plan's probe (s) on so many threads.
    fn unit_s(&self, threads: u64) -> f64 {
        let wall_s = |unit: Unit| {
            let batches = unit.runs.div_ceil(nav_sim::lanes::LANES as u64);
            self.plan.unit_s(&self.grid, unit) / threads.clamp(1, batches.max(1)) as f64
        };
        self.plan.units(&self.grid).map(wall_s).fold(0.0, f64::max)
    }

    /// The names of a cell on those axes that have more than one.
    fn cell_name(&self, cell: nav_sim::study::Cell) -> String {
        let grid = &self.grid;
        let sizes = [
            grid.trajectories.len(),
            grid.truths.len(),
            grid.scenarios.len(),
            grid.gnss.len(),
            grid.outages.len(),
        ];
        let names = grid.names(cell).into_iter().zip(sizes).filter(|(_, n)| *n > 1).map(|(name, _)| name);
        let name = names.collect::<Vec<_>>().join(", ");
        if name.is_empty() { grid.names(cell)[0].to_owned() } else { name }
    }
}

/// A refusal of the study as a whole.
fn unusable(study: &Path, e: &StudyError) -> Failure {
    Failure::input(format!("{}: {e}", study.display())).maybe_hint(e.hint())
}

impl From<BatchDirectoryError> for Failure {
    fn from(e: BatchDirectoryError) -> Self {
        let failure = if e.is_usage() { Self::input(&e) } else { Self::could_not(&e) };
        failure.maybe_hint(e.hint())
    }
}

impl From<PrepareError> for Failure {
    fn from(e: PrepareError) -> Self {
        Self::input(e)
    }
}
