"""Which objects are parts, where they stand, units, parents, and how they turn."""

import math
from types import SimpleNamespace

import bpy
import numpy
import sbdp
from support import Scene, add, between, box_mesh, empty_scene, rigid

from sbdp_disassembly.parts import find_parts, units


def step(number, parts, path, of=None, ends="out"):
    return SimpleNamespace(number=number, parts=tuple(parts), path=path, of=of, ends=ends)


def pose(x, y, z, axis=(0, 0, 1), angle=0.0):
    axis = numpy.array(axis) / numpy.linalg.norm(axis) * math.sin(angle / 2)
    return [x, y, z, math.cos(angle / 2), *axis]


STILL = pose(0, 0, 0)
TURN = [STILL, pose(0.3, 0.4, 0.5, (1, 2, 3), 2.2), pose(0.3, 0.4, 5, (0, 1, 1), 2.8)]


def two_boxes():
    empty_scene()
    add("a", box_mesh("a", (0, 0, 0), (1, 0.4, 0.2)), (1, 2, 3))
    add("b", box_mesh("b", (0, 0, 0), (1, 0.5, 0.2)), (2.5, 2, 3)).rotation_euler = (0.1, 0.2, 0.3)
    bpy.context.view_layer.update()


class Turning(Scene):
    make = staticmethod(two_boxes)

    def show(self, *steps, per_step=8):
        """Keyframes of steps that no planner made."""
        parts = find_parts(bpy.context, False).parts
        self.vertices = {name: part.world() for name, part in parts.items()}
        self.disassembly.motion = sbdp.Motion(steps, self.vertices)
        self.disassembly.add_keyframes(bpy.context, per_step)
        return self.disassembly.motion

    def centre(self, *names):
        points = numpy.concatenate([self.vertices[name] for name in names])
        return (points.min(axis=0) + points.max(axis=0)) / 2

    def each_frame(self, step, leg, per_step=8):
        """Each frame within a leg of a step, set, with its share of the leg."""
        low, high = self.disassembly.motion.legs[step].shares[leg : leg + 2]
        frames = [frame for frame in range(per_step + 1) if low <= frame / per_step <= high]
        self.assertTrue(frames)
        for frame in frames:
            bpy.context.scene.frame_set(1 + step * per_step + frame)
            yield (frame / per_step - low) / (high - low)

    def test_every_frame_is_as_the_contract_has_it(self):
        home = self.worlds()
        self.show(step(0, "b", TURN))
        for leg in range(2):
            for share in self.each_frame(0, leg):
                self.assert_worlds({**home, "b": between(TURN, self.centre("b"), leg, share) @ home["b"]})

    def test_parts_of_a_step_are_one_body(self):
        home = self.worlds()
        self.show(step(0, "ab", TURN))
        for share in self.each_frame(0, 1):
            there = between(TURN, self.centre("a", "b"), 1, share)
            self.assert_worlds({name: there @ world for name, world in home.items()})

    def test_aside_and_out(self):
        home = self.worlds()
        self.show(step(0, "a", TURN, ends="aside"), step(1, "a", [STILL, pose(0, 0, 4)]))
        bpy.context.scene.frame_set(17)
        self.assert_worlds({**home, "a": rigid(pose(0, 0, 4)) @ rigid(TURN[-1]) @ home["a"]})

    def test_a_group_is_taken_apart_as_it_stood_in_the_assembly(self):
        home, own = self.worlds(), [STILL, pose(-2, 0.1, 0.2, (1, 0, 0), 1.2)]
        self.show(step(0, "ab", TURN), step(1, "a", own, of=0))
        out = rigid(TURN[-1])
        for share in self.each_frame(1, 0):
            there = out @ between(own, self.centre("a"), 0, share) @ home["a"]
            self.assert_worlds({"a": there, "b": out @ home["b"]}, 2e-6)

    def test_a_mirrored_and_stretched_object_under_a_tilted_parent(self):
        parent = bpy.data.objects.new("holder", None)
        bpy.context.scene.collection.objects.link(parent)
        parent.location, parent.rotation_euler, parent.scale = (1, 1, 0), (0.5, 0.2, 0.1), (-2, 2, 2)
        thing = bpy.data.objects["b"]
        thing.parent, thing.scale = parent, (-1, 1.5, 0.7)
        bpy.context.view_layer.update()
        home = self.worlds()
        self.show(step(0, "b", TURN))
        for leg in range(2):
            for share in self.each_frame(0, leg):
                self.assert_worlds({**home, "b": between(TURN, self.centre("b"), leg, share) @ home["b"]}, 5e-6)


