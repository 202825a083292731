//! What velocity columns look like where they contradict the positions.

use super::samples::Rows;
use glam::DVec3;
use nav_sim_navigation::trajectory::Trajectory;
use nav_sim_navigation::trajectory::plausibility::VelocityMisfit;

/// Velocities in n that a file gives, one for each row, or none at all.
#[derive(Debug, Default)]
pub(super) struct Velocities {
    /// m/s.
    pub given: Vec<DVec3>,
    /// The columns as the file names them.
    pub columns: [String; 3],
    /// Whether the third of them is a velocity up.
    pub is_up: bool,
}

/// A mean square (m²/s²) from which on a component shows its sign.
const SHOWN: f64 = 0.1 * 0.1;
/// What is left of a sum of squares where a reading is the right one.
const EXPLAINED: f64 = 0.1;
/// A step between rows (s) from which on a time a thousand times too long is the likelier one of two units.
const LONG_STEP_S: f64 = 2.0;
const MILLIMETRES: &str = "the velocities look like mm/s";
const MILLISECONDS: &str = "the time looks like milliseconds (then name its column t_ms)";
/// Factors from what is given to what the positions say, and what has them.
const FACTORS: [(f64, &str); 6] = [
    (1.0 / 3.6, "the velocities look like km/h"),
    (0.514_444, "the velocities look like knots"),
    (0.3048, "the velocities look like feet per second"),
    (1e-2, "the velocities look like cm/s"),
    (60.0, "the time looks like minutes, and is expected in seconds"),
    (3600.0, "the time looks like hours, and is expected in seconds"),
];

impl Velocities {
    /// Says where they contradict the positions, and what they look like.
    pub(super) fn doubt(rows: &mut Rows, trajectory: &Trajectory) {
        let times = rows.samples.iter().map(|s| s.t_s);
        let given: Vec<_> = times.zip(rows.velocities.given.iter().copied()).collect();
        let Some(misfit) = VelocityMisfit::new(trajectory, &given) else { return };
        let pairs: Vec<_> = given.iter().map(|(t_s, given)| (*given, trajectory.state(*t_s).v_n)).collect();
        let looks = rows.velocities.wrong_signs(&pairs).or_else(|| {
            let step_s = (given[given.len() - 1].0 - given[0].0) / given.len() as f64;
            let reading =
                || rows.velocities.zeros(&pairs).or_else(|| rows.velocities.other_reading(&pairs, step_s));
            misfit.contradicts().then(reading).flatten()
        });
        // A component that is small beside the speed contradicts by its sign alone.
        if looks.is_none() && !misfit.contradicts() {
            return;
        }
        let looks = looks.map_or_else(String::new, |looks| format!("; {looks}"));
        let line = given.iter().position(|(t, _)| *t == misfit.worst_s).map(|i| rows.lines[i]);
        rows.doubt(
            line,
            format!("{misfit}{looks}; the positions are used, whose columns may be the wrong ones instead"),
        );
    }

    /// The columns that agree with the positions when their sign is turned.
    fn wrong_signs(&self, pairs: &[(DVec3, DVec3)]) -> Option<String> {
        let sum = |f: &dyn Fn(DVec3, DVec3) -> f64| pairs.iter().map(|(g, p)| f(*g, *p).powi(2)).sum::<f64>();
        let is_turned = |i: &usize| {
            let (shown, as_given) = (sum(&|_, p| p[*i]), sum(&|g, p| g[*i] - p[*i]));
            shown > SHOWN * pairs.len() as f64 && sum(&|g, p| g[*i] + p[*i]) < EXPLAINED * as_given
        };
        let opposite = ["south", "west", if self.is_up { "down" } else { "up" }];
        let words = |i: usize| format!("{} has the sign of a velocity {}", self.columns[i], opposite[i]);
        let turned: Vec<String> = (0..3).filter(is_turned).map(words).collect();
        (!turned.is_empty()).then(|| turned.join(", "))
    }

    /// The columns that nobody filled in, though the positions move.
    fn zeros(&self, pairs: &[(DVec3, DVec3)]) -> Option<String> {
        let is_empty = |i: &usize| {
            let moved: f64 = pairs.iter().map(|(_, p)| p[*i].powi(2)).sum();
            pairs.iter().all(|(given, _)| given[*i] == 0.0) && moved > SHOWN * pairs.len() as f64
        };
        let empty: Vec<&str> = (0..3).filter(is_empty).map(|i| self.columns[i].as_str()).collect();
        match empty.as_slice() {
            [] => None,
            [one] => Some(format!("{one} is zero throughout")),
            several => Some(format!("{} are zero throughout", several.join(", "))),
        }
    }

    /// Another unit, of the velocities or of the time, or exchanged columns.
    fn other_reading(&self, pairs: &[(DVec3, DVec3)], step_s: f64) -> Option<String> {
        let sum = |f: &dyn Fn(DVec3, DVec3) -> f64| pairs.iter().map(|(g, p)| f(*g, *p)).sum::<f64>();
        let left = |read: &dyn Fn(DVec3) -> DVec3| sum(&|g, p| (read(g) - p).length_squared());
        if left(&|g| DVec3::new(g.y, g.x, g.z)) < EXPLAINED * left(&|g| g) {
            return Some(format!("{} and {} look exchanged", self.columns[0], self.columns[1]));
        }
        // least squares: the factor that brings what is given nearest to the positions
        let factor = sum(&|g, p| g.dot(p)) / sum(&|g, _| g.length_squared());
        if left(&|g| factor * g) > EXPLAINED * sum(&|_, p| p.length_squared()) {
            return None;
        }
        let is_near = |known: f64| (factor / known).ln().abs() < 0.03;
        if is_near(1e-3) {
            let looks = if step_s < LONG_STEP_S { MILLIMETRES } else { MILLISECONDS };
            return Some(looks.to_owned());
        }
        FACTORS.into_iter().find(|(known, _)| is_near(*known)).map(|(_, looks)| looks.to_owned())
    }
}
