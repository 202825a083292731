//! What is said of a fusion: `summary.json` and the lines on the terminal.

use super::number::{seconds, window};
use super::page::{Cell, Table, Tone};
use super::smoothed::{Reference, Smoothed};
use nav_sim_navigation::ekf::InitialSettings;
use nav_sim_navigation::frames::{NavState, RollPitchYaw, wrap_angle};
use nav_sim_navigation::fusion::mounting::Mounting;
use nav_sim_navigation::fusion::{Assessment, Drift, Outcome, Solution, Start, Verdict};
use nav_sim_signal::units::DEG;
use serde::Serialize;

pub(super) const STATE: [&str; 9] =
    ["lat_deg", "lon_deg", "h_m", "v_n_m_s", "v_e_m_s", "v_d_m_s", "roll_deg", "pitch_deg", "yaw_deg"];
const SCHEMA_VERSION: u32 = 1;

/// `summary.json` of a fusion.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(crate) struct FusionSummary {
    schema_version: u32,
    method: &'static str,
    /// `ok`, `underconfident`, `doubtful` or `overconfident` (not to be believed).
    verdict: &'static str,
    /// Why, where the verdict is not `ok`.
    reasons: Vec<String>,
    imu_samples: usize,
    imu_rate_hz: f64,
    start_s: f64,
    end_s: f64,
    filter_states: usize,
    turn_on_states: usize,
    initial: Initial,
    #[serde(skip_serializing_if = "Option::is_none")]
    mounting: Option<MountingRow>,
    fixes: Fixes,
    nis_per_component: f64,
    outages: Vec<OutageRow>,
    #[serde(skip_serializing_if = "Option::is_none")]
    reference: Option<Reference>,
    #[serde(skip_serializing_if = "Option::is_none")]
    smoothed: Option<Smoothed>,
}

#[derive(Debug, Clone, PartialEq, Serialize)]
struct Initial {
    t_s: f64,
    state: PerName,
    sigma: InitialSettings,
    how: Vec<String>,
}

/// A mounting that was found: angles as `--mounting` takes them, standard deviations about front, right, down.
#[derive(Debug, Clone, PartialEq, Serialize)]
struct MountingRow {
    roll_deg: f64,
    pitch_deg: f64,
    yaw_deg: f64,
    sigma_deg: [f64; 3],
    how: String,
}

