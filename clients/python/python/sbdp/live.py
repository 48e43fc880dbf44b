"""Planning a document that is open in a CAD program: only what changed is sent again, and planning runs in a thread
of its own. The FreeCAD workbench and the Blender add-on are built on this.

    live = sbdp.LiveAssembly(units="mm")
    job = live.plan({"bolt": sbdp.LivePart(vertices, triangles, placement), …})
    job.join()                                     # or check `job.is_alive()`, `job.steps` and `job.progress`
    print(job.change, job.plan.status)             # or `job.error`
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy
from numpy.typing import NDArray

from . import errors
from .meshes import _part, assembly
from .motion import is_rigid, pose

if TYPE_CHECKING:
    from ._native import Assembly, Client, Plan, PlanStream, Progress, Step

# Seconds between two looks at whether a plan was cancelled. At half nothing gets faster that a person would notice; at
# double a cancelled plan seems to hang.
_LOOK = 0.05
# Scales that differ from 1 by less are rounding: Blender has matrices in single precision (1e-7).
_RIGID = 1e-6


class LivePart(NamedTuple):
    """A part: its mesh in its own frame, and its placement."""

    #: Shape (n, 3), in the part's own frame.
    vertices: NDArray
    #: Shape (m, 3).
    triangles: NDArray
    #: 4 × 4, from the part's own frame to that of the document. It may scale and mirror.
    placement: NDArray

    def world(self) -> NDArray:
        """The vertices in the frame of the document."""
        placement = numpy.asarray(self.placement, dtype=float)
        return numpy.ascontiguousarray(numpy.asarray(self.vertices, dtype=float) @ placement[:3, :3].T + placement[:3, 3])

    def mesh(self) -> tuple[NDArray, NDArray]:
        """Vertices in the frame of the document, and triangles that face outwards where those given do."""
        triangles = numpy.asarray(self.triangles)
        if numpy.linalg.det(numpy.asarray(self.placement, dtype=float)[:3, :3]) < 0:
            triangles = triangles[:, ::-1]
        return self.world(), numpy.ascontiguousarray(triangles, dtype=numpy.uint32)


@dataclass(frozen=True)
class Change:
    """What was sent for a plan, beside the request. Lists of part names."""

    #: All meshes were sent, for the first time or because the daemon had dropped them.
    whole: bool = False
    #: How many parts there are.
    count: int = 0
    #: Only their position was sent, because they were moved.
    moved: tuple[str, ...] = ()
    #: New meshes of known parts.
    replaced: tuple[str, ...] = ()
    #: Meshes of new parts.
    added: tuple[str, ...] = ()
    #: Parts that were removed.
    removed: tuple[str, ...] = ()

    def __str__(self) -> str:
        if self.whole:
            return f"sent: all {self.count} parts"
        kinds = {"position": self.moved, "new shape": self.replaced, "added": self.added, "removed": self.removed}
        said = [f"{kind} of {_listed(parts)}" for kind, parts in kinds.items() if parts and kind not in ("added", "removed")]
        said += [f"{_listed(parts)} {kind}" for kind, parts in kinds.items() if parts and kind in ("added", "removed")]
        return f"sent: {'; '.join(said)}" if said else "nothing had changed, nothing was sent"


def _listed(parts: tuple[str, ...]) -> str:
    return ", ".join(parts) if len(parts) <= 3 else f"{len(parts)} parts"


class LiveAssembly:
    """An assembly that is edited between plans. It makes one plan at a time, and is for one thread at a time.

    `units` is the unit of length, if known. `connect` makes a client, and a new one if the daemon went away; default: the
    daemon of this user, started if none runs.
    """

    def __init__(self, units: str | None = None, *, name: str = "", connect: Callable[[], Client] | None = None) -> None:
        self.units, self.name = units, name
        self._connect = connect or _connect
        self._client: Client | None = None
        self._assembly: Assembly | None = None
        # The parts as their meshes were sent.
        self._sent: dict[str, LivePart] = {}

    def plan(self, parts: Mapping[str, LivePart], **options: Any) -> PlanJob:
        """Begins to plan how these parts come apart, in a thread of its own. Options are those of `Client.plan`, without
        `moved` and `removed`, which follow from the parts."""
        job = PlanJob(self, parts, options)
        job.start()
        return job

    def ask(self, parts: Mapping[str, LivePart], **options: Any) -> tuple[Change, PlanStream]:
        """Sends what changed, and requests a plan. Raises as `sbdp.assembly`, `sbdp.connect` and `Client.plan`."""
        if not parts:
            raise ValueError("there is no part to plan: choose objects with a volume")
        if self._client is None:
            self._client = self._connect()
        change, moved = self._send(parts)
        poses = {part: pose(motion) for part, motion in moved.items()}
        gone = [part for part in self._sent if part not in parts]
        return change, self._client.plan(self._assembly, moved=poses, removed=gone, **options)

    def _send(self, parts: Mapping[str, LivePart]) -> tuple[Change, dict[str, NDArray]]:
        if self._assembly is None:
            self._assembly = assembly({name: part.mesh() for name, part in parts.items()}, units=self.units, name=self.name)
            self._sent = dict(parts)
            return Change(whole=True, count=len(parts)), {}
        moved, meshes = {}, {}
        for name, part in parts.items():
            motion = _motion(self._sent.get(name), part)
            if motion is None:
                meshes[name] = part
            elif not numpy.array_equal(motion, numpy.eye(4)):
                moved[name] = motion
        replaced = tuple(name for name in meshes if name in self._sent)
        added = tuple(name for name in meshes if name not in self._sent)
        if meshes:
            # What stands elsewhere beside a new shape is in the new mesh.
            sent = [_part(name, part.mesh()) for name, part in meshes.items()]
            self._assembly = self._client.revise(self._assembly, sent)
            self._sent.update(meshes)
        removed = tuple(part for part in self._sent if part not in parts)
        return Change(False, len(parts), tuple(moved), replaced, added, removed), moved

    @property
    def was_sent(self) -> bool:
        """Whether meshes were sent that the next plan can use."""
        return self._assembly is not None

    def forget(self) -> None:
        """Sends all meshes with the next plan, through a new connection."""
        if self._client is not None:
            self._client.close()
        self._client, self._assembly, self._sent = None, None, {}


def _connect() -> Client:
    from . import connect

    # A daemon that went away is replaced by one that is started.
    return connect(start=True, reconnect=0.0)


def _motion(before: LivePart | None, now: LivePart) -> NDArray | None:
    """The rigid motion of a part since its mesh was sent; None if it must be sent again."""
    if before is None:
        return None
    same = numpy.array_equal(before.vertices, now.vertices) and numpy.array_equal(before.triangles, now.triangles)
    if not same:
        return None
    if numpy.array_equal(before.placement, now.placement):
        return numpy.eye(4)
    motion = numpy.asarray(now.placement, dtype=float) @ numpy.linalg.inv(before.placement)
    return motion if is_rigid(motion, _RIGID) else None


class PlanJob(threading.Thread):
    """A plan that is being made. Its properties may be read from any thread at any time."""

    def __init__(self, live: LiveAssembly, parts: Mapping[str, LivePart], options: Mapping[str, Any]) -> None:
        super().__init__(name="sbdp plan", daemon=True)
        self._live, self._options = live, dict(options)
        self._cancelled = threading.Event()
        #: The parts.
        self.parts = dict(parts)
        #: What was sent; None before.
        self.change: Change | None = None
        #: The steps found so far.
        self.steps: list[Step] = []
        #: The latest progress that the daemon reported.
        self.progress: Progress | None = None
        #: The whole plan; None before the end, and where there is an error.
        self.plan: Plan | None = None
        #: Why there is no plan.
        self.error: Exception | None = None

    def cancel(self) -> None:
        """Asks the daemon to stop soon. The plan then has status `cancelled`, or `error` is a `CancelledError`."""
        self._cancelled.set()

    def result(self) -> Plan:
        """Waits for the end. Raises the error of the plan, if any."""
        self.join()
        if self.error is not None:
            raise self.error
        assert self.plan is not None
        return self.plan

    def run(self) -> None:
        try:
            try:
                self._plan()
            except (errors.UnknownHandleError, errors.NoDaemonError):
                # It forgot the assembly, or was stopped: once more with all meshes.
                self._live.forget()
                self._plan()
        except Exception as error:  # noqa: BLE001 - it is for the thread that looks at `error`
            # What was not taken must not count as sent.
            self._live.forget()
            self.error = error

    def _plan(self) -> None:
        if self._cancelled.is_set():
            raise errors.CancelledError("the plan was cancelled before it began")
        self.steps = []
        self.change, stream = self._live.ask(self.parts, **self._options)
        with stream:
            asked = False
            while not stream.done:
                if self._cancelled.is_set() and not asked:
                    asked = True
                    stream.cancel()
                restarts = stream.restarts
                step = stream.poll(_LOOK)
                if stream.restarts != restarts:
                    self.steps = []
                if step is not None:
                    self.steps = [*self.steps, step]
                self.progress = stream.progress
            self.plan = stream.result()
