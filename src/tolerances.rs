//! The table of tolerances: every length, angle and share on which an answer of the planner depends.
//!
//! Lengths are in the planning frame, where the assembly's longest side is in (5, 10]; angles are in radians; shares,
//! cosines and multiples have no unit. A constant that is derived says from what. Counts are in `budgets`.
//!
//! "Measured" says what the constant at half and at double its value changed in the plans of 18 corpus entries (11
//! generated, 3 of the gallery, 1 press fit, 3 of `truth`), one thread, up to 150 simulations, in November 2026; not
//! what it changed in their time. "No effect" means on these.

use std::f64::consts::TAU;
use std::ops::Range;

// Depth: what counts as a penetration.

/// Length. A pair may be this much deeper than its allowed penetration at any pose of a motion. Every other depth
/// below derives from it; verification allows the multiple that the engine declares.
/// Measured: at half and at double another plan of 3 entries.
pub(crate) const DEPTH_TOLERANCE: f64 = 3e-4;
/// Length. The same half-way between two poses of a motion that turns.
/// Measured: at half another plan of `cam_lock_key`; at double another plan of 3 entries.
pub(crate) const BULGE_TOLERANCE: f64 = 2.0 * DEPTH_TOLERANCE;
/// Length. How far a piece may be outside its region beyond the allowed penetration. A corner of the measured surface
/// gets a few times deeper into a face than the face gets into the corner; this keeps it within what the engine
/// declares.
/// Measured: no effect at half and double.
pub(crate) const HELD: f64 = DEPTH_TOLERANCE / 2.0;
/// Length. The same where a motion begins: flat sides leave out a little of what is free, and where parts stand
/// assembled nothing is entered.
/// Measured: at half no effect; at double another plan of `caxif-s1-c5-214`.
pub(crate) const HELD_AT_FIRST: f64 = 1e-3;
/// Length. A plane nearer than this is touched; lengths below it count as none.
/// Measured: no effect at half and double.
pub(crate) const TOUCHED: f64 = 1e-6;
/// Share of the smallest extent of the smaller part of a pair. A deeper overlap as assembled gets a warning of its own:
/// press fits and threads are drawn some hundredths deep, and a part in a wrong place about half. At half, parts of
/// coarse meshes are warned of; at double, only parts whose middle is inside another.
pub(crate) const DEEP_OVERLAP: f64 = 0.25;
/// Length. Coordinates in files are rounded by up to this.
/// Measured: no effect at half and double.
pub(crate) const ROUNDED: f64 = 1e-5;
/// Length. A sample no deeper than this counts as on the surface: a third of the depth tolerance, as coordinates are
/// rounded and poses drift.
/// Measured: at half and at double another plan of `bolt_nut_m8_thread`.
pub(crate) const ON_SURFACE: f64 = 1e-4;
/// Length. Gap from which on two hulls are apart.
/// Measured: at half and at double another plan of 13 entries.
pub(crate) const HULL_MARGIN: f64 = 1e-3;
/// Share of the longest side of a part's box: the gap between its hull and that of all that stands where its way ends, if
/// the request gives none. So no way out is shorter than this, and a part that leaves is seen to be off. Chosen: at half, a
/// way cannot be seen on a picture of the whole; at double, ways of long parts are visibly longer than they need to be.
pub(crate) const HULL_CLEARANCE: f64 = 0.01;
/// Cosine of the angle between a part's last leg and the way straight off the hull of what stands up to which the leg is
/// continued (60 degrees): the leg is then at most twice as long. At half, four times; at 1 most ways end with a bend.
pub(crate) const ALONG_HULL: f64 = 0.5;
/// Share. Where a sweep takes a part to be out, the gap of hulls is this much larger than [`HULL_MARGIN`], so that it
/// does not hang on rounding.
/// Measured: at half and at double another plan of 8 entries.
pub(crate) const ASSURED_GAP: f64 = 0.01;
/// Length. How deep a sweep may enter a face before the face stops it.
/// Measured: no effect at half and double.
pub(crate) const SWEEP_SUNK: f64 = 0.2 * DEPTH_TOLERANCE;
/// Length. How deep shifts along a plane, tilted by less than [`TILT`], may get into it in all.
/// Measured: no effect at half and double.
pub(crate) const SHIFT_SUNK: f64 = 0.3 * DEPTH_TOLERANCE;
/// Sine of an angle. A shift that leads into a plane less steeply goes along it: planes in files are rounded.
/// Measured: no effect at half and double.
pub(crate) const TILT: f64 = 1e-5;
/// Length. Pairs with more allowed penetration are not covered by regions: their facets lie across each other, and what
/// overlaps may be pushed into walls by as much. Of a screw whose head reaches 0.02 into its lid, 20,000 regions were
/// looked for in vain.
/// Measured: no effect at half and double.
pub(crate) const COVERED_OVERLAP: f64 = 1e-3;
/// Length. A point is moved this far to see whether it enters.
/// Measured: no effect at half and double.
pub(crate) const ENTRY_PROBE: f64 = 2e-3;
/// Share of [`ENTRY_PROBE`] by which it must get deeper.
/// Measured: no effect at half and double.
pub(crate) const ENTRY_SHARE: f64 = 0.125;

// Steps of motions.

