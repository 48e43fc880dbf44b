//! What a planning request asks for, free of any transport.

/// Which search runs.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Planner {
    /// State-based planning guided by directional blocking graphs (the paper's SBDP*).
    #[default]
    SbdpStar,
}

/// Which transition function moves the parts.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Engine {
    /// Contact-constrained sliding without inertia.
    #[default]
    Sliding,
}

/// Which actions the search may use.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum ActionSet {
    /// The paper's: six translations; six translations and six rotations.
    Paper,
    /// The paper's and pulling while turning about the same axis.
    #[default]
    Extended,
}

/// A planning question about one assembly. Part numbers are indices into its parts.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct PlanRequest {
    /// Which search.
    pub planner: Planner,
    /// Which transition function.
    pub engine: Engine,
    /// Which actions.
    pub actions: ActionSet,
    /// Simulations after which the search gives up with `partial`.
    pub max_simulations: Option<u64>,
    /// Worker threads for this request; 0 stands for all. Never changes the plan.
    pub threads: usize,
    /// Parts that may not move.
    pub fixed: Vec<usize>,
    /// Parts that are gone already.
    pub removed: Vec<usize>,
    /// Parts that must come out; `None` for all.
    pub targets: Option<Vec<usize>>,
    /// Neither read nor write anything remembered.
    pub no_cache: bool,
}

/// What a request is doing; lossy, for display only.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Progress {
    /// The stage that runs.
    pub stage: Stage,
    /// Units of this stage done.
    pub done: u32,
    /// Units of this stage in all (fields to build; parts to remove).
    pub total: u32,
    /// Simulations so far.
    pub simulations: u64,
}

/// The stages of a request, named like the folders that do them.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Stage {
    /// Building distance fields.
    Sdf,
    /// Searching and verifying.
    Search,
}

/// Receives what a request yields while it runs.
pub trait PlanSink: Send {
    /// Something moved on.
    fn progress(&mut self, progress: Progress);
    /// A verified step, in order.
    fn step(&mut self, step: &crate::plan::PlanStep);
}
