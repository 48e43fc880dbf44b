//! The table of budgets: every count that bounds work, memory or a number of attempts.
//!
//! All of them are counts, of what the first words name. A motion or path that exceeds its budget does not count as free
//! or blocked: a slower method takes over (samples for regions, surfaces for profiles), or it ends as undecided. Half of
//! a budget makes this happen sooner, double later. Where no reason stands beside a value, it was chosen for the time of
//! the corpus, and no derivation is recorded.
//!
//! "Measured" names the plans of 18 corpus entries (11 generated, 3 of the gallery, 1 press fit, 3 of `truth`) that
//! change at half and at double the value; times were not compared. One thread, up to 150 simulations, November 2026.

// Region covers: pieces and regions.

/// Regions of one shift. A cover that needs more is given up, and samples take over.
/// Measured: no effect at half and double.
pub(crate) const REGIONS_PER_SHIFT: usize = 20_000;
/// Pieces of one surface in a cover for shifts; with more, samples take over. In the play of a thread, which has
/// thousands, each step ends at the next piece, and samples take a fraction of the time.
/// Measured: no effect at half and double.
pub(crate) const SHIFT_PIECES: usize = 1000;
/// Pieces of one surface in a cover for motions that turn: fewer, as every step looks at all of them.
/// Measured: no effect at half and double.
pub(crate) const RIGID_PIECES: usize = 600;
/// Regions of the first cover of one surface of a pair, before the other surface gets as many; doubled each time, …
/// Measured: no effect at half and double.
pub(crate) const FIRST_SIDE_REGIONS: usize = 16;
/// … up to this. Fewer regions predict badly how many the whole surface needs.
/// Measured: no effect at half and double.
pub(crate) const SIDE_REGIONS: usize = 64;
/// Pieces in a row whose new region allows no further shift, after which a shift ends. A corner where many pieces touch
/// needs one each.
/// Measured: no effect at half and double.
pub(crate) const STALLS: usize = 16;
/// Regions of one query of a pair while turning.
/// Measured: no effect at half and double.
pub(crate) const REGIONS_PER_LOOK: usize = 100;
/// Regions when a pair comes near and pieces lie outside the regions of the cover for shifts.
/// Measured: no effect at half and double.
pub(crate) const REGIONS_ON_APPROACH: usize = 200;
/// Regions of one motion that turns …
/// Measured: no effect at half and double.
pub(crate) const REGIONS_PER_MOTION: usize = 400;
/// … and of each of its steps. A motion that needs more than both costs less at samples.
/// Measured: no effect at half and double.
pub(crate) const REGIONS_PER_STEP: usize = 40;
/// Poses between the ends of a step at which small bits without a region are measured.
pub(crate) const POSES_BETWEEN: usize = 4;
/// Golden sections along an edge to find its deepest point.
/// Measured: no effect at half and double.
pub(crate) const EDGE_SECTIONS: usize = 10;
/// Contacts of a pair that are kept from step to step.
/// Measured: no effect at half and double.
pub(crate) const KEPT_CONTACTS: usize = 128;
/// Contacts of one query after which no more pieces without a region are searched.
/// Measured: no effect at half and double.
pub(crate) const CONTACTS_PER_LOOK: usize = 4;
/// Corners of a piece that are measured, …
/// Measured: no effect at half and double.
pub(crate) const PROBED_CORNERS: usize = 24;
/// … and triangles whose planes it has passed.
/// Measured: no effect at half and double.
pub(crate) const PASSED_TRIANGLES: usize = 12;
/// Corners of a piece that are probed ahead, and as many faces.
/// Measured: no effect at half and double.
pub(crate) const PROBES: usize = 16;
/// Points of a piece that are probed before each plane that it touches.
/// Measured: no effect at half and double.
pub(crate) const LOWEST_POINTS: usize = 8;
/// Points that showed obstacles of a pair and are remembered.
/// Measured: no effect at half and double.
pub(crate) const WITNESSES: usize = 8;
/// Effort (pieces, and [`REGION_EFFORT`] for each region) on each surface of a path before it is left to samples: some
/// seconds, for samples promise less. A bayonet that turns askew to all axes needs a third.
/// Measured: no effect at half and double.
pub(crate) const PATH_EFFORT: usize = 20_000_000;
/// The same where holes are in sight or threads cross: most stays open, whatever is spent.
/// Measured: no effect at half and double.
pub(crate) const PATH_EFFORT_IN_DOUBT: usize = 200_000;
/// Effort on one surface of a path (pieces and [`REGION_EFFORT`]) after which depths are ignored up to half the limit;
/// after twice as much effort up to three quarters, … Chosen, not derived: most paths of the corpus need less. Half of
/// it reports less exact depths of more paths; double makes a lid that is tilted out take about twice as long.
pub(crate) const EFFORT_PER_HALVING: usize = 100_000;
/// … at most this many times. A part that touches all along its path is then bounded to seven eighths of the limit; a
/// fourth halving would leave a sixteenth of the limit for pieces that must be measured.
pub(crate) const MOST_HALVINGS: usize = 3;
/// Effort on each surface of a path before its samples are measured, which refute most paths that are refused. As much
/// as [`EFFORT_PER_HALVING`]: up to there depths are exact. Half measures samples of more good paths in vain; double
/// spends as much more on paths that samples refute.
pub(crate) const EFFORT_BEFORE_SAMPLES: usize = 100_000;
/// Poses. Samples of a path are measured at every fourth pose first, and a path that is refused there is not measured
/// further: a thread that is refused is too deep all along. Chosen, not derived. Half (2) spends twice as much on such
/// paths. At 16 verification finds fewer points to refine the motion with: `furniture-round-table` took twice as long.
pub(crate) const FIRST_POSES_EVERY: usize = 4;
/// In sight of holes, after this part of the effort (a divisor) …
/// Measured: no effect at half and double.
pub(crate) const HOPELESS_AFTER: usize = 10;
/// … the search ends if no more than this share is bounded.
/// Measured: no effect at half and double.
pub(crate) const HOPELESS_SHARE: f64 = 0.02;
/// The effort of a region, in pieces.
/// Measured: at half and at double another plan of `bolt_nut_m8_thread`.
pub(crate) const REGION_EFFORT: usize = 40;
/// Edges of holes whose winding numbers take as long as a piece without holes.
/// Measured: no effect at half and double.
pub(crate) const RIM_EDGES_PER_EFFORT: usize = 32;
/// Deep points after which a path is refuted.
/// Measured: no effect at half and double.
pub(crate) const DEEP_POINTS: usize = 400;
/// Regions of a place that are tried, …
/// Measured: at half another plan of 7 entries; at double another plan of `flange_6_plain`, `gearbox_1stage`.
pub(crate) const REGIONS_OF_PLACE: usize = 3;
/// … and of those that held a piece last: the next piece lies beside it, mostly.
/// Measured: at half another plan of 3 entries; at double another plan of 5 entries.
pub(crate) const RECENT_REGIONS: usize = 4;
/// Corners of a hull; larger hulls are not tested corner by corner.
/// Measured: no effect at half and double.
pub(crate) const HULL_CORNERS: usize = 64;
/// Corners around which a region is grown.
/// Measured: no effect at half and double.
pub(crate) const WANTED_CORNERS: usize = 1024;
/// Bends of a leg of a path; a leg with more has no hull.
/// Measured: no effect at half and double.
pub(crate) const LEG_BENDS: usize = 12;

