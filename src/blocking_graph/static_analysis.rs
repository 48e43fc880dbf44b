//! Static analysis: blocking relations of pairs, before anything is simulated.
//!
//! The paper tests whether vertices that are pushed a few steps along a direction come to lie
//! inside another part. Taken literally (see `literal`) that blocks tilted pegs and press fits in
//! all six directions. By default an edge is added only if contact with the other part alone lets
//! the wanted motion come to almost nothing, so nothing that could slide is excluded. The relation
//! is symmetric: p is blocked by o along d exactly if o is blocked by p along −d.

use rayon::prelude::*;

use crate::cache::{RecordKey, RequestCache};
use crate::geometry::Pose;
use crate::scene::{CongruentPair, Scene, grouped};
use crate::simulation::{Action, pair_blocks};
use crate::termination::{Interrupt, Termination};

use super::records::blocking_key;
use super::{Blockage, literal};

/// When one part counts as blocked by another, before anything is simulated.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum StaticAnalysis {
    /// If contact with the other part alone brings the wanted motion to almost nothing.
    #[default]
    Sliding,
    /// If a vertex, pushed a few steps, gets inside: the paper's rule, taken literally.
    Paper,
}

impl StaticAnalysis {
    /// All rules, in the order of their numbers on the wire.
    pub const ALL: [Self; 2] = [Self::Sliding, Self::Paper];

    /// The name on the command line and in records.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Sliding => "sliding",
            Self::Paper => "paper",
        }
    }
}

/// What static analysis is asked with: a rule about translations in opposite pairs (action `a ^ 1` is the
/// reverse of `a`), and what is remembered of its answers.
#[derive(Debug, Clone, Copy)]
pub struct Analysis<'a> {
    /// The rule.
    pub rule: StaticAnalysis,
    /// The bodies.
    pub scene: &'a Scene,
    /// The actions.
    pub translations: &'a [Action],
    /// What is remembered.
    pub cache: &'a RequestCache,
}

/// The graphs of a state: one part at one pose.
#[derive(Debug, Clone, PartialEq)]
pub struct StateGraphs {
    /// The part's outgoing edges.
    pub blockage: Blockage,
    /// There are pairs to ask about, and the answers of all were remembered.
    pub remembered: bool,
}

impl StateGraphs {
    /// Before any pair is asked about.
    fn new(actions: usize) -> Self {
        Self { blockage: Blockage::open(actions), remembered: false }
    }
}

/// For each translation, whether the second part of a pair blocks the first.
#[derive(Debug)]
struct PairRelation {
    blocks: Vec<bool>,
    remembered: bool,
}

impl Analysis<'_> {
    /// The graphs of all present parts (ascending) at their assembled poses. `least` is the travel of a part
    /// that counts as motion. One entry per part; absent parts stay open.
    ///
    /// # Errors
    /// The termination condition became true.
    pub fn assembled_graphs(
        &self,
        present: &[usize],
        least: &(impl Fn(usize) -> f64 + Sync),
        termination: &Termination,
    ) -> Result<Vec<StateGraphs>, Interrupt> {
        let Self { scene, translations, .. } = *self;
        let is_present = |part: usize| present.binary_search(&part).is_ok();
        let mut pairs = scene.broad_phase.pairs(NEAR);
        pairs.retain(|&(p, o)| is_present(p) && is_present(o));
        // The smaller part moves: its steps are adapted to its size.
        let extent = |i: usize| scene.bodies[i].bounds.extents().max();
        let placed = |&(p, o): &(usize, usize)| {
            let (mover, other) = if extent(p) <= extent(o) { (p, o) } else { (o, p) };
            self.keyed(mover, &scene.bodies[mover].planning_from_shape, other, least(mover))
        };
        let pairs: Vec<(RecordKey, CongruentPair)> = pairs.par_iter().map(placed).collect();
        // What holds for one bolt in its nut holds for all that stand alike.
        let (first, group_of) = grouped(pairs.iter().map(|(key, _)| *key));
        // One by one: most are remembered, and two that are not must not come after one another on one thread.
        let relations = first
            .par_iter()
            .with_max_len(1)
            .map(|&i| {
                termination.check()?;
                let (key, pair) = &pairs[i];
                self.pair_blocks(*key, pair, least(pair.parts[0]), termination)
            })
            .collect::<Result<Vec<_>, Interrupt>>()?;
        let mut out = vec![StateGraphs::new(translations.len()); scene.bodies.len()];
        let mut unknown = vec![false; scene.bodies.len()];
        for ((_, CongruentPair { parts: [mover, other], .. }), group) in pairs.into_iter().zip(group_of) {
            let PairRelation { blocks, remembered } = &relations[group];
            for a in (0..translations.len()).filter(|&a| blocks.get(a) == Some(&true)) {
                out[mover].blockage.block_single(a, other);
                out[other].blockage.block_single(a ^ 1, mover);
            }
            for part in [mover, other] {
                unknown[part] |= !remembered;
                out[part].remembered = !unknown[part];
            }
        }
        Ok(out)
    }

    /// The graphs of one displaced part among the parts that stand.
    ///
    /// # Errors
    /// The termination condition became true.
    pub fn displaced_graphs(
        &self,
        standing: &[usize],
        part: usize,
        pose: &Pose,
        least: f64,
        termination: &Termination,
    ) -> Result<StateGraphs, Interrupt> {
        let Self { scene, translations, .. } = *self;
        let mut out = StateGraphs::new(translations.len());
        let mut unknown = false;
        let bounds = scene.bodies[part].shape.bounds().transformed(pose).grown(NEAR);
        for other in scene.broad_phase.meeting_of(standing, &bounds) {
            let (key, pair) = self.keyed(part, pose, other, least);
            let PairRelation { blocks, remembered } = self.pair_blocks(key, &pair, least, termination)?;
            for a in (0..translations.len()).filter(|&a| blocks.get(a) == Some(&true)) {
                out.blockage.block_single(a, other);
            }
            unknown |= !remembered;
            out.remembered = !unknown;
        }
        Ok(out)
    }

    fn keyed(&self, part: usize, pose: &Pose, other: usize, least: f64) -> (RecordKey, CongruentPair) {
        let pair = CongruentPair::shifted(self.scene, part, pose, other);
        (blocking_key(self.scene, &pair, self.rule.name(), self.translations, least), pair)
    }

    fn pair_blocks(
        &self,
        key: RecordKey,
        pair: &CongruentPair,
        least: f64,
        termination: &Termination,
    ) -> Result<PairRelation, Interrupt> {
        let mut remembered = true;
        let blocks = self.cache.get_or(key, || {
            remembered = false;
            let (alone, pose) = (pair.scene(self.scene), &pair.poses[0]);
            match self.rule {
                StaticAnalysis::Sliding => {
                    pair_blocks(&alone, 0, pose, 1, self.translations, least, termination)
                }
                StaticAnalysis::Paper => {
                    literal::pair_blocks(&alone, 0, pose, 1, self.translations, termination)
                }
            }
        })?;
        Ok(PairRelation { blocks, remembered })
    }
}

