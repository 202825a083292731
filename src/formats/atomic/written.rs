//! Kinds of files that nav-sim writes, known by what stands in them.

use crate::formats::source;
use std::io::Read;
use std::path::Path;

/// A kind of file that nav-sim writes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Written {
    Calibrated,
    Datasheet,
    Required,
    Tuned,
    Curves,
    Draws,
    Signals,
    Comparison,
    Export,
    Page,
    Svg,
    Png,
    Trajectory,
}

/// Most of a file that is looked at (bytes).
const HEAD: u64 = 1 << 20;

impl Written {
    const ALL: [Self; 13] = [
        Self::Calibrated,
        Self::Datasheet,
        Self::Required,
        Self::Tuned,
        Self::Curves,
        Self::Draws,
        Self::Signals,
        Self::Comparison,
        Self::Export,
        Self::Page,
        Self::Svg,
        Self::Png,
        Self::Trajectory,
    ];

    /// Texts that every file of the kind has.
    const fn marks(self) -> [&'static str; 2] {
        const MODEL: &str = "program = \"nav-sim ";
        const JSON: &str = "\"schema_version\"";
        match self {
            Self::Calibrated => [MODEL, "[[provenance.fits]]"],
            Self::Datasheet => [MODEL, "estimator = \"datasheet\""],
            Self::Required => [MODEL, "made_by = \"require\""],
            Self::Tuned => [MODEL, "made_by = \"tune\""],
            Self::Curves => [JSON, "\"curves\""],
            Self::Draws => [JSON, "\"draws\""],
            Self::Signals => [JSON, "\"edof_method\""],
            Self::Comparison => [JSON, "\"paired\""],
            Self::Export => ["(nav-sim export)", ""],
            Self::Page => ["<meta name=\"generator\" content=\"nav-sim\">", ""],
            Self::Svg => ["<svg", "class=\"chart wide\""],
            Self::Png => ["PNG", "Software\0nav-sim"],
            Self::Trajectory => [
                "t_s,lat_deg,lon_deg,h_m,v_n_m_s,v_e_m_s,v_d_m_s,roll_deg,pitch_deg,yaw_deg\n",
                "",
            ],
        }
    }

    /// What stands at a path where a file of this kind is to be written.
    pub(super) fn found(self, path: &Path) -> Found {
        let Some(text) = head(path) else {
            return if path.exists() {
                Found::Foreign
            } else {
                Found::Same
            };
        };
        let is_of = |kind: &Self| {
            kind.marks().iter().all(|mark| text.contains(mark)) && kind.is_as_written(&text)
        };
        match () {
            () if text.is_empty() || is_of(&self) => Found::Same,
            () if Self::ALL.iter().any(is_of) => Found::Other("holds another kind of result"),
            () => Found::Foreign,
        }
    }

    /// Other programs write tables with the same header, but not each number in its shortest form.
    fn is_as_written(self, text: &str) -> bool {
        let row = text.lines().nth(1).unwrap_or_default();
        let is_shortest = |cell: &str| cell.parse::<f64>().is_ok_and(|x| x.to_string() == cell);
        self != Self::Trajectory || row.split(',').all(is_shortest)
    }
}

fn head(path: &Path) -> Option<String> {
    let file = source::open(path).ok()?;
    let mut bytes = Vec::new();
    let is_packed = path
        .extension()
        .is_some_and(|e| e.eq_ignore_ascii_case("gz"));
    let read = match is_packed {
        true => flate2::read::GzDecoder::new(file)
            .take(HEAD)
            .read_to_end(&mut bytes),
        false => file.take(HEAD).read_to_end(&mut bytes),
    };
    read.is_ok()
        .then(|| String::from_utf8_lossy(&bytes).into_owned())
}

/// What stands where a result is to be written; in a directory told by its last file, which appears when the others are whole.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Found {
    /// Nothing that may be replaced.
    Foreign,
    /// Another result: how so.
    Other(&'static str),
    /// An earlier result of what is to be written, or nothing.
    Same,
}

impl Found {
    /// A result of this command, by whether all that decides it is the same.
    pub(crate) const fn result(is_same: bool) -> Self {
        match is_same {
            true => Self::Same,
            false => Self::Other(
                "holds the result of another configuration, other inputs or another seed",
            ),
        }
    }
}
