//! Drawing plots as SVG.

use std::error::Error;
use std::ops::Range;

use plotters::coord::Shift;
use plotters::coord::ranged1d::{KeyPointHint, NoDefaultFormatting, Ranged, ValueFormatter};
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

use super::axis::Scale;
use super::{Line, Look, Marker, Panel, Plot, Series};

const PANEL_WIDTH: u32 = 560;
const PANEL_HEIGHT: u32 = 380;
const TITLE_HEIGHT: u32 = 40;
const LEGEND_MARGIN: u32 = 8;
const LEGEND_ROW_HEIGHT: u32 = 22;
const LEGEND_COLUMN_WIDTH: i32 = 180;
const LEGEND_LEFT: i32 = 70;
const FONT: &str = "sans-serif";
const GREY: RGBColor = RGBColor(90, 90, 90);
const GRID: RGBColor = RGBColor(225, 225, 225);

type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;
type Drawn = Result<(), Box<dyn Error>>;
type Coordinates = Cartesian2d<Scale, Scale>;
type Chart<'a, 'b> = ChartContext<'a, SVGBackend<'b>, Coordinates>;

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
    // Four panels make a square; other numbers stand beside each other.
    let columns = match plot.panels.len() {
        4 => 2,
        count => count.max(1),
    };
    let rows = plot.panels.len().div_ceil(columns).max(1);
    let legend_rows = plot.panels.iter().map(legend_rows).max().unwrap_or(0);
    let row_height = PANEL_HEIGHT + LEGEND_MARGIN + legend_rows * LEGEND_ROW_HEIGHT + 12;
    let size = (
        u32::try_from(columns)? * PANEL_WIDTH,
        TITLE_HEIGHT + u32::try_from(rows)? * row_height,
    );
    let mut text = String::new();
    {
        let root = SVGBackend::with_string(&mut text, size).into_drawing_area();
        root.fill(&WHITE)?;
        let title = TextStyle::from((FONT, 18).into_font())
            .color(&BLACK)
            .pos(Pos::new(HPos::Center, VPos::Top));
        let middle = i32::try_from(size.0 / 2).unwrap_or_default();
        root.draw(&Text::new(plot.title.clone(), (middle, 12), title))?;
        let (_, below) = root.split_vertically(TITLE_HEIGHT);
        let areas = below.split_evenly((rows, columns));
        for (panel, area) in plot.panels.iter().zip(&areas) {
            let (chart, legend) = area.split_vertically(PANEL_HEIGHT);
            draw_panel(panel, &chart)?;
            let (_, legend) = legend.split_vertically(LEGEND_MARGIN);
            draw_legend(panel, &legend)?;
        }
        root.present()?;
    }
    Ok(text)
}

fn legend_columns() -> usize {
    let room = i32::try_from(PANEL_WIDTH).unwrap_or_default() - LEGEND_LEFT;
    usize::try_from(room / LEGEND_COLUMN_WIDTH)
        .unwrap_or(1)
        .max(1)
}

fn legend_entries(panel: &Panel) -> impl Iterator<Item = &Series> {
    panel.series.iter().filter(|series| !series.name.is_empty())
}

/// Long names get a row of their own.
fn legend_is_wide(panel: &Panel) -> bool {
    legend_entries(panel).any(|series| series.name.chars().count() > 20)
}

fn legend_rows(panel: &Panel) -> u32 {
    let columns = if legend_is_wide(panel) {
        1
    } else {
        legend_columns()
    };
    let entries = legend_entries(panel).count();
    u32::try_from(entries.div_ceil(columns)).unwrap_or_default()
}

fn draw_panel(panel: &Panel, area: &Area<'_>) -> Drawn {
    let x = panel.x.scale(&panel.series, |point| (point.x, 0.0));
    let y = panel
        .y
        .scale(&panel.series, |point| (point.y, point.deviation));
    let mut builder = ChartBuilder::on(area);
    builder
        .margin_top(8)
        .margin_right(24)
        .margin_left(10)
        .set_label_area_size(LabelAreaPosition::Bottom, 48)
        .set_label_area_size(LabelAreaPosition::Left, 80);
    if !panel.title.is_empty() {
        builder.caption(&panel.title, (FONT, 15));
    }
    let mut chart = builder.build_cartesian_2d(x.clone(), y.clone())?;
    chart
        .configure_mesh()
        .x_desc(panel.x.label.clone())
        .y_desc(panel.y.label.clone())
        .x_labels(x.ticks.len())
        .y_labels(y.ticks.len())
        .axis_desc_style((FONT, 14))
        .label_style((FONT, 12))
        .axis_style(GREY)
        .bold_line_style(GRID)
        .light_line_style(TRANSPARENT)
        .draw()?;
    for series in &panel.series {
        draw_series(series, &mut chart, &x, &y)?;
        draw_markers(series, &chart, &x, &y, area)?;
    }
    Ok(())
}

