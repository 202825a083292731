//! A result as a document, before it is rendered.

use crate::chart::{Chart, Size};
use crate::draw::{Canvas, NARROW, SMALL, WIDE, draw, escape, one_line};
use crate::picture::{CHART_STYLE, COLOURS, svg};
use crate::table::{Cell, Table};
use std::fmt::Write as _;

/// Colour of a verdict.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Tone {
    /// Green: as it should be.
    Good,
    /// Grey: the figures at hand do not decide.
    Undecided,
    /// Amber: to be examined.
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
    /// A paragraph.
    Text(String),
    /// A table; a terminal shows the first one.
    Table(Table),
    /// Charts, side by side where they are small, and what is to be seen in them.
    Charts(Vec<Chart>, String),
    /// Files beside the document: relative path and what is there.
    Links(Vec<(String, String)>),
    /// Details folded away under a title.
    Folded(String, Vec<Block>),
}

/// A result as a document: title, verdict, blocks in their order, notes in that of their importance.
#[derive(Debug, Clone, PartialEq)]
pub struct Document {
    /// Its title.
    pub title: String,
    /// Colour of the answer.
    pub tone: Tone,
    /// The answer: one sentence each, of at most 120 characters, the most important first.
    pub verdict: Vec<String>,
    /// Blocks after the verdict.
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
        Self {
            title: title.to_owned(),
            tone,
            verdict: lines.into_iter().map(Into::into).collect(),
            blocks: Vec::new(),
            notes: Vec::new(),
        }
    }

    /// Begins a section.
    pub fn section(&mut self, title: &str) {
        self.blocks.push(Block::Section(title.to_owned()));
    }

    /// Adds a paragraph.
    pub fn text(&mut self, words: &str) {
        self.blocks.push(Block::Text(words.to_owned()));
    }

    /// Adds a table; a terminal shows the first one.
    pub fn table(&mut self, table: Table) {
        self.blocks.push(Block::Table(table));
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

    /// Adds what `inside` adds, folded under a title.
    pub fn folded(&mut self, title: &str, inside: impl FnOnce(&mut Self)) {
        let before = std::mem::take(&mut self.blocks);
        inside(self);
        let folded = std::mem::replace(&mut self.blocks, before);
        self.blocks.push(Block::Folded(title.to_owned(), folded));
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

    /// Its charts below one another as an SVG picture, small ones where there are no others.
    #[must_use]
    pub fn svg(&self) -> String {
        let mut charts = Vec::new();
        collect(&self.blocks, &mut charts);
        if charts.iter().any(|chart| chart.size == Size::Full) {
            charts.retain(|chart| chart.size == Size::Full);
        }
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

// Documents for a terminal.

/// Notes that a terminal shows without being asked for more.
pub const NOTES: usize = 3;
/// Lines that a terminal shows without being asked for more, before the notes.
const LINES: usize = 16;

impl Document {
    /// The verdict, and as much of the lead table as a screen has room for.
    #[must_use]
    pub fn terminal(&self, width: usize) -> String {
        let verdict = self.verdict_lines();
        let first = self.blocks.iter().find_map(|block| match block {
            Block::Table(table) => Some(table),
            _ => None,
        });
        let Some(table) = first else {
            return verdict + "\n";
        };
        let mut shown = table.clone();
        let room = LINES.saturating_sub(self.verdict.len());
        while shown.columns(width).lines().count() > room && shown.rows.len() > 1 {
            shown.rows.pop();
        }
        let hidden = table.rows.len() - shown.rows.len();
        let more = if hidden > 0 {
            format!("  … {hidden} more rows (--verbose)\n")
        } else {
            String::new()
        };
        format!("{verdict}\n\n{}\n{more}", shown.columns(width))
    }

    /// All that can be said without figures.
    #[must_use]
    pub fn verbose(&self, width: usize) -> String {
        let mut text = self.verdict_lines() + "\n";
        blocks(&self.blocks, width, &mut text);
        text
    }

    fn verdict_lines(&self) -> String {
        let lines: Vec<String> = self.verdict.iter().map(|line| one_line(line)).collect();
        lines.join("\n")
    }

    /// The notes that a terminal shows, the most important first; all of them to those who ask for more.
    pub fn shown_notes(&self, is_verbose: bool) -> impl Iterator<Item = &Note> {
        let is_spoken = move |note: &&Note| is_verbose || note.importance < Importance::Detail;
        self.notes()
            .iter()
            .filter(is_spoken)
            .take(if is_verbose { usize::MAX } else { NOTES })
    }
}

fn blocks(all: &[Block], width: usize, text: &mut String) {
    for block in all {
        match block {
            Block::Section(title) => *text += &format!("\n{}\n", title.to_uppercase()),
            Block::Text(words) => *text += &format!("\n{words}\n"),
            Block::Table(table) => *text += &format!("\n{}\n", table.columns(width)),
            Block::Folded(title, inside) => {
                *text += &format!("\n{title}\n");
                blocks(inside, width, text);
            }
            Block::Charts(..) | Block::Links(_) => {}
        }
    }
}

#[cfg(test)]
mod terminal_tests {
    use crate::{Document, Importance, Table, Tone};

    #[test]
    fn a_screen_has_verdict_first_table_and_three_notes() {
        let mut document = Document::new(
            "t",
            Tone::Undecided,
            ["undecided: 8 runs", "100 runs decide"],
        );
        let mut table = Table::new(["row"]);
        (0..40).for_each(|k| table.row([k.to_string().into()]));
        document.table(table);
        document.table(Table::new(["other"]));
        for k in 0..3 {
            document.note(Importance::Detail, format!("detail {k}"));
            document.note(Importance::Remark, format!("remark {k}"));
        }
        document.note(Importance::Warning, "last said, first told");
        let text = document.terminal(100);
        assert!(
            text.starts_with("undecided: 8 runs\n100 runs decide\n\n  row\n  0\n"),
            "{text}"
        );
        assert!(
            text.ends_with("  12\n  … 27 more rows (--verbose)\n") && text.lines().count() <= 18,
            "{text}"
        );
        let spoken: Vec<&str> = document
            .shown_notes(false)
            .map(|n| n.text.as_str())
            .collect();
        assert_eq!(spoken, ["last said, first told", "remark 0", "remark 1"]);
        assert_eq!(document.shown_notes(true).count(), 7);
        assert!(document.verbose(100).contains("\n  39\n"));
    }
}

// Documents as pages: one self-contained HTML file each (no network, complete without scripts, for a screen, a phone,
// paper, by day and by night). A page is a function of the document alone: same result, same bytes.

const PAGE_STYLE: &str = include_str!("page.css");
const SCRIPT: &str = include_str!("page.js");
/// Tells our pages from those of others.
const GENERATOR: &str = "<meta name=\"generator\" content=\"nav-sim\">";
/// Characters beyond which a text in a table has more than one line.
const LONG: usize = 40;

impl Document {
    /// The page.
    #[must_use]
    pub fn html(&self) -> String {
        let title = escape(&self.title);
        let tone = match self.tone {
            Tone::Good => "good",
            Tone::Undecided => "undecided",
            Tone::Doubtful => "doubtful",
            Tone::Bad => "bad",
        };
        let verdict = self
            .verdict
            .iter()
            .map(|line| escape(line))
            .collect::<Vec<_>>()
            .join("<br>\n");
        let mut body = format!("<h1>{title}</h1>\n<p class=\"verdict {tone}\">{verdict}</p>\n");
        let (first, others) = self.notes().split_at(NOTES.min(self.notes().len()));
        body += &notes(first);
        if !others.is_empty() {
            let (count, others) = (others.len(), notes(others));
            let _ = writeln!(
                body,
                "<details><summary>Further notes: {count}</summary>\n{others}</details>"
            );
        }
        self.blocks.iter().for_each(|b| block(b, &mut body));
        format!(
            "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n{GENERATOR}\n{VIEWPORT}\n\
             <title>{title}</title>\n<style>\n{COLOURS}{CHART_STYLE}{PAGE_STYLE}</style>\n</head>\n<body>\n\
             <main>\n{body}</main>\n<script>\n{SCRIPT}</script>\n</body>\n</html>\n"
        )
    }
}

const VIEWPORT: &str = "<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">";

fn notes(notes: &[Note]) -> String {
    let item = |note: &Note| {
        let class = if note.importance == Importance::Warning {
            " class=\"warning\""
        } else {
            ""
        };
        format!("<li{class}>{}</li>\n", escape(&note.text))
    };
    match notes {
        [] => String::new(),
        _ => format!(
            "<ul class=\"notes\">\n{}</ul>\n",
            notes.iter().map(item).collect::<String>()
        ),
    }
}

fn block(block: &Block, html: &mut String) {
    *html += &match block {
        Block::Section(title) => format!("<h2>{}</h2>\n", escape(title)),
        Block::Text(words) => format!("<p>{}</p>\n", escape(words)),
        Block::Table(table) => self::table(table),
        Block::Charts(charts, caption) => {
            // The head of a section stands for the title of its only chart.
            let head = |chart: &Chart| format!("<h2>{}</h2>\n", escape(&chart.title));
            let is_titled = matches!(&charts[..], [only] if html.ends_with(&head(only)));
            let figures: String = charts
                .iter()
                .map(|chart| figure(chart, is_titled))
                .collect();
            let caption = match caption.as_str() {
                "" => String::new(),
                caption => format!("<figcaption>{}</figcaption>\n", escape(caption)),
            };
            match charts.iter().all(|chart| chart.size == Size::Small) {
                true => format!("<div class=\"charts\">\n{figures}</div>\n{caption}"),
                false => figures + &caption,
            }
        }
        Block::Links(links) => {
            let link = |(path, name): &(String, String)| {
                format!(
                    "<li><a href=\"{}\">{}</a></li>\n",
                    escape(path),
                    escape(name)
                )
            };
            format!(
                "<ul>\n{}</ul>\n",
                links.iter().map(link).collect::<String>()
            )
        }
        Block::Folded(title, blocks) => {
            let mut inside = String::new();
            blocks.iter().for_each(|b| self::block(b, &mut inside));
            format!(
                "<details><summary>{}</summary>\n{inside}</details>\n",
                escape(title)
            )
        }
    };
}

fn table(table: &Table) -> String {
    let name = |(column, name): (usize, &String)| {
        let class = if table.is_numeric(column) {
            " class=\"number\""
        } else {
            ""
        };
        format!("<th{class}>{}</th>", escape(name))
    };
    let cell = |cell: &Cell| {
        let class = match cell.is_number {
            true => " class=\"number\"",
            false if cell.text.chars().count() > LONG => " class=\"long\"",
            false => "",
        };
        let pointer = match cell.pointer.as_str() {
            "" => String::new(),
            pointer => format!(" data-json=\"{}\"", escape(pointer)),
        };
        format!("<td{class}{pointer}>{}</td>", escape(&cell.text))
    };
    let row = |row: &Vec<Cell>| format!("<tr>{}</tr>\n", row.iter().map(cell).collect::<String>());
    let head: String = table.head.iter().enumerate().map(name).collect();
    let rows: String = table.rows.iter().map(row).collect();
    format!(
        "<div class=\"scroll\" tabindex=\"0\"><table>\n<thead><tr>{head}</tr></thead>\n<tbody>\n{rows}</tbody></table></div>\n"
    )
}

fn figure(chart: &Chart, is_titled: bool) -> String {
    let canvases: &[Canvas] = match chart.size {
        Size::Small => &[SMALL],
        Size::Full => &[WIDE, NARROW],
    };
    let drawn: String = canvases
        .iter()
        .filter_map(|canvas| drawing(chart, canvas))
        .collect();
    let title = match is_titled {
        true => String::new(),
        false => format!("<h3>{}</h3>\n", escape(&chart.title)),
    };
    let inside = match drawn.is_empty() {
        true => "<p>No value to show.</p>\n",
        false => &drawn,
    };
    format!("<figure>\n{title}{inside}</figure>\n")
}

fn drawing(chart: &Chart, canvas: &Canvas) -> Option<String> {
    let (inside, height) = draw(chart, canvas)?;
    let group = if chart.is_map { "map" } else { &chart.group };
    Some(format!(
        "<svg class=\"chart {}\" viewBox=\"0 0 {} {height}\" role=\"img\" aria-label=\"{}\" data-group=\"{}\">\n{inside}</svg>\n",
        canvas.class,
        canvas.width,
        escape(&chart.title),
        escape(group)
    ))
}

#[cfg(test)]
#[path = "page_tests.rs"]
mod tests;