/// Boxes further apart than this cannot touch within the look-ahead.
const NEAR: f64 = 0.2;

#[cfg(test)]
mod tests {
    use std::sync::Arc;
    use std::sync::atomic::Ordering;

    use nalgebra::Vector3;

    use super::super::BLOCKING;
    use super::*;
    use crate::cache::Cache;
    use crate::fixtures::{block_on_plate, cuboid, moved, peg_in_hole, scene};

    const UP: usize = 4;
    const DOWN: usize = 5;
    const LEAST: f64 = 0.05;
    const RULE: StaticAnalysis = StaticAnalysis::Sliding;

    fn among(
        scene: &Scene,
        present: &[usize],
        termination: &Termination,
    ) -> Result<Vec<Blockage>, Interrupt> {
        let (translations, cache) = (Action::translations(), RequestCache::default());
        let analysis = Analysis { rule: RULE, scene, translations: &translations, cache: &cache };
        let graphs = analysis.assembled_graphs(present, &|_| LEAST, termination)?;
        Ok(graphs.into_iter().map(|g| g.blockage).collect())
    }

    fn initial(scene: &Scene) -> Vec<Blockage> {
        let all: Vec<_> = (0..scene.bodies.len()).collect();
        among(scene, &all, &Termination::default()).unwrap()
    }

    fn from(scene: &Scene, standing: &[usize], part: usize, pose: &Pose) -> Blockage {
        let (translations, cache) = (Action::translations(), RequestCache::default());
        let analysis = Analysis { rule: RULE, scene, translations: &translations, cache: &cache };
        analysis.displaced_graphs(standing, part, pose, LEAST, &Termination::default()).unwrap().blockage
    }

    fn open(b: &Blockage) -> Vec<usize> {
        b.open_actions().collect()
    }

    #[test]
    fn the_six_translations_stand_in_opposite_pairs() {
        let translations = Action::translations();
        for (a, action) in translations.iter().enumerate() {
            assert_eq!(action.force(), -translations[a ^ 1].force());
        }
        assert_eq!(
            (translations[UP].to_string(), translations[DOWN].to_string()),
            ("+z".into(), "-z".into())
        );
    }

    #[test]
    fn a_plate_blocks_its_block_downwards_and_the_block_its_plate_upwards() {
        let (scene, _) = scene(block_on_plate());
        let b = initial(&scene);
        assert_eq!((open(&b[1]), open(&b[0])), (vec![0, 1, 2, 3, UP], vec![0, 1, 2, 3, DOWN]));
        assert_eq!(b[1].blockers(DOWN).into_iter().collect::<Vec<_>>(), [0]);
        assert_eq!(b[0].blockers(UP).into_iter().collect::<Vec<_>>(), [1]);
    }

