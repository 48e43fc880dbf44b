"""The panel in FreeCAD's window: `SBDP_TESTS=gui_*.py xvfb-run freecad run.py`. With $SBDP_PICTURES, a folder, it saves pictures
of the window."""

import os
import re
import shutil
import tempfile
import time
import unittest

import FreeCAD
import FreeCADGui
import Part
from FreeCAD import Placement, Rotation, Vector
from PySide2 import QtCore, QtWidgets
from support import add, bolted, captive, connect, distance, placement
from test_cancel import chain

from freecad.sbdp_workbench import panel as panels
from freecad.sbdp_workbench.colours import COLOURS


class InWindow(unittest.TestCase):
    make = staticmethod(bolted)

    def setUp(self):
        self.document = self.make()
        FreeCAD.setActiveDocument(self.document.Name)
        self.addCleanup(FreeCAD.closeDocument, self.document.Name)
        FreeCADGui.Selection.clearSelection()
        FreeCADGui.activateWorkbench("DisassemblyWorkbench")
        FreeCADGui.getMainWindow().showMaximized()
        self.panel = panels.show(self.document, connect)
        self.addCleanup(self.panel.reject)
        self.panel.deflection.setValue(0.05)

    def wait(self):
        while self.panel.disassembly.job is not None:
            QtWidgets.QApplication.processEvents(QtCore.QEventLoop.AllEvents, 50)
            time.sleep(0.01)

    def plan(self):
        self.panel.plan.click()
        self.wait()

    def picture(self, name):
        folder = os.environ.get("SBDP_PICTURES")
        if not folder:
            return
        view = FreeCADGui.activeDocument().activeView()
        view.viewIsometric()
        view.fitAll()
        for _ in range(20):
            QtWidgets.QApplication.processEvents()
            time.sleep(0.02)
        # The window's own picture of itself is without the view of the document.
        screen = QtWidgets.QApplication.primaryScreen()
        screen.grabWindow(0).save(os.path.join(folder, f"freecad-{name}.png"))

    def placements(self):
        return {thing.Label: Placement(thing.Placement) for thing in self.document.Objects}


class Motion(InWindow):
    def test_plan_scrub_explode_reset(self):
        home = self.placements()
        self.plan()
        panel = self.panel
        plan = panel.disassembly.plan
        self.assertIn("Complete", panel.status.text())
        self.assertIn("7 steps; sent: all 8 parts", panel.status.text())
        self.assertEqual(panel.steps.count(), 7)
        panel.slider.setValue(panel.slider.maximum())
        expected = dict(home)
        for step in plan.to_dict()["steps"]:
            for part in step["parts"]:
                expected[part] = placement(step["path"][-1]) * expected[part]
        for label, there in self.placements().items():
            self.assertLess(distance(there, expected[label]), 1e-6)
        panel.steps.setCurrentRow(1)
        self.assertEqual((panel.slider.value(), panel.steps.currentRow()), (2 * panels.PER_STEP, 1))
        panel.slider.setValue(2 * panels.PER_STEP + 1)
        self.assertEqual(panel.steps.currentRow(), 2)
        panel.steps.itemClicked.emit(panel.steps.item(1))
        self.assertEqual((panel.slider.value(), panel.steps.currentRow()), (2 * panels.PER_STEP, 1))
        self.picture("motion")
        panel.exploded.setChecked(True)
        self.picture("exploded")
        panel.exploded.setChecked(False)
        self.assertEqual(panel.slider.value(), 2 * panels.PER_STEP)
        panel.reset.click()
        for label, there in self.placements().items():
            self.assertEqual(distance(there, home[label]), 0)

    def test_replan_sends_what_moved(self):
        self.assertFalse(self.panel.replan.isEnabled())
        self.plan()
        bolt = self.document.getObjectsByLabel("bolt 3")[0]
        bolt.Placement = Placement(Vector(0, 0, 2), Rotation()) * bolt.Placement
        self.panel.replan.click()
        self.wait()
        self.assertIn("sent: position of bolt 3", self.panel.status.text())
        # Plan begins anew.
        self.plan()
        self.assertIn("sent: all 8 parts", self.panel.status.text())

    def test_selected_parts(self):
        for label in ("plate", "bolt 1"):
            FreeCADGui.Selection.addSelection(self.document.getObjectsByLabel(label)[0], "Face1")
        self.panel.selected.setChecked(True)
        self.plan()
        self.assertEqual(set(self.panel.disassembly.plan.parts), {"plate", "bolt 1"})

    def test_closing_brings_all_back(self):
        home = self.placements()
        self.plan()
        self.panel.slider.setValue(250)
        self.panel.reject()
        for label, there in self.placements().items():
            self.assertEqual(distance(there, home[label]), 0)
        self.assertFalse(FreeCADGui.Control.activeDialog())


