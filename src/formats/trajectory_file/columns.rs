//! What the columns of a trajectory table mean.

use super::table::{COLUMNS, Table};
use crate::formats::suggest::nearest;
use crate::formats::{FileError as Error, Kind};
use nav_sim_signal::units::DEG;

/// What a column holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Quantity {
    Time,
    Lat,
    Lon,
    H,
    N,
    E,
    D,
    Roll,
    Pitch,
    Yaw,
    Vn,
    Ve,
    Vd,
}

nav_sim_signal::named!(
    Quantity {
        Time = "t_s",
        Lat = "lat_deg",
        Lon = "lon_deg",
        H = "h_m",
        N = "n_m",
        E = "e_m",
        D = "d_m",
        Roll = "roll_deg",
        Pitch = "pitch_deg",
        Yaw = "yaw_deg",
        Vn = "v_n_m_s",
        Ve = "v_e_m_s",
        Vd = "v_d_m_s",
    }
);

use Quantity::{D, E, H, Lat, Lon, N, Pitch, Roll, Time, Vd, Ve, Vn, Yaw};

/// Names of a quantity without their unit. Angles end in `_deg` or `_rad` (nothing: degrees), times in
/// `_s`, `_ms`, `_us`, `_ns`, lengths in `_m`, velocities in `_m_s` or `_mps`.
const STEMS: [(&[&str], Quantity, f64); 15] = [
    (&["t", "time", "timestamp"], Time, 1.0),
    (&["lat", "latitude"], Lat, 1.0),
    (&["lon", "lng", "longitude"], Lon, 1.0),
    (&["h", "alt", "height", "altitude"], H, 1.0),
    (&["n", "north"], N, 1.0),
    (&["e", "east"], E, 1.0),
    (&["d", "down"], D, 1.0),
    (&["u", "up"], D, -1.0),
    (&["roll"], Roll, 1.0),
    (&["pitch"], Pitch, 1.0),
    (&["yaw", "heading", "azimuth"], Yaw, 1.0),
    (&["v_n", "vn", "v_north"], Vn, 1.0),
    (&["v_e", "ve", "v_east"], Ve, 1.0),
    (&["v_d", "vd", "v_down"], Vd, 1.0),
    (&["v_u", "v_up"], Vd, -1.0),
];

/// The quantity a name stands for and the factor to SI.
fn classify(name: &str) -> Option<(Quantity, f64)> {
    let name = name.to_lowercase().replace([' ', '-'], "_");
    let units: [(&str, f64, &[Quantity]); 10] = [
        ("_ms", 1e-3, &[Time]),
        ("_us", 1e-6, &[Time]),
        ("_ns", 1e-9, &[Time]),
        ("_m_s", 1.0, &[Vn, Ve, Vd]),
        ("_mps", 1.0, &[Vn, Ve, Vd]),
        ("_s", 1.0, &[Time]),
        ("_deg", DEG, &[Lat, Lon, Roll, Pitch, Yaw]),
        ("_rad", 1.0, &[Lat, Lon, Roll, Pitch, Yaw]),
        ("_m", 1.0, &[H, N, E, D]),
        ("", 1.0, &[Time, H]),
    ];
    let of_stem =
        |stem: &str| STEMS.iter().find(|(names, ..)| names.contains(&stem)).map(|&(_, q, sign)| (q, sign));
    for (suffix, factor, quantities) in units {
        let found = name.strip_suffix(suffix).and_then(of_stem);
        if let Some((q, sign)) = found.filter(|(q, _)| quantities.contains(q)) {
            return Some((q, sign * factor));
        }
    }
    // Angles without a unit are degrees.
    of_stem(&name).filter(|(q, _)| [Lat, Lon, Roll, Pitch, Yaw].contains(q)).map(|(q, sign)| (q, sign * DEG))
}

/// Where each quantity stands in a table.
#[derive(Debug)]
pub(super) struct Columns {
    found: Vec<(Quantity, usize, f64)>,
    /// Columns that mean nothing here.
    pub(super) ignored: Vec<String>,
}

