//! Pictures of a plan's instructions, drawn without a browser and without a graphics card.
//!
//! Of each instruction: the parts that it moves in one strong colour with an arrow along their way, all that still stands
//! pale with dark edges, and what hides the moving parts see-through. Parts that left before are not drawn. Besides, an
//! overview (assembled and exploded), and of a plan that is not complete what is stuck.

use nalgebra::{Point3, Vector3};
use rayon::prelude::*;

use super::arrow::{Arrow, arrows_of};
use super::raster::{Camera, Canvas, Image, Layer, Paint};
use super::viewpoint::{Posed, chosen, corners, merits, upwards, views};
use super::{Instruction, Instructions, PALETTE, Placement, PlanScene, Rgb, ViewError};
use crate::geometry::Bounds;
use crate::plan::{PlanKind, PlanStatus};

/// Pixels of a picture of an instruction; and of the two panels of an overview.
const SIZE: [usize; 2] = [840, 600];
const LEFT: [usize; 2] = [360, 620];
const RIGHT: [usize; 2] = [840, 620];
/// Pixels of the small picture of the whole, beside an enlarged one.
const INSET: [usize; 2] = [240, 172];
/// Share of a picture that is left free on each side.
const MARGIN: f64 = 0.06;
/// Share of the picture's width. If the moving parts with their arrows are smaller, the picture is enlarged about them. At
/// half, screws of a frame are specks; at double, nearly all pictures are enlarged, and the place is hard to find.
const SMALL: f64 = 0.3;
/// Share of an enlarged picture that is left free on each side of the moving parts.
const AROUND: f64 = 0.3;

/// Share of the samples of the moving parts that a part hides from which on it is see-through. At half, parts that cover a
/// corner become glass; at double, the head of a screw that sticks out hides its way.
const HIDES: f64 = 0.1;
/// Opacity of faces and lines of what is see-through, …
const GLASS: [f32; 2] = [0.16, 0.55];
/// … and of the places where parts are put in.
const PLACE: [f32; 2] = [0.16, 0.6];

const BACKGROUND: Rgb = [255, 255, 255];
/// The moving parts: the vermilion of Okabe and Ito's palette, which no pale part comes near to.
pub(super) const MOVING: Rgb = [0xE8, 0x5D, 0x04];
const MOVING_EDGE: Rgb = [0x5A, 0x1E, 0x00];
/// Parts that have to be held meanwhile.
pub(super) const HELD: Rgb = [0xC2, 0x18, 0x3A];
const HELD_EDGE: Rgb = [0x4A, 0x00, 0x12];
const EDGE: Rgb = [0x56, 0x60, 0x70];
/// The colours of stuck parts. They alternate, so that two parts that hold each other differ.
pub(super) const STUCK: [Rgb; 3] = [[0x8E, 0x3B, 0x9C], [0xC9, 0x8A, 0xD6], [0x5F, 0x4B, 0xB6]];
const STUCK_EDGE: Rgb = [0x3E, 0x0A, 0x46];
/// Groups that can begin to move together.
pub(super) const FREE: [Rgb; 3] = [[0x2A, 0x9D, 0x6E], [0x1F, 0x86, 0xC4], [0xC9, 0x9A, 0x06]];
const ARROW: Rgb = [0x0B, 0x3D, 0x91];
const GUIDE: Rgb = [0x8A, 0x97, 0xAD];
const FRAME: Rgb = [0x8A, 0x94, 0xA3];

/// A picture of a plan.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Illustration {
    /// A name for its file, without an extension.
    pub name: String,
    /// Which instruction it shows; none for the overview and for what is stuck.
    pub instruction: Option<usize>,
    /// What is seen, for those who do not see it.
    pub text: String,
    /// The picture as PNG. The same plan and meshes give the same bytes.
    pub png: Vec<u8>,
}

