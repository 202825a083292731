//! What is wrong with a profile.

/// A profile that cannot be followed.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error("{}: \"{}\" {problem}", place(*segment), problem.key())]
pub struct Error {
    /// Which segment, counted from 0; none for the profile's own keys and its start.
    pub segment: Option<usize>,
    /// What is wrong.
    pub problem: Problem,
}

fn place(segment: Option<usize>) -> String {
    segment.map_or("start".to_owned(), |i| format!("segment {}", i + 1))
}

/// What is wrong with a profile; the texts continue `"key" = value`.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum Problem {
    /// A value outside its domain.
    #[error("is not {domain}")]
    Domain {
        /// Key in profile files.
        key: &'static str,
        /// What would be accepted.
        domain: &'static str,
    },
    /// Something that only a moving vehicle can do.
    #[error("needs a moving vehicle, but it stands still here")]
    AtRest {
        /// Key in profile files.
        key: &'static str,
    },
    /// Too much height for the path.
    #[error("is too steep: {climb_m} m over {length_m:.1} m of path climbs more than 60°")]
    TooSteep {
        /// Height gained (m).
        climb_m: f64,
        /// Length of the path (m).
        length_m: f64,
    },
    /// More than a day.
    #[error("makes the trajectory {total_s:.3e} s long: more than a day")]
    TooLong {
        /// Duration up to the end of the segment (s).
        total_s: f64,
    },
    /// A waypoint nearer than the turns before and after it need.
    #[error("has waypoint {number} too near: {leg_m:.1} m away, the turns take {needed_m:.1} m")]
    TooNear {
        /// Which waypoint, from 1.
        number: usize,
        /// Distance left to it (m).
        leg_m: f64,
        /// Distance the turn needs (m).
        needed_m: f64,
    },
    /// A waypoint inside the turning circle.
    #[error("has waypoint {number} inside the turning circle")]
    Unreachable {
        /// Which waypoint, from 1.
        number: usize,
    },
    /// A corner that turns back.
    #[error("turns back by {angle_deg:.0}° at waypoint {number}: more than 150°")]
    TurnsBack {
        /// Which waypoint, from 1.
        number: usize,
        /// The corner (deg).
        angle_deg: f64,
    },
    /// The path leaves the region of latitude and longitude, or turns too fast to sample.
    #[error("gives no trajectory: {0}")]
    Samples(crate::trajectory::Error),
}

impl Problem {
    /// The key in profile files that is to blame.
    #[must_use]
    pub const fn key(&self) -> &'static str {
        match self {
            Self::Domain { key, .. } | Self::AtRest { key } => key,
            Self::TooSteep { .. } => "climb_m",
            Self::TooNear { .. } | Self::Unreachable { .. } | Self::TurnsBack { .. } => "points",
            Self::TooLong { .. } => "duration_s",
            Self::Samples(_) => "segment",
        }
    }

    /// What to do about it, where that is not plain.
    #[must_use]
    pub const fn hint(&self) -> Option<&'static str> {
        Some(match self {
            Self::AtRest { .. } => {
                "put an accelerate segment before it, or give the start a speed_m_s"
            }
            Self::TooSteep { .. } => "climb over a longer path, or for longer",
            Self::TooNear { .. } | Self::Unreachable { .. } => {
                "turn tighter, go slower, or move the point away"
            }
            Self::TurnsBack { .. } => "turn back over two points",
            Self::Samples(crate::trajectory::Error::Rotation { .. }) => "give the turn more time",
            Self::Domain { .. } | Self::TooLong { .. } | Self::Samples(_) => return None,
        })
    }
}
