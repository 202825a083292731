//! Specification of a model, the kinds of its processes: "2*AR1+RW+WN+QN".

use super::limits::{LimitError, Limits};
use crate::noise::{Kind, ParameterRef, labels};
use crate::wavelet::Curve;
use std::fmt;
use std::str::FromStr;

/// Largest number of processes of a kind in one model.
const fn most(kind: Kind) -> usize {
    match kind {
        Kind::Ar1 | Kind::GaussMarkov => MOST_SHAPES,
        _ => 1,
    }
}

/// Processes with a shape parameter that one model may have: the search is over all their combinations.
const MOST_SHAPES: usize = 5;

/// The kinds of process of a model, in the order of [`Kind::ALL`], and where their parameters may be.
#[derive(Debug, Clone, PartialEq)]
pub struct ModelSpec {
    kinds: Vec<Kind>,
    limits: Vec<Limits>,
}

/// Why a specification means no model.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum SpecError {
    /// A term that is neither a process nor a named model.
    #[error("model \"{spec}\": \"{term}\" is no process")]
    Unknown {
        /// The specification.
        spec: String,
        /// The term.
        term: String,
    },
    /// Nothing between two plus signs, or nothing at all.
    #[error("model \"{0}\": a process is missing")]
    Empty(String),
    /// "0*AR1", "x*AR1".
    #[error("model \"{spec}\": \"{count}\" is not a number of processes")]
    Count {
        /// The specification.
        spec: String,
        /// Text before the asterisk.
        count: String,
    },
    /// Several of a kind that adds up to one of itself.
    #[error(
        "model \"{spec}\": {count} {code} are one {code}: their wavelet variances are proportional"
    )]
    Repeated {
        /// The specification.
        spec: String,
        /// Code of the kind.
        code: &'static str,
        /// Number given.
        count: usize,
    },
    /// More AR1, GM and MA1 than can be searched.
    #[error(
        "model \"{spec}\": {count} AR1, GM and MA1 processes; at most {MOST_SHAPES} can be told apart"
    )]
    TooMany {
        /// The specification.
        spec: String,
        /// How many.
        count: usize,
    },
}

impl ModelSpec {
    /// Name of the usual model.
    pub const USUAL: &str = "N2";

    /// N1 = WN + AR1 + RW of the paper.
    #[must_use]
    pub fn n1() -> Self {
        Self::of([Kind::White, Kind::Ar1, Kind::RandomWalk])
    }

    /// N2 = WN + QN + 2 AR1 + RW of the paper: the usual model.
    #[must_use]
    pub fn n2() -> Self {
        Self::of([
            Kind::White,
            Kind::Quantization,
            Kind::Ar1,
            Kind::Ar1,
            Kind::RandomWalk,
        ])
    }

    /// A sum of processes that can be told apart.
    pub(crate) fn of(kinds: impl IntoIterator<Item = Kind>) -> Self {
        let mut kinds: Vec<Kind> = kinds.into_iter().collect();
        kinds.sort_unstable();
        let limits = vec![Limits::NONE; kinds.len()];
        Self { kinds, limits }
    }

    /// Labels of the processes, as those of a fitted model: `WN`, `AR1_1`, `AR1_2`, …
    #[must_use]
    pub fn labels(&self) -> Vec<String> {
        labels(&self.kinds)
    }

