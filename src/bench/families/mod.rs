//! Families of assemblies of any number of parts, to see how planning grows with it. In mm; as
//! assemblies of that kind grow, parts become many, not small.

mod solid;

use std::fmt::Write;
use std::path::Path;

use super::BenchError;
use crate::geometry::SourceMesh;
use solid::{across, gear, moved, plate, tube, turned};

#[cfg(test)]
pub(crate) use solid::cells;

/// A kind of assembly.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Family {
    /// Two layers of beams across each other, with a bolt, a washer and a nut where they cross.
    BoltedFrame,
    /// Uprights with shelves in grooves between them, on each shelf a tray with a block in it, which
    /// leaves upwards once there is no shelf above.
    Rack,
    /// Meshing gears on headed shafts between two plates, each between two spacers.
    GearTrain,
}

impl Family {
    /// All of them.
    pub const ALL: [Self; 3] = [Self::BoltedFrame, Self::Rack, Self::GearTrain];

    /// Its name on the command line and in results.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::BoltedFrame => "bolted-frame",
            Self::Rack => "rack",
            Self::GearTrain => "gear-train",
        }
    }

    /// The smallest number of parts it has.
    pub const LEAST: usize = 8;

    /// Names and meshes of a member of exactly so many parts, of which there are [`Self::LEAST`] at
    /// least.
    #[must_use]
    pub fn member(self, parts: usize) -> Vec<(String, SourceMesh)> {
        let parts = parts.max(Self::LEAST);
        let mut member = match self {
            Self::BoltedFrame => bolted_frame(parts),
            Self::Rack => rack(parts),
            Self::GearTrain => gear_train(parts),
        };
        // The last fastener, bay or axle may be incomplete.
        member.truncate(parts);
        member
    }

    /// Writes a member as a folder of OBJ files.
    ///
    /// # Errors
    /// A file cannot be written.
    pub fn write(self, parts: usize, folder: &Path) -> Result<(), BenchError> {
        std::fs::create_dir_all(folder).map_err(|e| BenchError::file(folder, &e))?;
        for (name, mesh) in self.member(parts) {
            let file = folder.join(format!("{name}.obj"));
            std::fs::write(&file, obj(&mesh)).map_err(|e| BenchError::file(&file, &e))?;
        }
        Ok(())
    }
}

fn obj(mesh: &SourceMesh) -> String {
    let mut text = String::new();
    // Writing to a string cannot fail.
    for [x, y, z] in &mesh.vertices {
        let _ = writeln!(text, "v {x} {y} {z}");
    }
    for [a, b, c] in &mesh.triangles {
        let _ = writeln!(text, "f {} {} {}", a + 1, b + 1, c + 1);
    }
    text
}

/// Between a shaft and its bore, on the radius.
const CLEARANCE: f64 = 0.1;

/// The smallest number whose value reaches `wanted`.
fn least(wanted: usize, value: impl Fn(usize) -> usize) -> usize {
    (1..).find(|&k| value(k) >= wanted).unwrap_or(wanted)
}

fn bolted_frame(parts: usize) -> Vec<(String, SourceMesh)> {
    const TILE: f64 = 30.0;
    let (shank, height) = (3.0, 10.0);
    let side = least(parts, |k| 2 * k + 3 * k * k);
    let beam = |z| plate([side, 1], TILE, z, |_, _| Some(shank + CLEARANCE));
    let mut out = Vec::new();
    for k in 0..side {
        let at = k as f64 * TILE;
        out.push((format!("beam-x-{k}"), moved(beam([0.0, height]), [0.0, at, 0.0])));
        out.push((format!("beam-y-{k}"), moved(across(beam([height, 2.0 * height])), [at, 0.0, 0.0])));
    }
    let top = 2.0 * height;
    let (seat, head) = (top + 1.5, top + 6.0);
    let bolt = turned(&[[0.0, -8.0], [shank, -8.0], [shank, seat], [5.5, seat], [5.5, head], [0.0, head]]);
    let washer = tube(shank + CLEARANCE, 6.5, [top, seat]);
    let nut = tube(shank + CLEARANCE, 5.5, [-5.0, 0.0]);
    for k in 0..side * side {
        let place = [((k % side) as f64 + 0.5) * TILE, ((k / side) as f64 + 0.5) * TILE, 0.0];
        out.push((format!("bolt-{k}"), moved(bolt.clone(), place)));
        out.push((format!("washer-{k}"), moved(washer.clone(), place)));
        out.push((format!("nut-{k}"), moved(nut.clone(), place)));
    }
    out
}

