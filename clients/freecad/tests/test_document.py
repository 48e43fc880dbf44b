"""Which objects of a document are parts, where they stand, and how they are moved there: containers, links, arrays."""

import unittest

import FreeCAD
import Mesh
import numpy
import Part
from FreeCAD import Placement, Rotation, Vector
from support import add, bolted, connect, distance, placement

from freecad.sbdp_workbench.disassembly import Disassembly
from freecad.sbdp_workbench.document import Tessellation, find_parts

TILTED = Placement(Vector(100, 20, -5), Rotation(Vector(1, 2, 3), 50))


class Documents(unittest.TestCase):
    def setUp(self):
        self.document = FreeCAD.newDocument("parts")
        self.addCleanup(FreeCAD.closeDocument, self.document.Name)

    def box(self, name, where=(0, 0, 0), size=10, container=None):
        thing = self.document.addObject("Part::Box", name)
        thing.Label, thing.Length, thing.Width, thing.Height = name, size, size, size
        thing.Placement.Base = Vector(*where)
        if container is not None:
            container.addObject(thing)
        return thing

    def container(self, name, where=Placement(), inside=None):
        made = self.document.addObject("App::Part", name)
        made.Label, made.Placement = name, where
        if inside is not None:
            inside.addObject(made)
        return made

    def link(self, name, target, where=Placement(), count=0):
        made = self.document.addObject("App::Link", name)
        made.Label, made.LinkedObject, made.ElementCount = name, target, count
        made.Placement = where
        return made

    def live(self, deflection=0.1):
        self.document.recompute()
        return Tessellation(deflection).live_parts(find_parts(self.document))

    def assert_box(self, live, low, high):
        points = live.world()
        numpy.testing.assert_allclose(points.min(axis=0), low, atol=1e-9)
        numpy.testing.assert_allclose(points.max(axis=0), high, atol=1e-9)


class Finding(Documents):
    def test_containers_add_their_placements(self):
        outer = self.container("outer", Placement(Vector(100, 0, 0), Rotation(Vector(0, 0, 1), 90)))
        inner = self.container("inner", Placement(Vector(0, 50, 0), Rotation()), outer)
        self.box("block", (1, 2, 3), container=inner)
        live = self.live()
        # y of the outer container is −x of the document.
        self.assert_box(live["block"], (100 - 50 - 12, 1, 3), (100 - 50 - 2, 11, 13))

    def test_links_stand_where_the_document_shows_them(self):
        block = self.box("block", (1, 2, 3))
        self.link("copy", block, Placement(Vector(50, 0, 0), Rotation()))
        half = self.link("half", block, Placement(Vector(0, 50, 0), Rotation()))
        half.Scale = 0.5
        further = self.link("further", block, Placement(Vector(0, 0, 50), Rotation()))
        further.LinkTransform = True
        live = self.live()
        self.assertEqual(set(live), {"block", "copy", "half", "further"})
        self.assert_box(live["copy"], (50, 0, 0), (60, 10, 10))
        self.assert_box(live["half"], (0, 50, 0), (5, 55, 5))
        self.assert_box(live["further"], (1, 2, 53), (11, 12, 63))
        for name in live:
            shown = Part.getShape(self.document.getObjectsByLabel(name)[0]).BoundBox
            self.assert_box(live[name], (shown.XMin, shown.YMin, shown.ZMin), (shown.XMax, shown.YMax, shown.ZMax))

    def test_a_link_to_a_container_is_one_part(self):
        unit = self.container("unit", Placement(Vector(0, 0, 5), Rotation()))
        self.box("lower", (0, 0, 0), container=unit)
        self.box("upper", (0, 0, 10), container=unit)
        self.link("second", unit, Placement(Vector(30, 0, 0), Rotation()))
        live = self.live()
        self.assertEqual(set(live), {"lower", "upper", "second"})
        self.assert_box(live["second"], (30, 0, 0), (40, 10, 20))

    def test_elements_of_arrays_are_parts(self):
        block = self.box("block")
        row = self.link("row", block, Placement(Vector(0, 0, 100), Rotation()), count=2)
        for number, element in enumerate(row.ElementList):
            element.Placement = Placement(Vector(0, 20 * number, 0), Rotation())
        flat = self.link("flat", block, Placement(Vector(0, 0, 200), Rotation()), count=2)
        flat.ShowElement = False
        flat.PlacementList = [Placement(), Placement(Vector(30, 0, 0), Rotation())]
        live = self.live()
        self.assertEqual(len(live), 5)
        self.assert_box(live["flat 2"], (30, 0, 200), (40, 10, 210))
        self.assert_box(live[row.ElementList[1].Label], (0, 20, 100), (10, 30, 110))

    def test_operands_and_what_is_hidden_are_no_parts(self):
        cut = self.document.addObject("Part::Cut", "cut")
        cut.Base, cut.Tool = self.box("base"), self.box("tool", (5, 5, 5))
        self.box("hidden", (50, 0, 0)).Visibility = False
        support = self.box("support", (100, 0, 0))
        sketch = self.document.addObject("Sketcher::SketchObject", "sketch")
        sketch.Support, sketch.MapMode = [(support, "Face6")], "FlatFace"
        body = self.document.addObject("PartDesign::Body", "body")
        made = self.document.addObject("PartDesign::AdditiveBox", "feature")
        made.Length = made.Width = made.Height = 10
        body.addObject(made)
        body.Placement = Placement(Vector(0, 0, 70), Rotation())
        live = self.live()
        self.assertEqual(set(live), {"cut", "support", "body"})
        self.assert_box(live["body"], (0, 0, 70), (10, 10, 80))

    def test_what_has_no_volume_is_left_out_by_name(self):
        self.box("block")
        add(self.document, "sheet", Part.makePlane(10, 10))
        mesh = self.document.addObject("Mesh::Feature", "ball")
        mesh.Mesh = Mesh.createSphere(5.0, 20)
        mesh.Placement.Base = Vector(0, 0, 30)
        found = find_parts(self.document)
        self.assertEqual(set(found.parts), {"block", "ball"})
        self.assertEqual(found.left_out, ["sheet is left out: it is a surface without volume"])
        self.assertAlmostEqual(self.live()["ball"].world()[:, 2].mean(), 30, delta=0.1)

    def test_equal_labels_get_names_of_their_own(self):
        for name in ("left", "right"):
            container = self.container(name)
            self.box("block", container=container).Label = "bolt"
        parameters = FreeCAD.ParamGet("User parameter:BaseApp/Preferences/Document")
        parameters.SetBool("DuplicateLabels", True)
        self.addCleanup(parameters.RemBool, "DuplicateLabels")
        for thing in self.document.Objects:
            if thing.TypeId == "Part::Box":
                thing.Label = "bolt"
        self.assertEqual(set(find_parts(self.document).parts), {"left/bolt", "right/bolt"})

    def test_the_deflection_is_in_millimetres(self):
        add(self.document, "disc", Part.makeCylinder(20, 5))
        for deflection in (0.01, 0.5):
            points = self.live(deflection)["disc"].world()
            triangles = self.live(deflection)["disc"].triangles
            middles = points[triangles].mean(axis=1)
            middles = middles[(middles[:, 2] > 0.1) & (middles[:, 2] < 4.9)]
            inside = 20 - numpy.linalg.norm(middles[:, :2], axis=1)
            self.assertLess(inside.max(), deflection)

    def test_an_unchanged_shape_is_not_meshed_again(self):
        block = self.box("block")
        self.document.recompute()
        tessellation = Tessellation(0.1)
        first = tessellation.live_parts(find_parts(self.document))["block"]
        block.Placement = TILTED
        second = tessellation.live_parts(find_parts(self.document))["block"]
        self.assertIs(first.vertices, second.vertices)
        block.Length = 11
        self.document.recompute()
        third = tessellation.live_parts(find_parts(self.document))["block"]
        self.assertAlmostEqual(numpy.ptp(third.vertices[:, 0]), 11)