fn draw_series(series: &Series, chart: &mut Chart<'_, '_>, x: &Scale, y: &Scale) -> Drawn {
    let look = series.look;
    let colour = colour_of(look);
    let places: Vec<(f64, f64)> = series
        .points
        .iter()
        .map(|point| (x.place(point.x), y.place(point.y)))
        .collect();
    match look.line {
        Line::None => {}
        Line::Solid | Line::Thin => {
            let width = if look.line == Line::Thin { 1 } else { 2 };
            let style = colour.stroke_width(width);
            chart.draw_series(std::iter::once(PathElement::new(places.clone(), style)))?;
        }
        Line::Dashed | Line::ThinDashed => {
            let width = if look.line == Line::Dashed { 2 } else { 1 };
            let style = colour.stroke_width(width);
            chart.draw_series(DashedLineSeries::new(places.clone(), 6, 4, style))?;
        }
    }
    for point in series.points.iter().filter(|point| point.deviation > 0.0) {
        let place = x.place(point.x);
        let ends = [point.y - point.deviation, point.y + point.deviation];
        let bar = ends.map(|end| (place, y.place(end))).to_vec();
        chart.draw_series(std::iter::once(PathElement::new(bar, colour.mix(0.5))))?;
    }
    Ok(())
}

/// Draws on the whole panel, so that markers at the edges of the plotting area are not cut.
fn draw_markers(
    series: &Series,
    chart: &Chart<'_, '_>,
    x: &Scale,
    y: &Scale,
    panel: &Area<'_>,
) -> Drawn {
    let panel = panel.use_screen_coord();
    for point in series
        .points
        .iter()
        .step_by(series.look.marker_every.max(1))
    {
        let at = chart.backend_coord(&(x.place(point.x), y.place(point.y)));
        draw_marker(series.look, at, &panel)?;
    }
    Ok(())
}

fn colour_of(look: Look) -> RGBAColor {
    let (red, green, blue) = look.colour;
    RGBColor(red, green, blue).mix(look.opacity)
}

fn draw_legend(panel: &Panel, area: &Area<'_>) -> Drawn {
    let wide = legend_is_wide(panel);
    let columns = if wide { 1 } else { legend_columns() };
    let row_height = i32::try_from(LEGEND_ROW_HEIGHT)?;
    for (number, series) in legend_entries(panel).enumerate() {
        let left = LEGEND_LEFT + LEGEND_COLUMN_WIDTH * i32::try_from(number % columns)?;
        let middle = row_height * i32::try_from(number / columns)? + row_height / 2;
        let look = Look {
            opacity: 1.0,
            ..series.look
        };
        let colour = colour_of(look);
        let ends = vec![(left, middle), (left + 28, middle)];
        match series.look.line {
            Line::None => {}
            Line::Solid => area.draw(&PathElement::new(ends, colour.stroke_width(2)))?,
            Line::Thin => area.draw(&PathElement::new(ends, colour.stroke_width(1)))?,
            Line::Dashed | Line::ThinDashed => {
                let width = if series.look.line == Line::Dashed {
                    2
                } else {
                    1
                };
                for start in [left, left + 10, left + 20] {
                    let dash = vec![(start, middle), (start + 6, middle)];
                    area.draw(&PathElement::new(dash, colour.stroke_width(width)))?;
                }
            }
        }
        draw_marker(look, (left + 14, middle), area)?;
        let style = TextStyle::from((FONT, 13).into_font())
            .color(&BLACK)
            .pos(Pos::new(HPos::Left, VPos::Center));
        area.draw(&Text::new(series.name.clone(), (left + 36, middle), style))?;
    }
    Ok(())
}

fn draw_marker(look: Look, (x, y): (i32, i32), area: &Area<'_>) -> Drawn {
    let colour = colour_of(look);
    let fill = colour.filled();
    match look.marker {
        Marker::None => {}
        Marker::Circle => area.draw(&Circle::new((x, y), 4, fill))?,
        Marker::Ring => area.draw(&Circle::new((x, y), 4, colour.stroke_width(2)))?,
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
