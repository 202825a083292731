//! What the vehicle knows of its own motion: settings, figures, table.

use super::Fuse;
use nav_sim_document::{Cell, Table, readable};
use nav_sim_navigation::fusion::{AidInnovations, Solution, aid_innovations};
use nav_sim_navigation::sensors::aiding::{
    AidingSettings, NhcSettings, OdometerSettings, ZuptSettings,
};
use nav_sim_signal::units::DEG;
use serde::Serialize;

/// A road car's axes are known in the IMU's to a degree, its wheel's size to the wear and pressure of a tyre (1 σ).
const MOUNTING_SIGMA_DEG: f64 = 1.0;
const SCALE_SIGMA: f64 = 0.03;

impl Fuse {
    /// What is believed of the vehicle: nothing that was not asked for.
    pub(super) fn aiding(&self) -> AidingSettings {
        let lever_arm_m = self.rear_axle_m;
        AidingSettings {
            nhc: self.nhc.then(|| NhcSettings {
                mounting_sigma_deg: MOUNTING_SIGMA_DEG,
                lever_arm_m,
                ..NhcSettings::default()
            }),
            odometer: self.odometer.as_ref().map(|_| OdometerSettings {
                scale_sigma: SCALE_SIGMA,
                lever_arm_m,
                ..OdometerSettings::default()
            }),
            zupt: self.zupt.then(ZuptSettings::default),
            heading: None,
        }
    }
}

/// Estimates at the end, and how the aids agree with the solution.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct VehicleSummary {
    /// The wheel reads so much more than the speed (1).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub wheel_scale: Option<Known>,
    /// Pitch of the vehicle's axes in those of the mounting (degrees).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub mounting_pitch_deg: Option<Known>,
    /// Yaw of these (degrees).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub mounting_yaw_deg: Option<Known>,
    /// Innovations of each aid that was used.
    pub aids: Vec<AidInnovations>,
}

/// An estimate and its standard deviation.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Known {
    /// Estimate.
    pub value: f64,
    /// Standard deviation.
    pub sigma: f64,
}

impl VehicleSummary {
    /// None where nothing was asked for.
    pub(super) fn of(solution: &Solution, settings: &AidingSettings) -> Option<Self> {
        let known = |i: usize, unit: f64| {
            let [value, sigma] = solution.vehicle?.map(|estimates| estimates[i] / unit);
            (settings.state_sigmas()[i] > 0.0).then_some(Known { value, sigma })
        };
        (!settings.is_none()).then(|| Self {
            wheel_scale: known(0, 1.0),
            mounting_pitch_deg: known(1, DEG),
            mounting_yaw_deg: known(2, DEG),
            aids: aid_innovations(&solution.aids),
        })
    }

    /// Estimates, and the innovations of each aid.
    pub(super) fn table(&self) -> Table {
        let mut table = Table::new(["", "value", "1 σ, or 95 % if right", "correlation"]);
        let states = [
            ("wheel scale", "wheel_scale", self.wheel_scale),
            (
                "mounting pitch (°)",
                "mounting_pitch_deg",
                self.mounting_pitch_deg,
            ),
            (
                "mounting yaw (°)",
                "mounting_yaw_deg",
                self.mounting_yaw_deg,
            ),
        ];
        for (name, key, known) in states
            .into_iter()
            .filter_map(|(n, k, known)| Some((n, k, known?)))
        {
            let cell = |value, part: &str| Cell::number(value, &format!("/vehicle/{key}/{part}"));
            table.row([
                name.into(),
                cell(known.value, "value"),
                cell(known.sigma, "sigma"),
                Cell::figures("–"),
            ]);
        }
        for (i, aid) in self.aids.iter().enumerate() {
            let pointer = |key: &str| format!("/vehicle/aids/{i}/{key}");
            let band = format!(
                "{}–{}",
                readable(aid.nis_band.lower),
                readable(aid.nis_band.upper)
            );
            let lag_1 = aid
                .whiteness
                .map(|w| Cell::number(w.lag_1, &pointer("whiteness/lag_1")));
            table.row([
                format!("{}: NIS per component, {} used", aid.aid, aid.count).into(),
                Cell::number(aid.nis_per_component, &pointer("nis_per_component")),
                Cell::figures(band),
                lag_1.unwrap_or_else(|| Cell::figures("–")),
            ]);
        }
        table.without_unknown()
    }
}
