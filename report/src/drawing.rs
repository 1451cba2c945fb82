//! How spots, links and modules look; shared by the pictures and the page's player.

use formation::model::Pose;

use crate::element::{Element, Short};
use crate::frame::Frame;
use crate::palette::{Look, look};
use crate::subject::{Module, Spot, Subject};

/// What the grid's numbers need beside and below the ground.
pub(crate) const LEFT: f64 = 46.0;
pub(crate) const BELOW: f64 = 40.0;

/// Below this, digits cannot be read.
const LABEL_MIN: f64 = 6.0;

/// The patterns that palettes name, for one picture.
pub(crate) fn patterns() -> Element {
    let pattern = |id: &str, size: f64| {
        Element::new("pattern")
            .with("id", id)
            .with("width", size)
            .with("height", size)
            .with("patternUnits", "userSpaceOnUse")
    };
    let ink = |element: Element| element.with("fill", "#000").with("fill-opacity", "0.3");
    let square = |x: f64, y: f64| {
        ink(Element::new("rect")
            .with("x", x)
            .with("y", y)
            .with("width", 4)
            .with("height", 4))
    };
    Element::new("defs")
        .containing(
            pattern("stripes", 7.0)
                .with("patternTransform", "rotate(45)")
                .containing(ink(Element::new("rect")
                    .with("width", 2.5)
                    .with("height", 7))),
        )
        .containing(
            pattern("dots", 7.0).containing(ink(Element::new("circle")
                .with("cx", 3.5)
                .with("cy", 3.5)
                .with("r", 1.6))),
        )
        .containing(
            pattern("checks", 8.0)
                .containing(square(0.0, 0.0))
                .containing(square(4.0, 4.0)),
        )
}

/// The grid, with its numbers and what they count.
pub(crate) fn grid(frame: &Frame) -> Element {
    let mut grid = Element::group("grid");
    let line = |x1: f64, y1: f64, x2: f64, y2: f64| {
        Element::new("line")
            .with("x1", Short(x1))
            .with("y1", Short(y1))
            .with("x2", Short(x2))
            .with("y2", Short(y2))
    };
    let text = |x: f64, y: f64, anchor: &str| {
        Element::new("text")
            .with("x", Short(x))
            .with("y", Short(y))
            .with("text-anchor", anchor)
    };
    let (width, height) = (frame.width, frame.height);
    for column in frame.columns() {
        grid.push(line(column.at, 0.0, column.at, height));
        if let Some(number) = column.number {
            grid.push(text(column.at, height + 14.0, "middle").saying(number));
        }
    }
    for row in frame.rows() {
        grid.push(line(0.0, row.at, width, row.at));
        if let Some(number) = row.number {
            grid.push(text(-6.0, row.at + 4.0, "end").saying(number));
        }
    }
    grid.push(text(width / 2.0, height + 30.0, "middle").saying("x in units"));
    let middle = height / 2.0;
    grid.push(
        text(-34.0, middle, "middle")
            .with("transform", format!("rotate(-90 -34 {})", Short(middle)))
            .saying("y in units"),
    );
    grid
}

/// A line between two poses.
pub(crate) fn line(frame: &Frame, class: &str, from: &Pose, to: &Pose) -> Element {
    Element::new("line")
        .with("class", class)
        .with("x1", Short(frame.x(from)))
        .with("y1", Short(frame.y(from)))
        .with("x2", Short(frame.x(to)))
        .with("y2", Short(frame.y(to)))
}

/// A link that breaks: a dashed bow and the cross on it, so that it does not hide behind what lies between its ends.
pub(crate) fn broken(frame: &Frame, from: &Pose, to: &Pose) -> (Element, Element) {
    let (x1, y1) = (frame.x(from), frame.y(from));
    let (x2, y2) = (frame.x(to), frame.y(to));
    let (dx, dy) = (x2 - x1, y2 - y1);
    let length = dx.hypot(dy).max(1.0);
    // Neighbours are joined straight; the further apart, the wider the bow, up to some modules' width.
    let side = frame.module_side();
    let bow = if length < 1.6 * side {
        0.0
    } else {
        (0.35 * length).min(3.0 * side)
    };
    let (middle_x, middle_y) = (
        (x1 + x2) / 2.0 + dy / length * bow,
        (y1 + y2) / 2.0 - dx / length * bow,
    );
    // The curve comes half as far as the point that draws it there.
    let (control_x, control_y) = (
        2.0 * middle_x - (x1 + x2) / 2.0,
        2.0 * middle_y - (y1 + y2) / 2.0,
    );
    let bow = Element::new("path").with("class", "link broken").with(
        "d",
        format!(
            "M{} {}Q{} {} {} {}",
            Short(x1),
            Short(y1),
            Short(control_x),
            Short(control_y),
            Short(x2),
            Short(y2)
        ),
    );
    (bow, cross(middle_x, middle_y, side * 0.15))
}

