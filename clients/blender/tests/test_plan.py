"""A scene of eight objects: planned, edited, planned again; the keyframes are what the plan says."""

import json

import bmesh
import bpy
import numpy
from support import Scene, add, box_mesh, empty_scene, mesh_of, rigid

from sbdp_disassembly.placing import HOME

FRAMES = 10


class EightParts(Scene):
    def keyed(self):
        plan = self.plan()
        self.disassembly.add_keyframes(bpy.context, FRAMES)
        return plan

    def in_the_end(self, plan, home):
        now = dict(home)
        for step in plan.to_dict()["steps"]:
            self.assertIsNone(step["of"])
            for part in step["parts"]:
                now[part] = rigid(step["path"][-1]) @ now[part]
        return now

    def snapshot(self):
        """All that a motion may change."""
        bpy.context.view_layer.update()
        found = {}
        for thing in bpy.data.objects:
            action = thing.animation_data.action.name if thing.animation_data and thing.animation_data.action else None
            values = [list(getattr(thing, f"rotation_{kind}")) for kind in ("euler", "quaternion", "axis_angle")]
            keys = sorted(key for key in thing.keys() if key.startswith("sbdp"))
            found[thing.name] = [list(thing.location), thing.rotation_mode, values, list(thing.scale), action, keys]
        return json.dumps([found, bpy.context.scene.frame_end, sorted(action.name for action in bpy.data.actions)])

    def test_the_end_of_the_animation_is_that_of_the_plan(self):
        home = self.worlds()
        plan = self.keyed()
        self.assertEqual(plan.status, "complete", plan.reason)
        self.assertEqual((len(plan.parts), len(plan)), (8, 7))
        self.assertEqual(plan.to_dict()["units"], "cm")
        scene = bpy.context.scene
        scene.frame_set(scene.frame_start + FRAMES * len(plan))
        self.assert_worlds(self.in_the_end(plan, home))
        scene.frame_set(scene.frame_start)
        self.assert_worlds(home)

    def test_a_moved_bolt_is_planned_from_where_it_stands(self):
        first = self.keyed()
        self.assertTrue(self.disassembly.change.whole)
        bpy.ops.sbdp.clear()
        bolt = bpy.data.objects["bolt 3"]
        bolt.location.z += 0.3
        bolt.rotation_axis_angle[0] += 1
        home = self.worlds()
        second = self.keyed()
        self.assertEqual(self.disassembly.change.moved, ("bolt 3",))
        self.assertFalse(self.disassembly.change.whole or self.disassembly.change.replaced)
        self.assertIn("bolt 3", second.to_dict()["initial"]["poses"])
        bpy.context.scene.frame_set(bpy.context.scene.frame_start + FRAMES * len(second))
        self.assert_worlds(self.in_the_end(second, home))
        ways = [plan.steps_of("bolt 3")[0].path[-1][2] for plan in (first, second)]
        self.assertAlmostEqual(ways[0] - ways[1], 0.3, delta=0.05)

    def test_a_bolt_that_is_moved_while_it_has_keyframes_stays_there(self):
        self.keyed()
        bpy.context.scene.frame_set(1)
        bpy.data.objects["bolt 2"].location.z += 0.25
        home = self.worlds()
        self.keyed()
        self.assertEqual(self.disassembly.change.moved, ("bolt 2",))
        self.assertIn("bolt 2 was moved by hand, and stays there", self.disassembly.notes)
        bpy.ops.sbdp.clear()
        self.assert_worlds(home)

    def test_a_changed_mesh_alone_is_sent(self):
        self.plan()
        pin = bpy.data.objects["pin"]
        pin.scale = (1, 1, 0.9)
        pin.location.z = 0.03
        self.plan()
        self.assertEqual(self.disassembly.change.replaced, ("pin",))
        self.assertFalse(self.disassembly.change.whole or self.disassembly.change.moved)
        self.plan()
        self.assertEqual(str(self.disassembly.change), "nothing had changed, nothing was sent")

    def test_clear_restores_exactly(self):
        before = self.snapshot()
        plan = self.keyed()
        self.assertNotEqual(self.snapshot(), before)
        bpy.context.scene.frame_set(1 + 5 * len(plan))
        bpy.ops.sbdp.clear()
        self.assertEqual(self.snapshot(), before)
        self.disassembly.explode(bpy.context)
        self.assertNotEqual(self.snapshot(), before)
        bpy.ops.sbdp.clear()
        self.assertEqual(self.snapshot(), before)

    def test_clear_removes_only_our_keyframes(self):
        pin, bolt = bpy.data.objects["pin"], bpy.data.objects["bolt 1"]
        pin.keyframe_insert("location", frame=1)
        pin.keyframe_insert("scale", frame=5)
        plan = self.keyed()
        bolt.keyframe_insert("hide_render", frame=3)
        bpy.context.scene.frame_set(1 + FRAMES * len(plan))
        bpy.ops.sbdp.clear()
        paths = {curve.data_path for curve in pin.animation_data.action.fcurves}
        self.assertEqual(paths, {"location", "scale"})
        self.assertEqual([curve.data_path for curve in bolt.animation_data.action.fcurves], ["hide_render"])
        self.assertFalse(pin.animation_data.action.use_fake_user)

    def test_a_saved_file_can_be_cleared(self):
        import tempfile

        home = self.worlds()
        plan = self.keyed()
        bpy.context.scene.frame_set(1 + FRAMES * len(plan))
        with tempfile.TemporaryDirectory() as folder:
            bpy.ops.wm.save_as_mainfile(filepath=f"{folder}/saved.blend")
            bpy.ops.wm.open_mainfile(filepath=f"{folder}/saved.blend")
        self.assertTrue(any(HOME in thing for thing in bpy.data.objects))
        bpy.ops.sbdp.clear()
        self.assert_worlds(home)

    def test_exploded_boxes_are_apart(self):
        self.plan()
        home = self.worlds()
        self.disassembly.explode(bpy.context)
        boxes = {}
        for name, world in self.worlds().items():
            mesh = bpy.data.objects[name].evaluated_get(bpy.context.evaluated_depsgraph_get()).data
            points = numpy.array([v.co for v in mesh.vertices]) @ world[:3, :3].T + world[:3, 3]
            boxes[name] = points.min(axis=0), points.max(axis=0)
        names = list(boxes)
        for i, one in enumerate(names):
            for other in names[:i]:
                apart = (boxes[one][0] > boxes[other][1]) | (boxes[other][0] > boxes[one][1])
                self.assertTrue(apart.any(), (one, other))
        bpy.ops.sbdp.clear()
        self.assert_worlds(home)

    def test_the_buttons(self):
        home = self.worlds()
        bpy.context.scene.sbdp.frames_per_step = FRAMES
        self.assertEqual(bpy.ops.sbdp.plan(), {"FINISHED"})
        plan = self.disassembly.plan
        bpy.context.scene.frame_set(1 + FRAMES * len(plan))
        self.assert_worlds(self.in_the_end(plan, home))
        self.assertEqual(bpy.ops.sbdp.explode(), {"FINISHED"})
        self.assertEqual(bpy.ops.sbdp.keyframes(), {"FINISHED"})
        self.assert_worlds(self.in_the_end(plan, home))
        self.assertEqual(bpy.ops.sbdp.clear(), {"FINISHED"})
        self.assert_worlds(home)
        # Nothing is to be selected.
        self.assertFalse(bpy.ops.sbdp.select_blocking.poll())

    def test_selected_objects_alone(self):
        for name in ("plate", "bolt 1"):
            bpy.data.objects[name].select_set(True)
        self.assertEqual(set(self.plan(True).parts), {"plate", "bolt 1"})


