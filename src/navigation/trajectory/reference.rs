//! A trajectory that a solution is compared with: a recorded one has start-up jumps, outages and glitches, and
//! what can be compared with are the stretches between them.

use super::{MAX_ROTATION, Trajectory, TrajectorySample};
use crate::earth::{geodetic_to_ecef, moved};
use crate::frames::NavState;
use crate::linalg::median;
use crate::units::DEG;
use glam::DVec3;
use std::fmt;
use std::ops::Range;

/// A step of position this far from where the steps about it lead is a jump (m), beside what an acceleration
/// makes of it (m/s²). Corrections of a filter, tenths of a metre to metres, are none.
const POSITION_JUMP: (f64, f64) = (5.0, 30.0);
/// A rotation of so much (rad) and so fast beside it (rad/s) from one sample to the next is a jump.
const ATTITUDE_JUMP: (f64, f64) = (10.0 * DEG, 200.0 * DEG);
/// Steps on either side whose median says where a step should lead.
const NEIGHBOURS: usize = 5;
/// A longer step than this many median ones, and than so long (s), is a gap: what is in it is a guess.
const GAP: (f64, f64) = (1.5, 1.0 + 1e-6);
/// Length left out on either side of a jump (s): smoothing spreads it.
const AROUND_JUMP_S: f64 = 1.0;
/// A stretch with a jump at an end lasts at least so long (s), or is part of what jumps.
const SHORTEST_S: f64 = 5.0;

/// Longest step of positions whose unevenness is that of the positions (s): over longer ones it may be the motion's.
const FINE_S: f64 = 0.1;
/// A change of velocity from step to step this many times the median one is a correction.
const CORRECTION: f64 = 5.0;
/// Samples on either side over which the spline spreads a correction.
const SPREAD: usize = 6;

/// Stretches of a recorded trajectory, in order of time.
#[derive(Debug, Clone)]
pub struct Reference {
    stretches: Vec<Stretch>,
}

/// A trajectory, and how well its velocity is known at each of its knots (m/s).
#[derive(Debug, Clone)]
struct Stretch {
    curve: Trajectory,
    velocity_sigma: Vec<f64>,
}

impl From<Trajectory> for Reference {
    fn from(curve: Trajectory) -> Self {
        let velocity_sigma = velocity_sigma(&curve);
        let whole = Stretch {
            curve,
            velocity_sigma,
        };
        Self {
            stretches: vec![whole],
        }
    }
}

/// Reason that samples are left out.
#[derive(Debug, Clone)]
pub enum Fault {
    /// No samples for so long (s).
    Gap(f64),
    /// Time stands still or goes back by so much (s).
    Back(f64),
    /// The position is so far from where it was to be expected (m).
    Position(f64),
    /// The attitude turns by so much (rad) from one sample to the next.
    Attitude(f64),
}

impl fmt::Display for Fault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Gap(seconds) => write!(f, "a gap of {seconds:.2} s"),
            Self::Back(seconds) => write!(f, "time goes back by {seconds:.2} s"),
            Self::Position(metres) => write!(f, "a jump of {metres:.1} m"),
            Self::Attitude(angle) => write!(f, "a jump of {:.1}° in attitude", angle / DEG),
        }
    }
}

/// The fault that ends a stretch: between sample `index − 1` and `index`.
#[derive(Debug, Clone)]
pub struct Break {
    /// The sample after it.
    pub index: usize,
    /// The fault.
    pub fault: Fault,
}

impl Reference {
    /// The reference of stretches in order of time; none without any.
    pub fn of_stretches(stretches: Vec<Trajectory>) -> Option<Self> {
        let all = stretches.into_iter().map(Self::from);
        all.reduce(|mut all, more| {
            all.stretches.extend(more.stretches);
            all
        })
    }

    /// Position, velocity and attitude at an instant; none where nothing is known.
    pub fn state(&self, t_s: f64) -> Option<NavState> {
        Some(self.stretch(t_s)?.curve.state(t_s))
    }

