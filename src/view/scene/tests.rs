use super::super::document::tests::{plan, reversed, step};
use super::timeline::ARC_ERROR;
use super::*;
use crate::document::{FreeGroupDocument, StepDocument};
use crate::fixtures::{cuboid, source};
use crate::geometry::{Pose, Waypoint, waypoint_from_pose};

const STILL: Waypoint = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0];

/// A plate, and two boxes on it side by side, with their middles at (1, 1, 1) and (3, 1, 1).
fn assembly() -> Assembly {
    let plate = cuboid([-4.0, -4.0, -1.0], [4.0, 4.0, 0.0]);
    let boxes = [0.0, 2.0].map(|x| cuboid([x, 0.0, 0.0], [x + 2.0, 2.0, 2.0]));
    let [one, two] = boxes;
    Assembly::new(&source([plate, one, two])).unwrap()
}

/// The boxes leave together, turned by 90° about +z on the way up by 10. Then the second goes up by 1 in the group,
/// and out of it along what was +x.
fn group() -> PlanDocument {
    let up = [0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 0.0];
    let away = [5.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0];
    let moved = |parts: &[&str], of: Option<usize>, ends: &str, to: Waypoint| StepDocument {
        parts: parts.iter().map(|&name| name.to_owned()).collect(),
        of,
        ends: ends.into(),
        requires: of.into_iter().collect(),
        ..step("1", &[STILL, to])
    };
    // The middle of both is at (2, 1, 1): it goes to (2, 1, 11).
    let turn = Pose::new(Vector3::new(3.0, -1.0, 10.0), Vector3::z() * std::f64::consts::FRAC_PI_2);
    let steps = vec![
        moved(&["1", "2"], None, "out", waypoint_from_pose(&turn)),
        moved(&["2"], Some(0), "aside", up),
        moved(&["2"], Some(0), "out", away),
    ];
    PlanDocument { parts: ["0", "1", "2"].map(String::from).into(), steps, ..plan() }
}

fn scene(plan: &PlanDocument) -> PlanScene {
    PlanScene::new(&assembly(), Up::Z, plan).unwrap()
}

fn at(scene: &PlanScene, part: usize, time: f64) -> Placement {
    scene.parts[part].placement(time)
}

fn assert_at(scene: &PlanScene, part: usize, time: f64, centre: [f64; 3], tolerance: f64) {
    let found = at(scene, part, time).centre;
    assert!((found - Point3::from(centre)).norm() <= tolerance, "{part} is at {found} at {time}");
}

/// When steps begin and end, and their middle.
fn times(scene: &PlanScene, step: usize) -> [f64; 3] {
    let SceneStep { begins, ends, .. } = scene.steps[step];
    [begins, (begins + ends) / 2.0, ends]
}

#[test]
fn a_group_turns_on_its_way_out_and_is_taken_apart_where_it_lies() {
    let scene = scene(&group());
    let [begins, middle, ends] = times(&scene, 0);
    assert_at(&scene, 1, begins, [1.0, 1.0, 1.0], 0.0);
    assert_at(&scene, 1, ends, [2.0, 0.0, 11.0], 1e-9);
    assert_at(&scene, 2, ends, [2.0, 2.0, 11.0], 1e-9);
    // Half-way the middle of both has gone half of the way, and they are turned by 45°.
    let lever = std::f64::consts::FRAC_1_SQRT_2;
    let error = 8.0 * ARC_ERROR;
    assert_at(&scene, 1, middle, [2.0 - lever, 1.0 - lever, 6.0], error);
    assert_at(&scene, 2, middle, [2.0 + lever, 1.0 + lever, 6.0], error);
    let turned = at(&scene, 1, middle).rotation.angle_to(&scene.parts[1].assembled.rotation);
    assert!((turned - std::f64::consts::FRAC_PI_4).abs() < 1e-9, "{turned}");
    for u in 0..=100 {
        let time = begins + (ends - begins) * f64::from(u) / 100.0;
        let [one, two] = [1, 2].map(|part| at(&scene, part, time).centre);
        assert!(((one - two).norm() - 2.0).abs() <= 2.0 * error, "they stay as far apart as they are");
    }
    assert_at(&scene, 2, times(&scene, 1)[2], [2.0, 2.0, 12.0], 1e-9);
    let [_, middle, ends] = times(&scene, 2);
    assert_at(&scene, 2, middle, [2.0, 4.5, 12.0], 1e-9);
    assert_at(&scene, 2, ends, [2.0, 7.0, 12.0], 1e-9);
    assert_at(&scene, 1, ends, [2.0, 0.0, 11.0], 1e-9);
    let quarter = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), std::f64::consts::FRAC_PI_2);
    for part in [1, 2] {
        let expected = quarter * scene.parts[part].assembled.rotation;
        assert!(at(&scene, part, ends).rotation.angle_to(&expected) < 1e-9);
    }
}