/// The pictures of a plan: the overview, one per instruction, and if parts are stuck one of them.
///
/// # Errors
/// A picture cannot be written as PNG.
pub fn illustrations(scene: &PlanScene, instructions: &Instructions) -> Result<Vec<Illustration>, ViewError> {
    let (figures, backs) = figures(scene, instructions);
    let digits = scene.steps.len().to_string().len();
    let of_instruction = |(k, back): (usize, &Vector3<f64>)| {
        let instruction = &instructions.list[k];
        let numbers: Vec<String> =
            instruction.steps.iter().map(|step| format!("{:0digits$}", step + 1)).collect();
        let name = match &numbers[..] {
            [first, .., last] => format!("steps-{first}-{last}"),
            numbers => format!("step-{}", numbers.concat()),
        };
        let text = format!("{}. {}", instruction.numbers(), instruction.words);
        illustration(name, Some(k), text, &figures[k].drawn(scene, back))
    };
    let pictures: Vec<Result<Illustration, ViewError>> =
        backs.par_iter().enumerate().map(of_instruction).collect();
    let name = if scene.name.is_empty() { "the assembly" } else { &scene.name };
    let overview = illustration(
        "overview".to_owned(),
        None,
        format!("{name}, assembled and exploded"),
        &panels(scene, &Figure::assembled(scene), &Figure::exploded(scene, |_| true)),
    );
    let stuck = (scene.status != PlanStatus::Complete.name()).then(|| {
        let left = left(scene);
        let end = Figure::at_the_end(scene, &left);
        let image = panels(scene, &end, &Figure::exploded_stuck(scene, &left));
        illustration("stuck".to_owned(), None, "What is stuck, as it stands and exploded".to_owned(), &image)
    });
    std::iter::once(overview).chain(pictures).chain(stuck).collect()
}

/// How an instruction is shown where it plays.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Shot {
    /// Unit direction to the viewer.
    pub(super) back: Vector3<f64>,
    /// Parts that hide much of the moving ones.
    pub(super) hiding: Vec<usize>,
    /// The ways of its parts.
    pub(super) arrows: Vec<Arrow>,
}

/// How each instruction is shown, as in its picture.
pub(super) fn shots(scene: &PlanScene, instructions: &Instructions) -> Vec<Shot> {
    let (figures, backs) = figures(scene, instructions);
    let shot = |(figure, back): (Figure, Vector3<f64>)| {
        let camera =
            Camera::fitting(&back, &upwards(scene.up), &figure.extent(scene, |_| true), SIZE, MARGIN);
        let hiding = figure.hiding(scene, &camera).into_iter().map(|at| figure.shown[at].part).collect();
        Shot { back, hiding, arrows: figure.arrows }
    };
    figures.into_par_iter().zip(backs).map(shot).collect()
}

/// What is shown of each instruction, and from which side.
fn figures(scene: &PlanScene, instructions: &Instructions) -> (Vec<Figure>, Vec<Vector3<f64>>) {
    let figures: Vec<Figure> = instructions.list.iter().map(|i| Figure::of_instruction(scene, i)).collect();
    let merits: Vec<Vec<f64>> = figures.par_iter().map(|figure| figure.merits(scene)).collect();
    let all = views(scene.up);
    (figures, chosen(&merits).into_iter().map(|view| all[view]).collect())
}

fn illustration(
    name: String,
    instruction: Option<usize>,
    text: String,
    image: &Image,
) -> Result<Illustration, ViewError> {
    let png = image.png().map_err(|e| ViewError::TooLarge(format!("as PNG: {e}")))?;
    Ok(Illustration { name, instruction, text, png })
}

/// The parts that are not where they should be in the end, with those that stand among them.
fn left(scene: &PlanScene) -> Vec<usize> {
    let is_left = |part: &usize| scene.parts[*part].crosses.is_none();
    (0..scene.parts.len()).filter(is_left).collect()
}

/// What a part is in a picture.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Role {
    /// The picture is about it.
    Moving,
    /// It is there.
    Standing,
    /// It is there, and has to be held.
    Held,
    /// It is shown in its own colour.
    Coloured,
    /// It should have moved, and did not; its turn among the colours.
    Stuck(usize),
    /// It is in one of the groups that can begin to move together.
    Free(usize),
}

#[derive(Debug, Clone, Copy)]
struct Shown {
    part: usize,
    at: Placement,
    role: Role,
}

/// What a picture shows.
#[derive(Debug, Default)]
struct Figure {
    shown: Vec<Shown>,
    /// Where parts are put in.
    places: Vec<Shown>,
    arrows: Vec<Arrow>,
    /// Lines from where parts stand to where they are shown.
    guides: Vec<[Point3<f64>; 2]>,
}

