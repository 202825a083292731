//! A trajectory on a map.

use nav_sim_document::{Chart, Colour, Mark, Series};
use nav_sim_navigation::earth::ned_difference;
use nav_sim_navigation::trajectory::Trajectory;

/// Instants of a trajectory that are drawn: more do not show.
const INSTANTS: u32 = 4000;

/// The track of a trajectory: time (s), and place east and north of the start (m), at evenly spaced instants.
pub(crate) fn track(trajectory: &Trajectory) -> Vec<(f64, [f64; 2])> {
    let start = trajectory.state(trajectory.start_s());
    let step = (trajectory.end_s() - trajectory.start_s()) / f64::from(INSTANTS);
    let instant = |k: u32| {
        let t_s = trajectory.start_s() + step * f64::from(k);
        let state = trajectory.state(t_s);
        let moved = ned_difference(start.place(), state.place());
        (t_s, [moved.y, moved.x])
    };
    (0..=INSTANTS).map(instant).collect()
}

/// A track on a map: outages marked, start and end named.
pub(crate) fn track_map(
    name: &str,
    track: &[(f64, [f64; 2])],
    title: &str,
    outages: &[(f64, f64)],
) -> Chart {
    let way = |from_s: f64, to_s: f64| {
        track
            .iter()
            .filter(|(t, _)| (from_s..to_s).contains(t))
            .map(|(_, place)| (*place).into())
            .collect()
    };
    let mut series = vec![Series::line(
        name,
        Colour::BELIEVED,
        way(f64::NEG_INFINITY, f64::INFINITY),
    )];
    series.extend(outages.iter().map(|(start_s, end_s)| {
        Series::new(
            "outage",
            Colour::REAL,
            Mark::Line(way(*start_s, *end_s), nav_sim_document::Stroke::Bold),
        )
    }));
    series.extend(
        [("start", track.first()), ("end", track.last())]
            .into_iter()
            .filter_map(|(name, end)| {
                let (_, [east, north]) = *end?;
                Some(Series::new(name, Colour::RIGHT, Mark::Place(east, north)))
            }),
    );
    Chart::map(title, series)
}

#[cfg(test)]
mod trajectory_tests {
    use super::*;
    use nav_sim_document::svg;

    #[test]
    fn a_map_has_everything_inside() {
        let track: Vec<_> = (0..11)
            .map(|k| (f64::from(k), [0.0, 100.0 * f64::from(k)]))
            .collect();
        let svg = svg("a<b", &[track_map("b", &track, "a<b", &[(3.0, 6.0)])]);
        assert!(svg.starts_with("<svg xmlns=") && svg.ends_with("</svg>\n"));
        assert_eq!(svg.matches("data-name=\"outage\"").count(), 1);
        assert!(
            svg.contains("<title>a&lt;b</title>") && !svg.contains("NaN") && !svg.contains("href")
        );
    }
}