/// Length. The longest step in free space.
/// Measured: at half no effect; at double another plan of `cam_lock_key`.
pub(crate) const FREE_STEP: f64 = 0.5;
/// Length. The longest step in contact; what is further off needs no region, and regions reach as far.
/// Measured: at half another plan of 4 entries; at double another plan of `bayonet`, `cam_lock_key`.
pub(crate) const CONTACT_STEP: f64 = 0.12;
/// Length. A contact step is half as long as the part is thin, but no shorter than this.
/// Measured: no effect at half and double.
pub(crate) const SHORTEST_CONTACT_STEP: f64 = 0.03;
/// Length. How far the arc of one turning step may bulge from its chord.
/// Measured: at half another plan of 3 entries; at double another plan of `bolt_nut_m8_thread`.
pub(crate) const STEP_BULGE: f64 = 1e-3;
/// Multiple of a contact step. The longest free turn: exits show at the ends of steps alone.
/// Measured: no effect at half and double.
pub(crate) const FREE_TURN_STEPS: f64 = 4.0;
/// Share of a step. Contacts are gathered as near as this. In tight fits all of a wall is near, and contacts take most
/// of the time: a quarter of a step takes a fifth longer; less misses what is then found by the step's end alone.
/// Measured: at half another plan of `cam_lock_key`; at double another plan of `cam_lock_key`, `bolt_nut_m8_thread`.
pub(crate) const CONTACT_REACH: f64 = 0.06;
/// Multiples. Where contact takes most of a step away, it is lengthened by at least and at most these.
pub(crate) const STEP_STRETCH: Range<f64> = 1.25..8.0;
/// Multiple, squared. A corrected step may be this much longer than the wanted one.
/// Measured: no effect at half and double.
pub(crate) const STEP_OVERSHOOT: f64 = 4.0;
/// Cosine, squared. A motion that follows less of its action is stuck.
/// Measured: at half no effect; at double another plan of `bayonet`, `cam_lock_key`.
pub(crate) const STUCK_SHARE: f64 = 0.05;
/// Share, squared. A contact presses if it holds back more of the wanted motion.
/// Measured: no effect at half and double.
pub(crate) const PRESSED_SHARE: f64 = 1e-4;
/// Length. Travel per turn below which a turning part goes nowhere.
/// Measured: no effect at half and double.
pub(crate) const LEAST_TURNING_TRAVEL: f64 = 0.01;
/// Length. A shift shorter than this counts as none.
/// Measured: no effect at half and double.
pub(crate) const STALL: f64 = TOUCHED / 10.0;
/// Length. How far ahead free flight is looked through at once; of a shift, the longest of [`SHIFTS_AHEAD`].
/// Measured: no effect at half and double.
pub(crate) const FLIGHT_STRETCH: f64 = 4.0;
/// Length. Shorter flights cost more than regions, which have to be found anew where one ends.
/// Measured: at half no effect; at double another plan of `cam_lock_key`.
pub(crate) const SHORTEST_FLIGHT: f64 = FREE_STEP / 2.0;
/// Length. A flight ends this far before what it meets; regions lead on to it.
/// Measured: at half and at double another plan of `cam_lock_key`.
pub(crate) const LANDING: f64 = 4.0 * DEPTH_TOLERANCE;
/// Length. A part with half this gap is in the middle of its play. A contact holds a pull back if the part, moved this
/// far along it, is too deep there: in a slot nothing is, whatever its play.
/// Measured: at half and at double another plan of 3 entries.
pub(crate) const CLEARANCE: f64 = 0.01;
/// Length. Contacts this near hold a part in its play.
/// Measured: at half another plan of `bolt_nut_m8_thread`; at double no effect.
pub(crate) const CLEARANCE_REACH: f64 = 0.04;
/// Share. A contact that is along an axis by less does not hold a part there.
/// Measured: no effect at half and double.
pub(crate) const CLEARANCE_SPEED: f64 = 0.1;
/// Share. A contact that opposes a pull by less does not hold it back: the part slides along it.
/// Measured: no effect at half and double.
pub(crate) const OPPOSED_PULL: f64 = 0.3;
/// Share of a pull that a part follows where nothing holds it back; if it follows less, it may be released.
/// Measured: no effect at half and double.
pub(crate) const FREE_PULL: f64 = 0.9;

// Region covers.

