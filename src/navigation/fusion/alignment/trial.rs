//! Which of two starts the fixes that follow speak for: the filter is run from both, and its innovations tell.

use super::Recorded;
use crate::ekf::Belief;
use crate::frames::{RollPitchYaw, wrap_angle};
use crate::fusion::assessment::nis_bound;
use crate::fusion::{Settings, Solution, Start, Use, fuse};
use crate::units::DEG;

/// How much of the recording is tried at first (s). Doubled while the two starts are not told apart.
const TRIAL_S: f64 = 60.0;
/// A heading that the smoother moves by more than so many of its standard deviations is not known as well as it says.
const MOVED: f64 = 3.0;
/// Largest standard deviation of a start (degrees).
const WIDEST_DEG: f64 = 30.0;
/// Difference of −2 ln(likelihood) between forwards and backwards from which one is refuted: odds of e^10.
const DECIDED: f64 = 20.0;

/// How well a start agrees with the fixes after it.
#[derive(Debug, Clone, Copy)]
pub(super) struct Agreement {
    /// −2 ln(likelihood) of the innovations, up to a constant.
    cost: f64,
    /// Mean NIS per component, and of how many components.
    pub(super) nis: f64,
    components: usize,
}

impl Agreement {
    pub(super) fn holds(&self) -> bool {
        self.nis <= nis_bound(self.components)
    }
}

/// What the trial of two opposite starts says.
pub(super) struct Trial {
    /// The better one, 0 or 1, and whether the other is refuted.
    pub(super) better: usize,
    pub(super) decided: bool,
    /// How well the better one agrees with the first minute, and with all that was tried.
    pub(super) agreements: [Agreement; 2],
}

/// The solution from a start as far as `to_s`, its rows those of the start and the end.
fn until(
    recorded: &Recorded<'_>,
    belief: &Belief,
    settings: &Settings,
    start: &Start,
    to_s: f64,
) -> Option<Solution> {
    let imu = &recorded.imu[..recorded.imu.partition_point(|s| s.t_s <= to_s)];
    let gnss = &recorded.gnss[..recorded.gnss.partition_point(|f| f.t_s <= to_s)];
    let settings = Settings {
        nis_gate: None,
        rows_hz: 1e-3,
        ..settings.clone()
    };
    fuse(
        &Recorded {
            imu,
            gnss,
            ..*recorded
        },
        belief,
        start,
        &settings,
        None,
    )
    .ok()
}

fn agreement(
    recorded: &Recorded<'_>,
    belief: &Belief,
    settings: &Settings,
    start: &Start,
    to_s: f64,
) -> Agreement {
    let failed = Agreement {
        cost: f64::INFINITY,
        nis: f64::INFINITY,
        components: 0,
    };
    let settings = Settings {
        smooth: false,
        ..settings.clone()
    };
    let Some(solution) = until(recorded, belief, &settings, start, to_s) else {
        return failed;
    };
    let mut sum = Agreement {
        cost: 0.0,
        nis: 0.0,
        components: 0,
    };
    for fix in solution.fixes.iter().filter(|f| f.used == Use::Used) {
        // the sum of the logarithms stands for the determinant: the correlations of both starts are alike
        sum.cost += fix.nis + 2.0 * fix.sigma.iter().map(|s| s.ln()).sum::<f64>();
        sum.nis += fix.nis;
        sum.components += fix.innovation.len();
    }
    sum.nis = if sum.components > 0 {
        sum.nis / sum.components as f64
    } else {
        0.0
    };
    sum
}

/// Runs the filter from both starts over the first minute, and longer while that does not tell them apart.
pub(super) fn opposite(
    recorded: &Recorded<'_>,
    belief: &Belief,
    settings: &Settings,
    starts: [&Start; 2],
) -> Trial {
    let begin_s = starts[0].t_s;
    let end_s = recorded.gnss.last().map_or(begin_s, |f| f.t_s);
    let mut window_s = TRIAL_S;
    let mut first: Option<[Agreement; 2]> = None;
    loop {
        let to_s = begin_s + window_s;
        let both = starts.map(|start| agreement(recorded, belief, settings, start, to_s));
        let first = *first.get_or_insert(both);
        // a receiver that is worse than it says exaggerates the difference as much as the NIS of the better
        let least = both[0].nis.min(both[1].nis).max(1.0);
        let gain = (both[0].cost - both[1].cost) / least;
        let decided = gain.abs() >= DECIDED;
        if decided || to_s >= end_s {
            // forwards unless that is refuted
            let better = usize::from(decided && gain > 0.0);
            return Trial {
                better,
                decided,
                agreements: [first[better], both[better]],
            };
        }
        window_s *= 2.0;
    }
}

/// Runs the filter from a start that has no other beside it, over the first minute.
pub(super) fn alone(
    recorded: &Recorded<'_>,
    belief: &Belief,
    settings: &Settings,
    start: &Start,
) -> Trial {
    let agreement = agreement(recorded, belief, settings, start, start.t_s + TRIAL_S);
    Trial {
        better: 0,
        decided: true,
        agreements: [agreement; 2],
    }
}

/// Widens the standard deviation of a heading that is not the course: wind sets an aircraft off, currents a boat. The
/// smoother, from all fixes of the first minute, says how far.
pub(super) fn widen(
    recorded: &Recorded<'_>,
    belief: &Belief,
    settings: &Settings,
    start: &mut Start,
) {
    let settings = Settings {
        smooth: true,
        ..settings.clone()
    };
    let solution = until(recorded, belief, &settings, start, start.t_s + TRIAL_S);
    let Some([first, ..]) = solution.as_ref().and_then(|s| s.smoothed.as_deref()) else {
        return;
    };
    let [course, heading] =
        [start.state.q_b_n, first.state.q_b_n].map(|q| RollPitchYaw::from_quat(q).yaw);
    let moved_deg = wrap_angle(heading - course) / DEG;
    let sigma_deg = &mut start.sigma.att_sigma_deg[2];
    if moved_deg.abs() > MOVED * *sigma_deg {
        *sigma_deg = sigma_deg.hypot(moved_deg).min(WIDEST_DEG);
        start
            .found
            .iter_mut()
            .for_each(|found| found.moved_deg = Some(moved_deg));
    }
}