#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(transparent)]
struct PerName(std::collections::BTreeMap<&'static str, f64>);

#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
struct Fixes {
    used: usize,
    withheld: usize,
    rejected: usize,
}

#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
struct OutageRow {
    start_s: f64,
    end_s: f64,
    fixes_withheld: usize,
    followed_by_fix: bool,
    end_from_fix: Option<DriftRow>,
    #[serde(skip_serializing_if = "Option::is_none")]
    end_from_reference: Option<DriftRow>,
}

#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
struct DriftRow {
    horizontal_m: f64,
    down_m: f64,
    expected_sigma_m: f64,
}

impl From<Drift> for DriftRow {
    fn from(d: Drift) -> Self {
        Self { horizontal_m: d.horizontal_m, down_m: d.down_m, expected_sigma_m: d.sigma_m }
    }
}

impl MountingRow {
    /// As it is given for the next drive.
    fn line(&self) -> String {
        let Self { roll_deg, pitch_deg, yaw_deg, sigma_deg: [front, right, down], how } = self;
        format!(
            "mounting found: --mounting={roll_deg:.2},{pitch_deg:.2},{yaw_deg:.2}:{front:.2},{right:.2},{down:.2} (after the \
             colon ± about the vehicle's front, right, down, degrees), {how}"
        )
    }
}

impl FusionSummary {
    /// The summary of a fusion.
    #[must_use]
    pub(crate) fn of(
        solution: &Solution,
        (outcome, assessment): (&Outcome, &Assessment),
        start: &Start,
        imu_rate_hz: f64,
        [filter_states, turn_on_states]: [usize; 2],
    ) -> Self {
        let outage = |o: &nav_sim_navigation::fusion::OutageDrift| OutageRow {
            start_s: o.outage.start_s,
            end_s: o.outage.end_s,
            fixes_withheld: o.withheld,
            followed_by_fix: o.is_followed,
            end_from_fix: o.from_fix.map(Into::into),
            end_from_reference: o.from_reference.map(Into::into),
        };
        let [used, withheld, rejected] = outcome.fixes;
        Self {
            schema_version: SCHEMA_VERSION,
            method: "fusion",
            verdict: assessment.verdict.name(),
            reasons: assessment.reasons.iter().map(|(_, text)| text.clone()).collect(),
            imu_samples: solution.samples,
            imu_rate_hz,
            start_s: start.t_s,
            end_s: solution.rows.last().map_or(start.t_s, |r| r.t_s),
            filter_states,
            turn_on_states,
            initial: Initial {
                t_s: start.t_s,
                state: PerName(STATE.into_iter().zip(values(&start.state)).collect()),
                sigma: start.sigma.clone(),
                how: start.how.clone(),
            },
            mounting: None,
            fixes: Fixes { used, withheld, rejected },
            nis_per_component: outcome.nis_per_component,
            outages: outcome.outages.iter().map(outage).collect(),
            reference: outcome.reference.map(Into::into),
            smoothed: outcome.smoothed.as_ref().map(Into::into),
        }
    }

    /// The same with the mounting that was found.
    #[must_use]
    pub(crate) fn mounted(self, found: Option<&Mounting>) -> Self {
        let row = |m: &Mounting| {
            // hundredths are what is printed; + 0 takes the sign from -0
            let [roll_deg, pitch_deg, yaw_deg] = m.angles_deg().map(|a| (a * 100.0).round() / 100.0 + 0.0);
            MountingRow { roll_deg, pitch_deg, yaw_deg, sigma_deg: m.sigma_deg(), how: m.how.clone() }
        };
        Self { mounting: found.map(row), ..self }
    }

    /// How the page colours the verdict.
    pub(super) fn tone(&self) -> Tone {
        match self.verdict {
            word if word == Verdict::Ok.name() => Tone::Good,
            word if word == Verdict::Overconfident.name() => Tone::Bad,
            _ => Tone::Doubtful,
        }
    }

    /// Outages (start, end) (s).
    pub(super) fn windows(&self) -> Vec<(f64, f64)> {
        self.outages.iter().map(|o| (o.start_s, o.end_s)).collect()
    }

    /// The outages as the page shows them.
    pub(super) fn outage_table(&self) -> Table {
        let mut table = Table::new(["outage", "fixes withheld", "horizontal from the fix (m)", "1 σ (m)"])
            .and(["horizontal from the reference (m)", "1 σ (m)"].map(str::to_owned));
        for (i, o) in self.outages.iter().enumerate() {
            let mut cells =
                vec![Cell::from(window(o.start_s, o.end_s)), Cell::figures(o.fixes_withheld.to_string())];
            for (end, key) in [(o.end_from_fix, "end_from_fix"), (o.end_from_reference, "end_from_reference")]
            {
                let number =
                    |value: f64, name: &str| Cell::number(value, &format!("/outages/{i}/{key}/{name}"));
                cells.extend(end.map_or_else(
                    || [Cell::figures("–"), Cell::figures("–")],
                    |d| {
                        [
                            number(d.horizontal_m, "horizontal_m"),
                            number(d.expected_sigma_m, "expected_sigma_m"),
                        ]
                    },
                ));
            }
            table.row(cells);
        }
        table
    }

    /// What smoothing does in the outages, as the page shows it.
    pub(super) fn smoothed_table(&self) -> Option<Table> {
        let smoothed = self.smoothed.as_ref().filter(|_| !self.outages.is_empty());
        smoothed.map(Smoothed::outage_table)
    }

    /// The verdict with all its reasons.
    pub(super) fn verdict_line(&self) -> String {
        self.verdict_for(&self.reasons.join("; "))
    }

    /// The verdict with what weighs most.
    fn short_verdict(&self) -> String {
        match self.reasons.as_slice() {
            [first, _, ..] => self.verdict_for(&format!(
                "{first} (and {} more: warnings, summary.json)",
                self.reasons.len() - 1
            )),
            _ => self.verdict_line(),
        }
    }

    fn verdict_for(&self, reasons: &str) -> String {
        let words = match self.verdict {
            word if word == Verdict::Ok.name() => "consistent with its fixes",
            word if word == Verdict::Underconfident.name() => "underconfident",
            word if word == Verdict::Doubtful.name() => "doubtful",
            _ => "overconfident and not to be believed",
        };
        let figures = self.figures();
        format!("verdict: {words}: {}", if reasons.is_empty() { &figures } else { reasons })
    }

    /// What a verdict rests on.
    fn figures(&self) -> String {
        let nis = format!(
            "NIS {:.2} per component (1 if right) over {} fixes",
            self.nis_per_component, self.fixes.used
        );
        let nees = self.reference.as_ref().map(|reference| {
            format!(
                ", NEES {:.2} against the reference ({} if right)",
                reference.nees_mean, reference.nees_dof
            )
        });
        nis + &nees.unwrap_or_default()
    }

    /// The summary for people, the verdict first.
    #[must_use]
    pub(crate) fn text(&self) -> String {
        let Fixes { used, withheld, rejected } = self.fixes;
        let mut lines = vec![self.short_verdict()];
        let turn_on = match self.turn_on_states {
            0 => String::new(),
            n => format!(" + {n} turn-on"),
        };
        let states = self.filter_states - self.turn_on_states;
        lines.push(format!(
            "{} IMU samples at {:.2} Hz, {} to {} s, {states}{turn_on} states; {used} fixes used, {withheld} withheld, {rejected} rejected",
            self.imu_samples, self.imu_rate_hz, seconds(self.start_s), seconds(self.end_s)
        ));
        if !self.reasons.is_empty() {
            lines.push(self.figures());
        }
        lines.extend(self.mounting.iter().map(MountingRow::line));
        for o in &self.outages {
            let drift_words = |name: &str, d: Option<DriftRow>| {
                d.map(|d| {
                    format!("{:.2} m from the {name} (1 sigma {:.2} m)", d.horizontal_m, d.expected_sigma_m)
                })
            };
            let fix = if o.followed_by_fix { "next fix" } else { "last fix withheld" };
            let ends = [drift_words(fix, o.end_from_fix), drift_words("reference", o.end_from_reference)];
            let ends: Vec<String> = ends.into_iter().flatten().collect();
            lines.push(format!(
                "outage {}, {} fixes withheld: at its end {}",
                window(o.start_s, o.end_s),
                o.fixes_withheld,
                if ends.is_empty() { "nothing to compare with".to_owned() } else { ends.join(", ") }
            ));
        }
        if let Some(r) = &self.reference {
            let e = &r.rmse.0;
            lines.push(format!(
                "against the reference, RMSE: horizontal {:.3} m (largest {:.3} m), down {:.3} m, velocity {:.3} {:.3} {:.3} m/s{}, \
                 roll {:.3}°, pitch {:.3}°, yaw {:.3}°; NEES {:.2} (9 if both are right)",
                r.horizontal_rmse_m, r.horizontal_max_m, e[2], e[3], e[4], e[5], r.velocity_words(), e[6], e[7], e[8], r.nees_mean
            ));
        }
        if let Some(smoothed) = &self.smoothed {
            lines.extend(smoothed.lines(self.reference.as_ref()));
        }
        lines.join("\n")
    }
}

/// Position (degrees, m), velocity, roll, pitch, yaw (degrees).
pub(super) fn values(s: &NavState) -> [f64; 9] {
    let rpy = RollPitchYaw::from_quat(s.q_b_n);
    let [roll, pitch, yaw] = [rpy.roll, rpy.pitch, rpy.yaw].map(|a| a / DEG);
    [s.lat / DEG, wrap_angle(s.lon) / DEG, s.h, s.v_n.x, s.v_n.y, s.v_n.z, roll, pitch, yaw]
}
