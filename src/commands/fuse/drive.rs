//! From the files of a request to a solution and its figures.

use super::summary::{Cause, FuseSummary, FuseVerdict, Initial, correlation, vehicle};
use super::{Fuse, MountingChoice, document};
use crate::app::{Context, Input, inputs};
use crate::app::{Failure, Refuse, Result};
use crate::commands::run::reduction_of;
use crate::io::fusion_files::{read_gnss, read_imu, read_initial, read_wheel};
use crate::io::model_file::ModelFile;
use crate::io::trajectory_file::{self, load_reference};
use nav_sim_document::{Importance, window};
use nav_sim_navigation::ekf::{Belief, FilterStates, InitialSettings};
use nav_sim_navigation::fusion::alignment::{Alignment, coarse, towards};
use nav_sim_navigation::fusion::mounting::{self, Mounting, MountingError};
use nav_sim_navigation::fusion::{
    Assessment, ClocksApart, Recorded, Settings, Solution, Start, WheelSpeed, Whiteness, assess,
    check_clocks, clocks_apart, displaced, earlier, fuse, fuse_correlated, interval_s, middle,
    outcome, rest_of_origin, rough_origin, vehicle_velocities, wheel_ratio,
};
use nav_sim_navigation::gnss::GnssFix;
use nav_sim_navigation::metrics::{ReductionQuality, VerdictKind};
use nav_sim_navigation::sensors::defects::ImuSettings;
use nav_sim_navigation::sensors::gnss::GnssSettings;
use nav_sim_navigation::sensors::outage::{FixedData, Outage, OutagePlan};
use nav_sim_navigation::simulation::lincov;
use nav_sim_navigation::simulation::lincov::{HeadingDoubt, weak_heading};
use nav_sim_navigation::trajectory::reference::Reference;
use nav_sim_signal::imu::ImuIncrement;
use nav_sim_signal::noise::{Composite, Model, Process, continuous, reduction};
use nav_sim_signal::units::DEG;
use serde::Serialize;
use serde_json::{Value, json};
use std::ops::Range;

/// Solution of a recorded drive.
#[derive(Debug, Serialize)]
#[serde(transparent)]
#[non_exhaustive]
pub struct FuseAnswer {
    /// States, standard deviations and innovations.
    #[serde(skip)]
    pub solution: Solution,
    /// Verdict and figures: `summary.json`.
    pub summary: FuseSummary,
    /// Quality of the model reduced to the filter's states, where it loses something.
    #[serde(skip)]
    pub reduction: Option<ReductionQuality>,
    /// Files by their roles.
    #[serde(skip)]
    pub(super) inputs: Vec<Input>,
    /// Settings, for the manifest.
    #[serde(skip)]
    pub(super) configuration: Value,
}

/// A drive that was read.
pub(crate) struct Drive {
    request: Fuse,
    settings: Settings,
    imu: Vec<ImuIncrement>,
    imu_rate_hz: f64,
    gnss: Vec<GnssFix>,
    wheel: Vec<WheelSpeed>,
    model: ModelFile,
    expected: InitialSettings,
    initial: Option<Start>,
    reference: Option<Reference>,
    configuration: Value,
}

