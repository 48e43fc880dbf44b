"""Steps that turn, that leave parts aside, and groups: the plan's contract, worked out with FreeCAD's placements."""

import unittest
from types import SimpleNamespace

import FreeCAD
import Part
import sbdp
from FreeCAD import Placement, Rotation, Vector
from support import add, between, connect, cylinder, distance, placement

from freecad.sbdp_workbench.disassembly import Disassembly
from freecad.sbdp_workbench.display import Display
from freecad.sbdp_workbench.document import Tessellation, find_parts


def step(number, parts, path, of=None, ends="out"):
    return SimpleNamespace(number=number, parts=tuple(parts), path=path, of=of, ends=ends)


def pose(x, y, z, axis=(0, 0, 1), degrees=0.0):
    i, j, k, w = Rotation(Vector(*axis), degrees).Q
    return [x, y, z, w, i, j, k]


STILL = pose(0, 0, 0)
TURN = [STILL, pose(3, 4, 5, (1, 2, 3), 130), pose(3, 4, 50, (0, 1, 1), 160)]


class Turning(unittest.TestCase):
    def setUp(self):
        self.document = FreeCAD.newDocument("turning")
        self.addCleanup(FreeCAD.closeDocument, self.document.Name)
        for number, name in enumerate("abc"):
            add(self.document, name, Part.makeBox(10, 4 + number, 2), Placement(Vector(12 * number, 0, 1), Rotation()))
        self.document.recompute()
        self.parts = find_parts(self.document)
        self.live = Tessellation(0.1).live_parts(self.parts)
        self.display = Display(self.document, self.parts)
        self.addCleanup(self.display.close)

    def motion(self, *steps):
        return sbdp.Motion(steps, {name: part.world() for name, part in self.live.items()})

    def there(self, name):
        return self.document.getObject(name).Placement

    def centre(self, *names):
        box = FreeCAD.BoundBox()
        for name in names:
            box.add(self.document.getObject(name).Shape.BoundBox)
        return box.Center

    def test_the_middle_of_the_box_goes_along_a_line_and_the_rotation_slerps(self):
        home, centre = self.there("b"), self.centre("b")
        motion = self.motion(step(0, "b", TURN))
        for leg in range(2):
            for share in (0.0, 0.25, 0.5, 0.9):
                low, high = motion.legs[0].shares[leg : leg + 2]
                self.display.show(motion.at(low + (high - low) * share))
                expected = between(TURN, centre, leg, share) * home
                self.assertLess(distance(self.there("b"), expected), 1e-6)
        self.display.show(motion.at(1))
        self.assertLess(distance(self.there("b"), placement(TURN[-1]) * home), 1e-6)

    def test_parts_of_a_step_are_one_body(self):
        homes, centre = [self.there(name) for name in "ab"], self.centre("a", "b")
        motion = self.motion(step(0, "ab", TURN))
        low, high = motion.legs[0].shares[:2]
        self.display.show(motion.at((low + high) / 2))
        for name, home in zip("ab", homes):
            self.assertLess(distance(self.there(name), between(TURN, centre, 0, 0.5) * home), 1e-6)

    def test_what_was_left_aside_goes_on_from_there(self):
        home = self.there("a")
        motion = self.motion(step(0, "a", TURN, ends="aside"), step(1, "a", TURN))
        self.display.show(motion.at(1))
        # The box of the second step is that of the part as it stands then.
        centre = self.centre("a")
        low, high = motion.legs[1].shares[:2]
        self.display.show(motion.at(1 + low + (high - low) * 0.3))
        aside = placement(TURN[-1]) * home
        self.assertLess(distance(self.there("a"), between(TURN, centre, 0, 0.3) * aside), 1e-6)
        self.display.show(motion.at(2))
        self.assertLess(distance(self.there("a"), placement(TURN[-1]) * aside), 1e-6)

    def test_a_group_is_taken_apart_as_it_stood_in_the_assembly(self):
        home_a, home_b, centre = self.there("a"), self.there("b"), self.centre("a")
        group, own = TURN, [STILL, pose(-20, 1, 2, (1, 0, 0), 70)]
        motion = self.motion(step(0, "ab", group), step(1, "a", own, of=0))
        self.display.show(motion.at(1.5))
        out = placement(group[-1])
        self.assertLess(distance(self.there("a"), out * between(own, centre, 0, 0.5) * home_a), 1e-6)
        self.assertLess(distance(self.there("b"), out * home_b), 1e-6)
        self.display.show(motion.at(2))
        self.assertLess(distance(self.there("a"), out * placement(own[-1]) * home_a), 1e-6)

    def test_steps_that_contradict_each_other_are_refused(self):
        for steps, words in (
            ([step(0, "a", TURN), step(1, "a", TURN)], "out of step None, but it is in 0"),
            ([step(0, ["d"], TURN)], "`d`, whose vertices are not given"),
            ([step(0, "a", TURN, ends="in")], "disassembly plans"),
        ):
            with self.assertRaisesRegex(ValueError, words):
                self.motion(*steps)


class Key(unittest.TestCase):
    def test_a_key_that_must_be_turned(self):
        """A plan of the daemon with a turn in it: a bar below a slot, through which it only fits lengthwise."""
        document = FreeCAD.newDocument("key")
        self.addCleanup(FreeCAD.closeDocument, document.Name)
        plate = Part.makeBox(60, 60, 4, Vector(-30, -30, 0)).cut(Part.makeBox(20, 6, 4, Vector(-10, -3, 0)))
        bar, head = Part.makeBox(5, 18, 3, Vector(-2.5, -9, -3.5)), cylinder(8, 8, 11)
        key = cylinder(2.5, -3, 10).fuse(bar).fuse(head)
        add(document, "plate", plate)
        add(document, "key", key)
        document.recompute()
        disassembly = Disassembly(document, connect)
        self.addCleanup(disassembly.close)
        disassembly.begin(deflection=0.05, base="plate")
        plan = disassembly.finish()
        self.assertEqual(plan.status, "complete")
        (only,) = plan.to_dict()["steps"]
        path, shares = only["path"], disassembly.motion.legs[0].shares
        thing = document.getObjectsByLabel(only["parts"][0])[0]
        home, points = thing.Placement, thing.Shape.tessellate(0.05)[0]
        centre = FreeCAD.BoundBox()
        for point in points:
            centre.add(point)
        for leg in range(len(path) - 1):
            disassembly.show(0.4 * shares[leg] + 0.6 * shares[leg + 1])
            expected = between(path, centre.Center, leg, 0.6) * home
            self.assertLess(distance(thing.Placement, expected), 1e-6)
        self.assertEqual(only["motion"], "rotation")
