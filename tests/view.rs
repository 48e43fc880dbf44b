//! What shows plans: the scenes are where the plans say, and the commands do what they are asked.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};

use nalgebra::{Isometry3, Point3, Quaternion, Translation3, UnitQuaternion};
use sbdp::document::PlanDocument;
use sbdp::files::load_assembly;
use sbdp::geometry::{Assembly, Pose, Revision, heal, interpolate, pose_from_waypoint, waypoint_from_pose};
use sbdp::search::{PlanRequest, Staging, Termination};
use sbdp::service::Service;
use sbdp::view::{PlanScene, Up, glb};

fn folder(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/assemblies").join(name)
}

/// The plan of an assembly with some parts standing elsewhere, and the assembly as the plan begins with it.
fn planned(name: &str, moved: Vec<(usize, Pose)>) -> (Assembly, PlanDocument) {
    asked(name, moved, &PlanRequest::default())
}

fn asked(name: &str, moved: Vec<(usize, Pose)>, request: &PlanRequest) -> (Assembly, PlanDocument) {
    let service = Service::default();
    let base = service.admit(&load_assembly(&folder(name)).unwrap()).unwrap().id;
    let id = service.revise(base, &Revision { moved, ..Revision::default() }).unwrap().id;
    let plan = service.plan(id, request, &Termination::default(), &mut ()).unwrap();
    (service.assembly(id).unwrap(), PlanDocument::from(&plan))
}

/// The plan backwards, as an assembly plan.
fn reversed(mut plan: PlanDocument) -> PlanDocument {
    plan.kind = "assembly".into();
    plan.steps.reverse();
    for step in &mut plan.steps {
        step.path.reverse();
        step.ends = "in".into();
        plan.initial.poses.insert(step.parts[0].clone(), step.path[0]);
    }
    plan
}

/// A scene read back from GLB.
struct Played {
    document: gltf::Document,
    bytes: Vec<u8>,
}

impl Played {
    fn new(glb: &[u8]) -> Self {
        let gltf = gltf::Gltf::from_slice(glb).unwrap();
        Self { document: gltf.document, bytes: gltf.blob.unwrap() }
    }

    fn node(&self, name: &str) -> gltf::Node<'_> {
        self.document.nodes().find(|n| n.mesh().is_some() && n.name() == Some(name)).unwrap()
    }

    /// The channel values of a node at a time, interpolated as glTF prescribes.
    fn pose(&self, name: &str, time: f32) -> Isometry3<f64> {
        let node = self.node(name);
        let (shift, turn, scale) = node.transform().decomposed();
        assert_eq!(scale, [1.0; 3]);
        let (mut shift, mut turn) = (shift, turn);
        let channels = self.document.animations().flat_map(|a| a.channels().collect::<Vec<_>>());
        for channel in channels.filter(|c| c.target().node().index() == node.index()) {
            let reader = channel.reader(|_| Some(&self.bytes));
            let times: Vec<f32> = reader.read_inputs().unwrap().collect();
            assert!(times.windows(2).all(|w| w[0] < w[1]), "{times:?}");
            let next = times.partition_point(|t| *t < time).clamp(1, times.len() - 1);
            let u = ((time - times[next - 1]) / (times[next] - times[next - 1])).clamp(0.0, 1.0);
            match reader.read_outputs().unwrap() {
                gltf::animation::util::ReadOutputs::Translations(t) => {
                    let t: Vec<[f32; 3]> = t.collect();
                    shift = [0, 1, 2].map(|a| t[next - 1][a] + (t[next][a] - t[next - 1][a]) * u);
                }
                gltf::animation::util::ReadOutputs::Rotations(r) => {
                    let r: Vec<_> = r.into_f32().map(unit).collect();
                    let q = r[next - 1].try_slerp(&r[next], f64::from(u), 1e-9).unwrap_or(r[next]);
                    turn = [q.i as f32, q.j as f32, q.k as f32, q.w as f32];
                }
                _ => panic!("neither shift nor turn"),
            }
        }
        let shift = Translation3::new(f64::from(shift[0]), f64::from(shift[1]), f64::from(shift[2]));
        Isometry3::from_parts(shift, unit(turn))
    }

    /// The vertices of a part at a time, in the input's frame.
    fn points(&self, name: &str, time: f32) -> Vec<Point3<f64>> {
        let pose = self.pose(name, time);
        let primitive = self.node(name).mesh().unwrap().primitives().next().unwrap();
        let reader = primitive.reader(|_| Some(&self.bytes));
        reader.read_positions().unwrap().map(|p| pose * Point3::from(p.map(f64::from))).collect()
    }
}

