//! How files are read.

use glob::{MatchOptions, Pattern};

use super::step::StepSettings;

/// What counts as a part in a file that holds several.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Split {
    /// Each object or group of an OBJ file, solid of an STL file, or primitive of a glTF mesh.
    Objects,
    /// Each separate body.
    Bodies,
    /// The whole file, or each node of a scene.
    None,
}

impl std::str::FromStr for Split {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text {
            "objects" => Ok(Self::Objects),
            "bodies" => Ok(Self::Bodies),
            "none" => Ok(Self::None),
            _ => Err(format!("`{text}` is none of objects, bodies, none")),
        }
    }
}

impl std::fmt::Display for Split {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Objects => "objects",
            Self::Bodies => "bodies",
            Self::None => "none",
        })
    }
}

/// How files are read.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct LoadOptions {
    /// What counts as a part in a file that holds several [default: what a file with a whole assembly names].
    pub split: Option<Split>,
    /// Patterns of file and part names that are left out.
    pub ignore: Vec<IgnorePattern>,
    /// How STEP files are converted. `None`: they are not, because that runs a program.
    pub step: Option<StepSettings>,
}

/// A pattern of names: `*` stands for any characters, `?` for one, `[ab]` for one of some.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct IgnorePattern(Pattern);

impl std::str::FromStr for IgnorePattern {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        Pattern::new(text).map(Self).map_err(|e| format!("`{text}` is no pattern of names: {e}"))
    }
}

impl IgnorePattern {
    /// Whether a name matches. Upper and lower case differ.
    #[must_use]
    pub fn matches(&self, name: &str) -> bool {
        self.0.matches_with(name, MatchOptions::new())
    }

    /// The pattern as given.
    #[must_use]
    pub fn as_str(&self) -> &str {
        self.0.as_str()
    }
}