#[test]
fn parts_are_in_a_body_until_they_leave_it() {
    let bodies = |plan: &PlanDocument| scene(plan).steps.iter().map(|s| s.body.clone()).collect::<Vec<_>>();
    assert_eq!(bodies(&group()), [vec![0, 1, 2], vec![1, 2], vec![1, 2]]);
    assert_eq!(bodies(&reversed(group())), [vec![1, 2], vec![1, 2], vec![0, 1, 2]]);
    let mut one_by_one = group();
    one_by_one.steps.truncate(1);
    one_by_one.steps[0].parts = vec!["2".into()];
    one_by_one.steps.push(StepDocument { parts: vec!["1".into()], ..one_by_one.steps[0].clone() });
    assert_eq!(bodies(&one_by_one), [vec![0, 1, 2], vec![0, 1]]);
    assert_eq!(bodies(&reversed(one_by_one)), [vec![0, 1], vec![0, 1, 2]]);
}

#[test]
fn an_assembly_plan_is_the_same_backwards() {
    let (apart, together) = (scene(&group()), scene(&reversed(group())));
    let duration = together.steps[2].ends;
    assert_eq!(apart.steps[2].ends, duration);
    for k in 0..=200 {
        let time = duration * f64::from(k) / 200.0;
        for part in 0..3 {
            let (there, back) = (at(&apart, part, duration - time), at(&together, part, time));
            assert!((there.centre - back.centre).norm() < 1e-9, "{part} at {time}");
            assert!(there.rotation.angle_to(&back.rotation) < 1e-7, "{part} at {time}");
        }
    }
    assert_eq!(together.parts[2].start.centre, at(&together, 2, 0.0).centre);
    assert_at(&together, 2, 0.0, [2.0, 7.0, 12.0], 1e-9);
}

#[test]
fn it_is_known_from_when_to_when_parts_are_handled() {
    let apart = scene(&group());
    let [out, last] = [times(&apart, 0), times(&apart, 2)];
    assert_eq!((apart.parts[0].crosses, apart.parts[0].handled), (None, None));
    for part in [1, 2] {
        let ScenePart { crosses, handled, .. } = &apart.parts[part];
        // The first lies there while the second is taken off it.
        assert_eq!((*crosses, *handled), (Some(out[2]), Some([0.0, last[2]])), "part {part}");
    }
    assert_eq!([1, 2].map(|part| apart.parts[part].steps.clone()), [vec![0], vec![0, 1, 2]]);
    let together = scene(&reversed(group()));
    let [first, last] = [times(&together, 0), times(&together, 2)];
    for part in [1, 2] {
        let ScenePart { crosses, handled, .. } = &together.parts[part];
        assert_eq!((*crosses, *handled), (Some(last[2]), Some([first[0], last[2]])), "part {part}");
    }
    let mut aside = group();
    aside.steps.truncate(1);
    (aside.steps[0].parts, aside.steps[0].ends) = (vec!["1".into()], "aside".into());
    let aside = scene(&aside);
    assert_eq!((aside.parts[1].crosses, aside.parts[1].handled), (None, Some([0.0, aside.steps[0].ends])));
}

