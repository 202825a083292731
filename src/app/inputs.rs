//! Inputs that several commands share: files, settings, outages.

use super::{Context, Failure, IntoFailure, Result, refused};
use crate::io::model_file::{self, ModelFile, TurnOn};
use crate::io::recordings::{self, Gaps, ReadOptions};
use crate::io::toml_file::TomlSource;
use crate::io::{scenario_file, trajectory_file};
use crate::parse;
use crate::report::readable;
use nav_sim_navigation::ekf::{FilterModelError, FilterStates, InitialSettings};
use nav_sim_navigation::scenario::Scenario;
use nav_sim_navigation::sensors::defects::ImuSettings;
use nav_sim_navigation::sensors::outage::Outage;
use nav_sim_navigation::trajectory::Trajectory;
use nav_sim_navigation::trajectory::plausibility::{LIMITS, LimitExcess, examine};
use nav_sim_signal::imu::{Recording, Sensor};
use nav_sim_signal::noise::{Model, continuous};
use nav_sim_signal::units::Refused;
use std::path::{Path, PathBuf};
use std::str::FromStr;

/// A trajectory; where no vehicle moves so.
pub(crate) fn trajectory(path: &Path, context: &Context<'_>) -> Result<Trajectory> {
    let (trajectory, warnings) = trajectory_file::load(path, None)?;
    context.warn_each(&warnings);
    let (_, beyond) = examine(&trajectory, &LIMITS);
    let farthest = |e: &&LimitExcess| e.worst / e.limit;
    if let Some(worst) = beyond
        .iter()
        .max_by(|a, b| farthest(a).total_cmp(&farthest(b)))
    {
        let shown = path.display();
        let more = match beyond.len() - 1 {
            0 => String::new(),
            n => format!(", and {n} more such stretches"),
        };
        context.warn(format!(
            "{shown}: {worst}{more} (nav-sim trajectory check {shown} lists them)"
        ));
    }
    Ok(trajectory)
}

/// A model for navigation; the axes that it does not name.
pub(crate) fn model(path: &Path, context: &Context<'_>) -> Result<ModelFile> {
    let file = model_file::read(path)?;
    context.warn_each(file.doubts(path));
    Ok(file.for_navigation())
}

/// A noise model at the rate of the IMU.
pub(crate) fn at_rate(
    path: &Path,
    model: &Model,
    imu_hz: f64,
    context: &Context<'_>,
) -> Result<Model> {
    let from_hz = model.rate_hz;
    let converted = continuous::at_rate(model, imu_hz);
    let converted = converted.refuse_within(path.display()).map_err(|e| {
        e.hint(format!(
            "give a model at {imu_hz} Hz, or rate_hz = {from_hz} in [imu] of --scenario"
        ))
    })?;
    if !continuous::same_rate(from_hz, imu_hz) {
        let text = format!(
            "{}: converted from {from_hz} Hz to {imu_hz} Hz",
            path.display()
        );
        context.remark(text);
    }
    Ok(converted)
}

/// Static recordings, every channel of them; files without a time column at a rate that is given.
pub(crate) fn recordings(
    paths: &[PathBuf],
    rate_hz: Option<f64>,
    gaps: Gaps,
    context: &Context<'_>,
) -> Result<Vec<Recording>> {
    let options = ReadOptions {
        rate_hz,
        gaps,
        ..ReadOptions::default()
    };
    let (recordings, report) = recordings::read(paths, &options)?;
    context.warn_each(report.all_warnings());
    report
        .files
        .iter()
        .for_each(|file| context.detail(file.to_string()));
    Ok(recordings)
}

/// The outages on a trajectory that lasts from `span_s.0` to `span_s.1`; what is doubtful about them.
pub(crate) fn placed(
    scenario: &Scenario,
    span_s: (f64, f64),
    seed: u64,
    context: &Context<'_>,
) -> Result<Vec<Outage>> {
    let placed = scenario.outages_on(span_s, seed)?;
    context.warn_each(placed.remarks);
    Ok(placed.windows)
}

