//! An assembly that comes in, in pieces.

use std::collections::HashSet;

use sbdp_client::{Assembly, Part, Vertices};
use tonic::Status;

use crate::proto::{self, upload_request::Piece};
use crate::status::{argument, part};

/// Bytes that a part takes in memory beside its name and its meshes: its structs have about 150. It keeps an upload of
/// millions of empty parts within the limit.
const PART_BYTES: usize = 256;

/// What has come so far.
#[derive(Debug, Default)]
pub(crate) struct Intake {
    assembly: Option<proto::Assembly>,
    parts: Vec<PartIntake>,
    names: HashSet<String>,
}

#[derive(Debug, Default)]
struct PartIntake {
    name: String,
    wide: Vec<[f64; 3]>,
    narrow: Vec<[f32; 3]>,
    triangles: Vec<[u32; 3]>,
}

/// Bytes of memory that a piece takes.
pub(crate) fn size(request: &proto::UploadRequest) -> usize {
    match &request.piece {
        Some(Piece::Mesh(mesh)) => {
            let meshes = mesh.vertices_f64.len() + mesh.vertices_f32.len() + mesh.triangles.len();
            meshes + 2 * mesh.name.len() + PART_BYTES
        }
        Some(Piece::Assembly(assembly)) => {
            let fixed: usize = assembly.fixed.iter().map(|name| name.len() + size_of::<String>()).sum();
            assembly.name.len() + fixed
        }
        None => 0,
    }
}

impl Intake {
    /// Takes a piece in.
    ///
    /// # Errors
    /// It comes out of turn, or has not the length of whole rows. What else may be wrong with a mesh, the daemon finds.
    pub(crate) fn add(&mut self, request: proto::UploadRequest) -> Result<(), Status> {
        match (request.piece, &self.assembly) {
            (None, _) => Err(argument("piece", "a message of an upload has an `assembly` or a `mesh`")),
            (Some(Piece::Assembly(assembly)), None) => {
                self.assembly = Some(assembly);
                Ok(())
            }
            (Some(Piece::Assembly(_)), Some(_)) => {
                Err(argument("assembly", "it comes once, in the first message of an upload"))
            }
            (Some(Piece::Mesh(_)), None) => {
                Err(argument("mesh", "the first message of an upload has an `assembly`"))
            }
            (Some(Piece::Mesh(mesh)), Some(_)) => self.add_mesh(&mesh),
        }
    }

    fn add_mesh(&mut self, mesh: &proto::Mesh) -> Result<(), Status> {
        if self.parts.last().is_none_or(|last| last.name != mesh.name) {
            if !self.names.insert(mesh.name.clone()) {
                let problem = "another part came in between: send all pieces of a part one after the other, and give each \
                               part a name of its own";
                return Err(part(&mesh.name, problem));
            }
            self.parts.push(PartIntake { name: mesh.name.clone(), ..PartIntake::default() });
        }
        let Some(last) = self.parts.last_mut() else { return Ok(()) };
        extend(&mut last.wide, &mesh.vertices_f64, f64::from_le_bytes, &mesh.name, "vertices_f64")?;
        extend(&mut last.narrow, &mesh.vertices_f32, f32::from_le_bytes, &mesh.name, "vertices_f32")?;
        extend(&mut last.triangles, &mesh.triangles, u32::from_le_bytes, &mesh.name, "triangles")?;
        if !last.wide.is_empty() && !last.narrow.is_empty() {
            return Err(part(
                &mesh.name,
                "it has vertices in `vertices_f64` and in `vertices_f32`: use one of them",
            ));
        }
        Ok(())
    }

    /// All of it, as the client of the daemon takes it.
    ///
    /// # Errors
    /// No message came.
    pub(crate) fn assembly(&self) -> Result<Assembly<'_>, Status> {
        let Some(assembly) = &self.assembly else {
            return Err(argument("assembly", "the upload has no messages: begin with an `assembly`"));
        };
        let parts = self.parts.iter().map(|part| Part {
            name: &part.name,
            vertices: match part.narrow.is_empty() {
                true => Vertices::F64(&part.wide),
                false => Vertices::F32(&part.narrow),
            },
            triangles: &part.triangles,
        });
        Ok(Assembly {
            name: &assembly.name,
            units: assembly.units.as_deref(),
            parts: parts.collect(),
            fixed: assembly.fixed.iter().map(String::as_str).collect(),
        })
    }

    /// The name of the part that came last, for messages about what came after it.
    pub(crate) fn last_part(&self) -> Option<&str> {
        self.parts.last().map(|part| part.name.as_str())
    }
}

