//! Whether a run can write what it is to leave behind, before any process starts.

use std::fs::{self, File, OpenOptions};
use std::io::{self, ErrorKind};
use std::path::{Path, PathBuf};

use ros_runtime::exit::Failure;
use rustix::fs::{Access, access};

use crate::arguments::RunArguments;

/// Refuses files and directories that cannot be written.
///
/// # Errors
/// Names the option, the path, and what is wrong with it.
pub fn check(arguments: &RunArguments) -> Result<(), Failure> {
    let files = [
        ("--trace", arguments.trace.as_deref()),
        ("--record", arguments.record.as_deref()),
    ];
    let directories = [
        ("--report", arguments.report.as_deref()),
        ("--state-dir", arguments.state_dir.as_deref()),
    ];
    for (option, path) in given(files) {
        check_file(path).map_err(|reason| refusal(option, path, &reason))?;
    }
    for (option, path) in given(directories) {
        check_directory(path).map_err(|reason| refusal(option, path, &reason))?;
    }
    if let (Some(trace), Some(record)) = (&arguments.trace, &arguments.record)
        && resolved(trace) == resolved(record)
    {
        return Err(refusal("--record", record, "is the file of --trace too"));
    }
    Ok(())
}

fn given<'a>(
    options: [(&'static str, Option<&'a Path>); 2],
) -> impl Iterator<Item = (&'static str, &'a Path)> {
    let options = options.into_iter();
    options.filter_map(|(option, path)| Some((option, path?)))
}

fn refusal(option: &str, path: &Path, reason: &str) -> Failure {
    Failure::bad_input(format_args!("{option} {}: {reason}", path.display()))
}

/// A file that exists already, or can be created; none is left behind.
fn check_file(path: &Path) -> Result<(), String> {
    let kind = match fs::metadata(path) {
        Ok(found) if found.is_dir() => return Err("is a directory; name a file".to_owned()),
        Ok(found) => Some(found.is_file()),
        Err(error) if error.kind() == ErrorKind::NotFound => None,
        Err(error) => return Err(cannot_be_written(&error)),
    };
    let opened = match kind {
        // A pipe would wait for its reader.
        Some(false) => {
            return access(path, Access::WRITE_OK)
                .map_err(|error| cannot_be_written(&error.into()));
        }
        Some(true) => OpenOptions::new().append(true).open(path),
        None => created(path),
    };
    match opened {
        Ok(_) => Ok(()),
        Err(_) if !parent(path).exists() => Err(format!(
            "its directory `{}` does not exist",
            parent(path).display()
        )),
        Err(error) => Err(cannot_be_written(&error)),
    }
}

/// Creates a file and deletes it again.
fn created(path: &Path) -> io::Result<File> {
    // A link to what does not exist yet is kept.
    let place = match fs::read_link(path) {
        Ok(target) => parent(path).join(target),
        Err(_) => path.to_owned(),
    };
    let file = OpenOptions::new()
        .write(true)
        .create_new(true)
        .open(&place)?;
    fs::remove_file(place)?;
    Ok(file)
}

/// A directory that exists, or can be created with those above it.
fn check_directory(path: &Path) -> Result<(), String> {
    let absolute = std::path::absolute(path).map_err(|error| cannot_be_written(&error))?;
    for above in absolute.ancestors() {
        match fs::metadata(above) {
            Ok(found) if !found.is_dir() => {
                return Err(match above == absolute {
                    true => "is a file; name a directory".to_owned(),
                    false => format!("`{}` is no directory", above.display()),
                });
            }
            Ok(_) => {
                let writable = access(above, Access::WRITE_OK | Access::EXEC_OK);
                return writable.map_err(|error| cannot_be_written(&error.into()));
            }
            Err(error) if error.kind() == ErrorKind::NotFound => {}
            // A file stands where a directory is named.
            Err(error) if error.kind() == ErrorKind::NotADirectory => {}
            Err(error) => return Err(cannot_be_written(&error)),
        }
    }
    Ok(())
}

fn cannot_be_written(error: &io::Error) -> String {
    format!("cannot be written: {error}")
}

fn parent(path: &Path) -> &Path {
    let parent = path.parent();
    parent
        .filter(|parent| !parent.as_os_str().is_empty())
        .unwrap_or(Path::new("."))
}

/// Where the path of a file leads.
fn resolved(path: &Path) -> PathBuf {
    fs::canonicalize(path).unwrap_or_else(|_| {
        let directory = parent(path);
        let directory = fs::canonicalize(directory).unwrap_or_else(|_| directory.to_owned());
        directory.join(path.file_name().unwrap_or_default())
    })
}