/// Turn-on biases that a model and that of the true errors state, where the scenario is silent.
pub(crate) fn turn_on(
    scenario: &mut Scenario,
    model: (&Path, &ModelFile),
    truth: Option<(&Path, &ModelFile)>,
    context: &Context<'_>,
) {
    expect_turn_on(&mut scenario.initial, model.1.turn_on, model.0, context);
    if let Some((path, file)) = truth {
        make_turn_on(&mut scenario.imu, file.turn_on, path, context);
    }
}

/// Lets the filter expect the turn-on bias that its model states, where settings are silent.
pub(crate) fn expect_turn_on(
    initial: &mut InitialSettings,
    stated: Option<TurnOn>,
    path: &Path,
    context: &Context<'_>,
) {
    let settings = [
        &mut initial.accel_bias_sigma_m_s2,
        &mut initial.gyro_bias_sigma_rad_s,
    ];
    set_turn_on(settings, stated, path, "the filter expects", context);
}

/// Gives the true IMU the turn-on bias that the model of its errors states, where settings are silent; a 0 is a setting.
pub(crate) fn make_turn_on(
    imu: &mut ImuSettings,
    stated: Option<TurnOn>,
    path: &Path,
    context: &Context<'_>,
) {
    let settings = [
        &mut imu.turn_on_bias_accel_m_s2,
        &mut imu.turn_on_bias_gyro_rad_s,
    ];
    set_turn_on(settings, stated, path, "the true IMU has", context);
}

fn set_turn_on(
    settings: [&mut Option<f64>; 2],
    stated: Option<TurnOn>,
    path: &Path,
    who: &str,
    context: &Context<'_>,
) {
    for (sensor, setting) in Sensor::ALL.into_iter().zip(settings) {
        if let (None, Some(sigma)) = (&setting, stated.unwrap_or_default().sigma(sensor)) {
            *setting = Some(sigma);
            let (sigma, unit) = (readable(sigma), sensor.unit());
            context.remark(format!(
                "{}: {who} a turn-on bias of {sigma} {unit} ({sensor}, 1 σ)",
                path.display()
            ));
        }
    }
}

/// States of the filter.
#[derive(clap::Args, Debug, Clone)]
pub(crate) struct FilterArgs {
    /// States of the filter: 15 (one bias per axis), 21 (and a scale factor per axis) or full (each process)
    /// [default: 15]
    #[arg(long = "filter", value_name = "STATES")]
    pub states: Option<FilterStates>,
    /// Turn-on biases that the filter expects beside the model: standard deviations (m/s², rad/s); 3 states each
    #[arg(long, value_name = "ACCEL,GYRO", value_parser = parse::pair, hide_short_help = true)]
    pub turn_on_bias: Option<[f64; 2]>,
    /// Scale-factor errors that the filter expects: standard deviations (ppm); 3 states each [default: 300,300 with
    /// --filter 21, else none]
    #[arg(long, value_name = "ACCEL,GYRO", value_parser = parse::pair, hide_short_help = true)]
    pub scale_ppm: Option<[f64; 2]>,
}

impl FilterArgs {
    /// Puts what is given over the settings of a file.
    pub(crate) fn over(&self, states: &mut FilterStates, initial: &mut InitialSettings) {
        *states = self.states.unwrap_or(*states);
        if let Some([accel, gyro]) = self.turn_on_bias {
            (initial.accel_bias_sigma_m_s2, initial.gyro_bias_sigma_rad_s) =
                (Some(accel), Some(gyro));
        }
        if let Some([accel, gyro]) = self.scale_ppm {
            (initial.accel_scale_sigma_ppm, initial.gyro_scale_sigma_ppm) =
                (Some(accel), Some(gyro));
        }
    }
}

/// A value of `--outage`: a window, or that there is none.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct OutageFlag(Option<Outage>);

impl FromStr for OutageFlag {
    type Err = Refused;

