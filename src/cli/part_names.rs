//! From the part names that a user writes to part numbers.

use super::error::CliError;
use crate::geometry::SourceAssembly;

/// How many near misses a message lists.
const SUGGESTIONS: usize = 3;

/// The numbers of named parts, each once, in the assembly's order.
///
/// # Errors
/// There is no such part; the message names those that are spelled most alike.
pub(super) fn resolve(
    assembly: &SourceAssembly,
    option: &str,
    names: &[String],
) -> Result<Vec<usize>, CliError> {
    let find = |name: &String| part_named(assembly, option, name);
    let mut parts = names.iter().map(find).collect::<Result<Vec<_>, _>>()?;
    parts.sort_unstable();
    parts.dedup();
    Ok(parts)
}

/// The number of a named part.
///
/// # Errors
/// There is no such part; the message names those that are spelled most alike.
pub(super) fn part_named(assembly: &SourceAssembly, option: &str, name: &str) -> Result<usize, CliError> {
    let found = assembly.parts.iter().position(|p| p.name == name);
    found.ok_or_else(|| CliError::Refused(unknown(assembly, option, name)))
}

fn unknown(assembly: &SourceAssembly, option: &str, name: &str) -> String {
    let mut alike: Vec<(f64, &str)> = assembly
        .parts
        .iter()
        .map(|p| (strsim::jaro_winkler(&p.name.to_lowercase(), &name.to_lowercase()), p.name.as_str()))
        .collect();
    alike.sort_by(|a, b| b.0.total_cmp(&a.0));
    let nearest: Vec<String> = alike.iter().take(SUGGESTIONS).map(|(_, n)| format!("`{n}`")).collect();
    format!(
        "{option}: the assembly `{}` has no part `{name}`; the nearest names are {}",
        assembly.name,
        nearest.join(", ")
    )
}

#[cfg(test)]
mod tests {
    use super::resolve;
    use crate::geometry::{SourceAssembly, SourceMesh, SourcePart};

    fn assembly(names: &[&str]) -> SourceAssembly {
        let part =
            |n: &&str| SourcePart { name: (*n).into(), origin: "x".into(), mesh: SourceMesh::default() };
        SourceAssembly {
            name: "gearbox".into(),
            parts: names.iter().map(part).collect(),
            ..Default::default()
        }
    }

    #[test]
    fn names_become_sorted_numbers() {
        let names = ["c".to_owned(), "a".to_owned(), "c".to_owned()];
        assert_eq!(resolve(&assembly(&["a", "b", "c"]), "--fixed", &names).unwrap(), [0, 2]);
    }

    #[test]
    fn unknown_names_are_told_with_the_nearest() {
        let error = resolve(
            &assembly(&["bolt-1", "bolt-2", "housing", "nut-1", "washer"]),
            "--fixed",
            &["blot-1".into()],
        )
        .unwrap_err()
        .to_string();
        assert!(
            error.contains("--fixed") && error.contains("gearbox") && error.contains("`bolt-1`"),
            "{error}"
        );
        assert!(!error.contains("washer"), "{error}");
    }
}