/// Appends rows of three numbers.
fn extend<T, const N: usize>(
    rows: &mut Vec<[T; 3]>,
    bytes: &[u8],
    number: fn([u8; N]) -> T,
    name: &str,
    field: &str,
) -> Result<(), Status> {
    let (numbers, rest) = bytes.as_chunks::<N>();
    let (triples, over) = numbers.as_chunks::<3>();
    if !rest.is_empty() || !over.is_empty() {
        let row = 3 * N;
        return Err(part(
            name,
            format!("`{field}` has {} bytes: send whole rows of {row} bytes", bytes.len()),
        ));
    }
    rows.extend(triples.iter().map(|triple| triple.map(number)));
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use prost::bytes::Bytes;

    fn assembly() -> proto::UploadRequest {
        proto::UploadRequest { piece: Some(Piece::Assembly(proto::Assembly::default())) }
    }

    fn mesh(name: &str, wide: &[f64], narrow: &[f32], triangles: &[u32]) -> proto::UploadRequest {
        let mesh = proto::Mesh {
            name: name.to_owned(),
            vertices_f64: wide.iter().flat_map(|x| x.to_le_bytes()).collect::<Vec<_>>().into(),
            vertices_f32: narrow.iter().flat_map(|x| x.to_le_bytes()).collect::<Vec<_>>().into(),
            triangles: triangles.iter().flat_map(|x| x.to_le_bytes()).collect::<Vec<_>>().into(),
        };
        proto::UploadRequest { piece: Some(Piece::Mesh(mesh)) }
    }

    #[test]
    fn pieces_of_a_part_are_joined() {
        let mut intake = Intake::default();
        for piece in [
            assembly(),
            mesh("a", &[1.0, 2.0, 3.0], &[], &[0, 1, 2]),
            mesh("a", &[4.0, 5.0, 6.0], &[], &[]),
            mesh("b", &[], &[0.5, 0.25, 0.125], &[]),
            mesh("a2", &[], &[], &[]),
        ] {
            intake.add(piece).unwrap();
        }
        let assembly = intake.assembly().unwrap();
        let names: Vec<&str> = assembly.parts.iter().map(|part| part.name).collect();
        assert_eq!(names, ["a", "b", "a2"]);
        assert_eq!(assembly.parts[0].vertices, Vertices::F64(&[[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]]));
        assert_eq!(assembly.parts[0].triangles, [[0, 1, 2]]);
        assert_eq!(assembly.parts[1].vertices, Vertices::F32(&[[0.5, 0.25, 0.125]]));
    }

    #[test]
    fn what_is_wrong_is_refused_by_name() {
        let refused = |pieces: Vec<proto::UploadRequest>| {
            let mut intake = Intake::default();
            let status = pieces.into_iter().find_map(|piece| intake.add(piece).err()).unwrap();
            assert_eq!(status.code(), tonic::Code::InvalidArgument);
            status.message().to_owned()
        };
        assert!(refused(vec![mesh("a", &[], &[], &[])]).contains("`mesh`"));
        assert!(refused(vec![assembly(), assembly()]).contains("`assembly`"));
        assert!(refused(vec![assembly(), proto::UploadRequest { piece: None }]).contains("`piece`"));
        assert!(
            refused(vec![assembly(), mesh("a", &[1.0], &[], &[])])
                .contains("part `a`: `vertices_f64` has 8 bytes")
        );
        let both = mesh("a", &[1.0; 3], &[1.0; 3], &[]);
        assert!(refused(vec![assembly(), both]).contains("part `a`"));
        let mut torn = proto::Mesh { name: "t".to_owned(), ..proto::Mesh::default() };
        torn.triangles = Bytes::from_static(b"12345678901");
        let torn = proto::UploadRequest { piece: Some(Piece::Mesh(torn)) };
        assert!(refused(vec![assembly(), torn]).contains("part `t`: `triangles` has 11 bytes"));
        let names = ["a", "b", "a"].map(|name| mesh(name, &[], &[], &[]));
        assert!(refused([assembly()].into_iter().chain(names).collect()).contains("part `a`"));
    }
}