fn unit([x, y, z, w]: [f32; 4]) -> UnitQuaternion<f64> {
    let q = Quaternion::new(f64::from(w), f64::from(x), f64::from(y), f64::from(z));
    assert!((q.norm() - 1.0).abs() < 1e-6);
    UnitQuaternion::from_quaternion(q)
}

/// The furthest that a point of `a` is from all of `b`, and the other way round.
fn apart(a: &[Point3<f64>], b: &[Point3<f64>]) -> f64 {
    let one_way = |a: &[Point3<f64>], b: &[Point3<f64>]| {
        let nearest =
            |p: &Point3<f64>| b.iter().map(|q| (p - q).norm_squared()).fold(f64::INFINITY, f64::min);
        a.iter().map(nearest).fold(0.0, f64::max).sqrt()
    };
    one_way(a, b).max(one_way(b, a))
}

/// Every part is all the time where the plan has it: at waypoints, between them, before its step and after.
fn check_motion(name: &str, assembly: &Assembly, plan: &PlanDocument) {
    let scene = PlanScene::new(assembly, Up::Z, plan).unwrap();
    let played = Played::new(&glb::glb(&scene).unwrap());
    let source = load_assembly(&folder(name)).unwrap();
    let scale = glb::metres(scene.units.as_deref()).unwrap_or(1.0);
    let tolerance = 2e-6 * assembly.longest_side() / assembly.scale * scale;
    let given =
        |part: &str| heal(source.parts.iter().find(|p| p.name == part).unwrap()).unwrap().mesh.vertices;
    let check = |part: &str, pose: &Pose, time: f64| {
        let expected: Vec<_> = given(part).iter().map(|v| (pose * v) * scale).collect();
        let off = apart(&expected, &played.points(part, time as f32));
        assert!(off < tolerance, "{name}: {part} is {off} off at {time}");
    };
    for (step, shown) in plan.steps.iter().zip(&scene.steps) {
        let [place] = shown.parts[..] else { panic!("one part at a time") };
        let part = &scene.parts[place];
        assert_eq!((&step.parts, part.steps.len()), (&vec![part.name.clone()], 1));
        // Waypoints are about the part as it stands assembled.
        let stands = assembly.parts.iter().find(|p| p.name == part.name).unwrap().moved;
        let poses: Vec<Pose> = step.path.iter().map(pose_from_waypoint).collect();
        check(&part.name, &(poses[0] * stands), 0.0);
        check(&part.name, &(poses[poses.len() - 1] * stands), scene.duration());
        let centre = part.bounds.centre();
        for (pair, keys) in poses.windows(2).zip(part.keys.windows(2)).take(12) {
            let pose = interpolate(&pair[0], &pair[1], &centre, 0.3);
            check(&part.name, &(pose * stands), keys[0].time * 0.7 + keys[1].time * 0.3);
        }
        assert_eq!((part.keys.len() <= poses.len(), part.keys[0].time), (true, shown.begins));
    }
    let times: Vec<f64> = scene.steps.iter().flat_map(|s| [s.begins, s.ends]).collect();
    assert!(times.windows(2).all(|w| w[0] < w[1]), "{name}: one step at a time");
    for part in assembly.parts.iter().filter(|p| plan.remaining.contains(&p.name)) {
        check(&part.name, &part.moved, scene.duration());
    }
}

