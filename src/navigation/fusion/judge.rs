//! The solution of any filter against a reference: its errors, whether they are as large as it states, and what else may
//! explain them: another clock, another point of the vehicle, other axes, heights or units.

use super::antenna_offset::{ANTENNA, DELAY, Normal};
use super::{Nine, horizontal};
use crate::frames::{NavState, RollPitchYaw};
use crate::linalg::{mean, median};
use crate::metrics::{DriveVerdict, NormalisedErrors, PerState, Verdict, VerdictKind};
use crate::sensors::outage::Outage;
use crate::simulation::{REPORTED, TOLERANCE, reported_error};
use crate::trajectory::reference::Reference;
use crate::units::DEG;
use glam::{DMat3, DQuat, DVec3, DVec4};
use nalgebra::{DMatrix, DVector, Matrix4, SMatrix, Vector4};
use rayon::prelude::*;
use serde::Serialize;

/// A row of a solution.
#[derive(Debug, Clone)]
pub struct StatedRow {
    /// Time (s).
    pub t_s: f64,
    /// Position; velocity and attitude where they are known.
    pub state: NavState,
    /// True if the solution has a velocity, an attitude.
    pub has: [bool; 2],
    /// Covariance of position (m, north, east, down), velocity (m/s), roll, pitch, yaw (degrees): NaN where none is stated.
    pub covariance: SMatrix<f64, REPORTED, REPORTED>,
    /// True if its correlations are stated too.
    pub has_correlations: bool,
}

/// Clock and point of a reference beside those of a solution.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize)]
pub struct ReferenceOffset {
    /// Delay of the stamps of the reference (s).
    pub delay_s: f64,
    /// The reference's point from the solution's: front, right, down (m).
    pub lever_arm_m: DVec3,
}

impl ReferenceOffset {
    fn vector(&self) -> Vector4<f64> {
        let [x, y, z] = self.lever_arm_m.to_array();
        Vector4::new(x, y, z, self.delay_s)
    }

    fn of(x: &Vector4<f64>) -> Self {
        Self {
            delay_s: x[3],
            lever_arm_m: DVec3::new(x[0], x[1], x[2]),
        }
    }
}

/// Errors of a row: solution less reference.
#[derive(Debug, Clone, Copy)]
pub struct StatedErrors {
    /// Time (s).
    pub t_s: f64,
    /// In each state; NaN where one of the two does not have it.
    pub values: Nine,
    /// Standard deviations stated, the velocity's with that of the reference.
    pub sigma: Nine,
    /// Normalised by the covariance of all known states; none without correlations.
    pub nees: Option<f64>,
}

/// An offset that was found.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct FoundOffset {
    /// It, beside what was given.
    #[serde(flatten)]
    pub offset: ReferenceOffset,
    /// Standard deviations.
    pub sigma: ReferenceOffset,
    /// True if the clock, the point is part of it.
    #[serde(skip)]
    pub parts: [bool; 2],
}

/// Errors that are no fault of a filter.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[serde(tag = "doubt", rename_all = "snake_case")]
pub enum SetupFault {
    /// Both are so far apart all the time (m).
    Apart {
        /// Median horizontal distance (m).
        metres: f64,
    },
    /// Heights differ by so much all the time.
    Height {
        /// Solution above reference (m).
        metres: f64,
    },
    /// Axes are others.
    Axes {
        /// The body's, or those of navigation (north, east, down).
        axes: &'static str,
        /// Roll, pitch and yaw of the solution's axes in the reference's (degrees).
        angles_deg: [f64; 3],
    },
    /// Three states are as accurate as stated after a simple transformation.
    Transformed {
        /// Sentence on what they are.
        cause: &'static str,
        /// Errors over standard deviations, root mean square, as they are.
        times: f64,
        /// Errors over standard deviations after the transformation.
        left: f64,
    },
    /// Another clock or another point of the vehicle.
    Offset(FoundOffset),
}

