"""Where parts stand in an exploded view: along their own ways out, just far enough to separate their boxes. The rule is that
of the page of `sbdp view` (`src/view/explode.rs`)."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy
from numpy.typing import NDArray

# Space between boxes, as a share of the part's longest side. At half, parts seem to touch; at double, long rows get out of
# sight.
_GAP = 0.15
# Ways shorter than this share of the part's longest side are none: they are rounding, and have no direction.
_NO_WAY = 1e-6

Box = tuple[NDArray, NDArray]


class Leaving(NamedTuple):
    """Parts that leave a body together."""

    number: int
    #: The step that took the body out which they leave; None for the assembly.
    of: int | None
    parts: Sequence[str]
    #: Where the middle of their common box goes.
    middles: NDArray


def exploded(boxes: Mapping[str, Box], leaving: Sequence[Leaving]) -> dict[str, NDArray]:
    """The shift of each part, from the boxes (lowest and highest corner) as they are at first and who leaves whom, first to
    last. Those that leave last are shifted least; parts of a group go along the way of the group and along their own out
    of it."""
    shifts = {part: numpy.zeros(3) for part in boxes}
    # Of each body, the parts that have their places: at first those that never leave it.
    placed: dict[int | None, list[str]] = {None: list(boxes)}
    placed.update({step.number: list(step.parts) for step in leaving})
    for step in leaving:
        placed[step.of] = [part for part in placed[step.of] if part not in step.parts]
    # Backwards, so that a group is arranged before it is shifted.
    for step in reversed(leaving):
        around = [(boxes[part], shifts[part]) for part in placed[step.of]]
        box = _union([boxes[part] for part in step.parts])
        shown = _union([_shifted(boxes[part], shifts[part]) for part in step.parts])
        # Parts that were moved aside go from there.
        middles = numpy.vstack([(box[0] + box[1]) / 2, step.middles])
        way = _way_out(box, [other for other, _ in around], middles)
        shift = way * _distance(shown, around, way)
        for part in step.parts:
            shifts[part] = shifts[part] + shift
        placed[step.of].extend(step.parts)
    return shifts


def _union(boxes: Sequence[Box]) -> Box:
    return numpy.min([low for low, _ in boxes], axis=0), numpy.max([high for _, high in boxes], axis=0)


def _shifted(box: Box, shift: NDArray) -> Box:
    return box[0] + shift, box[1] + shift


def _way_out(box: Box, around: Sequence[Box], middles: NDArray) -> NDArray:
    """The unit direction to the first place along the way where the box is clear of all others, else to the last. Zero if
    it does not move."""
    size = (box[1] - box[0]).max()

    def is_clear(middle: NDArray) -> bool:
        shift = middle - middles[0]
        low, high = _shifted(box, shift)
        meets = any((low <= other[1]).all() and (other[0] <= high).all() for other in around)
        return bool(numpy.linalg.norm(shift) > size / 2 and not meets)

    end = next((middle for middle in middles if is_clear(middle)), middles[-1])
    way = end - middles[0]
    length = numpy.linalg.norm(way)
    return way / length if length > size * _NO_WAY else numpy.zeros(3)


def _distance(box: Box, around: Sequence[tuple[Box, NDArray]], way: NDArray) -> float:
    """How far a box goes along a unit direction until it is clear of the others where these are shown, and of no part that
    was behind it comes to stand before it."""
    if not way.any():
        return 0.0
    at = max([0.0, *(float(shift @ way) for other, shift in around if _meeting(other, box, way))])
    gap = (box[1] - box[0]).max() * _GAP
    grown = (box[0] - gap, box[1] + gap)
    met = [_meeting(grown, _shifted(other, shift), way) for other, shift in around]
    for start, end in sorted(pair for pair in met if pair):
        if start > at:
            break
        at = max(at, end)
    return at


def _meeting(moving: Box, other: Box, way: NDArray) -> tuple[float, float] | None:
    """From where to where a box that is shifted along a direction meets another, if it ever does."""
    start, end = -numpy.inf, numpy.inf
    for axis in range(3):
        near, far = other[0][axis] - moving[1][axis], other[1][axis] - moving[0][axis]
        if abs(way[axis]) < 1e-9:
            if near > 0 or far < 0:
                return None
        else:
            one, two = near / way[axis], far / way[axis]
            start, end = max(start, min(one, two)), min(end, max(one, two))
    return (float(start), float(end)) if start < end and end > 0 else None
