//! Windows without fixes in a second run of the filter: at their ends the fixes tell how wrong it became, which those that it
//! uses cannot.

use super::antenna_offset::interval_s;
use super::outcome::not_withheld;
use super::{DriveData, FixRecord, FusionError, FusionSettings, Start, WeightedSolution, fuse};
use crate::ekf::FilterModel;
use crate::gnss::GnssFix;
use crate::linalg::mean;
use crate::metrics::{Basis, Verdict, VerdictKind};
use crate::sensors::outage::Outage;
use serde::Serialize;

/// Lengths that are tried (s).
const LENGTHS_S: [f64; 7] = [10.0, 15.0, 25.0, 40.0, 60.0, 90.0, 135.0];
/// Correlation times of the fixes that a window lasts at least: the errors at its ends are then others.
const APART: f64 = 3.0;
/// Time after the start before the first window (s).
const SETTLING_S: f64 = 30.0;
/// Time with fixes between two windows at least (s), and in lengths of them.
const BETWEEN: (f64, f64) = (20.0, 0.25);
/// Share of the variance of the innovations at their ends that is the filter's at least.
const SHARE: f64 = 0.5;
/// Squares that decide: with them errors 25 % above the stated ones are found.
const ENOUGH: usize = 66;

/// Errors at the ends of withheld windows.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct WithheldWindows {
    /// Number of windows.
    pub windows: usize,
    /// Length of each (s).
    pub length_s: f64,
    /// Verdict on the errors.
    pub verdict: Verdict,
}

/// Withholds the fixes of windows that are long enough for the errors at their ends to be the filter's and not the fixes'; none
/// without fixes, of no windows where the drive is too short for one.
///
/// # Errors
/// As [`fuse`].
pub fn withheld(
    recorded: &DriveData<'_>,
    filter_model: &FilterModel,
    start: &Start,
    settings: &FusionSettings,
    weighed: &WeightedSolution,
) -> Result<Option<WithheldWindows>, FusionError> {
    let first_s = start.t_s + SETTLING_S;
    let fixes: Vec<&FixRecord> = not_withheld(&weighed.solution).collect();
    let (Some(last), Some(interval_s)) = (fixes.last(), interval_s(recorded.gnss)) else {
        return Ok(None);
    };
    let least_s = weighed.correlation().map_or(0.0, |lag_1| {
        -APART * interval_s / lag_1.clamp(1e-9, 0.999).ln()
    });
    let span_s = last.t_s - first_s;
    let most = ENOUGH.div_ceil(last.innovation.len().max(1));
    // rejected fixes are outliers at the end of a window too
    let is_rejected = |fix: &GnssFix| {
        let next = fixes.partition_point(|f| f.t_s < fix.t_s - 1e-9);
        fixes
            .get(next)
            .is_some_and(|f| !f.used && f.t_s - fix.t_s < 1e-9)
    };
    let kept: Vec<GnssFix> = recorded
        .gnss
        .iter()
        .filter(|fix| !is_rejected(fix))
        .copied()
        .collect();
    // a drive that is too short for one: how long it would have to be
    let shortest_s = LENGTHS_S
        .into_iter()
        .find(|l| *l >= least_s)
        .unwrap_or(least_s);
    let needed_s = SETTLING_S + most as f64 * (shortest_s + BETWEEN.0.max(BETWEEN.1 * shortest_s));
    let mut found = Some(WithheldWindows {
        windows: 0,
        length_s: shortest_s,
        verdict: Verdict {
            kind: VerdictKind::Undecided,
            basis: Basis::Withheld,
            times_to_decide: Some((needed_s / (span_s + SETTLING_S)).max(1.0)),
            ..Verdict::default()
        },
    });
    for length_s in LENGTHS_S {
        let with_fixes_s = BETWEEN.0.max(BETWEEN.1 * length_s);
        let count = most.min((span_s / (length_s + with_fixes_s)).max(0.0) as usize);
        if count == 0 {
            break;
        }
        if length_s < least_s {
            continue;
        }
        let period_s = span_s / count as f64;
        let outage = |k: usize| {
            let end_s = first_s + period_s * (k as f64 + 1.0) - interval_s;
            Outage {
                start_s: end_s - length_s,
                end_s,
            }
        };
        let outages: Vec<Outage> = (0..count).map(outage).collect();
        let ends: Vec<usize> = outages
            .iter()
            .map(|outage| kept.partition_point(|fix| fix.t_s < outage.end_s - 1e-9))
            .filter(|end| *end < kept.len())
            .collect();
        // a single fix is as stated, however long its errors last
        let [position, velocity] = weighed.sigma_factors;
        let believed = |(k, fix): (usize, &GnssFix)| match ends.contains(&k) {
            true => *fix,
            false => fix.with_sigmas_times(position, velocity),
        };
        let gnss: Vec<GnssFix> = kept.iter().enumerate().map(believed).collect();
        let settings = FusionSettings {
            outages: outages.clone(),
            gate: None,
            ..settings.trial()
        };
        let solution = fuse(
            &recorded.with_gnss(&gnss),
            filter_model,
            start,
            &settings,
            None,
        )?;
        let at_end = |end: &usize| {
            let t_s = gnss[*end].t_s;
            let at = solution
                .fixes
                .iter()
                .find(|f| f.used && (f.t_s - t_s).abs() < 1e-9);
            at.map(|record| (record, &gnss[*end]))
        };
        let ends: Vec<(&FixRecord, &GnssFix)> = ends.iter().filter_map(at_end).collect();
        let share = |(record, fix): &(&FixRecord, &GnssFix)| {
            let stated = fix.sigmas().zip(&record.sigma);
            mean(stated.map(|(fix, all)| 1.0 - (fix / all).powi(2)))
        };
        let shows_filter = mean(ends.iter().map(share)) > SHARE;
        let squares = ends.iter().map(|(f, _)| (f.nis, f.innovation.len()));
        if let Some(verdict) = Verdict::of_windows(squares) {
            found = Some(WithheldWindows {
                windows: ends.len(),
                length_s,
                verdict,
            });
        }
        if shows_filter {
            break;
        }
    }
    Ok(found)
}
