//! What is written is read, and nothing else is believed.

use std::mem::offset_of;

use super::super::build::Threads;
use super::*;
use crate::cache::MappingTally;
use crate::fixtures::{ball, cuboid, l_shape, open_box, spread, surface};
use crate::termination::Termination;

const KEY: [u8; 32] = [7; 32];

fn built(surface: &Arc<Surface>) -> Grid {
    Grid::build(surface, Threads::All, &Termination::default()).unwrap()
}

fn bytes(grid: &Grid) -> Vec<u8> {
    let mut bytes = Vec::new();
    grid.write(&KEY, &mut bytes).unwrap();
    bytes
}

/// What a file of these bytes has, and what of it was found damaged so far.
fn read(surface: &Arc<Surface>, bytes: &[u8]) -> (Option<Grid>, Arc<MappingTally>) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("field");
    std::fs::write(&path, bytes).unwrap();
    let tally = Arc::default();
    let grid = Grid::stored(surface, &KEY, Mapping::of(&path, &tally).unwrap());
    (grid, tally)
}

fn solids() -> Vec<Arc<Surface>> {
    let open = open_box([-1.0; 3], [1.0; 3]);
    [cuboid([-1.0, -1.5, -1.2], [1.0, 1.5, 1.2]), ball(3), l_shape(), open]
        .map(|mesh| Arc::new(surface(mesh)))
        .into()
}

/// Points in the box and around it; with `fraction`, those in a part of it.
fn points(surface: &Surface, fraction: f64) -> Vec<nalgebra::Point3<f64>> {
    let b = surface.bounds().grown(0.3);
    let to = b.min + b.extents() * fraction;
    spread(b.min.into(), to.into(), 3000).collect()
}

/// Everything that a grid says, to the bit.
fn told(grid: &Grid, points: &[nalgebra::Point3<f64>]) -> Vec<String> {
    let at = |p| (grid.sample(p), grid.estimate(p), grid.deepest(p), grid.likely_nearest(p));
    points.iter().map(|p| format!("{:?} {:x}", at(p), grid.value(p).to_bits())).collect()
}

#[test]
fn a_field_from_its_file_says_the_same_to_the_bit() {
    for surface in solids() {
        let (all, some) = (points(&surface, 1.0), points(&surface, 0.5));
        let grid = built(&surface);
        drop(told(&grid, &some));
        let filled = grid.filled();
        assert!(filled > 0 && filled < grid.bricks(), "{filled} of {}", grid.bricks());
        let (stored, tally) = read(&surface, &bytes(&grid));
        let stored = stored.unwrap();
        assert_eq!(told(&stored, &some), told(&grid, &some));
        assert_eq!((stored.filled(), stored.in_its_file()), (0, (filled, false)), "all of it is from there");
        assert!(stored.memory() + filled * size_of::<Nodes>() == grid.memory());
        // What is not in the file is filled, and joins what is in the next one.
        assert_eq!(told(&stored, &all), told(&grid, &all));
        assert_eq!(stored.filled() + filled, grid.filled());
        assert_eq!(bytes(&stored), bytes(&grid));
        assert!(tally.bytes() > 0 && tally.damaged() == 0);
        drop(stored);
        assert_eq!(tally.bytes(), 0);
    }
}

