//! GPX tracks: time, latitude, longitude, elevation of every track point.
//!
//! Format: <https://www.topografix.com/GPX/1/1/>. Elements are known by their names without the prefix of a
//! namespace; comments, extensions and everything outside track points are passed over.

use super::samples::{Attitude, Rows};
use crate::io::{Failure as Error, Place};
use chrono::{DateTime, NaiveDateTime, Utc};
use glam::DQuat;
use nav_sim_navigation::trajectory::TrajectorySample;
use nav_sim_signal::units::DEG;
use roxmltree::{Document, Node};

/// A GPX track; heading and pitch follow the path.
pub(super) fn gpx(path: &str, text: &str) -> Result<Rows, Error> {
    let document = Document::parse(text).map_err(|e| {
        let line = u64::from(e.pos().row);
        Error::contents(path, line, format!("not well-formed XML: {e}"))
    })?;
    let mut rows = Rows::new(path, Vec::new(), Vec::new(), Attitude::OfPath);
    let (mut start, mut line, mut counted) = (None, 1, 0);
    let nodes = document.descendants();
    for point in nodes.filter(|node| node.tag_name().name() == "trkpt") {
        let begin = point.range().start;
        line += text[counted..begin].matches('\n').count() as u64;
        counted = begin;
        // extensions have times and elevations of their own
        let child = |name| point.children().find(|own| own.tag_name().name() == name);
        let text = |name| {
            let child = || child(name)?.children().find(Node::is_text)?.text();
            point.attribute(name).or_else(child)
        };
        let absent = |column| {
            let reason = "does not have it, or not as a number";
            Error::cell(path, line, column, "the track point", reason).or_hint(
                "every <trkpt> needs lat, lon, <ele> and <time>: export them with the track",
            )
        };
        let number = |column| {
            let number = text(column).and_then(|text| text.trim().parse::<f64>().ok());
            number.ok_or_else(|| absent(column))
        };
        let time = text("time").and_then(|text| instant(text.trim()));
        let time = time.ok_or_else(|| absent("time"))?;
        rows.samples.push(TrajectorySample {
            t_s: (time - *start.get_or_insert(time)).as_seconds_f64(),
            lat: number("lat")? * DEG,
            lon: number("lon")? * DEG,
            h: number("ele")?,
            q_b_n: DQuat::IDENTITY,
        });
        rows.lines.push(line);
    }
    if rows.samples.is_empty() {
        return Err(Error::contents(path, Place::Within, "no rows in it"));
    }
    rows.doubt(
        None,
        "GPX: heading and pitch follow the path, roll is 0; elevations are taken as ellipsoidal heights",
    );
    Ok(rows)
}