/// A solution judged by a reference.
#[derive(Debug, Clone)]
pub struct Judgement {
    /// In one word.
    pub kind: VerdictKind,
    /// Verdict on the errors over their standard deviations; none without standard deviations.
    pub stated: Option<DriveVerdict>,
    /// Verdict without the offset that was found.
    pub without_offset: Option<DriveVerdict>,
    /// Other explanations of the errors.
    pub doubts: Vec<SetupFault>,
    /// Another clock or point of the reference that was found, also where it explains little.
    pub offset: Option<FoundOffset>,
    /// Root mean square errors; NaN where not known.
    pub rmse: PerState<f64>,
    /// Root mean square of the horizontal distance (m).
    pub horizontal_rmse_m: f64,
    /// Largest horizontal distance (m).
    pub horizontal_max_m: f64,
    /// Rows that the reference reaches.
    pub rows: usize,
    /// True if they are those at the epochs of a coarser reference, which is interpolated between.
    pub is_at_epochs: bool,
    /// Their errors.
    pub errors: Vec<StatedErrors>,
}

/// Judges a solution with outages; none where the reference reaches no row.
pub fn judge(
    rows: &[StatedRow],
    reference: &Reference,
    given: ReferenceOffset,
    outages: &[Outage],
) -> Option<Judgement> {
    let nearest = at_epochs(rows, reference, given);
    let is_at_epochs = nearest.is_some();
    let rows = nearest.as_deref().unwrap_or(rows);
    let errors = errors(rows, reference, given);
    let of_state = |state: usize| errors.iter().map(move |e| e.values[state]);
    let rmse: Nine = std::array::from_fn(|state| {
        let known = of_state(state).filter(|x| x.is_finite());
        mean(known.map(|x| x * x)).sqrt()
    });
    if errors.is_empty() {
        return None;
    }
    let stated = Verdict::of_drive(&normalised(&errors), outages);
    let mut doubts = doubts(rows, reference, given, &errors);
    let transformed = match &stated {
        Some(stated) => transformed(rows, reference, given, stated, &doubts),
        None => Vec::new(),
    };
    // velocities and attitudes in another unit tell nothing of clock and point
    let mut known = Vec::new();
    if transformed.iter().any(|(block, _)| *block > 0) {
        known = rows.to_vec();
        for (block, _) in transformed.iter().filter(|(block, _)| *block > 0) {
            known.iter_mut().for_each(|row| row.has[block - 1] = false);
        }
    }
    let found = match known.is_empty() {
        true => found_offset(rows, reference, given),
        false => found_offset(&known, reference, given),
    };
    doubts.extend(transformed.into_iter().map(|(_, doubt)| doubt));
    let judged = |found: &FoundOffset| {
        let errors = self::errors(rows, reference, found.offset);
        Verdict::of_drive(&normalised(&errors), outages)
    };
    let mut without_offset = found.as_ref().and_then(judged);
    if let Some(found) = found {
        // worth a word where it explains a fault, or errors that are larger by what is let pass
        let matters = match (&stated, &without_offset) {
            (Some(with), Some(without)) => {
                let lost = (with.verdict.nees / without.verdict.nees).sqrt();
                without.verdict.kind < with.verdict.kind || lost > 1.0 + TOLERANCE
            }
            _ => true,
        };
        match matters {
            true => doubts.push(SetupFault::Offset(found)),
            false => without_offset = None,
        }
    }
    let own = stated
        .as_ref()
        .map_or(VerdictKind::Undecided, |s| s.verdict.kind);
    // a fault that an offset does not explain stays one
    let left = without_offset.as_ref().map(|w| w.verdict.kind);
    let kind = match (doubts.as_slice(), left) {
        ([], _) => own,
        ([SetupFault::Offset(_)], Some(left)) if left > VerdictKind::Undecided => left,
        _ => VerdictKind::Doubtful,
    };
    let horizontal_max_m = errors
        .iter()
        .map(|e| horizontal(&e.values))
        .fold(0.0, f64::max);
    Some(Judgement {
        kind,
        without_offset,
        doubts,
        offset: found,
        rmse: PerState(rmse),
        horizontal_rmse_m: rmse[0].hypot(rmse[1]),
        horizontal_max_m,
        rows: errors.len(),
        is_at_epochs,
        stated,
        errors,
    })
}