// Motions.

/// Poses of a motion, after which it turns without end.
/// Measured: no effect at half and double.
pub(crate) const MOTION_POSES: usize = 8000;
/// Corrections of a step that is likely to hold, …
/// Measured: no effect at half and double.
pub(crate) const EAGER_ROUNDS: usize = 6;
/// … and of one that is not.
/// Measured: no effect at half and double.
pub(crate) const LAZY_ROUNDS: usize = 12;
/// Halvings of a step before it is stuck.
/// Measured: no effect at half and double.
pub(crate) const STEP_HALVINGS: usize = 3;
/// Bends of a push at one place.
/// Measured: no effect at half and double.
pub(crate) const PUSH_BENDS: usize = 64;
/// Corrections that bring a part to the middle of its play.
/// Measured: at half and at double another plan of `bolt_nut_m8_thread`.
pub(crate) const CLEARANCE_ROUNDS: usize = 3;
/// Places of a step that are tested for a release: slots with less play than an eighth of a step are missed.
/// Measured: at half and at double another plan of `bayonet`.
pub(crate) const RELEASE_PLACES: u32 = 16;
/// Contact queries of one step before the step is made without release.
/// Measured: no effect at half and double.
pub(crate) const RELEASE_LOOKS: usize = 8;
/// Steps that the static analysis of a pair looks ahead (the paper's five extensions), …
/// Measured: no effect at half and double.
pub(crate) const STATIC_STEPS: usize = 5;
/// … and pushes, which end where the next obstacle begins.
/// Measured: no effect at half and double.
pub(crate) const STATIC_PUSHES: usize = 32;
/// Steps of an extrapolation.
/// Measured: at half another plan of `bayonet`; at double no effect.
pub(crate) const EXTRAPOLATION_STEPS: usize = 32;
/// The same along a helix.
/// Measured: at half another plan of `bolt_nut_m8_thread`; at double no effect.
pub(crate) const HELIX_EXTRAPOLATION_STEPS: usize = 512;
/// A shorter extrapolation along a helix gains nothing over steps.
/// Measured: at half no effect; at double another plan of `bolt_nut_m8_thread`.
pub(crate) const SHORTEST_HELIX_EXTRAPOLATION: usize = 4;
/// Steps between two tests whether a thread still holds the part, coarse and fine, …
pub(crate) const HELD_STATIONS: [usize; 2] = [4, 1];
/// … and whether it clearly enters anything.
pub(crate) const FREE_STATIONS: [usize; 3] = [16, 4, 1];
/// Measurements of samples of either surface; with more, distance fields are quicker: in the play of a thread nearly
/// all samples are near.
/// Measured: no effect at half and double.
pub(crate) const LOOKS_BY_SAMPLES: usize = 1200;
/// Poses that are tested on the way through a passage.
/// Measured: no effect at half and double.
pub(crate) const PASSAGE_POSES: usize = 64;
/// Rays that measure what is in a part's way.
/// Measured: no effect at half and double.
pub(crate) const OBSTRUCTION_RAYS: usize = 128;
/// Points of a side from which null twists are computed, …
/// Measured: no effect at half and double.
pub(crate) const NULL_TWIST_POINTS: usize = 2000;
/// … and the fewest contacts.
/// Measured: no effect at half and double.
pub(crate) const FEWEST_NULL_CONTACTS: usize = 12;
/// Planes of touching faces: round fits have many, threads more.
/// Measured: no effect at half and double.
pub(crate) const TOUCHED_PLANES: usize = 64;
/// The most Newton iterations of a penalty step that a request may ask for, thirty times the default: between two steps
/// nothing is interrupted. At double, a request is cancelled twice as late.
pub(crate) const MOST_NEWTON_ITERATIONS: u32 = 1000;
/// The most steps of a motion that a request may ask for, ten times the default. Each may add a waypoint of 56 bytes; at
/// double, a motion may take twice the memory.
pub(crate) const MOST_PENALTY_STEPS: u64 = 1_000_000;
/// Evaluations of a penalty step, per Newton iteration. Smooth contact needs one each; a part wedged between points
/// whose slopes all jump could go on for hundreds, and gain millionths.
pub(crate) const EVALUATIONS_PER_ITERATION: u64 = 2;
/// Times that a Newton step is shortened.
pub(crate) const BACKTRACKS: u32 = 6;
/// Slopes that are kept at one contact point.
pub(crate) const SLOPES_PER_POINT: usize = 8;

