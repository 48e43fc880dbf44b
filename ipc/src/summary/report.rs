//! What a plan means where it is carried out: sections of the summary, if the request asks for them.

use bytemuck::{Pod, Zeroable};

use super::{NO_PART, SUMMARY_HAS_CLEARANCE, SUMMARY_HAS_STABILITY, SUMMARY_HAS_TOOLS, SummaryHeader};
use crate::bytes::{Malformed, Reader, Writer};
use crate::plan::{check_range, slice_of};

/// The moving parts of a step pass others, so that there is a place where they do so the nearest.
pub const CLEARANCE_HAS_CLOSEST: u32 = 1;
/// The closest parts do not meet, so that their points are given.
pub const CLEARANCE_HAS_POINTS: u32 = 2;
/// The tool has room enough to turn the fastener.
pub const TOOL_FITS: u32 = 1;
/// All that falls could be held by forces, but only if something pressed it together that does not.
pub const UNSTABLE_NEEDS_CLAMPING: u32 = 1;

/// Names of the tools; the wire carries the index.
pub const TOOLS: [&str; 4] = ["socket", "ring_spanner", "open_end_wrench", "hex_key"];

/// How the parts of a state stand.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
pub struct StabilityRecord {
    /// The least coefficient of friction with which all that does not fall stands.
    pub needs_friction: f64,
    /// Index of the first [`UnstableRecord`].
    pub first_unstable: u32,
    /// How many.
    pub unstable: u32,
    /// Index of the first of the parts of which it is not known whether they stand.
    pub first_unknown: u32,
    /// How many.
    pub unknown: u32,
}

/// Connected parts of which some fall.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Eq, Pod, Zeroable)]
pub struct UnstableRecord {
    /// Index of the first [`FallRecord`].
    pub first_fall: u32,
    /// How many.
    pub falls: u32,
    /// Index of the first [`HoldRecord`].
    pub first_hold: u32,
    /// How many.
    pub holds: u32,
    /// [`UNSTABLE_NEEDS_CLAMPING`].
    pub flags: u32,
    /// Reserved, 0.
    pub reserved: u32,
}

/// A part that falls.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
pub struct FallRecord {
    /// The part.
    pub part: u32,
    /// Reserved, 0.
    pub reserved: u32,
    /// The unit vector, in the input's frame, along which its centre of mass begins to move if nothing rubs.
    pub direction: [f64; 3],
}

/// Parts that are enough to hold.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Eq, Pod, Zeroable)]
pub struct HoldRecord {
    /// Index of the first of the parts.
    pub first_part: u32,
    /// How many.
    pub parts: u32,
}

/// How near the moving parts of a step pass the others. Lengths and points in the input's units and frame.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
pub struct ClearanceRecord {
    /// [`CLEARANCE_HAS_CLOSEST`], [`CLEARANCE_HAS_POINTS`].
    pub flags: u32,
    /// The moving part that comes the nearest; [`NO_PART`] if there is none.
    pub moving: u32,
    /// The standing part that it comes the nearest to; [`NO_PART`] if there is none.
    pub standing: u32,
    /// The segment of the path in which it does, 0 for that from the first waypoint to the second.
    pub segment: u32,
    /// Index of the first of the standing parts that touch moving ones as the step begins, and do not count here.
    pub first_touching: u32,
    /// How many.
    pub touching: u32,
    /// The least distance on the way.
    pub distance: f64,
    /// No part that counts comes nearer than this.
    pub at_least: f64,
    /// How far the two are apart as they stand.
    pub assembled: f64,
    /// How far along the segment, from 0 to 1.
    pub share: f64,
    /// A point of the moving surface there.
    pub moving_point: [f64; 3],
    /// A point of the standing surface there.
    pub standing_point: [f64; 3],
}

/// The fastener that a step takes off.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
pub struct FastenerRecord {
    /// Index of the first [`ToolRecord`].
    pub first_tool: u32,
    /// How many; 0 if the step takes no fastener off.
    pub tools: u32,
    /// The size of the tools: the width across its flats, in the input's units; 0 if the step takes no fastener off.
    pub size: f64,
}