impl Figure {
    /// The body that an instruction is about, before its first step (of an assembly plan: with its last one), and the moving
    /// parts: where their ways out begin, or before their places.
    fn of_instruction(scene: &PlanScene, instruction: &Instruction) -> Self {
        let (Some(&first), Some(&last)) = (instruction.steps.first(), instruction.steps.last()) else {
            return Self::default();
        };
        let is_assembly = scene.kind == PlanKind::Assembly;
        let body = &scene.steps[if is_assembly { last } else { first }].body;
        let begins = scene.steps[first].begins;
        let mut figure = Self::default();
        let is_moved =
            |part: &usize| instruction.steps.iter().any(|&step| scene.steps[step].parts.contains(part));
        let is_held =
            |part: usize| instruction.steps.iter().any(|&step| scene.steps[step].held.contains(&part));
        for &part in body.iter().filter(|part| !is_moved(part)) {
            let role = if is_held(part) { Role::Held } else { Role::Standing };
            figure.shown.push(Shown { part, at: scene.parts[part].placement(begins), role });
        }
        let standing = figure.shown.iter().map(|shown| scene.bounds_at(shown.part, &shown.at));
        let size = standing.fold(Bounds::EMPTY, |all, own| all.union(&own)).extents().norm();
        for &step in &instruction.steps {
            let (time, arrows) = arrows_of(scene, step, size);
            for &part in &scene.steps[step].parts {
                let at = scene.parts[part].placement(time);
                figure.shown.push(Shown { part, at, role: Role::Moving });
                if is_assembly {
                    let at = scene.parts[part].placement(scene.steps[step].ends);
                    figure.places.push(Shown { part, at, role: Role::Moving });
                }
            }
            figure.arrows.extend(arrows);
        }
        figure
    }

    fn assembled(scene: &PlanScene) -> Self {
        let shown = |part: usize| Shown { part, at: scene.parts[part].assembled, role: Role::Coloured };
        Self { shown: (0..scene.parts.len()).map(shown).collect(), ..Self::default() }
    }

    fn exploded(scene: &PlanScene, is_shown: impl Fn(usize) -> bool) -> Self {
        let mut figure = Self::assembled(scene);
        figure.shown.retain(|shown| is_shown(shown.part));
        for Shown { part, at, .. } in &mut figure.shown {
            let shift = scene.parts[*part].exploded;
            if shift != Vector3::zeros() {
                figure.guides.push([at.centre, at.centre + shift]);
            }
            at.centre += shift;
        }
        figure
    }

    /// What is left at the end, where it stands.
    fn at_the_end(scene: &PlanScene, left: &[usize]) -> Self {
        let shown = |&part: &usize| Shown {
            part,
            at: scene.parts[part].placement(scene.duration()),
            role: left_role(scene, part),
        };
        Self { shown: left.iter().map(shown).collect(), ..Self::default() }
    }

    fn exploded_stuck(scene: &PlanScene, left: &[usize]) -> Self {
        let mut figure = Self::exploded(scene, |part| left.contains(&part));
        figure.shown.iter_mut().for_each(|shown| shown.role = left_role(scene, shown.part));
        figure
    }