#[test]
fn the_bytes_are_where_the_format_says() {
    let surface = Arc::new(surface(cuboid([-1.0; 3], [1.0; 3])));
    let grid = built(&surface);
    grid.fill();
    let bytes = bytes(&grid);
    let number = |at: usize| u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap()) as usize;
    assert_eq!((&bytes[..4], number(4), &bytes[8..40]), (&b"SBDF"[..], 1, &KEY[..]));
    assert_eq!(f64::from_le_bytes(bytes[40..48].try_into().unwrap()), grid.cell());
    assert_eq!([48, 52, 56].map(number), grid.dims);
    let slots: usize = grid.dims.iter().product();
    let (near, pairs, filled) = (number(64), number(68), number(72));
    assert_eq!((number(60), near, pairs), (12, grid.bricks(), grid.triangles.len()));
    assert_eq!((filled, number(76)), (near, 0));
    assert_eq!(number(96), grid.far[0].to_bits() as usize);
    let entries = 96 + 4 * slots;
    assert_eq!(
        [0, 4, 8].map(|at| number(entries + at)),
        [grid.near[0].brick, grid.near[0].triangles[1], 0].map(|n| n as usize)
    );
    assert_eq!(number(entries + 12 * near), grid.triangles[0] as usize);
    let checksums = entries + 12 * near + 4 * pairs;
    let bricks = (checksums + 16 * filled).next_multiple_of(64);
    assert_eq!(bytes.len(), bricks + 5832 * filled);
    assert_eq!(
        bytes[checksums..checksums + 16],
        blake3::hash(&bytes[bricks..bricks + 5832]).as_bytes()[..16]
    );
    assert_eq!(number(bricks), grid.nodes(0).values[0].to_bits() as usize);
    assert_eq!(number(bricks + 2916), grid.nodes(0).nearest[0] as usize);
    let sealed = [&bytes[..80], &bytes[96..checksums + 16 * filled]].concat();
    assert_eq!(bytes[80..96], blake3::hash(&sealed).as_bytes()[..16]);
}

#[test]
fn a_file_damaged_anywhere_is_never_believed() {
    for surface in [surface(cuboid([-1.0; 3], [1.0; 3])), surface(open_box([-1.0; 3], [1.0; 3]))] {
        let surface = Arc::new(surface);
        let (grid, at) = (built(&surface), points(&surface, 0.2));
        let truth = told(&grid, &at);
        let whole = bytes(&grid);
        assert!(is_intact(&KEY, &whole));
        let bricks = Tables::of(&whole, &KEY).unwrap().bricks;
        let flipped = |i: usize| {
            let mut bytes = whole.clone();
            bytes[i] ^= 1 << (i % 8);
            assert!(!is_intact(&KEY, &bytes), "byte {i}");
            bytes
        };
        let tables = (0..HEADER).chain((HEADER..bricks.at).step_by(bricks.at / 200)).chain([bricks.at - 1]);
        for i in tables {
            assert!(read(&surface, &flipped(i)).0.is_none(), "byte {i}");
        }
        for i in (bricks.at..whole.len()).step_by(whole.len() / 20).chain([whole.len() - 1]) {
            // All but one brick is as it was, and what is read is right.
            let (damaged, tally) = read(&surface, &flipped(i));
            let damaged = damaged.unwrap();
            assert!(told(&damaged, &at) == truth, "byte {i}");
            assert_eq!(
                (damaged.filled(), damaged.in_its_file().1, tally.damaged()),
                (1, true, 1),
                "byte {i}"
            );
        }
        for length in (0..whole.len()).step_by(whole.len() / 200).chain([whole.len() - 1]) {
            assert!(read(&surface, &whole[..length]).0.is_none(), "{length} bytes");
        }
        assert!(read(&surface, &[&whole[..], &[0]].concat()).0.is_none());
    }
}

#[test]
fn a_file_of_another_version_shape_or_hash_is_none() {
    let shape = Arc::new(surface(l_shape()));
    let whole = bytes(&built(&shape));
    assert!(read(&shape, &whole).0.is_some());
    for other in [surface(ball(2)), surface(cuboid([-1.0; 3], [1.0; 3]))] {
        let (found, tally) = read(&Arc::new(other), &whole);
        assert!(found.is_none() && tally.damaged() == 1);
    }
    let changed = |at: usize, value: &[u8]| {
        let mut bytes = whole.clone();
        bytes[at..at + value.len()].copy_from_slice(value);
        resealed(bytes)
    };
    assert!(read(&shape, &changed(4, &1_u32.to_le_bytes())).0.is_some(), "nothing changed");
    assert!(read(&shape, &changed(4, &2_u32.to_le_bytes())).0.is_none());
    assert!(read(&shape, &changed(8, &[8; 32])).0.is_none());
    assert!(!is_intact(&[8; 32], &whole));
}

