//! Pictures of formations, and a page that plays one.
//!
//! All functions turn data into text and do no I/O: a [`Subject`] becomes the pictures [`before`] and [`after`]; a subject
//! and its course, planned ([`course_of_plan`]) or recorded, become a [`page`] or an animated picture ([`animation`]).

mod animation;
mod drawing;
mod element;
mod figure;
mod frame;
mod legend;
mod page;
pub mod palette;
mod pictures;
mod planned;
mod playback;
mod played;
mod subject;

pub use animation::{Colours, animation};
pub use figure::{PANELS_MAX, figure};
pub use page::{Fact, Summary, Tone, page};
pub use pictures::{after, before};
pub use planned::course_of_plan;
pub use played::{PlayedFilm, film};
pub use subject::Subject;
