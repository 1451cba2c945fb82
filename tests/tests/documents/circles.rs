//! No files of a crate import each other in a circle.
//!
//! This reads text: `use` lines, and paths that begin with `crate`, `self` or `super`, outside of comments and tests. An item
//! that a file hands on (`pub use`) is taken to be imported from where it is defined. Methods of a type in another file are no
//! imports, and neither are `mod` lines. What stands in the file of a folder (`mod.rs`, `lib.rs`) is there for all files of the
//! folder, so they may import it although it imports from them.

use std::collections::{BTreeMap, BTreeSet};

use super::files::{self, TextFile};

/// A path of the language, such as `super::plan::Plan`.
type Segments = Vec<String>;

/// One file of a crate.
struct Source {
    /// Its module: `["paths", "group"]`.
    module: Segments,
    /// The code without comments, tests and `use` lines.
    code: String,
    /// What it imports: the path, the name under which it is known here, and whether others can import it from here.
    imports: Vec<(Segments, String, bool)>,
}

/// The code before the tests, without comments and string literals of one line.
fn code_of(text: &str) -> String {
    let tests = text.match_indices("#[cfg(test)]\n").find(|(at, mark)| {
        let next = text[at + mark.len()..].lines().next();
        next.is_some_and(|line| line.ends_with("mod tests {"))
    });
    let code = tests.map_or(text, |(at, _)| &text[..at]);
    let lines = code.lines().map(|line| {
        let parts: Vec<&str> = line.split('"').step_by(2).collect();
        let line = parts.join("\"\"");
        line.split("//").next().unwrap_or_default().to_owned()
    });
    lines.collect::<Vec<_>>().join("\n")
}

/// The paths of a `use` tree, without `use` and `;`.
fn expand(tree: &str, prefix: &[String], found: &mut Vec<(Segments, String)>) {
    let Some((head, rest)) = tree.split_once('{') else {
        let (path, alias) = tree.split_once(" as ").unwrap_or((tree, ""));
        let mut segments = prefix.to_vec();
        segments.extend(path.trim().split("::").map(str::to_owned));
        if segments.last().is_some_and(|last| last == "self") && segments.len() > 1 {
            segments.pop();
        }
        let name = match alias.trim() {
            "" => segments.last().cloned().unwrap_or_default(),
            alias => alias.to_owned(),
        };
        found.push((segments, name));
        return;
    };
    let mut segments = prefix.to_vec();
    let head = head.trim().split("::").filter(|part| !part.is_empty());
    segments.extend(head.map(str::to_owned));
    let inner = rest.rsplit_once('}').map_or(rest, |(inner, _)| inner);
    let (mut depth, mut start) = (0, 0);
    let ends = inner
        .char_indices()
        .chain([(inner.len(), ',')])
        .filter(|&(_, symbol)| {
            depth += i32::from(symbol == '{') - i32::from(symbol == '}');
            symbol == ',' && depth == 0
        });
    for (end, _) in ends.collect::<Vec<_>>() {
        let part = inner[start..end].trim();
        if !part.is_empty() {
            expand(part, &segments, found);
        }
        start = (end + 1).min(inner.len());
    }
}

/// The module of a file below `src`.
fn module_of(path: &str) -> Segments {
    let path = path.trim_end_matches(".rs");
    let parts = path.split('/').map(str::to_owned);
    let mut module: Segments = parts.collect();
    let is_root = module.len() == 1 && ["lib", "main"].contains(&module[0].as_str());
    if is_root || module.last().is_some_and(|last| last == "mod") {
        module.pop();
    }
    module
}