/// A tool that turns a fastener.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
pub struct ToolRecord {
    /// Index into [`TOOLS`].
    pub tool: u32,
    /// [`TOOL_FITS`].
    pub flags: u32,
    /// Index of the first of the parts that end its swing.
    pub first_blocker: u32,
    /// How many.
    pub blockers: u32,
    /// Degrees through which it swings; 360 for all around, 0 if there is no way to the fastener.
    pub swing: f64,
    /// Degrees that it needs to swing.
    pub needs: f64,
}

const _: () = {
    assert!(size_of::<StabilityRecord>() == 24);
    assert!(
        size_of::<UnstableRecord>() == 24 && size_of::<FallRecord>() == 32 && size_of::<HoldRecord>() == 8
    );
    assert!(size_of::<ClearanceRecord>() == 104 && std::mem::offset_of!(ClearanceRecord, moving_point) == 56);
    assert!(size_of::<FastenerRecord>() == 16 && size_of::<ToolRecord>() == 32);
};

/// How the parts of a state stand, owned.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Stability {
    /// The least coefficient of friction with which all that does not fall stands: 0 where contacts alone hold it.
    pub needs_friction: f64,
    /// What falls, by parts that are connected with each other.
    pub unstable: Vec<Unstable>,
    /// Parts of which it is not known whether they stand.
    pub unknown: Vec<u32>,
}

/// Connected parts of which some fall, owned.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Unstable {
    /// What falls, and the unit vectors, in the input's frame, along which the centres of mass begin to move if nothing rubs.
    pub falls: Vec<(u32, [f64; 3])>,
    /// Sets of parts, each of which is enough to hold: the smallest ones that were found.
    pub hold: Vec<Vec<u32>>,
    /// Forces exist that would hold all of them, but only if something pressed them together that does not.
    pub needs_clamping: bool,
}

/// How near the moving parts of a step pass the others, owned.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Clearance {
    /// The standing parts that touch moving ones as the step begins, ascending: they do not count here.
    pub touching: Vec<u32>,
    /// Where the step passes other parts the nearest; `None` if there are no others.
    pub closest: Option<Closest>,
}

/// Where a step passes other parts the nearest. Lengths and points in the input's units and frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Closest {
    /// The part that moves.
    pub moving: u32,
    /// The part that stands.
    pub standing: u32,
    /// The least distance on the way.
    pub distance: f64,
    /// No part that counts comes nearer than this.
    pub at_least: f64,
    /// How far the two are apart as they stand.
    pub assembled: f64,
    /// The segment of the path, 0 for that from its first waypoint to its second.
    pub segment: u32,
    /// How far along the segment, from 0 to 1.
    pub share: f64,
    /// A point of the moving and one of the standing surface there; `None` where they meet.
    pub points: Option<[[f64; 3]; 2]>,
}

/// The fastener that a step takes off, owned.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Fastener {
    /// The size of its tools: the width across its flats, in the input's units.
    pub size: f64,
    /// The tools, each with the room that it has while the others stand.
    pub tools: Vec<Tool>,
}

/// A tool that turns a fastener, owned.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Tool {
    /// Index into [`TOOLS`].
    pub tool: u32,
    /// Degrees through which it swings; 360 for all around, 0 if there is no way to the fastener.
    pub swing: f64,
    /// Degrees that it needs to swing.
    pub needs: f64,
    /// It has room enough to turn the fastener.
    pub fits: bool,
    /// The parts that end its swing, or are in its way, ascending.
    pub blocked_by: Vec<u32>,
}

impl Tool {
    /// Its name.
    #[must_use]
    pub fn name(&self) -> &'static str {
        TOOLS.get(self.tool as usize).copied().unwrap_or("?")
    }
}