/// The rows nearest to the epochs of a reference that is coarser than they are; none where it is as fine.
fn at_epochs(
    rows: &[StatedRow],
    reference: &Reference,
    given: ReferenceOffset,
) -> Option<Vec<StatedRow>> {
    const COARSER: f64 = 1.5;
    let step = |t_s: &[f64]| median(t_s.windows(2).map(|t| t[1] - t[0]));
    let times: Vec<f64> = rows.iter().map(|row| row.t_s).collect();
    let epochs: Vec<f64> = reference.epochs().map(|t| t - given.delay_s).collect();
    let (own, of_reference) = (step(&times)?, step(&epochs)?);
    if of_reference < COARSER * own {
        return None;
    }
    let nearest = epochs.iter().filter_map(|t| {
        let next = times.partition_point(|own| own < t);
        let near = [next.saturating_sub(1), next.min(times.len() - 1)];
        let apart = |k: &usize| (times[*k] - t).abs();
        let nearest = near
            .into_iter()
            .min_by(|a, b| apart(a).total_cmp(&apart(b)))?;
        (apart(&nearest) <= 0.5 * own + 1e-6).then_some(nearest)
    });
    let mut nearest: Vec<usize> = nearest.collect();
    nearest.dedup();
    (!nearest.is_empty()).then(|| nearest.into_iter().map(|k| rows[k].clone()).collect())
}

/// Errors of the rows that a reference reaches.
pub fn errors(
    rows: &[StatedRow],
    reference: &Reference,
    offset: ReferenceOffset,
) -> Vec<StatedErrors> {
    let with_nees = |row: &StatedRow| {
        let found = error(row, reference, offset)?;
        let nees = row.has_correlations.then(|| {
            let known: Vec<usize> = (0..REPORTED)
                .filter(|i| found.values[*i].is_finite() && found.sigma[*i].is_finite())
                .collect();
            let x = DVector::from_iterator(known.len(), known.iter().map(|i| found.values[*i]));
            let p = DMatrix::from_fn(known.len(), known.len(), |i, j| match i == j {
                true => found.sigma[known[i]].powi(2),
                false => row.covariance[(known[i], known[j])],
            });
            p.cholesky().map_or(f64::NAN, |c| x.dot(&c.solve(&x)))
        });
        Some(StatedErrors { nees, ..found })
    };
    rows.iter().filter_map(with_nees).collect()
}

/// The errors of a row, without their NEES.
fn error(row: &StatedRow, reference: &Reference, offset: ReferenceOffset) -> Option<StatedErrors> {
    error_after(row, reference, offset, |truth| truth, |sigma| sigma)
}

/// Errors of a row with another truth and other standard deviations.
fn error_after(
    row: &StatedRow,
    reference: &Reference,
    offset: ReferenceOffset,
    map: fn(NavState) -> NavState,
    of_sigma: fn(f64) -> f64,
) -> Option<StatedErrors> {
    let t_s = row.t_s + offset.delay_s;
    let truth = reference.state_of_point(t_s, -offset.lever_arm_m)?;
    let velocity_sigma = reference.velocity_sigma(t_s)?;
    let (mut values, _) = reported_error(&row.state, &map(truth));
    for (block, has) in [1, 2].into_iter().zip(row.has) {
        if !has {
            values[3 * block..3 * block + 3].fill(f64::NAN);
        }
    }
    let sigma = std::array::from_fn(|i| {
        let of_reference = if (3..6).contains(&i) {
            velocity_sigma
        } else {
            0.0
        };
        of_sigma(row.covariance[(i, i)].sqrt()).hypot(of_reference)
    });
    Some(StatedErrors {
        t_s: row.t_s,
        values,
        sigma,
        nees: None,
    })
}

