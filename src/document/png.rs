//! A picture as dots.

use resvg::{tiny_skia, usvg};
use std::sync::Arc;

/// Dots an inch of a PNG; an SVG's pixel is 1/96 inch.
const DENSITY: f32 = 300.0;
const PIXELS_AN_INCH: f32 = 96.0;
/// Largest number of dots of a PNG: a taller picture has fewer dots per inch, so that no viewer
/// refuses it.
const MOST_DOTS: f32 = 8e7;

/// With the font that is compiled in: the same drawing on every machine, also where no font is installed.
fn parsed(svg: &str) -> Result<usvg::Tree, String> {
    let mut fonts = usvg::fontdb::Database::new();
    for font in [dejavu::sans::regular(), dejavu::sans::bold()] {
        fonts.load_font_source(usvg::fontdb::Source::Binary(Arc::new(font)));
    }
    fonts.set_sans_serif_family("DejaVu Sans");
    let options = usvg::Options {
        fontdb: Arc::new(fonts),
        ..usvg::Options::default()
    };
    usvg::Tree::from_str(svg, &options).map_err(|e| e.to_string())
}

/// The dots of an SVG picture.
pub(crate) fn png(svg: &str) -> Result<Vec<u8>, String> {
    let picture = parsed(svg)?;
    let (width, height) = (picture.size().width(), picture.size().height());
    let zoom = (DENSITY / PIXELS_AN_INCH).min((MOST_DOTS / (width * height)).sqrt());
    let dots = picture
        .size()
        .to_int_size()
        .scale_by(zoom)
        .ok_or("it has no size")?;
    let mut dotted =
        tiny_skia::Pixmap::new(dots.width(), dots.height()).ok_or("it does not fit into memory")?;
    resvg::render(
        &picture,
        tiny_skia::Transform::from_scale(zoom, zoom),
        &mut dotted.as_mut(),
    );
    dotted
        .encode_png()
        .map(|png| signed(&png))
        .map_err(|e| e.to_string())
}

/// With the name of the program in a text chunk behind the signature and the header.
fn signed(png: &[u8]) -> Vec<u8> {
    const SIGNATURE_AND_HEADER: usize = 33;
    const CHUNK: &[u8] = b"\0\0\0\x10tEXtSoftware\0nav-sim\x58\x6e\x2b\xd7";
    let (head, rest) = png.split_at(SIGNATURE_AND_HEADER);
    [head, CHUNK, rest].concat()
}
