#[cfg(feature = "pictures")]
use crate::encode;
use crate::{Cell, Chart, ChartAxis, Colour, Document, Mark, Panel, Series, Table, Tone, svg};

fn chart() -> Chart {
    let curve = (0..50)
        .map(|i| (f64::from(i), 1.0 + f64::from(i)))
        .collect();
    let band = (0..50)
        .map(|i| (f64::from(i), 0.5, 2.0 + f64::from(i)))
        .collect();
    let upper = vec![
        Series::new("confidence <95 %>", Colour::BELIEVED, Mark::Band(band)),
        Series::line("RMSE", Colour::REAL, curve),
        Series::new("", Colour::Soft, Mark::Level(9.0)),
    ];
    let lower = vec![Series::line(
        "RMSE",
        Colour::REAL,
        vec![(0.0, 1.0), (49.0, f64::NAN)],
    )];
    let panels = vec![
        Panel::new(ChartAxis::log("error (m)"), upper),
        Panel::new(ChartAxis::linear("ratio"), lower),
    ];
    Chart {
        group: String::new(),
        ..Chart::over_time("a<b", panels, &[(10.0, 20.0), (80.0, 90.0)])
    }
}

fn page(chart: &Chart) -> String {
    let mut page = Document::new("x & y", Tone::Bad, ["It is <bad>."]);
    page.chart(chart, "A caption.");
    page.html()
}

/// A screen's drawing and a phone's, each with two panels, the outage within the time shown in each, one name in the
/// legend for both panels.
#[test]
fn a_chart_is_drawn_for_a_screen_and_for_a_phone() {
    let html = page(&chart());
    assert_eq!(html.matches("<svg class=\"chart wide\"").count(), 1);
    assert_eq!(html.matches("<svg class=\"chart narrow\"").count(), 1);
    assert_eq!(html.matches("<svg class=\"plot\"").count(), 4);
    assert_eq!(html.matches("class=\"outage\" x").count(), 6); // and one in each legend
    assert_eq!(html.matches("<g class=\"key h1\"").count(), 2);
    assert!(
        html.contains(">a&lt;b</h3>")
            && html.contains("It is &lt;bad&gt;.")
            && !html.contains("NaN")
    );
}

/// The page asks nothing of the network.
#[test]
fn a_page_is_self_contained() {
    let html = page(&chart());
    let without_names = html.replace("http://www.w3.org/2000/svg", "");
    for word in ["http:", "https:", "src=", "@import", "url(", "<link"] {
        assert!(!without_names.contains(word), "{word}");
    }
    assert!(html.ends_with("</html>\n"));
}

#[test]
fn nothing_to_show_is_said() {
    let empty = Chart::new(
        "t",
        ChartAxis::linear("x"),
        vec![Panel::new(ChartAxis::log("y"), vec![])],
    );
    assert!(page(&empty).contains("No value to show."));
    let picture = svg("title", &[empty, chart()]);
    assert!(picture.starts_with("<svg xmlns=") && picture.ends_with("</svg>\n"));
    assert_eq!(picture.matches("class=\"title\"").count(), 1);
}

/// A square of 100 m by 100 m is drawn as one.
#[test]
fn a_map_has_one_scale() {
    let corners = vec![(0.0, 0.0), (100.0, 0.0), (100.0, 100.0), (0.0, 100.0)];
    let series = vec![
        Series::line("way", Colour::Ink, corners),
        Series::new("start", Colour::RIGHT, Mark::Place(0.0, 0.0)),
    ];
    let html = page(&Chart::map("map", series));
    let from = html.find("class=\"line\" d=\"M").unwrap() + 17;
    let path = &html[from..from + html[from..].find('"').unwrap()];
    let points: Vec<Vec<f64>> = path
        .split('L')
        .map(|p| p.split(' ').map(|c| c.parse().unwrap()).collect())
        .collect();
    let (east, north) = (points[1][0] - points[0][0], points[1][1] - points[2][1]);
    // Four coordinates in tenths of a pixel.
    assert!((east - north).abs() < 0.21 && east > 100.0, "{path}");
    assert!(html.contains(">start</text>"), "{path}");
}

