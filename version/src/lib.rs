//! The version of the programs.

/// The version; that of a release build also names its commit, where git knows it.
pub const VERSION: &str = env!("FORMATION_VERSION");

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_version_is_that_of_the_package_with_the_commit_of_a_release_build() {
        let (version, commit) = match VERSION.split_once(' ') {
            Some((version, commit)) => (version, Some(commit)),
            None => (VERSION, None),
        };
        assert_eq!(version, env!("CARGO_PKG_VERSION"));
        if let Some(commit) = commit {
            let digits = commit.strip_prefix('(').unwrap().strip_suffix(')').unwrap();
            assert!(digits.chars().all(|digit| digit.is_ascii_hexdigit()));
        }
    }
}