fn normalised(errors: &[StatedErrors]) -> Vec<NormalisedErrors> {
    let of = |e: &StatedErrors| NormalisedErrors {
        t_s: e.t_s,
        over_sigma: std::array::from_fn(|i| e.values[i] / e.sigma[i]),
        nees: e.nees,
    };
    errors.iter().map(of).collect()
}

// What else explains errors.

/// Farther apart than this all the time is another place (m).
const APART_M: f64 = 1000.0;
/// Heights that differ by more (m) and this many times their scatter are counted from another level: geoids are up to 100 m
/// from the ellipsoid, and constant over a drive.
const HEIGHT: (f64, f64) = (5.0, 10.0);
/// Attitudes this near to other axes are in those (degrees).
const AXES_DEG: f64 = 10.0;
fn doubts(
    rows: &[StatedRow],
    reference: &Reference,
    given: ReferenceOffset,
    errors: &[StatedErrors],
) -> Vec<SetupFault> {
    let mut found = Vec::new();
    let metres = median(errors.iter().map(|e| horizontal(&e.values))).unwrap_or(0.0);
    if metres > APART_M {
        found.push(SetupFault::Apart { metres });
    }
    let down = || errors.iter().map(|e| e.values[2]);
    let middle = median(down()).unwrap_or(0.0);
    let scatter = median(down().map(|d| (d - middle).abs())).unwrap_or(0.0);
    let sigma = median(errors.iter().map(|e| e.sigma[2]).filter(|s| s.is_finite()));
    let scatter = scatter.max(sigma.unwrap_or(0.0));
    if middle.abs() > HEIGHT.0.max(HEIGHT.1 * scatter) {
        found.push(SetupFault::Height { metres: -middle });
    }
    found.extend(turned_axes(rows, reference, given));
    found
}

/// A simple transformation of a solution that is written otherwise than its names say.
struct Transformation {
    /// Its states: position, velocity or attitude.
    block: usize,
    /// Sentence on what they are.
    cause: &'static str,
    /// True states as such a solution has them.
    truth: fn(NavState) -> NavState,
    /// Standard deviations of what is stated.
    sigma: fn(f64) -> f64,
    /// True if it changes each state by a factor of its own: one factor is no cause then.
    is_uneven: bool,
}

const fn identity(truth: NavState) -> NavState {
    truth
}

/// The state with other roll, pitch and yaw (rad).
fn with_angles(truth: NavState, map: fn([f64; 3]) -> [f64; 3]) -> NavState {
    let own = RollPitchYaw::from_quat(truth.q_b_n);
    let [roll, pitch, yaw] = map([own.roll, own.pitch, own.yaw]);
    NavState {
        q_b_n: RollPitchYaw { roll, pitch, yaw }.to_quat(),
        ..truth
    }
}

fn with_velocity(truth: NavState, map: fn(DVec3) -> DVec3) -> NavState {
    NavState {
        v_n: map(truth.v_n),
        ..truth
    }
}

/// (m/s).
const KM_H: f64 = 1.0 / 3.6;
const QUARTER: f64 = 90.0 * DEG;

