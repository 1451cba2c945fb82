//! The documents are true of the repository, and its text keeps to the rules of layout.

mod files;
mod references;
mod sources;