/// A time as GPX has it: 2024-05-01T10:20:30.5Z, with another offset, or without one (UTC).
fn instant(text: &str) -> Option<DateTime<Utc>> {
    let local =
        || NaiveDateTime::parse_from_str(text, "%Y-%m-%dT%H:%M:%S%.f").map(|time| time.and_utc());
    DateTime::parse_from_rfc3339(text)
        .map(|time| time.to_utc())
        .or_else(|_| local())
        .ok()
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;
    use nav_sim_navigation::frames::RollPitchYaw;
    use nav_sim_navigation::trajectory::Trajectory;

    fn load(path: &str, text: &str) -> Result<(Trajectory, Vec<String>), Error> {
        gpx(path, text)?.trajectory()
    }

    /// Nine points north, 1e-4 degrees and a metre up a second, across a leap day and into another time zone.
    fn track() -> String {
        let point = |k: u32| {
            let lat = 46.0 + 1e-4 * f64::from(k);
            format!(
                "<trkpt lon='7.0' lat=\"{lat}\">\n<ele>{}</ele><time>2024-02-29T23:59:{}Z</time></trkpt>\n",
                500 + k,
                52 + k
            )
        };
        let last = "<trkpt lat=\"46.0008\" lon=\"7\"><ele>508</ele><time>2024-03-01T02:00:00+02:00</time></trkpt>";
        let points: String = (0..8).map(point).collect();
        format!("<gpx>\n<trk><trkseg>\n{points}{last}</trkseg></trk></gpx>")
    }

    #[test]
    fn a_byte_order_mark_is_no_part_of_a_file() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.gpx");
        std::fs::write(&path, format!("\u{feff}{}", track())).unwrap();
        let (t, _) = super::super::load(&path, &super::super::Options::default()).unwrap();
        assert_eq!((t.start_s(), t.end_s()), (0.0, 8.0));
    }

    #[test]
    fn tracks_get_their_heading_from_the_path() {
        let text = track();
        let (t, warnings) = load("a.gpx", &text).unwrap();
        assert_eq!((t.start_s(), t.end_s(), warnings.len()), (0.0, 8.0, 1));
        let (state, rpy) = (t.state(4.0), RollPitchYaw::from_quat(t.state(4.0).q_b_n));
        assert!(
            (state.v_n - DVec3::new(11.117, 0.0, -1.0)).length() < 0.01,
            "{}",
            state.v_n
        );
        assert!(
            rpy.yaw.abs() < 1e-6 && (rpy.pitch - (1.0_f64 / 11.117).atan()).abs() < 1e-3,
            "{rpy:?}"
        );
        let e = load("a.gpx", &text.replacen("<ele>500</ele>", "", 1)).unwrap_err();
        assert!(e.advice().unwrap().contains("<ele> and <time>"), "{e:?}");
        let e = e.to_string();
        assert_eq!(
            e,
            "a.gpx, line 3: column \"ele\": the track point does not have it, or not as a number"
        );
        assert_eq!(
            load("a.gpx", "<gpx></gpx>").unwrap_err().to_string(),
            "a.gpx: no rows in it"
        );
    }

    #[test]
    fn prefixes_comments_and_extensions_change_nothing() {
        let written = track()
            .replace("<trk", "<g:trk")
            .replace("</trk", "</g:trk")
            .replace("<ele>", "<g:ele><!-- metres --><![CDATA[")
            .replace("</ele>", "]]></g:ele>")
            .replace(
                "<time>",
                "<g:extensions><ele>9</ele><x:time/></g:extensions><g:time>\n  ",
            )
            .replace("</time>", "\n</g:time>")
            .replace(
                "<gpx>",
                "<?xml version=\"1.0\"?>\n<gpx xmlns:g='u' xmlns:x='v'><!-- <trkpt lat='1'> -->",
            );
        let (plain, other) = (
            gpx("a.gpx", &track()).unwrap(),
            gpx("a.gpx", &written).unwrap(),
        );
        assert_eq!(plain.samples, other.samples);
        assert_eq!((plain.lines[0], other.lines[0]), (3, 4));
    }

    #[test]
    fn what_is_not_xml_is_refused_with_its_line() {
        let e = load("a.gpx", &track().replacen("</trkpt>", "</trkseg>", 1))
            .unwrap_err()
            .to_string();
        assert!(e.starts_with("a.gpx, line 4: not well-formed XML: "), "{e}");
    }

    #[test]
    fn times_have_fractions_offsets_and_leap_seconds() {
        let start = instant("2016-12-31T23:59:59.75Z").unwrap();
        for (text, seconds) in [
            ("2016-12-31T23:59:60.5Z", 0.75),
            ("2017-01-01T00:00:00Z", 0.25),
            ("2017-01-01T00:00:01.125", 1.375),
            ("2017-01-01T01:30:00+01:30", 0.25),
        ] {
            assert_eq!(
                (instant(text).unwrap() - start).as_seconds_f64(),
                seconds,
                "{text}"
            );
        }
        assert!(
            ["", "2017-02-29T00:00:00Z", "2017-01-01", "noon"]
                .iter()
                .all(|text| instant(text).is_none())
        );
    }
}
