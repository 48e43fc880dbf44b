"""Documents for the tests, a daemon of their own, and the plan's contract worked out a second time with FreeCAD's own
placements."""

import contextlib
import os
import tempfile
from pathlib import Path

import FreeCAD
import Part
import sbdp
from FreeCAD import Placement, Rotation, Vector

_running = contextlib.ExitStack()


def connect():
    """A client of the daemon of these tests, which remembers nothing of others; it is started by the first."""
    if not hasattr(connect, "place"):
        folder = Path(_running.enter_context(tempfile.TemporaryDirectory()))
        os.environ["SBDP_CACHE_DIR"] = str(folder / "cache")
        _running.enter_context(sbdp.Daemon(folder / "run", arguments=["--root", str(folder / "iox")], quiet=True))
        connect.place = folder / "run"
    return sbdp.connect(connect.place, reconnect=0.0)


def stop():
    """Ends the daemon of these tests."""
    _running.close()


def cylinder(radius, low, high, x=0.0, y=0.0):
    return Part.makeCylinder(radius, high - low, Vector(x, y, low))


def add(document, name, shape, placement=None):
    """A part, with its shape in its own frame."""
    thing = document.addObject("Part::Feature", name)
    thing.Label, thing.Shape, thing.Placement = name, shape, placement or Placement()
    return thing


CORNERS = [(10, 10), (70, 10), (70, 50), (10, 50)]


def bolted(name="bolted"):
    """Eight parts: a plate, a cover on it with four bolts through both, and under the cover a pin with a washer about it."""
    document = FreeCAD.newDocument(name)
    document.UndoMode = 1
    plate, cover = Part.makeBox(80, 60, 10), Part.makeBox(80, 60, 6, Vector(0, 0, 10))
    for x, y in CORNERS:
        plate = plate.cut(cylinder(2.2, 0, 10, x, y))
        cover = cover.cut(cylinder(2.2, 10, 16, x, y))
    plate = plate.cut(cylinder(3.1, 2, 10, 40, 30))
    cover = cover.cut(cylinder(3.1, 10, 14, 40, 30)).cut(cylinder(6.2, 10, 11.1, 40, 30))
    add(document, "plate", plate)
    add(document, "cover", cover)
    for number, (x, y) in enumerate(CORNERS, 1):
        shape = cylinder(2, -14, 0.5).fuse(cylinder(3.5, 0, 3))
        add(document, f"bolt {number}", shape, Placement(Vector(x, y, 16), Rotation(Vector(0, 0, 1), 25 * number)))
    add(document, "pin", cylinder(3, 2, 13.9, 40, 30))
    add(document, "washer", cylinder(6, 10, 11, 40, 30).cut(cylinder(3.2, 10, 11, 40, 30)))
    document.recompute()
    return document


def captive(name="captive"):
    """A ball in a closed box, with a lid on the box that is no part of that."""
    document = FreeCAD.newDocument(name)
    document.UndoMode = 1
    hollow = Part.makeBox(30, 30, 30).cut(Part.makeBox(20, 20, 20, Vector(5, 5, 5)))
    add(document, "box", hollow)
    add(document, "ball", Part.makeSphere(6, Vector(15, 15, 15)))
    add(document, "lid", Part.makeBox(30, 30, 2, Vector(0, 0, 30)))
    document.recompute()
    return document


def placement(waypoint):
    x, y, z, w, i, j, k = waypoint
    return Placement(Vector(x, y, z), Rotation(i, j, k, w))


def between(path, centre, leg, share):
    """The transform at a share of a leg of a path: the middle of the box on a line, the rotation by slerp."""
    before, after = placement(path[leg]), placement(path[leg + 1])
    middle = before.multVec(centre) * (1 - share) + after.multVec(centre) * share
    turn = before.Rotation.slerp(after.Rotation, share)
    return Placement(middle - turn.multVec(centre), turn)


def distance(one, other):
    """How far points within 100 mm of the origin are apart at most under two placements, about."""
    points = [Vector(0, 0, 0), Vector(100, 0, 0), Vector(0, 100, 0), Vector(0, 0, 100)]
    return max((one.multVec(p) - other.multVec(p)).Length for p in points)
