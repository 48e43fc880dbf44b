"""Types of the compiled part. Lengths and poses are in the input's units and frame."""

import os
from collections.abc import Iterable, Iterator, Mapping, Sequence
from types import TracebackType
from typing import Any, Literal, TypedDict, Unpack

import numpy
from numpy.typing import NDArray

VERSION: str

Pose = Sequence[float] | NDArray[numpy.floating[Any]]
"""[x, y, z], or [x, y, z, qw, qx, qy, qz]: the rigid motion x' = q x + t."""

Report = Literal["stability", "clearance", "tools"]

class Options(TypedDict, total=False):
    """Options of a plan, named as those of `sbdp plan`. Times are in seconds, lengths in the input's units."""

    planner: Literal["sbdp-star", "sbdp", "pdp-t", "pdp-r", "pdp-star", "rrt", "bk-rrt"]
    engine: Literal["sliding", "penalty"]
    actions: Literal["paper", "extended"]
    dbg: Literal["sliding", "paper"]
    penalty: Mapping[str, float]
    sweeps: bool | None
    timeout: float | None
    """Time after which the daemon answers with the plan so far."""
    planning_timeout: float | None
    path_timeout: float | None
    seed: int
    end_gap: float | None
    """Distance between the hulls of a part and of the rest where its path ends."""
    clearance: float
    """Distance that parts keep from what they pass on their way, unless they are nearer as they stand."""
    max_simulations: int | None
    threads: int
    fixed: str | Iterable[str]
    """Parts that may not move, besides those that the assembly declares."""
    removed: str | Iterable[str]
    """Parts that are already removed."""
    targets: str | Iterable[str] | None
    """Parts that must come out; None for all."""
    base: str | Iterable[str]
    """Parts that stay as long as others leave."""
    keep: str | Iterable[str]
    """Parts that stay unless others that are asked for cannot leave otherwise."""
    keep_out: str | Iterable[str]
    """Parts that are in the way and do not come apart, as a fixture or a table: they may not move, and are no base."""
    moved: Mapping[str, Pose]
    """Parts that stand elsewhere: the rigid motion of their mesh from where the assembly has it."""
    assembly: bool
    """Plan how it is put together."""
    staging: Literal["auto", "none"] | Mapping[str, Pose]
    """Where parts of an assembly plan wait: where the files say, otherwise beside the assembly ("auto"); nowhere; or at
    these poses."""
    up: Literal["+x", "-x", "+y", "-y", "+z", "-z"] | Sequence[float] | None
    """The direction up: upward paths come before sideways ones, and these before downward ones."""
    report: Report | Iterable[Report]
    """What to report about each step besides its path: `stability`, `clearance` and `tools` of `steps` in `Plan.to_dict()`.
    Gravity acts against `up`; without it, against +z (+y of glTF scenes)."""
    steady: bool
    """Put the steps into an order in which few parts have to be held at once. They then come when the order is known."""
    hands: int | None
    """As `steady`; the plan ends before the first step for which more hands are needed, the one that moves included."""
    friction: float
    """With the report "stability", `steady` and `hands`: the coefficient of friction of all contacts, 0.2 by default."""
    groups: Literal["needed", "prefer"]
    """"prefer": groups that the files name leave as wholes, as long as anything else leaves."""
    no_cache: bool
    batch: bool

