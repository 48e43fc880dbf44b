//! Names of parts from the names in a file's tree.

use std::collections::{HashMap, HashSet};

use super::text::printable;

/// A name for each of several bodies, by the names of the nodes above it and its own. The own name if only one body
/// has it; else with as many of the names above as tell it apart, with slashes between; else with a number.
pub(super) fn unique_names(paths: &[Vec<String>]) -> Vec<String> {
    let paths: Vec<Vec<String>> = paths.iter().map(|path| named(path)).collect();
    let tail = |path: &[String], length: usize| path[path.len().saturating_sub(length)..].join("/");
    let mut names: Vec<String> = paths.iter().map(|path| tail(path, 1)).collect();
    let deepest = paths.iter().map(Vec::len).max().unwrap_or(0);
    for length in 2..=deepest {
        let mut by_name: HashMap<&str, HashSet<&[String]>> = HashMap::new();
        for (name, path) in names.iter().zip(&paths) {
            by_name.entry(name).or_default().insert(path);
        }
        // Where all paths are the same, too, no name above tells anything apart.
        let lengthened = |(name, path): (&String, &Vec<String>)| match by_name.get(name.as_str()) {
            Some(paths) if paths.len() > 1 => tail(path, length),
            _ => name.clone(),
        };
        names = names.iter().zip(&paths).map(lengthened).collect();
    }
    let equal = counts(&names);
    let mut taken: HashMap<String, usize> = HashMap::new();
    let numbered = |name: String| {
        if equal.get(&name).is_none_or(|&n| n < 2) {
            return name;
        }
        loop {
            let count = taken.entry(name.clone()).or_default();
            *count += 1;
            let candidate = if *count == 1 { name.clone() } else { format!("{name}-{count}") };
            if candidate == name || !equal.contains_key(&candidate) {
                return candidate;
            }
        }
    };
    names.into_iter().map(numbered).collect()
}

fn counts(names: &[String]) -> HashMap<String, usize> {
    let mut counts = HashMap::new();
    names.iter().for_each(|name| *counts.entry(name.clone()).or_default() += 1);
    counts
}

/// The names from the outside in, with slashes between.
pub(super) fn shown_path(path: &[String]) -> String {
    named(path).join("/")
}

/// The names of a path that say something, ready to be shown.
fn named(path: &[String]) -> Vec<String> {
    let names = path.iter().map(|name| printable(name.trim()));
    let names: Vec<String> = names.filter(|name| !name.is_empty() && !is_placeholder(name)).collect();
    if names.is_empty() { vec!["part".to_owned()] } else { names }
}

/// Whether a name is a kernel's own label of something without a name, as `=>[0:1:1:3]`.
fn is_placeholder(name: &str) -> bool {
    let inner = name.strip_prefix("=>[").and_then(|rest| rest.strip_suffix(']'));
    inner.is_some_and(|inner| inner.chars().all(|c| c.is_ascii_digit() || c == ':'))
}

#[cfg(test)]
mod tests {
    use super::unique_names;

    #[test]
    fn equal_names_get_what_tells_them_apart() {
        let path = |names: &str| names.split('/').map(str::to_owned).collect::<Vec<_>>();
        for (paths, expected) in [
            (vec!["a/bolt", "a/nut"], vec!["bolt", "nut"]),
            (vec!["a/bolt", "b/bolt", "a/nut"], vec!["a/bolt", "b/bolt", "nut"]),
            (vec!["x/a/bolt", "y/a/bolt"], vec!["x/a/bolt", "y/a/bolt"]),
            (vec!["a/bolt", "a/bolt", "a/bolt"], vec!["bolt", "bolt-2", "bolt-3"]),
            (vec!["a/bolt", "a/bolt", "b/bolt"], vec!["a/bolt", "a/bolt-2", "b/bolt"]),
            (vec!["bolt", "bolt", "bolt-2"], vec!["bolt", "bolt-3", "bolt-2"]),
            (vec!["bolt/=>[0:1:1:3]", "nut/=>[0:1:1]"], vec!["bolt", "nut"]),
            (vec!["=>[0:1]", " "], vec!["part", "part-2"]),
            (vec!["be\u{7}ll"], vec!["be\\u{7}ll"]),
        ] {
            let paths: Vec<_> = paths.into_iter().map(path).collect();
            assert_eq!(unique_names(&paths), expected);
        }
    }
}