// The search.

/// Largest number of translational passes in a row before turning is tried. 1 is the paper's, and turns parts that
/// further pushes would free; a large number pushes through free play first.
pub(crate) const TRANSLATION_PASSES: usize = 6;
/// Number of states of one part after which the resolution is halved, and again after as many more. Free play yields
/// states without end. Half of it merges states sooner; double it simulates more of the play first.
pub(crate) const STATES_PER_LEVEL: usize = 3;
/// Number of states of the other kind, or in other regions, that count as one. Half of it hides more junctions of a
/// large maze; double it keeps more states of free play in many regions.
pub(crate) const STATES_ELSEWHERE: usize = 8;
/// Number of times that a motion is simulated again with the points at which verification refuted it. Half of it
/// gives motions up that more samples would mend; double it spends as many more simulations on each that they do not
/// mend.
pub(crate) const REFINEMENTS: usize = 4;
/// Largest number of rays, of all parts together. It bounds the number of sweeps. Once it is reached, further parts
/// get no rays.
pub(crate) const OWN_RAYS: usize = 32;
/// Largest number of twists, of all parts together: two for a helix, four where it has no sense. It bounds the number
/// of simulations. Once it is reached, further parts get no twist.
pub(crate) const OWN_TWISTS: usize = 64;
/// Largest number of rays of a narrow cone: three planes of a corner bound a cone of three. Half of it leaves that
/// corner out; double it adds rays of wide cones, which are no better than the axes.
pub(crate) const NARROW_CONE_RAYS: usize = 4;
/// Largest number of axes beyond the frame, for parts that stand askew. Each adds its actions to every state; half of
/// it leaves out askew parts of small surface.
pub(crate) const EXTRA_AXES: usize = 3;
/// Largest number of curves per part: two per hole. It bounds the time; parts with more holes are not found to be
/// linked.
pub(crate) const SURFACE_LOOPS: usize = 64;
/// Largest number of pairs of segments for one pair of parts. It bounds the time; pairs with more are not found to be
/// linked.
pub(crate) const SEGMENT_PAIRS: usize = 4_000_000;
/// Cells that are measured for one ball inside a part: about as many as a plate of 30 by 30 times its thickness needs.
/// A part that needs more gets a smaller ball.
pub(crate) const INSCRIBED_BALL_CELLS: usize = 4000;
/// Cells along the longest side of a part's box in which the way out of a ball is looked for; the next grid follows if
/// one proves nothing. The last one tells windows from balls that differ by a hundredth of the side.
pub(crate) const ENCLOSURE_GRIDS: [usize; 4] = [16, 32, 64, 128];
/// Cells of all such grids of one search: some seconds. Half of it leaves out the last pairs of assemblies of many
/// parts; double it lets the end of such a search take twice as long.
pub(crate) const ENCLOSURE_CELLS: usize = 2_000_000;