impl Drive {
    /// Reads the files of a request.
    ///
    /// # Errors
    /// A setting out of range, a file that cannot be used.
    pub(crate) fn read(request: &Fuse, context: &Context<'_>) -> Result<Self> {
        let settings = request.settings();
        let (unsaid, gnss_sigma_factor) = request.gnss_sigma.unwrap_or((None, [1.0; 2]));
        let [position, velocity] = gnss_sigma_factor;
        let topic = |k: usize| {
            request
                .topic
                .get(k)
                .map(String::as_str)
                .filter(|t| !t.is_empty())
        };
        let imu = read_imu(&request.imu, request.columns.as_deref(), topic(0))?;
        let span_s = imu
            .samples
            .first()
            .zip(imu.samples.last())
            .map(|(first, last)| (first.t_s, last.t_s));
        let (mut gnss, remarks) = read_gnss(&request.gnss, unsaid.as_ref(), span_s, topic(1))?;
        for fix in &mut gnss {
            *fix = fix.with_sigmas_times(position, velocity);
            fix.t_s -= request.gnss_delay_s;
        }
        for note in imu.remarks.into_iter().chain(remarks) {
            match note.importance {
                Importance::Warning => context.warn(note.text),
                _ => context.remark(note.text),
            }
        }
        let wheel = request
            .odometer
            .as_deref()
            .map_or_else(|| Ok(Vec::new()), read_wheel)?;
        let initial = request
            .initial_file()
            .map(|path| read_initial(path))
            .transpose()?;
        let model = inputs::model(&request.model, context)?;
        if (model.model.rate_hz / imu.rate_hz - 1.0).abs() > 0.01 {
            let (from, to) = (model.model.rate_hz, imu.rate_hz);
            context.detail(format!(
                "the model was converted from {from} Hz to {to:.3} Hz"
            ));
        }
        let of_file = initial
            .as_ref()
            .map(|start| start.sigma.clone())
            .unwrap_or_default();
        let mut expected = request.expected(of_file);
        inputs::expect_turn_on(&mut expected, &model, &request.model, context);
        expected.validate().refuse()?;
        let options = trajectory_file::Options::default();
        let reference = request
            .reference
            .as_deref()
            .map(|path| load_reference(path, &options))
            .transpose()?;
        let reference = reference.map(|(reference, warnings)| {
            warnings.iter().for_each(|warning| context.warn(warning));
            reference
        });
        let mut configuration = json!({
            "settings": settings,
            "filter": request.filter,
            "initial": expected,
            "gnss_sigma": unsaid,
            "gnss_sigma_factor": gnss_sigma_factor,
            "gnss_correlation": request.gnss_correlation,
            "heading": request.given_heading(),
            "gnss_delay_s": request.gnss_delay_s,
        });
        let aiding = request.aiding();
        if !aiding.is_none() {
            configuration["aiding"] = json!(aiding);
        }
        Ok(Self {
            request: request.clone(),
            settings,
            imu: imu.samples,
            imu_rate_hz: imu.rate_hz,
            gnss,
            wheel,
            model,
            expected,
            initial,
            reference,
            configuration,
        })
    }

