//! Occupancy maps as `nav2_map_server` and SLAM programs of ROS 2 save them: a YAML file that names an image.
//!
//! The format is documented with `nav2_map_server`: a pixel's darkness (its lightness with `negate`) is the probability that it
//! is occupied. Above `occupied_thresh` it is, below `free_thresh` it is free, and in between it is unknown.

use std::path::Path;

use anyhow::{Context, anyhow, ensure};
use formation_model::ModuleSize;
use image::{ImageReader, Limits};
use serde::Deserialize;

use super::grid::Grid;

/// The greatest width and height of an image, in pixels.
const SIDE_MAX: u32 = 16_384;

/// A pixel that reaches less far than this into a cell, in units, only touches it.
const TOUCH: f64 = 1e-6;

/// The YAML file. Further keys are those of other programs.
#[derive(Debug, Deserialize)]
struct MapFile {
    image: String,
    resolution: f64,
    origin: [f64; 3],
    #[serde(default)]
    negate: u8,
    #[serde(default = "occupied_by_default")]
    occupied_thresh: f64,
    #[serde(default = "free_by_default")]
    free_thresh: f64,
    #[serde(default)]
    mode: Mode,
}

/// What the value of a pixel means.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
enum Mode {
    #[default]
    Trinary,
    Scale,
    /// A percentage; unknown above 100.
    Raw,
}

fn occupied_by_default() -> f64 {
    0.65
}

fn free_by_default() -> f64 {
    0.25
}

impl MapFile {
    /// Whether a module may enter a pixel of this value.
    fn is_open(&self, value: u8, unknown_is_free: bool) -> bool {
        let occupied = match self.mode {
            Mode::Raw if value > 100 => return unknown_is_free,
            Mode::Raw => f64::from(value) / 100.0,
            _ if self.negate == 0 => f64::from(255 - value) / 255.0,
            _ => f64::from(value) / 255.0,
        };
        match unknown_is_free {
            true => occupied <= self.occupied_thresh,
            false => occupied < self.free_thresh,
        }
    }
}

/// Reads a map, whose image is looked for next to `path`. A cell is closed if a pixel that is occupied reaches into it, or one that is unknown unless those are free.
///
/// # Errors
/// Says what is wrong with the YAML file or its image.
pub fn read(
    path: &Path,
    text: &str,
    size: ModuleSize,
    unknown_is_free: bool,
) -> anyhow::Result<Grid> {
    let file: MapFile = serde_yaml::from_str(text).context("is no map of ROS 2")?;
    ensure!(
        file.resolution.is_finite() && file.resolution > 0.0,
        "resolution: must be a positive number of metres, got {}",
        file.resolution
    );
    let [x, y, yaw] = file.origin;
    ensure!(
        [x, y, yaw].iter().all(|number| number.abs() < 1e6),
        "origin: must be three numbers below a million"
    );
    ensure!(
        yaw == 0.0,
        "origin: the map is turned by {yaw}; only maps along the axes of their frame can be read"
    );
    let image_path = path.parent().unwrap_or(Path::new("")).join(&file.image);
    let pixels = read_image(&image_path).with_context(|| format!("image {}", file.image))?;
    let pitch = size.metres();
    let to_cells = |metres: f64| metres / pitch;
    let along = |from: f64, count: u32| {
        // The cells that lie within the image.
        let low = (to_cells(from) + 0.5 - TOUCH).ceil();
        let high = (to_cells(from + file.resolution * f64::from(count)) - 0.5 + TOUCH).floor();
        let extent = (high - low + 1.0).max(0.0);
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "both are bounded"
        )]
        (low as i64, extent as usize)
    };
    let (left, width) = along(x, pixels.width());
    let (bottom, height) = along(y, pixels.height());
    let mut grid = Grid::open((left, bottom), width, height)?;
    let reached = |from: f64, index: u32| {
        let low = to_cells(from + file.resolution * f64::from(index));
        let high = to_cells(from + file.resolution * f64::from(index + 1));
        #[expect(clippy::cast_possible_truncation, reason = "coordinates are bounded")]
        let cells = (
            (low + 0.5 + TOUCH).floor() as i64,
            (high + 0.5 - TOUCH).ceil() as i64 - 1,
        );
        cells
    };
    for (column, row, pixel) in pixels.enumerate_pixels() {
        if file.is_open(pixel.0[0], unknown_is_free) {
            continue;
        }
        // The image's first row is the top one.
        let (first, last) = reached(x, column);
        let (lowest, highest) = reached(y, pixels.height() - 1 - row);
        for cell in (first..=last).flat_map(|x| (lowest..=highest).map(move |y| (x, y))) {
            grid.close(cell);
        }
    }
    Ok(grid)
}

fn read_image(path: &Path) -> anyhow::Result<image::GrayImage> {
    let mut limits = Limits::default();
    (limits.max_image_width, limits.max_image_height) = (Some(SIDE_MAX), Some(SIDE_MAX));
    let mut reader = ImageReader::open(path)?.with_guessed_format()?;
    reader.limits(limits);
    let format = reader
        .format()
        .ok_or_else(|| anyhow!("is neither PGM nor PNG"))?;
    ensure!(
        matches!(format, image::ImageFormat::Pnm | image::ImageFormat::Png),
        "is neither PGM nor PNG"
    );
    Ok(reader.decode()?.to_luma8())
}