#[test]
fn parts_move_in_the_scene_as_in_the_plan() {
    for name in
        ["pin-bolt-cover", "l-slot", "threaded-bolt-and-nut", "bolted-bracket-20", "linked-rings", "pegs.glb"]
    {
        let (assembly, plan) = planned(name, Vec::new());
        check_motion(name, &assembly, &plan);
        check_motion(name, &assembly, &reversed(plan));
    }
}

#[test]
fn parts_that_wait_beside_the_assembly_are_put_in() {
    let request = PlanRequest { assembly: Some(Staging::Beside(Vec::new())), ..PlanRequest::default() };
    for name in ["pin-bolt-cover", "threaded-bolt-and-nut"] {
        let (assembly, plan) = asked(name, Vec::new(), &request);
        assert_eq!((plan.kind.as_str(), plan.status.as_str()), ("assembly", "complete"), "{:?}", plan.reason);
        check_motion(name, &assembly, &plan);
        let scene = PlanScene::new(&assembly, Up::Z, &plan).unwrap();
        assert!(scene.parts.iter().all(|p| p.stays == p.steps.is_empty()));
    }
}

#[test]
fn parts_that_stand_elsewhere_are_shown_there() {
    let source = load_assembly(&folder("l-slot")).unwrap();
    let all = Pose::new(nalgebra::Vector3::new(3.0, -1.0, 2.0), nalgebra::Vector3::new(0.4, 0.2, -0.7));
    let moved = (0..source.parts.len()).map(|part| (part, all)).collect();
    let (assembly, plan) = planned("l-slot", moved);
    assert_eq!(plan.initial.poses.len(), source.parts.len());
    assert!(!plan.steps.is_empty(), "{:?}", plan.reason);
    check_motion("l-slot", &assembly, &plan);
}

/// Two parts of the bracket leave together, by a turn, and are then taken apart where they lie: the way in the scene is
/// the motion of the group after that within it.
#[test]
fn a_group_is_taken_apart_where_it_lies() {
    let (assembly, plan) = planned("pin-bolt-cover", Vec::new());
    let [first, second] = ["pin", "bolt"].map(String::from);
    let (turn, shift) = (
        Pose::new(nalgebra::Vector3::new(5.0, -30.0, 80.0), nalgebra::Vector3::new(0.3, -0.9, 1.4)),
        Pose::translation(60.0, 0.0, 0.0),
    );
    let mut group = plan.steps[0].clone();
    group.parts = vec![second.clone(), first.clone()];
    group.path = [Pose::identity(), turn].map(|pose| waypoint_from_pose(&pose)).to_vec();
    let mut inner = group.clone();
    (inner.parts, inner.of, inner.requires) = (vec![first.clone()], Some(0), vec![0]);
    inner.path = [Pose::identity(), shift].map(|pose| waypoint_from_pose(&pose)).to_vec();
    let plan = PlanDocument { steps: vec![group, inner], ..plan };
    let scene = PlanScene::new(&assembly, Up::Z, &plan).unwrap();
    let played = Played::new(&glb::glb(&scene).unwrap());
    let source = load_assembly(&folder("pin-bolt-cover")).unwrap();
    let size = assembly.longest_side() / assembly.scale;
    let parts = &scene.parts;
    let bounds = parts.iter().filter(|p| [&first, &second].contains(&&p.name)).map(|p| p.bounds);
    let centre = bounds.fold(sbdp::geometry::Bounds::EMPTY, |all, b| all.union(&b)).centre();
    let scale = glb::metres(scene.units.as_deref()).unwrap_or(1.0);
    let check = |part: &String, pose: Pose, time: f64, tolerance: f64| {
        let mesh = heal(source.parts.iter().find(|p| p.name == *part).unwrap()).unwrap().mesh;
        let expected: Vec<_> = mesh.vertices.iter().map(|v| (pose * v) * scale).collect();
        let off = apart(&expected, &played.points(part, time as f32));
        assert!(off < tolerance * size * scale, "{part} is {off} off at {time}");
    };
    let [out, own] = [&scene.steps[0], &scene.steps[1]];
    for part in [&first, &second] {
        check(part, Pose::identity(), out.begins, 2e-6);
        check(part, turn, out.ends, 2e-6);
        for u in [0.1, 0.3, 0.5, 0.77] {
            let pose = interpolate(&Pose::identity(), &turn, &centre, u);
            check(part, pose, out.begins + (out.ends - out.begins) * u, 1.01e-3);
        }
    }
    check(
        &first,
        turn * interpolate(&Pose::identity(), &shift, &centre, 0.5),
        (own.begins + own.ends) / 2.0,
        2e-6,
    );
    check(&first, turn * shift, scene.duration(), 2e-6);
    check(&second, turn, scene.duration(), 2e-6);
}