/// Lengths. Shifts that a region is asked to allow, the longest that works; of one step, [`STEPS_AHEAD`].
pub(crate) const SHIFTS_AHEAD: [f64; 5] = [4.0, 0.5, 0.06, 0.012, 2e-3];
/// Multiple of a step that a region is asked to allow at best.
/// Measured: no effect at half and double.
pub(crate) const STEPS_AHEAD: f64 = 4.0;
/// Share. A region that allows less of the shift that it was asked for is too small.
/// Measured: no effect at half and double.
pub(crate) const LEAST_SHARE_AHEAD: f64 = 0.25;
/// Multiple. The radius asked of a region, of what it must hold.
/// Measured: at half `side_exit_mid` ends complete; another plan of 5 entries; at double no effect.
pub(crate) const REGION_ROOM: f64 = 1.25;
/// The same for regions along a path, where others are to find room, too.
/// Measured: at half another plan of 8 entries; at double another plan of 6 entries.
pub(crate) const SWEPT_ROOM: f64 = 3.0;
/// Length. A bit of a triangle that is smaller and has no region ahead is in the way.
/// Measured: no effect at half and double.
pub(crate) const SMALL_BIT_AHEAD: f64 = 0.3;
/// Length. Of a bit of a triangle that is smaller and has no region at a pose, the deepest point is looked for.
/// Measured: no effect at half and double.
pub(crate) const SMALL_BIT_ENTERED: f64 = 0.1;
/// Length. A smaller bit without a region is lost, or measured.
/// Measured: no effect at half and double.
pub(crate) const SMALLEST_BIT: f64 = 0.02;
/// Share. Pieces are drawn together by this to see whether they only touch.
/// Measured: no effect at half and double.
pub(crate) const TOUCH_INSET: f64 = 0.02;
/// Length. Boxes further apart are not looked at for congruent pairs.
/// Measured: no effect at half and double.
pub(crate) const CONGRUENT_PAIR_DISTANCE: f64 = 0.2;
/// Radians. A leg of a path that turns further has no hull and is split.
/// Measured: at half another plan of `bolt_nut_m8_thread`; at double another plan of `bayonet`, `bolt_nut_m8_thread`.
pub(crate) const LEG_TURN: f64 = 0.8;
/// Multiple. A hull is clipped only if the part outside the box is longer than this times the part inside.
/// Measured: at half another plan of `gearbox_1stage`, `caxif-s1-c5-214`; at double another plan of 5 entries.
pub(crate) const CLIPPED_LENGTH: f64 = 1.0;
/// Length. What reaches no further beyond a box is not clipped: of what only just enters, a sliver would find regions
/// with planes askew to it.
/// Measured: at half another plan of 5 entries; at double another plan of 6 entries.
pub(crate) const CLIP_MARGIN: f64 = 4e-3;
/// Share. A face whose normal is less across its way has no side to it.
/// Measured: at half no effect; at double another plan of `caxif-as1-tu-203`.
pub(crate) const FACING_ACROSS: f64 = 0.5;
/// Divisor. Pieces that may be too deep are split to sizes this much smaller than others.
/// Measured: no effect at half and double.
pub(crate) const DOUBTED_SIZE: f64 = 4.0;
/// Share of a depth. A depth is computed with this error at most.
/// Measured: at half and at double another plan of `caxif-as1-tu-203`, `caxif-s1-c5-214`.
pub(crate) const DEPTH_SHARE: f64 = 0.1;

// One plane, one direction, one axis.

/// Cosine. Planes of obstacles that differ by less are one; an edge whose planes differ by more is steep (0.8 degrees).
/// Measured: no effect at half and double.
pub(crate) const STEEP_COSINE: f64 = 0.9999;
/// Cosine. Planes of contacts that differ by less are one (half a degree).
/// Measured: at half another plan of `cam_lock_key`, `bolt_nut_m8_thread`; at double another plan of 3 entries.
pub(crate) const ONE_PLANE_COSINE: f64 = 0.99996;
/// Cosine. Directions that differ by less are one (a quarter of a degree).
/// Measured: no effect at half and double.
pub(crate) const ONE_DIRECTION_COSINE: f64 = 0.999_99;
/// Cosine. Faces in contact look against each other within this (8 degrees).
/// Measured: no effect at half and double.
pub(crate) const OPPOSED_COSINE: f64 = 0.99;
/// Cosine. The face that is entered is the one that a plane keeps a piece before (26 degrees).
/// Measured: no effect at half and double.
pub(crate) const SAME_FACE: f64 = 0.9;
/// 1 − cosine. An axis that differs by less from one of the world's is that one (0.03 degrees).
/// Measured: no effect at half and double.
pub(crate) const AXIS_SNAP: f64 = 1e-7;
/// Sine. A face that looks less steeply along or against a direction is a wall beside it.
/// Measured: no effect at half and double.
pub(crate) const WALL_STEEPNESS: f64 = 1e-3;
/// Share. Singular values smaller than this against the largest are near null: facets of a round fit lean as much.
/// Measured: no effect at half and double.
pub(crate) const NEAR_NULL: f64 = 0.1;
/// Share of a unit twist. A null twist that turns less only shifts.
/// Measured: no effect at half and double.
pub(crate) const NULL_TURN: f64 = 0.25;
/// Share. Bits of touching faces are no longer than this against the box that both have in common.
/// Measured: no effect at half and double.
pub(crate) const TOUCHING_BIT: f64 = 0.125;
/// Share of the way beyond everything to which a sweep finds the way out.
/// Measured: at half another plan of 7 entries; at double another plan of 8 entries.
pub(crate) const WAY_OUT_FINENESS: f64 = 1.0 / 256.0;

// Helices and threads.

