//! Drawing plots as SVG.

use std::error::Error;
use std::ops::Range;

use plotters::coord::Shift;
use plotters::coord::ranged1d::{KeyPointHint, NoDefaultFormatting, Ranged, ValueFormatter};
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

use super::axis::{HEADROOM, Scale};
use super::path::{Dashes, Pixel, dashed, thinned};
use super::{Line, Look, Marker, Panel, Plot, Series};

/// The width and height of a panel that stands alone, and of one of several. Two beside each other are as wide as the
/// column in which web pages show them, so that their text stays readable.
const ONE_PANEL: (u32, u32) = (640, 380);
const ONE_OF_PANELS: (u32, u32) = (440, 330);
const TITLE_HEIGHT: u32 = 40;
const CAPTION_HEIGHT: u32 = 30;
const LEGEND_MARGIN: u32 = 8;
const LEGEND_ROW_HEIGHT: u32 = 22;
const LEGEND_LEFT: i32 = 24;
/// The line and the marker of an entry, with the gap to its name and to the next entry.
const LEGEND_SAMPLE: u32 = 66;
const FONT: &str = "sans-serif";
// The drawing library writes sizes divided by 1.24 into the file.
const TITLE_SIZE: u32 = 20;
const CAPTION_SIZE: u32 = 18;
const AXIS_SIZE: u32 = 17;
const LEGEND_SIZE: u32 = 16;
const TICK_SIZE: u32 = 15;
/// About the widths of a letter in a legend and of a digit at a tick.
const LETTER_WIDTH: u32 = 7;
const DIGIT_WIDTH: u32 = 8;
/// Bars of neighbouring series stand this far apart, as they would hide each other, but none stands further from its marker
/// than the marker is wide.
const BAR_STEP: i32 = 3;
const BAR_ASIDE_MAX: i32 = 4;
const GREY: RGBColor = RGBColor(90, 90, 90);
const GRID: RGBColor = RGBColor(225, 225, 225);

type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;
type Drawn = Result<(), Box<dyn Error>>;

impl Ranged for Scale {
    type FormatOption = NoDefaultFormatting;
    type ValueType = f64;

    fn map(&self, place: &f64, limit: (i32, i32)) -> i32 {
        let share = (place - self.from) / (self.to - self.from);
        limit.0 + (share * f64::from(limit.1 - limit.0)).round() as i32
    }

    fn key_points<Hint: KeyPointHint>(&self, _: Hint) -> Vec<f64> {
        self.ticks.iter().map(|tick| tick.0).collect()
    }

    fn range(&self) -> Range<f64> {
        self.from..self.to
    }
}

impl ValueFormatter<f64> for Scale {
    fn format(place: &f64) -> String {
        place.to_string()
    }

    fn format_ext(&self, place: &f64) -> String {
        self.name(*place)
    }
}

impl From<Scale> for Range<f64> {
    fn from(scale: Scale) -> Self {
        scale.from..scale.to
    }
}

/// Draws a plot; the text is the SVG file's.
///
/// # Errors
/// Passes on what the drawing library says.
pub(crate) fn draw(plot: &Plot) -> Result<String, Box<dyn Error>> {
    let columns = plot.panels.len().clamp(1, 2);
    let rows = plot.panels.len().div_ceil(columns).max(1);
    let (width, height) = if columns == 1 {
        ONE_PANEL
    } else {
        ONE_OF_PANELS
    };
    let full_width = u32::try_from(columns)? * width;
    let shared = shared_legend(&plot.panels);
    let legend_height = |panel: &Panel, width| LEGEND_MARGIN + 12 + legend_height(panel, width);
    let (under_panels, under_all) = match shared {
        Some(panel) => (12, legend_height(panel, full_width)),
        None => {
            let heights = plot.panels.iter().map(|panel| legend_height(panel, width));
            (heights.max().unwrap_or(0), 0)
        }
    };
    let panels_height = u32::try_from(rows)? * (height + under_panels);
    let size = (full_width, TITLE_HEIGHT + panels_height + under_all);
    let mut text = String::new();
    {
        let root = SVGBackend::with_string(&mut text, size).into_drawing_area();
        root.fill(&WHITE)?;
        draw_heading(&plot.title, TITLE_SIZE, 12, &root)?;
        let (_, below) = root.split_vertically(TITLE_HEIGHT);
        let (panels, below) = below.split_vertically(panels_height);
        let areas = panels.split_evenly((rows, columns));
        for (panel, area) in plot.panels.iter().zip(&areas) {
            let (chart, legend) = area.split_vertically(height);
            draw_panel(panel, &chart)?;
            if shared.is_none() {
                let (_, legend) = legend.split_vertically(LEGEND_MARGIN);
                draw_legend(panel, &legend, width)?;
            }
        }
        if let Some(panel) = shared {
            let (_, legend) = below.split_vertically(LEGEND_MARGIN);
            draw_legend(panel, &legend, full_width)?;
        }
        root.present()?;
    }
    Ok(text)
}

