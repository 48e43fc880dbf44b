//! How files are read.

use glob::{MatchOptions, Pattern};

use super::step::StepSettings;

/// What is a part in a file that holds several.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Split {
    /// Each object or group of an OBJ file, solid of an STL file, primitive of a glTF mesh that the file tells apart.
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

/// How files are read; by default as they say themselves.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct LoadOptions {
    /// What is a part in a file that holds several [default: what a file of a whole assembly tells apart by name].
    pub split: Option<Split>,
    /// Patterns of file and part names that are left out.
    pub ignore: Vec<IgnorePattern>,
    /// How STEP files are converted; if it is not said, they are not: that runs a program.
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
    /// Whether a name is meant. Capital and small letters are different.
    #[must_use]
    pub fn matches(&self, name: &str) -> bool {
        self.0.matches_with(name, MatchOptions::new())
    }

    /// The pattern as it was given.
    #[must_use]
    pub fn as_str(&self) -> &str {
        self.0.as_str()
    }
}
