//! A track that ends where its last outage does.

use super::track::Track;

impl Track {
    /// Without what comes after the end of the last outage; the whole track where there is none.
    #[must_use]
    pub(crate) fn until_outage_end(mut self) -> Self {
        if let Some(last) = self.marks.iter().rposition(|mark| !mark.outages.is_empty()) {
            self.steps.truncate(self.marks[last].steps);
            self.marks.truncate(last + 1);
        }
        self
    }
}