    /// Fuses it. Outages are placed on the fixes, those before the start are left out.
    ///
    /// # Errors
    /// Data and settings that do not fit together, or a filter that diverges.
    pub(crate) fn fuse(mut self, context: &Context<'_>) -> Result<FuseAnswer> {
        let origin_s = self.common_origin()?;
        let mut recorded = Recorded {
            imu: &self.imu,
            gnss: &self.gnss,
            aids: &[],
        };
        let mut settings = self.settings.clone();
        let of_model = (&self.model.model, self.request.filter, &self.expected);
        let (belief, reduction) =
            belief(of_model, self.imu_rate_hz, &self.gnss, &settings.outages)?;
        let plan = OutagePlan {
            fixed: settings.outages,
            ..OutagePlan::default()
        };
        let times_s: Vec<f64> = self.gnss.iter().map(|fix| fix.t_s).collect();
        let placed = plan.on(&FixedData::recorded(&times_s), 0)?;
        placed
            .remarks
            .iter()
            .for_each(|remark| context.warn(remark));
        settings.outages = placed.windows;
        let mounting = match self.request.mounting {
            Some(MountingChoice::Auto) => {
                let found = mounting::find(&recorded, &settings, &belief);
                Some(found.map_err(|e| self.not_mounted(e, &recorded, &settings, &belief))?)
            }
            _ => None,
        };
        if let Some(Mounting { q_s_b, sigma_b, .. }) = mounting {
            (settings.q_s_b, settings.mounting_sigma_b) = (q_s_b, sigma_b);
        }
        let rest_s = origin_s.map_or(0.0, |_| rest_of_origin(&recorded, &belief, &settings));
        let gnss = earlier(recorded.gnss, rest_s);
        recorded.gnss = &gnss;
        let delay_s = self.request.gnss_delay_s + origin_s.unwrap_or(0.0) + rest_s;
        if origin_s.is_some() {
            context.warn(format!(
                "the clocks had nothing in common: fused with --gnss-delay={delay_s:.2}, from turns and innovations"
            ));
        }
        let Alignment { start, doubts } = match (&self.initial, self.request.given_heading()) {
            (Some(start), _) => Alignment {
                start: beside_mounting(start.clone(), &settings),
                doubts: Vec::new(),
            },
            (None, Some(heading)) => towards(&recorded, &settings, &belief, heading)?,
            (None, None) => coarse(&recorded, &settings, &belief)?,
        };
        settings.outages.retain(|outage| {
            let is_early = outage.end_s <= start.t_s;
            if is_early {
                let span = window(outage.start_s, outage.end_s);
                context.warn(format!(
                    "outage {span} ends before the start of the solution: it is left out"
                ));
            }
            !is_early
        });
        // the start and the mounting are found without: they are what the vehicle's axes come from
        let aiding = self.request.aiding();
        self.check_wheel(&recorded, &settings.outages)?;
        let aids = vehicle_velocities(&recorded, &self.wheel, &aiding, &settings.outages);
        recorded.aids = &aids;
        let belief = belief.with_vehicle(aiding.state_sigmas());
        let asked = (self.reference.as_ref(), self.request.gnss_correlation);
        let weighed = fuse_correlated(&recorded, &belief, &start, &settings, asked)?;
        if self.reference.is_some() && weighed.solution.rows.iter().all(|row| row.error.is_none()) {
            let message = "the reference and the solution have no time in common";
            return Err(Failure::input(message).hint("both need one clock"));
        }
        doubt_heading(&weighed.solution, &settings.outages)
            .iter()
            .for_each(|doubt| context.warn(doubt));
        let outcome = outcome(&weighed.solution, &settings.outages);
        let Assessment { verdict, findings } = assess(&weighed, &outcome, &doubts);
        let is_correlated = weighed
            .whiteness
            .as_ref()
            .is_some_and(Whiteness::is_correlated);
        let is_unexplained =
            verdict >= VerdictKind::Doubtful || verdict == VerdictKind::Undecided && is_correlated;
        let scene = Scene {
            belief: &belief,
            start: &start,
            settings: &settings,
            is_given: self.initial.is_some(),
        };
        let explained = is_unexplained
            .then(|| {
                scene.cause(&Recorded {
                    gnss: &weighed.gnss,
                    ..recorded
                })
            })
            .flatten();
        let cause = explained.map(|cause| cause.after(delay_s));
        let kind = if cause.is_some() {
            verdict.max(VerdictKind::Doubtful)
        } else {
            verdict
        };
        let against = |(verdict, finding)| (verdict > VerdictKind::Consistent).then_some(finding);
        let evidence = findings.into_iter().filter_map(against).collect();
        let constants = belief
            .groups
            .iter()
            .flatten()
            .filter(|g| g.is_constant())
            .count();
        let rows = &weighed.solution.rows;
        let squares = rows
            .iter()
            .map(|row| row.sigma[0].powi(2) + row.sigma[1].powi(2));
        let summary = FuseSummary {
            schema_version: 1,
            method: "fusion",
            verdict: FuseVerdict {
                kind,
                evidence,
                cause,
            },
            imu_samples: weighed.solution.samples,
            imu_rate_hz: self.imu_rate_hz,
            start_s: start.t_s,
            end_s: weighed
                .solution
                .rows
                .last()
                .map_or(start.t_s, |row| row.t_s),
            filter_states: belief.states,
            turn_on_states: 3 * constants,
            initial: Initial::new(
                &start,
                self.request.initial_file().map(|path| path.as_path()),
            ),
            mounting: mounting.as_ref().map(Into::into),
            horizontal_sigma_rms_m: (squares.sum::<f64>() / rows.len() as f64).sqrt(),
            gnss_correlation: correlation(&weighed),
            vehicle: vehicle(&weighed.solution, &aiding),
            outcome,
        };
        Ok(FuseAnswer {
            solution: weighed.solution,
            summary,
            reduction,
            inputs: context.inputs().to_vec(),
            configuration: self.configuration,
        })
    }
}

impl Drive {
    /// Brings fixes to the clock of the IMU where the two have nothing in common and no delay is given; by how much (s).
    fn common_origin(&mut self) -> Result<Option<f64>> {
        let recorded = Recorded {
            imu: &self.imu,
            gnss: &self.gnss,
            aids: &[],
        };
        let Err(apart) = check_clocks(&recorded) else {
            return Ok(None);
        };
        let is_free = self.request.gnss_delay_s == 0.0;
        let origin_s = is_free
            .then(|| rough_origin(&recorded))
            .flatten()
            .ok_or(apart)?;
        self.gnss = earlier(&self.gnss, origin_s);
        Ok(Some(origin_s))
    }

