"""Where parts stand while a plan is carried out.

A moment of a plan of n steps is a number from 0 to n: at 2.5, steps 0 and 1 are done, and step 2 is half-way along its path.
A transform is a 4 × 4 matrix, in the input's units and frame: it takes a point of a part from where it is when the plan
begins to where it is at the moment.

Steps act within bodies: the assembly, or a group that an earlier step took out. A part stands at
`frame of its body · pose in the body`, and a step moves parts in the frame of their body.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy
from numpy.typing import ArrayLike, NDArray

from ._native import Step

Matrix = NDArray[numpy.float64]

#: Two quaternions whose angle has a smaller sine are interpolated along a line: the slerp would divide by that sine. At half
#: no effect; at double none either, as both ways differ by 1e-17 there.
_NO_TURN = 1e-8


def matrix(pose: ArrayLike) -> Matrix:
    """The transform of a pose [x, y, z, qw, qx, qy, qz]."""
    pose = numpy.asarray(pose, dtype=float)
    w, x, y, z = pose[3:] / numpy.linalg.norm(pose[3:])
    made = numpy.eye(4)
    made[:3, :3] = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    made[:3, 3] = pose[:3]
    return made


def pose(transform: ArrayLike) -> NDArray[numpy.float64]:
    """The pose [x, y, z, qw, qx, qy, qz] of a rigid transform; qw is not negative."""
    transform = numpy.asarray(transform, dtype=float)
    turn = transform[:3, :3]
    # The eigenvector of the largest eigenvalue (Bar-Itzhack 2000): exact for a rotation, and the nearest one for a matrix
    # that is a rotation but for rounding.
    xx, xy, xz, yx, yy, yz, zx, zy, zz = turn.ravel()
    symmetric = [
        [xx + yy + zz, zy - yz, xz - zx, yx - xy],
        [zy - yz, xx - yy - zz, xy + yx, xz + zx],
        [xz - zx, xy + yx, yy - xx - zz, yz + zy],
        [yx - xy, xz + zx, yz + zy, zz - xx - yy],
    ]
    quaternion = numpy.linalg.eigh(numpy.array(symmetric))[1][:, -1]
    if quaternion[0] < 0:
        quaternion = -quaternion
    return numpy.concatenate([transform[:3, 3], quaternion])


def is_rigid(transform: ArrayLike, tolerance: float = 1e-9) -> bool:
    """Whether a transform only rotates and shifts, without scale, shear or mirror."""
    turn = numpy.asarray(transform, dtype=float)[:3, :3]
    return bool(numpy.abs(turn @ turn.T - numpy.eye(3)).max() <= tolerance and numpy.linalg.det(turn) > 0)


def _slerp(a: NDArray, b: NDArray, share: float) -> NDArray:
    cosine = float(numpy.dot(a, b))
    if cosine < 0:
        b, cosine = -b, -cosine
    angle = numpy.arccos(min(cosine, 1.0))
    if numpy.sin(angle) < _NO_TURN:
        between = (1 - share) * a + share * b
        return between / numpy.linalg.norm(between)
    return (numpy.sin((1 - share) * angle) * a + numpy.sin(share * angle) * b) / numpy.sin(angle)


@dataclass
class Leg:
    """One step as a motion. Poses and points are in the frame of the body that the parts leave."""

    parts: tuple[str, ...]
    #: The frame of that body.
    body: Matrix
    #: By part, where it stands in that body when the step begins.
    standing: dict[str, Matrix]
    #: The middle of the common box of the parts as they stand then.
    centre: NDArray
    #: Half the diagonal of that box: how far corners are from the middle.
    lever: float
    #: The waypoints, with quaternions of length 1.
    path: NDArray
    #: Of each waypoint, where it has the middle.
    middles: NDArray = field(init=False)
    #: Of each waypoint, which share of the step is over when the parts get there: from 0 to 1, by how far the middle goes
    #: and a corner turns about it.
    shares: NDArray = field(init=False)

    def __post_init__(self) -> None:
        self.middles = numpy.array([(matrix(waypoint) @ [*self.centre, 1.0])[:3] for waypoint in self.path])
        ways = numpy.linalg.norm(numpy.diff(self.middles, axis=0), axis=1)
        alike = numpy.abs((self.path[1:, 3:] * self.path[:-1, 3:]).sum(axis=1)).clip(0, 1)
        efforts = ways + 2 * numpy.arccos(alike) * self.lever
        total = efforts.sum()
        if len(self.path) == 1:
            self.shares = numpy.ones(1)
        elif total == 0:
            self.shares = numpy.linspace(0, 1, len(self.path))
        else:
            self.shares = numpy.concatenate([[0.0], numpy.cumsum(efforts) / total]).clip(0, 1)

    def turns(self, waypoint: int) -> bool:
        """Whether the parts turn on the way from the waypoint before to this one."""
        return waypoint > 0 and bool(abs(numpy.dot(self.path[waypoint - 1, 3:], self.path[waypoint, 3:])) < 1 - 1e-15)

    def motion(self, share: float) -> Matrix:
        """The transform within the body when a share of the step, from 0 to 1, is over."""
        after = int(numpy.searchsorted(self.shares, share))
        if after >= len(self.path) or share >= 1:
            return matrix(self.path[-1])
        if after == 0:
            return matrix(self.path[0])
        before = after - 1
        along = (share - self.shares[before]) / (self.shares[after] - self.shares[before])
        turn = _slerp(self.path[before, 3:], self.path[after, 3:], along)
        made = matrix([0, 0, 0, *turn])
        middle = (1 - along) * self.middles[before] + along * self.middles[after]
        made[:3, 3] = middle - made[:3, :3] @ self.centre
        return made

    def transforms(self, share: float) -> dict[str, Matrix]:
        """Of the parts that move, the transforms when a share of the step is over."""
        moved = self.body @ self.motion(share)
        return {part: moved @ self.standing[part] for part in self.parts}


class Motion:
    """The motion of a disassembly plan.

    `steps` are those of a plan, in order. `vertices` are points of each part, of shape (n, 3), where it is when the plan
    begins: all of them, or at least those of its convex hull. Raises ValueError for an assembly plan, and for steps that
    contradict each other.
    """

    def __init__(self, steps: Iterable[Step], vertices: Mapping[str, ArrayLike]) -> None:
        self.parts: tuple[str, ...] = tuple(vertices)
        self.steps: list[Step] = []
        self.legs: list[Leg] = []
        self._vertices = {part: numpy.asarray(points, dtype=float) for part, points in vertices.items()}
        # Where each part stands: the step that took its body out (None: the assembly), and the pose there.
        self._standing: dict[str, tuple[int | None, Matrix]] = {part: (None, numpy.eye(4)) for part in vertices}
        for step in steps:
            self.add(step)

    def __len__(self) -> int:
        return len(self.legs)

    def add(self, step: Step) -> None:
        """Takes the next step of the plan."""
        number = len(self.legs)
        if step.ends not in ("out", "aside"):
            raise ValueError(f"step {number} ends `{step.ends}`: this is for disassembly plans; play these backwards")
        standing = {}
        for part in step.parts:
            if part not in self._standing:
                raise ValueError(f"step {number} moves `{part}`, whose vertices are not given")
            body, pose_there = self._standing[part]
            if body != step.of:
                raise ValueError(f"step {number} moves `{part}` out of step {step.of}, but it is in {body}")
            standing[part] = pose_there
        points = numpy.concatenate([self._vertices[p] @ s[:3, :3].T + s[:3, 3] for p, s in standing.items()])
        low, high = points.min(axis=0), points.max(axis=0)
        path = numpy.array(step.path, dtype=float)
        path[:, 3:] /= numpy.linalg.norm(path[:, 3:], axis=1, keepdims=True)
        body_frame = numpy.eye(4) if step.of is None else self._frame(step.of)
        lever = float(numpy.linalg.norm(high - low)) / 2
        leg = Leg(tuple(step.parts), body_frame, standing, (low + high) / 2, lever, path)
        self.steps.append(step)
        self.legs.append(leg)
        last = matrix(path[-1])
        for part in step.parts:
            if step.ends == "aside":
                self._standing[part] = (step.of, last @ standing[part])
            else:
                self._standing[part] = (number, standing[part])

    def _frame(self, step: int) -> Matrix:
        """The frame of the body that a step took out."""
        leg = self.legs[step]
        return leg.body @ matrix(leg.path[-1])

    def at(self, moment: float) -> dict[str, Matrix]:
        """The transforms of all parts at a moment, from 0 to the number of steps."""
        moment = min(max(float(moment), 0.0), float(len(self)))
        whole = int(moment)
        now = {part: numpy.eye(4) for part in self.parts}
        for leg in self.legs[:whole]:
            now.update(leg.transforms(1.0))
        if whole < len(self) and moment > whole:
            now.update(self.legs[whole].transforms(moment - whole))
        return now

    def exploded(self) -> dict[str, NDArray]:
        """How far each part is shifted in an exploded view, from where it is when the plan begins: along its own way out,
        just far enough to separate the boxes. Parts that do not leave stay."""
        from .explosion import Leaving, exploded

        boxes = {part: (points.min(axis=0), points.max(axis=0)) for part, points in self._vertices.items()}
        leaving = [
            Leaving(number, step.of, leg.parts, leg.middles)
            for number, (step, leg) in enumerate(zip(self.steps, self.legs))
            if step.ends == "out"
        ]
        return exploded(boxes, leaving)


def blockers(plan_document: Mapping) -> dict[str, str]:
    """What keeps a plan from being complete, from `plan.to_dict()`. By part: `captive` if it should have come out and did
    not, or `blocks` if it blocks such a part and is not captive itself."""
    captive = {entry["part"] for entry in plan_document["blocked"]}
    stopping: Sequence[str] = [part for entry in plan_document["blocked"] for part in entry["by"]]
    return {**dict.fromkeys(stopping, "blocks"), **dict.fromkeys(captive, "captive")}
