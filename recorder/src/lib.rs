//! Records the topics of a formation into an MCAP file, which `ros2 bag`, `rosbags` and Foxglove open, reads such
//! files, and plays them.
//!
//! [`process`] is the node; it hands each sample, undecoded, to the thread of [`queue`], which writes it with
//! [`file::RecordingFile`]. [`read`] reads a file, or the folder of a bag, as far as it is intact, and [`replay`] makes the event
//! log of it.
//! [`play`] publishes what a file has.

mod bag;
mod chunk;
pub mod file;
pub mod play;
pub mod process;
pub mod queue;
pub mod read;
pub mod replay;
mod sequence_numbers;