    fn posed<'a>(&self, scene: &'a PlanScene) -> Vec<Posed<'a>> {
        let posed = |shown: &Shown| Posed {
            mesh: &scene.drawn[scene.parts[shown.part].drawn],
            at: shown.at,
            is_subject: !matches!(shown.role, Role::Standing | Role::Held),
        };
        self.shown.iter().map(posed).collect()
    }

    fn merits(&self, scene: &PlanScene) -> Vec<f64> {
        let mut ways: Vec<Vec<Point3<f64>>> =
            self.arrows.iter().filter(|a| !a.is_turn).map(|a| a.points.clone()).collect();
        ways.extend(self.guides.iter().map(|guide| guide.to_vec()));
        merits(&self.posed(scene), &ways, scene.up)
    }

    /// Points that must be in the picture.
    fn extent(&self, scene: &PlanScene, is_in: impl Fn(&Shown) -> bool) -> Vec<Point3<f64>> {
        let shown = self.shown.iter().chain(&self.places).filter(|shown| is_in(shown));
        let boxes = shown.flat_map(|s| corners(&scene.drawn[scene.parts[s.part].drawn], &s.at));
        boxes.chain(self.arrows.iter().flat_map(|arrow| arrow.points.iter().copied())).collect()
    }

    /// The picture from a side; if the moving parts are small, enlarged about them, with a small picture of the whole.
    fn drawn(&self, scene: &PlanScene, back: &Vector3<f64>) -> Image {
        let up = upwards(scene.up);
        let whole = self.extent(scene, |_| true);
        let moving = self.extent(scene, |shown| shown.role == Role::Moving);
        let camera = Camera::fitting(back, &up, &whole, SIZE, MARGIN);
        let span = span(&camera, &moving);
        let is_small = !moving.is_empty()
            && (span[1][0] - span[0][0]).max(span[1][1] - span[0][1]) < SMALL * SIZE[0] as f64;
        if !is_small {
            return self.painted(scene, &camera);
        }
        let near = Camera::fitting(back, &up, &moving, SIZE, AROUND);
        let mut image = self.painted(scene, &near);
        let far = Camera::fitting(back, &up, &whole, INSET, MARGIN);
        let mut inset = self.painted(scene, &far);
        // What the enlarged picture shows of the whole.
        let middle = |k: usize| (self::span(&far, &moving)[0][k] + self::span(&far, &moving)[1][k]) / 2.0;
        let half = SIZE.map(|s| s as f64 / 2.0 * near.pixel() / far.pixel());
        let (x, y) = (middle(0), middle(1));
        inset.frame([x - half[0], y - half[1]], [x + half[0], y + half[1]], ARROW);
        inset.frame([0.0, 0.0], INSET.map(|s| s as f64), FRAME);
        image.put(&inset, [SIZE[0] - INSET[0], SIZE[1] - INSET[1]]);
        image
    }

    fn painted(&self, scene: &PlanScene, camera: &Camera) -> Image {
        let fine = camera.supersampled();
        let mesh = |shown: &Shown| &scene.drawn[scene.parts[shown.part].drawn];
        let hiding = self.hiding(scene, camera);
        let (glass, solid): (Vec<(usize, &Shown)>, _) =
            self.shown.iter().enumerate().partition(|(i, _)| hiding.contains(i));
        let layer = |shown: &[(usize, &Shown)]| {
            let mut layer = Layer::new(&fine);
            shown.iter().for_each(|(i, s)| layer.surface(&fine, mesh(s), &s.at, *i as u32));
            shown.iter().for_each(|(_, s)| layer.edges(&fine, mesh(s), &s.at));
            layer
        };
        let mut canvas = Canvas::new(&fine, BACKGROUND);
        for guide in &self.guides {
            let ends = guide.map(|p| fine.project(&p)).map(|[x, y, _]| [x, y]);
            super::arrow::line(&mut canvas, &ends, 1.5, GUIDE);
        }
        let solid = layer(&solid);
        let look = |shown: &Shown| paint(scene, shown);
        canvas.paint(&solid, None, [1.0; 2], |i| look(&self.shown[i as usize]));
        if !glass.is_empty() {
            canvas.paint(&layer(&glass), Some(&solid), GLASS, |i| look(&self.shown[i as usize]));
        }
        if !self.places.is_empty() {
            let places: Vec<(usize, &Shown)> = self.places.iter().enumerate().collect();
            canvas.paint(&layer(&places), None, PLACE, |i| look(&self.places[i as usize]));
        }
        self.arrows.iter().for_each(|arrow| arrow.draw(&mut canvas, &fine, ARROW));
        canvas.image()
    }

    /// Which of the standing parts hide much of the moving ones.
    fn hiding(&self, scene: &PlanScene, camera: &Camera) -> Vec<usize> {
        let mesh = |shown: &Shown| &scene.drawn[scene.parts[shown.part].drawn];
        let mut subject = Layer::new(camera);
        for shown in self.shown.iter().filter(|shown| shown.role == Role::Moving) {
            subject.surface(camera, mesh(shown), &shown.at, 0);
        }
        let whole = subject.count(|_| true) as f64;
        let hides = |i: &usize| {
            let shown = &self.shown[*i];
            if shown.role != Role::Standing || whole == 0.0 {
                return false;
            }
            let mut own = Layer::new(camera);
            own.surface(camera, mesh(shown), &shown.at, 0);
            subject.covered_by(&own) as f64 > whole * HIDES
        };
        (0..self.shown.len()).filter(hides).collect()
    }
}