/// A line of text in the middle of an area.
fn draw_heading(text: &str, size: u32, top: i32, area: &Area<'_>) -> Drawn {
    let style = TextStyle::from((FONT, size).into_font())
        .color(&BLACK)
        .pos(Pos::new(HPos::Center, VPos::Top));
    let middle = i32::try_from(area.dim_in_pixel().0 / 2)?;
    area.draw(&Text::new(text.to_owned(), (middle, top), style))?;
    Ok(())
}

fn legend_entries(panel: &Panel) -> impl Iterator<Item = &Series> {
    panel.series.iter().filter(|series| !series.name.is_empty())
}

/// A panel whose legend is that of all panels, if there are several.
fn shared_legend(panels: &[Panel]) -> Option<&Panel> {
    let (first, others) = panels.split_first()?;
    let entries = |panel| legend_entries(panel).map(|series| (&series.name, series.look));
    let same = others.iter().all(|panel| entries(panel).eq(entries(first)));
    (!others.is_empty() && same).then_some(first)
}

/// How many entries stand beside each other, and how wide each is.
fn legend_columns(panel: &Panel, width: u32) -> (usize, i32) {
    let letters = legend_entries(panel).map(|series| series.name.chars().count());
    let letters = u32::try_from(letters.max().unwrap_or(0)).unwrap_or(u32::MAX);
    let column = LEGEND_SAMPLE.saturating_add(letters.saturating_mul(LETTER_WIDTH));
    let columns = width.saturating_sub(LEGEND_LEFT.unsigned_abs()) / column;
    (
        usize::try_from(columns).unwrap_or(1).max(1),
        i32::try_from(column).unwrap_or_default(),
    )
}

fn legend_height(panel: &Panel, width: u32) -> u32 {
    let (columns, _) = legend_columns(panel, width);
    let rows = legend_entries(panel).count().div_ceil(columns);
    u32::try_from(rows).unwrap_or_default() * LEGEND_ROW_HEIGHT
}

fn draw_panel(panel: &Panel, area: &Area<'_>) -> Drawn {
    let x = panel.x.scale(&panel.series, 1.0, |point| (point.x, 0.0));
    let y = panel
        .y
        .scale(&panel.series, HEADROOM, |point| (point.y, point.deviation));
    // The caption stays clear of markers at the upper edge.
    let caption_height = if panel.title.is_empty() {
        0
    } else {
        draw_heading(&panel.title, CAPTION_SIZE, 4, area)?;
        CAPTION_HEIGHT
    };
    let (_, area) = area.split_vertically(caption_height);
    let letters = y.ticks.iter().map(|tick| tick.1.chars().count()).max();
    let tick_width = u32::try_from(letters.unwrap_or(0))? * DIGIT_WIDTH;
    let mut chart = ChartBuilder::on(&area)
        .margin_top(8)
        .margin_right(24)
        .margin_left(10)
        .set_label_area_size(LabelAreaPosition::Bottom, 52)
        .set_label_area_size(LabelAreaPosition::Left, tick_width + 32)
        .build_cartesian_2d(x.clone(), y.clone())?;
    chart
        .configure_mesh()
        .x_desc(panel.x.label.clone())
        .y_desc(panel.y.label.clone())
        .x_labels(x.ticks.len())
        .y_labels(y.ticks.len())
        .axis_desc_style((FONT, AXIS_SIZE))
        .label_style((FONT, TICK_SIZE))
        .axis_style(GREY)
        .bold_line_style(GRID)
        .light_line_style(TRANSPARENT)
        .draw()?;
    // Drawn on the whole panel, so that markers at the edges of the plotting area are not cut.
    let area = area.use_screen_coord();
    let count = i32::try_from(panel.series.len())?;
    for (number, series) in (0..).zip(&panel.series) {
        let pixel =
            |x_value: f64, y_value: f64| chart.backend_coord(&(x.place(x_value), y.place(y_value)));
        let aside = (2 * number + 1 - count) * BAR_STEP / 2;
        draw_bars(
            series,
            aside.clamp(-BAR_ASIDE_MAX, BAR_ASIDE_MAX),
            &pixel,
            &area,
        )?;
        let mut pixels: Vec<Pixel> = Vec::new();
        for point in &series.points {
            pixels.push(pixel(point.x, point.y));
        }
        draw_line(series.look, &thinned(&pixels), &area)?;
        let marked = pixels.iter().rev().step_by(series.look.marker_every.max(1));
        for &at in marked {
            draw_marker(series.look, at, &area)?;
        }
    }
    Ok(())
}