/// Length. A helix gets this much further with every turn; others do not rise.
/// Measured: no effect at half and double.
pub(crate) const LEAST_PITCH: f64 = 0.02;
/// Radians. A path that turns further may be a screw, and profiles are compared before surfaces (two thirds of a turn);
/// longer stretches are bounded in pieces.
/// Measured: at half another plan of `bayonet`, `bolt_nut_m8_thread`; at double another plan of `bolt_nut_m8_thread`.
pub(crate) const SCREW_TURN: f64 = 4.0;
/// Radians. Stretches that turn less are not compared by profile any more.
/// Measured: no effect at half and double.
pub(crate) const SHORTEST_SCREW_STRETCH: f64 = 0.25;
/// Radians. If the stretches that are left turn by less in all, no finer profiles are made for them: at half, a nut's first
/// turn off its seat takes seconds; at double, half a turn of a wire is checked at samples, which takes as long.
pub(crate) const LEAST_PROFILED_TURN: f64 = 1.0;
/// Share of the limit by which a part may stray on a piece of the way that is looked at as one.
/// Measured: at half and at double another plan of `bolt_nut_m8_thread`.
pub(crate) const STRAY_SHARE: f64 = 0.5;
/// Share of the pitch. A path this far from the helix has left it.
/// Measured: no effect at half and double.
pub(crate) const OFF_HELIX: f64 = 0.25;
/// Pitches. What is no further from the end of a thread does not count: seats and bottoms of holes are there.
/// Measured: at half and at double another plan of `bolt_nut_m8_thread`.
pub(crate) const THREAD_ENDS: f64 = 0.3;
/// Share of the length of a thread that an end is at most. At half, a chamfer of a short nut distorts its fit; at double,
/// a tenth of a turn less is left of a corkscrew of one turn, too little to fit its helix.
pub(crate) const THREAD_END_SHARE: f64 = 0.1;
/// Radians between two poses of a path that is turned off its thread, before thinning.
/// Measured: at half and at double another plan of `bolt_nut_m8_thread`.
pub(crate) const SCREW_POSE_ANGLE: f64 = 0.1;
/// Radians. A part that is off its thread after turning this much further is turned off it: chamfers end threads early.
/// Measured: no effect at half and double.
pub(crate) const UNSCREWING_ANGLE: f64 = 2.0 * TAU;
/// Pitches. A profile is exact up to this distance outside and inside the other part.
/// Measured: no effect at half and double.
pub(crate) const PROFILE_MARGIN: f64 = 0.5;
/// Share. Of the shifts with the widest gap, those within this count as equal.
/// Measured: no effect at half and double.
pub(crate) const EQUAL_GAP: f64 = 0.02;
/// Multiples of the least travel of a part within which its threads are sought, the first that shows one: flanks are as
/// far apart as their play. With half of the largest, threads with a play of 0.2 are left to simulation; with double,
/// what stands beside a thread is taken for a part of it.
pub(crate) const THREAD_REACHES: [f64; 3] = [1.0, 3.0, 8.0];
/// Share of the pitch by which points travel on one knot of a helix, about: half of a slab of a profile, so that a head
/// that is a slab away from a nut is not taken for a part of the thread. At four times as much, more stretches near a head
/// are left to samples; at half, profiles take a little longer.
pub(crate) const KNOT_TRAVEL: f64 = 1.0 / 32.0;
/// Multiple. What is this many times further off the helix than most is left out of its fit.
/// Measured: at half and at double another plan of `bolt_nut_m8_thread`.
pub(crate) const OUTLIER: f64 = 3.0;
/// Cosines. Flanks lean along the axis by at least and at most these.
pub(crate) const FLANK_LEAN: [f64; 2] = [0.15, 0.97];
/// Shares of a guess within which the rise of a thread is sought: null twists of flanks with play are wrong by half and
/// by double. With half the range, these are missed; with double it takes a little longer.
pub(crate) const RISE_RANGE: [f64; 2] = [0.4, 3.0];
/// Length. Profiles are compared no finer, at a third of the depth at which paths past thin parts are refused: at half,
/// fine threads that do not pass take four times as long to refute; at double, threads with a play of a thousandth of the
/// longest side are checked at samples, which takes seconds.
pub(crate) const PROFILE_FINENESS: f64 = 2e-4;
/// Share of the distance of two heights. How far the footprint of a facet on a profile may be off: halving a facet divides
/// its error by four. At double, threads with a play of a hundredth of the radius are compared three times as finely; at
/// half, profiles take twice as long.
pub(crate) const FOOTPRINT_ERROR: f64 = 0.25;
/// Heights of a profile. A gap across the axis between points of one surface is closed if it is narrower than this many:
/// footprints of facets are only as exact as one. At half, profiles are in crumbs and take longer to compare; at double, a wire
/// must have a play of a twentieth of the pitch, at the first fineness, not to be taken for its tunnel's walls.
pub(crate) const PROFILE_JOINT: f64 = 4.0;
/// Shares of the radius within which a rise is sought if a part turns and shifts independently, as far as its contacts
/// show: pitches from a twentieth of the radius to the radius. Coarser threads show their rise; finer ones are left to
/// simulation.
pub(crate) const RISE_BY_RADIUS: [f64; 2] = [0.05 / TAU, 1.0 / TAU];
/// Share of the radius, radians, or share of the rise over the turns: the first step of the fit of a helix, about as far as the axis that
/// facets show is off. At half, one round more; at double, one less.
pub(crate) const HELIX_FIT_STEP: f64 = 0.01;
/// The same for the last step: a hundredth of a play that is a thousandth of the radius. At half it takes a little longer;
/// at double, the play of tight threads is not used to the full.
pub(crate) const HELIX_FIT_PRECISION: f64 = 1e-5;
/// Share of the rise to which it is fitted: over a hundred turns this adds up to a ten-thousandth of the pitch.
pub(crate) const RISE_PRECISION: f64 = 1e-6;
/// Share of the rise, for a thread of one turn, between two rises that are tried: flanks on each other then differ by
/// less than a flank is high. At half it takes twice as long; at double the true rise may be stepped over.
pub(crate) const RISE_STEP: f64 = 0.05;
/// Share of the turning speed. Facets that slip faster are none of a thread.
/// Measured: no effect at half and double.
pub(crate) const FLANK_SLIP: f64 = 0.15;
/// Share of a step. Two steps are one motion if no point of the part differs by more …
/// Measured: at half and at double another plan of `bolt_nut_m8_thread`.
pub(crate) const SAME_STEP: f64 = 0.02;
/// … and belong to one helix up to this share.
/// Measured: no effect at half and double.
pub(crate) const SAME_HELIX: f64 = 0.15;
/// Radians of a helix that steps must have passed before it is extrapolated.
/// Measured: at half and at double another plan of `bolt_nut_m8_thread`.
pub(crate) const SEEN_HELIX_ANGLE: f64 = 0.4;
/// Radians. An extrapolation off a helix turns by less than half a turn, so that its two poses determine its screw.
/// Measured: at half no effect; at double another plan of `bolt_nut_m8_thread`.
pub(crate) const EXTRAPOLATION_ANGLE: f64 = 2.4;
/// Radians. Beyond whole turns, an extrapolation along a helix turns at least this far, and this much less than a turn
/// at most: near whole turns, the two poses do not determine the axis.
/// Measured: at half and at double another plan of `bolt_nut_m8_thread`.
pub(crate) const SCREW_FROM_POSES_ANGLE: f64 = 0.25 * TAU;
/// Steps. How far a part is moved against what it is pressed to, to see whether that is still there.
/// Measured: at half another plan of `cam_lock_key`; at double another plan of `bolt_nut_m8_thread`.
pub(crate) const PRESSED_PROBE: f64 = 1.0;
/// Steps. The same on a thread, where it is less than the pitch.
/// Measured: at half and at double another plan of `bolt_nut_m8_thread`.
pub(crate) const PRESSED_PROBE_ON_HELIX: f64 = 0.25;
/// Length. How deep the probe must enter a thread.
/// Measured: at half and at double another plan of `bolt_nut_m8_thread`.
pub(crate) const PRESSED_DEPTH: f64 = 2e-3;
/// Steps. Samples around the start of a motion are known this far.
/// Measured: no effect at half and double.
pub(crate) const KNOWN_SAMPLE_STEPS: f64 = 2.0;