/// A transformation of values comes first with standard deviations in the same unit, then in that of their names.
#[rustfmt::skip]
const TRANSFORMATIONS: [Transformation; 17] = {
    const fn new(block: usize, cause: &'static str, truth: fn(NavState) -> NavState, sigma: fn(f64) -> f64) -> Transformation {
        Transformation { block, cause, truth, sigma, is_uneven: false }
    }
    const fn variance(block: usize, cause: &'static str) -> Transformation {
        Transformation { block, cause, truth: identity, sigma: f64::sqrt, is_uneven: true }
    }
    const RADIANS: &str = "attitudes are radians named degrees";
    const DEGREES: &str = "attitudes are degrees named radians";
    const SPEEDS: &str = "velocities are km/h, not m/s";
    const EXCHANGED: &str = "north and east velocity are exchanged, as in east, north, up";
    const OF_EAST: &str = "yaw is 90° − ψ, counted from east to north: write it from north to east";
    const REVERSED: &str = "yaw has the other sign: write it from north to east";
    [
        variance(0, "standard deviations of position are variances (m²)"),
        variance(1, "standard deviations of velocity are variances (m²/s²)"),
        variance(2, "standard deviations of attitude are variances"),
        new(1, SPEEDS, |x| with_velocity(x, |v| v / KM_H), |s| s),
        new(1, SPEEDS, |x| with_velocity(x, |v| v / KM_H), |s| s / KM_H),
        new(1, EXCHANGED, |x| with_velocity(x, |v| DVec3::new(v.y, v.x, -v.z)), |s| s),
        new(1, EXCHANGED, |x| with_velocity(x, |v| DVec3::new(v.y, v.x, v.z)), |s| s),
        new(2, "standard deviations of attitude are radians named degrees", identity, |s| s / DEG),
        new(2, "standard deviations of attitude are degrees named radians", identity, |s| s * DEG),
        new(2, RADIANS, |x| with_angles(x, |all| all.map(|a| a * DEG)), |s| s),
        new(2, RADIANS, |x| with_angles(x, |all| all.map(|a| a * DEG)), |s| s * DEG),
        new(2, DEGREES, |x| with_angles(x, |all| all.map(|a| a / DEG)), |s| s),
        new(2, DEGREES, |x| with_angles(x, |all| all.map(|a| a / DEG)), |s| s / DEG),
        new(2, OF_EAST, |x| with_angles(x, |[r, p, y]| [r, p, QUARTER - y]), |s| s),
        new(2, OF_EAST, |x| with_angles(x, |[r, p, y]| [r, -p, QUARTER - y]), |s| s),
        new(2, REVERSED, |x| with_angles(x, |[r, p, y]| [r, p, -y]), |s| s),
        new(2, REVERSED, |x| with_angles(x, |[r, p, y]| [r, -p, -y]), |s| s),
    ]
};

/// Errors over standard deviations that are off by more than a factor of 1.5, and by more than the cube of what is left, have the
/// transformation for a cause; the other states are then off by less than this one.
const FAR: f64 = 1.5;
const OTHERS: f64 = 4.0;

/// Largest departure of these ratios from 1, and from one another, as logarithms; none without any.
fn departures(ratios: &[f64]) -> Option<[f64; 2]> {
    let known = || {
        ratios
            .iter()
            .filter(|r| r.is_finite() && **r > 0.0)
            .map(|r| r.ln())
    };
    let (least, most) = (known().reduce(f64::min)?, known().reduce(f64::max)?);
    Some([most.max(-least), most - least])
}

