//! What can be wrong with a trajectory file.

use crate::formats::source;
use crate::formats::toml_file::TomlError;
use crate::trajectory;

/// What is wrong with a trajectory file: which file, which line, which column, which value.
#[derive(Debug, thiserror::Error)]
#[expect(missing_docs, reason = "fields are what the messages name: file, line, column, value")]
pub enum TrajectoryFileError {
    /// It cannot be read.
    #[error("{path}: {source}")]
    Io { path: String, source: std::io::Error },
    /// A motion profile that is not as it should be.
    #[error(transparent)]
    Profile(#[from] TomlError),
    /// Its ending is none that is known.
    #[error("{path}: a trajectory file ends in {known}")]
    Ending { path: String, known: &'static str },
    /// No rows.
    #[error("{path}: no rows in it")]
    Empty { path: String },
    /// No header.
    #[error("{path}, line {line}: a header that names the columns is missing, found \"{found}\"")]
    NoHeader { path: String, line: u64, found: String },
    /// A column that is nearly one that is missing.
    #[error("{path}, line {line}: unknown column \"{column}\"")]
    UnknownColumn { path: String, line: u64, column: String, meant: &'static str },
    /// Columns that are needed.
    #[error("{path}, line {line}: {columns} missing")]
    MissingColumns { path: String, line: u64, columns: String },
    /// Two columns for one quantity.
    #[error("{path}, line {line}: columns \"{first}\" and \"{second}\" both give {quantity}")]
    ColumnTwice { path: String, line: u64, first: String, second: String, quantity: &'static str },
    /// A cell that is refused.
    #[error("{path}, line {line}: column \"{column}\": {value} {reason}")]
    Cell { path: String, line: u64, column: String, value: String, reason: &'static str },
    /// A row with too few or too many cells.
    #[error("{path}, line {line}: {found} values, but {expected} columns")]
    RowLength { path: String, line: u64, found: usize, expected: usize },
    /// Local coordinates without a place on the Earth.
    #[error("{path}: {what} needs an origin on the Earth")]
    NoOrigin { path: String, what: &'static str },
    /// Rows that no trajectory goes through.
    #[error("{path}, line {line}: {source}")]
    Samples { path: String, line: u64, source: trajectory::Error },
    /// Not a height in metres.
    #[error("{path}, line {line}: height {h:?} m is not within −12 to 1000 km")]
    Height { path: String, line: u64, h: f64 },
    /// Rows too far apart in time.
    #[error("{path}, line {line}: the rows are {step_s} s apart")]
    SlowRows { path: String, line: u64, step_s: f64 },
    /// Longer than can be simulated.
    #[error(
        "{path}, line {line}: time goes from {previous_s} s to {t_s} s: the rows cover {duration_s} s, a day at most"
    )]
    TooLong { path: String, line: u64, duration_s: f64, previous_s: f64, t_s: f64 },
    /// Two rows too far apart.
    #[error("{path}, line {line}: position jumps by {metres:.0} m in {seconds} s")]
    Jump { path: String, line: u64, metres: f64, seconds: f64 },
    /// A reference that jumps throughout.
    #[error("{path}: no stretch of five seconds without a jump in position or attitude")]
    NoStretch { path: String },
    /// A text format that is not followed.
    #[error("{path}, line {line}: {message}")]
    Format { path: String, line: u64, message: String },
}

const COLUMNS: &str = "a trajectory has the columns t_s, lat_deg, lon_deg, h_m (or n_m, e_m, d_m with an origin), \
                       roll_deg, pitch_deg, yaw_deg, and may have v_n_m_s, v_e_m_s, v_d_m_s";

impl TrajectoryFileError {
    /// Whether the file's contents are at fault (rather than the machine, or a missing file).
    #[must_use]
    pub fn is_content(&self) -> bool {
        match self {
            Self::Io { source, .. } => source::is_damage(source.kind()),
            Self::Profile(e) => e.is_content(),
            _ => true,
        }
    }

    /// What to do about it.
    #[must_use]
    pub fn hint(&self) -> Option<String> {
        use trajectory::Error as E;
        let text = match self {
            Self::Profile(e) => return e.hint(),
            Self::UnknownColumn { meant, .. } => return Some(format!("did you mean \"{meant}\"?")),
            Self::NoHeader { .. } | Self::MissingColumns { .. } => COLUMNS,
            Self::ColumnTwice { .. } => "remove one of them",
            Self::Cell { column, .. } if column.contains("_deg") => {
                "angles are in degrees: latitude within ±89.9, longitude and yaw in (−180, 180] or [0, 360), pitch \
                 within ±90"
            }
            Self::RowLength { .. } => "every row needs one value a column; was the file cut off?",
            Self::NoOrigin { .. } => {
                "give --origin LAT_DEG,LON_DEG,H_M, or a first line \"# origin: LAT_DEG, LON_DEG, H_M\""
            }
            Self::Samples { source: E::Time { .. }, .. } => {
                "remove repeated rows, sort by time, or split the file where the clock was set back"
            }
            Self::Samples { source: E::Rotation { .. }, .. } => {
                "is an angle in the wrong column or unit? If the vehicle does turn this fast, give more rows a second"
            }
            Self::Samples { source: E::TooFew { .. }, .. } => "give at least four rows, one a second or more",
            Self::Samples { source: E::Latitude { .. }, .. } => {
                "latitude and longitude cannot navigate at the poles; is a column swapped?"
            }
            Self::Height { .. } => "is a value in the wrong column, or the row damaged?",
            Self::SlowRows { .. } => "give at least one row a second; is the time in milliseconds (t_ms)?",
            Self::TooLong { .. } => {
                "is that time stamp damaged, on another clock, or in another unit? Split what lasts longer than a day"
            }
            Self::Jump { .. } => "is a latitude swapped with a longitude, a sign lost, or a row damaged?",
            _ => return None,
        };
        Some(text.to_owned())
    }
}
