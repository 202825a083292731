//! Specification of a model, the kinds of its processes: "2*AR1+RW+WN+QN".

use crate::noise::{ProcessKind, labels};
use std::fmt;
use std::str::FromStr;

/// Processes with a shape parameter that one model may have: the search is over all their combinations.
const MOST_SHAPES: usize = 5;

/// The kinds of process of a model, in the order of [`ProcessKind::ALL`].
#[derive(Debug, Clone, PartialEq)]
pub struct ModelSpec {
    kinds: Vec<ProcessKind>,
}

/// Reason that a specification is refused.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("model {message}")]
pub struct SpecError {
    message: String,
    /// A term that is neither a process nor a named model, if that is why.
    pub term: Option<String>,
}

impl ModelSpec {
    /// Name of the usual model.
    pub const USUAL: &str = "N2";

    /// N1 = WN + AR1 + RW of the paper.
    pub fn n1() -> Self {
        Self::of([
            ProcessKind::White,
            ProcessKind::Ar1,
            ProcessKind::RandomWalk,
        ])
    }

    /// N2 = WN + QN + 2 AR1 + RW of the paper: the usual model.
    pub fn n2() -> Self {
        Self::of([
            ProcessKind::White,
            ProcessKind::Quantization,
            ProcessKind::Ar1,
            ProcessKind::Ar1,
            ProcessKind::RandomWalk,
        ])
    }

    /// A sum of processes that can be distinguished.
    pub(crate) fn of(kinds: impl IntoIterator<Item = ProcessKind>) -> Self {
        let mut kinds: Vec<ProcessKind> = kinds.into_iter().collect();
        kinds.sort_unstable();
        Self { kinds }
    }

    /// Labels of the processes, as those of a fitted model: `WN`, `AR1_1`, `AR1_2`, …
    pub fn labels(&self) -> Vec<String> {
        labels(&self.kinds)
    }

    /// Returns true if another model equals this one with some amplitudes zero and some AR1 at the
    /// ends of their range: an AR1 is white noise at phi = 0 and a random walk at phi = 1.
    pub(crate) fn is_special_case_of(&self, other: &Self) -> bool {
        let count =
            |spec: &Self, kind: ProcessKind| spec.kinds.iter().filter(|k| **k == kind).count();
        let more = |kind: ProcessKind| count(self, kind).saturating_sub(count(other, kind));
        // A white noise or random walk that the other model lacks must be one of its AR1 at the end of its
        // range, and that AR1 is then free for nothing else.
        let (white, walk) = (more(ProcessKind::White), more(ProcessKind::RandomWalk));
        let others: usize = ProcessKind::ALL.into_iter().map(more).sum::<usize>() - white - walk;
        others == 0
            && count(self, ProcessKind::Ar1) + white + walk <= count(other, ProcessKind::Ar1)
    }

    /// The model without the process at an index.
    pub(crate) fn without(&self, index: usize) -> Self {
        let mut less = self.clone();
        less.kinds.remove(index);
        less
    }

    /// The kinds of process.
    pub fn kinds(&self) -> &[ProcessKind] {
        &self.kinds
    }

    /// Number of parameters.
    pub fn parameters(&self) -> usize {
        self.kinds.iter().map(|kind| kind.parameters().len()).sum()
    }

    /// Words that may stand between plus signs.
    pub fn legal() -> impl Iterator<Item = &'static str> {
        ProcessKind::ALL
            .iter()
            .map(|k| k.code())
            .chain(["N1", "N2"])
    }
}

impl FromStr for ModelSpec {
    type Err = SpecError;

