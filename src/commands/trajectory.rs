//! `nav-sim trajectory`: reference trajectories.

use crate::app::inputs::ScenarioArgs;
use crate::app::{Command, Context, Failure, Invocation, OutputKind, PlainAnswer, Result, inputs};
use crate::io::trajectory_file::{self, parse_origin};
use crate::parse;
use crate::report::{gnss_csv, imu_csv, initial_toml};
use nav_sim_document::{Document, Table, Tone};
use nav_sim_navigation::closure::{Bounds, Closure};
use nav_sim_navigation::earth::GravityModel;
use nav_sim_navigation::scenario::Scenario;
use nav_sim_navigation::sensors::aiding::AidingSettings;
use nav_sim_navigation::sensors::imu::Truth;
use nav_sim_navigation::simulation::{Plan, record};
use nav_sim_navigation::trajectory::Trajectory;
use nav_sim_navigation::trajectory::plausibility::{LIMITS, examine};
use nav_sim_signal::noise::continuous;
use serde_json::json;
use std::path::PathBuf;

/// Make, check and convert reference trajectories
#[derive(clap::Args)]
pub(crate) struct TrajectoryArgs {
    #[command(subcommand)]
    pub(crate) command: TrajectoryCommand,
}

#[derive(clap::Subcommand)]
pub(crate) enum TrajectoryCommand {
    /// Write a motion profile as a table of evenly spaced rows
    ///
    /// Columns: time, latitude, longitude, height, velocity north, east, down, roll, pitch, yaw. Numbers have
    /// enough digits to be read back exactly.
    Generate(Invocation<Convert>),
    Check(Invocation<CheckTrajectory>),
    /// Convert a trajectory file of any kind to a nav-sim table, or to TUM
    ///
    /// The rows are those of the input, or evenly spaced ones with --rate-hz. Local coordinates become latitude,
    /// longitude and height. A path without attitude gets the heading and pitch along it. With -o FILE.tum the rows are those of
    /// TUM, as evo reads them: t x y z qx qy qz qw, east, north, up of --origin (default: the first row), body forward, left, up.
    Convert(Invocation<Convert>),
    Record(Invocation<Record>),
}

/// The trajectory of a command.
#[derive(clap::Args, Debug)]
struct TrajectorySource {
    /// Motion profile (.toml) or table (.csv, .tsv, .txt, also .gz)
    #[arg(id = "trajectory", value_name = "TRAJECTORY")]
    path: PathBuf,
    /// Origin of local coordinates, if the file does not state it: latitude, longitude, height
    #[arg(long, value_name = "LAT_DEG,LON_DEG,H_M", value_parser = origin, allow_hyphen_values = true)]
    origin: Option<[f64; 3]>,
}

/// Latitude, longitude (rad), height (m).
fn origin(text: &str) -> Result<[f64; 3], String> {
    parse_origin(text)
        .ok_or_else(|| "expected LAT_DEG,LON_DEG,H_M, latitude within ±89.9".to_owned())
}

impl TrajectorySource {
    /// Reads it, and warns of what is doubtful about it.
    fn read(&self, context: &Context<'_>) -> Result<(Trajectory, Vec<String>)> {
        let read = trajectory_file::load(&self.path, self.origin)?;
        context.warn_each(&read.1);
        Ok(read)
    }
}

/// Table of the rows of a trajectory, or of evenly spaced ones.
#[derive(clap::Args, Debug)]
pub struct Convert {
    #[command(flatten)]
    source: TrajectorySource,
    /// Instants per second (default: of generate 100, of convert the rows of the input)
    #[arg(long, value_name = "HZ", value_parser = parse::rate_hz)]
    pub(crate) rate_hz: Option<f64>,
}

impl Command for Convert {
    type Answer = PlainAnswer;
    const NAME: &'static str = "trajectory convert";
    const OUT: OutputKind = OutputKind::File {
        name: "trajectory.csv",
        help: "Table to write (.csv, .csv.gz or .tum); without it, standard output",
    };
    const PLOT: bool = false;
    const PRINTS_FILE: bool = true;

