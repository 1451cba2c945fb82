//! The documents are true of the repository, and its text keeps to the rules of layout.

mod book;
mod circles;
mod files;
mod names;
mod parameters;
mod references;
mod rules;
mod sources;