// States and directions of the search.

/// Length. The least travel of the centre of mass that makes a new state (the paper's rmd). Half of it keeps more
/// states, and each costs simulations; double it may merge two junctions of a maze.
pub(crate) const SAME_STATE_TRAVEL: f64 = 0.05;
/// Radians. The least angle, that makes a new state of a part (the paper's rmd). Half of it keeps more states, and
/// each costs simulations; double (1 rad) still separates a quarter turn from none.
pub(crate) const SAME_STATE_ROTATION: f64 = 0.5;
/// Radians. The least angle from the assembled pose, at which a part counts as turned. A tenth of the rotation that
/// makes a new state. Chosen, not derived.
pub(crate) const TURNED: f64 = 0.05;
/// Multiple. Factor by which the surface of an axis of the world counts more. At 1, rounding decides between the axes
/// of a round part; double it may prefer the world to the frame of a turned assembly.
pub(crate) const WORLD_PREFERENCE: f64 = 1.2;
/// Cosine. cos of the angle within which two axes are the same: two degrees. A narrower angle lists one thread twice;
/// a wider one drops a thread that leans by less.
pub(crate) const ONE_AXIS_COSINE: f64 = 0.9994;
/// Length. The least distance of two curves: closer ones might pass through each other within the depth that engines
/// allow. Half of it may call parts linked that engines separate; double it misses links with little play.
pub(crate) const LINK_CLEARANCE: f64 = 2e-3;
/// Share. A ball inside a part is large enough if no other one is larger by more than this share. Half of it doubles the
/// cells that are measured; double it misses windows that are narrower than the ball by less than 2%.
pub(crate) const INSCRIBED_GAIN: f64 = 0.01;

/// Length. Places of a part this near are in one cell: more than the rounding of coordinates in files, less than any
/// play that is drawn on purpose. Half of it keeps cells twice that differ by rounding; double merges cells of fine play.
pub(crate) const SAME_CELL: f64 = 10.0 * ROUNDED;

/// Radians. Critical angles this near are one: coordinates in files are rounded by [`ROUNDED`], seen from a tenth of the
/// longest side. At half, angles of rounded edges are tried twice; at double, the window of a play of as much is missed.
pub(crate) const CRITICAL_ANGLE: f64 = 1e-4;
/// Length. Centres of round edges this near to each other across an axis are one: a part lies in its play. At half, parts
/// that lie at the side of a wide hole are turned about their centres of mass; at double, holes beside each other are
/// taken for one.
pub(crate) const SAME_CENTRE: f64 = 0.05;
/// Radians between two poses of a turn in place: a centre a unit from the axis cuts a corner of 3e-4. At half, twice as many
/// poses are looked at; at double, turns about edges are refused in tight fits.
pub(crate) const TURN_POSE_ANGLE: f64 = 0.05;

/// Divisor. Divides a part's largest extent: the least travel of a part smaller than `SHARE_OF_EXTENT *
/// SAME_STATE_TRAVEL`, one length, is that share of its size. Chosen, not derived.
pub(crate) const SHARE_OF_EXTENT: f64 = 20.0;

// Verification.

