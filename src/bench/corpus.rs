//! The assemblies of a benchmark: every folder with meshes, however deep.

use std::collections::HashMap;
use std::collections::HashSet;
use std::ffi::OsStr;
use std::path::{Path, PathBuf};
use std::str::FromStr;

use super::BenchError;
use crate::files::natural_order;

/// The paper's groups of problems by their number of parts.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Category {
    /// One or two parts. The paper has none of these, so they never count towards its totals.
    Pair,
    /// 3 to 9 parts.
    Small,
    /// 10 to 49 parts.
    Medium,
    /// 50 parts and more.
    Large,
}

impl Category {
    /// All of them, by size.
    pub const ALL: [Self; 4] = [Self::Pair, Self::Small, Self::Medium, Self::Large];

    /// The category of a problem with so many parts.
    #[must_use]
    pub fn of(parts: usize) -> Self {
        match parts {
            0..3 => Self::Pair,
            3..10 => Self::Small,
            10..50 => Self::Medium,
            _ => Self::Large,
        }
    }

    /// Its name in the records.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Pair => "pair",
            Self::Small => "small",
            Self::Medium => "medium",
            Self::Large => "large",
        }
    }
}

/// One assembly to be planned.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct CorpusProblem {
    /// Its name in the records: the given folder's name and the path below it, so that it is
    /// the same on every machine.
    pub name: String,
    /// Where it is.
    pub folder: PathBuf,
    /// How many meshes it has.
    pub parts: usize,
}

/// All assemblies below the given folders, in natural order of their names.
///
/// # Errors
/// A folder cannot be read or has no assembly in it, or two assemblies would have one name.
pub fn find(roots: &[PathBuf]) -> Result<Vec<CorpusProblem>, BenchError> {
    let mut found = Vec::new();
    for root in roots {
        let before = found.len();
        let place = root.canonicalize().map_err(|e| BenchError::file(root, &e))?;
        let name = place.file_name().unwrap_or(OsStr::new("root")).to_string_lossy().into_owned();
        collect(&place, name, &mut HashSet::new(), &mut found)?;
        if found.len() == before {
            let reason = format!("{}: no folder with .obj or .stl files in it", root.display());
            return Err(BenchError::Refused(reason));
        }
    }
    found.sort_by(|a, b| natural_order(&a.name, &b.name));
    check_names(&found)?;
    Ok(found)
}

/// Goes into every folder once, links included: a link to a folder above it would never end.
fn collect(
    folder: &Path,
    name: String,
    visited: &mut HashSet<PathBuf>,
    found: &mut Vec<CorpusProblem>,
) -> Result<(), BenchError> {
    let unreadable = |e: std::io::Error| BenchError::file(folder, &e);
    if !visited.insert(folder.canonicalize().map_err(unreadable)?) {
        return Ok(());
    }
    let (mut parts, mut below) = (0, Vec::new());
    for entry in std::fs::read_dir(folder).map_err(unreadable)? {
        let path = entry.map_err(unreadable)?.path();
        let Some(file) = path.file_name().map(|n| n.to_string_lossy().into_owned()) else { continue };
        if file.starts_with('.') {
            continue;
        }
        if path.is_dir() {
            below.push((file, path));
        } else if is_mesh(&path) {
            parts += 1;
        }
    }
    // Sorted, so that of two links to one folder the same one counts on every machine.
    below.sort_by(|a, b| natural_order(&a.0, &b.0));
    if parts > 0 {
        found.push(CorpusProblem { name: name.clone(), folder: folder.to_owned(), parts });
    }
    below.into_iter().try_for_each(|(file, path)| collect(&path, format!("{name}/{file}"), visited, found))
}

fn is_mesh(path: &Path) -> bool {
    path.extension().is_some_and(|e| e.eq_ignore_ascii_case("obj") || e.eq_ignore_ascii_case("stl"))
}

fn check_names(problems: &[CorpusProblem]) -> Result<(), BenchError> {
    let mut by_name = HashMap::new();
    for problem in problems {
        if let Some(other) = by_name.insert(&problem.name, &problem.folder) {
            return Err(BenchError::Refused(format!(
                "{} and {} would both be called `{}`; give a folder above both",
                other.display(),
                problem.folder.display(),
                problem.name
            )));
        }
    }
    Ok(())
}

/// One machine's part of a corpus, written `K/N`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Shard {
    number: usize,
    of: usize,
}

impl Shard {
    /// The whole corpus.
    pub const WHOLE: Self = Self { number: 1, of: 1 };