    /// Refuses a wheel of another time or unit.
    fn check_wheel(&self, recorded: &Recorded<'_>, outages: &[Outage]) -> Result<()> {
        /// Tyres and speeds by noisy positions differ by less, units by more.
        const RATIO: Range<f64> = 0.6..1.55;
        let span = self.imu.first().zip(self.imu.last());
        let is_within =
            |w: &WheelSpeed| span.is_some_and(|(a, b)| (a.t_s..=b.t_s).contains(&w.t_s));
        if !self.wheel.is_empty() && !self.wheel.iter().any(is_within) {
            let message = "the wheel and the IMU have no time in common";
            return Err(Failure::input(message).hint("both need one clock"));
        }
        match wheel_ratio(recorded, &self.wheel, outages) {
            Some(ratio) if !RATIO.contains(&ratio) => {
                let message = format!("the wheel reads {ratio:.2} times the speed of the fixes");
                Err(Failure::input(message)
                    .hint("check the unit in the header: _m_s, _km_h or _mph"))
            }
            _ => Ok(()),
        }
    }

    /// Why the mounting is not found: the clocks, where they are apart.
    fn not_mounted(
        &self,
        e: MountingError,
        recorded: &Recorded<'_>,
        settings: &Settings,
        belief: &Belief,
    ) -> Failure {
        let rest = |there: &Recorded<'_>| {
            let found = mounting::find(there, settings, belief).ok()?;
            let settings = Settings {
                q_s_b: found.q_s_b,
                mounting_sigma_b: found.sigma_b,
                ..settings.clone()
            };
            let start = coarse(there, &settings, belief).ok()?.start;
            displaced(there, belief, &start, &settings)?.delay_s
        };
        let Some(mut clocks) = clocks_apart(recorded, rest) else {
            return e.into();
        };
        clocks.delay_s += self.request.gnss_delay_s;
        Failure::input(e).hint(document::apart(&clocks))
    }
}

/// What a cause is looked for with.
struct Scene<'a> {
    belief: &'a Belief,
    start: &'a Start,
    settings: &'a Settings,
    /// Whether the start was given.
    is_given: bool,
}

impl Scene<'_> {
    /// Cause of innovations that are large or last: the clocks, else the antenna or a small delay.
    fn cause(&self, recorded: &Recorded<'_>) -> Option<Cause> {
        let small =
            || displaced(recorded, self.belief, self.start, self.settings).map(Cause::Displaced);
        self.clocks(recorded).map(Cause::Clocks).or_else(small)
    }

    /// Clocks that are apart, where the innovations are smaller when they are not: the course of what walks or slips has
    /// other turns than its body.
    fn clocks(&self, recorded: &Recorded<'_>) -> Option<ClocksApart> {
        // turns of the course tell it to tenths of a second, the innovations tell the rest
        let clocks = clocks_apart(recorded, |there| {
            displaced(there, self.belief, &self.start(there)?, self.settings)?.delay_s
        })?;
        let gnss = earlier(recorded.gnss, clocks.delay_s);
        let without = self.nis(&Recorded {
            gnss: &gnss,
            ..*recorded
        })?;
        self.nis(recorded)
            .is_none_or(|now| without < now)
            .then_some(clocks)
    }

    /// Mean NIS per component with a start of its own.
    fn nis(&self, recorded: &Recorded<'_>) -> Option<f64> {
        let solution = fuse(
            recorded,
            self.belief,
            &self.start(recorded)?,
            self.settings,
            None,
        )
        .ok()?;
        Some(outcome(&solution, &[]).nis_per_component).filter(|nis| nis.is_finite())
    }

    fn start(&self, recorded: &Recorded<'_>) -> Option<Start> {
        if self.is_given {
            Some(self.start.clone())
        } else {
            coarse(recorded, self.settings, self.belief)
                .ok()
                .map(|a| a.start)
        }
    }
}

impl Cause {
    /// The same where the fixes were delayed already (s).
    fn after(mut self, given_s: f64) -> Self {
        match &mut self {
            Self::Clocks(clocks) => clocks.delay_s += given_s,
            Self::Displaced(found) => found
                .delay_s
                .iter_mut()
                .for_each(|[delay_s, _]| *delay_s += given_s),
        }
        self
    }
}

/// A start that states the attitude of the vehicle: that of the IMU is known no better than the mounting.
fn beside_mounting(mut start: Start, settings: &Settings) -> Start {
    let mounting_deg = (settings.mounting_sigma_b / DEG).to_array();
    for (sigma, mounting) in start.sigma.att_sigma_deg.iter_mut().zip(mounting_deg) {
        *sigma = sigma.hypot(mounting).min(30.0).max(*sigma);
    }
    start
}