/// The role of a part that is left in the end.
fn left_role(scene: &PlanScene, part: usize) -> Role {
    let group = scene.free_together.iter().position(|group| group.parts.contains(&part));
    let is_stuck = |part: usize| scene.blocked.iter().any(|blocked| blocked.part == scene.parts[part].name);
    match group {
        Some(group) => Role::Free(group % FREE.len()),
        None if is_stuck(part) => {
            Role::Stuck((0..part).filter(|&other| is_stuck(other)).count() % STUCK.len())
        }
        None => Role::Standing,
    }
}

/// The upper left and the lower right corner of some points in an image.
fn span(camera: &Camera, points: &[Point3<f64>]) -> [[f64; 2]; 2] {
    let mut span = [[f64::INFINITY; 2], [f64::NEG_INFINITY; 2]];
    for [x, y, _] in points.iter().map(|p| camera.project(p)) {
        for (k, value) in [x, y].into_iter().enumerate() {
            span[0][k] = span[0][k].min(value);
            span[1][k] = span[1][k].max(value);
        }
    }
    span
}

/// Two pictures side by side, from the side from which the second is seen best.
fn panels(scene: &PlanScene, left: &Figure, right: &Figure) -> Image {
    let back = chosen(&[right.merits(scene)]).first().map_or(Vector3::z(), |&view| views(scene.up)[view]);
    let up = upwards(scene.up);
    let draw = |figure: &Figure, size: [usize; 2]| {
        let camera = Camera::fitting(&back, &up, &figure.extent(scene, |_| true), size, MARGIN);
        figure.painted(scene, &camera)
    };
    let size = [LEFT[0] + RIGHT[0], LEFT[1]];
    let mut image = Image { size, pixels: vec![BACKGROUND; size[0] * size[1]] };
    image.put(&draw(left, LEFT), [0, 0]);
    image.put(&draw(right, RIGHT), [LEFT[0], 0]);
    image
}

fn paint(scene: &PlanScene, shown: &Shown) -> Paint {
    let own = PALETTE[scene.parts[shown.part].colour];
    // Steps of colour; a share of the paper's white.
    let pale = |share: f64| own.map(|c| (f64::from(c) * (1.0 - share) + 255.0 * share).round() as u8);
    match shown.role {
        Role::Moving => Paint { colour: MOVING, edge: MOVING_EDGE, outline: 2 },
        Role::Held => Paint { colour: HELD, edge: HELD_EDGE, outline: 2 },
        Role::Standing => Paint { colour: pale(0.78), edge: EDGE, outline: 1 },
        Role::Coloured => Paint { colour: pale(0.25), edge: EDGE, outline: 1 },
        Role::Stuck(turn) => Paint { colour: STUCK[turn], edge: STUCK_EDGE, outline: 2 },
        Role::Free(group) => Paint { colour: FREE[group], edge: STUCK_EDGE, outline: 2 },
    }
}

#[cfg(test)]
mod tests {
    use super::super::Up;
    use super::super::document::tests::{plan, reversed, step};
    use super::*;
    use crate::document::{BlockedDocument, PlanDocument};
    use crate::fixtures::{cuboid, source};
    use crate::geometry::Assembly;

    /// A plate with two boxes of different sizes on it, which are lifted one after the other.
    fn lifted() -> PlanDocument {
        let up = [[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 9.0, 1.0, 0.0, 0.0, 0.0]];
        let steps = vec![step("1", &up), step("2", &up)];
        PlanDocument { parts: ["0", "1", "2"].map(String::from).into(), steps, ..plan() }
    }

