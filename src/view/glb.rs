//! A scene as binary glTF 2.0: plays in Blender and in web viewers.
//!
//! One node per part, with its name, under a root node named after the assembly; one animation with all steps in
//! order, interpolated linearly. A node's origin is the middle of its part's box, so what glTF does between key
//! frames is what the plan promises (of a group that turns, but for a thousandth of the longest side). Parts stay where their paths end: glTF cannot hide nodes.
//!
//! Lengths are metres where the input's unit is known, else one metre per unit; `asset.extras` says which. The
//! nodes of parts are in the input's frame; where z is up there, the root node turns it so that y is.
//! Vertices are single floats relative to the middle of the part's box.

use std::collections::{BTreeMap, HashMap};
use std::f32::consts::FRAC_1_SQRT_2;

use gltf::json::accessor::{ComponentType, GenericComponentType, Type};
use gltf::json::animation::{Channel, Interpolation, Property, Sampler, Target as Animated};
use gltf::json::buffer::{Stride, Target, View};
use gltf::json::material::{PbrBaseColorFactor, PbrMetallicRoughness, StrengthFactor};
use gltf::json::mesh::{Mode, Primitive, Semantic};
use gltf::json::scene::UnitQuaternion;
use gltf::json::validation::{Checked, USize64};
use gltf::json::{self, Accessor, Animation, Asset, Index, Material, Mesh, Node, Root};

use super::{DrawnPart, Keyframe, PALETTE, Placement, PlanScene, Rgb, Up, ViewError};

/// The scene as the bytes of a `.glb` file.
///
/// # Errors
/// It has more than 4 GiB.
pub fn glb(scene: &PlanScene) -> Result<Vec<u8>, ViewError> {
    let mut writer = Writer { scale: metres(scene.units.as_deref()).unwrap_or(1.0), ..Writer::default() };
    writer.materials();
    let nodes = writer.parts(scene);
    writer.scene(scene, &nodes);
    writer.animation(scene, &nodes);
    writer.root.asset = asset(scene);
    writer.finished()
}

/// How many metres a unit of length has, if it is known.
#[must_use]
pub fn metres(units: Option<&str>) -> Option<f64> {
    Some(match units?.trim().to_ascii_lowercase().as_str() {
        "m" | "metre" | "metres" | "meter" | "meters" => 1.0,
        "dm" => 0.1,
        "cm" | "centimetre" | "centimetres" | "centimeter" | "centimeters" => 1e-2,
        "mm" | "millimetre" | "millimetres" | "millimeter" | "millimeters" => 1e-3,
        "um" | "µm" | "μm" | "micrometre" | "micrometer" | "micron" => 1e-6,
        "in" | "inch" | "inches" | "\"" => 0.0254,
        "ft" | "foot" | "feet" => 0.3048,
        _ => return None,
    })
}

fn asset(scene: &PlanScene) -> Asset {
    let notes = serde_json::json!({
        "units": scene.units,
        "metresPerUnit": metres(scene.units.as_deref()),
        "up": match scene.up { Up::Y => "y", Up::Z => "z" },
        "kind": scene.kind.name(),
        "status": scene.status,
    });
    Asset {
        generator: Some(concat!("sbdp ", env!("CARGO_PKG_VERSION")).to_owned()),
        extras: serde_json::value::to_raw_value(&notes).ok(),
        version: "2.0".to_owned(),
        ..Asset::default()
    }
}

#[derive(Default)]
struct Writer {
    root: Root,
    bytes: Vec<u8>,
    /// Metres per unit of the scene.
    scale: f64,
    /// Meshes by what is drawn and its colour; and what is drawn as accessors, which all colours share.
    meshes: HashMap<(usize, usize), Index<Mesh>>,
    surfaces: HashMap<usize, GlbSurface>,
}

#[derive(Clone, Copy)]
struct GlbSurface {
    positions: Index<Accessor>,
    normals: Index<Accessor>,
    indices: Index<Accessor>,
}

impl Writer {
    fn materials(&mut self) {
        self.root.materials = PALETTE.iter().map(material).collect();
    }

    /// A node per part, at its start.
    fn parts(&mut self, scene: &PlanScene) -> Vec<Index<Node>> {
        let mut nodes = Vec::new();
        for part in &scene.parts {
            let mesh = self.mesh(part.drawn, part.colour, &scene.drawn[part.drawn]);
            let node = Node {
                mesh: Some(mesh),
                name: Some(part.name.clone()),
                translation: Some(self.translation(&part.start)),
                rotation: Some(UnitQuaternion(rotation(&part.start))),
                ..Node::default()
            };
            nodes.push(Index::push(&mut self.root.nodes, node));
        }
        nodes
    }