    fn from_str(spec: &str) -> Result<Self, SpecError> {
        let refused = |why: String| SpecError {
            message: format!("\"{spec}\": {why}"),
            term: None,
        };
        let mut kinds = Vec::new();
        for term in spec.split('+').map(str::trim) {
            let (count, name) = match term.split_once('*') {
                None => ("1", term),
                Some((count, name)) => (count.trim(), name.trim()),
            };
            let counted = count.parse().ok().filter(|n| (1..=99).contains(n));
            let counted: usize = counted
                .ok_or_else(|| refused(format!("\"{count}\" is not a number of processes")))?;
            let own = match name.to_ascii_uppercase().as_str() {
                "" => return Err(refused("a process is missing".to_owned())),
                "N1" => Self::n1().kinds,
                "N2" => Self::n2().kinds,
                code => vec![ProcessKind::named(code).ok_or_else(|| SpecError {
                    term: Some(name.to_owned()),
                    ..refused(format!("\"{name}\" is no process"))
                })?],
            };
            kinds.extend(std::iter::repeat_n(own, counted).flatten());
        }
        for kind in ProcessKind::ALL {
            let count = kinds.iter().filter(|k| **k == kind).count();
            if count > 1 && !matches!(kind, ProcessKind::Ar1 | ProcessKind::GaussMarkov) {
                let code = kind.code();
                return Err(refused(format!(
                    "{count} {code} equal one {code}: their wavelet variances are proportional"
                )));
            }
        }
        match kinds.iter().filter(|k| k.shape().is_some()).count() {
            count if count > MOST_SHAPES => Err(refused(format!(
                "{count} AR1, GM and MA1 processes: at most {MOST_SHAPES}"
            ))),
            _ => Ok(Self::of(kinds)),
        }
    }
}

impl fmt::Display for ModelSpec {
    /// "WN+QN+2*AR1+RW"
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut separator = "";
        for kind in ProcessKind::ALL {
            let count = self.kinds.iter().filter(|k| **k == kind).count();
            match count {
                0 => continue,
                1 => write!(f, "{separator}{}", kind.code())?,
                n => write!(f, "{separator}{n}*{}", kind.code())?,
            }
            separator = "+";
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sums_are_read_in_any_order() {
        for text in ["2*AR1+RW+WN+QN", " qn + AR1+ rw+wn +ar1", "N2", "n2"] {
            assert_eq!(
                text.parse::<ModelSpec>().unwrap(),
                ModelSpec::n2(),
                "{text}"
            );
        }
        assert_eq!("AR1+RW+WN".parse::<ModelSpec>().unwrap(), ModelSpec::n1());
        let spec: ModelSpec = "MA1+N1+DR+3*GM".parse().unwrap();
        assert_eq!(spec.to_string(), "WN+AR1+3*GM+MA1+RW+DR");
        assert_eq!(spec.to_string().parse::<ModelSpec>().unwrap(), spec);
        assert_eq!((spec.parameters(), ModelSpec::n2().parameters()), (13, 7));
    }

    #[test]
    fn special_cases() {
        let special = |a: &str, b: &str| {
            a.parse::<ModelSpec>()
                .unwrap()
                .is_special_case_of(&b.parse::<ModelSpec>().unwrap())
        };
        for (a, b) in [
            ("WN", "N1"),
            ("N1", "N1"),
            ("WN", "AR1"),
            ("RW", "AR1"),
            ("WN+RW", "2*AR1"),
            ("WN+AR1", "2*AR1"),
        ] {
            assert!(special(a, b), "{a} of {b}");
        }
        for (a, b) in [
            ("WN+RW", "AR1"),
            ("N1", "2*AR1"),
            ("QN", "AR1"),
            ("AR1", "WN+RW"),
            ("DR", "N2"),
        ] {
            assert!(!special(a, b), "{a} of {b}");
        }
    }

    #[test]
    fn what_means_no_model_is_refused() {
        let message = |text: &str| text.parse::<ModelSpec>().unwrap_err().to_string();
        for (text, expected) in [
            ("AR1+WM", "model \"AR1+WM\": \"WM\" is no process"),
            ("", "model \"\": a process is missing"),
            ("WN++RW", "model \"WN++RW\": a process is missing"),
            (
                "0*AR1",
                "model \"0*AR1\": \"0\" is not a number of processes",
            ),
            (
                "-1*AR1",
                "model \"-1*AR1\": \"-1\" is not a number of processes",
            ),
            (
                "2*WN",
                "2 WN equal one WN: their wavelet variances are proportional",
            ),
            ("4*AR1+2*GM", "6 AR1, GM and MA1 processes: at most 5"),
            ("99*N2", "99 WN"),
        ] {
            assert!(message(text).contains(expected), "{}", message(text));
        }
    }
}