/// Length. How far any point of a part may lie from the dense path after thinning.
/// Measured: at half another plan of `bayonet`, `bolt_nut_m8_thread`; at double another plan of `cam_lock_key`,
/// `bolt_nut_m8_thread`.
pub(crate) const PATH_TOLERANCE: f64 = 2e-5;
/// Radians. Two waypoints turn by less, so that the interpolation between them is unambiguous.
/// Measured: at half and at double another plan of 3 entries.
pub(crate) const WAYPOINT_TURN: f64 = 2.0;
/// Share of the longest side of the smaller part of a pair. Largest travel of a vertex between two poses that samples are
/// checked at: half of the independent check's. By the assembly's side, a nut beside a rail of 4 m left through its bolt
/// between two poses. At 0.004 plans of threads take up to 1.8 times as long; at double, it is no finer than what checks it.
pub(crate) const PATH_DENSITY: f64 = 0.01;
/// Share of the longest side of the smaller part of a pair. A path is refused at this depth, whatever stands beside the
/// pair. The independent check refuses at 0.001 of that side; what is left is for what lies between its samples.
pub(crate) const PAIR_LIMIT: f64 = 8e-4;
/// Share of the thickness of the thinner part of a pair. A path is refused at this depth: nothing passes through a wall
/// unseen that is refused at half of it, and the independent check refuses at a quarter.
pub(crate) const THIN_LIMIT: f64 = 0.2;
/// Share of the limit. Points deeper than this help in refining a motion that is refused.
/// Measured: no effect at half and double.
pub(crate) const HELPFUL: f64 = 1.0 / 2.0;
/// Share of the limit. Depth that is not looked into.
/// Measured: at half and at double another plan of 7 entries.
pub(crate) const IGNORED_SHARE: f64 = 1.0 / 8.0;
/// The same with an allowed penetration: facets that lie across each other are deep here and there.
/// Measured: at half and at double another plan of `caxif-as1-tu-203`, `caxif-s1-c5-214`.
pub(crate) const IGNORED_SHARE_IN_OVERLAP: f64 = 1.0 / 4.0;
/// Share of the limit. The smallest radius of a piece of surface.
/// Measured: no effect at half and double.
pub(crate) const FINEST_SHARE: f64 = 1.0 / 4.0;
/// Share of the longest side of the larger part of a pair. Penetrations are reported no closer to each other.
/// Measured: at half another plan of `bayonet`, `caxif-s1-c5-214`; at double another plan of `bayonet`,
/// `caxif-as1-tu-203`. At 0.01 of the smaller part, points of a shallow spot fill the report before the deepest is found.
pub(crate) const COARSE_SHARE: f64 = 4e-3;
/// Share of the limit. Depth that is not looked into when the overlap of assembled parts is measured. No more is allowed
/// than is measured at some point, and no less than nine tenths of what there is ([`DEPTH_SHARE`]).
/// Measured: no effect at half and double.
pub(crate) const OVERLAP_IGNORED: f64 = 0.01;
/// Share of the limit. The smallest radius of a piece there.
/// Measured: at half another plan of `caxif-s1-c5-214`; at double another plan of `caxif-as1-tu-203`,
/// `caxif-s1-c5-214`.
pub(crate) const OVERLAP_FINEST: f64 = 0.5;
/// Share of the limit. The error of a large overlap is at most this, and not [`DEPTH_SHARE`] of the overlap: a part that
/// keeps its overlap along its path must pass.
/// Measured: at half another plan of `caxif-s1-c5-214`, `press_fit_overlap_0.05`; at double another plan of
/// `caxif-s1-c5-214`.
pub(crate) const OVERLAP_MARGIN: f64 = 1.0 / 8.0;

// Parts that are given twice.

/// Share of a part's largest extent. How far the surface of a copy may be off: a circle of 16 sides leaves out as much.
/// At half, copies with fewer than 23 sides are missed; at double, bodies that are 2 % of their size apart count as one.
pub(crate) const REPEATED_SIZE: f64 = 0.01;
/// Share of a part's volume over its area, which is half of the thickness of a sheet. The same for thin parts: it is a
/// twentieth of their walls, and what is just below one side of a wall ([`BELOW_SURFACE`]) is a tenth through it. Half
/// misses more copies of tubes with few sides; at ten times as much, it is through the wall.
pub(crate) const REPEATED_WALL: f64 = 0.1;
/// Multiple of that tolerance. Below its surface by this, a body is told from what it only touches, by four times the
/// tolerance. It must be more than 1, or both are within the tolerance.
pub(crate) const BELOW_SURFACE: f64 = 2.0;
/// Share of the depth that a point deep in a body has at least in a part that holds the body. Bodies that overlap in the
/// whole have surface of others inside, so it is less than 1. It only has to tell solid from hollow.
pub(crate) const DEEP_SHARE: f64 = 0.5;
/// Share of its surface that a body has in common with a part that holds it beside other bodies. Less takes in what is
/// sunk into a part without a hole for it; more misses bodies that are joined to others in the whole.
pub(crate) const BODY_SURFACE: f64 = 0.9;
/// Share of its surface that a whole has from its bodies. Less takes in a part with others sunk flush into it; more
/// misses a whole with a small body more.
pub(crate) const WHOLE_SURFACE: f64 = 0.9;
/// Share of its radius by which a ball may be entered by the surface that it touches: rounding.
pub(crate) const BALL_TOUCHES: f64 = 1e-6;

// The penalty engine (the paper's simulation), beside its own parameters.

