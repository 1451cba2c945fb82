//! The text files of the repository.

use std::fs;
use std::path::Path;

use formation_tests::root;

/// Folders that hold what a build or a tool leaves behind.
const GENERATED: [&str; 3] = ["target", "__pycache__", ".git"];
/// Texts that are not written here.
const OF_OTHERS: [&str; 3] = ["Cargo.lock", "LICENSE", "tests/hiroz_peer/Cargo.lock"];

/// One text file.
pub struct TextFile {
    /// The path from the root of the repository.
    pub path: String,
    /// The whole content.
    pub text: String,
}

impl TextFile {
    /// The file at `path`, which must exist.
    pub fn read(path: &str) -> Self {
        let text = fs::read_to_string(root().join(path))
            .unwrap_or_else(|error| panic!("cannot read {path}: {error}"));
        let path = path.to_owned();
        Self { path, text }
    }

    /// Whether the file lies in this folder.
    pub fn is_in(&self, folder: &str) -> bool {
        Path::new(&self.path).starts_with(folder)
    }

    /// Whether the name of the file ends like this.
    pub fn ends_with(&self, end: &str) -> bool {
        self.path.ends_with(end)
    }
}

/// Every text file that is written here, ascending by path.
pub fn all() -> Vec<TextFile> {
    let mut found = Vec::new();
    collect("", &mut found);
    found.sort_by(|one, other| one.path.cmp(&other.path));
    assert!(found.len() > 300, "found {} files only", found.len());
    found
}

/// What lies at the root of the repository.
pub fn top_level() -> Vec<String> {
    entries("").into_iter().map(|(name, _)| name).collect()
}

fn entries(folder: &str) -> Vec<(String, bool)> {
    fs::read_dir(root().join(folder))
        .unwrap()
        .map(|entry| entry.unwrap())
        .map(|entry| {
            let name = entry.file_name().into_string().unwrap();
            (name, entry.file_type().unwrap().is_dir())
        })
        .filter(|(name, is_folder)| {
            let is_hidden = name.starts_with('.') && name != ".ci";
            !(*is_folder && is_hidden || GENERATED.contains(&name.as_str()))
        })
        .collect()
}

fn collect(folder: &str, found: &mut Vec<TextFile>) {
    for (name, is_folder) in entries(folder) {
        let path = if folder.is_empty() {
            name
        } else {
            format!("{folder}/{name}")
        };
        if is_folder {
            collect(&path, found);
        } else if !OF_OTHERS.contains(&path.as_str())
            && let Ok(text) = fs::read_to_string(root().join(&path))
        {
            found.push(TextFile { path, text });
        }
    }
}

/// The lines of one table of a manifest.
pub fn table<'a>(manifest: &'a str, name: &str) -> impl Iterator<Item = &'a str> {
    let header = format!("[{name}]");
    manifest
        .lines()
        .skip_while(move |line| *line != header)
        .skip(1)
        .take_while(|line| !line.starts_with('['))
}

/// The folder of each package of the workspace.
pub fn members() -> Vec<String> {
    let manifest = TextFile::read("Cargo.toml");
    let members = table(&manifest.text, "workspace").filter_map(|line| {
        let member = line.trim().strip_prefix('"')?;
        member.strip_suffix("\",")
    });
    members.map(str::to_owned).collect()
}
