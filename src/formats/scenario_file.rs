//! Scenario files (TOML): see [`Scenario`].

use super::FileError;
use super::toml_described::Document;
use super::toml_file::Source;
use crate::scenario::Scenario;
use crate::units::SettingError;
use std::path::Path;

/// Reads and checks a scenario.
///
/// # Errors
/// File, line, key and value of what is refused; a mistyped key with the nearest legal one.
pub(crate) fn read(path: &Path) -> Result<Scenario, FileError> {
    read_for(path, |_| Ok(()))
}

/// Reads and checks a scenario, also by a rule of the study it is for.
///
/// # Errors
/// As [`read`].
pub(crate) fn read_for(
    path: &Path,
    rule: impl FnOnce(&Scenario) -> Result<(), SettingError>,
) -> Result<Scenario, FileError> {
    from_source(&Source::read(path)?, rule)
}

fn from_source(
    source: &Source,
    rule: impl FnOnce(&Scenario) -> Result<(), SettingError>,
) -> Result<Scenario, FileError> {
    let document = Document::parse(source)?;
    let scenario: Scenario = document.read()?;
    scenario.validate().and_then(|()| rule(&scenario)).map_err(|e| document.refused(&e))?;
    Ok(scenario)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn refused(text: &str) -> (String, Option<String>) {
        let error = from_source(&Source::new("s.toml", text), |_| Ok(())).unwrap_err();
        (error.to_string(), error.hint())
    }

    #[test]
    fn typos_are_answered_with_the_nearest_key() {
        let (message, hint) = refused("[run]\nruns = 3\n[gnss]\nrate_hz = 1\npos_sgima_m = [1, 1, 1]\n");
        assert_eq!(message, "s.toml, line 5: unknown key \"gnss.pos_sgima_m\"");
        assert_eq!(hint.unwrap(), "did you mean \"pos_sigma_m\"?");
        let (message, hint) = refused("[gps]\nrate_hz = 1\n");
        assert_eq!(message, "s.toml, line 1: unknown key \"gps\"");
        assert!(hint.unwrap().contains("gnss"));
    }

    #[test]
    fn wrong_types_are_refused_by_line_key_and_value() {
        let (message, _) = refused("[run]\nruns = 3\n[imu]\nrate_hz = \"fast\"\n");
        assert_eq!(message, "s.toml, line 4: \"imu.rate_hz\" = \"fast\" is not a number");
        let (message, _) = refused("[gnss]\npos_sigma_m = [1, 2]\n");
        assert_eq!(message, "s.toml, line 2: \"gnss.pos_sigma_m\" = [1, 2] is not an array of length 3");
        let (message, _) = refused("[filter]\nstates = 16\n");
        assert!(message.ends_with("= 16 is refused: expected \"15\", \"21\" or \"full\""), "{message}");
        let (message, _) = refused("[run]\nmethod = \"lincav\"\n");
        assert!(
            message.contains("\"run.method\" = \"lincav\"")
                && message.contains("is not one of \"monte-carlo\""),
            "{message}"
        );
    }

    #[test]
    fn values_out_of_range_are_refused_by_line_key_and_value() {
        let (message, _) = refused("[run]\nruns = 0\n");
        assert_eq!(message, "s.toml, line 2: \"run.runs\" = 0 is refused: at least one run");
        let (message, _) =
            refused("[[outage]]\nstart_s = 1\nend_s = 2\n[[outage]]\nstart_s = 5\nend_s = 5\n");
        assert_eq!(
            message,
            "s.toml, line 6: \"outage[2].end_s\" = 5 is refused: it must come after start_s = 5"
        );
        let (message, hint) = refused("[imu]\nrate_hz = 7.5\n");
        assert!(message.starts_with("s.toml, line 1: \"gnss.rate_hz\" = 1 is refused"), "{message}");
        assert!(hint.unwrap().contains("default"));
    }

    #[test]
    fn states_may_be_a_number() {
        assert!(from_source(&Source::new("s.toml", "filter.states = 15"), |_| Ok(())).is_ok());
    }
}