    fn mesh(&mut self, drawn: usize, colour: usize, mesh: &DrawnPart) -> Index<Mesh> {
        if let Some(known) = self.meshes.get(&(drawn, colour)) {
            return *known;
        }
        let surface = match self.surfaces.get(&drawn) {
            Some(known) => *known,
            None => self.surface(mesh),
        };
        self.surfaces.insert(drawn, surface);
        let attributes = BTreeMap::from([
            (Checked::Valid(Semantic::Positions), surface.positions),
            (Checked::Valid(Semantic::Normals), surface.normals),
        ]);
        let primitive = Primitive {
            attributes,
            indices: Some(surface.indices),
            material: Some(Index::new(colour as u32)),
            mode: Checked::Valid(Mode::Triangles),
            extensions: None,
            extras: None,
            targets: None,
        };
        let mesh =
            Mesh { primitives: vec![primitive], name: None, weights: None, extensions: None, extras: None };
        let mesh = Index::push(&mut self.root.meshes, mesh);
        self.meshes.insert((drawn, colour), mesh);
        mesh
    }

    fn surface(&mut self, mesh: &DrawnPart) -> GlbSurface {
        let positions: Vec<[f32; 3]> =
            mesh.positions.iter().map(|p| p.map(|x| (f64::from(x) * self.scale) as f32)).collect();
        let at = self.view(bytemuck::cast_slice(&positions), Some((Target::ArrayBuffer, 12)));
        let (min, max) = extent(&positions);
        let positions = self.accessor(at, positions.len(), ComponentType::F32, Type::Vec3, Some((min, max)));
        let at = self.view(bytemuck::cast_slice(&mesh.normals), Some((Target::ArrayBuffer, 12)));
        let normals = self.accessor(at, mesh.normals.len(), ComponentType::F32, Type::Vec3, None);
        let indices = mesh.triangles.as_flattened();
        // The greatest index of 16 bits is reserved.
        let (at, component) = if mesh.positions.len() < usize::from(u16::MAX) {
            let short: Vec<u16> = indices.iter().map(|&i| i as u16).collect();
            (
                self.view(bytemuck::cast_slice(&short), Some((Target::ElementArrayBuffer, 0))),
                ComponentType::U16,
            )
        } else {
            (
                self.view(bytemuck::cast_slice(indices), Some((Target::ElementArrayBuffer, 0))),
                ComponentType::U32,
            )
        };
        let indices = self.accessor(at, indices.len(), component, Type::Scalar, None);
        GlbSurface { positions, normals, indices }
    }

    fn scene(&mut self, scene: &PlanScene, parts: &[Index<Node>]) {
        let upright = match scene.up {
            Up::Y => [0.0, 0.0, 0.0, 1.0],
            Up::Z => [-FRAC_1_SQRT_2, 0.0, 0.0, FRAC_1_SQRT_2],
        };
        let name = if scene.name.is_empty() { "assembly" } else { &scene.name };
        let root = Node {
            children: Some(parts.to_vec()),
            name: Some(name.to_owned()),
            rotation: Some(UnitQuaternion(upright)),
            ..Node::default()
        };
        let root = Index::push(&mut self.root.nodes, root);
        let scene = json::Scene { nodes: vec![root], name: None, extensions: None, extras: None };
        self.root.scene = Some(Index::push(&mut self.root.scenes, scene));
    }

    fn animation(&mut self, scene: &PlanScene, nodes: &[Index<Node>]) {
        let mut animation = Animation {
            channels: Vec::new(),
            samplers: Vec::new(),
            name: Some(scene.kind.name().to_owned()),
            extensions: None,
            extras: None,
        };
        for (part, node) in scene.parts.iter().zip(nodes) {
            self.motion(&part.keys, *node, &mut animation);
        }
        // One without channels is not valid: nothing moves then.
        if !animation.channels.is_empty() {
            self.root.animations.push(animation);
        }
    }