/// Number of simulations per thread in one window, where few of them lead out: long and short ones share the threads
/// better. 1 leaves threads idle; more throws away more when one leads out. No plan depends on it.
pub(crate) const WINDOW_PER_THREAD: usize = 4;

/// Count of edges and corners that are cast to search the cells of one part before anything is simulated turning (once
/// from its states, once from where turns in place lead), and to find such turns from one state: a serpentine of 40
/// rows is searched within it in 0.8 s; the play of a thread has cells without end. Half of it leaves large mazes to the
/// end of the search.
pub(crate) const EDGES_CAST_BEFORE_TURNING: usize = 200_000;
/// The same at the end of the search, when nothing else is left. Half of it misses ways through the largest mazes; at
/// three times as much, puzzles that end `exhausted` take 1 to 2 s longer (measured on four of the corpus).
pub(crate) const EDGES_CAST_AT_LAST: usize = 600_000;
/// States of a part that are turned in place before anything is simulated turning. At half, a part that has to be pushed
/// aside before it turns is left to simulation more often; at double, parts that do not leave so take twice as long.
pub(crate) const STARTS_TURNED: usize = 4;
/// Centres of round edges about which a part is turned, beside its centre of mass. At half, hinges of parts with several
/// round ends are missed; at double, plates with many holes take twice as long.
pub(crate) const TURN_CENTRES: usize = 3;
/// Angles by which a part is turned about one axis. At half, windows are missed among the edges of splines and gears; at
/// double, these take twice as long.
pub(crate) const TURNS_PER_AXIS: usize = 48;
/// Pairs of edges along one axis that give critical angles: a gear with a hundred teeth has as many with its like. Beyond,
/// nothing is turned about that axis. At half, internal gears are left out; at double, knurls take seconds.
pub(crate) const CRITICAL_ANGLES: usize = 200_000;
/// Cells that are kept of the line of one cast. A surface with thousands of critical coordinates (a thread) would fill
/// the search with one line; half of it misses narrow windows among as many.
pub(crate) const CELLS_PER_CAST: usize = 256;

