//! A recorded drive → its solution, and whether it is to be believed.

use super::{FusionFilter, FusionFilterError, Note};
use crate::observer::Observer;
use crate::report::{FusionSummary, displaced_words};
use nav_sim_navigation::fusion::alignment::{self, Alignment, AlignmentError};
use nav_sim_navigation::fusion::mounting::{self, Mounted, MountingError};
use nav_sim_navigation::fusion::{
    self, Assessment, FusionError, Outcome, Recorded, Settings, Solution, Start, check_clocks,
};
use nav_sim_navigation::gnss::GnssFix;
use nav_sim_navigation::sensors::outage::{FixedData, Outage, OutageError, OutagePlan, PlacedOutages};
use nav_sim_navigation::simulation::lincov::weak_heading;
use nav_sim_navigation::trajectory::reference::Reference;
use nav_sim_signal::imu::ImuIncrement;
use nav_sim_signal::units::DEG;

/// A recorded drive.
#[derive(Debug)]
pub struct RecordedDrive {
    /// The IMU's samples.
    pub imu: Vec<ImuIncrement>,
    /// Their rate (Hz).
    pub rate_hz: f64,
    /// The receiver's fixes.
    pub gnss: Vec<GnssFix>,
    /// How much earlier than their files say they were made to be ([`Self::earlier`], s).
    pub delay_s: f64,
    /// How the IMU sits in the vehicle.
    pub mounted: Mounted,
    /// Where the filter starts; none: by levelling and the course.
    pub initial: Option<Start>,
    /// What the solution is compared with.
    pub reference: Option<Reference>,
}

/// What was found.
#[derive(Debug)]
#[non_exhaustive]
pub struct Fused {
    /// The solution.
    pub solution: Solution,
    /// Its figures.
    pub outcome: Outcome,
    /// Whether it is to be believed.
    pub assessment: Assessment,
    /// The summary.
    pub(crate) summary: FusionSummary,
}

/// Why there is no solution.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum FuseError {
    /// Data and settings that do not fit together, or a filter that diverged.
    #[error(transparent)]
    Fusion(#[from] FusionError),
    /// The filter cannot be made.
    #[error(transparent)]
    Filter(#[from] FusionFilterError),
    /// Windows that are not on the data.
    #[error(transparent)]
    Outage(#[from] OutageError),
    /// The data do not show where the drive starts.
    #[error(transparent)]
    Alignment(#[from] AlignmentError),
    /// The drive does not show how the IMU is mounted.
    #[error(transparent)]
    Mounting(#[from] MountingError),
    /// The reference is of another time.
    #[error("the reference and the solution have no time in common")]
    NothingInCommon,
}

impl RecordedDrive {
    /// Multiplies the receiver's standard deviations, of position and of velocity.
    pub fn scale_sigma(&mut self, position: f64, velocity: f64) {
        for fix in &mut self.gnss {
            *fix = fix.with_sigmas_times(position, velocity);
        }
    }

    /// Takes the fixes for those of so long before their times (s).
    pub fn earlier(&mut self, delay_s: f64) {
        self.gnss.iter_mut().for_each(|fix| fix.t_s -= delay_s);
        self.delay_s += delay_s;
    }

    /// Fuses it. The outages of the settings are placed on the fixes, those before the start are left out.
    ///
    /// # Errors
    /// Why there is no solution.
    pub fn fuse(
        &self,
        filter: &FusionFilter<'_>,
        settings: Settings,
        observer: &dyn Observer<Note>,
    ) -> Result<Fused, FuseError> {
        let recorded = Recorded { imu: &self.imu, gnss: &self.gnss };
        check_clocks(&recorded)?;
        let belief = filter.belief(self.rate_hz, &self.gnss, &settings.outages, observer)?;
        let mut settings = self.with_outages(settings, observer)?;
        let mounting = match self.mounted {
            Mounted::AsGiven => None,
            Mounted::AsFound => Some(mounting::find(&recorded, &settings, &belief)?),
        };
        if let Some(found) = &mounting {
            (settings.q_s_b, settings.mounting_sigma_b) = (found.q_s_b, found.sigma_b);
        }
        let Alignment { start, doubts } = match &self.initial {
            Some(start) => Alignment { start: beside_mounting(start.clone(), &settings), doubts: Vec::new() },
            None => alignment::coarse(&recorded, &settings, &belief)?,
        };
        observer.remark(&Note::Start(start.clone()));
        let settings = without_early_outages(settings, start.t_s, observer);
        let solution = fusion::fuse(&recorded, &belief, &start, &settings, self.reference.as_ref())?;
        if self.reference.is_some() && solution.rows.iter().all(|row| row.error.is_none()) {
            return Err(FuseError::NothingInCommon);
        }
        let outcome = fusion::outcome(&solution, &settings.outages);
        let cause = || {
            let mut found = fusion::displaced(&recorded, &belief, &start, &settings)?;
            found.delay_s = found.delay_s.map(|[more_s, sigma_s]| [self.delay_s + more_s, sigma_s]);
            Some(displaced_words(&found))
        };
        let assessment = fusion::assess(&solution, &outcome, &doubts).explained(&recorded, cause);
        observer.remark(&Note::Fused(assessment.clone(), outcome.reference.map(|r| r.horizontal_max_m)));
        doubt_heading(&solution, &settings.outages, observer);
        let constants = belief.groups.iter().flatten().filter(|g| g.is_constant()).count();
        let states = [belief.states, 3 * constants];
        let summary = FusionSummary::of(&solution, (&outcome, &assessment), &start, self.rate_hz, states)
            .mounted(mounting.as_ref());
        Ok(Fused { solution, outcome, assessment, summary })
    }

    /// The settings with their outages placed on the fixes.
    fn with_outages(
        &self,
        settings: Settings,
        observer: &dyn Observer<Note>,
    ) -> Result<Settings, OutageError> {
        let times_s: Vec<f64> = self.gnss.iter().map(|fix| fix.t_s).collect();
        let plan = OutagePlan { fixed: settings.outages.clone(), ..OutagePlan::default() };
        let PlacedOutages { windows, remarks } = plan.on(&FixedData::recorded(&times_s), 0)?;
        remarks.into_iter().for_each(|remark| observer.remark(&Note::Outage(remark)));
        Ok(Settings { outages: windows, ..settings })
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

/// Windows that end before the filter starts withhold nothing: no outages.
fn without_early_outages(mut settings: Settings, start_s: f64, observer: &dyn Observer<Note>) -> Settings {
    settings.outages.retain(|outage| {
        let is_early = outage.end_s <= start_s;
        if is_early {
            observer.remark(&Note::EarlyOutage(*outage, start_s));
        }
        !is_early
    });
    settings
}

/// Where the motion hardly shows the heading, no filter of this kind is to be believed.
fn doubt_heading(solution: &Solution, outages: &[Outage], observer: &dyn Observer<Note>) {
    let start_s = solution.rows.first().map_or(0.0, |row| row.t_s);
    let fixed = solution.rows.iter().filter(|row| !outages.iter().any(|o| o.withholds(row.t_s)));
    if let Some(doubt) = weak_heading(fixed.map(|row| (row.t_s - start_s, row.sigma[8]))) {
        observer.remark(&Note::Heading(doubt));
    }
}
