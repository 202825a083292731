//! Pages of results: one self-contained HTML file each (no network, complete without scripts, for a screen, a phone,
//! paper, by day and by night), and charts as files. A page is a function of the results alone: same seed, same bytes.

mod axis;
mod chart;
mod draw;
mod legend;
mod marks;
mod picture;
mod table;
mod terminal;

pub(crate) use chart::{Axis, Chart, Colour, Interval, Mark, Panel, Series, Size, Stroke};
pub(crate) use picture::{Form, encode, svg};
pub(crate) use table::{Cell, Table};
pub(crate) use terminal::{beside, terminal};

use draw::{Canvas, NARROW, SMALL, WIDE, draw};
use std::fmt::Write as _;

/// Colours by name, by day and by night.
const COLOURS: &str = include_str!("colours.css");
const CHART_STYLE: &str = include_str!("chart.css");
const PAGE_STYLE: &str = include_str!("page.css");
const SCRIPT: &str = include_str!("page.js");

/// How a verdict is coloured.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Tone {
    /// As it should be.
    Good,
    /// Not known.
    Undecided,
    /// To be looked at.
    Doubtful,
    /// Not to be believed.
    Bad,
}

/// A page: a title, a verdict, then sections of words, charts and tables.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Page {
    title: String,
    body: String,
    /// Its charts, in their order.
    charts: Vec<Chart>,
}

impl Page {
    /// A page that begins with its verdict, one or two sentences.
    pub(crate) fn new(title: &str, tone: Tone, verdict: &str) -> Self {
        let class = match tone {
            Tone::Good => "",
            Tone::Undecided => " undecided",
            Tone::Doubtful => " doubtful",
            Tone::Bad => " bad",
        };
        let (heading, verdict) = (escape(title), escape(verdict));
        let body = format!("<h1>{heading}</h1>\n<p class=\"verdict{class}\">{verdict}</p>\n");
        Self { title: title.to_owned(), body, charts: Vec::new() }
    }

    /// Begins a section.
    pub(crate) fn section(&mut self, title: &str) {
        let _ = writeln!(self.body, "<h2>{}</h2>", escape(title));
    }

    /// A heading within a section.
    pub(crate) fn heading(&mut self, title: &str) {
        let _ = writeln!(self.body, "<h3>{}</h3>", escape(title));
    }

    /// A paragraph.
    pub(crate) fn text(&mut self, words: &str) {
        let _ = writeln!(self.body, "<p>{}</p>", escape(words));
    }

    /// Names and what they are, line by line.
    pub(crate) fn facts(&mut self, facts: &[(&str, String)]) {
        self.body += "<dl>\n";
        for (name, value) in facts {
            let _ = writeln!(self.body, "<dt>{}</dt><dd>{}</dd>", escape(name), escape(value));
        }
        self.body += "</dl>\n";
    }

    /// Links to files beside the page: relative path and what is there.
    pub(crate) fn links(&mut self, links: &[(String, String)]) {
        self.body += "<ul>\n";
        for (path, name) in links {
            let _ = writeln!(self.body, "<li><a href=\"{}\">{}</a></li>", escape(path), escape(name));
        }
        self.body += "</ul>\n";
    }

    /// A chart and what is to be seen in it.
    pub(crate) fn chart(&mut self, chart: &Chart, caption: &str) {
        self.body += &figure(chart, caption);
        self.charts.push(chart.clone());
    }

    /// Its figures, below one another, as an SVG file.
    pub(crate) fn svg(&self) -> String {
        svg(&self.title, &self.charts)
    }

    /// Small charts side by side; one below the other on a phone.
    pub(crate) fn charts(&mut self, charts: &[Chart], caption: &str) {
        self.body += "<div class=\"charts\">\n";
        charts.iter().for_each(|chart| self.body += &figure(chart, ""));
        let _ = writeln!(self.body, "</div>\n<figcaption>{}</figcaption>", escape(caption));
        self.charts.extend_from_slice(charts);
    }

    /// The last line of a page: what its figures were checked against, to which tolerance, by which test.
    pub(crate) fn checked(&mut self, words: &str) {
        let _ = writeln!(self.body, "<p class=\"checked\">Checked: {}</p>", escape(words));
    }

    /// A table.
    pub(crate) fn table(&mut self, table: &Table) {
        self.body += &table.html();
    }

    /// A text as it stands in a file.
    pub(crate) fn code(&mut self, text: &str) {
        let _ = writeln!(self.body, "<pre>{}</pre>", escape(text));
    }

    /// What few want to see, folded.
    pub(crate) fn folded(&mut self, title: &str, inside: impl FnOnce(&mut Self)) {
        let _ = writeln!(self.body, "<details><summary>{}</summary>", escape(title));
        inside(self);
        self.body += "</details>\n";
    }

    /// The file.
    pub(crate) fn html(&self) -> String {
        let (title, body) = (escape(&self.title), &self.body);
        format!(
            "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
             {GENERATOR}\n<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n<title>{title}</title>\n\
             <style>\n{COLOURS}{CHART_STYLE}{PAGE_STYLE}</style>\n</head>\n<body>\n<main>\n{body}</main>\n\
             <script>\n{SCRIPT}</script>\n</body>\n</html>\n"
        )
    }
}

/// Tells our pages from those of others.
const GENERATOR: &str = "<meta name=\"generator\" content=\"nav-sim\">";

/// Whether a text is a page of this module.
pub(crate) fn is_own(html: &str) -> bool {
    html.contains(GENERATOR)
}

/// The tone of a good or a bad result.
impl From<bool> for Tone {
    fn from(is_good: bool) -> Self {
        if is_good { Self::Good } else { Self::Bad }
    }
}

fn figure(chart: &Chart, caption: &str) -> String {
    let title = escape(&chart.title);
    let canvases: &[Canvas] = if chart.size == Size::Small { &[SMALL] } else { &[WIDE, NARROW] };
    let drawn: String = canvases.iter().filter_map(|canvas| element(chart, canvas)).collect();
    let inside = if drawn.is_empty() { "<p>No value to show.</p>\n" } else { &drawn };
    let caption = if caption.is_empty() {
        String::new()
    } else {
        format!("<figcaption>{}</figcaption>\n", escape(caption))
    };
    format!("<figure>\n<h3>{title}</h3>\n{inside}{caption}</figure>\n")
}

fn element(chart: &Chart, canvas: &Canvas) -> Option<String> {
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

/// Text made safe inside HTML and SVG.
pub(crate) fn escape(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

#[cfg(test)]
mod tests;
