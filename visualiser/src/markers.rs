//! The shapes of a picture.

use std::collections::BTreeMap;

use formation_model::{BODY_WIDTH, ModuleId, ModulePhase, ModuleSize, Pose, Surroundings};
use formation_msgs::Header;
use formation_msgs::external::geometry_msgs::{self, Point, Vector3};
use formation_msgs::external::std_msgs::ColorRGBA;
use formation_msgs::external::visualization_msgs::{Marker, MarkerArray};

use crate::scene::{DrawnScene, Figure};

const MODULE_HEIGHT: f64 = 0.3;
const LABEL_HEIGHT: f64 = 0.35;
const LINE_WIDTH: f64 = 0.05;
/// Links are drawn thicker than edges of the target that nobody has docked yet.
const LINK_WIDTH: f64 = 0.15;

const GREY: ColorRGBA = colour(0.5, 0.5, 0.5, 0.6);
const DARK_GREY: ColorRGBA = colour(0.25, 0.25, 0.28, 1.0);
const WHITE: ColorRGBA = colour(1.0, 1.0, 1.0, 1.0);
/// Single modules.
const PALE_BLUE: ColorRGBA = colour(0.7, 0.8, 1.0, 1.0);

const fn colour(r: f32, g: f32, b: f32, a: f32) -> ColorRGBA {
    ColorRGBA { r, g, b, a }
}

const fn scale(x: f64, y: f64, z: f64) -> Vector3 {
    Vector3 { x, y, z }
}

/// A picture of the whole scene in units; it replaces the one before.
pub(crate) fn of(scene: &DrawnScene, header: &Header, labels: bool) -> MarkerArray {
    let figures: BTreeMap<ModuleId, Figure<'_>> = scene.figures().collect();
    let target = scene.target();
    let width = target.map_or(BODY_WIDTH, |target| target.surroundings().body_width());
    let is_round = target.is_some_and(|target| target.surroundings().body().is_round());
    let mut picture = Picture {
        header,
        width: width.to_units(),
        is_round,
        figures: &figures,
        markers: vec![Marker {
            header: header.clone(),
            action: Marker::DELETEALL,
            ..Marker::default()
        }],
    };
    picture.draw_target(scene, labels);
    picture.draw_links();
    picture.draw_claims(scene);
    for (&module, figure) in &figures {
        picture.draw_trail(module, figure);
        picture.draw_module(module, figure, labels);
    }
    MarkerArray {
        markers: picture.markers,
    }
}

struct Picture<'a> {
    header: &'a Header,
    /// The width of a body.
    width: f64,
    is_round: bool,
    figures: &'a BTreeMap<ModuleId, Figure<'a>>,
    markers: Vec<Marker>,
}

