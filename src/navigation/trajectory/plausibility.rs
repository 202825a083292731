//! Plausibility of a trajectory: limits on speed, acceleration, jerk and angular rate; velocities
//! that agree with positions.

use super::Trajectory;
use crate::linalg::{by_value, larger};
use crate::units::DEG;
use glam::DVec3;
use std::fmt;

/// Time over which a change of acceleration counts as a jump (s).
const JERK_WINDOW_S: f64 = 0.1;
/// Excesses nearer than this to one another are one (s).
const SAME_EVENT_S: f64 = 1.0;

/// Limited quantities and their units: speed, acceleration, change of acceleration over 0.1 s,
/// angular rate.
const QUANTITIES: [(&str, &str); 4] = [
    ("speed", "m/s"),
    ("acceleration", "m/s²"),
    ("jump of acceleration", "m/s³"),
    ("angular rate", "deg/s"),
];

/// Limits that no land vehicle and no aircraft outside aerobatics exceeds: 350 m/s, 30 m/s², 35
/// m/s³, 200 deg/s. Recorded drives stay below 25 m/s³ but for glitches of the recording.
pub const LIMITS: [f64; 4] = [350.0, 30.0, 35.0, 200.0];

/// A stretch beyond a limit.
#[derive(Debug, Clone, Copy)]
pub struct LimitExcess {
    /// The quantity and its unit.
    pub quantity: (&'static str, &'static str),
    /// The limit.
    pub limit: f64,
    /// The largest value.
    pub worst: f64,
    /// Time of the largest value (s).
    pub worst_s: f64,
    /// First time beyond the limit (s).
    pub start_s: f64,
    /// Last time beyond the limit (s).
    pub end_s: f64,
}

impl fmt::Display for LimitExcess {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (name, unit) = self.quantity;
        write!(
            f,
            "{name} {:.1} {unit} at {:.2} s, beyond {:.1} {unit}",
            self.worst, self.worst_s, self.limit
        )?;
        if self.end_s > self.start_s {
            write!(
                f,
                " (between {:.2} s and {:.2} s)",
                self.start_s, self.end_s
            )?;
        }
        Ok(())
    }
}

/// The largest speed, acceleration, jerk and rate of a trajectory (SI), in the order of `Quantity::ALL`,
/// and every stretch beyond the limits, in order of time.
pub fn examine(trajectory: &Trajectory, limits: &[f64; 4]) -> ([f64; 4], Vec<LimitExcess>) {
    let (mut largest, mut found) = ([0.0_f64; 4], Vec::new());
    let mut open: [Option<LimitExcess>; 4] = [None; 4];
    // Acceleration is linear between knots, so that its extremes are at knots.
    for &t_s in trajectory.knots() {
        for (i, value) in magnitudes(trajectory, t_s).into_iter().enumerate() {
            largest[i] = larger(largest[i], value);
            let limit = limits[i];
            // NaN lies beyond every limit: it is to be reported, not passed over.
            // A motion made to reach the limit exactly does so to rounding.
            if value.is_nan() || value > limit * (1.0 + 1e-6) {
                let event = LimitExcess {
                    quantity: QUANTITIES[i],
                    limit,
                    worst: value,
                    worst_s: t_s,
                    start_s: t_s,
                    end_s: t_s,
                };
                match &mut open[i] {
                    Some(e) if t_s - e.end_s <= SAME_EVENT_S => extend(e, &event),
                    slot => found.extend(slot.replace(event)),
                }
            }
        }
    }
    found.extend(open.into_iter().flatten());
    found.sort_by(|a, b| a.start_s.total_cmp(&b.start_s));
    (largest, found)
}

fn extend(event: &mut LimitExcess, by: &LimitExcess) {
    event.end_s = by.end_s;
    if by.worst > event.worst {
        (event.worst, event.worst_s) = (by.worst, by.worst_s);
    }
}

fn magnitudes(trajectory: &Trajectory, t_s: f64) -> [f64; 4] {
    let half = 0.5 * JERK_WINDOW_S;
    let clamped = |t: f64| t.clamp(trajectory.start_s(), trajectory.end_s());
    // A window rather than the third derivative: that of a cubic spline is a constant between samples, and
    // mostly the noise of them. At the ends the window is cut, and a steady jerk counts half there.
    let (before, after) = (
        trajectory.kinematics(clamped(t_s - half)),
        trajectory.kinematics(clamped(t_s + half)),
    );
    let now = trajectory.kinematics(t_s);
    let jerk = (after.a_e - before.a_e).length() / JERK_WINDOW_S;
    [
        now.v_e.length(),
        now.a_e.length(),
        jerk,
        now.omega_eb_b.length() / DEG,
    ]
}

