//! Documents as pages: one self-contained HTML file each (no network, complete without scripts, for a screen, a phone,
//! paper, by day and by night). A page is a function of the document alone: same result, same bytes.

use crate::canvas::{Canvas, NARROW, SMALL, WIDE};
use crate::chart::{Chart, Size};
use crate::document::{Block, Document, Importance, Note, Tone};
use crate::draw::draw;
use crate::escape::escape;
use crate::picture::{CHART_STYLE, COLOURS};
use crate::table::{Cell, Table};
use crate::terminal::NOTES;
use std::fmt::Write as _;

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
        let tone = match self.verdict.tone {
            Tone::Good => "good",
            Tone::Undecided => "undecided",
            Tone::Doubtful => "doubtful",
            Tone::Bad => "bad",
        };
        let verdict = self
            .verdict
            .lines
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
        Block::Heading(title) => format!("<h3>{}</h3>\n", escape(title)),
        Block::Text(words) => format!("<p>{}</p>\n", escape(words)),
        Block::Facts(facts) => {
            let fact = |(name, value): &(String, String)| {
                format!("<dt>{}</dt><dd>{}</dd>\n", escape(name), escape(value))
            };
            format!(
                "<dl>\n{}</dl>\n",
                facts.iter().map(fact).collect::<String>()
            )
        }
        Block::Table { table, .. } => self::table(table),
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
        Block::Code(text) => format!("<pre>{}</pre>\n", escape(text)),
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
