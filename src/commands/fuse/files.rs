//! Files of a fusion directory: tables, track for maps, summary, page.

use super::FuseAnswer;
use super::summary::{STATE, values};
use crate::app::OutputFile;
use crate::report::json;
use nav_sim_document::shortest;
use nav_sim_navigation::earth::radii;
use nav_sim_navigation::frames::wrap_angle;
use nav_sim_navigation::fusion::{Row, Solution};
use nav_sim_navigation::simulation::{BIAS_NAMES, REPORTED_NAMES};
use nav_sim_signal::units::DEG;
use std::fmt::Write as _;

/// Names of the files of a fusion directory. The smoothed ones are there where that was asked for.
pub(super) const FILES: [&str; 8] = [
    "solution.csv",
    "innovations.csv",
    "errors.csv",
    "solution.kml",
    "smoothed.csv",
    "errors_smoothed.csv",
    "smoothed.kml",
    "summary.json",
];

/// The files of a fusion directory; `errors.csv` is empty but for its header without a
/// reference.
pub(super) fn directory(answer: &FuseAnswer) -> Vec<OutputFile<'static>> {
    let FuseAnswer {
        solution, summary, ..
    } = answer;
    let title = answer
        .inputs
        .first()
        .map_or("solution", |imu| imu.path.as_str());
    let smoothed = solution.smoothed.as_deref();
    let contents = [
        Some(solution_csv(&solution.rows)),
        Some(innovations_csv(solution)),
        Some(errors_csv(&solution.rows)),
        Some(kml(&solution.rows, "solution", title)),
        smoothed.map(solution_csv),
        smoothed.map(errors_csv),
        smoothed.map(|rows| kml(rows, "smoothed solution", title)),
        Some(json(summary)),
    ];
    let files = FILES.into_iter().zip(contents);
    files
        .filter_map(|(name, text)| Some(OutputFile::whole(name, text?)))
        .collect()
}

fn header(groups: &[(&str, &[&str])]) -> String {
    let names = groups
        .iter()
        .flat_map(|(prefix, names)| names.iter().map(move |n| format!("{prefix}{n}")));
    std::iter::once("t_s".to_owned())
        .chain(names)
        .collect::<Vec<_>>()
        .join(",")
        + "\n"
}

/// A number with as many digits as its size deserves: 1e-10 degrees are 0.01 mm.
fn fixed(x: f64, digits: usize) -> String {
    if x.is_finite() && x.abs() < 1e15 {
        format!("{x:.digits$}")
    } else {
        shortest(x)
    }
}

/// `solution.csv` and `smoothed.csv`: states, their standard deviations (those of latitude and longitude in degrees), bias
/// estimates, the horizontal standard deviations in metres, and those of the biases.
fn solution_csv(rows: &[Row]) -> String {
    let mut text = header(&[
        ("", &STATE),
        ("sd_", &STATE),
        ("", &BIAS_NAMES),
        ("sd_", &["n_m", "e_m"]),
        ("sd_", &BIAS_NAMES),
    ]);
    for row in rows {
        let (state, sd) = (values(&row.state), &row.sigma);
        let r = radii(row.state.lat.sin());
        let sd_lat = sd[0] / (r.meridian + row.state.h) / DEG;
        let sd_lon = sd[1] / ((r.transverse + row.state.h) * row.state.lat.cos()) / DEG;
        let digits = [10, 10, 5, 6, 6, 6, 7, 7, 7];
        let mut cells = vec![fixed(row.t_s, 6)];
        cells.extend(state.iter().zip(digits).map(|(x, d)| fixed(*x, d)));
        cells.extend([sd_lat, sd_lon].map(|x| format!("{x:.4e}")));
        cells.extend(sd[2..].iter().map(|x| fixed(*x, 6)));
        cells.extend(
            row.bias
                .iter()
                .flat_map(|b| b.to_array())
                .map(|x| fixed(x, 9)),
        );
        cells.extend(sd[..2].iter().map(|x| fixed(*x, 6)));
        cells.extend(
            row.bias_sigma
                .iter()
                .flat_map(|b| b.to_array())
                .map(|x| fixed(x, 9)),
        );
        text += &(cells.join(",") + "\n");
    }
    text
}

/// `innovations.csv`: every fix; 1 where it was used, and why not where it was not.
fn innovations_csv(solution: &Solution) -> String {
    let mut text = header(&[
        ("", &["used", "status"]),
        ("", &REPORTED_NAMES[..6]),
        ("sd_", &REPORTED_NAMES[..6]),
        ("", &["nis", "dof"]),
    ]);
    for fix in &solution.fixes {
        let status = if fix.used { "used" } else { "withheld" };
        let used = u8::from(fix.used).to_string();
        let mut cells = vec![fixed(fix.t_s, 6), used, status.to_owned()];
        for list in [&fix.innovation, &fix.sigma] {
            cells.extend((0..6).map(|i| list.get(i).map_or_else(String::new, |x| fixed(*x, 6))));
        }
        cells.extend([fixed(fix.nis, 4), fix.innovation.len().to_string()]);
        text += &(cells.join(",") + "\n");
    }
    text
}

fn errors_csv(rows: &[Row]) -> String {
    let mut text = header(&[("err_", &REPORTED_NAMES), ("", &["nees"])]);
    for (row, error) in rows.iter().filter_map(|row| Some((row, row.error?))) {
        let cells: Vec<String> = error.values.iter().map(|x| fixed(*x, 6)).collect();
        let _ = writeln!(
            text,
            "{},{},{}",
            fixed(row.t_s, 6),
            cells.join(","),
            fixed(error.nees, 4)
        );
    }
    text
}

/// The way as a line on the map, a point a second at most.
fn kml(rows: &[Row], name: &str, title: &str) -> String {
    let mut line = String::new();
    let mut last = f64::NEG_INFINITY;
    for (k, row) in rows.iter().enumerate() {
        if row.t_s - last >= 1.0 - 1e-6 || k + 1 == rows.len() {
            let (lon, lat, h) = (
                wrap_angle(row.state.lon) / DEG,
                row.state.lat / DEG,
                row.state.h,
            );
            let _ = write!(line, "{lon:.8},{lat:.8},{h:.2} ");
            last = row.t_s;
        }
    }
    let title = title.replace('&', "&amp;").replace('<', "&lt;");
    let points = line.trim_end();
    format!(
        r#"<?xml version="1.0" encoding="UTF-8"?>
<kml xmlns="http://www.opengis.net/kml/2.2">
<Document>
<name>{title}</name>
<Placemark>
<name>{name}</name>
<Style><LineStyle><color>ff0050ff</color><width>3</width></LineStyle></Style>
<LineString><tessellate>1</tessellate><altitudeMode>clampToGround</altitudeMode>
<coordinates>{points}</coordinates>
</LineString>
</Placemark>
</Document>
</kml>
"#
    )
}
