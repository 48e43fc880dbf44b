"""A document of eight parts: planned, edited, planned again; what it shows is what the plan says."""

import shutil
import tempfile
import unittest

import FreeCAD
import Part
from FreeCAD import Placement, Rotation, Vector
from support import between, bolted, captive, connect, distance, placement

from freecad.sbdp_workbench.disassembly import Disassembly

CLOSE = 1e-6
DEFLECTION = 0.05


class Planned(unittest.TestCase):
    """Each test has a document of its own."""

    make = staticmethod(bolted)

    def setUp(self):
        self.document = self.make()
        self.addCleanup(FreeCAD.closeDocument, self.document.Name)
        self.disassembly = Disassembly(self.document, connect)
        self.addCleanup(self.disassembly.close)

    def part(self, label):
        return self.document.getObjectsByLabel(label)[0]

    def placements(self):
        return {thing.Label: Placement(thing.Placement) for thing in self.document.Objects if hasattr(thing, "Placement")}

    def plan(self, selection=None):
        # Coarser than usual, and finer than the play of the bolts: it saves most of the time.
        self.disassembly.begin(selection, DEFLECTION)
        return self.disassembly.finish()

    def expected_in_the_end(self, plan, home):
        """By FreeCAD's placements, from the plan's document. For plans without groups."""
        now = dict(home)
        for step in plan.to_dict()["steps"]:
            self.assertIsNone(step["of"])
            for part in step["parts"]:
                now[part] = placement(step["path"][-1]) * now[part]
        return now

    def assert_placed(self, expected):
        for label, there in self.placements().items():
            self.assertLess(distance(there, expected[label]), CLOSE, label)