/// The header's checksum made right.
fn resealed(mut bytes: Vec<u8>) -> Vec<u8> {
    let header: Header = bytemuck::pod_read_unaligned(&bytes[..HEADER]);
    let slots: usize = header.dims.iter().map(|&n| n as usize).product();
    let [near, pairs, filled] = [header.near, header.pairs, header.filled].map(|n| n as usize);
    let end = HEADER + slots * (4 + header.open as usize) + near * 12 + pairs * 4 + filled * 16;
    let sum = checksum([&bytes[..CHECKSUM_AT], bytes.get(HEADER..end).unwrap_or(&[])]);
    bytes[CHECKSUM_AT..HEADER].copy_from_slice(&sum);
    bytes
}

/// Right checksums do not make it true.
#[test]
fn a_file_that_names_what_is_not_there_is_none() {
    let shape = Arc::new(surface(open_box([-1.0; 3], [1.0; 3])));
    let grid = built(&shape);
    drop(told(&grid, &points(&shape, 1.0)));
    let whole = bytes(&grid);
    let header: Header = bytemuck::pod_read_unaligned(&whole[..HEADER]);
    let slots: usize = header.dims.iter().map(|&n| n as usize).product();
    let near = HEADER + 4 * slots;
    let pairs = near + 12 * header.near as usize;
    let insides = pairs + 4 * header.pairs as usize + 16 * header.filled as usize;
    let with = |at: usize, value: u32| {
        let mut bytes = whole.clone();
        bytes[at..at + 4].copy_from_slice(&value.to_le_bytes());
        read(&shape, &resealed(bytes)).0.is_some()
    };
    assert!(with(pairs, header.triangles - 1) && !with(pairs, header.triangles));
    assert!(!with(near, slots as u32) && !with(near + 12, grid.near[0].brick), "a place in the grid");
    assert!(!with(near + 4, header.pairs + 1) && !with(near + 16, grid.near[0].triangles[1] - 1));
    assert!(with(near + 8, NOT_STORED) && !with(near + 8, header.filled), "a place among the filled");
    assert!(with(insides, 0x0201_0002) && !with(insides, 3), "neither inside nor outside");
    assert!(!with(48, u32::MAX) && !with(48, header.dims[0] + 1) && !with(76, 0) && !with(76, 2));
    for cell in [0.0, -1.0, 1e-300, f64::NAN, f64::INFINITY, grid.cell * 2.0] {
        let mut bytes = whole.clone();
        bytes[40..48].copy_from_slice(&cell.to_le_bytes());
        assert!(read(&shape, &resealed(bytes)).0.is_none(), "a cell of {cell}");
    }
    // A brick that names a triangle that is not there is filled anew.
    let bricks = Tables::of(&whole, &KEY).unwrap().bricks;
    let mut bytes = whole.clone();
    let nearest = bricks.at + offset_of!(Nodes, nearest);
    bytes[nearest..nearest + 4].copy_from_slice(&header.triangles.to_le_bytes());
    let sum = checksum([&bytes[bricks.at..bricks.at + size_of::<Nodes>()]]);
    bytes[bricks.checksums_at..bricks.checksums_at + 16].copy_from_slice(&sum);
    let bytes = resealed(bytes);
    assert!(!is_intact(&KEY, &bytes));
    let (found, tally) = read(&shape, &bytes);
    let found = found.unwrap();
    assert_eq!(told(&found, &points(&shape, 1.0)), told(&grid, &points(&shape, 1.0)));
    assert_eq!((found.filled(), tally.damaged()), (1, 1));
}