    fn scene(plan: &PlanDocument) -> PlanScene {
        let meshes = [
            cuboid([-4.0, -4.0, -1.0], [4.0, 4.0, 0.0]),
            cuboid([-3.0, -3.0, 0.0], [-1.0, -1.0, 2.0]),
            cuboid([1.0, 1.0, 0.0], [3.0, 3.0, 3.0]),
        ];
        PlanScene::new(&Assembly::new(&source(meshes)).unwrap(), Up::Z, plan).unwrap()
    }

    fn drawn(scene: &PlanScene, plan: &PlanDocument) -> Vec<Illustration> {
        illustrations(scene, &Instructions::of(plan, Some(&[0, 1, 2]))).unwrap()
    }

    /// How many pixels of a picture have the hue of the moving parts.
    fn moving_pixels(picture: &Illustration) -> usize {
        let mut reader = png::Decoder::new(std::io::Cursor::new(&picture.png)).read_info().unwrap();
        let mut bytes = vec![0; reader.output_buffer_size().unwrap()];
        reader.next_frame(&mut bytes).unwrap();
        let is_moving = |p: &&[u8]| {
            let [r, g, b] = [p[0], p[1], p[2]].map(i32::from);
            r > 120 && g * 10 < r * 6 && b * 10 < r * 3
        };
        bytes.chunks_exact(3).filter(is_moving).count()
    }

    #[test]
    fn each_instruction_has_a_picture_in_which_its_part_is_seen() {
        for plan in [lifted(), reversed(lifted())] {
            let pictures = drawn(&scene(&plan), &plan);
            let names: Vec<&str> = pictures.iter().map(|p| p.name.as_str()).collect();
            assert_eq!(names, ["overview", "step-1", "step-2"]);
            for picture in &pictures[1..] {
                assert!(moving_pixels(picture) > 2000, "{}: {}", picture.name, moving_pixels(picture));
            }
            assert_eq!(pictures[1].instruction, Some(0));
        }
    }

    #[test]
    fn the_same_plan_gives_the_same_bytes() {
        assert_eq!(drawn(&scene(&lifted()), &lifted()), drawn(&scene(&lifted()), &lifted()));
    }

    #[test]
    fn nothing_is_drawn_of_parts_that_left_before() {
        let (plan, before) = (lifted(), scene(&lifted()));
        let mut other = before.clone();
        let gone = other.parts[1].drawn;
        assert!(other.parts.iter().filter(|p| p.drawn == gone).count() == 1);
        other.drawn[gone].positions.iter_mut().for_each(|p| *p = p.map(|x| x * 1.5));
        let [before, after] = [drawn(&before, &plan), drawn(&other, &plan)];
        assert_ne!(before[1].png, after[1].png, "it is seen while it is there");
        assert_eq!(before[2].png, after[2].png, "and not when it is gone");
    }

    #[test]
    fn a_part_that_hides_the_moving_one_is_see_through() {
        let plan = lifted();
        let mut scene = scene(&plan);
        assert!(shots(&scene, &Instructions::of(&plan, None)).iter().all(|shot| shot.hiding.is_empty()));
        // The plate becomes a block around all.
        let block = scene.parts[0].drawn;
        scene.drawn[block].positions.iter_mut().for_each(|p| p[2] *= 20.0);
        let shots = shots(&scene, &Instructions::of(&plan, None));
        assert!(shots.iter().all(|shot| shot.hiding == [0]), "{shots:?}");
        assert!(drawn(&scene, &plan)[1..].iter().all(|picture| moving_pixels(picture) > 500));
    }

    #[test]
    fn what_is_stuck_has_a_picture() {
        let blocked = BlockedDocument { part: "2".into(), by: vec!["0".into()], action: "any".into() };
        let stuck = PlanDocument {
            status: "infeasible".into(),
            steps: lifted().steps[..1].to_vec(),
            blocked: vec![blocked],
            ..lifted()
        };
        let scene = scene(&stuck);
        let pictures = drawn(&scene, &stuck);
        assert_eq!(pictures.last().map(|p| p.name.as_str()), Some("stuck"));
        let left = left(&scene);
        assert_eq!(left, [0, 2]);
        let roles: Vec<Role> = Figure::at_the_end(&scene, &left).shown.iter().map(|s| s.role).collect();
        assert_eq!(roles, [Role::Standing, Role::Stuck(0)]);
    }
}