impl Picture<'_> {
    fn add(&mut self, ns: &str, id: u32, marker: Marker) {
        self.markers.push(Marker {
            header: self.header.clone(),
            ns: ns.to_owned(),
            // Markers count in signed numbers; wrapping keeps different ones different.
            id: i32::from_ne_bytes(id.to_ne_bytes()),
            action: Marker::ADD,
            ..marker
        });
    }

    /// Lines of one width, each with a colour of its own.
    fn add_lines(&mut self, ns: &str, width: f64, lines: &[([Point; 2], ColorRGBA)]) {
        if lines.is_empty() {
            return;
        }
        self.add(
            ns,
            0,
            Marker {
                r#type: Marker::LINE_LIST,
                scale: scale(width, 0.0, 0.0),
                color: WHITE,
                points: lines.iter().flat_map(|(ends, _)| *ends).collect(),
                colors: lines.iter().flat_map(|(_, colour)| [*colour; 2]).collect(),
                ..Marker::default()
            },
        );
    }

    fn add_label(&mut self, ns: &str, id: u32, pose: &Pose, height: f64, colour: ColorRGBA) {
        let mut pose = in_units(pose);
        pose.position.z = height;
        self.add(
            ns,
            id,
            Marker {
                r#type: Marker::TEXT_VIEW_FACING,
                pose,
                scale: scale(0.0, 0.0, LABEL_HEIGHT),
                color: colour,
                text: id.to_string(),
                ..Marker::default()
            },
        );
    }

    /// The outline of each spot, in the colour of its holder, and the edges between them.
    fn draw_target(&mut self, scene: &DrawnScene, labels: bool) {
        let Some(target) = scene.target() else {
            return;
        };
        self.draw_surroundings(target.surroundings());
        let mut outlines = Vec::new();
        let mut edges = Vec::new();
        for spot in target.spots() {
            let holder = scene.holders().get(&spot.id);
            let holder = holder.and_then(|module| self.figures.get(module));
            let colour = holder.map_or(GREY, colour_of);
            let corners = match self.is_round {
                true => points_around(&spot.pose, self.width),
                false => corners_of(&spot.pose, self.width).into(),
            };
            for (index, corner) in corners.iter().enumerate() {
                outlines.push(([*corner, corners[(index + 1) % corners.len()]], colour));
            }
            for other in target
                .neighbours_of(spot.id)
                .filter(|&other| other > spot.id)
            {
                if let Some(other) = target.spot(other) {
                    edges.push(([point(&spot.pose, 0.0), point(&other.pose, 0.0)], GREY));
                }
            }
            if labels {
                self.add_label("spot_labels", spot.id.0, &spot.pose, 0.0, GREY);
            }
        }
        self.add_lines("target_spots", LINE_WIDTH, &outlines);
        self.add_lines("target_edges", LINE_WIDTH, &edges);
    }

    /// A block for each obstacle, and a line along the walls.
    fn draw_surroundings(&mut self, surroundings: &Surroundings) {
        for (id, obstacle) in (0..).zip(surroundings.obstacles()) {
            let area = obstacle.to_raw();
            let mut pose = geometry_msgs::Pose::default();
            (pose.position.x, pose.position.y) = (area.x, area.y);
            pose.position.z = MODULE_HEIGHT / 2.0;
            self.add(
                "obstacles",
                id,
                Marker {
                    r#type: Marker::CUBE,
                    pose,
                    scale: scale(area.width, area.height, MODULE_HEIGHT),
                    color: DARK_GREY,
                    ..Marker::default()
                },
            );
        }
        let Some(walls) = surroundings.arena() else {
            return;
        };
        let (low, high) = (walls.low, walls.high);
        let corners = [low, (high.0, low.1), high, (low.0, high.1), low];
        let points = corners.map(|(x, y)| Point {
            x: x.to_units(),
            y: y.to_units(),
            z: 0.0,
        });
        let lines = points
            .windows(2)
            .map(|ends| ([ends[0], ends[1]], DARK_GREY));
        self.add_lines("arena", LINE_WIDTH, &lines.collect::<Vec<_>>());
    }

    /// A line between two docked modules; pale while only one of them says so.
    fn draw_links(&mut self) {
        let mut links = Vec::new();
        for (&module, figure) in self.figures {
            for &other in &figure.snapshot.links {
                let Some(end) = self.figures.get(&other) else {
                    continue;
                };
                let mutual = end.snapshot.links.contains(&module);
                if mutual && other < module {
                    continue;
                }
                let ends = [
                    point(&figure.snapshot.pose, MODULE_HEIGHT),
                    point(&end.snapshot.pose, MODULE_HEIGHT),
                ];
                links.push((ends, if mutual { WHITE } else { GREY }));
            }
        }
        self.add_lines("links", LINK_WIDTH, &links);
    }

    /// A line from each module to the spot that it claims and does not stand on yet.
    fn draw_claims(&mut self, scene: &DrawnScene) {
        let Some(target) = scene.target() else {
            return;
        };
        let lines: Vec<_> = scene
            .holders()
            .iter()
            .filter_map(|(&spot, module)| {
                let figure = self.figures.get(module)?;
                if figure.snapshot.phase == ModulePhase::Settled {
                    return None;
                }
                let colour = ColorRGBA {
                    a: 0.5,
                    ..colour_of(figure)
                };
                let spot = target.spot(spot)?;
                Some((
                    [point(&figure.snapshot.pose, 0.0), point(&spot.pose, 0.0)],
                    colour,
                ))
            })
            .collect();
        self.add_lines("claims", LINE_WIDTH, &lines);
    }

    fn draw_trail(&mut self, module: ModuleId, figure: &Figure) {
        if figure.trail.len() < 2 {
            return;
        }
        let colour = ColorRGBA {
            a: 0.4,
            ..colour_of(figure)
        };
        self.add(
            "trails",
            module.0,
            Marker {
                r#type: Marker::LINE_STRIP,
                scale: scale(LINE_WIDTH, 0.0, 0.0),
                color: colour,
                points: figure.trail.iter().map(|pose| point(pose, 0.0)).collect(),
                ..Marker::default()
            },
        );
    }

    fn draw_module(&mut self, module: ModuleId, figure: &Figure, labels: bool) {
        let mut pose = in_units(&figure.snapshot.pose);
        pose.position.z = MODULE_HEIGHT / 2.0;
        self.add(
            "modules",
            module.0,
            Marker {
                r#type: match self.is_round {
                    true => Marker::CYLINDER,
                    false => Marker::CUBE,
                },
                pose,
                scale: scale(self.width, self.width, MODULE_HEIGHT),
                color: colour_of(figure),
                ..Marker::default()
            },
        );
        if labels {
            let height = MODULE_HEIGHT + LABEL_HEIGHT;
            self.add_label(
                "module_labels",
                module.0,
                &figure.snapshot.pose,
                height,
                WHITE,
            );
        }
    }
}

/// The picture is drawn in units, and scaled as a whole.
fn in_units(pose: &Pose) -> geometry_msgs::Pose {
    geometry_msgs::Pose::new(pose, ModuleSize::METRE)
}

fn point(pose: &Pose, z: f64) -> Point {
    Point {
        x: pose.x.to_units(),
        y: pose.y.to_units(),
        z,
    }
}