    /// State of a point of the vehicle that is `arm_b` (front, right, down, m) from the reference's.
    pub fn state_of_point(&self, t_s: f64, arm_b: DVec3) -> Option<NavState> {
        let curve = &self.stretch(t_s)?.curve;
        let state = curve.state(t_s);
        let rotation_b = curve.kinematics(t_s).omega_eb_b.cross(arm_b);
        let [lat, lon, h] = moved(state.place(), state.q_b_n * arm_b);
        let v_n = state.v_n + state.q_b_n * rotation_b;
        Some(NavState {
            lat,
            lon,
            h,
            v_n,
            ..state
        })
    }

    /// Instants at which it was recorded (s); between them it is interpolated.
    pub fn epochs(&self) -> impl Iterator<Item = f64> + '_ {
        self.stretches.iter().flat_map(|s| s.curve.knots()).copied()
    }

    /// First and last instant (s).
    pub fn span_s(&self) -> (f64, f64) {
        let spans = self.stretches.iter().map(|s| s.curve.span_s());
        spans.fold((f64::INFINITY, f64::NEG_INFINITY), |all, own| {
            (all.0.min(own.0), all.1.max(own.1))
        })
    }

    /// Standard deviation of the velocity at an instant (m/s, each axis): the velocity follows from
    /// the positions and is as uneven as they are. A filter that corrects its position by half a
    /// metre from one sample to the next, 20 ms later, does not move at 25 m/s.
    pub fn velocity_sigma(&self, t_s: f64) -> Option<f64> {
        let stretch = self.stretch(t_s)?;
        // the worse one of the knots on either side
        let knot = stretch.curve.knots().partition_point(|knot| *knot < t_s);
        let sigmas = stretch.velocity_sigma.get(knot.saturating_sub(1)..=knot)?;
        Some(sigmas.iter().copied().fold(0.0, f64::max))
    }

    fn stretch(&self, t_s: f64) -> Option<&Stretch> {
        let next = self.stretches.partition_point(|s| s.curve.end_s() < t_s);
        self.stretches
            .get(next)
            .filter(|s| s.curve.start_s() <= t_s)
    }
}

/// Standard deviation of the velocities of a spline through these positions at its knots (m/s, each
/// axis): as for positions with white errors everywhere, larger near a correction.
fn velocity_sigma(curve: &Trajectory) -> Vec<f64> {
    let knots = curve.knots();
    let places: Vec<DVec3> = knots.iter().map(|t_s| curve.kinematics(*t_s).r_e).collect();
    let seconds: Vec<f64> = knots.windows(2).map(|w| w[1] - w[0]).collect();
    let v: Vec<DVec3> = places
        .windows(2)
        .zip(&seconds)
        .map(|(w, s)| (w[1] - w[0]) / *s)
        .collect();
    // the second difference of the velocities of steps: of a smooth motion the jerk times a step squared
    let uneven: Vec<f64> = v
        .windows(3)
        .zip(seconds.windows(3))
        .map(|(v, s)| {
            if s.iter().all(|s| *s <= FINE_S) {
                (v[2] - 2.0 * v[1] + v[0]).length()
            } else {
                0.0
            }
        })
        .collect();
    let median = median(uneven.iter().copied()).unwrap_or(0.0);
    // White errors σ of a position have 20 σ² in an axis of that difference times the step, and 1.39 σ² in the slope of
    // the spline, whose weights are 3 (√3 − 2)^k; the median of three axes is at 1.54.
    let white = (1.39_f64 / 20.0).sqrt() / 1.54 * median;
    // a correction by s makes 1, −2, 1 times s over the step; the slopes of the spline fall by √3 − 2 a knot beside it
    let near = |knot: usize| {
        // `uneven[i]` is about the knots i + 1 and i + 2
        let from = knot.saturating_sub(SPREAD + 2).min(uneven.len());
        let to = (knot + SPREAD).min(uneven.len());
        let corrections = (from..to).filter(|i| uneven[*i] > CORRECTION * median);
        let faded = corrections.map(|i| {
            let beside = (i + 1).saturating_sub(knot).max(knot.saturating_sub(i + 2));
            0.5 * uneven[i] * (2.0 - 3.0_f64.sqrt()).powi(beside as i32)
        });
        faded.fold(0.0, f64::max)
    };
    (0..knots.len())
        .map(|knot| white.hypot(near(knot)))
        .collect()
}