#[test]
fn equal_parts_share_a_mesh_and_neighbours_differ() {
    let (assembly, plan) = planned("bolted-bracket-20", Vec::new());
    let scene = PlanScene::new(&assembly, Up::Z, &plan).unwrap();
    assert!(scene.drawn.len() < scene.parts.len(), "{} meshes", scene.drawn.len());
    let clashes = |a: &sbdp::view::ScenePart| {
        scene
            .parts
            .iter()
            .filter(|b| b.name != a.name && b.bounds.meets(&a.bounds) && b.colour == a.colour)
            .count()
    };
    assert_eq!(scene.parts.iter().map(clashes).sum::<usize>(), 0);
    let played = Played::new(&glb::glb(&scene).unwrap());
    assert!(played.document.meshes().count() < scene.parts.len());
    let exploded: Vec<_> = scene
        .parts
        .iter()
        .map(|p| sbdp::geometry::Bounds { min: p.bounds.min + p.exploded, max: p.bounds.max + p.exploded })
        .collect();
    for (i, a) in exploded.iter().enumerate() {
        assert!(
            exploded[..i].iter().all(|b| !a.grown(-1e-9).meets(b)),
            "{} is not clear",
            scene.parts[i].name
        );
    }
}

#[test]
fn a_plan_of_other_parts_is_refused() {
    let (assembly, mut plan) = planned("l-slot", Vec::new());
    plan.parts[0] = "wheel".into();
    let error = PlanScene::new(&assembly, Up::Z, &plan).unwrap_err().to_string();
    assert!(error.contains("no part `wheel`"), "{error}");
}

/// The command, kept away from any daemon that runs for this user, and from what is remembered.
fn run(arguments: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_sbdp"));
    command.env("SBDP_RUNTIME_DIR", "/nonexistent/sbdp-tests").stdin(Stdio::null());
    command.env("SBDP_CACHE_DIR", "/nonexistent/sbdp-tests").args(arguments).output().unwrap()
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8(bytes.to_vec()).unwrap()
}

#[track_caller]
fn succeeded(output: &Output) -> String {
    assert!(output.status.success(), "{}", text(&output.stderr));
    text(&output.stdout)
}

#[track_caller]
fn refused(output: &Output, words: &[&str]) {
    let error = text(&output.stderr);
    assert_eq!(output.status.code(), Some(2), "{error}");
    assert!(words.iter().all(|w| error.contains(w)), "{words:?}: {error}");
}