    fn from_str(text: &str) -> std::result::Result<Self, Refused> {
        let window = (text != "none").then(|| text.parse());
        window.transpose().map(Self)
    }
}

/// The windows among the values of `--outage`, of which "none" stands alone.
pub(crate) fn windows_of(outages: &[OutageFlag]) -> Result<Vec<Outage>> {
    if outages.len() > 1 && outages.contains(&OutageFlag(None)) {
        return refused("--outage none with other outages", "give windows, or none");
    }
    Ok(outages.iter().filter_map(|flag| flag.0).collect())
}

/// Settings in a TOML file and by key.
#[derive(clap::Args, Debug, Clone)]
pub(crate) struct ScenarioArgs {
    /// Settings in one TOML file; flags override it (see `nav-sim schema scenario`)
    #[arg(long, value_name = "FILE")]
    pub scenario: Option<PathBuf>,
    /// Scenario file whose section gnss is used
    #[arg(long, value_name = "FILE")]
    pub gnss: Option<PathBuf>,
    /// A setting of the scenario, such as gnss.rate_hz=5 (repeatable)
    #[arg(long, value_name = "KEY=VALUE", hide = true)]
    pub set: Vec<String>,
}

impl ScenarioArgs {
    /// The file with the settings over it; not yet checked.
    pub(crate) fn read(&self) -> Result<Scenario> {
        let file = self.scenario.as_deref();
        let read = file.map(scenario_file::read).transpose()?;
        let mut scenario = read.unwrap_or_default();
        if let Some(path) = &self.gnss {
            scenario.gnss = scenario_file::read(path)?.gnss;
        }
        if !self.set.is_empty() {
            let over: toml::Table = self.set.join("\n").parse().refuse_within("--set")?;
            let mut table = toml::Table::try_from(&scenario).refuse()?;
            merge(&mut table, over);
            scenario = TomlSource::new("", &toml::to_string(&table).refuse()?).get()?;
        }
        Ok(scenario)
    }
}

/// Settings of a run with outages in the place of those of the file.
#[derive(clap::Args, Debug, Clone)]
pub(crate) struct SettingsArgs {
    /// Window without fixes, in seconds (repeatable), or "none" (default: 300:390 and 700:790)
    #[arg(id = "outage", long = "outage", value_name = "START:END")]
    pub outages: Vec<OutageFlag>,
    /// Other settings.
    #[command(flatten)]
    pub file: ScenarioArgs,
}

impl SettingsArgs {
    /// The scenario with these outages; not yet checked.
    pub(crate) fn scenario(&self) -> Result<Scenario> {
        let mut scenario = self.file.read()?;
        if !self.outages.is_empty() {
            scenario.outage = Some(windows_of(&self.outages)?);
            (scenario.outage_periodic, scenario.outage_random) = (None, None);
        }
        Ok(scenario)
    }

    /// The scenario, checked.
    pub(crate) fn checked(&self) -> Result<Scenario> {
        let scenario = self.scenario()?;
        scenario.validate().refuse()?;
        Ok(scenario)
    }
}

/// Puts a table over another, key by key.
pub(crate) fn merge(into: &mut toml::Table, over: toml::Table) {
    for (key, value) in over {
        match (into.get_mut(&key), value) {
            (Some(toml::Value::Table(inner)), toml::Value::Table(over)) => merge(inner, over),
            (_, value) => _ = into.insert(key, value),
        }
    }
}

/// Refusal of a model without a filter, by the file that is at fault, of the model and the one with the settings; `advice` is on settings.
pub(crate) fn no_filter(
    e: &FilterModelError,
    model: &Path,
    settings: Option<&Path>,
    advice: &str,
) -> Failure {
    let within = |failure: Failure, file: &Path| failure.within(&file.display().to_string());
    match e {
        FilterModelError::Setting(_) => {
            let failure = Failure::input(e).hint(advice.to_owned());
            settings.into_iter().fold(failure, within)
        }
        _ => within(Failure::input(e), model),
    }
}