impl Columns {
    pub(super) fn of(table: &Table) -> Result<Self, Error> {
        let mut columns = Self { found: Vec::new(), ignored: Vec::new() };
        for (index, name) in table.columns.iter().enumerate() {
            let Some((quantity, factor)) = classify(name) else {
                columns.ignored.push(name.clone());
                continue;
            };
            if let Some((_, earlier, _)) = columns.get(quantity) {
                return Err(table.given_twice([earlier, index], quantity.name()));
            }
            columns.found.push((quantity, index, factor));
        }
        columns.refuse_slips(table)?;
        columns.complete(table)?;
        Ok(columns)
    }

    fn get(&self, quantity: Quantity) -> Option<(Quantity, usize, f64)> {
        self.found.iter().copied().find(|(q, ..)| *q == quantity)
    }

    pub(super) fn has(&self, quantity: Quantity) -> bool {
        self.get(quantity).is_some()
    }

    /// Index of a column, for messages.
    pub(super) fn index(&self, quantity: Quantity) -> usize {
        self.get(quantity).map_or(0, |(_, index, _)| index)
    }

    /// Whether a column has the opposite sign of the quantity: a velocity up.
    pub(super) fn is_turned(&self, quantity: Quantity) -> bool {
        self.get(quantity).is_some_and(|(_, _, factor)| factor < 0.0)
    }

    /// The value of a quantity in a row, in SI; 0 where the table does not have it.
    pub(super) fn value(&self, quantity: Quantity, row: &[f64]) -> f64 {
        self.get(quantity).map_or(0.0, |(_, index, factor)| row[index] * factor)
    }

    /// A column that nearly has the name of one that is missing is a slip, not an extra.
    fn refuse_slips(&self, table: &Table) -> Result<(), Error> {
        let missing: Vec<_> =
            Quantity::ALL.into_iter().filter(|q| !self.has(*q)).map(Quantity::name).collect();
        for column in &self.ignored {
            if let Some(meant) = nearest(column, missing.iter().copied()) {
                let message = format!("unknown column \"{column}\"");
                return Err(Error::contents(table.path.as_str(), table.header_line, message)
                    .advice(format!("did you mean \"{meant}\"?")));
            }
        }
        Ok(())
    }

    fn complete(&self, table: &Table) -> Result<(), Error> {
        let local = [N, E, D].into_iter().any(|q| self.has(q)) && !self.has(Lat);
        let mut needed = vec![Time];
        needed.extend(if local { [N, E, D] } else { [Lat, Lon, H] });
        for optional in [[Roll, Pitch, Yaw], [Vn, Ve, Vd]] {
            if optional.into_iter().any(|q| self.has(q)) {
                needed.extend(optional);
            }
        }
        let missing: Vec<_> = needed.into_iter().filter(|q| !self.has(*q)).map(Quantity::name).collect();
        if missing.is_empty() {
            return Ok(());
        }
        let columns = match &missing[..] {
            [one] => format!("column {one} is missing"),
            many => format!("columns {} are missing", many.join(", ")),
        };
        Err(Error::new(table.path.as_str(), table.header_line, Kind::Columns(columns.into())).advice(COLUMNS))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_many_tools() {
        for (name, quantity, factor) in [
            ("t_s", Time, 1.0),
            ("time_s", Time, 1.0),
            ("timestamp_ns", Time, 1e-9),
            ("Latitude", Lat, DEG),
            ("lon_deg", Lon, DEG),
            ("lat_rad", Lat, 1.0),
            ("alt_m", H, 1.0),
            ("height_m", H, 1.0),
            ("heading_deg", Yaw, DEG),
            ("roll", Roll, DEG),
            ("pitch_rad", Pitch, 1.0),
            ("vn_mps", Vn, 1.0),
            ("v_d_m_s", Vd, 1.0),
            ("v_up_m_s", Vd, -1.0),
            ("up_m", D, -1.0),
            ("e_m", E, 1.0),
        ] {
            assert_eq!(classify(name), Some((quantity, factor)), "{name}");
        }
        for name in ["sd_roll_deg", "gnss", "e", "n", "roll_m", "lat_m", "t_deg", "v_n_deg"] {
            assert_eq!(classify(name), None, "{name}");
        }
        assert!(Quantity::ALL.into_iter().all(|q| classify(q.name()).is_some_and(|(found, _)| found == q)));
    }
}