fn rack(parts: usize) -> Vec<(String, SourceMesh)> {
    const WIDTH: f64 = 60.0;
    const HEIGHT: f64 = 40.0;
    const DEPTH: f64 = 80.0;
    let (upright, shelf, groove) = (10.0, 6.0, 3.0);
    let columns = least(parts, |k| k + 1 + 3 * k * k);
    let mut z = vec![0.0];
    for row in 0..columns {
        let floor = row as f64 * HEIGHT + 10.0;
        z.extend([floor - CLEARANCE, floor + shelf + CLEARANCE]);
    }
    z.push(columns as f64 * HEIGHT + 10.0);
    // Grooves on both sides, so that all uprights are alike.
    let post = solid::cells([&[0.0, groove, upright - groove, upright], &[0.0, DEPTH], &z], |[x, _, k]| {
        x == 1 || k % 2 == 0
    });
    let mut out: Vec<_> = (0..=columns)
        .map(|k| (format!("upright-{k}"), moved(post.clone(), [k as f64 * (WIDTH + upright), 0.0, 0.0])))
        .collect();
    let cuboid = |lo: [f64; 3], hi: [f64; 3]| {
        solid::cells([&[lo[0], hi[0]], &[lo[1], hi[1]], &[lo[2], hi[2]]], |_| true)
    };
    let reach = groove - CLEARANCE;
    let board = cuboid([-reach, 0.0, 0.0], [WIDTH + reach, DEPTH, shelf]);
    let tray = solid::cells(
        [&[2.0, 4.0, WIDTH - 4.0, WIDTH - 2.0], &[2.0, 4.0, DEPTH - 4.0, DEPTH - 2.0], &[0.0, 2.0, 16.0]],
        |[x, y, k]| k == 0 || x != 1 || y != 1,
    );
    let block = cuboid([10.0, 10.0, 2.0], [WIDTH - 10.0, DEPTH - 10.0, 24.0]);
    // From the top, so that what is left out of an incomplete rack is at its foot.
    for k in 0..columns * columns {
        let (column, row) = (k % columns, columns - 1 - k / columns);
        let floor = row as f64 * HEIGHT + 10.0;
        let place = |above: f64| [upright + column as f64 * (WIDTH + upright), 0.0, floor + above];
        out.push((format!("shelf-{k}"), moved(board.clone(), place(0.0))));
        out.push((format!("tray-{k}"), moved(tray.clone(), place(shelf))));
        out.push((format!("block-{k}"), moved(block.clone(), place(shelf))));
    }
    out
}

fn gear_train(parts: usize) -> Vec<(String, SourceMesh)> {
    const TEETH: usize = 12;
    const PITCH: f64 = 24.6;
    let (shaft, thickness) = (4.0, 6.0);
    let (bottom, top) = (thickness, 18.0);
    let side = least(parts, |k| 2 + 4 * k * k);
    let bored = |z| plate([side, side], PITCH, z, |_, _| Some(shaft + CLEARANCE));
    let mut out = vec![
        ("plate-bottom".to_owned(), bored([0.0, bottom])),
        ("plate-top".to_owned(), bored([top, top + thickness])),
    ];
    let end = top + thickness + 4.0;
    let axle = turned(&[[0.0, -4.0], [7.0, -4.0], [7.0, 0.0], [shaft, 0.0], [shaft, end], [0.0, end]]);
    let spacer = |z| tube(shaft + CLEARANCE, 6.0, z);
    for k in 0..side * side {
        let (i, j) = (k % side, k / side);
        let place = [(i as f64 + 0.5) * PITCH, (j as f64 + 0.5) * PITCH, 0.0];
        // Neighbours stand half a tooth apart.
        let phase = ((i + j) % 2) as f64 / 2.0;
        let wheel = gear(TEETH, phase, [shaft + CLEARANCE, 10.0, 14.0], [bottom + 2.0, top - 2.0]);
        out.push((format!("shaft-{k}"), moved(axle.clone(), place)));
        out.push((format!("gear-{k}"), moved(wheel, place)));
        out.push((format!("spacer-low-{k}"), moved(spacer([bottom, bottom + 2.0]), place)));
        out.push((format!("spacer-high-{k}"), moved(spacer([top - 2.0, top]), place)));
    }
    out
}

#[cfg(test)]
mod tests {
    use std::collections::HashSet;

    use super::*;
    use crate::fixtures::source;
    use crate::geometry::Assembly;
    use crate::service::Service;

    #[test]
    fn members_have_the_parts_asked_for_with_distinct_names_and_closed_meshes() {
        for family in Family::ALL {
            for parts in [8, 9, 10, 11, 12, 13, 30, 100] {
                let member = family.member(parts);
                assert_eq!(member.len(), parts, "{}", family.name());
                let names: HashSet<_> = member.iter().map(|(n, _)| n.clone()).collect();
                assert_eq!(names.len(), parts);
                let assembly = Assembly::new(&source(member.into_iter().map(|(_, m)| m))).unwrap();
                assert!(assembly.findings.is_empty(), "{}: {:?}", family.name(), assembly.findings);
                assert_eq!(assembly.repetitions, [], "{}", family.name());
            }
        }
    }

    #[test]
    fn copies_share_few_shapes() {
        for family in Family::ALL {
            let member = family.member(100).into_iter().map(|(_, m)| m);
            let shapes = Assembly::new(&source(member)).unwrap().shapes.len();
            assert!(shapes <= 6, "{} has {shapes} shapes", family.name());
        }
    }

    #[test]
    fn nothing_overlaps_as_assembled() {
        for family in Family::ALL {
            let service = Service::default();
            let member = source(family.member(20).into_iter().map(|(_, m)| m));
            let found = service.overlaps(service.admit(&member).unwrap().id).unwrap();
            assert!(found.is_empty(), "{}: {found:?}", family.name());
        }
    }
}
