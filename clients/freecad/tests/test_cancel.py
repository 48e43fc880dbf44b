"""A plan that takes long is cancelled, and the document is as it was."""

import time
import unittest

import FreeCAD
import Part
import sbdp
from FreeCAD import Placement, Rotation, Vector
from support import add, connect

from freecad.sbdp_workbench.disassembly import Disassembly


def chain(links):
    """Rings through each other, cut open by less than they are thick: only a long search shows that they do not come
    apart."""
    document = FreeCAD.newDocument("chain")
    ring = Part.makeTorus(5, 1.5, Vector(), Vector(0, 0, 1), 0, 360, 345)
    for number in range(links):
        turn = Rotation(Vector(1, 0, 0), 90 * (number % 2))
        add(document, f"link {number}", ring, Placement(Vector(6.75 * number, 0, 0), turn))
    document.recompute()
    return document


class Cancelling(unittest.TestCase):
    def setUp(self):
        self.document = chain(6)
        self.addCleanup(FreeCAD.closeDocument, self.document.Name)
        self.disassembly = Disassembly(self.document, connect)
        self.addCleanup(self.disassembly.close)

    def test_a_cancelled_plan_ends(self):
        self.disassembly.begin(deflection=0.3)
        job = self.disassembly.job
        while job.progress is None and job.is_alive():
            time.sleep(0.01)
        self.assertTrue(job.is_alive(), job.error)
        with self.assertRaisesRegex(RuntimeError, "cancel"):
            self.disassembly.begin()
        job.cancel()
        plan = self.disassembly.finish()
        self.assertEqual(plan.status, "cancelled")
        self.assertIsNone(self.disassembly.job)
        # And the next question is answered.
        self.disassembly.begin([("link_0",)], deflection=0.3)
        self.assertEqual(self.disassembly.finish().status, "complete")

    def test_one_that_is_cancelled_before_it_begins(self):
        self.disassembly.begin(deflection=0.3)
        self.disassembly.job.cancel()
        try:
            self.assertEqual(self.disassembly.finish().status, "cancelled")
        except sbdp.CancelledError:
            pass

    def test_closing_cancels(self):
        self.disassembly.begin(deflection=0.3)
        job = self.disassembly.job
        self.disassembly.close()
        self.assertFalse(job.is_alive())