    /// Names of the parameters of the process of that label; none of one that is not there.
    #[must_use]
    pub fn parameter_names(&self, label: &str) -> Vec<&'static str> {
        let kind = self
            .labels()
            .iter()
            .position(|l| l == label)
            .map(|i| self.kinds[i]);
        kind.map_or(Vec::new(), names)
    }

    /// Restricts a parameter of the process of that label (`WN`, `AR1`, or `AR1_2` of several) to `low` … `high`;
    /// without one of them it is not restricted on that side.
    ///
    /// Processes of a kind of which one has limits keep the order of their labels; others are
    /// ordered by correlation time.
    ///
    /// # Errors
    /// When there is no such process or parameter, or no value is allowed.
    pub fn limit(
        &mut self,
        process: &str,
        parameter: &str,
        low: Option<f64>,
        high: Option<f64>,
    ) -> Result<(), LimitError> {
        let ParameterRef {
            process: index,
            parameter: named,
        } = self.parameter(process, parameter)?;
        let kind = self.kinds[index];
        for value in [low, high].into_iter().flatten() {
            let domain = BoundDomain::of(kind, named.is_shape());
            if !domain.contains(value) {
                let (process, parameter, domain) =
                    (process.to_owned(), parameter.to_owned(), domain.words);
                return Err(LimitError::Domain {
                    process,
                    parameter,
                    value,
                    domain,
                });
            }
        }
        let (from, to) = (
            low.unwrap_or(f64::NEG_INFINITY),
            high.unwrap_or(f64::INFINITY),
        );
        if from > to {
            let (process, parameter) = (process.to_owned(), parameter.to_owned());
            return Err(LimitError::Empty {
                process,
                parameter,
                low: from,
                high: to,
            });
        }
        let limits = &mut self.limits[index];
        if named.is_shape() {
            limits.shape = Some((from, to));
        } else {
            // Amplitudes are not negative: variances, and the slope of a drift, whose sign a wavelet variance
            // does not show.
            limits.amplitude = (from.max(0.0), to);
        }
        Ok(())
    }

    /// The parameter of that name of the process of that label.
    ///
    /// # Errors
    /// When there is no such process or parameter.
    pub(crate) fn parameter(
        &self,
        process: &str,
        parameter: &str,
    ) -> Result<ParameterRef, LimitError> {
        let labels = self.labels();
        let Some(index) = labels.iter().position(|l| l == process) else {
            let (spec, process) = (self.to_string(), process.to_owned());
            return Err(LimitError::Process {
                spec,
                process,
                legal: labels,
            });
        };
        let kind = self.kinds[index];
        match kind.parameters().iter().find(|p| p.name() == parameter) {
            Some(named) => Ok(ParameterRef {
                process: index,
                parameter: *named,
            }),
            None => {
                let (process, parameter) = (process.to_owned(), parameter.to_owned());
                Err(LimitError::Parameter {
                    process,
                    parameter,
                    legal: names(kind),
                })
            }
        }
    }

    /// Range of a parameter by the limits given.
    pub(crate) fn range(&self, of: ParameterRef) -> (f64, f64) {
        let limits = self.limits[of.process];
        if of.parameter.is_shape() {
            limits.shape.unwrap_or((f64::NEG_INFINITY, f64::INFINITY))
        } else {
            limits.amplitude
        }
    }

    /// Whether a parameter has one value only.
    pub(crate) fn is_fixed(&self, of: ParameterRef) -> bool {
        let (low, high) = self.range(of);
        low >= high
    }

    pub(crate) fn limits(&self) -> &[Limits] {
        &self.limits
    }

    /// Whether another model, with some amplitudes zero and some AR1 at the ends of their range, is this one: an AR1
    /// is white noise at phi = 0 and a random walk at phi = 1.
    pub(crate) fn is_special_case_of(&self, other: &Self) -> bool {
        let count = |spec: &Self, kind: Kind| spec.kinds.iter().filter(|k| **k == kind).count();
        let more = |kind: Kind| count(self, kind).saturating_sub(count(other, kind));
        // A white noise or random walk that the other model lacks must be one of its AR1 at the end of its
        // range, and that AR1 is then free for nothing else.
        let (white, walk) = (more(Kind::White), more(Kind::RandomWalk));
        let others: usize = Kind::ALL.into_iter().map(more).sum::<usize>() - white - walk;
        others == 0 && count(self, Kind::Ar1) + white + walk <= count(other, Kind::Ar1)
    }

    /// The model without the process at an index.
    pub(crate) fn without(&self, index: usize) -> Self {
        let mut less = self.clone();
        less.kinds.remove(index);
        less.limits.remove(index);
        less
    }

    /// The kinds of process.
    #[must_use]
    pub fn kinds(&self) -> &[Kind] {
        &self.kinds
    }

    /// Number of parameters that are not fixed.
    #[must_use]
    pub fn parameters(&self) -> usize {
        // Equal bounds leave nothing to estimate: such a parameter costs no degree of freedom.
        let fixed = |(low, high): (f64, f64)| usize::from(low >= high);
        let free = |(kind, limits): (&Kind, &Limits)| {
            kind.parameters().len() - fixed(limits.amplitude) - limits.shape.map_or(0, fixed)
        };
        self.kinds.iter().zip(&self.limits).map(free).sum()
    }

    /// Words that may stand between plus signs.
    pub fn legal() -> impl Iterator<Item = &'static str> {
        Kind::ALL.iter().map(|k| k.code()).chain(["N1", "N2"])
    }
}

