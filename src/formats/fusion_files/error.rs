//! What can be wrong with recorded data to be fused.

use crate::formats::recordings::RecordingError;
use crate::formats::toml_file::TomlError;
use crate::formats::trajectory_file::TrajectoryFileError;
use crate::imu::Channel;

/// What is wrong with a file, where, with which value.
#[derive(Debug, thiserror::Error)]
#[expect(missing_docs, reason = "fields are what the messages name: file, line, column, value")]
pub enum FusionFileError {
    /// A table that is none.
    #[error(transparent)]
    Table(Box<TrajectoryFileError>),
    /// An IMU file that cannot be read.
    #[error(transparent)]
    Imu(#[from] RecordingError),
    /// An initial state that cannot be read.
    #[error(transparent)]
    Initial(#[from] TomlError),
    /// Numbers that nobody names.
    #[error("{path}: {columns} columns without a header")]
    Bare { path: String, columns: usize, expected: &'static str },
    /// Channels that are needed.
    #[error("{path}: channel {channel} is missing; all six are needed")]
    Missing { path: String, channel: Channel },
    /// No clock.
    #[error("{path}: no time column")]
    NoTime { path: String },
    /// Columns that are needed.
    #[error("{path}, line {line}: {columns} missing")]
    MissingColumns { path: String, line: u64, columns: String },
    /// Time stands still or goes back.
    #[error("{path}, line {line}: time goes from {previous_s} s to {t_s} s: it must increase")]
    Time { path: String, line: u64, previous_s: f64, t_s: f64 },
    /// Too long without samples.
    #[error(
        "{path}, line {line}: no samples from {previous_s} s to {t_s} s: more than {longest_s} s cannot be bridged"
    )]
    Gap { path: String, line: u64, previous_s: f64, t_s: f64, longest_s: f64 },
    /// A value that is none.
    #[error("{path}, line {line}: column \"{column}\": {value} {reason}")]
    Value { path: String, line: u64, column: String, value: f64, reason: &'static str },
    /// Two fixes too far apart.
    #[error("{path}, line {line}: the fix is {metres:.0} m from the one {seconds} s before")]
    Jump { path: String, line: u64, metres: f64, seconds: f64 },
    /// Too fast a rotation.
    #[error(
        "{path}, line {line}: a rotation of {angle_deg:.1}° in one sample, at most {max_deg:.1}° can be followed"
    )]
    Rotation { path: String, line: u64, angle_deg: f64, max_deg: f64 },
    /// Not enough of it.
    #[error("{path}: {found} samples, but at least {needed} are needed")]
    TooFew { path: String, found: usize, needed: usize },
}

impl From<TrajectoryFileError> for FusionFileError {
    fn from(e: TrajectoryFileError) -> Self {
        Self::Table(Box::new(e))
    }
}

impl FusionFileError {
    /// Whether the system, not the contents, is at fault.
    #[must_use]
    pub fn is_io(&self) -> bool {
        match self {
            Self::Table(e) => !e.is_content(),
            Self::Imu(e) => e.is_io(),
            Self::Initial(e) => !e.is_content(),
            _ => false,
        }
    }

    /// What to do about it.
    #[must_use]
    pub fn hint(&self) -> Option<String> {
        use TrajectoryFileError as T;
        const GNSS: &str = "a GNSS file has the columns t_s, lat_deg, lon_deg, h_m, sd_n_m, sd_e_m, sd_d_m and may \
                            have v_n_m_s, v_e_m_s, v_d_m_s, sd_vn_m_s, sd_ve_m_s, sd_vd_m_s; or it is a KF-GINS text \
                            of 7 columns, or of 13 with velocity";
        let text = match self {
            Self::Table(e) => match **e {
                T::NoHeader { .. } | T::MissingColumns { .. } | T::Empty { .. } => GNSS,
                T::RowLength { .. } => "every row needs one value a column; was the file cut off?",
                T::Cell { .. } => "remove the row: a fix that is not whole is no fix",
                _ => return e.hint(),
            },
            Self::Imu(e) => return e.hint(),
            Self::Initial(e) => return e.hint(),
            Self::Bare { expected, .. } => expected,
            Self::Missing { .. } | Self::NoTime { .. } => {
                "name the columns t_s, gyro_x_rad_s … accel_z_m_s2 (rates) or t_s, dtheta_x_rad … dv_z_m_s \
                 (increments, time = end of the interval), or give a KF-GINS text of 7 or 8 columns"
            }
            Self::MissingColumns { .. } => GNSS,
            Self::Time { previous_s, t_s, .. } if previous_s - t_s > 500_000.0 => {
                "a new GPS week? Count the seconds on, in both files"
            }
            Self::Time { .. } => "sort the rows by time and remove repeated ones",
            Self::Gap { .. } => "fuse the stretches before and after it one by one",
            Self::Value { column, .. } if column.starts_with("lat") || column.starts_with("lon") => {
                "latitude within ±89.9, longitude in (−180, 180] or [0, 360), in degrees (or name the columns lat_rad, \
                 lon_rad)"
            }
            Self::Value { .. } => {
                "a fix needs the standard deviations its receiver believes; remove rows without"
            }
            Self::Jump { .. } => "is a latitude swapped with a longitude, a sign lost, or a row damaged?",
            Self::Rotation { .. } => {
                "is the unit right? gyro_x_deg_s is in degrees, gyro_x_rad_s in radians a second"
            }
            Self::TooFew { .. } => return None,
        };
        Some(text.to_owned())
    }
}