class Moving(Documents):
    """A stack in tilted containers, whose uppermost parts are links and elements of an array."""

    def setUp(self):
        super().setUp()
        outer = self.container("outer", TILTED)
        inner = self.container("inner", Placement(Vector(3, 4, 5), Rotation(Vector(1, 0, 0), 30)), outer)
        self.box("ground", size=40, container=inner)
        block = self.box("block", (5, 5, 40), container=inner)
        self.link("copy", block, Placement(Vector(25, 5, 40), Rotation(Vector(0, 0, 1), 20)))
        inner.addObject(self.document.getObject("copy"))
        row = self.link("row", block, Placement(Vector(0, 20, 40), Rotation()), count=2)
        row.ShowElement = False
        row.PlacementList = [Placement(Vector(5, 5, 0), Rotation()), Placement(Vector(20, 5, 0), Rotation())]
        inner.addObject(row)
        self.document.recompute()
        self.disassembly = Disassembly(self.document, connect)
        self.addCleanup(self.disassembly.close)

    def world(self):
        parts = find_parts(self.document).parts
        return {name: part.outer * part.placement for name, part in parts.items()}

    def test_they_are_where_the_plan_has_them(self):
        home = self.world()
        self.disassembly.begin()
        plan = self.disassembly.finish()
        self.assertEqual(plan.status, "complete")
        self.assertEqual(set(plan.parts), {"ground", "block", "copy", "row 1", "row 2"})
        now = dict(home)
        for number, step in enumerate(plan.to_dict()["steps"]):
            self.disassembly.show(number + 1)
            for part in step["parts"]:
                now[part] = placement(step["path"][-1]) * now[part]
            for name, there in self.world().items():
                self.assertLess(distance(there, now[name]), 1e-6, name)
        self.disassembly.reset()
        for name, there in self.world().items():
            self.assertEqual(distance(there, home[name]), 0, name)

    def test_a_moved_container_moves_its_parts(self):
        self.disassembly.begin()
        self.disassembly.finish()
        self.document.getObject("outer").Placement = Placement(Vector(7, 7, 7), Rotation()) * TILTED
        self.disassembly.begin()
        self.disassembly.finish()
        self.assertEqual(set(self.disassembly.change.moved), {"ground", "block", "copy", "row 1", "row 2"})
        self.assertEqual(self.disassembly.change.replaced, ())


class Units(unittest.TestCase):
    def test_lengths_are_sent_in_millimetres(self):
        document = bolted("units")
        self.addCleanup(FreeCAD.closeDocument, document.Name)
        disassembly = Disassembly(document, connect)
        self.addCleanup(disassembly.close)
        disassembly.begin(deflection=0.05)
        plan = disassembly.finish().to_dict()
        self.assertEqual(plan["units"], "mm")
        self.assertEqual([w for w in plan["warnings"] if "unit" in w["message"]], [])
