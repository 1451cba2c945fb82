//! Plots as data; [`draw`] makes SVG of them.

mod axis;
mod draw;
mod path;

pub(crate) use axis::Axis;
pub(crate) use draw::draw;

use crate::contender::Contender;

/// One picture: panels, each with a legend below it.
#[derive(Clone, Debug)]
pub(crate) struct Plot {
    pub title: String,
    pub panels: Vec<Panel>,
}

/// One coordinate system.
#[derive(Clone, Debug)]
pub(crate) struct Panel {
    /// What the panel shows, above it; empty if the plot's title says it.
    pub title: String,
    pub x: Axis,
    pub y: Axis,
    pub series: Vec<Series>,
}

/// One curve, or one set of points.
#[derive(Clone, Debug)]
pub(crate) struct Series {
    /// Its entry in the legend; none if empty.
    pub name: String,
    pub look: Look,
    /// x, y and the standard deviation of y, which is drawn as a bar.
    pub points: Vec<Point>,
}

/// One point with its deviation, 0 for none.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Point {
    pub x: f64,
    pub y: f64,
    pub deviation: f64,
}

impl Point {
    pub(crate) fn new(x: f64, y: f64) -> Self {
        Self {
            x,
            y,
            deviation: 0.0,
        }
    }
}

/// How a series looks: colour and marker tell the same, so that neither is needed alone.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Look {
    pub colour: (u8, u8, u8),
    pub opacity: f64,
    pub marker: Marker,
    /// A marker on the last point and on every so many before it.
    pub marker_every: usize,
    pub line: Line,
}

/// The shape of a point.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Marker {
    None,
    Circle,
    Square,
    Triangle,
    Diamond,
    Cross,
    Ring,
}

/// How points are joined.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Line {
    None,
    Solid,
    Dashed,
    Dotted,
    Thin,
}

/// Colours that people with any kind of colour vision tell apart (M. Okabe and K. Ito, "Color Universal Design").
pub(crate) mod colour {
    pub(crate) const BLACK: (u8, u8, u8) = (0, 0, 0);
    pub(crate) const ORANGE: (u8, u8, u8) = (230, 159, 0);
    pub(crate) const SKY: (u8, u8, u8) = (86, 180, 233);
    pub(crate) const GREEN: (u8, u8, u8) = (0, 158, 115);
    pub(crate) const BLUE: (u8, u8, u8) = (0, 114, 178);
    pub(crate) const VERMILION: (u8, u8, u8) = (213, 94, 0);
    pub(crate) const PURPLE: (u8, u8, u8) = (204, 121, 167);
}

impl Look {
    /// A solid line with markers.
    pub(crate) fn new(colour: (u8, u8, u8), marker: Marker) -> Self {
        Self {
            colour,
            opacity: 1.0,
            marker,
            marker_every: 1,
            line: Line::Solid,
        }
    }

    /// What the paper states: points without a line.
    pub(crate) fn stated() -> Self {
        Self {
            line: Line::None,
            ..Self::new(colour::BLACK, Marker::Diamond)
        }
    }

    pub(crate) fn with_line(self, line: Line) -> Self {
        Self { line, ..self }
    }

    pub(crate) fn with_marker_every(self, marker_every: usize) -> Self {
        Self {
            marker_every,
            ..self
        }
    }

    /// The look of number `position` of `count` ordered series: a ramp from dark to light, as in the map "viridis", and
    /// markers in turn.
    pub(crate) fn of_step(position: usize, count: usize) -> Self {
        const RAMP: [(u8, u8, u8); 6] = [
            (68, 1, 84),
            (65, 68, 135),
            (42, 120, 142),
            (34, 168, 132),
            (122, 199, 70),
            (214, 196, 20),
        ];
        const MARKERS: [Marker; 6] = [
            Marker::Circle,
            Marker::Square,
            Marker::Triangle,
            Marker::Diamond,
            Marker::Ring,
            Marker::Cross,
        ];
        let steps = count.saturating_sub(1).max(1);
        let place = position.min(steps) * (RAMP.len() - 1);
        let (from, part) = (place / steps, place % steps);
        let to = (from + 1).min(RAMP.len() - 1);
        let mix = |one: u8, other: u8| {
            let mixed = usize::from(one) * (steps - part) + usize::from(other) * part;
            u8::try_from(mixed / steps).unwrap_or(u8::MAX)
        };
        let ((r, g, b), (r2, g2, b2)) = (RAMP[from], RAMP[to]);
        Self::new(
            (mix(r, r2), mix(g, g2), mix(b, b2)),
            MARKERS[position % MARKERS.len()],
        )
    }
}

impl Contender {
    /// The same look in every plot.
    pub(crate) fn look(self) -> Look {
        match self {
            Self::PaperPolicy => Look::new(colour::VERMILION, Marker::Square),
            Self::Ours => Look::new(colour::BLUE, Marker::Circle),
            Self::OursSizeFirst => Look::new(colour::SKY, Marker::Triangle),
            Self::Auction => Look::new(colour::ORANGE, Marker::Cross).with_line(Line::Dashed),
            Self::Hungarian => Look::new(colour::GREEN, Marker::Ring).with_line(Line::Dotted),
        }
    }

    /// Its curve through these points.
    pub(crate) fn series(self, points: Vec<Point>) -> Series {
        Series {
            name: self.label().to_owned(),
            look: self.look(),
            points,
        }
    }
}