    fn run(&self, context: &Context<'_>) -> Result<PlainAnswer> {
        let (trajectory, _) = self.source.read(context)?;
        let count = trajectory_file::instants(&trajectory, self.rate_hz).len();
        let json = json!({
            "schema_version": 1,
            "start_s": trajectory.start_s(),
            "end_s": trajectory.end_s(),
            "rows": count,
        });
        let document = Document::new("Trajectory", Tone::Good, [format!("{count} rows")]);
        let text = match context.writes(".tum") {
            true => trajectory_file::tum(&trajectory, self.rate_hz, self.source.origin),
            false => trajectory_file::csv(&trajectory, self.rate_hz),
        };
        Ok(PlainAnswer::new(json, document).with([("", text)]))
    }
}

/// Check a trajectory: could a vehicle move so, and does navigation close on it?
///
/// Closure: the noise-free IMU samples of the trajectory are mechanised from its exact start and compared with
/// it. The difference is the error of the strapdown algorithm at this rate. Closure beyond a bound and motion beyond
/// a limit end with exit code 3. Velocity columns that contradict the positions are warnings.
#[derive(clap::Args, Debug)]
pub struct CheckTrajectory {
    #[command(flatten)]
    source: TrajectorySource,
    /// IMU rate at which the closure is computed
    #[arg(long, value_name = "HZ", default_value_t = 100.0, value_parser = parse::rate_hz)]
    rate_hz: f64,
    /// Bound on the position error of the closure (m)
    #[arg(long, value_name = "M", default_value_t = Bounds::default().position_m, value_parser = parse::positive)]
    max_position_m: f64,
    /// Largest plausible speed (m/s)
    #[arg(long, value_name = "M_S", default_value_t = LIMITS[0], value_parser = parse::positive)]
    limit_speed: f64,
}

/// Stretches beyond limits that are said one by one.
const SAID: usize = 10;

impl Command for CheckTrajectory {
    type Answer = PlainAnswer;
    const NAME: &'static str = "trajectory check";
    const PLOT: bool = false;

    fn run(&self, context: &Context<'_>) -> Result<PlainAnswer> {
        let (trajectory, warnings) = self.source.read(context)?;
        let mut limits = LIMITS;
        limits[0] = self.limit_speed;
        let bounds = Bounds {
            position_m: self.max_position_m,
            ..Bounds::default()
        };
        let (largest, beyond) = examine(&trajectory, &limits);
        let name = self.source.path.display().to_string();
        for excess in beyond.iter().take(SAID) {
            context.warn(format!("{name}: {excess}"));
        }
        let closure = Closure::new(&trajectory, self.rate_hz, GravityModel::default())
            .map_err(|e| Failure::input(format!("{name}: {e}")).hint("give another --rate-hz"))?;
        let is_within = closure.within(&bounds);
        let places = trajectory.knots().iter();
        let places: Vec<_> = places.map(|t| trajectory.kinematics(*t).r_e).collect();
        let motion = |[speed_m_s, acceleration_m_s2, jerk_m_s3, rate_deg_s]: [f64; 4]| {
            json!({
                "speed_m_s": speed_m_s,
                "acceleration_m_s2": acceleration_m_s2,
                "jerk_m_s3": jerk_m_s3,
                "rate_deg_s": rate_deg_s,
            })
        };
        let beyond: Vec<String> = beyond.iter().map(ToString::to_string).collect();
        let json = json!({
            "file": name,
            "start_s": trajectory.start_s(),
            "end_s": trajectory.end_s(),
            "points": places.len(),
            // chords between the points
            "path_m": places.windows(2).map(|w| w[0].distance(w[1])).sum::<f64>(),
            "largest": motion(largest),
            "limits": motion(limits),
            "beyond_limits": beyond,
            "warnings": warnings,
            "closure": closure,
            "within_bounds": is_within,
            "bounds": bounds,
        });
        let rows = [
            ("path (m)", "path_m -"),
            ("speed (m/s)", "largest/speed_m_s limits/speed_m_s"),
            (
                "acceleration (m/s²)",
                "largest/acceleration_m_s2 limits/acceleration_m_s2",
            ),
            (
                "jerk over 0.1 s (m/s³)",
                "largest/jerk_m_s3 limits/jerk_m_s3",
            ),
            (
                "angular rate (deg/s)",
                "largest/rate_deg_s limits/rate_deg_s",
            ),
            (
                "closure: position (m)",
                "closure/position_m bounds/position_m",
            ),
            ("horizontal (m)", "closure/horizontal_m -"),
            ("velocity (m/s)", "closure/velocity_m_s bounds/velocity_m_s"),
            ("attitude (rad)", "closure/attitude_rad bounds/attitude_rad"),
        ];
        let (start_s, points) = (trajectory.start_s(), places.len());
        let length_s = trajectory.end_s() - start_s;
        let path = format!("{name}: {length_s} s from {start_s} s, {points} points");
        let closes = format!(
            "closure at {} Hz over {} s: {}",
            closure.rate_hz,
            closure.duration_s,
            if is_within {
                "within bounds"
            } else {
                "BEYOND A BOUND"
            },
        );
        let table = Table::of_keys(&json, &["", "largest", "limit"], &rows).columns(usize::MAX);
        let table = table.lines().map(str::to_owned);
        let (mut missed, mut hints) = (Vec::new(), Vec::new());
        if !is_within {
            let (c, b) = (&closure, &bounds);
            missed.push(format!(
                "closure at {} Hz is {:.3e} m, {:.3e} m/s, {:.3e} rad, beyond {:e} m, {:e} m/s or {:e} rad",
                c.rate_hz,
                c.position_m,
                c.velocity_m_s,
                c.attitude_rad,
                b.position_m,
                b.velocity_m_s,
                b.attitude_rad
            ));
            hints.push("a higher --rate-hz closes better; rough motion may need a wider bound");
        }
        if !beyond.is_empty() {
            let stretches = match beyond.len() {
                1 => "1 stretch".to_owned(),
                n => format!("{n} stretches"),
            };
            missed.push(format!("the motion is beyond a limit in {stretches}"));
            hints.push("a vehicle that moves so needs a larger --limit-speed");
        }
        let message = format!("{name}: {}", missed.join("; "));
        let unmet = (!missed.is_empty()).then(|| Failure::bound(message).hint(hints.join("; ")));
        let lines = [path, closes].into_iter().chain(table);
        let document = Document::new("Trajectory", Tone::Good, lines);
        Ok(PlainAnswer::new(json, document).with_unmet(unmet))
    }
}

