"""From a document to a plan and back: what the panel does, without a window."""

from collections.abc import Callable, Sequence
from typing import Any

import FreeCAD
import sbdp
from sbdp.motion import blockers

from .display import Display, is_open
from .document import DEFLECTION, Tessellation, find_parts

# FreeCAD's own unit of length.
UNITS = "mm"


class Disassembly:
    """Plans of one document, one after the other: only what changed in the document is sent for the next. `connect` makes a
    client of the daemon; by default it is that of this user, started if none runs."""

    def __init__(self, document: "FreeCAD.Document", connect: "Callable[[], sbdp.Client] | None" = None) -> None:
        self.document = document
        self._live = sbdp.LiveAssembly(UNITS, name=document.Label, connect=connect)
        self._tessellation = Tessellation()
        #: The plan that is being made; None if none is.
        self.job: sbdp.PlanJob | None = None
        #: The last plan, and how its parts move; None before.
        self.plan: sbdp.Plan | None = None
        self.motion: sbdp.Motion | None = None
        self.display: Display | None = None
        #: What was sent for the last plan.
        self.change: sbdp.Change | None = None
        #: Objects that are no parts, with the reason, and what the planner says about the parts.
        self.notes: list[str] = []

    def begin(
        self, selection: "Sequence[tuple[str, ...]] | None" = None, deflection: float = DEFLECTION, **options: Any
    ) -> None:
        """Begins to plan the selected parts as they stand, or all. Parts that are shown elsewhere are brought home first.
        Raises ValueError where there is nothing to plan."""
        if self.job is not None:
            raise RuntimeError("a plan is being made: wait for it, or cancel it")
        self._need_document()
        self.close_display()
        parts = find_parts(self.document, None if selection is None else list(selection))
        self.notes = list(parts.left_out)
        if not parts.parts:
            where = "the document" if selection is None else "the selection"
            raise ValueError("\n".join([f"{where} has no visible part with a volume", *self.notes]))
        self._tessellation.deflection = deflection
        live = self._tessellation.live_parts(parts)
        self.display = Display(self.document, parts)
        self.job = self._live.plan(live, **options)

    @property
    def was_sent(self) -> bool:
        """Whether the daemon has the parts, so that a plan is a matter of what changed."""
        return self._live.was_sent

    def forget(self) -> None:
        """Sends all parts with the next plan."""
        self._live.forget()

    def finish(self) -> "sbdp.Plan":
        """Takes the plan of the job, waiting for it. Raises what went wrong."""
        job, self.job = self.job, None
        try:
            plan = job.result()
        except Exception:
            self.close_display()
            raise
        self.plan, self.change = plan, job.change
        self.motion = sbdp.Motion(plan.steps, {name: part.world() for name, part in job.parts.items()})
        for warning in plan.to_dict()["warnings"]:
            self.notes.append(f"{warning['part']}: {warning['message']}" if warning["part"] else warning["message"])
        return plan

    def show(self, moment: float) -> None:
        """Shows a moment of the plan, from 0 to the number of its steps. Raises ValueError where a part cannot be moved, or
        the document was closed."""
        self._need_document()
        self.display.show(self.motion.at(moment))

    def explode(self) -> None:
        """Shows the parts along their ways out. Raises as `show`."""
        self._need_document()
        transforms = {}
        for name, shift in self.motion.exploded().items():
            transforms[name] = sbdp.motion.matrix([*shift, 1, 0, 0, 0])
        self.display.show(transforms)

    def blocking(self) -> dict[str, str]:
        """By part, `captive` or `blocks`: see `sbdp.motion.blockers`. Empty if the plan is complete."""
        return blockers(self.plan.to_dict()) if self.plan is not None else {}

    def reset(self) -> None:
        """Brings all parts to where they belong."""
        if self.display is not None:
            self.display.reset()

    def close_display(self) -> None:
        """The same, and forgets the plan: it is of the document as it was."""
        if self.display is not None:
            self.display.close()
        self.plan, self.motion, self.display = None, None, None

    def _need_document(self) -> None:
        if not is_open(self.document):
            raise ValueError("the document was closed: close this panel, too")

    def close(self) -> None:
        """Ends all of it: a running plan is cancelled."""
        if self.job is not None:
            self.job.cancel()
            self.job.join()
            self.job = None
        self.close_display()
        self._live.forget()
