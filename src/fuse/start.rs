//! Choices of a start and of topics, as users write them.

use super::request::{MAX_SIGMA_DEG, number};
use serde::{Deserialize, Serialize};
use std::fmt::{self, Display, Formatter};
use std::path::PathBuf;
use std::str::FromStr;

/// Start of a fusion.
#[derive(Debug, Clone, PartialEq)]
pub enum StartChoice {
    /// Found in the data.
    Auto,
    /// Found in the data but for the heading.
    Heading {
        /// From north, clockwise (degrees).
        deg: f64,
        /// Standard deviation (degrees).
        sigma_deg: f64,
    },
    /// Stated in a file.
    File(PathBuf),
}

impl FromStr for StartChoice {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let numbers = text
            .split_once(':')
            .map(|(deg, sigma)| (number(deg), number(sigma)));
        match numbers {
            _ if text == "auto" => Ok(Self::Auto),
            Some((Ok(deg), Ok(sigma_deg)))
                if sigma_deg > 0.0 && sigma_deg <= MAX_SIGMA_DEG && deg.abs() <= 360.0 =>
            {
                Ok(Self::Heading { deg, sigma_deg })
            }
            Some((Ok(_), Ok(_))) => Err(format!(
                "expected a heading and its standard deviation of up to {MAX_SIGMA_DEG}°, such as 90:5"
            )),
            _ => Ok(Self::File(text.into())),
        }
    }
}

crate::parse::textual!(StartChoice);

impl Display for StartChoice {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        match self {
            Self::Auto => f.write_str("auto"),
            Self::Heading { deg, sigma_deg } => write!(f, "{deg}:{sigma_deg}"),
            Self::File(path) => write!(f, "{}", path.display()),
        }
    }
}

/// Topics of a log that has several.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct TopicChoice {
    /// Of the IMU; none: the only one.
    pub imu: Option<String>,
    /// Of the fixes; none: the only one.
    pub fixes: Option<String>,
}

impl FromStr for TopicChoice {
    type Err = std::convert::Infallible;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let (imu, fixes) = text.split_once(',').unwrap_or((text, ""));
        let named = |name: &str| (!name.is_empty()).then(|| name.to_owned());
        Ok(Self {
            imu: named(imu),
            fixes: named(fixes),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_start_is_a_file_a_heading_or_found() {
        let start = |text: &str| text.parse::<StartChoice>();
        assert_eq!(start("auto"), Ok(StartChoice::Auto));
        assert_eq!(
            start("-90:5"),
            Ok(StartChoice::Heading {
                deg: -90.0,
                sigma_deg: 5.0
            })
        );
        assert_eq!(
            start("a/initial.toml"),
            Ok(StartChoice::File("a/initial.toml".into()))
        );
        for bad in ["400:5", "90:0", "90:31"] {
            assert!(start(bad).is_err(), "{bad}");
        }
        for text in ["auto", "-90:5", "a:b.toml"] {
            assert_eq!(start(text).unwrap().to_string(), text);
        }
    }
}