/// Largest number of halvings: at 2^10 times the resolution every pose of a large part is the same state (51 lengths
/// and 512 rad), so that more of them change nothing.
pub(crate) const STATE_LEVELS: usize = 10;

// Helices and threads.

/// Slabs along the axis per pitch. A profile is stored slab by slab: a head that is at least one slab away from the thread
/// is not compared with it. At a quarter, nuts near the head of a coarse bolt are checked at samples: 10 s, not 1 s, on a thread of two starts. At
/// double, profiles take twice the memory.
pub(crate) const SLABS_PER_PITCH: f64 = 16.0;
/// Heights of a profile within a pitch: at first, and where these show no gap. The finest see a play of a
/// hundredth of the pitch of a thread of three starts; at half, such threads are checked at samples, which takes seconds.
/// The first measured: at half no effect; at double another plan of `bolt_nut_m8_thread`.
pub(crate) const HEIGHTS_PER_PITCH: [usize; 4] = [300, 900, 2700, 8100];
/// Halvings of a triangle until its profile is taken as it is.
/// Measured: no effect at half and double.
pub(crate) const TRIANGLE_HALVINGS: u32 = 24;
/// Effort on a surface of a screw path before profiles are compared.
/// Measured: at half and at double another plan of `bolt_nut_m8_thread`.
pub(crate) const EFFORT_BEFORE_PROFILES: usize = 8_000;
/// Pieces of the way from the middle of a thread's play to where the given path ends.
/// Measured: at half and at double another plan of `bolt_nut_m8_thread`.
pub(crate) const CENTRING_PIECES: u32 = 4;
/// Rounds of leaving out what lies off a helix.
/// Measured: at half and at double another plan of `bolt_nut_m8_thread`.
pub(crate) const OUTLIER_ROUNDS: usize = 4;
/// Knots of a helix on one segment of a path.
/// Measured: no effect at half and double.
pub(crate) const KNOTS_PER_SEGMENT: f64 = 64.0;
/// Rounds of weighing facets when the axis of flanks is fitted.
/// Measured: at half and at double another plan of `bolt_nut_m8_thread`.
pub(crate) const FLANK_ROUNDS: usize = 6;
/// Poses of a way along a thread of which one is looked at before the way is verified: a look every 0.8 radians. At half
/// looks take twice as long; at double a way into a thin obstacle is verified for seconds before it is refuted.
pub(crate) const POSES_PER_LOOK: usize = 8;
/// Ranges of heights within a pitch by which the rise of a thread is fitted. Within each the flank should be straight: at
/// half, it has corners there; at double, there are few points in each. Measured on an M8 thread and on threads of one to
/// three starts: no effect of either.
pub(crate) const RISE_RANGES: usize = 24;
/// Heights within a pitch at which flanks are looked for, to see how much of it they take up: ten to each of
/// [`RISE_RANGES`]. At half, a thin wire is taken for one twice as thick; at double, half of the heights have no point.
pub(crate) const OCCUPIED_HEIGHTS: usize = 10 * RISE_RANGES;
/// Rounds of fitting the helix of a thread before the last one: the ends of the thread, which do not count, are known
/// only with its pitch. With none, seats and bottoms of holes distort the fit; with double no effect.
pub(crate) const HELIX_ROUNDS: usize = 1;
/// Sweeps over the parameters of a helix when it is fitted; some dozens are needed. At half no effect; at double, what is
/// no thread takes a little longer to be recognised as such.
pub(crate) const HELIX_FIT_SWEEPS: usize = 200;
/// Points of each surface from which the helix of a thread is fitted: a hundred to each of [`RISE_RANGES`]. At half the rise
/// is less exact, by a thousandth where the thread has a single turn; at double it takes twice as long.
pub(crate) const FLANK_POINTS: usize = 2500;
/// Facets that make a thread.
/// Measured: no effect at half and double.
pub(crate) const FEWEST_FLANK_FACETS: usize = 24;

