"""A plan that takes long is cancelled, and the scene is as it was."""

import math
import time

import bpy
import numpy
from support import Scene, add, empty_scene


def ring():
    """A ring, cut open by less than it is thick."""
    around, across = 24, 12
    i, j = (grid.ravel() for grid in numpy.meshgrid(range(around), range(across), indexing="ij"))
    turn, roll = 2 * numpy.pi * i / around, 2 * numpy.pi * j / across
    radius = 5 + 1.5 * numpy.cos(roll)
    points = numpy.column_stack([radius * numpy.cos(turn), radius * numpy.sin(turn), 1.5 * numpy.sin(roll)])
    faces = [
        (a * across + b, (a + 1) * across + b, (a + 1) * across + (b + 1) % across, a * across + (b + 1) % across)
        for a in range(around - 1)
        for b in range(across)
    ]
    faces += [tuple(range(across)), tuple(range(around * across - 1, (around - 1) * across - 1, -1))]
    mesh = bpy.data.meshes.new("ring")
    mesh.from_pydata(points.tolist(), [], faces)
    return mesh


class Cancelling(Scene):
    @staticmethod
    def make():
        empty_scene()
        mesh = ring()
        for number in range(6):
            add(f"link {number}", mesh, (6.75 * number, 0, 0)).rotation_euler.x = math.pi / 2 * (number % 2)
        bpy.context.view_layer.update()

    def test_a_cancelled_plan_ends(self):
        self.disassembly.begin(bpy.context)
        job = self.disassembly.job
        while job.progress is None and job.is_alive():
            time.sleep(0.01)
        self.assertTrue(job.is_alive(), job.error)
        self.assertFalse(bpy.ops.sbdp.plan.poll())
        with self.assertRaisesRegex(RuntimeError, "cancel"):
            self.disassembly.begin(bpy.context)
        job.cancel()
        self.assertEqual(self.disassembly.finish().status, "cancelled")
        self.assertTrue(bpy.ops.sbdp.plan.poll())

    def test_closing_cancels(self):
        self.disassembly.begin(bpy.context)
        job = self.disassembly.job
        self.disassembly.close()
        self.assertFalse(job.is_alive())
