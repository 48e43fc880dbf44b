//! An assembly as given, before healing and scaling.

use nalgebra::{Point3, UnitQuaternion};
use serde::{Deserialize, Serialize};

use super::Pose;

/// A triangle mesh as given: nothing is known to be valid yet.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct SourceMesh {
    /// Vertex positions in the input's units and frame, at the assembled pose.
    pub vertices: Vec<[f64; 3]>,
    /// Vertex indices, three per triangle, counter-clockwise from outside.
    pub triangles: Vec<[u32; 3]>,
}

/// One part as given.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SourcePart {
    /// The part's name: the file stem, or the node's name in a scene. Unique in its assembly.
    pub name: String,
    /// Where it came from, for messages: a file path, or `upload`.
    pub origin: String,
    /// The geometry.
    pub mesh: SourceMesh,
}

/// A group that the input names: a node of a scene, a product of a CAD program.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SourceGroup {
    /// Its name; for nested groups, the names from the outside in, separated by slashes.
    pub name: String,
    /// The names of all parts in it, including those of nested groups. At least two.
    pub parts: Vec<String>,
}

/// An assembly as given. Parts stand in natural order of their names ("2" before "10").
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct SourceAssembly {
    /// A name for display.
    pub name: String,
    /// The unit of length, if known ("mm").
    pub units: Option<String>,
    /// The parts.
    pub parts: Vec<SourcePart>,
    /// Names of parts that the assembly's own description declares fixed.
    pub fixed: Vec<String>,
    /// Names of parts that stay as long as others leave, if the description says so. They belong to requests about the
    /// assembly, not to its content.
    #[serde(skip)]
    pub base: Vec<String>,
    /// Names of parts that stay unless others cannot leave otherwise, if the description says so. Not content, either.
    #[serde(skip)]
    pub keep: Vec<String>,
    /// Names of parts that are in the way and do not come apart, if the description says so. Not content, either.
    #[serde(skip)]
    pub keep_out: Vec<String>,
    /// How far triangles may be from the surfaces that they stand for, where these were made from others (STEP):
    /// overlaps up to that depth may be of the triangles alone. In the assembly's units. Not content, either.
    #[serde(skip)]
    pub resolution: Option<f64>,
    /// Which parts belong together, outer groups before inner ones. Not content, either.
    #[serde(skip)]
    pub groups: Vec<SourceGroup>,
    /// Where parts wait before they are put in, if the description says so: the motion of the mesh from where it stands
    /// assembled. Not content, either.
    #[serde(skip)]
    pub waiting: Vec<(String, Pose)>,
    /// Warnings about what was left out, decided or doubtful when the files were read, in sentences that name the file.
    /// Not content, either.
    #[serde(skip)]
    pub notes: Vec<String>,
}

impl SourceAssembly {
    /// Rotates all parts together about the origin of the input's frame.
    pub fn rotate(&mut self, rotation: &UnitQuaternion<f64>) {
        let turn = Pose::from_parts(Default::default(), *rotation);
        self.waiting.iter_mut().for_each(|(_, pose)| *pose = turn * *pose * turn.inverse());
        let matrix = rotation.to_rotation_matrix();
        for vertex in self.parts.iter_mut().flat_map(|p| &mut p.mesh.vertices) {
            *vertex = (matrix * Point3::from(*vertex)).coords.into();
        }
    }
}