#[test]
fn a_plan_becomes_a_scene_a_page_and_words() {
    let here = tempfile::tempdir().unwrap();
    let at = |name: &str| here.path().join(name).display().to_string();
    let (json, glb, html) = (at("plan.json"), at("plan.glb"), at("plan.html"));
    let assembly = folder("pin-bolt-cover").display().to_string();
    succeeded(&run(&["plan", &assembly, "--no-cache", "--json", &json, "--glb", &glb]));
    let played = Played::new(&fs::read(&glb).unwrap());
    assert_eq!(played.document.nodes().filter(|n| n.mesh().is_some()).count(), 4);
    assert_eq!(played.document.animations().count(), 1);
    let notes = played.document.as_json().asset.extras.as_ref().unwrap().get();
    assert!(notes.contains(r#""up":"z""#) && notes.contains(r#""metresPerUnit":0.001"#), "{notes}");
    assert!(succeeded(&run(&["view", &json, "-o", &html])).contains(": complete, steps 3"));
    let page = fs::read_to_string(&html).unwrap();
    assert!(page.starts_with("<!doctype html>") && !page.contains("{{"), "a placeholder is left");
    for loading in ["src=\"", "href=\"", "@import"] {
        assert!(!page.contains(loading), "{loading}: the page must need nothing else");
    }
    let words = succeeded(&run(&["steps", &json]));
    assert!(words.starts_with("# Taking apart: ") && words.contains(", after "), "{words}");
    // Put together: the page of the plan and that of the assembly are the same.
    let (json, html) = (at("together.json"), at("together.html"));
    succeeded(&run(&["plan", &assembly, "--assembly", "--no-cache", "--json", &json]));
    succeeded(&run(&["view", &json, "-o", &html]));
    let together = at("together-at-once.html");
    succeeded(&run(&["view", &assembly, "--assembly", "--no-cache", "--embedded", "-o", &together]));
    assert_eq!(fs::read_to_string(&together).unwrap(), fs::read_to_string(&html).unwrap());
    assert!(succeeded(&run(&["steps", &json])).contains("goes in after"));
    // The same from the assembly at once; the page is as good.
    let again = at("again.html");
    succeeded(&run(&["view", &assembly, "--no-cache", "--embedded", "-o", &again]));
    assert_eq!(fs::read_to_string(&again).unwrap(), page);
}

/// The names of a folder's files, sorted.
fn names_in(folder: &str) -> Vec<String> {
    let entries = fs::read_dir(folder).unwrap();
    let mut names: Vec<String> =
        entries.map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    names
}

#[test]
fn instructions_have_pictures_in_files_and_in_one_sheet() {
    let here = tempfile::tempdir().unwrap();
    let at = |name: &str| here.path().join(name).display().to_string();
    let json = at("plan.json");
    for (assembly, together) in
        [("bolted-bracket-20", false), ("pin-bolt-cover", true), ("pinned-block", false)]
    {
        let source = folder(assembly).display().to_string();
        let options: &[&str] = if together { &["--assembly"] } else { &[] };
        succeeded(&run(&[&["plan", &source, "--no-cache", "--json", &json], options].concat()));
        let words = succeeded(&run(&["steps", &json]));
        let numbered = |text: &str| text.lines().filter(|l| l.starts_with("**")).count();
        let (pictures, html) = (at(assembly), at("sheet.html"));
        let told = succeeded(&run(&["steps", &json, "--pictures", &pictures, "--html", &html]));
        let names = names_in(&pictures);
        assert_eq!(names.len(), numbered(&words) + 1, "{names:?}");
        assert!(told.contains(&format!("pictures {}", names.len())), "{told}");
        let sheet = fs::read_to_string(&html).unwrap();
        // The overview, and of every instruction its own.
        assert_eq!(sheet.matches("<img ").count(), names.len());
        assert_eq!(sheet.matches("<section class=\"step\">").count(), numbered(&words));
        for section in sheet.split("<section class=\"step\">").skip(1) {
            assert!(section.split("</section>").next().unwrap().contains("src=\"data:image/png;base64,"));
        }
        for loading in ["src=\"http", "href=", "<script", "url("] {
            assert!(!sheet.contains(loading), "{loading}: the sheet must need nothing else");
        }
        let again = at("again");
        succeeded(&run(&["steps", &json, "--pictures", &again]));
        assert_eq!(names_in(&again), names);
        for name in &names {
            let [one, two] = [&pictures, &again].map(|f| fs::read(Path::new(f).join(name)).unwrap());
            assert!(one == two, "{name} has other bytes");
        }
        fs::remove_dir_all(&again).unwrap();
    }
}

#[test]
fn pictures_need_meshes_and_stuck_parts_have_one() {
    let here = tempfile::tempdir().unwrap();
    let at = |name: &str| here.path().join(name).display().to_string();
    let (json, html) = (at("plan.json"), at("sheet.html"));
    let rings = folder("linked-rings").display().to_string();
    assert_eq!(run(&["plan", &rings, "--no-cache", "--json", &json]).status.code(), Some(3));
    succeeded(&run(&["steps", &json, "--html", &html, "--pictures", &at("pictures")]));
    assert_eq!(names_in(&at("pictures")), ["overview.png", "stuck.png"]);
    let sheet = fs::read_to_string(&html).unwrap();
    assert!(sheet.contains("What is stuck") && sheet.contains("Not complete (infeasible)"), "{sheet}");
    let plan = PlanDocument::from_json(&fs::read_to_string(&json).unwrap()).unwrap();
    fs::write(&json, PlanDocument { source: None, ..plan }.to_json().unwrap()).unwrap();
    refused(&run(&["steps", &json, "--html", &html]), &["--meshes"]);
}

#[test]
fn what_was_changed_for_planning_is_shown_so() {
    let here = tempfile::tempdir().unwrap();
    let at = |name: &str| here.path().join(name).display().to_string();
    let (json, glb, html) = (at("plan.json"), at("plan.glb"), at("plan.html"));
    let assembly = folder("l-slot").display().to_string();
    let part = load_assembly(&folder("l-slot")).unwrap().parts[0].name.clone();
    let moved = format!("{part}=0.001,0,0");
    let options =
        ["--rotate", "0.5,0.5,0.5,0.5", "--moved", &moved, "--no-cache", "--json", &json, "--glb", &glb];
    run(&[&["plan", assembly.as_str()], &options[..]].concat());
    let plan = PlanDocument::from_json(&fs::read_to_string(&json).unwrap()).unwrap();
    let source = plan.source.clone().unwrap();
    assert_eq!((source.rotate, plan.initial.poses.len()), (Some([0.5; 4]), 1));
    succeeded(&run(&["view", &json, "-o", &html]));
    let without = PlanDocument { source: None, ..plan };
    fs::write(&json, without.to_json().unwrap()).unwrap();
    refused(&run(&["view", &json, "-o", &html]), &["--meshes"]);
    succeeded(&run(&["view", &json, "--meshes", &assembly, "-o", &html]));
    let words = run(&["steps", &json]);
    assert!(text(&words.stderr).contains("--meshes") && succeeded(&words).contains("Taking apart"));
}

#[test]
fn meshes_that_changed_since_are_not_shown_as_planned() {
    let here = tempfile::tempdir().unwrap();
    let at = |name: &str| here.path().join(name).display().to_string();
    let (json, html, assembly) = (at("plan.json"), at("plan.html"), at("slot"));
    fs::create_dir(&assembly).unwrap();
    for file in fs::read_dir(folder("l-slot")).unwrap().map(|entry| entry.unwrap().path()) {
        fs::copy(&file, here.path().join("slot").join(file.file_name().unwrap())).unwrap();
    }
    let turned = ["--rotate", "0.1,0.7,-0.3,0.2"];
    succeeded(&run(&[&["plan", &assembly, "--no-cache", "--json", &json], &turned[..]].concat()));
    succeeded(&run(&["view", &json, "-o", &html]));
    let pin = at("slot/t-pin.obj");
    let mesh = fs::read_to_string(&pin).unwrap();
    let changed = mesh.replacen("v -8 -4 14\n", "v -8 -4 14.5\n", 1);
    assert_ne!(changed, mesh);
    fs::write(&pin, changed).unwrap();
    refused(&run(&["view", &json, "-o", &html]), &["not those that were planned", "--meshes"]);
    let named = run(&["view", &json, "--meshes", &assembly, "-o", &html]);
    assert!(text(&named.stderr).contains("not those that were planned"));
    succeeded(&named);
}

#[test]
fn refusals_say_what_to_do() {
    let here = tempfile::tempdir().unwrap();
    let at = |name: &str| here.path().join(name).display().to_string();
    let (json, html) = (at("plan.json"), at("plan.html"));
    let assembly = folder("l-slot").display().to_string();
    succeeded(&run(&["plan", &assembly, "--no-cache", "--json", &json]));
    refused(&run(&["view", &json, "-o", &html, "--planner", "sbdp"]), &["--planner", "planned already"]);
    refused(&run(&["view", &assembly, "-o", &html, "--meshes", &assembly]), &["--meshes"]);
    let other = folder("linked-rings").display().to_string();
    refused(&run(&["view", &json, "-o", &html, "--meshes", &other]), &["does not fit"]);
    refused(&run(&["view", &at("none.json"), "-o", &html]), &["none.json"]);
    fs::write(at("other.json"), "{}").unwrap();
    refused(&run(&["view", &at("other.json"), "-o", &html]), &["other.json", "schema", "sbdp plan --json"]);
    refused(&run(&["steps", &at("other.json")]), &["other.json", "schema"]);
    refused(&run(&["graph", &assembly, "-o", &at("graph.png")]), &["graph.png", ".svg"]);
    refused(&run(&["graph", &assembly, "--removed", "wheel", "-o", &at("g.svg")]), &["--removed", "`wheel`"]);
    refused(&run(&["graph", &assembly, "--direction", "up", "-o", &at("g.svg")]), &["--direction", "+x"]);
}

#[test]
fn an_infeasible_assembly_has_a_page_too() {
    let here = tempfile::tempdir().unwrap();
    let html = here.path().join("plan.html");
    let assembly = folder("linked-rings").display().to_string();
    let output = run(&["view", &assembly, "--no-cache", "--embedded", "-o", html.to_str().unwrap()]);
    assert_eq!(output.status.code(), Some(3));
    assert!(fs::read_to_string(&html).unwrap().contains("\"status\":\"infeasible\""));
}

#[test]
fn blocking_graphs_are_drawn() {
    let here = tempfile::tempdir().unwrap();
    let at = |name: &str| here.path().join(name).display().to_string();
    let assembly = folder("bolt-washer-plate").display().to_string();
    let parts = load_assembly(&folder("bolt-washer-plate")).unwrap().parts;
    let drawn = |options: &[&str], file: &str| {
        let file = at(file);
        succeeded(&run(&[&["graph", assembly.as_str(), "-o", &file], options].concat()));
        fs::read_to_string(&file).unwrap()
    };
    let svg = drawn(&["--direction", "+z"], "g.svg");
    assert_eq!((svg.matches("class=\"title\"").count(), svg.matches("<rect").count()), (1, parts.len()));
    // Of several directions, each has a file.
    succeeded(&run(&["graph", &assembly, "-o", &at("all.svg")]));
    for direction in ["+x", "-x", "+y", "-y", "+z", "-z"] {
        let svg = fs::read_to_string(at(&format!("all{direction}.svg"))).unwrap();
        assert!(svg.contains(&format!(">{direction}: ")), "{svg}");
    }
    assert!(!Path::new(&at("all.svg")).exists());
    let both = |dot: &str, from: usize, to: usize| dot.contains(&format!("d0p{from} -> d0p{to};"));
    let (up, down) = (drawn(&["--direction", "+z"], "g.dot"), drawn(&["--direction", "0,0,-1"], "d.dot"));
    assert_eq!(up.matches(" -> ").count(), down.matches(" -> ").count());
    for [a, b] in [[0, 1], [1, 2], [0, 2]] {
        assert_eq!(both(&up, a, b), both(&down, b, a), "what blocks upwards is blocked downwards");
    }
    assert!(up.contains(" -> "), "{up}");
    let bare =
        drawn(&["--direction", "+z", "--removed", &parts[0].name, "--removed", &parts[1].name], "b.dot");
    assert!(!bare.contains(" -> ") && bare.matches("label=").count() == 2, "{bare}");
}