/// Heading that the motion between outages hardly shows.
fn doubt_heading(solution: &Solution, outages: &[Outage]) -> Option<HeadingDoubt> {
    let start_s = solution.rows.first()?.t_s;
    let fixed = solution
        .rows
        .iter()
        .filter(|row| !outages.iter().any(|o| o.withholds(row.t_s)));
    weak_heading(fixed.map(|row| (row.t_s - start_s, row.sigma[8])))
}

// The filter of a fusion: made for a recording whose trajectory is not known.

/// The filter for an IMU of that rate, these fixes and outages. A reduced filter is made for a built-in drive with
/// the receiver of the fixes; also what the reduction loses.
///
/// # Errors
/// When the model cannot be converted to the rate, or has no such filter.
pub(super) fn belief(
    (model, states, initial): (&Model, FilterStates, &InitialSettings),
    rate_hz: f64,
    gnss: &[GnssFix],
    outages: &[Outage],
) -> Result<(Belief, Option<ReductionQuality>)> {
    let model = at_rate(model, rate_hz).refuse_within("the model")?;
    let lengths: Vec<f64> = outages.iter().map(|o| o.end_s - o.start_s).collect();
    let interval_s = interval_s(gnss).unwrap_or(1.0);
    let window_s = reduction::window_s(lengths.iter().copied().fold(0.0, f64::max));
    let belief = Belief::new(&model, states, interval_s, window_s).refuse_within("the model")?;
    let drive = || {
        lincov::drive(
            &model,
            &ImuSettings::default(),
            &receiver(gnss, interval_s),
            &lengths,
        )
    };
    let Some(track) = states.is_reduced().then(drive).flatten() else {
        return Ok((belief.with_initial(initial), None));
    };
    let belief =
        lincov::reduced_belief(&model, belief, &track, lincov::Alike::All).with_initial(initial);
    let full = Belief::new(&model, FilterStates::Full, interval_s, window_s);
    let full = full
        .ok()
        .map(|full| full.with_initial(&beside(states, initial)));
    let made = (&model, &belief, full.as_ref());
    let quality = reduction_of(made, &track, &Context::default());
    Ok((belief, quality))
}

/// What a filter expects beside the model, with what its states say of scale factors.
fn beside(states: FilterStates, initial: &InitialSettings) -> InitialSettings {
    let mut all = initial.clone();
    let ppm = states.scale_sigma() * 1e6;
    if ppm > 0.0 {
        all.accel_scale_sigma_ppm.get_or_insert(ppm);
        all.gyro_scale_sigma_ppm.get_or_insert(ppm);
    }
    all
}

/// The receiver of the fixes: medians.
fn receiver(gnss: &[GnssFix], interval_s: f64) -> GnssSettings {
    let defaults = GnssSettings::default();
    let position = |i: usize| middle(gnss.iter().map(|fix| fix.pos_sigma_n[i]).collect());
    let velocity = |i: usize| {
        middle(
            gnss.iter()
                .filter_map(|fix| Some(fix.velocity?.sigma_n()[i]))
                .collect(),
        )
    };
    let velocities = [0, 1, 2].map(velocity);
    let has_velocity = velocities.iter().all(Option::is_some);
    GnssSettings {
        rate_hz: 1.0 / interval_s,
        pos_sigma_m: [0, 1, 2].map(|i| position(i).unwrap_or(defaults.pos_sigma_m[i])),
        vel_sigma_m_s: has_velocity.then(|| velocities.map(Option::unwrap_or_default)),
        ..defaults
    }
}

/// At the rate of the recording, without quantization noise: the filter leaves it out, and it belongs to
/// its own rate.
fn at_rate(model: &Model, rate_hz: f64) -> Result<Model, continuous::RateError> {
    let kept = |axis: &Composite| {
        let processes = axis
            .processes
            .iter()
            .filter(|p| !matches!(p, Process::Quantization(_)));
        Composite::new(processes.copied().collect())
    };
    let axes = std::array::from_fn(|i| kept(&model.axes[i]));
    continuous::at_rate(
        &Model {
            rate_hz: model.rate_hz,
            axes,
        },
        rate_hz,
    )
}