/// Difference of given velocities from those of the positions.
#[derive(Debug, Clone, Copy)]
pub struct VelocityMisfit {
    /// Root mean square of the difference vector (m/s).
    pub rms: f64,
    /// Its largest length (m/s).
    pub worst: f64,
    /// When (s).
    pub worst_s: f64,
    /// Root mean square of the speed (m/s).
    rms_speed: f64,
}

impl VelocityMisfit {
    /// Compares (time, velocity in n) with the trajectory; none without any.
    pub fn new(trajectory: &Trajectory, velocities: &[(f64, DVec3)]) -> Option<Self> {
        let found = |t_s: f64| trajectory.state(t_s).v_n;
        let off: Vec<(f64, f64)> = velocities
            .iter()
            .map(|(t_s, v)| (*t_s, (*v - found(*t_s)).length()))
            .collect();
        let (worst_s, worst) = off.iter().copied().max_by(by_value)?;
        let rms = |squares: f64| (squares / off.len() as f64).sqrt();
        let speed = velocities
            .iter()
            .map(|(t_s, _)| found(*t_s).length_squared())
            .sum();
        let square = off.iter().map(|(_, metres)| metres * metres).sum();
        Some(Self {
            rms: rms(square),
            worst,
            worst_s,
            rms_speed: rms(speed),
        })
    }

    /// Returns true if they contradict the positions: 0.1 m/s + 2 % of the speed in the mean, or 1
    /// m/s + 10 % once.
    pub fn contradicts(&self) -> bool {
        self.rms > 0.1 + 0.02 * self.rms_speed || self.worst > 1.0 + 0.1 * self.rms_speed
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tests::*;

    /// Due north at 10 m/s (on a sphere of 6380 km, near enough), 20 Hz, with the given shift of height.
    fn north(shift: impl Fn(f64) -> f64) -> Trajectory {
        let at = |t_s| (0.8 + 10.0 * t_s / 6.38e6, 0.1, shift(t_s), DQuat::IDENTITY);
        Trajectory::from_samples(&samples(200, 0.05, at)).unwrap()
    }

    #[test]
    fn a_smooth_motion_is_plausible() {
        let ([speed, acceleration, jerk, rate], found) = examine(&north(|_| 0.0), &LIMITS);
        assert!(found.is_empty(), "{found:?}");
        assert!((speed - 10.0).abs() < 0.1 && acceleration < 1e-3 && jerk < 1e-3 && rate < 1e-4);
    }

    /// A step of 0.5 m between two samples 0.05 s apart is a speed of 10 m/s and hundreds of m/s².
    #[test]
    fn a_jump_is_found_where_it_is() {
        let t = north(|t| if t > 4.02 { 0.5 } else { 0.0 });
        let [_, acceleration, jerk, rate] = LIMITS;
        let (_, found) = examine(&t, &[15.0, acceleration, jerk, rate]);
        let kinds = found.iter().map(|e| e.quantity.0);
        assert!(
            kinds.eq(["jump of acceleration", "acceleration"]),
            "{found:?}"
        );
        let is_there =
            |e: &LimitExcess| (e.worst_s - 4.02).abs() < 0.1 && e.end_s - e.start_s < 1.0;
        assert!(found.iter().all(is_there), "{found:?}");
    }

    #[test]
    fn velocities_are_compared_with_positions() {
        let t = north(|_| 0.0);
        let given = |v: DVec3| (0..=10).map(|k| (f64::from(k), v)).collect::<Vec<_>>();
        let right = t.state(5.0).v_n;
        let misfit = |v| VelocityMisfit::new(&t, &given(v)).unwrap();
        assert!(!misfit(right).contradicts());
        let wrong = misfit(-right);
        assert!(
            wrong.contradicts() && (wrong.rms - 19.9).abs() < 0.1,
            "{wrong:?}"
        );
        assert!(VelocityMisfit::new(&t, &[]).is_none());
    }
}
