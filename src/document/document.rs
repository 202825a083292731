//! A result as a document, before it is rendered.

use crate::chart::Chart;
use crate::picture::svg;
use crate::table::Table;

/// Colour of a verdict.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Tone {
    /// Green: as it should be.
    Good,
    /// Grey: the figures at hand do not decide.
    Undecided,
    /// Amber: to be looked at.
    Doubtful,
    /// Red: not to be believed, or a limit not met.
    Bad,
}

/// Green where a result is good, else red.
impl From<bool> for Tone {
    fn from(is_good: bool) -> Self {
        if is_good { Self::Good } else { Self::Bad }
    }
}

/// The answer to the question that was asked.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Banner {
    /// Its colour.
    pub tone: Tone,
    /// One sentence each, of at most 120 characters, the answer first.
    pub lines: Vec<String>,
}

/// Rank of a note among others.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Importance {
    /// Changes what the reader should conclude.
    Warning,
    /// Worth knowing at once.
    Remark,
    /// For the page and `--verbose` alone.
    Detail,
}

/// A sentence beside the result.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Note {
    /// Its rank.
    pub importance: Importance,
    /// One sentence.
    pub text: String,
}

/// A part of a document.
#[derive(Debug, Clone, PartialEq)]
pub enum Block {
    /// The beginning of a section.
    Section(String),
    /// A heading within a section.
    Heading(String),
    /// A paragraph.
    Text(String),
    /// Names and what they are, line by line.
    Facts(Vec<(String, String)>),
    /// A table; the lead is the one that a terminal shows.
    Table {
        /// The table.
        table: Table,
        /// Whether a terminal shows it without being asked for more.
        is_lead: bool,
    },
    /// Charts, side by side where they are small, and what is to be seen in them.
    Charts(Vec<Chart>, String),
    /// Files beside the document: relative path and what is there.
    Links(Vec<(String, String)>),
    /// A text as it stands in a file.
    Code(String),
    /// What few want to see, under a title.
    Folded(String, Vec<Block>),
}

/// A result as a document: title, verdict, blocks in their order, notes in that of their importance.
#[derive(Debug, Clone, PartialEq)]
pub struct Document {
    /// Its title.
    pub title: String,
    /// The answer.
    pub verdict: Banner,
    /// What follows the verdict.
    pub blocks: Vec<Block>,
    notes: Vec<Note>,
}

impl Document {
    /// A document of a verdict alone.
    pub fn new<L: Into<String>>(
        title: &str,
        tone: Tone,
        lines: impl IntoIterator<Item = L>,
    ) -> Self {
        let verdict = Banner {
            tone,
            lines: lines.into_iter().map(Into::into).collect(),
        };
        Self {
            title: title.to_owned(),
            verdict,
            blocks: Vec::new(),
            notes: Vec::new(),
        }
    }

    /// Begins a section.
    pub fn section(&mut self, title: &str) {
        self.blocks.push(Block::Section(title.to_owned()));
    }

    /// Begins a part of a section.
    pub fn heading(&mut self, title: &str) {
        self.blocks.push(Block::Heading(title.to_owned()));
    }

    /// Adds a paragraph.
    pub fn text(&mut self, words: &str) {
        self.blocks.push(Block::Text(words.to_owned()));
    }

    /// Adds names and what they are.
    pub fn facts(&mut self, facts: &[(&str, String)]) {
        let owned = facts
            .iter()
            .map(|(name, value)| ((*name).to_owned(), value.clone()));
        self.blocks.push(Block::Facts(owned.collect()));
    }

    /// Adds the table that a terminal shows.
    pub fn lead(&mut self, table: Table) {
        self.blocks.push(Block::Table {
            table,
            is_lead: true,
        });
    }

    /// Adds a table.
    pub fn table(&mut self, table: &Table) {
        self.blocks.push(Block::Table {
            table: table.clone(),
            is_lead: false,
        });
    }

    /// Adds a chart and what is to be seen in it.
    pub fn chart(&mut self, chart: &Chart, caption: &str) {
        self.charts(std::slice::from_ref(chart), caption);
    }

    /// Adds charts, small ones side by side; one below the other on a phone.
    pub fn charts(&mut self, charts: &[Chart], caption: &str) {
        self.blocks
            .push(Block::Charts(charts.to_vec(), caption.to_owned()));
    }

    /// Adds links to files beside the page: relative path and what is there.
    pub fn links(&mut self, links: &[(String, String)]) {
        self.blocks.push(Block::Links(links.to_vec()));
    }

    /// Adds a text as it stands in a file.
    pub fn code(&mut self, text: &str) {
        self.blocks.push(Block::Code(text.to_owned()));
    }

    /// Adds what `inside` adds, folded under a title.
    pub fn folded(&mut self, title: &str, inside: impl FnOnce(&mut Self)) {
        let before = std::mem::take(&mut self.blocks);
        inside(self);
        let folded = std::mem::replace(&mut self.blocks, before);
        self.blocks.push(Block::Folded(title.to_owned(), folded));
    }

    /// Adds what the figures were checked against, and to which tolerance.
    pub fn checked(&mut self, words: &str) {
        self.text(&format!("Checked: {words}"));
    }

    /// Adds a note behind those of its importance, once.
    pub fn note(&mut self, importance: Importance, text: impl Into<String>) {
        let note = Note {
            importance,
            text: text.into(),
        };
        if !self.notes.contains(&note) {
            let place = self
                .notes
                .partition_point(|other| other.importance <= importance);
            self.notes.insert(place, note);
        }
    }

    /// All notes, the most important first.
    #[must_use]
    pub fn notes(&self) -> &[Note] {
        &self.notes
    }

    /// Its charts below one another as an SVG picture.
    #[must_use]
    pub fn svg(&self) -> String {
        let mut charts = Vec::new();
        collect(&self.blocks, &mut charts);
        svg(&self.title, &charts)
    }
}

/// The charts among blocks, in their order.
fn collect(blocks: &[Block], into: &mut Vec<Chart>) {
    for block in blocks {
        match block {
            Block::Charts(charts, _) => into.extend_from_slice(charts),
            Block::Folded(_, blocks) => collect(blocks, into),
            _ => {}
        }
    }
}