/// Points on the circle of a round body.
fn points_around(pose: &Pose, width: f64) -> Vec<Point> {
    let eighths = (0..16).map(|part| f64::from(part) * std::f64::consts::FRAC_PI_8);
    let on_circle = eighths.map(|angle| Point {
        x: pose.x.to_units() + width / 2.0 * angle.cos(),
        y: pose.y.to_units() + width / 2.0 * angle.sin(),
        z: 0.0,
    });
    on_circle.collect()
}

/// The corners of a body of this width that stands there, in their order around it.
fn corners_of(pose: &Pose, width: f64) -> [Point; 4] {
    let (sine, cosine) = pose.theta.to_units().sin_cos();
    let half = width / 2.0;
    [(1.0, 1.0), (-1.0, 1.0), (-1.0, -1.0), (1.0, -1.0)].map(|(ahead, left)| Point {
        x: pose.x.to_units() + half * (ahead * cosine - left * sine),
        y: pose.y.to_units() + half * (ahead * sine + left * cosine),
        z: 0.0,
    })
}

/// Modules of one configuration share a colour, single ones are pale blue, and those that fell silent grey.
fn colour_of(figure: &Figure) -> ColorRGBA {
    if !figure.is_live {
        return GREY;
    }
    match figure.configuration {
        Some(configuration) => {
            // The golden angle keeps colours that follow each other far apart.
            let turn = f64::from(configuration.0) * 0.618_033_988_749_895;
            hue(turn.fract())
        }
        None => PALE_BLUE,
    }
}

/// A bright colour from its place on the colour circle, 0 to 1.
fn hue(turn: f64) -> ColorRGBA {
    let part = |offset: f64| {
        let distance = ((turn + offset).fract() * 6.0 - 3.0).abs();
        #[expect(
            clippy::cast_possible_truncation,
            reason = "a colour needs no more precision"
        )]
        let bright = (distance - 1.0).clamp(0.0, 1.0) as f32;
        0.2 + 0.75 * bright
    };
    ColorRGBA {
        r: part(0.0),
        g: part(2.0 / 3.0),
        b: part(1.0 / 3.0),
        a: 1.0,
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;
    use std::time::Duration;

    use formation_model::Message;

    use super::*;
    use crate::scene::tests::{pose, scene, state};

    fn drawn(scene: &DrawnScene) -> Vec<Marker> {
        of(scene, &Header::default(), true).markers
    }

    fn named<'a>(markers: &'a [Marker], ns: &str) -> Vec<&'a Marker> {
        markers.iter().filter(|marker| marker.ns == ns).collect()
    }

    #[test]
    fn everything_that_is_known_is_drawn() {
        let markers = drawn(&scene());
        assert_eq!(markers[0].action, Marker::DELETEALL);
        let modules = named(&markers, "modules");
        assert_eq!(
            modules.iter().map(|marker| marker.id).collect::<Vec<_>>(),
            [2, 3]
        );
        assert_eq!(
            modules[0].color, modules[1].color,
            "they are one configuration"
        );
        assert_eq!(named(&markers, "links")[0].points.len(), 2, "drawn once");
        assert_eq!(named(&markers, "target_spots")[0].points.len(), 16);
        assert_eq!(named(&markers, "target_edges")[0].points.len(), 2);
        let claims = named(&markers, "claims");
        assert_eq!(
            claims[0].points,
            [point(&pose(0.0, 0.0), 0.0), point(&pose(5.0, 5.0), 0.0)]
        );
        assert_eq!(named(&markers, "spot_labels")[1].text, "2");
        assert!(named(&markers, "trails").is_empty(), "nothing has moved");
        for list in &markers {
            assert!(list.colors.is_empty() || list.colors.len() == list.points.len());
        }
    }

    #[test]
    fn no_two_markers_share_a_name() {
        let mut scene = scene();
        let moved = state(2, 2, pose(1.0, 1.0));
        scene.handle(Duration::ZERO, &Message::ModuleState(Arc::new(moved)));
        let markers = drawn(&scene);
        let names: std::collections::BTreeSet<_> = markers
            .iter()
            .map(|marker| (&marker.ns, marker.id))
            .collect();
        assert_eq!(names.len(), markers.len());
        assert_eq!(named(&markers, "trails")[0].points.len(), 2);
    }

    #[test]
    fn configurations_have_distinct_colours_and_silent_modules_are_grey() {
        let mut scene = scene();
        scene.advance(Duration::from_secs(9));
        assert_eq!(named(&drawn(&scene), "modules")[0].color, GREY);
        let distinct: Vec<ColorRGBA> = (0..6).map(|turn| hue(f64::from(turn) / 6.0)).collect();
        for (index, one) in distinct.iter().enumerate() {
            for other in &distinct[index + 1..] {
                assert_ne!(one, other);
            }
            for part in [one.r, one.g, one.b, one.a] {
                assert!((0.0..=1.0).contains(&part));
            }
        }
    }

    #[test]
    fn an_outline_turns_with_its_spot() {
        let turned = Pose::from_units(1.0, 1.0, std::f64::consts::FRAC_PI_2).unwrap();
        let corner = corners_of(&turned, 0.9)[0];
        assert!((corner.x - 0.55).abs() < 1e-6 && (corner.y - 1.45).abs() < 1e-6);
    }
}