/// A cross upon a broken link.
pub(crate) fn cross(x: f64, y: f64, half: f64) -> Element {
    let (left, right, top, bottom) = (
        Short(x - half),
        Short(x + half),
        Short(y - half),
        Short(y + half),
    );
    Element::new("path").with("class", "cross").with(
        "d",
        format!("M{left} {top}L{right} {bottom}M{left} {bottom}L{right} {top}"),
    )
}

/// The target: its edges, and its spots with their numbers.
pub(crate) fn target(
    frame: &Frame,
    subject: &Subject,
    class_of: impl Fn(&Spot) -> &'static str,
) -> Element {
    let mut group = Element::group("target");
    for &(one, other) in &subject.edges {
        let (one, other) = (&subject.spots[one].pose, &subject.spots[other].pose);
        group.push(line(frame, "edge", one, other));
    }
    let side = frame.module_side();
    for spot in &subject.spots {
        let (x, y) = (frame.x(&spot.pose), frame.y(&spot.pose));
        let mut drawn = Element::group(class_of(spot))
            .with("data-spot", spot.id.0)
            .containing(
                square(side)
                    .with("transform", placed(x, y, Frame::turn(&spot.pose)))
                    .with("rx", Short(side * 0.18)),
            );
        if let Some(label) = label(side, spot.id.0) {
            drawn.push(label.with("x", Short(x)).with("y", Short(y)));
        }
        group.push(drawn);
    }
    group
}

/// A module that stands at a pose.
pub(crate) fn module_at(frame: &Frame, module: &Module, pose: &Pose) -> Element {
    let side = frame.module_side();
    let look = look(module.configuration);
    let class = if module.leads {
        "module leader"
    } else {
        "module"
    };
    let mut drawn = Element::group(class)
        .with("data-module", module.id.0)
        .with(
            "transform",
            format!(
                "translate({} {})",
                Short(frame.x(pose)),
                Short(frame.y(pose))
            ),
        )
        .containing(body(side, &look, Frame::turn(pose)));
    if let Some(label) = label(side, module.id.0) {
        drawn.push(label.with("fill", look.ink).with("stroke", look.fill));
    }
    drawn
}

/// A module's square with the mark of its heading, around the origin.
pub(crate) fn body(side: f64, look: &Look, turn: f64) -> Element {
    let mut body = Element::group("body").with("transform", format!("rotate({})", Short(turn)));
    body.push(
        square(side)
            .with("rx", Short(side * 0.18))
            .with("fill", look.fill),
    );
    if let Some(pattern) = look.pattern {
        body.push(
            square(side)
                .with("class", "pattern")
                .with("rx", Short(side * 0.18))
                .with("fill", format!("url(#{pattern})")),
        );
    }
    let (tip, back, half) = (side * 0.62, side * 0.44, side * 0.16);
    body.push(Element::new("path").with("class", "heading").with(
        "d",
        format!(
            "M{} 0L{1} {2}L{1} -{2}Z",
            Short(tip),
            Short(back),
            Short(half)
        ),
    ));
    body
}

fn square(side: f64) -> Element {
    Element::new("rect")
        .with("x", Short(-side / 2.0))
        .with("y", Short(-side / 2.0))
        .with("width", Short(side))
        .with("height", Short(side))
}

fn placed(x: f64, y: f64, turn: f64) -> String {
    format!(
        "translate({} {}) rotate({})",
        Short(x),
        Short(y),
        Short(turn)
    )
}

/// A number in the middle of a square, as large as fits; `None` where it could not be read.
fn label(side: f64, number: u32) -> Option<Element> {
    let digits = number.checked_ilog10().unwrap_or(0) + 1;
    let size = (side * 0.46).min(side * 0.8 / (0.6 * f64::from(digits)));
    (size >= LABEL_MIN).then(|| {
        Element::new("text")
            .with("class", "number")
            .with("font-size", Short(size))
            .with("dy", "0.35em")
            .saying(number)
    })
}
