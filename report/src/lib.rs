//! Pictures of formations, and a page that plays one.
//!
//! Everything here turns data into text: a [`Subject`] into the pictures [`before`] and [`after`], and a subject and its
//! course, planned ([`course_of_plan`]) or recorded, into a [`page`]. Nothing is read or written.

mod drawing;
mod element;
mod frame;
mod legend;
mod page;
pub mod palette;
mod pictures;
mod planned;
mod playback;
mod subject;

pub use page::{Fact, Summary, Tone, page};
pub use pictures::{after, before};
pub use planned::course_of_plan;
pub use subject::{Ending, Subject};
