//! The constants of the contract in tables, with the comments of their definitions.

use std::collections::BTreeSet;

use sbdp_ipc::summary::report;
use sbdp_ipc::{bytes, endpoint, geometry, headers, layout, plan, progress, revision, summary};

use crate::source::Source;

/// A table of constants: the name of its marker, and names and values.
type Group = (&'static str, Vec<(&'static str, String)>);

macro_rules! values {
    ($($($path:ident)::+),* $(,)?) => {
        vec![$((last(stringify!($($path)::+)), format!("{}", $($path)::+))),*]
    };
}

macro_rules! lists {
    ($($module:ident::$name:ident),* $(,)?) => {
        vec![$((stringify!($name), $module::$name.to_vec())),*]
    };
}

fn last(path: &'static str) -> &'static str {
    path.rsplit("::").next().map_or(path, str::trim)
}

fn groups() -> Vec<Group> {
    vec![
        ("versions", values![sbdp_ipc::PROTOCOL, sbdp_ipc::ICEORYX2_VERSION]),
        ("names of the runtime folder", values![endpoint::RUNTIME_DIR_VARIABLE, endpoint::DAEMON_FILE]),
        (
            "names of services",
            values![
                layout::PLAN_SERVICE,
                layout::GEOMETRY_SERVICE,
                layout::PROGRESS_SERVICE,
                layout::WAKE_SERVER_SERVICE,
                layout::WAKE_CLIENT_SERVICE,
            ],
        ),
        (
            "limits",
            values![
                layout::MAX_CLIENTS,
                layout::MAX_GEOMETRY_CLIENTS,
                layout::MAX_NODES,
                layout::MAX_EVENT_PORTS,
                layout::PLAN_ACTIVE_REQUESTS,
                layout::RESPONSE_BUFFER,
                layout::BORROWED_RESPONSES,
                layout::STREAM_WINDOW,
                layout::CREDIT_STEP,
                layout::PLAN_CHUNK,
                layout::PLAN_REQUEST,
                layout::GEOMETRY_RESPONSE,
                layout::PROGRESS_BUFFER,
                layout::LONGEST_PLACE,
                layout::TAG,
                bytes::ALIGNMENT,
                geometry::MAX_PARTS,
            ],
        ),
        ("flags of control requests", values![headers::CONTROL_CANCEL]),
        (
            "flags of plan requests",
            values![
                plan::PLAN_NO_CACHE,
                plan::PLAN_HAS_TARGETS,
                plan::PLAN_SWEEPS,
                plan::PLAN_NO_SWEEPS,
                plan::PLAN_BATCH,
                plan::PLAN_ASSEMBLY,
                plan::PLAN_NO_STAGING,
                plan::PLAN_TRACE,
                plan::PLAN_HAS_END_GAP,
                plan::PLAN_HAS_UP,
                plan::PLAN_REPORT_STABILITY,
                plan::PLAN_REPORT_CLEARANCE,
                plan::PLAN_REPORT_TOOLS,
                plan::PLAN_STEADY,
            ],
        ),
        (
            "numbers of uploads",
            values![
                geometry::UPLOAD_HAS_UNITS,
                geometry::VERTICES_F64,
                geometry::VERTICES_F32,
                revision::ADDED,
            ],
        ),
        ("numbers of steps", values![plan::NO_STEP]),
        (
            "flags of summaries",
            values![
                summary::SUMMARY_HAS_REASON,
                summary::SUMMARY_HAS_UNITS,
                summary::SUMMARY_HAS_TARGETS,
                summary::SUMMARY_ASSEMBLY,
                summary::SUMMARY_HAS_BASE_REASON,
                summary::SUMMARY_HAS_STABILITY,
                summary::SUMMARY_HAS_CLEARANCE,
                summary::SUMMARY_HAS_TOOLS,
                summary::NO_PART,
            ],
        ),
        (
            "flags of reports",
            values![
                report::UNSTABLE_NEEDS_CLAMPING,
                report::CLEARANCE_HAS_CLOSEST,
                report::CLEARANCE_HAS_POINTS,
                report::TOOL_FITS,
            ],
        ),
        ("stages", values![progress::STAGE_SDF, progress::STAGE_SEARCH, progress::STAGE_TRANSFER]),
        ("what is tried", values![progress::TRIED_TURNS]),
    ]
}

fn lists() -> Vec<(&'static str, Vec<&'static str>)> {
    lists![
        plan::PLANNERS,
        plan::ENGINES,
        plan::ACTION_SETS,
        plan::STATIC_ANALYSES,
        plan::PENALTY_PARAMETERS,
        summary::STATUSES,
        report::TOOLS,
    ]
}

/// The names and texts of all tables of numbers.
///
/// # Panics
/// A constant of the contract is in no table.
pub(crate) fn tables(source: &Source) -> Vec<(String, String)> {
    let mut tables = Vec::new();
    // What is not on the wire: how long the Rust client polls, the JSON of plans (src/document/JSON.md), and the friction where
    // the caller gives none.
    let mut told = BTreeSet::from(["USUAL", "SCHEMA", "FRICTION"]);
    for (name, values) in groups() {
        let mut text = "| constant | value | meaning |\n|---|---:|---|\n".to_owned();
        for (name, value) in values {
            told.insert(name);
            let value = if value.parse::<u64>().is_ok() { value } else { format!("`{value}`") };
            text += &format!("| `{name}` | {value} | {} |\n", source.constants[name]);
        }
        tables.push((name.to_owned(), text));
    }
    for (name, names) in lists() {
        told.insert(name);
        let mut text = format!("`{name}`: {}\n\n| number | name |\n|---:|---|\n", source.constants[name]);
        for (number, name) in names.iter().enumerate() {
            text += &format!("| {number} | `{name}` |\n");
        }
        tables.push((format!("names {name}"), text));
    }
    for (name, found) in &source.enums {
        let mut text = format!("| number | `{name}` | meaning |\n|---:|---|---|\n");
        for variant in &found.variants {
            text += &format!("| {} | `{}` | {} |\n", variant.number, variant.name, variant.comment);
        }
        tables.push((format!("enum {name}"), text));
    }
    for name in source.constants.keys() {
        assert!(
            told.contains(name.as_str()),
            "`{name}` is new: add it to a table in ipc/tests/document/numbers.rs"
        );
    }
    tables
}
