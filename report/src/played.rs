//! A film as data, for players that draw it themselves.

use formation_event_log::Entry;
use serde::Serialize;

use crate::frame::Frame;
use crate::page::places;
use crate::playback::{Film, KEYFRAMES_MAX};
use crate::subject::Subject;

/// A film, and how its pixels lie on the ground.
#[derive(Clone, Debug, Serialize)]
pub struct PlayedFilm {
    #[serde(flatten)]
    film: Film,
    ground: Ground,
}

/// The point of the plane at pixel (0, 0). The y axis points upwards in units and downwards in pixels.
#[derive(Clone, Copy, Debug, Serialize)]
struct Ground {
    left_units: f64,
    top_units: f64,
}

/// The film of a formation that took this course; `end` is its last sentence.
#[must_use]
pub fn film(subject: &Subject, course: &[Entry], end: &str) -> PlayedFilm {
    let frame = Frame::around(places(subject, course));
    let (left_units, top_units) = frame.origin();
    PlayedFilm {
        film: Film::of(subject, course, &frame, end, KEYFRAMES_MAX),
        ground: Ground {
            left_units,
            top_units,
        },
    }
}
