//! Charts as a picture for a paper or a slide: SVG in plain colours, which every program reads, and what is made of it.

use crate::canvas::{WIDE, text};
use crate::chart::Chart;
use crate::draw::draw;
use crate::escape::escape;
use resvg::{tiny_skia, usvg};
use std::fmt::Write as _;
use std::path::Path;
use std::sync::Arc;

/// Colours by name, by day and by night.
pub(crate) const COLOURS: &str = include_str!("colours.css");
/// Style of charts.
pub(crate) const CHART_STYLE: &str = include_str!("chart.css");

/// Dots an inch of a PNG; an SVG's pixel is 1/96 inch.
const DENSITY: f32 = 300.0;
const PIXELS_AN_INCH: f32 = 96.0;
/// Of a PNG: a taller picture has fewer dots an inch, so that no viewer refuses it.
const MOST_DOTS: f32 = 8e7;

/// In which form a picture is written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Form {
    /// Lines and text, as they are.
    Svg,
    /// Dots, 300 an inch.
    Png,
}

impl Form {
    /// By the ending of a file's name, in capitals or not.
    pub fn of(path: &Path) -> Option<Self> {
        match path.extension()?.to_str()?.to_ascii_lowercase().as_str() {
            "svg" => Some(Self::Svg),
            "png" => Some(Self::Png),
            _ => None,
        }
    }
}

/// Why there is no picture.
#[derive(Debug, thiserror::Error)]
#[error("the picture cannot be drawn as {form:?}: {cause}")]
pub struct PictureError {
    form: Form,
    cause: String,
}

/// Charts below one another as an SVG file; those without a value are left out.
pub fn svg(title: &str, charts: &[Chart]) -> String {
    const MARGIN: f64 = 16.0;
    let line = 2.0 * WIDE.font;
    let (mut body, mut top) = (String::new(), MARGIN);
    for chart in charts {
        let Some((inside, height)) = draw(chart, &WIDE) else { continue };
        let _ = writeln!(body, "<g transform=\"translate({MARGIN} {top})\">");
        text(&mut body, "title", (0.0, WIDE.font), "start", &chart.title);
        let _ = writeln!(body, "<g transform=\"translate(0 {line})\">\n{inside}</g></g>");
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
    let declarations = by_day.split(';').filter_map(|declaration| declaration.trim().split_once(':'));
    let named = declarations.filter(|(name, _)| name.starts_with("--"));
    named.fold(CHART_STYLE.to_owned(), |style, (name, colour)| {
        style.replace(&format!("var({name})"), colour.trim())
    })
}

/// An SVG picture in the form asked for.
///
/// # Errors
/// Where a text in it has a character that XML does not know, and where its dots do not fit into memory.
pub fn encode(svg: String, form: Form) -> Result<Vec<u8>, PictureError> {
    let drawn = match form {
        Form::Svg => return Ok(svg.into_bytes()),
        Form::Png => png(&drawable(&svg)),
    };
    drawn.map_err(|cause| PictureError { form, cause })
}

/// With a question mark for each character of the scripts that the font lacks (those of East Asia, pictographs): it would
/// be drawn as an empty box.
fn drawable(svg: &str) -> String {
    let is_lacking = |c: char| matches!(c, '\u{1100}'..='\u{11ff}' | '\u{2e80}'..='\u{a4cf}' | '\u{ac00}'..='\u{d7ff}' | '\u{f900}'..='\u{faff}' | '\u{ff00}'..='\u{ffef}' | '\u{1f000}'..);
    svg.replace(is_lacking, "?")
}

/// With the font that is compiled in: the same drawing on every machine, also where no font is installed.
fn parsed(svg: &str) -> Result<usvg::Tree, String> {
    let mut fonts = usvg::fontdb::Database::new();
    for font in [dejavu::sans::regular(), dejavu::sans::bold()] {
        fonts.load_font_source(usvg::fontdb::Source::Binary(Arc::new(font)));
    }
    fonts.set_sans_serif_family("DejaVu Sans");
    let options = usvg::Options { fontdb: Arc::new(fonts), ..usvg::Options::default() };
    usvg::Tree::from_str(svg, &options).map_err(|e| e.to_string())
}

fn png(svg: &str) -> Result<Vec<u8>, String> {
    let picture = parsed(svg)?;
    let (width, height) = (picture.size().width(), picture.size().height());
    let zoom = (DENSITY / PIXELS_AN_INCH).min((MOST_DOTS / (width * height)).sqrt());
    let dots = picture.size().to_int_size().scale_by(zoom).ok_or("it has no size")?;
    let mut dotted =
        tiny_skia::Pixmap::new(dots.width(), dots.height()).ok_or("it does not fit into memory")?;
    resvg::render(&picture, tiny_skia::Transform::from_scale(zoom, zoom), &mut dotted.as_mut());
    dotted.encode_png().map_err(|e| e.to_string())
}