#[test]
fn tables_say_where_their_numbers_are_from() {
    let mut table = Table::new(["state", "RMSE (m)"]).and(["note".to_owned()]);
    table.row([
        "<north>".into(),
        Cell::number(1.2345, "/rmse/pos_n_m"),
        "x".into(),
    ]);
    let html = super::table(&table);
    assert!(
        html.contains("<th class=\"number\">RMSE (m)</th>"),
        "{html}"
    );
    assert!(
        html.contains(
            "<td>&lt;north&gt;</td><td class=\"number\" data-json=\"/rmse/pos_n_m\">1.23</td>"
        ),
        "{html}"
    );
}

#[test]
fn a_picture_has_no_names_of_colours_that_browsers_alone_know() {
    let picture = svg("title", &[chart()]);
    assert!(
        ["var(", "@media", ":root"]
            .iter()
            .all(|word| !picture.contains(word)),
        "{picture}"
    );
}

/// White paper, ink where the title is, and a line in its own colour, at 300 dots an inch of 96 pixels.
#[cfg(feature = "pictures")]
#[test]
fn a_picture_can_be_dots() {
    let picture = svg("title", &[chart()]);
    let dots = resvg::tiny_skia::Pixmap::decode_png(&encode(picture, "png").unwrap()).unwrap();
    assert_eq!(dots.width(), 3100); // of 992 pixels
    let colour = |x, y| {
        dots.pixel(x, y)
            .map(|p| (p.red(), p.green(), p.blue()))
            .unwrap()
    };
    assert_eq!(colour(2, 2), (255, 255, 255));
    let in_title = (50..200).flat_map(|x| (50..100).map(move |y| (x, y)));
    assert!(
        in_title
            .clone()
            .any(|(x, y)| colour(x, y) == (0x1b, 0x1f, 0x24))
    );
    let everywhere = (0..dots.width()).flat_map(|x| (0..dots.height()).map(move |y| (x, y)));
    assert!(
        everywhere
            .clone()
            .filter(|&(x, y)| colour(x, y) == (0xcc, 0x4e, 0x00))
            .count()
            > 1000
    );
}

/// A name that is wider than the picture loses its middle, not its end: beginnings are alike.
#[test]
fn a_legend_stays_within_its_picture() {
    let name = format!(
        "{}_x, classical",
        "recording_of_the_unit_on_the_rate_table_".repeat(4)
    );
    let lines = vec![
        Series::line(&name, Colour::BELIEVED, vec![(0.0, 1.0), (1.0, 2.0)]),
        Series::line("model", Colour::REAL, vec![(0.0, 1.0), (1.0, 2.0)]),
    ];
    let html = page(&Chart::new(
        "t",
        ChartAxis::linear("x"),
        vec![Panel::new(ChartAxis::linear("y"), lines)],
    ));
    assert!(
        !html.contains(&format!(">{name}</text>")) && html.matches("…").count() >= 2,
        "{html}"
    );
    assert!(html.contains("_x, classical</text>"), "{html}");
}

#[cfg(feature = "pictures")]
#[test]
fn a_character_that_no_picture_can_hold_is_an_error() {
    let refused = encode(svg("a\u{fffe}b", &[chart()]), "png").unwrap_err();
    assert!(
        refused.starts_with("the picture cannot be drawn as PNG: "),
        "{refused}"
    );
}

#[cfg(feature = "pictures")]
#[test]
fn greek_letters_are_drawn() {
    let dots = |title: &str| {
        let named = Chart {
            title: title.to_owned(),
            ..chart()
        };
        encode(svg("t", &[named]), "png").unwrap()
    };
    assert!(dots("\u{3c3}") != dots("\u{6d4b}"));
}
