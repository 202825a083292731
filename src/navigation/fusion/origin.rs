//! Clocks without a common origin: an IMU that counts from its own start beside fixes that are dated.
//!
//! Two loggers of one drive begin within a minute of one another. The turns of the course against those of the
//! gyroscopes ([`super::clocks_apart`]) tell the rest to some tenths of a second; the delay among these at which the
//! filter's innovations are smallest, and their slope there ([`super::displaced()`]), tell it to hundredths.

use super::alignment::coarse;
use super::clocks::agreement;
use super::{Recorded, Settings, Solution, check_clocks, displaced, fuse};
use crate::ekf::Belief;
use crate::gnss::GnssFix;
use rayon::prelude::*;

/// Delays that are tried about the one at which the turns agree, and how far apart (s): the course of what walks is ahead
/// of the turns of its body by half a step.
const TRIED: (i32, f64) = (5, 0.2);
/// Most of a recording that is looked at (s).
const MOST_S: f64 = 1200.0;
/// NIS per component of a fix that contradicts, however much, and of one before the start: a wrong delay makes some starts
/// be given up for later ones, whose fewer fixes would speak for it.
const CONTRADICTS: f64 = 16.0;

/// Time that the clock of the fixes is ahead of the IMU's (s), where the two have nothing in common and the turns agree
/// when both recordings begin within a minute of one another.
#[must_use]
pub fn rough_origin(recorded: &Recorded<'_>) -> Option<f64> {
    let begins_s = check_clocks(recorded).err()?.delay_s()?;
    let gnss = earlier(recorded.gnss, begins_s);
    let [lag_s, ..] = agreement(&Recorded {
        gnss: &gnss,
        ..*recorded
    })?;
    Some(begins_s - lag_s)
}

/// The rest of a delay that was found roughly (s): the one at which the innovations are smallest.
#[must_use]
pub fn rest_of_origin(recorded: &Recorded<'_>, belief: &Belief, settings: &Settings) -> f64 {
    let to_s = recorded.gnss.first().map_or(0.0, |fix| fix.t_s) + MOST_S;
    let imu = &recorded.imu[..recorded.imu.partition_point(|sample| sample.t_s <= to_s)];
    let fixes = &recorded.gnss[..recorded.gnss.partition_point(|fix| fix.t_s <= to_s)];
    let settings = Settings {
        rows_hz: 1e-3,
        smooth: false,
        ..settings.clone()
    };
    let tried = |k: i32| {
        let delay_s = f64::from(k) * TRIED.1;
        let gnss = earlier(fixes, delay_s);
        let recorded = Recorded {
            imu,
            gnss: &gnss,
            ..*recorded
        };
        let start = coarse(&recorded, &settings, belief).ok()?.start;
        let solution = fuse(&recorded, belief, &start, &settings, None).ok()?;
        Some((delay_s, disagreement(&solution, fixes.len()), start))
    };
    let all: Vec<_> = (-TRIED.0..=TRIED.0)
        .into_par_iter()
        .filter_map(tried)
        .collect();
    let Some((delay_s, _, start)) = all.into_iter().min_by(|a, b| a.1.total_cmp(&b.1)) else {
        return 0.0;
    };
    let gnss = earlier(fixes, delay_s);
    let found = displaced(
        &Recorded {
            imu,
            gnss: &gnss,
            ..*recorded
        },
        belief,
        &start,
        &settings,
    );
    delay_s
        + found
            .and_then(|found| found.delay_s)
            .map_or(0.0, |[rest_s, _]| rest_s)
}

/// Mean NIS per component of so many fixes, those before the start among them.
fn disagreement(solution: &Solution, fixes: usize) -> f64 {
    let of = |nis: f64, components: usize| (nis / components as f64).min(CONTRADICTS);
    let seen: f64 = solution
        .fixes
        .iter()
        .map(|fix| of(fix.nis, fix.innovation.len()))
        .sum();
    let unseen = fixes.saturating_sub(solution.fixes.len());
    (seen + CONTRADICTS * unseen as f64) / fixes as f64
}

/// Fixes so much earlier (s).
#[must_use]
pub fn earlier(gnss: &[GnssFix], seconds: f64) -> Vec<GnssFix> {
    gnss.iter()
        .map(|fix| GnssFix {
            t_s: fix.t_s - seconds,
            ..*fix
        })
        .collect()
}