/// Length. Contact points are gathered this far ahead: about ten steps at full speed.
pub(crate) const PENALTY_REACH: f64 = 0.1;
/// Length. No point travels further between two waypoints or two poses that are checked: half a contact step.
pub(crate) const PENALTY_TRAVEL: f64 = CONTACT_STEP / 2.0;
/// Share of the depth tolerance that samples may use up; the rest is for what lies between them.
pub(crate) const SAMPLED_DEPTH_SHARE: f64 = 0.9;
/// Length. The least that a request may give as the longest edge between contact points, a tenth of the paper's: the
/// faces of a cube as large as the assembly then have half a million points. At half, four times the memory.
pub(crate) const SHORTEST_CONTACT_EDGE: f64 = 0.05;
/// Share of its way. A step that is shorter is barred.
pub(crate) const BARRED_SHARE: f64 = 0.01;
/// Share to which a Newton step that does not lead down is shortened.
pub(crate) const BACKTRACK_SHARE: f64 = 0.25;
/// Share of the linear forecast by which the energy must fall (Armijo).
pub(crate) const ARMIJO: f64 = 1e-4;
/// Share of the random poses of RRT and BK-RRT that are out (a goal bias of 5 to 10 % is usual: S. LaValle, "Planning
/// Algorithms", 2006, 5.5.1). At half ways out are found later; at double narrow ways are.
pub(crate) const GOAL_BIAS: f64 = 0.1;
/// Share of the radius of a disc inside a part that is checked to be inside: near the rim the check takes long. At half
/// the difference from 1, it takes twice as long; at double, necks are missed whose ends are wider by less than 4%.
pub(crate) const DISC_SHARE: f64 = 0.98;
/// Share of a part's smallest extent below which a move from cell to cell is short, as one within its play is: in a grid,
/// moves are as long as the part. At half, corridors with as much play are searched as a whole before what follows
/// them; at double, moves in a grid count as short, too.
pub(crate) const SHORT_MOVE: f64 = 0.9;

// Statics.

/// Share of the longest side of the smaller part of a pair. Surfaces no further apart count as touching: parts in CAD are
/// drawn with gaps, and settle. Chosen: a washer of 16 mm may be drawn 0.16 mm off. At half, parts with a usual play fall
/// that do not; at double, a part counts as held by what it passes at a visible distance.
pub(crate) const CONTACT_GAP: f64 = 0.01;
/// Length. Parts that overlap by more as assembled are one body: press fits, and threads drawn as cylinders. Twice what a
/// motion may enter, so that no contact counts as a fit. At half, rounded coordinates join parts; at double, fits with an
/// overlap of 0.0001 of the assembly come loose.
pub(crate) const JOINED_OVERLAP: f64 = 2.0 * DEPTH_TOLERANCE;
/// Sine of the angle from which on two edges cross in a point (3 degrees). Flatter ones lie along each other, and their
/// corners are contacts. At half, points far from where both are nearest count; at double, rods that cross at 4 degrees
/// have no contact but at their ends.
pub(crate) const CROSSED_EDGES: f64 = 0.05;
/// Share. A direction leads out of an edge between its faces even if it is this little outside of both: facets of round
/// parts lean by some degrees, and one may be no edge's. At half and double, cylinders with fewer or more sides.
pub(crate) const CONTACT_CONE: f64 = 0.05;
/// Share of a body's weight by which forces may miss it and still hold it, and of its speed by which a motion may enter a
/// contact: far above the solver's precision (1e-8), far below what friction and densities are known to. At half and
/// double no effect is known.
pub(crate) const HELD_SHARE: f64 = 1e-3;
/// Share of the strongest force by which a force may leave its friction cone. As above.
pub(crate) const BALANCED: f64 = 1e-6;
/// Share of the heaviest body's weight below which none counts as lighter, so that the program is well conditioned: such
/// a body moves the centre of mass of both by as little.
pub(crate) const LEAST_WEIGHT: f64 = 1e-4;
/// Share of the fastest fall. What moves down more slowly gives way to what falls, and does not fall itself. At half and
/// double, more or fewer parts are named.
pub(crate) const FALL_SHARE: f64 = 0.1;
/// Share of the given friction, and share of the weight, to which the least friction and the margin are found.
pub(crate) const FRICTION_PRECISION: f64 = 1.0 / 512.0;
/// Multiple of the least friction at which slips are seen to settle. Closer to it they take hundreds of repetitions; at
/// double the distance, a friction that clamping alone makes suffice may pass for the least.
pub(crate) const FRICTION_ROOM: f64 = 1.02;

// Fasteners.

