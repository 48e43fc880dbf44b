"""Scenes for the tests, a daemon of their own, and the plan's contract worked out a second time, in double precision and
with rotation vectors in place of quaternions."""

import contextlib
import math
import os
import tempfile
import unittest
from pathlib import Path

import bmesh
import bpy
import numpy
import sbdp
from mathutils import Matrix

from sbdp_disassembly import operators
from sbdp_disassembly.disassembly import Disassembly

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
    operators.forget_all()
    _running.close()


def mesh_of(name, make):
    """A mesh that `make` builds in a bmesh."""
    built = bmesh.new()
    make(built)
    mesh = bpy.data.meshes.new(name)
    built.to_mesh(mesh)
    built.free()
    return mesh


def box_mesh(name, low, high):
    centre, size = (numpy.array(low) + high) / 2, numpy.array(high, dtype=float) - low
    matrix = Matrix.Translation(centre) @ Matrix.Diagonal([*size, 1.0])
    return mesh_of(name, lambda built: bmesh.ops.create_cube(built, size=1, matrix=matrix))


def cylinders_mesh(name, *cylinders):
    """Cylinders along z: (radius, lowest, highest)."""

    def make(built):
        for radius, low, high in cylinders:
            matrix = Matrix.Translation((0, 0, (low + high) / 2))
            bmesh.ops.create_cone(
                built, cap_ends=True, segments=24, radius1=radius, radius2=radius, depth=high - low, matrix=matrix
            )

    return mesh_of(name, make)


def add(name, mesh, location=(0, 0, 0)):
    thing = bpy.data.objects.new(name, mesh)
    thing.location = location
    bpy.context.scene.collection.objects.link(thing)
    return thing


def cut(thing, *cutters):
    """Takes hidden objects out of one, by modifiers."""
    for cutter in cutters:
        modifier = thing.modifiers.new("hole", "BOOLEAN")
        modifier.object, modifier.operation, modifier.solver = cutter, "DIFFERENCE", "EXACT"
        cutter.hide_set(True)


def empty_scene(scale=0.01, system="METRIC"):
    bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True)
    settings = bpy.context.scene.unit_settings
    settings.system, settings.scale_length = system, scale


CORNERS = [(1, 1), (7, 1), (7, 5), (1, 5)]


def bolted():
    """Eight parts: a plate, a cover on it with four bolts through both, and under the cover a pin with a washer about it. In
    centimetres. The bolts share a mesh; one is mirrored, one twice as large as its mesh, and each turned in its own way."""
    empty_scene()
    plate = add("plate", box_mesh("plate", (0, 0, 0), (8, 6, 1)))
    cover = add("cover", box_mesh("cover", (0, 0, 1), (8, 6, 1.6)))
    hole = cylinders_mesh("hole", (0.25, -3, 3))
    holes = [add(f"hole {n}", hole, (x, y, 1)) for n, (x, y) in enumerate(CORNERS)]
    pit = add("pit", cylinders_mesh("pit", (0.35, 0.2, 1.4)), (4, 3, 0))
    recess = add("recess", cylinders_mesh("recess", (0.65, 0.5, 1.12)), (4, 3, 0))
    cut(plate, *holes, pit)
    cut(cover, *holes, pit, recess)
    full = cylinders_mesh("bolt", (0.2, -1.4, 0), (0.35, 0, 0.3))
    half = cylinders_mesh("half", (0.1, -0.7, 0), (0.175, 0, 0.15))
    for number, (x, y) in enumerate(CORNERS, 1):
        add(f"bolt {number}", half if number == 4 else full, (x, y, 1.6))
    bolts = bpy.data.objects
    bolts["bolt 1"].rotation_euler = (0, 0, 0.3)
    bolts["bolt 2"].rotation_mode = "QUATERNION"
    bolts["bolt 2"].rotation_quaternion = (math.cos(0.6), 0, 0, -math.sin(0.6))
    bolts["bolt 3"].rotation_mode = "AXIS_ANGLE"
    bolts["bolt 3"].rotation_axis_angle = (0.9, 0, 0, 1)
    bolts["bolt 3"].scale = (-1, 1, 1)
    bolts["bolt 4"].scale = (2, 2, 2)
    add("pin", cylinders_mesh("pin", (0.3, 0.2, 1.35)), (4, 3, 0))
    washer = add("washer", cylinders_mesh("washer", (0.6, 1.0, 1.1)), (4, 3, 0))
    cut(washer, pit)
    bpy.context.view_layer.update()


class Scene(unittest.TestCase):
    """Each test has a scene of its own."""

    make = staticmethod(bolted)

    def setUp(self):
        operators.forget_all()
        self.make()
        self.disassembly = Disassembly(connect)
        # What the buttons use, too.
        operators._disassemblies[bpy.context.scene.name_full] = self.disassembly
        self.addCleanup(self.disassembly.close)

    def plan(self, *arguments, **options):
        self.disassembly.begin(bpy.context, *arguments, **options)
        return self.disassembly.finish()

    def worlds(self):
        bpy.context.view_layer.update()
        return {thing.name: numpy.array(thing.matrix_world) for thing in bpy.data.objects if thing.visible_get()}

    def assert_worlds(self, expected, tolerance=1e-6):
        """All matrices, to so much of a Blender unit: locations and the columns that turn and scale."""
        for name, there in self.worlds().items():
            difference = numpy.abs(there - expected[name]).max()
            self.assertLess(difference, tolerance, f"{name}:\n{there}\n{expected[name]}")


def rotation_vector(turn):
    w, *axis = numpy.array(turn) if turn[0] >= 0 else -numpy.array(turn)
    length = numpy.linalg.norm(axis)
    return numpy.zeros(3) if length == 0 else numpy.array(axis) / length * 2 * math.atan2(length, w)


def rotation(vector):
    """By Rodrigues' formula."""
    angle = numpy.linalg.norm(vector)
    if angle == 0:
        return numpy.eye(3)
    x, y, z = vector / angle
    cross = numpy.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return numpy.eye(3) + math.sin(angle) * cross + (1 - math.cos(angle)) * cross @ cross


def rigid(waypoint):
    made = numpy.eye(4)
    made[:3, :3], made[:3, 3] = rotation(rotation_vector(waypoint[3:])), waypoint[:3]
    return made


def between(path, centre, leg, share):
    """The transform at a share of a leg of a path: the middle of the box on a line, the rotation about one axis."""
    before, after = rigid(path[leg]), rigid(path[leg + 1])
    relative = after[:3, :3] @ before[:3, :3].T
    angle = math.acos(min(1.0, max(-1.0, (numpy.trace(relative) - 1) / 2)))
    axis = numpy.array([relative[2, 1] - relative[1, 2], relative[0, 2] - relative[2, 0], relative[1, 0] - relative[0, 1]])
    vector = axis / numpy.linalg.norm(axis) * angle if angle > 1e-12 else numpy.zeros(3)
    made = numpy.eye(4)
    made[:3, :3] = rotation(share * vector) @ before[:3, :3]
    point = numpy.array([*centre, 1.0])
    middle = (1 - share) * (before @ point)[:3] + share * (after @ point)[:3]
    made[:3, 3] = middle - made[:3, :3] @ centre
    return made
