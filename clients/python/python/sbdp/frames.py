"""Plans as tables of pandas, where it is installed."""

from typing import TYPE_CHECKING

from ._native import Plan

if TYPE_CHECKING:
    import pandas


def steps_frame(plan: Plan) -> "pandas.DataFrame":
    """The steps of a plan, a row each, indexed by number: parts, of, ends, motion, waypoints (their count), verified_depth,
    requires, wave, and dx, dy, dz (the direction; NaN where there is none). Needs the package pandas."""
    import pandas

    nowhere = (float("nan"),) * 3
    rows = [
        {
            "parts": step.parts,
            "of": step.of,
            "ends": step.ends,
            "motion": step.motion,
            "waypoints": len(step.path),
            "verified_depth": step.verified_depth,
            "requires": step.requires,
            "wave": step.wave,
            **dict(zip(("dx", "dy", "dz"), step.direction or nowhere)),
        }
        for step in plan.steps
    ]
    columns = "parts of ends motion waypoints verified_depth requires wave dx dy dz".split()
    frame = pandas.DataFrame(rows, columns=columns)
    frame["of"] = frame["of"].astype("Int64")
    frame.index.name = "step"
    return frame


def path_frame(plan: Plan) -> "pandas.DataFrame":
    """All waypoints of a plan, a row each, indexed by step and waypoint: x, y, z, qw, qx, qy, qz. Needs the package
    pandas."""
    import numpy
    import pandas

    keys = [(step.number, i) for step in plan.steps for i in range(len(step.path))]
    rows = numpy.concatenate([step.path for step in plan.steps]) if plan.steps else numpy.empty((0, 7))
    index = pandas.MultiIndex.from_tuples(keys, names=["step", "waypoint"])
    return pandas.DataFrame(rows, index=index, columns=["x", "y", "z", "qw", "qx", "qy", "qz"])