/// Write what an IMU with the noise of MODEL and a GNSS receiver record along a trajectory
///
/// The files are those that `fuse` reads: imu.csv (rates), gnss.csv, reference.csv (the truth, 10 Hz),
/// initial.toml (a start drawn from the initial standard deviations). The noise is that of the first run of
/// `run` with the same seed; a turn-on bias that MODEL states is drawn too.
#[derive(clap::Args, Debug)]
pub struct Record {
    #[command(flatten)]
    source: TrajectorySource,
    /// Noise model of the IMU
    #[arg(value_name = "MODEL")]
    model: PathBuf,
    /// Settings, of which [imu], [gnss] and [initial] are used.
    #[command(flatten)]
    settings: ScenarioArgs,
}

const RECORDED: [&str; 4] = ["imu.csv", "gnss.csv", "reference.csv", "initial.toml"];

impl Command for Record {
    type Answer = PlainAnswer;
    const NAME: &'static str = "trajectory record";
    const OUT: OutputKind = OutputKind::Directory {
        path: "out/recording",
        files: &RECORDED,
    };
    const PLOT: bool = false;
    const PAGE: bool = false;

    fn run(&self, context: &Context<'_>) -> Result<PlainAnswer> {
        let mut scenario = self.settings.read()?;
        let (trajectory, _) = self.source.read(context)?;
        let file = inputs::model(&self.model, context)?;
        let model = continuous::at_rate(&file.model, scenario.imu.rate_hz)
            .map_err(|e| Failure::input(format!("{}: {e}", self.model.display())))?;
        inputs::make_turn_on(&mut scenario.imu, file.turn_on, &self.model, context);
        let seed = context.seed_or(scenario.run.seed);
        // a recording is what IMU and receiver give: neither barometer nor wheel, no filter
        let scenario = Scenario {
            baro: None,
            aiding: AidingSettings::default(),
            ..scenario
        };
        let experiment = scenario.experiment(&trajectory, Truth::Model(&model), &[], &[], seed);
        let plan = Plan::new(&experiment).map_err(Failure::input)?;
        let recording = record(&plan, 0);
        let texts = [
            imu_csv(&recording.imu),
            gnss_csv(&recording.gnss),
            trajectory_file::csv(&trajectory, Some(10.0)),
            initial_toml(trajectory.start_s(), &recording.start, &scenario.initial),
        ];
        let json = json!({ "schema_version": 1, "files": RECORDED });
        let document = Document::new("Recorded drive", Tone::Good, [RECORDED.join(", ")]);
        Ok(PlainAnswer::new(json, document).with(RECORDED.into_iter().zip(texts)))
    }
}