/// What a plan means where it is carried out, owned. `None` is what was not asked for.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Report {
    /// How the parts stand before the first step, and after each step.
    pub stability: Option<Vec<Stability>>,
    /// How near each step passes other parts.
    pub clearance: Option<Vec<Clearance>>,
    /// By step, the fastener that it takes off, if it does.
    pub tools: Option<Vec<Option<Fastener>>>,
}

/// The sections of a report.
#[derive(Debug, Clone, Default)]
pub(super) struct ReportSections {
    states: Vec<StabilityRecord>,
    unstable: Vec<UnstableRecord>,
    falls: Vec<FallRecord>,
    holds: Vec<HoldRecord>,
    clearances: Vec<ClearanceRecord>,
    fasteners: Vec<FastenerRecord>,
    tools: Vec<ToolRecord>,
    parts: Vec<u32>,
}

impl ReportSections {
    /// Adds numbers of parts; where they begin, and how many there are.
    fn parts(&mut self, parts: &[u32]) -> (u32, u32) {
        let first = self.parts.len() as u32;
        self.parts.extend_from_slice(parts);
        (first, parts.len() as u32)
    }

    fn state(&mut self, state: &Stability) {
        let first_unstable = self.unstable.len() as u32;
        for Unstable { falls, hold, needs_clamping } in &state.unstable {
            let (first_fall, first_hold) = (self.falls.len() as u32, self.holds.len() as u32);
            let fall = |&(part, direction): &(u32, [f64; 3])| FallRecord { part, reserved: 0, direction };
            self.falls.extend(falls.iter().map(fall));
            for set in hold {
                let (first_part, parts) = self.parts(set);
                self.holds.push(HoldRecord { first_part, parts });
            }
            self.unstable.push(UnstableRecord {
                first_fall,
                falls: falls.len() as u32,
                first_hold,
                holds: hold.len() as u32,
                flags: if *needs_clamping { UNSTABLE_NEEDS_CLAMPING } else { 0 },
                reserved: 0,
            });
        }
        let (first_unknown, unknown) = self.parts(&state.unknown);
        self.states.push(StabilityRecord {
            needs_friction: state.needs_friction,
            first_unstable,
            unstable: state.unstable.len() as u32,
            first_unknown,
            unknown,
        });
    }

    fn clearance(&mut self, clearance: &Clearance) {
        let (first_touching, touching) = self.parts(&clearance.touching);
        let closest = clearance.closest;
        let points = closest.and_then(|c| c.points);
        let flag = |set: bool, bit: u32| if set { bit } else { 0 };
        let length = |of: fn(&Closest) -> f64| closest.as_ref().map_or(0.0, of);
        self.clearances.push(ClearanceRecord {
            flags: flag(closest.is_some(), CLEARANCE_HAS_CLOSEST)
                | flag(points.is_some(), CLEARANCE_HAS_POINTS),
            moving: closest.map_or(NO_PART, |c| c.moving),
            standing: closest.map_or(NO_PART, |c| c.standing),
            segment: closest.map_or(0, |c| c.segment),
            first_touching,
            touching,
            distance: length(|c| c.distance),
            at_least: length(|c| c.at_least),
            assembled: length(|c| c.assembled),
            share: length(|c| c.share),
            moving_point: points.unwrap_or_default()[0],
            standing_point: points.unwrap_or_default()[1],
        });
    }

    fn fastener(&mut self, fastener: Option<&Fastener>) {
        let first_tool = self.tools.len() as u32;
        for tool in fastener.map_or(&[][..], |fastener| &fastener.tools) {
            let (first_blocker, blockers) = self.parts(&tool.blocked_by);
            self.tools.push(ToolRecord {
                tool: tool.tool,
                flags: if tool.fits { TOOL_FITS } else { 0 },
                first_blocker,
                blockers,
                swing: tool.swing,
                needs: tool.needs,
            });
        }
        let tools = self.tools.len() as u32 - first_tool;
        self.fasteners.push(FastenerRecord { first_tool, tools, size: fastener.map_or(0.0, |f| f.size) });
    }
}

