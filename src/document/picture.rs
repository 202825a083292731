//! Charts as a picture for a paper or a slide: SVG in plain colours, which every program reads, and what is made of it.

use crate::chart::Chart;
use crate::draw::{WIDE, draw, escape, text};
use std::fmt::Write as _;

/// Colours by name, by day and by night.
pub(crate) const COLOURS: &str = include_str!("colours.css");
/// Style of charts.
pub(crate) const CHART_STYLE: &str = include_str!("chart.css");

/// Endings of the files that pictures are written to.
pub const FORMS: &[&str] = match cfg!(feature = "pictures") {
    true => &["svg", "png"],
    false => &["svg"],
};

/// Charts below one another as an SVG file; those without a value are left out.
pub fn svg(title: &str, charts: &[Chart]) -> String {
    const MARGIN: f64 = 16.0;
    let line = 2.0 * WIDE.font;
    let (mut body, mut top) = (String::new(), MARGIN);
    for chart in charts {
        let Some((inside, height)) = draw(chart, &WIDE) else {
            continue;
        };
        let _ = writeln!(body, "<g transform=\"translate({MARGIN} {top})\">");
        text(&mut body, "title", (0.0, WIDE.font), "start", &chart.title);
        let _ = writeln!(
            body,
            "<g transform=\"translate(0 {line})\">\n{inside}</g></g>"
        );
        top += line + height + MARGIN;
    }
    let (width, title, style) = (WIDE.width + 2.0 * MARGIN, escape(title), plain_style());
    format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" class=\"chart wide\" viewBox=\"0 0 {width} {top}\" width=\"{width}\" \
         height=\"{top}\" role=\"img\">\n<title>{title}</title>\n<style>\n{style}</style>\n\
         <rect class=\"paper\" width=\"{width}\" height=\"{top}\"/>\n{body}</svg>\n"
    )
}

/// The charts' style with the colours of the day in the place of their names: browsers alone know such names.
fn plain_style() -> String {
    let by_day = COLOURS.split(['{', '}']).nth(1).unwrap_or_default();
    let declarations = by_day
        .split(';')
        .filter_map(|declaration| declaration.trim().split_once(':'));
    let named = declarations.filter(|(name, _)| name.starts_with("--"));
    named.fold(CHART_STYLE.to_owned(), |style, (name, colour)| {
        style.replace(&format!("var({name})"), colour.trim())
    })
}

/// The file of an SVG picture that has this ending.
///
/// # Errors
/// Of a PNG, where a text in it has a character that XML does not know, and where its dots do not fit into memory.
pub fn encode(svg: String, form: &str) -> Result<Vec<u8>, String> {
    #[cfg(feature = "pictures")]
    if form == "png" {
        return crate::png::png(&svg)
            .map_err(|cause| format!("the picture cannot be drawn as PNG: {cause}"));
    }
    let _ = form;
    Ok(svg.into_bytes())
}