/// Finds the pairs of consecutive samples between which no vehicle moves that way.
pub fn breaks(samples: &[TrajectorySample]) -> Vec<Break> {
    let steps = Steps::new(samples);
    let break_before = |index| steps.fault(index).map(|fault| Break { index, fault });
    (1..samples.len()).filter_map(break_before).collect()
}

/// Samples that can be compared with: those between breaks, without what is near a jump.
pub fn usable(samples: &[TrajectorySample], breaks: &[Break]) -> Vec<Range<usize>> {
    let jump = |b: Option<&Break>| {
        b.is_some_and(|b| matches!(b.fault, Fault::Position(_) | Fault::Attitude(_)))
    };
    let edges: Vec<usize> = std::iter::once(0)
        .chain(breaks.iter().map(|b| b.index))
        .chain([samples.len()])
        .collect();
    let mut found: Vec<Range<usize>> = Vec::new();
    for (k, edge) in edges.windows(2).enumerate() {
        let (before, after) = (k.checked_sub(1).and_then(|k| breaks.get(k)), breaks.get(k));
        let part = &samples[edge[0]..edge[1]];
        let Some((first, last)) = part.first().zip(part.last()) else {
            continue;
        };
        let trimmed = |is: bool| if is { AROUND_JUMP_S } else { 0.0 };
        let (from, to) = (
            first.t_s + trimmed(jump(before)),
            last.t_s - trimmed(jump(after)),
        );
        if (jump(before) || jump(after)) && last.t_s - first.t_s < SHORTEST_S {
            continue;
        }
        // a clock that was set back: what is behind is not gone through twice; a stamp that is repeated is passed over
        let gone_s = found
            .last()
            .map_or(f64::NEG_INFINITY, |r| samples[r.end - 1].t_s);
        let start = part.partition_point(|s| s.t_s < from - 1e-6);
        let is_later = part.get(start).is_some_and(|s| s.t_s >= gone_s);
        let start = start + part[start..].partition_point(|s| s.t_s <= gone_s);
        let range = edge[0] + start..edge[0] + part.partition_point(|s| s.t_s <= to + 1e-6);
        // Four samples are what a spline needs.
        if range.len() >= 4 && is_later {
            found.push(range);
        }
    }
    found
}

/// Differences between consecutive samples.
struct Steps<'a> {
    samples: &'a [TrajectorySample],
    /// From the sample before (m), in e.
    moved_e: Vec<DVec3>,
    median_s: f64,
}

impl<'a> Steps<'a> {
    fn new(samples: &'a [TrajectorySample]) -> Self {
        let place = |s: &TrajectorySample| geodetic_to_ecef(s.lat, s.lon, s.h);
        Self {
            samples,
            moved_e: samples
                .windows(2)
                .map(|w| place(&w[1]) - place(&w[0]))
                .collect(),
            // The median is not moved by gaps, however long.
            median_s: median(samples.windows(2).map(|w| w[1].t_s - w[0].t_s)).unwrap_or(0.0),
        }
    }

    fn seconds(&self, index: usize) -> f64 {
        self.samples[index].t_s - self.samples[index - 1].t_s
    }