class EightParts(Planned):
    def test_the_end_of_the_animation_is_that_of_the_plan(self):
        home = self.placements()
        plan = self.plan()
        self.assertEqual(plan.status, "complete")
        self.assertEqual(len(plan.parts), 8)
        self.assertEqual(len(plan), 7)
        self.disassembly.show(len(plan))
        expected = self.expected_in_the_end(plan, home)
        self.assert_placed(expected)
        moved = [label for label, there in self.placements().items() if distance(there, home[label]) > 1]
        self.assertEqual(len(moved), 7)

    def test_a_moved_bolt_is_planned_from_where_it_stands(self):
        first = self.plan()
        self.assertTrue(self.disassembly.change.whole)
        self.disassembly.show(3.5)
        self.disassembly.reset()
        bolt = self.part("bolt 2")
        bolt.Placement = Placement(Vector(0, 0, 3), Rotation(Vector(0, 0, 1), 40), Vector(70, 10, 0)) * bolt.Placement
        home = self.placements()
        second = self.plan()
        self.assertEqual(self.disassembly.change.moved, ("bolt 2",))
        self.assertFalse(self.disassembly.change.whole or self.disassembly.change.replaced)
        self.assertEqual(second.status, "complete")
        self.assertIn("bolt 2", second.to_dict()["initial"]["poses"])
        self.disassembly.show(len(second))
        self.assert_placed(self.expected_in_the_end(second, home))
        ways = [plan.steps_of("bolt 2")[0].path[-1][2] for plan in (first, second)]
        # It is 3 mm further up, and leaves to the same height.
        self.assertAlmostEqual(ways[0] - ways[1], 3, delta=0.5)

    def test_a_changed_shape_alone_is_sent(self):
        self.plan()
        pin = self.part("pin")
        pin.Shape = Part.makeCylinder(3, 11, Vector(40, 30, 2))
        self.document.recompute()
        plan = self.plan()
        self.assertEqual(plan.status, "complete")
        self.assertEqual(self.disassembly.change.replaced, ("pin",))
        self.assertFalse(self.disassembly.change.whole or self.disassembly.change.moved)
        # The same as that of a document which had this shape from the start.
        fresh = Disassembly(self.document, connect)
        self.addCleanup(fresh.close)
        fresh.begin(deflection=DEFLECTION)
        same = fresh.finish()
        self.assertTrue(fresh.change.whole)
        self.assertEqual([s.parts for s in same.steps], [s.parts for s in plan.steps])
        for one, other in zip(same.steps, plan.steps):
            self.assertEqual(one.path.tolist(), other.path.tolist())

    def test_a_deleted_part_and_a_new_one(self):
        self.plan()
        self.document.removeObject(self.part("washer").Name)
        spacer = self.document.addObject("Part::Cylinder", "spacer")
        spacer.Radius, spacer.Height, spacer.Placement.Base = 4, 10, Vector(20, 30, 16)
        self.document.recompute()
        plan = self.plan()
        self.assertEqual((self.disassembly.change.added, self.disassembly.change.removed), (("spacer",), ("washer",)))
        moved = {part for step in plan.steps for part in step.parts}
        self.assertIn("spacer", moved)
        self.assertNotIn("washer", moved)

    def test_half_way_is_between_the_waypoints(self):
        home = self.placements()
        plan = self.plan()
        document = plan.to_dict()
        before = dict(home)
        for number, step in enumerate(document["steps"]):
            path, (part,) = step["path"], step["parts"]
            leg_shares = self.disassembly.motion.legs[number].shares
            box = self.part(part).Shape.BoundBox
            self.disassembly.reset()
            for leg in range(len(path) - 1):
                moment = number + (0.7 * leg_shares[leg] + 0.3 * leg_shares[leg + 1])
                self.disassembly.show(moment)
                expected = {**before, part: between(path, box.Center, leg, 0.3) * before[part]}
                self.assert_placed(expected)
            before[part] = placement(path[-1]) * before[part]

    def test_reset_restores_exactly(self):
        home = self.placements()
        states = [thing.State for thing in self.document.Objects]
        plan = self.plan()
        for moment in (0.3, 2.5, len(plan), 1.2, 0):
            self.disassembly.show(moment)
        self.disassembly.explode()
        self.disassembly.show(5.1)
        self.disassembly.reset()
        for label, there in self.placements().items():
            self.assertEqual((tuple(there.Base), there.Rotation.Q), (tuple(home[label].Base), home[label].Rotation.Q))
        self.assertEqual([thing.State for thing in self.document.Objects], states)

    def test_all_of_it_is_one_step_of_undo(self):
        home = self.placements()
        plan = self.plan()
        count = self.document.UndoCount
        for moment in range(len(plan) + 1):
            self.disassembly.show(moment)
        self.document.commitTransaction()
        self.assertEqual(self.document.UndoCount, count + 1)
        self.document.undo()
        self.assert_placed(home)
        # What came home by undo is no edit.
        self.disassembly.reset()
        self.assertEqual(self.disassembly.display.edited, set())

    def test_an_edit_meanwhile_stays(self):
        plan = self.plan()
        self.disassembly.show(len(plan))
        there = Placement(Vector(5, 6, 70), Rotation())
        self.part("bolt 1").Placement = there
        self.disassembly.show(2)
        self.disassembly.reset()
        self.assertEqual(distance(self.part("bolt 1").Placement, there), 0)
        self.assertEqual(self.disassembly.display.edited, {"bolt 1"})

    def test_what_is_saved_is_the_document_and_not_the_animation(self):
        home = self.placements()
        plan = self.plan()
        self.disassembly.show(len(plan))
        shown = self.placements()
        with tempfile.TemporaryDirectory() as folder:
            self.document.saveAs(f"{folder}/saved.FCStd")
            self.assert_placed(shown)
            # A file that is open already would not be read.
            shutil.copy(f"{folder}/saved.FCStd", f"{folder}/copy.FCStd")
            saved = FreeCAD.openDocument(f"{folder}/copy.FCStd")
            try:
                for thing in saved.Objects:
                    self.assertLess(distance(thing.Placement, home[thing.Label]), 1e-9, thing.Label)
            finally:
                FreeCAD.closeDocument(saved.Name)

    def test_exploded_boxes_are_apart(self):
        self.plan()
        self.disassembly.explode()
        boxes = [(thing.Label, thing.Shape.BoundBox) for thing in self.document.Objects]
        for i, (label, box) in enumerate(boxes):
            for other, further in boxes[:i]:
                self.assertFalse(box.intersect(further), (label, other))

    def test_a_selection_is_planned_alone(self):
        names = [(self.part(label).Name,) for label in ("plate", "bolt 1", "bolt 3")]
        plan = self.plan(names)
        self.assertEqual(set(plan.parts), {"plate", "bolt 1", "bolt 3"})

    def test_nothing_to_plan_is_an_error(self):
        with self.assertRaisesRegex(ValueError, "no visible part"):
            self.disassembly.begin([("nothing",)])

    def test_a_daemon_that_is_gone_is_an_error(self):
        def gone():
            import sbdp

            return sbdp.connect("/nonexistent/sbdp")

        with self.assertRaises(Exception) as caught:
            other = Disassembly(self.document, gone)
            other.begin()
            other.finish()
        self.assertIn("daemon", str(caught.exception))


class Captive(Planned):
    make = staticmethod(captive)

    def test_what_blocks_is_named(self):
        plan = self.plan()
        self.assertEqual(plan.status, "infeasible")
        self.assertEqual(self.disassembly.blocking(), {"ball": "captive", "box": "captive"})
        self.assertIn("ball", plan.reason)