class Captive(Scene):
    @staticmethod
    def make():
        empty_scene()
        hollow = box_mesh("box", (0, 0, 0), (3, 3, 3))
        add("box", hollow)
        inner = add("inner", box_mesh("inner", (0.5, 0.5, 0.5), (2.5, 2.5, 2.5)))
        modifier = bpy.data.objects["box"].modifiers.new("void", "BOOLEAN")
        modifier.object, modifier.solver = inner, "EXACT"
        inner.hide_set(True)
        add(
            "ball",
            mesh_of("ball", lambda built: bmesh.ops.create_icosphere(built, subdivisions=2, radius=0.6)),
            (1.5, 1.5, 1.5),
        )
        add("lid", box_mesh("lid", (0, 0, 3), (3, 3, 3.2)))

    def test_what_blocks_is_selected(self):
        self.assertEqual(self.plan().status, "infeasible")
        self.assertEqual(self.disassembly.blocking(), {"ball": "captive", "box": "captive"})
        bpy.ops.sbdp.select_blocking()
        self.assertEqual({thing.name for thing in bpy.context.selected_objects}, {"ball", "box"})


class Errors(Scene):
    def test_a_daemon_that_is_gone(self):
        import sbdp

        from sbdp_disassembly.disassembly import Disassembly

        gone = Disassembly(lambda: sbdp.connect("/nonexistent/sbdp"))
        gone.begin(bpy.context)
        with self.assertRaisesRegex(sbdp.Error, "daemon"):
            gone.finish()
        # The buttons say it.
        from sbdp_disassembly import operators

        operators._disassemblies[bpy.context.scene.name_full] = gone
        with self.assertRaisesRegex(RuntimeError, "daemon"):
            bpy.ops.sbdp.plan()

    def test_nothing_to_plan(self):
        empty_scene()
        with self.assertRaisesRegex(ValueError, "no mesh object with a volume is visible"):
            self.disassembly.begin(bpy.context)