    fn motion(&mut self, moments: &[Keyframe], node: Index<Node>, animation: &mut Animation) {
        // Moments that are one as single floats would not ascend.
        let mut keys: Vec<(f32, &Placement)> = Vec::new();
        for key in moments {
            match keys.last_mut() {
                Some(last) if last.0 >= key.time as f32 => last.1 = &key.placement,
                _ => keys.push((key.time as f32, &key.placement)),
            }
        }
        let [first, _, ..] = keys[..] else { return };
        let times: Vec<f32> = keys.iter().map(|(time, _)| *time).collect();
        let at = self.view(bytemuck::cast_slice(&times), None);
        let range = (vec![times[0]], vec![times[times.len() - 1]]);
        let input = self.accessor(at, times.len(), ComponentType::F32, Type::Scalar, Some(range));
        let mut channel = |output, path| {
            let sampler = Sampler {
                input,
                output,
                interpolation: Checked::Valid(Interpolation::Linear),
                extensions: None,
                extras: None,
            };
            let sampler = Index::push(&mut animation.samplers, sampler);
            let target = Animated { node, path: Checked::Valid(path), extensions: None, extras: None };
            animation.channels.push(Channel { sampler, target, extensions: None, extras: None });
        };
        let centres: Vec<[f32; 3]> = keys.iter().map(|(_, p)| self.translation(p)).collect();
        let at = self.view(bytemuck::cast_slice(&centres), None);
        channel(self.accessor(at, keys.len(), ComponentType::F32, Type::Vec3, None), Property::Translation);
        if keys.iter().any(|(_, p)| p.rotation != first.1.rotation) {
            let turns: Vec<[f32; 4]> = keys.iter().map(|(_, p)| rotation(p)).collect();
            let at = self.view(bytemuck::cast_slice(&turns), None);
            channel(self.accessor(at, keys.len(), ComponentType::F32, Type::Vec4, None), Property::Rotation);
        }
    }

    fn translation(&self, placement: &Placement) -> [f32; 3] {
        (placement.centre.coords * self.scale).map(|x| x as f32).into()
    }

    /// Appends bytes to the buffer, where any number may begin; with what they are for, and for vertices how
    /// far apart these are.
    fn view(&mut self, bytes: &[u8], target: Option<(Target, usize)>) -> Index<View> {
        self.bytes.resize(self.bytes.len().next_multiple_of(4), 0);
        let view = View {
            buffer: Index::new(0),
            byte_length: USize64::from(bytes.len()),
            byte_offset: Some(USize64::from(self.bytes.len())),
            byte_stride: target.as_ref().filter(|(_, s)| *s > 0).map(|(_, s)| Stride(*s)),
            target: target.map(|(t, _)| Checked::Valid(t)),
            name: None,
            extensions: None,
            extras: None,
        };
        self.bytes.extend_from_slice(bytes);
        Index::push(&mut self.root.buffer_views, view)
    }

    fn accessor(
        &mut self,
        view: Index<View>,
        count: usize,
        component: ComponentType,
        kind: Type,
        range: Option<(Vec<f32>, Vec<f32>)>,
    ) -> Index<Accessor> {
        let (min, max) = range.unzip();
        let accessor = Accessor {
            buffer_view: Some(view),
            byte_offset: None,
            count: USize64::from(count),
            component_type: Checked::Valid(GenericComponentType(component)),
            type_: Checked::Valid(kind),
            min: min.map(Into::into),
            max: max.map(Into::into),
            name: None,
            normalized: false,
            sparse: None,
            extensions: None,
            extras: None,
        };
        Index::push(&mut self.root.accessors, accessor)
    }

    fn finished(mut self) -> Result<Vec<u8>, ViewError> {
        self.bytes.resize(self.bytes.len().next_multiple_of(4), 0);
        self.root.buffers.push(json::Buffer {
            byte_length: USize64::from(self.bytes.len()),
            uri: None,
            name: None,
            extensions: None,
            extras: None,
        });
        let too_large = |e: &dyn std::fmt::Display| ViewError::TooLarge(e.to_string());
        let json = json::serialize::to_vec(&self.root).map_err(|e| too_large(&e))?;
        let header = gltf::binary::Header { magic: *b"glTF", version: 2, length: 0 };
        let glb = gltf::Glb { header, json: json.into(), bin: Some(self.bytes.into()) };
        glb.to_vec().map_err(|e| too_large(&e))
    }
}

fn rotation(placement: &Placement) -> [f32; 4] {
    placement.rotation.coords.map(|x| x as f32).into()
}

fn extent(positions: &[[f32; 3]]) -> (Vec<f32>, Vec<f32>) {
    let of = |pick: fn(f32, f32) -> f32, from: f32| {
        (0..3).map(|a| positions.iter().map(|p| p[a]).fold(from, pick)).collect()
    };
    (of(f32::min, f32::INFINITY), of(f32::max, f32::NEG_INFINITY))
}

/// Matt, as painted; glTF has colours linear.
fn material(colour: &Rgb) -> Material {
    let linear = colour.map(|c| {
        let c = f32::from(c) / 255.0;
        if c <= 0.04045 { c / 12.92 } else { ((c + 0.055) / 1.055).powf(2.4) }
    });
    let [r, g, b] = linear;
    Material {
        pbr_metallic_roughness: PbrMetallicRoughness {
            base_color_factor: PbrBaseColorFactor([r, g, b, 1.0]),
            metallic_factor: StrengthFactor(0.1),
            roughness_factor: StrengthFactor(0.6),
            ..PbrMetallicRoughness::default()
        },
        // Surfaces may be open.
        double_sided: true,
        ..Material::default()
    }
}
