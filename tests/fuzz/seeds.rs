//! What mutation begins with: good messages and files, known bad ones, and what was found before.

use std::path::Path;

use sbdp::hostile_input::{Reader, field_file};
use sbdp_ipc::endpoint::Endpoint;
use sbdp_ipc::error::{ErrorCode, WireError};
use sbdp_ipc::geometry::{Assembly, Part, Vertices};
use sbdp_ipc::plan::{
    Gravity, MovedPart, PenaltyRecord, PlanRequest, Reports, Staging, Steady, Step, encode_steps,
};
use sbdp_ipc::revision::Revision;
use sbdp_ipc::status::{Status, StatusHeader};
use sbdp_ipc::summary::report::{Clearance, Closest, Fastener, Report, Stability, Tool, Unstable};
use sbdp_ipc::summary::{NO_PART, OverlapRecord, SummaryParts};

/// Longer files say nothing that shorter ones do not, and are read slowly.
const LONGEST: u64 = 16 * 1024;

/// The readers that a file of this extension is for.
fn readers(path: &Path) -> &'static [Reader] {
    match path.extension().and_then(|e| e.to_str()).unwrap_or_default() {
        "obj" => &[Reader::Obj, Reader::Healing],
        "stl" => &[Reader::Stl],
        "gltf" | "glb" => &[Reader::Gltf],
        "ply" => &[Reader::Ply],
        "off" => &[Reader::Off],
        "json" => &[Reader::Manifest, Reader::Endpoint],
        "toml" => &[Reader::Config, Reader::Manifest],
        _ => &[],
    }
}

/// A plan of four parts: two go out by a screw, and then apart, one of them aside first; one is stuck.
const PLAN: &str = r#"{"schema":"sbdp-plan/2","kind":"disassembly","status":"infeasible","reason":"stuck","planner":"sbdp-star","engine":"sliding","units":"mm","parts":["a","b-1","b-2","b-3"],"initial":{"removed":[],"poses":{"b-1":[0.0,0.0,1.0,1.0,0.0,0.0,0.0]}},"targets":null,"fixed":["a"],"base":["b-2"],"base_reason":"it is the largest","steps":[{"parts":["b-1","b-3"],"of":null,"ends":"out","motion":"rotation","path":[[0.0,0.0,0.0,1.0,0.0,0.0,0.0],[0.0,0.0,2.0,0.6,0.0,0.0,0.8],[0.0,0.0,3.0,-0.28,0.0,0.0,0.96]],"verified_depth":0.0,"requires":[],"wave":0,"direction":[0.0,0.0,1.0]},{"parts":["b-3"],"of":0,"ends":"aside","motion":"translation","path":[[0.0,0.0,0.0,1.0,0.0,0.0,0.0],[1.0,0.0,0.0,1.0,0.0,0.0,0.0]],"verified_depth":0.0,"requires":[0],"wave":1,"direction":[1.0,0.0,0.0]},{"parts":["b-3"],"of":0,"ends":"out","motion":"translation","path":[[0.0,0.0,0.0,1.0,0.0,0.0,0.0],[0.0,9.0,0.0,1.0,0.0,0.0,0.0]],"verified_depth":0.0,"requires":[0,1],"wave":2,"direction":[0.0,1.0,0.0]}],"remaining":["a","b-2"],"kept_together":[["a","b-2"]],"free_together":[{"parts":["a","b-2"],"direction":[0.0,0.0,1.0]}],"blocked":[{"part":"b-2","by":["a"],"action":"+x"}],"overlaps":[],"warnings":[],"stats":{"simulations":0,"simulations_run":0,"sweeps":0,"states":0,"sdf_time_s":0.0,"static_analysis_time_s":0.0,"path_time_s":0.0,"verify_time_s":0.0,"total_time_s":0.0,"cache":{"sdf_hits":0,"blocking_hits":0,"motion_hits":0,"plan_hit":false}}}"#;

/// Seeds for a reader: those built in, and those among the files below some folders.
pub(crate) fn seeds(reader: Reader, folders: &[std::path::PathBuf]) -> Vec<Vec<u8>> {
    let mut seeds = built_in(reader);
    folders.iter().for_each(|folder| collect(reader, folder, &mut seeds));
    seeds.push(Vec::new());
    seeds
}