impl ReportSections {
    /// Those of a report.
    pub(super) fn of(report: &Report) -> Self {
        let mut sections = Self::default();
        report.stability.iter().flatten().for_each(|state| sections.state(state));
        report.clearance.iter().flatten().for_each(|step| sections.clearance(step));
        report.tools.iter().flatten().for_each(|step| sections.fastener(step.as_ref()));
        sections
    }

    /// The header with their counts.
    pub(super) fn counted(&self, header: SummaryHeader) -> SummaryHeader {
        SummaryHeader {
            states: self.states.len() as u32,
            unstable: self.unstable.len() as u32,
            falls: self.falls.len() as u32,
            holds: self.holds.len() as u32,
            clearances: self.clearances.len() as u32,
            fasteners: self.fasteners.len() as u32,
            tools: self.tools.len() as u32,
            report_parts: self.parts.len() as u32,
            ..header
        }
    }

    /// Writes them in the order of the counts.
    pub(super) fn write(&self, writer: &mut Writer) {
        writer.array(&self.states).array(&self.unstable).array(&self.falls).array(&self.holds);
        writer.array(&self.clearances).array(&self.fasteners).array(&self.tools).array(&self.parts);
    }
}

impl Report {
    /// The flags of the header.
    pub(super) fn flags(&self) -> u32 {
        let flag = |set: bool, bit: u32| if set { bit } else { 0 };
        flag(self.stability.is_some(), SUMMARY_HAS_STABILITY)
            | flag(self.clearance.is_some(), SUMMARY_HAS_CLEARANCE)
            | flag(self.tools.is_some(), SUMMARY_HAS_TOOLS)
    }
}

/// A report read in place.
#[derive(Debug, Clone, Copy)]
pub struct ReportView<'a> {
    flags: u32,
    states: &'a [StabilityRecord],
    unstable: &'a [UnstableRecord],
    falls: &'a [FallRecord],
    holds: &'a [HoldRecord],
    clearances: &'a [ClearanceRecord],
    fasteners: &'a [FastenerRecord],
    tools: &'a [ToolRecord],
    parts: &'a [u32],
}

impl<'a> ReportView<'a> {
    /// Reads the sections of a summary, and checks all bounds.
    pub(super) fn read(reader: &mut Reader<'a>, header: &SummaryHeader) -> Result<Self, Malformed> {
        let view = Self {
            flags: header.flags,
            states: reader.array("states", u64::from(header.states))?,
            unstable: reader.array("unstable", u64::from(header.unstable))?,
            falls: reader.array("falls", u64::from(header.falls))?,
            holds: reader.array("holds", u64::from(header.holds))?,
            clearances: reader.array("clearances", u64::from(header.clearances))?,
            fasteners: reader.array("fasteners", u64::from(header.fasteners))?,
            tools: reader.array("tools", u64::from(header.tools))?,
            parts: reader.array("parts of the report", u64::from(header.report_parts))?,
        };
        view.check(header)?;
        Ok(view)
    }