fn source(below_src: &str, text: &str) -> Source {
    let mut code = String::new();
    let mut imports = Vec::new();
    let mut lines = text.lines();
    while let Some(line) = lines.next() {
        let words = line.trim_start();
        let (visibility, tree) = words.split_once("use ").unwrap_or(("no import", ""));
        let visibility = visibility.trim_end();
        let is_public =
            visibility == "pub" || visibility.starts_with("pub(") && visibility.ends_with(')');
        if !visibility.is_empty() && !is_public {
            code.push_str(line);
            code.push('\n');
            continue;
        }
        let mut tree = tree.to_owned();
        while !tree.contains(';') {
            let Some(line) = lines.next() else { break };
            tree.push_str(line);
        }
        let mut found = Vec::new();
        expand(tree.trim_end().trim_end_matches(';'), &[], &mut found);
        let found = found
            .into_iter()
            .map(|(path, name)| (path, name, is_public));
        imports.extend(found);
    }
    let module = module_of(below_src);
    Source {
        module,
        code,
        imports,
    }
}

/// Whether a text has a name as a word of its own.
fn has_word(text: &str, name: &str) -> bool {
    let is_word = |symbol: char| symbol.is_alphanumeric() || symbol == '_';
    text.match_indices(name).any(|(at, _)| {
        let (before, after) = (&text[..at], &text[at + name.len()..]);
        !before.ends_with(is_word) && !after.starts_with(is_word)
    })
}

/// The paths within a text that begin with `crate`, `self` or `super`.
fn paths_in(code: &str) -> Vec<Segments> {
    let is_part = |symbol: char| symbol.is_alphanumeric() || symbol == '_' || symbol == ':';
    let words = code.split(|symbol: char| !is_part(symbol));
    let paths = words.filter(|word| {
        ["crate::", "self::", "super::"]
            .iter()
            .any(|start| word.starts_with(start))
    });
    paths
        .map(|path| {
            path.trim_end_matches(':')
                .split("::")
                .map(str::to_owned)
                .collect()
        })
        .collect()
}

/// The files of one crate, by module.
struct Package(BTreeMap<Segments, Source>);

impl Package {
    fn of(files: &[(&str, &str)]) -> Self {
        let sources = files
            .iter()
            .map(|(path, text)| source(path, &code_of(text)));
        Self(sources.map(|one| (one.module.clone(), one)).collect())
    }

    /// The path from the root of the crate; `None` for a path into another crate.
    fn absolute(&self, within: &[String], path: &[String]) -> Option<Segments> {
        let mut module = within.to_vec();
        let mut rest = path;
        match path.first()?.as_str() {
            "crate" => (module, rest) = (Vec::new(), &path[1..]),
            "self" => rest = &path[1..],
            "super" => {
                while let Some((first, left)) = rest.split_first()
                    && first == "super"
                {
                    module.pop();
                    rest = left;
                }
            }
            child => {
                let module = [within, &[child.to_owned()]].concat();
                self.0.contains_key(&module).then_some(())?;
            }
        }
        module.extend_from_slice(rest);
        Some(module)
    }

    /// The module that defines what an absolute path names. `depth` bounds the names that are handed on.
    fn defining(&self, path: &[String], depth: usize) -> Option<Segments> {
        let length = (0..=path.len())
            .rev()
            .find(|&length| self.0.contains_key(&path[..length]))?;
        let (module, rest) = path.split_at(length);
        let Some(name) = rest.first().filter(|_| depth > 0) else {
            return Some(module.to_vec());
        };
        let handed_on = self.0[module].imports.iter().filter(|import| import.2);
        for (import, alias, _) in handed_on {
            let import = self.absolute(module, import);
            let Some(import) = import.filter(|_| alias == name || alias == "*") else {
                continue;
            };
            if alias == name {
                return self.defining(&import, depth - 1);
            }
            let all = import[..import.len() - 1].to_vec();
            let source = self.0.get(&all);
            if source.is_some_and(|source| defines(&source.code, name)) {
                return Some(all);
            }
        }
        Some(module.to_vec())
    }