    /// Every N-th problem by size, so that all shards get about as many large ones.
    #[must_use]
    pub fn select(self, problems: Vec<CorpusProblem>) -> Vec<CorpusProblem> {
        let mut order: Vec<usize> = (0..problems.len()).collect();
        order.sort_by_key(|&i| problems[i].parts);
        let mine: HashSet<usize> = order.into_iter().skip(self.number - 1).step_by(self.of).collect();
        let numbered = problems.into_iter().enumerate();
        numbered.filter(|(i, _)| mine.contains(i)).map(|(_, problem)| problem).collect()
    }
}

impl FromStr for Shard {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let wrong = || format!("`{text}` is not K/N with 1 ≤ K ≤ N, as 2/8");
        let (number, of) = text.split_once('/').ok_or_else(wrong)?;
        let parse = |t: &str| t.parse::<usize>().map_err(|_| wrong());
        let shard = Self { number: parse(number)?, of: parse(of)? };
        if (1..=shard.of).contains(&shard.number) { Ok(shard) } else { Err(wrong()) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn problems(parts: &[usize]) -> Vec<CorpusProblem> {
        let problem = |(i, &parts): (usize, &usize)| CorpusProblem {
            name: format!("c/{i}"),
            folder: PathBuf::from(i.to_string()),
            parts,
        };
        parts.iter().enumerate().map(problem).collect()
    }

    #[test]
    fn categories_begin_where_the_papers_begin() {
        let at = |parts: &[usize]| parts.iter().map(|&p| Category::of(p).name()).collect::<Vec<_>>();
        assert_eq!(at(&[1, 2, 3, 9]), ["pair", "pair", "small", "small"]);
        assert_eq!(at(&[10, 49, 50, 900]), ["medium", "medium", "large", "large"]);
    }

    #[test]
    fn shards_cover_all_problems_exactly_once_and_share_the_large_ones() {
        let all = problems(&[3, 60, 3, 70, 12, 4, 80, 3, 90, 5, 3]);
        for of in 1..=12 {
            let shards: Vec<Vec<CorpusProblem>> =
                (1..=of).map(|k| format!("{k}/{of}").parse::<Shard>().unwrap().select(all.clone())).collect();
            let mut names: Vec<&str> = shards.iter().flatten().map(|p| p.name.as_str()).collect();
            names.sort_by(|a, b| natural_order(a, b));
            assert_eq!(names, all.iter().map(|p| p.name.as_str()).collect::<Vec<_>>(), "{of} shards");
            let large = |s: &Vec<CorpusProblem>| s.iter().filter(|p| p.parts >= 50).count();
            let (least, most) = (shards.iter().map(large).min(), shards.iter().map(large).max());
            assert!(most.unwrap() - least.unwrap() <= 1, "{of} shards");
        }
    }

    #[test]
    fn a_shard_is_k_of_n() {
        assert_eq!("1/1".parse(), Ok(Shard::WHOLE));
        for wrong in ["", "1", "0/3", "4/3", "1/0", "-1/2", "a/b", "1/2/3"] {
            assert!(wrong.parse::<Shard>().is_err(), "{wrong}");
        }
    }

    #[test]
    fn every_folder_with_meshes_is_an_assembly() {
        let folder = tempfile::tempdir().unwrap();
        let corpus = folder.path().join("corpus");
        for file in [
            "10/0.obj",
            "2/0.obj",
            "2/1.OBJ",
            "2/translation.json",
            "2/inner/a.stl",
            "empty/x.txt",
            ".git/a.obj",
        ] {
            let path = corpus.join(file);
            std::fs::create_dir_all(path.parent().unwrap()).unwrap();
            std::fs::write(path, "").unwrap();
        }
        std::os::unix::fs::symlink(&corpus, corpus.join("empty/loop")).unwrap();
        let found = find(std::slice::from_ref(&corpus)).unwrap();
        let rows: Vec<(&str, usize)> = found.iter().map(|p| (p.name.as_str(), p.parts)).collect();
        assert_eq!(rows, [("corpus/2", 2), ("corpus/2/inner", 1), ("corpus/10", 1)]);
        let twice = find(&[corpus.clone(), corpus.clone()]).unwrap_err().to_string();
        assert!(twice.contains("`corpus/2`"), "{twice}");
        assert!(find(&[corpus.join("empty/none")]).unwrap_err().to_string().contains("none"));
        std::fs::create_dir(folder.path().join("bare")).unwrap();
        let bare = find(&[folder.path().join("bare")]).unwrap_err().to_string();
        assert!(bare.contains("no folder with"), "{bare}");
    }
}
