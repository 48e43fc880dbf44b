//! The paper's measures, over the records of one engine.

use std::collections::{BTreeSet, HashMap};

use super::corpus::Category;
use super::record::Record;
use super::{ENGINES, PAPER_PLANNERS, PDP_STAR, PDP_STAR_IS, PDP_T, PLANNERS};
use crate::files::natural_order;

/// The planner that the others are measured against.
pub(super) const REFERENCE: &str = PLANNERS[0];

/// A column of the paper's tables.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Group {
    /// The paper's three categories together.
    All,
    Only(Category),
}

impl Group {
    /// As the paper orders them; it has no pairs.
    pub(super) const LIST: [Self; 5] = [
        Self::All,
        Self::Only(Category::Small),
        Self::Only(Category::Medium),
        Self::Only(Category::Large),
        Self::Only(Category::Pair),
    ];

    pub(super) fn title(self) -> &'static str {
        match self {
            Self::All => "All, 3+",
            Self::Only(Category::Pair) => "Pairs, up to 2",
            Self::Only(Category::Small) => "Small, 3–9",
            Self::Only(Category::Medium) => "Medium, 10–49",
            Self::Only(Category::Large) => "Large, 50+",
        }
    }

    fn has(self, category: Category) -> bool {
        match self {
            Self::All => category != Category::Pair,
            Self::Only(only) => only == category,
        }
    }
}

/// What is measured of a run.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Measure {
    /// Simulations.
    Sim,
    /// Path planning time.
    Pt,
    /// Disassembly planning time.
    Dt,
}

impl Measure {
    pub(super) const ALL: [Self; 3] = [Self::Sim, Self::Pt, Self::Dt];

    pub(super) fn of(self, record: &Record) -> f64 {
        match self {
            Self::Sim => record.simulations as f64,
            Self::Pt => record.path_time_s,
            Self::Dt => record.total_time_s,
        }
    }
}

/// Average and standard deviation of all values there are (not estimated from a sample).
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Spread {
    pub(super) average: f64,
    pub(super) deviation: f64,
}

impl Spread {
    pub(super) fn of(values: &[f64]) -> Option<Self> {
        let average = mean(values)?;
        let squares: Vec<f64> = values.iter().map(|v| (v - average).powi(2)).collect();
        Some(Self { average, deviation: mean(&squares)?.sqrt() })
    }
}

/// How the reference does against another planner.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Versus {
    /// Share of problems on which it takes less time (LR).
    pub(super) less: f64,
    /// Average of what it saves where it takes less (TR); negative.
    pub(super) reduction: Option<f64>,
    /// Average of what it spends more where it takes more (TI).
    pub(super) increase: Option<f64>,
}

impl Versus {
    /// From the differences, reference minus other.
    pub(super) fn of(differences: &[f64]) -> Option<Self> {
        let side = |keep: fn(&f64) -> bool| differences.iter().copied().filter(keep).collect::<Vec<_>>();
        let (less, more) = (side(|d| *d < 0.0), side(|d| *d > 0.0));
        (!differences.is_empty()).then(|| Self {
            less: less.len() as f64 / differences.len() as f64,
            reduction: mean(&less),
            increase: mean(&more),
        })
    }
}

pub(super) fn mean(values: &[f64]) -> Option<f64> {
    (!values.is_empty()).then(|| values.iter().sum::<f64>() / values.len() as f64)
}

/// Of ratios; those that are not positive have none.
pub(super) fn geometric_mean(values: &[f64]) -> Option<f64> {
    let logarithms: Vec<f64> = values.iter().map(|v| v.ln()).collect();
    mean(&logarithms).map(f64::exp)
}

/// One planner's runs, by assembly.
#[derive(Debug)]
pub(super) struct PlannerResults<'a> {
    pub(super) planner: &'static str,
    pub(super) runs: HashMap<&'a str, &'a Record>,
}

impl<'a> PlannerResults<'a> {
    pub(super) fn solves(&self, problem: &str) -> bool {
        self.runs.get(problem).is_some_and(|r| r.solved())
    }

    /// When it solved some problems, earliest first; those that it did not solve are left out.
    fn solving_times<'p>(&self, problems: impl IntoIterator<Item = &'p str>) -> Vec<f64> {
        let runs = problems.into_iter().filter_map(|p| self.runs.get(p));
        let mut times: Vec<f64> = runs.filter(|r| r.solved()).map(|r| r.total_time_s).collect();
        times.sort_by(f64::total_cmp);
        times
    }

    fn of(planner: &'static str, records: &[&'a Record]) -> Self {
        let mine = records.iter().filter(|r| r.planner == planner);
        Self { planner, runs: mine.map(|r| (r.assembly.as_str(), *r)).collect() }
    }

    /// PDP* tries to translate and, where that fails, to turn as well; only the try that counts
    /// is recorded, as in the paper.
    fn pdp_star(records: &[&'a Record]) -> Self {
        let [first, second] = PDP_STAR_IS.map(|p| Self::of(p, records));
        let mut runs = second.runs;
        runs.retain(|problem, _| first.runs.contains_key(problem));
        runs.extend(first.runs.iter().filter(|(_, r)| r.solved()));
        Self { planner: PDP_STAR, runs }
    }
}

