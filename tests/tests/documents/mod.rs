//! The documents are true of the repository, and all of its text keeps to one vocabulary and to the rules of layout.

mod files;
mod references;
mod sources;
mod words;