/// The transformations that explain the errors of a solution which is not consistent, by the block of their states.
fn transformed(
    rows: &[StatedRow],
    reference: &Reference,
    given: ReferenceOffset,
    stated: &DriveVerdict,
    doubts: &[SetupFault],
) -> Vec<(usize, SetupFault)> {
    if stated.verdict.kind <= VerdictKind::Undecided {
        return Vec::new();
    }
    let rms = |ratios: &[f64]| {
        let known = ratios.iter().filter(|r| r.is_finite());
        mean(known.map(|r| r * r)).sqrt()
    };
    let plain = |block: usize| &stated.error_over_sigma.0[3 * block..3 * block + 3];
    let are_axes_others = doubts.iter().any(|d| matches!(d, SetupFault::Axes { .. }));
    let looks: Vec<&StatedRow> = rows.iter().step_by(rows.len().div_ceil(FITTED)).collect();
    let try_one = |t: &Transformation| {
        let [far, spread] = departures(plain(t.block))?;
        if far < FAR.ln() || t.block == 2 && are_axes_others {
            return None;
        }
        let errors = looks
            .par_iter()
            .filter_map(|row| error_after(row, reference, given, t.truth, t.sigma));
        let errors: Vec<StatedErrors> = errors.collect();
        let of_state = |i: usize| {
            let ratios = errors.iter().map(|e| e.values[i] / e.sigma[i]);
            rms(&ratios.collect::<Vec<_>>())
        };
        let after: [f64; 3] = std::array::from_fn(|i| of_state(3 * t.block + i));
        let [left, uneven] = departures(&after)?;
        let is_cause = far > FAR.ln() + 3.0 * left;
        let is_shape = !t.is_uneven || spread > FAR.ln() / 2.0 + 2.0 * uneven;
        let doubt = SetupFault::Transformed {
            cause: t.cause,
            times: rms(plain(t.block)),
            left: rms(&after),
        };
        (is_cause && is_shape).then_some((left, doubt))
    };
    let best = |block: usize| {
        let own = TRANSFORMATIONS.iter().filter(|t| t.block == block);
        let found = own.filter_map(try_one);
        found.min_by(|a, b| a.0.total_cmp(&b.0))
    };
    let found: Vec<Option<(f64, SetupFault)>> = (0..3).map(best).collect();
    let is_right = |block: usize| {
        let off = departures(plain(block));
        found[block].is_some() || off.is_none_or(|[far, _]| far < OTHERS.ln())
    };
    if !(0..3).all(is_right) {
        return Vec::new();
    }
    let found = found.into_iter().enumerate();
    let found = found.filter_map(|(block, found)| Some((block, found?.1)));
    found.collect()
}

/// Axes of the body, or of navigation, that are others than the reference's: turned by quarters of a circle about them, all the
/// time. Any other angle is an error.
fn turned_axes(
    rows: &[StatedRow],
    reference: &Reference,
    given: ReferenceOffset,
) -> Option<SetupFault> {
    let pairs: Vec<(DQuat, DQuat)> = rows
        .iter()
        .filter(|row| row.has[1])
        .filter_map(|row| {
            let truth = reference.state(row.t_s + given.delay_s)?;
            Some((truth.q_b_n, row.state.q_b_n))
        })
        .collect();
    let of_body = pairs.iter().map(|(truth, own)| truth.inverse() * *own);
    let of_navigation = pairs.iter().map(|(truth, own)| *own * truth.inverse());
    let turned = quarter_turns(of_body.collect()).map(|q| (q, "body"));
    let turned = turned.or_else(|| Some((quarter_turns(of_navigation.collect())?, "navigation")));
    turned.map(|(q, axes)| {
        let rpy = RollPitchYaw::from_quat(q);
        SetupFault::Axes {
            axes,
            angles_deg: [rpy.roll, rpy.pitch, rpy.yaw].map(|a| a / DEG),
        }
    })
}

/// The rotation by quarters that all of these are near.
fn quarter_turns(all: Vec<DQuat>) -> Option<DQuat> {
    // q and −q are one rotation: all on the side of the first
    let first = DVec4::from(*all.first()?);
    let side = |q: &DQuat| DVec4::from(*q) * DVec4::from(*q).dot(first).signum();
    let sum: DVec4 = all.iter().map(side).sum();
    let middle = DQuat::from_vec4(sum.try_normalize()?);
    let scatter = median(all.iter().map(|q| middle.angle_between(*q)))?;
    let quarters =
        DMat3::from_cols_array(&DMat3::from_quat(middle).to_cols_array().map(f64::round));
    let is_rotation = (quarters.determinant() - 1.0).abs() < 1e-9;
    let nearest = DQuat::from_mat3(&quarters);
    let is_near = is_rotation && nearest.angle_between(middle).max(scatter) < AXES_DEG * DEG;
    (is_near && nearest.angle_between(DQuat::IDENTITY) > 1.0).then_some(nearest)
}

// Clock and point of the reference, from the errors. To first order a clock that is late by δ makes the error of position
// vδ, a point at l −C l; velocities and attitudes tell the two apart where v and the front axis hardly do. Least squares over
// all rows; errors last, so the covariance of the four is that of sums over blocks of rows ([Huber's sandwich](https://doi.org/10.2307/1912934)).