class Closed(unittest.TestCase):
    def test_a_document_that_is_closed_first(self):
        document = bolted()
        panel = panels.show(document, connect)
        self.addCleanup(panel.reject)
        panel.plan.click()
        while panel.disassembly.job is not None:
            QtWidgets.QApplication.processEvents(QtCore.QEventLoop.AllEvents, 50)
        panel.slider.setValue(250)
        FreeCAD.closeDocument(document.Name)
        panel.slider.setValue(300)
        self.assertIn("was closed", panel.status.text())
        panel.replan.click()
        self.assertIn("was closed", panel.status.text())
        panel.reject()
        self.assertFalse(FreeCADGui.Control.activeDialog())


def rounded(colours):
    return re.sub(r"\d+\.\d+(e-\d+)?", lambda number: f"{float(number[0]):.1f}", str(colours))


class Blocked(InWindow):
    make = staticmethod(captive)

    def setUp(self):
        super().setUp()
        body = self.document.addObject("PartDesign::Body", "body")
        made = self.document.addObject("PartDesign::AdditiveBox", "feature")
        body.addObject(made)
        body.Placement.Base = Vector(60, 0, 0)
        link = self.document.addObject("App::Link", "copy")
        link.LinkedObject = self.document.getObject("box")
        link.Placement.Base = Vector(0, 60, 0)
        add(self.document, "ball2", Part.makeSphere(6, Vector(15, 75, 15)))
        self.document.recompute()
        self.view("box").DiffuseColor = [(0.1, 0.2, 0.3, 0.0)] * 5 + [(0.3, 0.2, 0.1, 0.0)] * 7
        self.view("body").ShapeColor = (0.2, 0.4, 0.6)

    def view(self, name):
        return self.document.getObject(name).ViewObject

    def colours(self, document=None):
        names = ("ShapeColor", "DiffuseColor", "Transparency", "OverrideMaterial")

        def values(view):
            yield from ((name, str(getattr(view, name))) for name in names if hasattr(view, name))
            if hasattr(view, "ShapeMaterial"):
                yield "ShapeMaterial", str(view.ShapeMaterial.DiffuseColor)

        return {thing.Name: dict(values(thing.ViewObject)) for thing in (document or self.document).Objects}

    def test_what_blocks_is_marked_and_gets_its_colours_back(self):
        before = self.colours()
        self.plan()
        self.assertIn("Infeasible", self.panel.status.text())
        roles = self.panel.disassembly.blocking()
        self.assertIn(set(roles), ({"ball", "box"}, {"ball2", "copy"}))
        self.panel.blocking.setChecked(True)
        for label, role in roles.items():
            expected, view = COLOURS[role], self.view(label)
            linked = hasattr(view, "OverrideMaterial")
            shown = [view.ShapeMaterial.DiffuseColor] if linked else [view.ShapeColor, *view.DiffuseColor]
            self.assertTrue(view.OverrideMaterial if linked else True)
            for colour in shown:
                self.assertLess(max(abs(a - b) for a, b in zip(colour, expected)), 0.01, label)
        self.assertEqual(self.view("body").Transparency, 70)
        self.picture("blocked")
        marked = self.colours()
        with tempfile.TemporaryDirectory() as folder:
            self.document.saveAs(f"{folder}/saved.FCStd")
            self.assertEqual(self.colours(), marked)
            # A file that is open already would not be read.
            shutil.copy(f"{folder}/saved.FCStd", f"{folder}/copy.FCStd")
            saved = FreeCAD.openDocument(f"{folder}/copy.FCStd")
            try:
                # Files have 8 bits of each colour.
                self.assertEqual(rounded(self.colours(saved)), rounded(before))
            finally:
                FreeCAD.closeDocument(saved.Name)
        self.panel.blocking.setChecked(False)
        self.assertEqual(self.colours(), before)
        self.panel.blocking.setChecked(True)
        self.panel.reset.click()
        self.assertEqual(self.colours(), before)


class Long(InWindow):
    make = staticmethod(lambda: chain(6))

    def test_cancel_while_the_window_lives(self):
        self.panel.deflection.setValue(0.3)
        self.panel.plan.click()
        self.assertTrue(self.panel.cancel.isEnabled())
        self.assertFalse(self.panel.plan.isEnabled())
        job = self.panel.disassembly.job
        while job.progress is None and job.is_alive():
            QtWidgets.QApplication.processEvents(QtCore.QEventLoop.AllEvents, 50)
        self.panel.cancel.click()
        self.wait()
        self.assertIn("Cancelled", self.panel.status.text())
        self.assertTrue(self.panel.plan.isEnabled())
