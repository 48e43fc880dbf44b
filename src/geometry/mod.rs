//! Geometry: from meshes as given to healed ones in the planning frame.
//!
//! Conventions, fixed here for the whole project: right-handed frames; radians; triangles
//! counter-clockwise from outside; signed distances negative inside; a pose `a_from_b` maps
//! coordinates of `b` to `a`. Input units and frame are the user's ("input frame"); planning
//! happens in the *planning frame*, the input frame scaled by a power of two so that the
//! assembly's longest side falls in (5, 10].

mod assembly;
mod bodies;
mod bounds;
mod closed_shell;
mod cone;
mod congruence;
mod content_hash;
mod convex_edges;
mod critical_coordinates;
mod cross_section;
mod dipoles;
mod edge_centres;
mod error;
mod faces;
mod floor;
mod folds;
mod free_region;
mod half_space;
mod heal;
mod helix;
mod hull;
mod hull_depth;
mod incidence;
mod inner_points;
mod joined;
mod leading;
mod linking_number;
mod mass;
mod mesh;
mod oriented;
mod own_frame;
mod patch_tree;
mod pose;
mod random;
mod ray;
mod records;
mod repeated;
mod revision;
mod rim;
mod sample_tree;
mod samples;
mod screw;
mod shape;
mod solid_angle;
mod source;
mod surface;
mod surface_loops;
mod triangle;
mod triangle_tree;

pub use assembly::{Assembly, Part};
pub use bodies::{bodies, is_closed};
pub use bounds::Bounds;
pub use closed_shell::is_within_closed_shell;
pub use cone::extreme_rays;
pub use content_hash::content_hash;
pub use convex_edges::{ConvexEdge, ConvexEdges, Corner};
pub use critical_coordinates::{critical_coordinates, sharp_edges};
pub use cross_section::{Contour, across, cross_section, is_surrounded};
pub use edge_centres::edge_centres;
pub use error::GeometryError;
pub use faces::{Faces, NEAR_AXIS, SQUARE, WeightedDirection, oriented};
pub use floor::Floor;
pub use free_region::{FreeRegion, NoRegion, Wanted};
pub use half_space::Cloud;
pub(crate) use heal::same_places;
pub use heal::{Healed, heal, heal_until};
pub use helix::{Footprint, Helix, radii};
pub use hull::{
    HullDistance, Support, gap_along, hull_distance, hull_vertices, separating, separating_direction,
    transformed,
};
pub use hull_depth::HullDepth;
pub use inner_points::SurfacePoint;
pub use linking_number::linking_number;
pub use mass::MassProperties;
pub use mesh::{Edge, Mesh, Solidity};
pub use oriented::OrientedSamples;
pub use patch_tree::{Parts, PatchTree};
pub use pose::{Pose, Waypoint, interpolate, pose_from_waypoint, scaled_pose, waypoint_from_pose};
pub use random::Uniform;
pub(crate) use records::{
    AssemblySource, HEALED, SHAPE, SOURCE, add_bounds, add_pose, has_source, healed_assembly, recent_sources,
    remember_given, remember_healed, remember_revised, source_of,
};
pub use repeated::Repetition;
pub use revision::Revision;
pub use rim::{Rim, RimEdge, WINDING_DOUBT};
pub use sample_tree::{Look, SampleBall, SampleNode, SampleTree};
pub use samples::Spacing;
pub use screw::Screw;
pub use shape::Shape;
pub use source::{SourceAssembly, SourceGroup, SourceMesh, SourcePart};
pub use surface::{SignedClosest, Surface};
pub use surface_loops::surface_loops;
pub use triangle::{Closest, Feature, area_normal, bisected, closest_on_triangle};