    fn check(&self, header: &SummaryHeader) -> Result<(), Malformed> {
        let steps = u64::from(header.steps);
        for (field, flag, count, wanted) in [
            ("states", SUMMARY_HAS_STABILITY, header.states, steps + 1),
            ("clearances", SUMMARY_HAS_CLEARANCE, header.clearances, steps),
            ("fasteners", SUMMARY_HAS_TOOLS, header.fasteners, steps),
        ] {
            if u64::from(count) != if header.flags & flag == 0 { 0 } else { wanted } {
                return Err(Malformed::OutOfRange { field, value: u64::from(count) });
            }
        }
        let parts = self.parts.len();
        for state in self.states {
            check_range("unstable", state.first_unstable, state.unstable, self.unstable.len())?;
            check_range("unknown", state.first_unknown, state.unknown, parts)?;
        }
        for unstable in self.unstable {
            check_range("falls", unstable.first_fall, unstable.falls, self.falls.len())?;
            check_range("holds", unstable.first_hold, unstable.holds, self.holds.len())?;
        }
        for hold in self.holds {
            check_range("parts to hold", hold.first_part, hold.parts, parts)?;
        }
        for clearance in self.clearances {
            check_range("touching", clearance.first_touching, clearance.touching, parts)?;
        }
        for fastener in self.fasteners {
            check_range("tools", fastener.first_tool, fastener.tools, self.tools.len())?;
        }
        for tool in self.tools {
            check_range("blockers of a tool", tool.first_blocker, tool.blockers, parts)?;
            if tool.tool as usize >= TOOLS.len() {
                return Err(Malformed::OutOfRange { field: "tool", value: u64::from(tool.tool) });
            }
        }
        let has_closest = |c: &&ClearanceRecord| c.flags & CLEARANCE_HAS_CLOSEST != 0;
        let passing = self.clearances.iter().filter(has_closest).flat_map(|c| [c.moving, c.standing]);
        let named = self.parts.iter().copied().chain(self.falls.iter().map(|f| f.part)).chain(passing);
        match named.into_iter().find(|part| *part >= header.parts) {
            Some(part) => Err(Malformed::OutOfRange { field: "part of the report", value: u64::from(part) }),
            None => Ok(()),
        }
    }

    /// All of it, owned; `None` if nothing was to be reported.
    #[must_use]
    pub fn to_report(&self) -> Option<Report> {
        let has = |flag: u32| self.flags & flag != 0;
        let parts = |first, count| slice_of(self.parts, first, count).to_vec();
        let unstable = |u: &UnstableRecord| Unstable {
            falls: slice_of(self.falls, u.first_fall, u.falls)
                .iter()
                .map(|f| (f.part, f.direction))
                .collect(),
            hold: slice_of(self.holds, u.first_hold, u.holds)
                .iter()
                .map(|h| parts(h.first_part, h.parts))
                .collect(),
            needs_clamping: u.flags & UNSTABLE_NEEDS_CLAMPING != 0,
        };
        let state = |s: &StabilityRecord| Stability {
            needs_friction: s.needs_friction,
            unstable: slice_of(self.unstable, s.first_unstable, s.unstable).iter().map(unstable).collect(),
            unknown: parts(s.first_unknown, s.unknown),
        };
        let clearance = |c: &ClearanceRecord| Clearance {
            touching: parts(c.first_touching, c.touching),
            closest: (c.flags & CLEARANCE_HAS_CLOSEST != 0).then_some(Closest {
                moving: c.moving,
                standing: c.standing,
                distance: c.distance,
                at_least: c.at_least,
                assembled: c.assembled,
                segment: c.segment,
                share: c.share,
                points: (c.flags & CLEARANCE_HAS_POINTS != 0).then_some([c.moving_point, c.standing_point]),
            }),
        };
        let tool = |t: &ToolRecord| Tool {
            tool: t.tool,
            swing: t.swing,
            needs: t.needs,
            fits: t.flags & TOOL_FITS != 0,
            blocked_by: parts(t.first_blocker, t.blockers),
        };
        let fastener = |f: &FastenerRecord| {
            let tools = slice_of(self.tools, f.first_tool, f.tools);
            (!tools.is_empty()).then(|| Fastener { size: f.size, tools: tools.iter().map(tool).collect() })
        };
        has(SUMMARY_HAS_STABILITY | SUMMARY_HAS_CLEARANCE | SUMMARY_HAS_TOOLS).then(|| Report {
            stability: has(SUMMARY_HAS_STABILITY).then(|| self.states.iter().map(state).collect()),
            clearance: has(SUMMARY_HAS_CLEARANCE).then(|| self.clearances.iter().map(clearance).collect()),
            tools: has(SUMMARY_HAS_TOOLS).then(|| self.fasteners.iter().map(fastener).collect()),
        })
    }
}