class Assembly:
    """An assembly, its meshes and the names of its parts. Made by `sbdp.load` and `sbdp.assembly`."""

    def __init__(
        self,
        parts: Sequence[tuple[str, NDArray[numpy.float64] | NDArray[numpy.float32], NDArray[numpy.uint32]]],
        units: str | None = None,
        name: str = "",
        fixed: Sequence[str] = (),
    ) -> None: ...
    @property
    def name(self) -> str: ...
    @property
    def units(self) -> str | None:
        """The unit of length, if known."""
    @property
    def parts(self) -> tuple[str, ...]:
        """The names of the parts, in natural order ("2" before "10")."""
    @property
    def fixed(self) -> tuple[str, ...]:
        """Parts that the assembly's own description declares fixed."""
    @property
    def groups(self) -> list[tuple[str, list[str]]]:
        """Groups that the files name: name and parts."""
    @property
    def notes(self) -> list[str]:
        """Warnings: what was left out, decided or doubtful when the files were read."""
    @property
    def handle(self) -> bytes:
        """The hash of the content, 32 bytes, by which the daemon knows the assembly."""
    def mesh(self, part: str) -> tuple[NDArray[numpy.float64], NDArray[numpy.uint32]]:
        """Copies of a part's vertices, of shape (n, 3), and triangles, (m, 3)."""
    def __len__(self) -> int: ...

def load(
    path: str | os.PathLike[str],
    *,
    split: Literal["objects", "bodies", "none"] | None = None,
    ignore: Sequence[str] = (),
    deflection: float | None = None,
    converter: str | os.PathLike[str] | None = None,
) -> Assembly:
    """Reads an assembly as the command line does: a folder of meshes, or a file (OBJ, STL, PLY, OFF, glTF, 3MF; STEP by a converter).

    `split` says what counts as a part in a file that holds several. `ignore` has patterns of names to leave out.
    `deflection` is how far triangles of STEP files may be from the surfaces, in mm. `converter` is the program that makes
    them.
    Raises `GeometryError`, which names file and reason.
    """

class Step:
    """Parts that move as one rigid body. A step that is read in place (`views=True`) ends when the next one is requested:
    then its properties raise BufferError."""

    @property
    def number(self) -> int:
        """Its index in the plan, from 0."""
    @property
    def parts(self) -> tuple[str, ...]: ...
    @property
    def of(self) -> int | None:
        """The step that removes (in an assembly plan: inserts) the group to which the parts belong, if any."""
    @property
    def ends(self) -> Literal["out", "aside", "in"]: ...
    @property
    def motion(self) -> Literal["translation", "rotation"]: ...
    @property
    def path(self) -> NDArray[numpy.float64]:
        """Waypoints, of shape (n, 7): rigid motions [x, y, z, qw, qx, qy, qz] of the parts as they stand when the step
        begins (in an assembly plan: when it ends). With `views=True` a read-only view; it owns its memory,
        and requesting the next step while the view exists raises BufferError."""
    @property
    def verified_depth(self) -> float:
        """No point gets deeper than this along the path, beyond the assembled depth."""
    @property
    def requires(self) -> tuple[int, ...]:
        """Numbers of the steps that must be done before."""
    @property
    def wave(self) -> int:
        """The earliest round, from 0, in which it can be done."""
    @property
    def direction(self) -> tuple[float, float, float] | None:
        """The unit vector of the path's last leg."""

class Plan:
    """A finished plan."""

    @property
    def status(
        self,
    ) -> Literal["complete", "partial", "infeasible", "timeout", "cancelled", "exhausted"]: ...
    @property
    def reason(self) -> str | None:
        """Why it is not complete."""
    @property
    def parts(self) -> tuple[str, ...]: ...
    @property
    def remaining(self) -> tuple[str, ...]:
        """Parts that are in the assembly at the end."""
    @property
    def steps(self) -> tuple[Step, ...]: ...
    def steps_of(self, part: str) -> list[Step]:
        """The steps that move a part."""
    def to_json(self) -> str:
        """The plan in the contract `sbdp-plan/2`: the bytes of `sbdp plan --json`, the line's end included."""
    def to_dict(self) -> dict[str, Any]:
        """The same, parsed."""
    def __len__(self) -> int:
        """How many steps."""

class Progress(TypedDict):
    """The progress of planning."""

    stage: Literal["sdf", "search", "transfer"]
    done: int
    total: int
    simulations: int
    part: int | None
    """Index of the part that the search tries to move; of several side by side, the first."""
    turns: bool
    """Whether that part is turned, and not only pushed."""

