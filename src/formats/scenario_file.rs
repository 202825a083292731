//! Scenario files (TOML): see [`Scenario`].

use super::error::{FileError, Kind};
use super::toml_described;
use super::toml_file::{Section, Source};
use crate::scenario::Scenario;
use crate::units::SettingError;
use std::path::Path;

/// Reads and checks a scenario.
///
/// # Errors
/// File, line, key and value of what is refused; a mistyped key with the nearest legal one.
pub fn read(path: &Path) -> Result<Scenario, FileError> {
    from_source(&Source::read(path)?)
}

fn from_source(source: &Source) -> Result<Scenario, FileError> {
    let scenario: Scenario = toml_described::read(source)?;
    let table = source.parse()?;
    scenario.validate().map_err(|e| located(&e, source, &source.root(&table)))?;
    Ok(scenario)
}

/// A refusal by [`Scenario::validate`] at the line its key stands in.
pub(super) fn located(error: &SettingError, source: &Source, root: &Section<'_>) -> FileError {
    let (section, key) = error.key.rsplit_once('.').unwrap_or(("", &error.key));
    let reason = format!("is refused: {}", error.requirement);
    let (name, index) = match section.trim_end_matches(']').split_once('[') {
        Some((name, index)) => (name, index.parse::<usize>().ok()),
        None => (section, None),
    };
    let found = match index {
        Some(i) => root.sections(name).ok().and_then(|all| all.into_iter().nth(i - 1)),
        None => root.section(name).ok().flatten(),
    };
    match found {
        Some(section) if section.has(key) => section.refuse(key, reason, None),
        _ => {
            let (key, value) = (error.key.as_str().into(), error.value.as_str().into());
            let kind = Kind::Value { key, value, reason: reason.into() };
            source.error(1, kind).advice("the file does not set it: this is the default")
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn refused(text: &str) -> (String, Option<String>) {
        let error = from_source(&Source::new("s.toml", text)).unwrap_err();
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
        assert!(from_source(&Source::new("s.toml", "filter.states = 15")).is_ok());
    }
}
