//! Contents of a chart, before it is drawn.

/// An axis.
#[derive(Debug, Clone, PartialEq)]
pub struct ChartAxis {
    /// Quantity and unit, such as `time (s)`.
    pub label: String,
    /// True for a logarithmic axis, which leaves out values that are not positive.
    pub is_log: bool,
    /// Range that it always shows.
    pub include: Option<(f64, f64)>,
}

impl ChartAxis {
    /// A linear axis.
    pub fn linear(label: &str) -> Self {
        Self {
            label: label.to_owned(),
            is_log: false,
            include: None,
        }
    }

    /// A logarithmic axis.
    pub fn log(label: &str) -> Self {
        Self {
            is_log: true,
            ..Self::linear(label)
        }
    }

    /// The axis, showing at least the values from `low` to `high`.
    pub fn including(self, low: f64, high: f64) -> Self {
        Self {
            include: Some((low, high)),
            ..self
        }
    }
}

/// A colour of the palette, which the blind to red or green can tell apart too (Okabe and Ito).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Colour {
    /// Colour of text: measurements.
    Ink,
    /// Grey: what stands in the background.
    Soft,
    /// One of [`Colour::HUES`]; more begin anew.
    Hue(usize),
}

impl Colour {
    /// Hues of the palette.
    pub const HUES: usize = 8;
    /// Standard deviation stated by a filter or a model.
    pub const BELIEVED: Self = Self::Hue(0);
    /// True or measured error.
    pub const REAL: Self = Self::Hue(1);
    /// Region in which a consistent filter or model stays.
    pub const RIGHT: Self = Self::Hue(2);

    /// Class of the style sheet.
    pub(crate) fn class(self) -> String {
        match self {
            Self::Ink => "ink".to_owned(),
            Self::Soft => "soft".to_owned(),
            Self::Hue(k) => format!("h{}", k % Self::HUES),
        }
    }
}

/// Style of a line.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Stroke {
    /// Solid line of normal width.
    Plain,
    /// One of many.
    Thin,
    /// In strokes.
    Dashed,
    /// Beneath another one, to mark a stretch of it.
    Bold,
}

impl Stroke {
    /// Class of the style sheet.
    pub(crate) const fn class(self) -> &'static str {
        match self {
            Self::Plain => "line",
            Self::Thin => "line thin",
            Self::Dashed => "line dashed",
            Self::Bold => "line bold",
        }
    }
}

/// A point and its interval.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PointInterval {
    /// Where.
    pub x: f64,
    /// The value.
    pub y: f64,
    /// Lower end; NaN: none.
    pub low: f64,
    /// Upper end; NaN: none.
    pub high: f64,
}

/// Mark of a series: line, points, band.
#[derive(Debug, Clone, PartialEq)]
pub enum Mark {
    /// A line through points (x, y); a value that cannot be shown breaks it.
    Line(Vec<(f64, f64)>, Stroke),
    /// The area between two curves (x, low, high).
    Band(Vec<(f64, f64, f64)>),
    /// Points with error bars.
    Points(Vec<PointInterval>),
    /// A line at one value of y.
    Level(f64),
    /// The area between two values of y.
    Zone(f64, f64),
    /// A dot with its name beside it, at (x, y); not in the legend.
    Place(f64, f64),
}

/// Something to see and its name in the legend. Series of one name, in all panels, are one entry there.
#[derive(Debug, Clone, PartialEq)]
pub struct Series {
    /// Name; of an empty one the legend says nothing.
    pub name: String,
    /// Colour.
    pub colour: Colour,
    /// Its mark.
    pub mark: Mark,
}

impl Series {
    /// A series.
    pub fn new(name: &str, colour: Colour, mark: Mark) -> Self {
        Self {
            name: name.to_owned(),
            colour,
            mark,
        }
    }

    /// A line.
    pub fn line(name: &str, colour: Colour, points: Vec<(f64, f64)>) -> Self {
        Self::new(name, colour, Mark::Line(points, Stroke::Plain))
    }

    /// Points (x, y, half of the interval; NaN: none).
    pub fn points(
        name: &str,
        colour: Colour,
        points: impl IntoIterator<Item = (f64, f64, f64)>,
    ) -> Self {
        let point = |(x, y, half): (f64, f64, f64)| PointInterval {
            x,
            y,
            low: y - half,
            high: y + half,
        };
        Self::new(
            name,
            colour,
            Mark::Points(points.into_iter().map(point).collect()),
        )
    }

    /// A dashed line.
    pub fn dashed(name: &str, colour: Colour, points: Vec<(f64, f64)>) -> Self {
        Self::new(name, colour, Mark::Line(points, Stroke::Dashed))
    }
}

/// One plot of a chart, all of which share their x axis.
#[derive(Debug, Clone, PartialEq)]
pub struct Panel {
    /// Its own axis.
    pub y: ChartAxis,
    /// Series of the panel, the first at the bottom.
    pub series: Vec<Series>,
    /// Its height as a share of the usual one.
    pub height: f64,
}

impl Panel {
    /// A panel of the usual height.
    pub fn new(y: ChartAxis, series: Vec<Series>) -> Self {
        Self {
            y,
            series,
            height: 1.0,
        }
    }

    /// The panel with another height, as a share of the usual one.
    pub fn of_height(self, height: f64) -> Self {
        Self { height, ..self }
    }
}

/// Size of a chart on the page.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Size {
    /// The whole width: drawn twice, for a screen and for a phone.
    Full,
    /// One of several side by side ([`crate::Document::charts`]).
    Small,
}

/// Panels above one another with one x axis.
#[derive(Debug, Clone, PartialEq)]
pub struct Chart {
    /// Title in words.
    pub title: String,
    /// The axis of all panels.
    pub x: ChartAxis,
    /// From top to bottom.
    pub panels: Vec<Panel>,
    /// Vertical stripes (from, to), such as outages, and what they are.
    pub stripes: (String, Vec<(f64, f64)>),
    /// True if x and y share one scale, as on a map.
    pub is_map: bool,
    /// Charts of one group are zoomed together, and show their values at the same x.
    pub group: String,
    /// Size on the page.
    pub size: Size,
}

impl Chart {
    /// A chart of one or more panels, of the whole width.
    pub fn new(title: &str, x: ChartAxis, panels: Vec<Panel>) -> Self {
        Self {
            title: title.to_owned(),
            x,
            panels,
            stripes: (String::new(), Vec::new()),
            is_map: false,
            group: String::new(),
            size: Size::Full,
        }
    }

    /// A map: east to the right, north up, in metres, one scale.
    pub fn map(title: &str, series: Vec<Series>) -> Self {
        let panel = Panel::new(ChartAxis::linear("north (m)"), series);
        Self {
            is_map: true,
            ..Self::new(title, ChartAxis::linear("east (m)"), vec![panel])
        }
    }

    /// Panels over time with outages (start, end) marked, in the group of charts that are zoomed together.
    pub fn over_time(title: &str, panels: Vec<Panel>, outages: &[(f64, f64)]) -> Self {
        Self {
            stripes: ("outage".to_owned(), outages.to_vec()),
            ..Self::new(title, ChartAxis::linear("time (s)"), panels).in_group("time")
        }
    }

    /// The chart in a group of charts that are zoomed together.
    pub fn in_group(self, group: &str) -> Self {
        Self {
            group: group.to_owned(),
            ..self
        }
    }

    /// The chart, small.
    pub fn small(self) -> Self {
        Self {
            size: Size::Small,
            ..self
        }
    }
}