/// Multiple of the distance of the flats that a nut, a screw's head and its shank are wide at most, about their line: flange
/// nuts have 1.4 of it (ISO 4161), heads 2.8 of their socket (ISO 7380), up to 3.3 countersunk (ISO 10642). At half, these are
/// none; at double, a plate with a hexagonal boss is a nut.
pub(crate) const WIDEST_FASTENER: [f64; 2] = [2.2, 4.0];
/// Share of a part's surface that a flat of a hexagon has at least: of a screw M8 that is 200 long, one flat of the socket
/// has 0.002. At half, longer screws are known; at double, screws of 15 diameters and more are none. Time goes with the
/// square of the number of such flats.
pub(crate) const FLAT_SHARE: f64 = 0.001;
/// Cosine of the difference of two directions from a right angle, or of one from 60 degrees: 0.1 degrees, far above what
/// coordinates with five digits are rounded by. At half and double no effect is known.
pub(crate) const FLAT_SPREAD: f64 = 0.002;
/// Share of the size by which the six flats of a hexagon differ at most, in area and distance from the middle: chamfers
/// with few facets cut flats unevenly. At half, hexagons with chamfers of 16 facets are none; at double, no effect is known.
pub(crate) const HEXAGON_SPREAD: f64 = 0.05;
/// Share of its radius by which corners of a cylinder differ at most in their distance from the line. At half, the holes
/// and rods of scans are none; at double, the steps of a turned part that is 2 % thicker count as one cylinder.
pub(crate) const ROUND_SPREAD: f64 = 0.01;
/// Cosine of the angle between a facet of a cylinder and its corners' radii: at least 8 facets around. At half the angle,
/// 16, and coarse holes are none; at double, a square bar is round.
pub(crate) const ROUND_COSINE: f64 = 0.92;
/// Share of a whole cylinder that facets must have: keyways and cross holes cut into it. At half, fillets count as holes;
/// at double, a hole with any cut is none.
pub(crate) const ROUND_SHARE: f64 = 0.5;
/// The diameter of the thread over the distance of the flats, of nuts and of screws with a hexagon head: 0.5 (M1.6) to 0.68
/// (M64) by ISO 4032 and ISO 4014, and 0.8 of that where the core is drawn, with room beyond. Wider, a hexagonal spacer
/// with a wide hole is a nut.
pub(crate) const THREAD_OF_HEXAGON: [f64; 2] = [0.4, 0.8];
/// The same of screws with a hexagon socket: 1.07 (M1.6) to 1.33 (M8) by ISO 4762, up to 2.3 of set screws by ISO 4026.
/// Wider, a bush with a hexagonal hole is a screw.
pub(crate) const THREAD_OF_SOCKET: [f64; 2] = [1.05, 2.5];
/// The radius of a rod over that of the nut's hole. Either is drawn at the thread's outer diameter or at its core, 0.76
/// (M1.6) to 0.85 (M12) of it, and a hole with play besides. Wider, nuts are screwed on rods that pass through them.
pub(crate) const ROD_OF_NUT: [f64; 2] = [0.75, 1.3];
/// The radius of a hole over that of a screw's shank. Tapped holes are drawn between the core's diameter, as above, and the
/// thread's own, some with a little play. Holes that screws pass through have 1.05 of it (M8 to M20 by ISO 273, fine); this
/// is half of that. At half the play, holes are not tapped that are drawn with play; at double, screws are fast in holes
/// that they only pass through, as from M36 on (1.028).
pub(crate) const TAPPED_HOLE: [f64; 2] = [0.75, 1.025];
/// Share of the thread's radius along which it is at least engaged: one pitch of a coarse thread is 0.3 of the radius. At
/// half, a screw counts as fast that a quarter of a turn frees; at double, the thinnest nuts hold nothing.
pub(crate) const LEAST_ENGAGEMENT: f64 = 0.3;

// Clearance.

/// Share of the least distance on a way by which its certified bound is below it. At half, ways with turns take up to twice
/// as long; at double, still a fifth of what people look at.
pub(crate) const APPROACH_PRECISION: f64 = 0.01;
/// Share of the longest side of the smaller part of a pair. Parts that are assembled no further apart count as touching: ten
/// times the rounding of binary STL files, whose coordinates are 10 times as large as the part. At half, touching parts of
/// such files have a clearance; at double, so have fewer fits.
pub(crate) const ASSEMBLED_CONTACT: f64 = 1e-5;
/// Share of their distance as they stand that parts keep on their way where more is wanted than they have. The facets of a shaft
/// and of its hole pass each other on the way, and are nearer then than they were: by a few hundredths of the play in most
/// files, by up to a third in a coarse hole. At half, a shaft may come near its hole; at double, no coarse shaft leaves.
pub(crate) const FIT_SHARE: f64 = 0.5;
/// Share of a shift of waypoints that arrives at a place between them. Where less arrives, as near the start, which stays, the
/// path gets a waypoint. At half, a path is bent ten times as far as it needs to be; at double, it gets waypoints where a
/// bend three times as far would do.
pub(crate) const BAND_LEVER: f64 = 0.2;
/// Share of the width across flats. A tool that comes nearer than this to a part does not pass it: the play of a ring on its
/// hexagon is 0.01 to 0.02 (ISO 691). At half, tools pass that scrape; at double, a ring on a low nut touches what the
/// nut stands on.
pub(crate) const TOOL_GAP: f64 = 0.01;

// Floors.

/// Share of the longest side of an assembly by which its floor reaches beyond it on each side. A part that leaves sideways is out
/// beyond the floor. At half, long parts are let down beside the floor; at double, sideways paths are a quarter of the
/// assembly longer.
pub(crate) const FLOOR_MARGIN: f64 = 0.25;
/// Share of the side of a floor. At half, thin parts pass it a little deeper (tolerances follow the thickness of parts); at
/// double, pictures show more of it.
pub(crate) const FLOOR_THICKNESS: f64 = 0.02;

// Tessellation of STEP files.

/// mm. How far the triangles of a STEP file may be from its surfaces, if the user does not say: the smallest play that is
/// drawn on purpose in most assemblies, the radial play of a running fit (ISO 286 H8/e8 at 10 mm: 0.0125 to 0.0345). A
/// hole's chords lie inside the hole, by this at most, so fits with less play would overlap. At double, such fits
/// overlap; at half, curved faces have 1.4 times as many triangles in one direction, twice as many in two.
pub(crate) const STEP_DEFLECTION: f64 = 0.01;
/// Radians. The angle between neighbouring chords of a curve in a STEP file, for small radii where the deflection alone
/// would leave a circle three sides: at least 13. At half, at least 26, and threads and fillets have twice as many
/// triangles; at double, at least 7, and small bores are 13 % narrower in area.
pub(crate) const STEP_ANGLE: f64 = 0.5;
