//! The pictures before and after, each an SVG file.

use formation_model::Pose;
use formation_model::text::counted;

use crate::drawing::{self, BELOW, LEFT, translate};
use crate::element::{Element, Short};
use crate::frame::Frame;
use crate::legend::{self, Entry, Mark};
use crate::subject::{Module, Spot, Subject};

/// The style sheet of the pictures, for light and dark surroundings.
pub(crate) const STYLE: &str = include_str!("../assets/picture.css");

/// The height of the title and of one line of subtitle above the ground.
const HEAD: f64 = 62.0;
/// The size of the subtitle's letters, and the distance of its lines.
const SUBTITLE: f64 = 13.0;
const LINE_HEIGHT: f64 = 17.0;
const RIGHT: f64 = 18.0;
/// The title and the legend need this width.
const GROUND_WIDTH_MIN: f64 = 460.0;

/// The moment that a picture shows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Moment {
    Start,
    End,
}

impl Moment {
    fn pose(self, module: &Module) -> &Pose {
        match self {
            Self::Start => &module.start,
            Self::End => &module.end,
        }
    }

    fn draw(self, frame: &Frame, module: &Module) -> Element {
        let drawn = drawing::module_at(frame, module, self.pose(module));
        match self {
            Self::End if module.is_dead => Element::group("dead").containing(drawn),
            _ => drawn,
        }
    }
}

/// The modules where they start, their links, and the spots that they are to fill.
#[must_use]
pub fn before(subject: &Subject) -> String {
    let kept = subject.kept_links();
    let broken = match subject.links.len() - kept {
        0 => "none".to_owned(),
        broken => broken.to_string(),
    };
    let subtitle = format!(
        "before: {}, {} to fill; {}, {broken} of them to break",
        counted(subject.modules.len(), "module"),
        counted(subject.spots.len(), "spot"),
        counted(subject.links.len(), "link"),
    );
    let signs = [
        (true, Mark::Spot, "spot to fill"),
        (kept > 0, Mark::Line("link kept"), "link that is kept"),
        (kept < subject.links.len(), Mark::Break, "link that breaks"),
    ];
    picture(subject, Moment::Start, &subtitle, &[], |_| "spot", &signs)
}

/// The modules where they end, their kept, broken and new links, and the open spots.
#[must_use]
pub fn after(subject: &Subject) -> String {
    let kept = subject.kept_links();
    let broken = subject.links.len() - kept;
    let filled = subject.filled_spots();
    let subtitle = format!(
        "after: {filled} of {} filled; {} kept, {broken} broken, {} new",
        counted(subject.spots.len(), "spot"),
        counted(kept, "link"),
        subject.new_links.len(),
    );
    let class_of = |spot: &Spot| match spot.holder {
        Some(_) => "spot",
        None => "spot open",
    };
    let new_links = &subject.new_links;
    let some_died = subject.modules.iter().any(|module| module.is_dead);
    let signs = [
        (kept > 0, Mark::Line("link kept"), "kept link"),
        (broken > 0, Mark::Break, "broken link"),
        (!new_links.is_empty(), Mark::Line("link new"), "new link"),
        (filled < subject.spots.len(), Mark::OpenSpot, "open spot"),
        (some_died, Mark::Dead, "module whose process died"),
    ];
    picture(subject, Moment::End, &subtitle, new_links, class_of, &signs)
}

/// A picture of all modules at a moment. Each sign of the legend has a condition and a meaning.
fn picture(
    subject: &Subject,
    moment: Moment,
    subtitle: &str,
    new_links: &[(usize, usize)],
    class_of: impl Fn(&Spot) -> &'static str,
    signs: &[(bool, Mark, &str)],
) -> String {
    let poses = subject.modules.iter().map(|module| *moment.pose(module));
    let spots = subject.spots.iter().map(|spot| spot.pose);
    let corners = subject.corners();
    let frame = Frame::around(poses.clone().chain(spots).chain(corners))
        .at_least(GROUND_WIDTH_MIN)
        .with_bodies(subject.surroundings.body());
    let pose_of = |module: usize| moment.pose(&subject.modules[module]);
    let line = |class, (one, other)| drawing::line(&frame, class, pose_of(one), pose_of(other));
    let [mut links, mut bows, mut crosses] = [(); 3].map(|()| Element::group("links"));
    links.extend(new_links.iter().map(|&ends| line("link new", ends)));
    for link in &subject.links {
        if link.kept {
            links.push(line("link kept", link.ends));
        } else {
            let (one, other) = link.ends;
            let (bow, cross) = drawing::broken(&frame, pose_of(one), pose_of(other), &poses);
            bows.push(bow);
            crosses.push(cross);
        }
    }
    let modules = subject.modules.iter();
    let mut ground = drawing::ground(&frame, (LEFT, HEAD));
    ground.push(drawing::target(&frame, subject, class_of));
    ground.extend([links, bows]);
    ground.extend(modules.map(|module| moment.draw(&frame, module)));
    ground.push(crosses);
    let mut entries = legend::of_modules(subject);
    let signs = signs.iter().filter(|(is_shown, ..)| *is_shown);
    entries.extend(signs.map(|&(_, mark, text)| (mark, text.to_owned())));
    on_paper(subject, &frame, subtitle, ground, &entries)
}