/// Blocks of a drive.
const BLOCKS: usize = 40;
/// A part whose absence costs less than this is none: χ² of three and 37 degrees, level 1e-4 (F = 9.2).
const COSTLY: f64 = 30.0;
/// Gauss-Newton steps, the difference that slopes are taken over (s, m), and rows at most.
const STEPS: usize = 5;
const OFF: f64 = 0.01;
const FITTED: usize = 5000;
/// A point (m) and a clock (s) that are nearer are the same.
const LEAST: (f64, f64) = (1e-3, 1e-4);
/// A point farther off is another frame (m).
const FARTHEST_M: f64 = 30.0;
/// Rows that are examined for a rough clock, and how far it is looked for (s), in steps (s).
const LOOKS: usize = 200;
const SEARCH_S: (f64, f64) = (120.0, 0.5);
/// Distance at which there is no other clock to look for (m).
const NEAR_M: f64 = 10.0;
/// Distance that the right clock leaves at most of what there was.
const NEARER: f64 = 0.3;

/// Clock and point that the errors of position ask for beside what was given.
fn found_offset(
    rows: &[StatedRow],
    reference: &Reference,
    given: ReferenceOffset,
) -> Option<FoundOffset> {
    let mut start = given.vector();
    start[3] = rough_delay_s(rows, reference, given).unwrap_or(given.delay_s);
    let solve = |parts: [bool; 2]| least_squares(rows, reference, start, parts);
    let both = solve([true; 2]);
    let parts = match &both {
        None => [true, false],
        Some((x, normal)) => {
            let off = x - given.vector();
            if normal.cost(&off, 0..4)? < COSTLY {
                return None;
            }
            let needed = normal.significant_parts(&off, COSTLY / 20.0)?;
            [needed.contains(&DELAY), needed.contains(&ANTENNA)]
        }
    };
    let (x, normal) = match both {
        Some(both) if parts == [true; 2] => both,
        _ => solve(parts)?,
    };
    let off = x - given.vector();
    let variance = normal.inverse.diagonal();
    let sigma = ReferenceOffset::of(&variance.map(|v| v.max(0.0).sqrt()));
    let is_delay = parts[0] && off[3].powi(2) > COSTLY * variance[3];
    let arm_m = off.fixed_rows::<3>(0).norm();
    let is_none = arm_m < LEAST.0 && off[3].abs() < LEAST.1;
    (!is_none && arm_m < FARTHEST_M && (parts[1] || is_delay)).then(|| FoundOffset {
        offset: ReferenceOffset::of(&x),
        sigma,
        parts,
    })
}

/// Lever arm (m) and delay (s) from a start, the parts that are not wanted as they are, and the inverse of the information.
fn least_squares(
    rows: &[StatedRow],
    reference: &Reference,
    start: Vector4<f64>,
    [delay, arm]: [bool; 2],
) -> Option<(Vector4<f64>, Normal)> {
    let wanted = [arm, arm, arm, delay];
    let looks: Vec<&StatedRow> = rows.iter().step_by(rows.len().div_ceil(FITTED)).collect();
    let mut x = start;
    let mut step = 0;
    loop {
        let terms: Vec<(Vector4<f64>, Matrix4<f64>)> = looks
            .par_iter()
            .filter_map(|row| {
                let now = normalised_error(row, reference, &x)?;
                let mut slopes = [[0.0; 4]; REPORTED];
                for k in (0..4).filter(|k| wanted[*k]) {
                    let aside = normalised_error(row, reference, &(x + Vector4::ith(k, OFF)))?;
                    for i in 0..REPORTED {
                        slopes[i][k] = (aside[i] - now[i]) / OFF;
                    }
                }
                let (mut gradient, mut information) = (Vector4::zeros(), Matrix4::zeros());
                for (slope, error) in slopes.map(Vector4::from).iter().zip(now) {
                    gradient += slope * error;
                    information += slope * slope.transpose();
                }
                Some((gradient, information))
            })
            .collect();
        let length = terms.len().div_ceil(BLOCKS).max(1);
        let blocks: Vec<Vector4<f64>> = terms
            .chunks(length)
            .map(|block| block.iter().map(|(gradient, _)| gradient).sum())
            .collect();
        let gradient: Vector4<f64> = blocks.iter().sum();
        let mut information: Matrix4<f64> = terms.iter().map(|(_, own)| own).sum();
        for k in 0..4 {
            information[(k, k)] += f64::from(u8::from(!wanted[k])); // what is not wanted stays
        }
        let inverse = information.try_inverse()?;
        if step == STEPS {
            let spread: Matrix4<f64> = blocks.iter().map(|g| g * g.transpose()).sum();
            let inverse = inverse * spread * inverse;
            return Some((x, Normal { inverse, gradient }));
        }
        x -= inverse * gradient;
        step += 1;
    }
}