/// What ran with one engine on assemblies as given, or on all under the rotation of one number.
#[derive(Debug)]
pub(super) struct EngineResults<'a> {
    pub(super) engine: &'static str,
    /// All problems that anything ran on, in natural order.
    pub(super) problems: Vec<(&'a str, Category)>,
    /// Those that ran, in the order of the paper's tables.
    pub(super) planners: Vec<PlannerResults<'a>>,
}

impl<'a> EngineResults<'a> {
    pub(super) fn by_engine(records: &'a [Record]) -> Vec<Self> {
        let of = |engine: &'static str| Self::of(engine, 0, records);
        ENGINES.into_iter().map(of).filter(|r| !r.problems.is_empty()).collect()
    }

    /// As given if `rotation` is 0.
    pub(super) fn of(engine: &'static str, rotation: u32, records: &'a [Record]) -> Self {
        let wanted = |r: &&Record| r.engine == engine && r.rotation == rotation;
        let records: Vec<&Record> = records.iter().filter(wanted).collect();
        let categories: HashMap<&str, Category> =
            records.iter().map(|r| (r.assembly.as_str(), r.group())).collect();
        let mut problems: Vec<_> = categories.into_iter().collect();
        problems.sort_by(|a, b| natural_order(a.0, b.0));
        let results = |planner| match planner {
            PDP_STAR => PlannerResults::pdp_star(&records),
            _ => PlannerResults::of(planner, &records),
        };
        let planners = PLANNERS.into_iter().map(results).filter(|p| !p.runs.is_empty()).collect();
        Self { engine, problems, planners }
    }

    pub(super) fn planner(&self, name: &str) -> Option<&PlannerResults<'a>> {
        self.planners.iter().find(|p| p.planner == name)
    }

    /// The problems of a group.
    pub(super) fn group(&self, group: Group) -> impl Iterator<Item = &'a str> + '_ {
        self.problems.iter().filter(move |(_, category)| group.has(*category)).map(|(name, _)| *name)
    }

    /// Problems of a group that all planners of the paper solved that ran, PDP_t aside as there: it solves too few.
    pub(super) fn common(&self, group: Group) -> BTreeSet<&'a str> {
        let counted: Vec<_> = self.counted().collect();
        let all = |p: &&str| !counted.is_empty() && counted.iter().all(|planner| planner.solves(p));
        self.group(group).filter(all).collect()
    }

    /// The planners that are compared over common problems.
    pub(super) fn counted(&self) -> impl Iterator<Item = &PlannerResults<'a>> {
        self.planners.iter().filter(|p| p.planner != PDP_T && PAPER_PLANNERS.contains(&p.planner))
    }

    pub(super) fn solved(&self, planner: &PlannerResults<'_>, group: Group) -> usize {
        self.group(group).filter(|p| planner.solves(p)).count()
    }

    /// How many problems only the reference solved, and only the other planner.
    pub(super) fn difference(&self, planner: &PlannerResults<'_>, group: Group) -> Option<(usize, usize)> {
        let reference = self.planner(REFERENCE)?;
        let only = |a: &PlannerResults<'_>, b: &PlannerResults<'_>| {
            self.group(group).filter(|p| a.solves(p) && !b.solves(p)).count()
        };
        Some((only(reference, planner), only(planner, reference)))
    }

    /// Over commonly solved problems.
    pub(super) fn spread(
        &self,
        planner: &PlannerResults<'_>,
        group: Group,
        measure: Measure,
    ) -> Option<Spread> {
        let common = self.common(group);
        let values: Vec<f64> =
            common.iter().filter_map(|p| planner.runs.get(p)).map(|r| measure.of(r)).collect();
        Spread::of(&values)
    }

    /// The reference against another planner, over commonly solved problems.
    pub(super) fn versus(
        &self,
        planner: &PlannerResults<'_>,
        group: Group,
        measure: Measure,
    ) -> Option<Versus> {
        let reference = self.planner(REFERENCE)?;
        let difference =
            |p: &&str| Some(measure.of(reference.runs.get(p)?) - measure.of(planner.runs.get(p)?));
        Versus::of(&self.common(group).iter().filter_map(difference).collect::<Vec<_>>())
    }

    /// When a planner solved the problems of a group, earliest first.
    pub(super) fn solving_times(&self, planner: &PlannerResults<'_>, group: Group) -> Vec<f64> {
        planner.solving_times(self.group(group))
    }

    /// When a planner solved the commonly solved problems of a group, earliest first.
    pub(super) fn common_times(&self, planner: &PlannerResults<'_>, group: Group) -> Vec<f64> {
        planner.solving_times(self.common(group))
    }
}