/// Standard deviations, moved aside by some pixels.
fn draw_bars(
    series: &Series,
    aside: i32,
    pixel: &impl Fn(f64, f64) -> Pixel,
    area: &Area<'_>,
) -> Drawn {
    for point in series.points.iter().filter(|point| point.deviation > 0.0) {
        let ends = [point.y - point.deviation, point.y + point.deviation];
        let bar = ends.map(|end| {
            let (across, down) = pixel(point.x, end);
            (across + aside, down)
        });
        let style = colour_of(series.look).mix(0.6);
        area.draw(&PathElement::new(bar.to_vec(), style))?;
    }
    Ok(())
}

fn draw_line(look: Look, path: &[Pixel], area: &Area<'_>) -> Drawn {
    // Lines that lie on each other all show, as dots fall into the gaps between dashes.
    let (width, dashes) = match look.line {
        Line::None => return Ok(()),
        Line::Solid => (2, None),
        Line::Thin => (1, None),
        Line::Dashed => (2, Some((0.0, 6.0))),
        Line::Dotted => (2, Some((7.5, 10.5))),
    };
    let pieces = match dashes {
        None => vec![path.to_vec()],
        Some((from, to)) => dashed(
            path,
            Dashes {
                period: 12.0,
                from,
                to,
            },
        ),
    };
    for piece in pieces {
        let style = colour_of(look).stroke_width(width);
        area.draw(&PathElement::new(piece, style))?;
    }
    Ok(())
}

fn colour_of(look: Look) -> RGBAColor {
    let (red, green, blue) = look.colour;
    RGBColor(red, green, blue).mix(look.opacity)
}

fn draw_legend(panel: &Panel, area: &Area<'_>, width: u32) -> Drawn {
    let (columns, column_width) = legend_columns(panel, width);
    let row_height = i32::try_from(LEGEND_ROW_HEIGHT)?;
    for (number, series) in legend_entries(panel).enumerate() {
        let left = LEGEND_LEFT + column_width * i32::try_from(number % columns)?;
        let middle = row_height * i32::try_from(number / columns)? + row_height / 2;
        let look = Look {
            opacity: 1.0,
            ..series.look
        };
        draw_line(look, &[(left, middle), (left + 42, middle)], area)?;
        draw_marker(look, (left + 21, middle), area)?;
        let style = TextStyle::from((FONT, LEGEND_SIZE).into_font())
            .color(&BLACK)
            .pos(Pos::new(HPos::Left, VPos::Center));
        area.draw(&Text::new(series.name.clone(), (left + 50, middle), style))?;
    }
    Ok(())
}

fn draw_marker(look: Look, (x, y): (i32, i32), area: &Area<'_>) -> Drawn {
    let colour = colour_of(look);
    let fill = colour.filled();
    match look.marker {
        Marker::None => {}
        Marker::Circle => area.draw(&Circle::new((x, y), 4, fill))?,
        // Wide enough to be seen around a circle.
        Marker::Ring => area.draw(&Circle::new((x, y), 6, colour.stroke_width(2)))?,
        Marker::Square => {
            area.draw(&Rectangle::new([(x - 4, y - 4), (x + 4, y + 4)], fill))?;
        }
        Marker::Triangle => {
            let corners = vec![(x, y - 5), (x + 5, y + 4), (x - 5, y + 4)];
            area.draw(&Polygon::new(corners, fill))?;
        }
        Marker::Diamond => {
            let corners = vec![(x, y - 6), (x + 6, y), (x, y + 6), (x - 6, y)];
            area.draw(&Polygon::new(corners, fill))?;
        }
        Marker::Cross => {
            let style = colour.stroke_width(2);
            area.draw(&PathElement::new(
                vec![(x - 4, y - 4), (x + 4, y + 4)],
                style,
            ))?;
            area.draw(&PathElement::new(
                vec![(x - 4, y + 4), (x + 4, y - 4)],
                style,
            ))?;
        }
    }
    Ok(())
}