#[test]
fn a_part_that_was_turned_aside_turns_about_the_middle_of_its_box_as_it_stands() {
    // An L, whose box has another middle once it is turned by 45°.
    let l_shape = crate::fixtures::l_shape();
    let assembly = Assembly::new(&source([l_shape, cuboid([0.0, 0.0, -5.0], [1.0, 1.0, -4.0])])).unwrap();
    let turn = |angle: f64| waypoint_from_pose(&Pose::new(Vector3::zeros(), Vector3::z() * angle));
    let eighth = std::f64::consts::FRAC_PI_4;
    let mut steps = vec![step("0", &[STILL, turn(eighth)]), step("0", &[STILL, turn(4.0 * eighth)])];
    steps[0].ends = "aside".into();
    let plan = PlanDocument { steps, remaining: vec!["1".into()], ..plan() };
    let scene = PlanScene::new(&assembly, Up::Z, &plan).unwrap();
    // Turned by 45° the corners of the L are at (0, ±√2…) about the origin: its box reaches from −√2 to √2 along x
    // and from 0 to 3/√2 along y (the corner that is missing would be at 2√2).
    let [_, middle, _] = times(&scene, 1);
    let box_middle = Point3::new(0.0, 1.5 * std::f64::consts::FRAC_1_SQRT_2, 0.5);
    let own = Point3::new(0.0, 2.0 * std::f64::consts::FRAC_1_SQRT_2, 0.5);
    // Half-way through the half turn about the origin, the box's middle is at half of its way, which is the origin.
    let offset = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), 2.0 * eighth) * (own - box_middle);
    let expected = Point3::new(0.0, 0.0, 0.5) + offset;
    assert_at(&scene, 0, middle, expected.into(), ARC_ERROR * 6.0);
}

#[test]
fn groups_are_exploded_along_their_way_and_their_parts_along_their_own() {
    let scene = scene(&group());
    let [plate, one, two] = [0, 1, 2].map(|part| scene.parts[part].exploded);
    assert_eq!(plate, Vector3::zeros());
    assert!(one.z > 0.0 && one.xy().norm() < 1e-9, "{one}");
    // Up and away, as the two steps within the group lead.
    let own = (two - one).normalize();
    assert!((own - Vector3::new(5.0, 0.0, 1.0).normalize()).norm() < 1e-9, "{own}");
    let shown = [1, 2].map(|part| {
        let ScenePart { bounds, exploded, .. } = &scene.parts[part];
        Bounds { min: bounds.min + exploded, max: bounds.max + exploded }
    });
    assert!(!shown[0].grown(-1e-9).meets(&shown[1]), "{shown:?}");
    assert!(shown.iter().all(|bounds| bounds.min.z > 0.0), "{shown:?}");
}

#[test]
fn groups_are_of_parts_of_the_scene() {
    let free = FreeGroupDocument { parts: vec!["0".into(), "2".into()], direction: [0.0, -1.0, 0.0] };
    let mut plan = PlanDocument { free_together: vec![free], ..group() };
    plan.kept_together = vec![vec!["2".into(), "1".into()]];
    (plan.status, plan.reason) = ("timeout".into(), Some("the deadline passed".into()));
    let PlanScene { kept_together, free_together, verdict, .. } = scene(&plan);
    let kept = SceneGroup { parts: vec![2, 1], words: "Not taken apart: parts 2 and 1".into() };
    assert_eq!(kept_together, [kept]);
    let words = "Can begin to move together along −Y: parts 0 and 2".to_owned();
    assert_eq!(free_together, [SceneGroup { parts: vec![0, 2], words }]);
    let verdict = verdict.unwrap();
    assert!(verdict.ends_with("remain. The deadline passed; nothing is proved."), "{verdict}");
}

#[test]
fn steps_that_contradict_each_other_are_refused() {
    let mut plan = group();
    plan.steps[2].of = None;
    let error = PlanScene::new(&assembly(), Up::Z, &plan).unwrap_err().to_string();
    assert!(error.contains("`steps[2]` moves `2`, which does not stand in the assembly"), "{error}");
}