impl FromStr for ModelSpec {
    type Err = SpecError;

    fn from_str(spec: &str) -> Result<Self, SpecError> {
        let mut kinds = Vec::new();
        for term in spec.split('+').map(str::trim) {
            let (count, name) = match term.split_once('*') {
                None => (1, term),
                Some((count, name)) => (parse_count(spec, count.trim())?, name.trim()),
            };
            for _ in 0..count {
                kinds.extend(named(spec, name)?);
            }
        }
        kinds.sort_unstable();
        check(spec, &kinds)?;
        Ok(Self::of(kinds))
    }
}

fn names(kind: Kind) -> Vec<&'static str> {
    kind.parameters().iter().map(|p| p.name()).collect()
}

/// Where bounds of a parameter may be.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BoundDomain {
    /// From.
    pub low: f64,
    /// To.
    pub high: f64,
    /// Whether these two are left out.
    pub is_open: bool,
    /// The same in words.
    pub words: &'static str,
}

impl BoundDomain {
    /// That of the shape of a process (phi, beta or theta), or of another parameter.
    #[must_use]
    pub fn of(kind: Kind, is_shape: bool) -> Self {
        let closed = |low: f64, high: f64, words| Self {
            low,
            high,
            is_open: false,
            words,
        };
        match kind {
            _ if !is_shape => closed(0.0, Curve::WV_RANGE.1, "a number from 0 to 1e100"),
            // The search is over positive correlations.
            Kind::Ar1 => Self {
                low: 0.0,
                high: 1.0,
                is_open: true,
                words: "between 0 and 1",
            },
            Kind::GaussMarkov => closed(1e-100, 1e100, "a number from 1e-100 to 1e100 (1/s)"),
            _ => closed(-1.0, 1.0, "between -1 and 1"),
        }
    }

    fn contains(&self, value: f64) -> bool {
        let is_end = value == self.low || value == self.high;
        (self.low..=self.high).contains(&value) && !(self.is_open && is_end)
    }
}

fn parse_count(spec: &str, count: &str) -> Result<usize, SpecError> {
    match count.parse() {
        Ok(n) if (1..=99).contains(&n) => Ok(n),
        _ => Err(SpecError::Count {
            spec: spec.into(),
            count: count.into(),
        }),
    }
}

fn named(spec: &str, name: &str) -> Result<Vec<Kind>, SpecError> {
    let upper = name.to_ascii_uppercase();
    match upper.as_str() {
        "" => Err(SpecError::Empty(spec.into())),
        "N1" => Ok(ModelSpec::n1().kinds),
        "N2" => Ok(ModelSpec::n2().kinds),
        code => match Kind::named(code) {
            Some(kind) => Ok(vec![kind]),
            None => Err(SpecError::Unknown {
                spec: spec.into(),
                term: name.into(),
            }),
        },
    }
}

fn check(spec: &str, kinds: &[Kind]) -> Result<(), SpecError> {
    for kind in Kind::ALL {
        let count = kinds.iter().filter(|k| **k == kind).count();
        if count > 1 && most(kind) == 1 {
            return Err(SpecError::Repeated {
                spec: spec.into(),
                code: kind.code(),
                count,
            });
        }
    }
    let count = kinds.iter().filter(|k| k.shape().is_some()).count();
    if count > MOST_SHAPES {
        return Err(SpecError::TooMany {
            spec: spec.into(),
            count,
        });
    }
    Ok(())
}

impl fmt::Display for ModelSpec {
    /// "WN+QN+2*AR1+RW"
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut separator = "";
        for kind in Kind::ALL {
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
mod tests;
