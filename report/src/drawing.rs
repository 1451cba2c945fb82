//! The drawings of spots, links and modules, for the pictures and for the page's player.

use formation_model::{Area, BodyShape, MicroUnits, Pose};

use crate::element::{Element, Short};
use crate::frame::Frame;
use crate::palette::{Look, look};
use crate::subject::{Module, Spot, Subject};

/// The space for the grid's numbers to the left of and below the ground.
pub(crate) const LEFT: f64 = 46.0;
pub(crate) const BELOW: f64 = 40.0;

/// The minimum size of legible digits.
const LABEL_MIN: f64 = 6.0;

/// The patterns that palettes name, for one picture.
pub(crate) fn patterns() -> Element {
    let pattern = |id: &str, size: f64| {
        Element::new("pattern")
            .with("id", id)
            .lengths([("width", size), ("height", size)])
            .with("patternUnits", "userSpaceOnUse")
    };
    let ink = |element: Element| element.with("fill", "#000").with("fill-opacity", "0.3");
    let square = |at: f64| {
        let lengths = [("x", at), ("y", at), ("width", 4.0), ("height", 4.0)];
        ink(Element::new("rect").lengths(lengths))
    };
    let stripe = Element::new("rect").lengths([("width", 2.5), ("height", 7.0)]);
    let dot = Element::new("circle").lengths([("cx", 3.5), ("cy", 3.5), ("r", 1.6)]);
    let stripes = pattern("stripes", 7.0).with("patternTransform", "rotate(45)");
    let checks = pattern("checks", 8.0).containing(square(0.0));
    Element::new("defs")
        .containing(stripes.containing(ink(stripe)))
        .containing(pattern("dots", 7.0).containing(ink(dot)))
        .containing(checks.containing(square(4.0)))
}

/// A rectangle of a class.
pub(crate) fn rectangle(class: &str, width: f64, height: f64) -> Element {
    Element::new("rect")
        .with("class", class)
        .lengths([("width", width), ("height", height)])
}

/// The ground with its grid, without anything on it.
pub(crate) fn ground(frame: &Frame, (left, top): (f64, f64)) -> Element {
    Element::group("ground")
        .with("transform", translate(left, top))
        .containing(rectangle("floor", frame.width, frame.height))
        .containing(grid(frame))
}