/// The ground with a title above and a legend below.
fn on_paper(
    subject: &Subject,
    frame: &Frame,
    subtitle: &str,
    ground: Element,
    entries: &[Entry],
) -> String {
    let width = LEFT + frame.width + RIGHT;
    let text_width = width - 2.0 * legend::INSET;
    let (legend, legend_height) = legend::draw(entries, frame, text_width);
    let lines = wrapped(subtitle, text_width, SUBTITLE);
    let added: f64 = lines.iter().skip(1).map(|_| LINE_HEIGHT).sum();
    let legend_top = HEAD + added + frame.height + BELOW;
    let height = legend_top + legend_height + legend::INSET;
    let text = |class: &str, y: f64, text: &str| {
        Element::new("text")
            .with("class", class)
            .with("x", legend::INSET)
            .with("y", Short(y))
            .saying(text)
    };
    let title = cut(subject.title(), text_width, 19.0);
    let mut baseline = 49.0 - LINE_HEIGHT;
    let subtitle_lines = lines.iter().map(|line| {
        baseline += LINE_HEIGHT;
        text("subtitle", baseline, line)
    });
    let lowered = translate(0.0, added);
    let ground = Element::group("lowered")
        .with("transform", lowered)
        .containing(ground);
    let legend_place = translate(legend::INSET, legend_top);
    let mut root = Element::new("svg")
        .with("xmlns", "http://www.w3.org/2000/svg")
        .with("viewBox", format!("0 0 {} {}", Short(width), Short(height)))
        .with("width", Short(width))
        .with("height", Short(height))
        .with("role", "img")
        .containing(Element::new("title").saying(format!("{}, {subtitle}", subject.title())))
        .containing(style_place())
        .containing(drawing::patterns())
        .containing(drawing::rectangle("paper", width, height))
        .containing(text("title", 28.0, &title));
    root.extend(subtitle_lines);
    root.extend([ground, legend.with("transform", legend_place)]);
    styled(&root)
}

/// Where [`styled`] puts the style sheet of a picture.
pub(crate) fn style_place() -> Element {
    Element::new("style").saying("")
}

/// The text of a picture with its style sheet, which contains characters that the escaping of text would change.
pub(crate) fn styled(picture: &Element) -> String {
    let style = format!("<style>{STYLE}</style>");
    picture.to_string().replacen("<style></style>", &style, 1)
}

/// The width of a letter of common fonts, as a part of its size.
fn letter_width(letter: char) -> f64 {
    match letter {
        'm' | 'w' | 'M' | 'W' | '@' | '%' => 0.95,
        letter if letter.is_ascii_uppercase() => 0.75,
        letter if letter.is_ascii() => 0.62,
        _ => 1.05,
    }
}

/// Text cut to `width`, for letters of this size.
fn cut(text: &str, width: f64, size: f64) -> String {
    let mut left = width - size;
    let mut end = text.len();
    for (index, letter) in text.char_indices() {
        left -= size * letter_width(letter);
        if left < 0.0 {
            end = end.min(index);
        }
    }
    if left >= 0.0 {
        text.to_owned()
    } else {
        format!("{}…", &text[..end])
    }
}

/// Text in lines of at most `width`, for letters of this size; a longer word has a line of its own.
fn wrapped(text: &str, width: f64, size: f64) -> Vec<String> {
    let mut lines: Vec<String> = Vec::new();
    let mut left = 0.0;
    for word in text.split(' ') {
        let needed: f64 = word.chars().map(letter_width).sum::<f64>() * size;
        let space = size * letter_width(' ');
        match lines.last_mut() {
            Some(line) if needed + space <= left => {
                line.push(' ');
                line.push_str(word);
                left -= needed + space;
            }
            _ => {
                lines.push(word.to_owned());
                left = width - needed;
            }
        }
    }
    lines
}
