//! What a job tells, in words.

use super::Note;
use crate::report::{reduction_doubt, reduction_line, unexpected_line};
use nav_sim_document::{Importance, Note as Said};

impl Note {
    /// The remark in words: what is doubtful is a warning, what is for those who ask for more a detail.
    #[must_use]
    pub fn said(&self) -> Vec<Said> {
        let one = |importance, text| vec![Said { importance, text }];
        match self {
            Self::Warning(text) => one(Importance::Warning, text.clone()),
            Self::Remark(text) => one(Importance::Remark, text.clone()),
            Self::Detail(text) => one(Importance::Detail, text.clone()),
            Self::LargeBias(sensor, sigma) => {
                let unit = sensor.unit();
                let text = format!(
                    "the filter starts with a bias of {sigma:.3} {unit} ({sensor}): an AR1 of phi near 1?"
                );
                one(Importance::Warning, text)
            }
            Self::Unexpected(found) => one(Importance::Warning, unexpected_line(found)),
            Self::Reduction(quality) => {
                let mut said = one(Importance::Remark, reduction_line(quality));
                said.extend(
                    reduction_doubt(quality)
                        .into_iter()
                        .flat_map(|text| one(Importance::Warning, text)),
                );
                said
            }
            Self::Heading(doubt) => one(Importance::Warning, doubt.to_string()),
            Self::Outage(remark) => one(Importance::Warning, remark.to_string()),
        }
    }
}