    #[test]
    fn edges_are_symmetric() {
        let tilt = crate::geometry::Pose::rotation(Vector3::new(0.1, 0.5, 0.0));
        let [plate, block] = block_on_plate();
        let stack = vec![
            plate,
            block,
            cuboid([-1.0, -1.0, 2.0], [1.0, 1.0, 3.0]),
            cuboid([1.0, -1.0, 0.0], [2.0, 1.0, 1.0]),
        ];
        for meshes in [
            stack,
            peg_in_hole(0.0).into(),
            peg_in_hole(0.02).into(),
            peg_in_hole(0.0).map(|m| moved(m, &tilt)).into(),
        ] {
            let (scene, _) = scene(meshes);
            let b = initial(&scene);
            for (p, o) in (0..b.len()).flat_map(|p| (0..b.len()).map(move |o| (p, o))) {
                for a in 0..6 {
                    assert_eq!(
                        b[p].blockers(a).contains(&o),
                        b[o].blockers(a ^ 1).contains(&p),
                        "{p}, {o}, {a}"
                    );
                }
            }
        }
    }

    #[test]
    fn a_peg_in_a_blind_hole_is_open_only_upwards() {
        for excess in [0.0, 0.02] {
            let (scene, _) = scene(peg_in_hole(excess));
            assert_eq!(open(&initial(&scene)[1]), [UP], "excess {excess}");
        }
    }

    #[test]
    fn a_peg_in_a_tilted_hole_is_open_where_it_can_slide() {
        let tilt = crate::geometry::Pose::rotation(Vector3::new(0.0, 0.5, 0.0));
        let (scene, _) = scene(peg_in_hole(0.0).map(|m| moved(m, &tilt)));
        // Out of the hole is towards +x and +z.
        assert_eq!(open(&initial(&scene)[1]), [0, UP]);
    }

    #[test]
    fn absent_and_distant_parts_block_nothing() {
        let [plate, block] = block_on_plate();
        let (scene, _) = scene([plate, block, cuboid([3.0, 3.0, 1.0], [4.0, 4.0, 2.0])]);
        assert_eq!(open(&initial(&scene)[2]).len(), 6);
        let without = among(&scene, &[1, 2], &Termination::default()).unwrap();
        assert!(without.iter().all(|b| open(b).len() == 6));
    }

    #[test]
    fn a_displaced_part_is_blocked_by_what_is_around_it_there() {
        let (scene, _) = scene(peg_in_hole(0.0));
        let blockage = |lift: f64| {
            let pose = Pose::translation(0.0, 0.0, lift) * scene.bodies[1].planning_from_shape;
            from(&scene, &[0], 1, &pose)
        };
        assert_eq!(open(&blockage(0.0)), [UP]);
        assert_eq!(open(&blockage(1.0)), [UP, DOWN], "half-way out there is room below");
        assert_eq!(open(&blockage(2.0)), [0, 1, 2, 3, UP, DOWN], "on the rim it is over the hole");
        assert_eq!(open(&blockage(5.0)).len(), 6);
    }

    #[test]
    fn a_displaced_part_is_blocked_as_initially_where_it_stands() {
        let [plate, block] = block_on_plate();
        let (scene, _) = scene([plate, block, cuboid([1.0, -1.0, 0.0], [2.0, 1.0, 1.0])]);
        let pose = scene.bodies[1].planning_from_shape;
        let there = from(&scene, &[0, 2], 1, &pose);
        let initially = &initial(&scene)[1];
        for a in 0..6 {
            assert_eq!(there.blockers(a), initially.blockers(a), "action {a}");
        }
    }

    #[test]
    fn graphs_are_remembered_if_the_answers_of_all_their_pairs_are() {
        let [plate, block] = block_on_plate();
        let (scene, _) = scene([plate, block, cuboid([1.0, -1.0, 0.0], [2.0, 1.0, 1.0])]);
        let translations = Action::translations();
        let cache = RequestCache::of(Arc::new(Cache::in_memory(1 << 20, &[&BLOCKING])));
        let analysis = Analysis { rule: RULE, scene: &scene, translations: &translations, cache: &cache };
        let remembered = |present: &[usize]| {
            let graphs = analysis.assembled_graphs(present, &|_| LEAST, &Termination::default()).unwrap();
            graphs.into_iter().map(|g| g.remembered).collect::<Vec<_>>()
        };
        assert_eq!(remembered(&[0, 1]), [false; 3]);
        assert_eq!(remembered(&[0, 1]), [true, true, false]);
        assert_eq!(remembered(&[0, 1, 2]), [false; 3], "each has the third part beside it");
        let at = |present: &[usize], x: f64| {
            let pose = Pose::translation(0.0, 0.0, x) * scene.bodies[1].planning_from_shape;
            analysis.displaced_graphs(present, 1, &pose, LEAST, &Termination::default()).unwrap().remembered
        };
        assert!(!at(&[0], 0.01) && at(&[0], 0.01));
        assert!(!at(&[0], 5.0), "nothing is near");
    }

    #[test]
    fn a_cancelled_analysis_ends_with_the_reason() {
        let (scene, _) = scene(block_on_plate());
        let termination = Termination::default();
        termination.cancel_flag().store(true, Ordering::Relaxed);
        assert_eq!(among(&scene, &[0, 1], &termination).err(), Some(Interrupt::Cancelled));
    }
}