class Finding(Scene):
    make = staticmethod(two_boxes)

    def refused(self, words):
        with self.assertRaisesRegex(ValueError, words):
            find_parts(bpy.context, False)

    def test_meshes_are_as_the_modifiers_leave_them(self):
        modifier = bpy.data.objects["a"].modifiers.new("row", "ARRAY")
        modifier.count, modifier.use_relative_offset, modifier.use_constant_offset = 3, False, True
        modifier.constant_offset_displace = (2, 0, 0)
        points = find_parts(bpy.context, False).parts["a"].world()
        numpy.testing.assert_allclose(points.max(axis=0), (6, 2.4, 3.2), atol=1e-6)

    def test_mirrored_meshes_face_outwards(self):
        bpy.data.objects["a"].scale.x = -1
        bpy.context.view_layer.update()
        for part in find_parts(bpy.context, False).parts.values():
            vertices, triangles = part.mesh()
            corners = vertices[triangles] - vertices.mean(axis=0)
            self.assertGreater(numpy.linalg.det(corners).sum() / 6, 0.01)

    def test_units(self):
        for scale, system, expected in (
            (1.0, "METRIC", ("m", 1.0)),
            (0.001, "METRIC", ("mm", 1.0)),
            (0.01, "IMPERIAL", ("cm", 1.0)),
            (0.0254, "IMPERIAL", ("in", 1.0)),
            (0.5, "METRIC", ("m", 0.5)),
            (0.5, "NONE", (None, 1.0)),
        ):
            empty_scene(scale, system)
            found = units(bpy.context.scene)
            self.assertEqual((found.name, found.factor), expected)

    def test_a_plan_in_metres_moves_in_blender_units(self):
        two_boxes()
        bpy.context.scene.unit_settings.scale_length = 0.5
        home = self.worlds()
        plan = self.plan()
        self.assertEqual(plan.to_dict()["units"], "m")
        parts = find_parts(bpy.context, False).parts
        numpy.testing.assert_allclose(parts["a"].world().min(axis=0), (0.5, 1, 1.5), atol=1e-6)
        self.disassembly.add_keyframes(bpy.context, 5)
        bpy.context.scene.frame_set(1 + 5 * len(plan))
        expected = dict(home)
        for taken in plan.to_dict()["steps"]:
            in_units = rigid(taken["path"][-1])
            in_units[:3, 3] /= 0.5
            for part in taken["parts"]:
                expected[part] = in_units @ expected[part]
        self.assert_worlds(expected)

    def test_what_is_no_part_is_named(self):
        add("ground", bpy.data.meshes.new("nothing"))
        mesh = bpy.data.meshes.new("sheet")
        mesh.from_pydata([(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)], [], [(0, 1, 2, 3)])
        add("sheet", mesh)
        add("letters", bpy.data.curves.new("letters", "FONT"))
        shown = bpy.data.objects.new("shown", None)
        shown.instance_type, shown.instance_collection = "COLLECTION", bpy.data.collections.new("unit")
        bpy.context.scene.collection.objects.link(shown)
        found = find_parts(bpy.context, False)
        self.assertEqual(set(found.parts), {"a", "b"})
        self.assertEqual(
            sorted(line.split(":")[0] + ":" + line.split(":")[1].split(";")[0] for line in found.left_out),
            [
                "ground is left out: it has no faces",
                "letters is left out: it is no mesh",
                "sheet is left out: it is flat",
                "shown is left out: it shows a collection",
            ],
        )

    def test_an_open_mesh_is_named_by_the_planner(self):
        import bmesh

        mesh = bpy.data.objects["a"].data
        built = bmesh.new()
        built.from_mesh(mesh)
        bmesh.ops.delete(built, geom=[built.faces[:][0]], context="FACES_ONLY")
        built.to_mesh(mesh)
        built.free()
        self.plan()
        self.assertTrue(any(note.startswith("a:") for note in self.disassembly.notes), self.disassembly.notes)

    def test_a_child_of_a_part_is_refused(self):
        bpy.data.objects["b"].parent = bpy.data.objects["a"]
        self.refused("b is a child of a, which is a part of its own")

    def test_a_child_that_is_no_part_goes_along(self):
        lamp = bpy.data.objects.new("lamp", bpy.data.lights.new("lamp", "POINT"))
        bpy.context.scene.collection.objects.link(lamp)
        lamp.parent = bpy.data.objects["a"]
        lamp.location = (0, 0, 1)
        home = self.worlds()
        plan = self.plan(base="b")
        self.disassembly.add_keyframes(bpy.context, 5)
        bpy.context.scene.frame_set(1 + 5 * len(plan))
        (taken,) = plan.to_dict()["steps"]
        moved = rigid(taken["path"][-1])
        self.assertEqual(taken["parts"], ["a"])
        self.assert_worlds({"a": moved @ home["a"], "lamp": moved @ home["lamp"], "b": home["b"]})

    def test_what_moves_by_itself_is_refused(self):
        thing = bpy.data.objects["b"]
        constraint = thing.constraints.new("COPY_LOCATION")
        self.refused("b has constraints")
        thing.constraints.remove(constraint)
        thing.driver_add("location", 0)
        self.refused("b has drivers")
        thing.driver_remove("location", 0)
        thing.delta_location.x = 1
        self.refused("b has delta transforms")
        thing.delta_location.x = 0
        modifier = thing.modifiers.new("follow", "BOOLEAN")
        modifier.object = bpy.data.objects["a"]
        self.refused("follows a, which moves: apply the modifier follow")
        thing.modifiers.clear()
        holder = bpy.data.objects.new("holder", None)
        bpy.context.scene.collection.objects.link(holder)
        thing.parent, holder.scale = holder, (1, 2, 1)
        bpy.context.view_layer.update()
        self.refused("b is a child of holder, whose scale is uneven")
        holder.scale = (2, 2, 2)
        bpy.context.view_layer.update()
        self.assertEqual(set(find_parts(bpy.context, False).parts), {"a", "b"})