/// The grid, with its numbers and their unit.
fn grid(frame: &Frame) -> Element {
    let mut grid = Element::group("grid");
    let line = |x1: f64, y1: f64, x2: f64, y2: f64| {
        Element::new("line").lengths([("x1", x1), ("y1", y1), ("x2", x2), ("y2", y2)])
    };
    let text = |x: f64, y: f64, anchor: &str| {
        Element::new("text")
            .lengths([("x", x), ("y", y)])
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
    Element::new("line").with("class", class).lengths([
        ("x1", frame.x(from)),
        ("y1", frame.y(from)),
        ("x2", frame.x(to)),
        ("y2", frame.y(to)),
    ])
}

/// A link that breaks: a cross on a dashed bow, which modules between its ends do not hide. It bends to the side on which the cross
/// is farther from all modules, and so upon no other link.
pub(crate) fn broken(
    frame: &Frame,
    from: &Pose,
    to: &Pose,
    modules: &(impl Iterator<Item = Pose> + Clone),
) -> (Element, Element) {
    let (x1, y1) = (frame.x(from), frame.y(from));
    let (x2, y2) = (frame.x(to), frame.y(to));
    let (dx, dy) = (x2 - x1, y2 - y1);
    let length = dx.hypot(dy).max(1.0);
    // The link between neighbours is straight. The greater the distance, the wider the bow, up to three modules.
    let side = frame.module_side();
    let bow = if length < 1.6 * side {
        0.0
    } else {
        (0.35 * length).min(3.0 * side)
    };
    let middle = |bow: f64| {
        let (x, y) = ((x1 + x2) / 2.0, (y1 + y2) / 2.0);
        (x + dy / length * bow, y - dx / length * bow)
    };
    let clearance = |(x, y): (f64, f64)| {
        let distances = modules
            .clone()
            .map(|pose| (frame.x(&pose) - x).hypot(frame.y(&pose) - y));
        distances.fold(f64::INFINITY, f64::min)
    };
    let (one, other) = (middle(bow), middle(-bow));
    let (middle_x, middle_y) = match clearance(one) < clearance(other) {
        true => other,
        false => one,
    };
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

/// A box of the ground.
fn area(frame: &Frame, class: &str, area: &Area) -> Element {
    let corner = |(x, y): (MicroUnits, MicroUnits)| {
        let theta = MicroUnits::ZERO;
        let pose = Pose { x, y, theta };
        (frame.x(&pose), frame.y(&pose))
    };
    let ((left, bottom), (right, top)) = (corner(area.low), corner(area.high));
    Element::new("rect").with("class", class).lengths([
        ("x", left),
        ("y", top),
        ("width", right - left),
        ("height", bottom - top),
    ])
}

/// The target: obstacles and walls, its edges, and its spots with their numbers.
pub(crate) fn target(
    frame: &Frame,
    subject: &Subject,
    class_of: impl Fn(&Spot) -> &'static str,
) -> Element {
    let mut group = Element::group("target");
    let surroundings = &subject.surroundings;
    group.extend(
        surroundings
            .arena()
            .map(|walls| area(frame, "arena", &walls)),
    );
    let obstacles = surroundings.obstacles().iter();
    group.extend(obstacles.map(|obstacle| area(frame, "obstacle", obstacle)));
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
                outline(side, frame.body).with("transform", placed(x, y, Frame::turn(&spot.pose))),
            );
        if let Some(label) = label(side, spot.id.0) {
            drawn.push(label.lengths([("x", x), ("y", y)]));
        }
        group.push(drawn);
    }
    group
}

/// A module at a pose.
pub(crate) fn module_at(frame: &Frame, module: &Module, pose: &Pose) -> Element {
    let place = (frame.x(pose), frame.y(pose));
    module_in(frame, module, place, Frame::turn(pose))
}

/// A module in a place in pixels, turned clockwise by degrees.
pub(crate) fn module_in(frame: &Frame, module: &Module, (x, y): (f64, f64), turn: f64) -> Element {
    let side = frame.module_side();
    let look = look(module.configuration);
    let class = if module.leads {
        "module leader"
    } else {
        "module"
    };
    let mut drawn = Element::group(class)
        .with("data-module", module.id.0)
        .with("transform", translate(x, y))
        .containing(body((side, frame.body), &look, turn));
    if let Some(label) = label(side, module.id.0) {
        drawn.push(label.with("fill", look.ink).with("stroke", look.fill));
    }
    drawn
}

/// A module's body with the mark of its heading, around the origin.
pub(crate) fn body((side, shape): (f64, BodyShape), look: &Look, turn: f64) -> Element {
    let mut body = Element::group("body").with("transform", format!("rotate({})", Short(turn)));
    body.push(outline(side, shape).with("fill", look.fill));
    if let Some(pattern) = look.pattern {
        body.push(
            outline(side, shape)
                .with("class", "pattern")
                .with("fill", format!("url(#{pattern})")),
        );
    }
    let (tip, back, half) = (side * 0.56, side * 0.42, side * 0.13);
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

/// A square around the origin, with round corners, or a circle.
fn outline(side: f64, shape: BodyShape) -> Element {
    let half = -side / 2.0;
    let corner = match shape {
        BodyShape::Square => side * 0.18,
        BodyShape::Circle => side / 2.0,
    };
    Element::new("rect")
        .lengths([("x", half), ("y", half), ("width", side), ("height", side)])
        .with("rx", Short(corner))
}

/// A transformation that moves the origin.
pub(crate) fn translate(x: f64, y: f64) -> String {
    format!("translate({} {})", Short(x), Short(y))
}

fn placed(x: f64, y: f64, turn: f64) -> String {
    format!("{} rotate({})", translate(x, y), Short(turn))
}

/// A number in the middle of a square, as large as possible; `None` if it would not be legible.
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