    /// The modules from which each module imports.
    fn arrows(&self) -> BTreeMap<Segments, BTreeSet<Segments>> {
        let arrows_of = |source: &Source| {
            // A name that is only handed on is not used here.
            let used = source
                .imports
                .iter()
                .filter(|(_, name, is_public)| !is_public || has_word(&source.code, name));
            let used = used.map(|(path, ..)| path.clone());
            let paths = used.chain(paths_in(&source.code));
            let paths = paths.filter_map(|path| self.absolute(&source.module, &path));
            let modules = paths.filter_map(|path| self.defining(&path, 4));
            modules
                .filter(|module| !source.module.starts_with(module))
                .collect()
        };
        let sources = self.0.iter();
        sources
            .map(|(module, source)| (module.clone(), arrows_of(source)))
            .collect()
    }

    /// The modules from which a way along arrows leads back.
    fn circles(&self) -> Vec<String> {
        let arrows = self.arrows();
        let reached = |from: &Segments| {
            let mut reached: BTreeSet<&Segments> = BTreeSet::new();
            let mut open: Vec<&Segments> = arrows[from].iter().collect();
            while let Some(next) = open.pop() {
                if reached.insert(next) {
                    open.extend(&arrows[next]);
                }
            }
            reached
        };
        let all: BTreeMap<&Segments, _> = arrows.keys().map(|from| (from, reached(from))).collect();
        let mut lines = Vec::new();
        for (from, to) in &arrows {
            for to in to.iter().filter(|to| all[to].contains(from)) {
                lines.push(format!("{} -> {}", from.join("::"), to.join("::")));
            }
        }
        lines
    }
}

/// Whether the source defines an item of this name.
fn defines(source: &str, name: &str) -> bool {
    let kinds = [
        "fn", "struct", "enum", "const", "static", "trait", "type", "mod",
    ];
    kinds
        .iter()
        .any(|kind| has_word(source, &format!("{kind} {name}")))
}

#[test]
fn no_files_import_each_other_in_a_circle() {
    let files = files::all();
    let mut found = Vec::new();
    let mut count = 0;
    for member in files::members() {
        let folder = format!("{member}/src/");
        let below = |file: &'_ TextFile| {
            let path = file.path.strip_prefix(&folder)?;
            let is_test = path
                .split('/')
                .any(|part| part == "tests" || part == "tests.rs");
            (path.ends_with(".rs") && !is_test).then(|| path.to_owned())
        };
        let sources: Vec<(String, &str)> = files
            .iter()
            .filter_map(|file| Some((below(file)?, file.text.as_str())))
            .collect();
        let has_library = sources.iter().any(|(path, _)| path == "lib.rs");
        let sources: Vec<(&str, &str)> = sources
            .iter()
            .filter(|(path, _)| !(has_library && path == "main.rs"))
            .map(|(path, text)| (path.as_str(), *text))
            .collect();
        let package = Package::of(&sources);
        count += package.arrows().values().map(BTreeSet::len).sum::<usize>();
        let circles = package.circles().into_iter();
        found.extend(circles.map(|circle| format!("{member}: {circle}")));
    }
    assert!(count > 500, "found {count} imports only");
    assert!(found.is_empty(), "{}", found.join("\n"));
}

#[test]
fn a_circle_is_found_through_names_that_are_handed_on() {
    let package = Package::of(&[
        ("lib.rs", "mod one;\nmod other;\npub use one::*;\n"),
        (
            "one.rs",
            "use super::other::{self, Other};\npub struct One(Other);\n",
        ),
        (
            "other.rs",
            "pub struct Other;\nfn back(one: &crate::One) {}\n",
        ),
    ]);
    assert_eq!(package.circles(), ["one -> other", "other -> one"]);
}

#[test]
fn what_is_handed_on_only_makes_no_circle() {
    let package = Package::of(&[
        (
            "lib.rs",
            "mod one;\npub use one::One;\npub const MANY: u32 = 3;\n",
        ),
        (
            "one.rs",
            "use super::MANY;\n// use super::other;\npub struct One;\n#[cfg(test)]\nmod tests {}\n",
        ),
    ]);
    assert_eq!(package.circles(), [""; 0]);
}
