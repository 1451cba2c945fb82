//! Obstacles for drawn scenarios.

use formation_generate::Random;
use formation_model::{RawArea, RawScenario};

/// The most obstacles of a scenario.
const OBSTACLES_MAX: usize = 6;

/// How often a place is drawn for each.
const DRAWS_MAX: usize = 50;

/// From the middle of a start or a spot to the nearest side of an obstacle, in units: room for a body to turn and pass.
const CLEARANCE: f64 = 2.0;

/// Adds up to six obstacles, up to three units long, between and round the starts and spots.
pub(crate) fn add_obstacles(scenario: &mut RawScenario, random: &mut Random) {
    let grouped = scenario.configurations.iter().flat_map(|it| &it.modules);
    let modules = grouped.chain(&scenario.singletons);
    let places: Vec<(f64, f64)> = modules
        .map(|module| (module.x, module.y))
        .chain(scenario.target.spots.iter().map(|spot| (spot.x, spot.y)))
        .collect();
    let (xs, ys) = places.iter().copied().unzip();
    let (x_range, y_range) = (range(xs), range(ys));
    let clears = |area: &RawArea| {
        places.iter().all(|&(x, y)| {
            let beyond = |along: f64, extent: f64| (along.abs() - extent / 2.0).max(0.0);
            let (x, y) = (
                beyond(x - area.x, area.width),
                beyond(y - area.y, area.height),
            );
            x.hypot(y) >= CLEARANCE
        })
    };
    for _ in 0..=random.index(OBSTACLES_MAX) {
        let drawn = (0..DRAWS_MAX).find_map(|_| {
            let mut extent = || 1.0 + random.index(3) as f64;
            let (width, height) = (extent(), extent());
            let mut within =
                |(low, high): (f64, f64)| low + (high - low) * random.index(1_001) as f64 / 1_000.0;
            let area = RawArea {
                x: within(x_range),
                y: within(y_range),
                width,
                height,
            };
            clears(&area).then_some(area)
        });
        scenario.obstacles.extend(drawn);
    }
}

/// The least and the greatest value.
fn range(values: Vec<f64>) -> (f64, f64) {
    let low = values.iter().copied().fold(f64::INFINITY, f64::min);
    let high = values.into_iter().fold(f64::NEG_INFINITY, f64::max);
    (low, high)
}