// Paths by samples.

/// Poses in the first batch of a path that is measured at samples.
pub(crate) const POSES_AT_ONCE: usize = 32;
/// Shares into which the samples of a shape are dealt, …
pub(crate) const SAMPLE_SHARES: usize = 4;
/// … on paths of more poses than this.
pub(crate) const LONG_PATH: usize = 400;

// Steps of a walk between two checks of the termination condition: reading the clock takes as long as a short step.

/// A sample, an edge, a corner or a triangle.
pub(crate) const SHORT_STEPS_PER_POLL: u32 = 64;
/// A contact with its planes: large surfaces that lie on each other have tens of thousands.
pub(crate) const STEPS_PER_POLL: u32 = 16;
/// A piece of surface.
pub(crate) const LONG_STEPS_PER_POLL: u32 = 4;

// Parts that are given twice, and what they have in common.

/// Points of a surface, and as many vertices, at which a part is compared with one that it may be a copy or a body of.
/// Half may miss a small hole; double takes twice as long where parts are given twice. Others differ at the first few.
pub(crate) const REPEATED_POINTS: usize = 500;
/// Points of the surface below which points deep inside are compared.
pub(crate) const REPEATED_DEEP_POINTS: usize = 32;
/// Parts that a warning names; others are counted.
pub(crate) const NAMED_BODIES: usize = 8;
/// Steps in which a ball is shrunk until it touches a surface. What takes more gives no point.
pub(crate) const BALL_SHRINKS: usize = 32;
/// Points at which the inside that two parts have in common is measured. In a large thin part far more would be needed to
/// prove that no point is deeper; its deepest point is found from the surface.
pub(crate) const COMMON_POINTS: usize = 2000;
/// Points of each surface below which the deepest point is looked for first.
pub(crate) const COMMON_SEEDS: usize = 64;

// Memory.

/// Sets of standing parts with their hulls; one set for each part would take memory of the square of their number.
pub(crate) const REMEMBERED_STANDING_PARTS: usize = 64;
/// Levels of the legs of a path that are remembered: some thousands.
pub(crate) const REMEMBERED_LEG_LEVELS: u32 = 12;
/// Pieces for shifts that are kept besides those of assembled pairs; then they are forgotten.
pub(crate) const REMEMBERED_SHIFT_PIECES: usize = 40_000;
/// Motions with one start, each among other parts; of more, the last ones.
pub(crate) const MOTION_VARIANTS: usize = 8;
/// Parts along one line; of more, the last ones.
pub(crate) const PARTS_PER_LINE: usize = 256;
/// Verdicts that a request keeps; of more, all are forgotten. A few kB each.
pub(crate) const KEPT_VERDICTS: usize = 4096;
/// Points of joined hulls, of some hundred hulls.
pub(crate) const REMEMBERED_HULL_POINTS: usize = 200_000;
/// A hull of fewer points is joined as fast as it is found in a store.
pub(crate) const FEWEST_STORED_POINTS: usize = 12;
/// A hull of more points than this times those that it had when it was last joined is joined again: a join takes as
/// long as some hundred tests.
pub(crate) const LOOSE_HULL: usize = 32;
/// If no more than one part in this many is gone, the tree of all parts is made: the next request may be about others.
pub(crate) const MOSTLY_STANDING: usize = 2;