/// Errors of a row over their standard deviations with clock and point of the reference at `x`: 0 where one is not known; of
/// positions without standard deviations those of a metre.
fn normalised_error(row: &StatedRow, reference: &Reference, x: &Vector4<f64>) -> Option<Nine> {
    let offset = ReferenceOffset::of(x);
    let found = error(row, reference, offset)?;
    Some(std::array::from_fn(|i| {
        let z = found.values[i] / found.sigma[i];
        match z.is_finite() {
            true => z,
            false if i < 3 => found.values[i],
            false => 0.0,
        }
    }))
}

/// Delay of the stamps of a reference (s), to half a second, where another clock brings it much nearer; none where the
/// given one is as good.
pub fn rough_delay_s(
    rows: &[StatedRow],
    reference: &Reference,
    given: ReferenceOffset,
) -> Option<f64> {
    const HOUR_S: f64 = 3600.0;
    let looks: Vec<&StatedRow> = rows
        .iter()
        .step_by(rows.len().div_ceil(LOOKS).max(1))
        .collect();
    let (first, last) = (rows.first()?.t_s, rows.last()?.t_s);
    let span = reference.span_s();
    let distance = |delay_s: f64| {
        let apart = |row: &&&StatedRow| {
            let truth = reference.state(row.t_s + delay_s)?;
            Some(horizontal(&reported_error(&row.state, &truth).0))
        };
        let apart: Vec<f64> = looks.iter().filter_map(|row| apart(&row)).collect();
        // a few rows at the ends are near by chance
        let is_enough = apart.len() * 4 >= looks.len();
        let apart = median(apart).filter(|_| is_enough);
        apart.unwrap_or(f64::INFINITY)
    };
    let now = distance(given.delay_s);
    if now < NEAR_M {
        return None; // what is left least squares find
    }
    let overlaps = span.0 <= last + given.delay_s && first + given.delay_s <= span.1;
    let centres: Vec<f64> = match overlaps {
        true => (-14..=14)
            .map(|h| given.delay_s + HOUR_S * f64::from(h))
            .collect(),
        // clocks that begin together, or end together
        false => vec![span.0 - first, span.1 - last],
    };
    let (reach, step) = SEARCH_S;
    let steps = (reach / step) as i32;
    let tried: Vec<f64> = centres
        .iter()
        .flat_map(|c| {
            (-steps..=steps).map(move |k| (c / step).round() * step + step * f64::from(k))
        })
        .collect();
    let (best, delay_s) = tried
        .par_iter()
        .map(|delay_s| (distance(*delay_s), *delay_s))
        .min_by(|a, b| a.0.total_cmp(&b.0))?;
    // Where nothing overlaps there is nothing to be nearer than but what the other clocks make.
    let usual = match now.is_finite() {
        true => now,
        false => median(
            tried
                .iter()
                .step_by(8)
                .map(|d| distance(*d))
                .filter(|d| d.is_finite()),
        )?,
    };
    (best < NEARER * usual).then_some(delay_s)
}

#[cfg(test)]
#[path = "judge_tests.rs"]
mod tests;