fn collect(reader: Reader, folder: &Path, seeds: &mut Vec<Vec<u8>>) {
    let Ok(entries) = std::fs::read_dir(folder) else { return };
    let mut paths: Vec<_> = entries.flatten().map(|e| e.path()).collect();
    paths.sort();
    for path in paths {
        if path.is_dir() {
            collect(reader, &path, seeds);
        } else if readers(&path).contains(&reader)
            && std::fs::metadata(&path).is_ok_and(|m| m.len() <= LONGEST)
            && let Ok(bytes) = std::fs::read(&path)
        {
            seeds.push(bytes);
        }
    }
}

fn built_in(reader: Reader) -> Vec<Vec<u8>> {
    match reader {
        Reader::Messages => messages(),
        Reader::Meshes | Reader::Admission => meshes(),
        Reader::Config => vec![include_bytes!("../../config/default.toml").to_vec()],
        Reader::Manifest => vec![
            br#"{"name": "a", "units": "mm", "fixed": ["0"], "base": ["0"], "keep": ["0"], "densities": {"0": 1.5}, "parts": ["0.obj"]}"#.to_vec(),
            b"name = \"a\"\nfixed = [\"0\"]\n[densities]\n0 = 1.5\n[[parts]]\nfile = \"0.obj\"\n".to_vec(),
            br#"{"0": [1.0, 2.0, 3.0]}"#.to_vec(),
            b"[[1.0, 2.0, 3.0]]".to_vec(),
            br#"{"parts": ["0.obj", {"file": "1.obj"}], "split": "objects", "ignore": ["*bolt*", "[ab]?"]}"#.to_vec(),
            br#"{"0": {"initial_state": [1, 2, 3], "final_state": [1, 2, 3, 0.5, 0.25, 1.5]}, "1": {"final_state": [0, 0, 1]}}"#.to_vec(),
            br#"{"tree": {"root": {"o": {"p": {}}}}, "root": {"bodies": {"b": {"is_visible": true}}}, "occurrences": {"o": {"name": "x", "is_visible": true, "bodies": {"b": {}, "c": {"is_visible": false}}, "transform": {"origin": {"x": 1, "y": 2, "z": 3}, "x_axis": {"x": 1, "y": 0, "z": 0}, "y_axis": {"x": 0, "y": 1, "z": 0}, "z_axis": {"x": 0, "y": 0, "z": 1}}}, "p": {"name": "y"}}, "bodies": {"b": {"name": "B", "obj": "b.obj"}, "c": {"name": "C", "obj": "c.obj"}}}"#.to_vec(),
        ],
        Reader::Records => records(),
        Reader::Fields => vec![field_file()],
        Reader::Endpoint => {
            let endpoint = Endpoint::of_this_process("sbdp_x_", Path::new("/tmp/iox"));
            vec![serde_json::to_vec(&endpoint).unwrap_or_default()]
        }
        Reader::Obj | Reader::Healing => vec![
            b"v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n".to_vec(),
            b"o a\nv 0 0 0\nvn 0 0 1\nvt 0 0\nf -1/1/1 1//1 1\n".to_vec(),
            b"o a\nv 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\no b\ng c d\nl 1 2\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\nsurf 1\n".to_vec(),
        ],
        Reader::Stl => vec![b"solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\nsolid b\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 0 1\nendloop\nendfacet\nendsolid\n".to_vec(), b"solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\nendsolid a\n".to_vec(), binary_stl()],
        Reader::Gltf => vec![br#"{"asset":{"version":"2.0","extras":{"units":"mm"}},"scenes":[{"nodes":[0]}],"extensionsRequired":["EXT_mesh_gpu_instancing","KHR_mesh_quantization"],"nodes":[{"name":"a","mesh":0,"scale":[1,1,-1],"extensions":{"EXT_mesh_gpu_instancing":{"attributes":{"TRANSLATION":2}}}}],"meshes":[{"weights":[1],"primitives":[{"attributes":{"POSITION":0},"indices":1},{"attributes":{"POSITION":0},"mode":1}]}],"accessors":[{"bufferView":0,"componentType":5123,"normalized":true,"count":3,"type":"VEC3","min":[0,0,0],"max":[1,1,0]},{"bufferView":1,"componentType":5121,"count":3,"type":"SCALAR"},{"bufferView":2,"componentType":5126,"count":2,"type":"VEC3"}],"bufferViews":[{"buffer":0,"byteLength":24,"byteStride":8},{"buffer":0,"byteOffset":24,"byteLength":4},{"buffer":0,"byteOffset":28,"byteLength":24}],"buffers":[{"byteLength":52,"uri":"data:;base64,AAAAAAAAAAD//wAAAAAAAAAA//8AAAAAAAECAAAAAAAAAAAAAAAAAAAAoEAAAAAAAAAAAA=="}]}"#.to_vec()],
        Reader::Ply => vec![
            b"ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\nproperty uchar red\nelement face 2\nproperty list uchar int vertex_indices\nelement edge 1\nproperty int a\nend_header\n0 0 0 9\n1 0 0 9\n1 1 0 9\n0 1 0.5 9\n4 0 1 2 3\n3 0 3 1\n7\n".to_vec(),
            b"ply\nformat binary_little_endian 1.0\nelement vertex 3\nproperty uchar x\nproperty short y\nproperty float z\nelement tristrips 1\nproperty list uchar char vertex_indices\nend_header\n\0\0\0\0\0\0\0\x01\0\0\0\0\0\0\0\x01\0\0\0\0\0\x05\0\x01\x02\xff\0".to_vec(),
            b"ply\nformat binary_big_endian 1.0\nelement vertex 3\nproperty double x\nproperty int y\nproperty uint z\nelement face 1\nproperty list ushort uint vertex_index\nend_header\n\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0".to_vec(),
        ],
        Reader::Off => vec![
            b"OFF # c\n4 2 0\n0 0 0\n1 0 0\n\n1 1 0\n0 1 0.5\n4 0 1 2 3 255 0 0\n3 0 3 1\n".to_vec(),
            b"STCNOFF3 1 0\n0 0 0 1 1 1\n1 0 0\n0 1 0\n3 0 1 2\n2 0 1\n".to_vec(),
        ],
        Reader::ThreeMf => vec![br##"<?xml version="1.0"?><model unit="inch" xmlns="http://schemas.microsoft.com/3dmanufacturing/core/2015/02" xmlns:p="http://schemas.microsoft.com/3dmanufacturing/production/2015/06" requiredextensions="p"><metadata name="Title">a</metadata><resources><p:x a="&amp;"/><object id="1" name="a" type="model"><mesh><vertices><vertex x="0" y="0" z="0"/><vertex x="1" y="0" z="0"/><vertex x="0" y="1" z="0"/></vertices><triangles><triangle v1="0" v2="2" v3="1"/></triangles></mesh></object><object id="2" partnumber="b"><components><component objectid="1"/><component objectid="1" transform="0 1 0 -1 0 0 0 0 1 10 0 0"/></components></object><object id="3" type="support"/></resources><build><item objectid="2" transform="1 0 0 0 1 0 0 0 1 0 0 5"/><item objectid="3" p:path="/a.model"/></build></model>"##.to_vec()],
        Reader::StepReport => vec![
            br#"{"sbdp-step":1,"unit":"mm","deflection":0.01,"products":3,"parts":2,"warnings":["a: no geometry"]}"#.to_vec(),
        ],
        Reader::Plan => vec![PLAN.as_bytes().to_vec()],
    }
}

fn binary_stl() -> Vec<u8> {
    let mut bytes = vec![0; 80];
    bytes.extend(2_u32.to_le_bytes());
    for triangle in 0..2_u8 {
        bytes.extend((0..12_u8).flat_map(|i| f32::from(i * triangle).to_le_bytes()));
        bytes.extend([0, 0]);
    }
    bytes
}

/// Payloads as bincode lays them out: counts of eight bytes, then what is counted.
fn records() -> Vec<Vec<u8>> {
    let mut seeds = vec![1.5_f64.to_le_bytes().to_vec()];
    for count in [0_u64, 1, 3] {
        let mut bytes = count.to_le_bytes().to_vec();
        bytes.extend((0..count * 56).map(|i| (i % 3) as u8));
        seeds.push(bytes);
    }
    let mut sealed = b"SBDC\x01\0\x02\0\x01\0\0\0\x0b\0\0\0".to_vec();
    sealed.extend([7; 27]);
    seeds.push(sealed);
    seeds
}

fn messages() -> Vec<Vec<u8>> {
    let path = vec![[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 5.0, 1.0, 0.0, 0.0, 0.0]];
    let step = Step {
        parts: vec![1, 2],
        of: Some(2),
        path,
        requires: vec![0, 2],
        verified_depth: 1e-4,
        ..Step::default()
    };
    let summary = SummaryParts {
        reason: Some("exhausted"),
        planner: "sbdp-star",
        engine: "sliding",
        units: Some("mm"),
        parts: vec!["0", "1", "größer"],
        overlaps: vec![OverlapRecord { parts: [0, 1], depth: 0.25 }],
        blocked: vec![(2, vec![0, 1], "+x"), (2, vec![], "-rz")],
        warnings: vec![(NO_PART, "whole"), (1, "one")],
        removed: vec![0],
        targets: Some(vec![1]),
        remaining: vec![1, 2],
        kept_together: vec![vec![0, 1]],
        free_together: vec![(vec![1, 2], [0.0, 0.0, 1.0])],
        poses: vec![MovedPart { part: 1, ..MovedPart::default() }],
        report: Some(Report {
            stability: Some(vec![
                Stability { needs_friction: 0.25, ..Stability::default() },
                Stability {
                    unstable: vec![Unstable {
                        falls: vec![(0, [0.0, 0.0, -1.0])],
                        hold: vec![vec![0], vec![0, 1]],
                        needs_clamping: true,
                    }],
                    unknown: vec![1],
                    ..Stability::default()
                },
            ]),
            clearance: Some(vec![Clearance {
                touching: vec![1],
                closest: Some(Closest {
                    moving: 0,
                    standing: 1,
                    distance: 0.5,
                    at_least: 0.25,
                    assembled: 2.0,
                    segment: 3,
                    share: 0.5,
                    points: Some([[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]]),
                }),
            }]),
            tools: Some(vec![Some(Fastener {
                size: 13.0,
                tools: vec![Tool { tool: 2, swing: 60.0, needs: 30.0, fits: true, blocked_by: vec![1] }],
            })]),
        }),
        steps: 1,
        ..SummaryParts::default()
    };
    let request = PlanRequest {
        fixed: vec![1, 2],
        base: vec![3],
        keep: vec![0],
        groups: vec![vec![0, 1], vec![2]],
        up: Some([0.0, 1.0, 0.0]),
        penalty: vec![PenaltyRecord { parameter: 1, reserved: 0, value: 0.5 }],
        targets: Some(vec![0]),
        moved: vec![MovedPart { part: 1, ..MovedPart::default() }],
        assembly: Some(Staging::Beside(vec![MovedPart::default()])),
        reports: Reports { stability: true, clearance: true, tools: true },
        steady: Some(Steady { hands: std::num::NonZeroU32::new(2) }),
        gravity: Gravity::default(),
        ..PlanRequest::default()
    };
    let status = Status {
        numbers: StatusHeader::default(),
        version: "0.1.0".to_owned(),
        preloaded: vec![("frame".to_owned(), [3; 32])],
    };
    vec![
        request.encode(),
        PlanRequest::default().encode(),
        encode_steps(0, [&step, &step]),
        summary.encode(),
        status.encode(),
        WireError::new(ErrorCode::Busy, "busy").encode(),
    ]
}

fn meshes() -> Vec<Vec<u8>> {
    const TETRAHEDRON: [[u32; 3]; 4] = [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]];
    let wide = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    let narrow = wide.map(|v| v.map(|x| x as f32 + 2.0));
    let parts = vec![
        Part { name: "a", vertices: Vertices::F64(&wide), triangles: &TETRAHEDRON },
        Part { name: "b", vertices: Vertices::F32(&narrow), triangles: &TETRAHEDRON },
    ];
    let revision =
        Revision { base: [1; 32], replaced: vec![(0, parts[0])], added: vec![parts[1]], moved: vec![] };
    let assembly = Assembly { name: "demo", units: Some("mm"), parts, fixed: vec!["b"] };
    let mut bytes = [vec![0; assembly.encoded_len()], vec![0; revision.encoded_len()]];
    assert!(assembly.encode_into(&mut bytes[0]) && revision.encode_into(&mut bytes[1]));
    bytes.into()
}