/// Points of a surface at which its thickness is measured. The quarter that is thinnest has a fourth of them; half of
/// them misses thin flanges of large parts, double takes twice as long once for each shape (a closest point costs most).
pub(crate) const THICKNESS_POINTS: usize = 200;
/// Count of random poses towards which the tree of a part grows at first, in RRT and BK-RRT; twice as many whenever no
/// part leaves: two batches of BK-RRT. At half one more round; at double, parts that others block are tried longer in vain.
pub(crate) const RRT_FIRST_SAMPLES: usize = 16;
/// The most of them for one part: eight times what a threaded bolt needed with BK-RRT (125), the most of the small
/// assemblies that come apart. At half fewer parts leave; at double what never leaves takes twice as long.
pub(crate) const RRT_SAMPLES: usize = 1024;
/// Motions of BK-RRT that are simulated in parallel, enough for eight threads. At half threads idle; at double trees grow
/// wider before they grow longer. Never the number of threads: plans may not depend on that.
pub(crate) const RRT_BATCH: usize = 8;
/// Cross-sections of a part along one axis in which discs and openings are looked for, amid the longest stretches that it
/// does not change in. At half, the neck of a part with many steps is missed; at double it takes twice as long.
pub(crate) const CROSS_SECTIONS: usize = 32;
/// Cells in which a disc is checked to be inside a part: some thousands are needed for a disc whose rim is a hundredth of
/// the radius inside. At half, some discs near a rim are not proved; at double no effect.
pub(crate) const DISC_CELLS: usize = 20_000;
/// Count of sets of parts that are looked at for the smallest one from which targets leave straight. In assemblies of twelve
/// parts a hundred are enough; at half or double, a target of a large frame may take more or fewer steps.
pub(crate) const TARGET_SETS: usize = 2000;
/// Count of searches for fewer removals that take targets out. Each has few parts that may move, and asks for the blocking
/// graph of all; at half, plans of more than six removals are left longer than they need to be; at double, such questions take
/// longer.
pub(crate) const TARGET_SEARCHES: usize = 12;
/// Count of searches for fewer parts that leave though they are to be kept, each for all that remains. They are made where
/// several such parts leave. Enough for all sets of four such parts; at half, more of them may leave than has to; at double,
/// such questions take longer.
pub(crate) const KEPT_SEARCHES: usize = 16;
/// Count of groups of one state that are searched for a way out by pushes. Six pieces have at most 31; at half, puzzles of five
/// pieces are given up; at double, what never comes apart takes up to twice as long.
pub(crate) const GROUPS_SEARCHED: usize = 64;
/// The same with all that the planner knows, at the end of a search: each takes as long as a part that does not leave.
/// At half, a group that turns out is missed where some smaller ones can begin to move; at double, a search that ends
/// `exhausted` takes up to twice as long.
pub(crate) const GROUPS_TURNED: usize = 8;
/// Count of places of all parts that are searched for one after which some leave, some 2,000 in a second on one core. A cube in a cage
/// needs 57 to its first piece; at half, puzzles of more moves are given up; at double, what never comes apart takes up to twice as long.
/// Measured: `puzzle-pelikanburr` (126 moves) needs more than 100,000.
pub(crate) const PLACES_SEARCHED: usize = 20_000;
/// Count of edges and corners that are cast for that, some seconds: parts with fine facets are given up sooner. At half, a
/// cage of round bars is; at double, what never comes apart takes up to twice as long.
pub(crate) const EDGES_CAST_FOR_PLACES: usize = 6_000_000;
/// Count of ways to such places that are verified: casts seldom miss anything. At half, one that is refuted may hide the next; at
/// double no effect.
pub(crate) const PLACES_VERIFIED: usize = 8;

// Statics.