    /// Fault of the step to sample `index`, if any.
    fn fault(&self, index: usize) -> Option<Fault> {
        let seconds = self.seconds(index);
        // Time first: everything below divides by the seconds.
        if seconds <= 0.0 {
            return Some(Fault::Back(seconds.abs()));
        }
        if seconds > GAP.1.max(GAP.0 * self.median_s) {
            return Some(Fault::Gap(seconds));
        }
        let turn = self.samples[index - 1].q_b_n.conjugate() * self.samples[index].q_b_n;
        // |w|: q and −q are one attitude, and the shorter way round is meant.
        let angle = 2.0 * turn.xyz().length().atan2(turn.w.abs());
        if angle > MAX_ROTATION.min(ATTITUDE_JUMP.0 + ATTITUDE_JUMP.1 * seconds) {
            return Some(Fault::Attitude(angle));
        }
        let (expected, reach_s) = self.expected(index);
        // The velocity of the neighbours may differ by acceleration × their distance in time, and so the step
        // by that times its own length.
        let metres = (self.moved_e[index - 1] - expected * seconds).length();
        (metres > POSITION_JUMP.0 + POSITION_JUMP.1 * seconds * reach_s)
            .then_some(Fault::Position(metres))
    }

    /// The median velocity of the steps about one (m/s, in e), each axis by itself, and how far in time they
    /// reach (s). The median is not moved by a jump to another place and back.
    fn expected(&self, index: usize) -> (DVec3, f64) {
        // The step itself is among its neighbours: of eleven values one does not move a median.
        let first = index.saturating_sub(NEIGHBOURS).max(1);
        let last = (index + NEIGHBOURS).min(self.samples.len() - 1);
        let near = || (first..=last).filter(|i| self.seconds(*i) > 0.0);
        let axis = |a: usize| {
            let velocities = near().map(|i| self.moved_e[i - 1][a] / self.seconds(i));
            median(velocities).unwrap_or(f64::NAN)
        };
        let now = self.samples[index].t_s;
        let reach = (now - self.samples[first - 1].t_s).max(self.samples[last].t_s - now);
        (DVec3::new(axis(0), axis(1), axis(2)), reach)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tests::*;

    /// 60 s north at 15 m/s, 20 samples a second, changed by `fault`.
    fn drive(fault: impl Fn(f64, &mut TrajectorySample)) -> Vec<TrajectorySample> {
        let north = |t_s| {
            (
                0.8 + 15.0 * t_s / 6.38e6,
                0.1,
                400.0,
                DQuat::from_rotation_z(0.3),
            )
        };
        let mut samples = samples(1200, 0.05, north);
        samples.iter_mut().for_each(|s| fault(s.t_s, s));
        samples
    }

    fn spans(samples: &[TrajectorySample]) -> Vec<(f64, f64)> {
        let rounded = |t: f64| (t * 1e3).round() / 1e3;
        let span = |r: Range<usize>| [r.start, r.end - 1].map(|i| rounded(samples[i].t_s)).into();
        usable(samples, &breaks(samples))
            .into_iter()
            .map(span)
            .collect()
    }

    #[test]
    fn a_sound_recording_is_one_stretch() {
        // corrections of 1 m twice a second, as references with GNSS updates have them
        let corrected = drive(|t, s| {
            s.h += if (2.0 * t).floor() % 2.0 == 0.0 {
                1.0
            } else {
                0.0
            }
        });
        assert_eq!(spans(&drive(|_, _| {})), [(0.0, 60.0)]);
        assert_eq!(spans(&corrected), [(0.0, 60.0)]);
    }

    /// 2.4 km away for a third of a second; an attitude that starts with another heading; 20 m for good.
    #[test]
    fn what_is_near_a_jump_is_left_out_and_nothing_else() {
        let away = drive(|t, s| {
            s.lon += if (30.02..30.33).contains(&t) {
                5.5e-4
            } else {
                0.0
            }
        });
        assert_eq!(spans(&away), [(0.0, 29.0), (31.35, 60.0)]);
        let found = breaks(&away);
        assert!(
            matches!(found[0].fault, Fault::Position(m) if (2300.0..2600.0).contains(&m)),
            "{found:?}"
        );
        let started = drive(|t, s| {
            if t < 3.02 {
                s.q_b_n = DQuat::from_rotation_z(2.9);
            }
        });
        assert_eq!(spans(&started), [(4.05, 60.0)]);
        let shifted = drive(|t, s| s.h += if t > 20.02 { 20.0 } else { 0.0 });
        assert_eq!(spans(&shifted), [(0.0, 19.0), (21.05, 60.0)]);
    }

    /// The velocity of a reference that is corrected by 1 m, or rounded to millimetres, is off by what is said of it; that
    /// of a smooth one is known.
    #[test]
    fn velocities_are_known_as_well_as_positions_are_even() {
        let known = |samples: &[TrajectorySample]| {
            let reference = Reference::from(Trajectory::from_samples(samples).unwrap());
            let at = |k: u32| {
                let t_s = 0.013 * f64::from(k);
                // the drive goes north at a constant speed, to a curvature of 1e-5 m/s
                let v = reference.state(t_s).unwrap().v_n;
                (v.y.hypot(v.z), reference.velocity_sigma(t_s).unwrap())
            };
            (80..4500).map(at).collect::<Vec<_>>()
        };
        let rms = |of: &dyn Fn(&(f64, f64)) -> f64, all: &[(f64, f64)]| {
            (all.iter().map(|x| of(x).powi(2)).sum::<f64>() / all.len() as f64).sqrt()
        };
        assert!(
            known(&drive(|_, _| {}))
                .iter()
                .all(|(_, sigma)| *sigma < 1e-3)
        );
        let corrected = known(&drive(|t, s| {
            s.h += if (t + 0.02).rem_euclid(2.0) < 1.0 {
                1.0
            } else {
                0.0
            }
        }));
        assert!(
            corrected
                .iter()
                .all(|(off, sigma)| *off < 2.0 * sigma + 0.01),
            "{corrected:?}"
        );
        assert!(corrected.iter().filter(|(_, sigma)| *sigma < 0.01).count() > corrected.len() / 8);
        let rounded = known(&drive(|_, s| {
            s.h = ((s.h + 1e3 * s.lat) * 1e3).round() / 1e3
        }));
        // the rounding is white where the slope is that of 1e3 rad⁻¹: 0.29 mm each
        let (off, sigma) = (rms(&|x| x.0, &rounded), rms(&|x| x.1, &rounded));
        assert!(off < 2.0 * sigma && sigma < 0.1, "{off} {sigma}");
    }

    #[test]
    fn gaps_and_clocks_set_back_part_it_without_loss() {
        let mut gap = drive(|_, _| {});
        gap.retain(|s| !(20.02..25.02).contains(&s.t_s));
        assert_eq!(spans(&gap), [(0.0, 20.0), (25.05, 60.0)]);
        let far = drive(|t, s| {
            s.t_s += if (30.02..30.06).contains(&t) {
                1.7e9
            } else {
                0.0
            }
        });
        assert_eq!(spans(&far), [(0.0, 30.0), (30.1, 60.0)]);
        let back = drive(|t, s| s.t_s -= if t > 40.02 { 10.0 } else { 0.0 });
        assert_eq!(spans(&back), [(0.0, 40.0)]);
        let mut twice = drive(|_, _| {});
        twice.insert(801, twice[800]);
        assert_eq!(spans(&twice), [(0.0, 40.0), (40.05, 60.0)]);
    }

    #[test]
    fn between_stretches_nothing_is_known() {
        let samples = drive(|_, _| {});
        let part = |r: Range<usize>| Trajectory::from_samples(&samples[r]).unwrap();
        let reference = Reference::of_stretches(vec![part(0..401), part(600..1201)]).unwrap();
        assert!(reference.state(10.0).is_some() && reference.state(20.0).is_some());
        assert!(reference.state(25.0).is_none() && reference.state(30.0).is_some());
        assert!(reference.state(-0.1).is_none() && reference.state(60.1).is_none());
        assert!(Reference::of_stretches(Vec::new()).is_none());
    }
}