class PlanStream(Iterator[Step]):
    """Steps as they are found. Closing it, or leaving its `with` block, cancels the request. After a daemon was restarted,
    steps come again from the first (`restarts` counts that)."""

    def __next__(self) -> Step: ...
    def poll(self, timeout: float = 0.0) -> Step | None:
        """The next step if it arrives within `timeout` seconds; None if there is nothing yet, or nothing more (`done`)."""
    def result(self, timeout: float | None = None) -> Plan:
        """Waits for the end, and returns the whole plan, with the steps that were read before. Raises TimeoutError if the
        end has not come within `timeout` seconds; the stream then continues. Raises BufferError with `views=True`, which
        keeps no steps."""
    def cancel(self) -> None:
        """Asks the daemon to stop soon. The plan so far still arrives, with status `cancelled`."""
    def close(self) -> None:
        """Ends the request."""
    @property
    def done(self) -> bool: ...
    @property
    def status(self) -> str | None:
        """How planning ended; None before."""
    @property
    def summary(self) -> dict[str, Any] | None:
        """The plan's document without its steps, once it has ended."""
    @property
    def progress(self) -> Progress | None:
        """The latest progress that the daemon reported."""
    @property
    def restarts(self) -> int: ...
    def __enter__(self) -> PlanStream: ...
    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None: ...

class Session:
    """An assembly that is being taken apart: what has happened to it, and plans for the rest."""

    def executed(self, parts: str | Iterable[str]) -> None:
        """Records that these parts are out."""
    def performed(self, step: Step) -> None:
        """Records that a step of the last plan was done: its parts are out, or stand where the step left them."""
    def stuck(self, part: str) -> None:
        """Records that this part does not move: until it is freed, plans leave it in place."""
    def freed(self, part: str) -> None:
        """Records that this part moves again."""
    def moved(self, part: str, pose: Pose) -> None:
        """Records that this part stands elsewhere: the rigid motion of its mesh from where the assembly has it."""
    def replan(self, timeout: float | None = None, *, views: bool = False) -> PlanStream:
        """Plans how the rest comes apart from how it stands now, within `timeout` seconds. A timeout also holds for later
        plans."""

class Client:
    """A connection to the daemon. Threads may share it; it receives one plan at a time. A forked child must connect for
    itself."""

    def __init__(
        self,
        runtime_dir: str | os.PathLike[str] | None = None,
        *,
        timeout: float = 10.0,
        upload_timeout: float = 300.0,
        reconnect: float = 10.0,
        busy_wait: float = 0.0,
    ) -> None: ...
    def plan(self, assembly: Assembly, /, *, views: bool = False, **options: Unpack[Options]) -> PlanStream:
        """Requests a plan. The meshes are uploaded if the daemon does not know them."""
    def session(self, assembly: Assembly, /, **options: Unpack[Options]) -> Session:
        """Begins a session about how an assembly comes apart."""
    def upload(self, assembly: Assembly) -> bytes:
        """Uploads an assembly ahead of the first plan. Returns its handle."""
    def revise(
        self,
        base: Assembly,
        parts: Sequence[tuple[str, NDArray[numpy.float64] | NDArray[numpy.float32], NDArray[numpy.uint32]]],
    ) -> Assembly:
        """Returns an assembly with these meshes for parts of `base`. Meshes with other names become further parts, after all
        others. Only these meshes are sent, and the daemon keeps what it knows about the other parts. The daemon must know
        `base`; once it has dropped the new assembly, plans of it raise `UnknownHandleError`."""
    def knows(self, assembly: Assembly) -> bool: ...
    def metrics(self) -> dict[str, Any]:
        """All metrics of the daemon."""
    @property
    def pid(self) -> int:
        """The daemon's process id."""
    @property
    def restarts(self) -> int:
        """How often the client has followed a daemon that was restarted."""
    def close(self) -> None: ...
    def __enter__(self) -> Client: ...
    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None: ...