/// Corners of the area in which two parts lie on each other. Of round areas as many are taken in evenly spread directions,
/// which leaves out up to 3 % of the radius. At half, 13 %; at double, programs have twice as many unknowns.
pub(crate) const CONTACT_CORNERS: usize = 12;
/// Contacts of a pair: those furthest from each other. A pin in a hole has hundreds. At half, pins have six around each
/// end; at double, programs have twice as many unknowns.
pub(crate) const CONTACTS_PER_PAIR: usize = 24;
/// Sets of parts that are tried for the smallest one that has to be held, of each size up to two. At half, assemblies
/// of 20 loose parts get a set that is not the smallest; at double, they take twice as long.
pub(crate) const HOLDING_SETS: usize = 200;
/// Sets of removals from which no order leads on, after which the search for one with few hands is given up. Orders of up to
/// eight removals are all tried; at half, of seven, at double, of nine. An order is nearly always found without any.
pub(crate) const STEADY_STATES: usize = 256;
/// Directions in which a sideways load is tried. At half, a part that tips over a corner seems to withstand 1.4 times as
/// much; at double, 1.08 instead of 1.08².
pub(crate) const SIDEWAYS_DIRECTIONS: usize = 8;

// Clearance.

/// Pieces that are looked into for the least distance on one way. Few ways need 10,000; those of threads with play, along
/// which all flanks are equally near, never end. At half, the bound of these is a little lower; at double, they take
/// twice as long.
pub(crate) const APPROACH_ITEMS: usize = 300_000;
/// Vertices of a patch (three for each triangle at most) whose hull bounds its distance. At half, only leaves have hulls;
/// at double, the hull of a patch takes longer than those of its parts.
pub(crate) const APPROACH_HULL: usize = 64;
/// Rounds in which a path is pushed away from what it comes too near to. A leg along a wall needs 2 or 3, a bend around an
/// edge up to 10. At half, some bends are given up; at double, ways without room take twice as long to be given up.
pub(crate) const BAND_ROUNDS: usize = 24;
/// Of these rounds, each one of this number adds a waypoint where the path is furthest off. At half, paths get waypoints
/// that they do not need; at double, what needs two of them is given up.
pub(crate) const BAND_ROUNDS_PER_WAYPOINT: usize = 4;
/// How many times all pushes of a round are satisfied in turn. They need not be satisfied to the digit: the next round
/// measures anew. At half, a leg in a corner takes more rounds; at double, nothing changes.
pub(crate) const BAND_PROJECTIONS: usize = 16;

// Converters of STEP files. Measured with the converters in `clients/step` (OCCT 8.0, November 2026, two slow cores):
// 0.6 s to start, 0.4 s and 14 MB of memory per MB of plane faces, 1 s per MB of curved ones.

/// Seconds after which a converter is killed. At half, files of 500 MB with plane faces are given up; at double, a
/// converter that hangs is waited for for twenty minutes.
pub(crate) const STEP_CONVERSION_SECONDS: u64 = 600;
/// Seconds that a converter may take to say its version: 0.06 measured; a cold disk and a busy machine take a hundred
/// times that. At half or double nothing is known to change.
pub(crate) const STEP_VERSION_SECONDS: u64 = 20;
/// Bytes of data of a process of a converter: as much as the largest file needs. At half, files above 300 MB fail; at
/// double, a converter that fills the memory takes that of most machines.
pub(crate) const STEP_MEMORY_BYTES: u64 = 8 << 30;
/// Bytes of a STEP file. All are in memory, and would take longer than the deadline if there were twice as many.
pub(crate) const STEP_FILE_BYTES: u64 = 512 << 20;
/// Bytes of a file that a converter writes: 100 million triangles. At double, a GLB is as large as the format allows.
pub(crate) const STEP_OUTPUT_BYTES: u64 = 2 << 30;
/// Bytes of a converter's stdout: a line with 50,000 products. At half, fewer; at double, a flood is read longer.
pub(crate) const STEP_STDOUT_BYTES: u64 = 4 << 20;
/// Bytes of a converter's stderr, of which the end is kept: kernels write a line for each face that they mend.
pub(crate) const STEP_STDERR_BYTES: u64 = 64 << 20;
/// Bytes of remembered outputs: 50 million triangles. At half, large assemblies push each other out sooner.
pub(crate) const STEP_CACHE_BYTES: u64 = 1 << 30;
