"""From a scene to a plan and back: what the buttons do."""

import math
from collections.abc import Callable
from typing import Any

import bpy
import numpy
import sbdp
from sbdp.motion import blockers, matrix

from . import placing
from .parts import find_parts, units

# The last frame of the scene as it was before ours were added to it.
_END = "sbdp_frame_end"


class Disassembly:
    """Plans of one scene, one after the other: only what changed in the scene is sent for the next. It keeps no objects, but
    their names: Blender's undo replaces objects. `connect` makes a client of the daemon; by default it is that of this user,
    started if none runs."""

    def __init__(self, connect: "Callable[[], sbdp.Client] | None" = None) -> None:
        self._connect = connect
        self._live: sbdp.LiveAssembly | None = None
        self._factor = 1.0
        #: The plan that is being made; None if none is.
        self.job: sbdp.PlanJob | None = None
        #: The last plan, how its parts move, and what was sent for it; None before.
        self.plan: sbdp.Plan | None = None
        self.motion: sbdp.Motion | None = None
        self.change: sbdp.Change | None = None
        #: Objects that are no parts, with the reason; what the planner says about the parts; objects that were moved by hand.
        self.notes: list[str] = []

    def begin(self, context: "bpy.types.Context", only_selected: bool = False, **options: Any) -> None:
        """Begins to plan the selected objects as they stand, or all. Keyframes and exploded views are cleared first. Raises
        ValueError where there is nothing to plan, or an object cannot be moved."""
        if self.job is not None:
            raise RuntimeError("a plan is being made: wait for it, or cancel it")
        self.notes = clear(context)
        self.plan = self.motion = None
        unit = units(context.scene)
        parts = find_parts(context, only_selected)
        self.notes += parts.left_out
        if not parts.parts:
            where = "is selected" if only_selected else "is visible"
            raise ValueError("\n".join([f"no mesh object with a volume {where}", *self.notes]))
        if self._live is None or self._live.units != unit.name:
            self._live = sbdp.LiveAssembly(unit.name, name=context.scene.name, connect=self._connect)
        self._factor = unit.factor
        self.job = self._live.plan(parts.parts, **options)

    def finish(self) -> "sbdp.Plan":
        """Takes the plan of the job, waiting for it. Raises what went wrong."""
        job, self.job = self.job, None
        plan = job.result()
        self.plan, self.change = plan, job.change
        self.motion = sbdp.Motion(plan.steps, {name: part.world() for name, part in job.parts.items()})
        for warning in plan.to_dict()["warnings"]:
            self.notes.append(f"{warning['part']}: {warning['message']}" if warning["part"] else warning["message"])
        return plan

    def frames(self, scene: "bpy.types.Scene", step: int, per_step: int) -> tuple[int, int]:
        """The first and the last frame of a step."""
        return scene.frame_start + step * per_step, scene.frame_start + (step + 1) * per_step

    def add_keyframes(self, context: "bpy.types.Context", per_step: int) -> None:
        """Gives the objects of the plan keyframes, from the first frame of the scene on, and the scene as many frames as it
        takes. Raises RuntimeError if there is no plan."""
        self._need_plan()
        clear(context)
        scene, keys = context.scene, {}
        for number, leg in enumerate(self.motion.legs):
            start, _ = self.frames(scene, number, per_step)
            for frame, share in _samples(leg, start, per_step):
                for name, transform in leg.transforms(share).items():
                    keys.setdefault(name, []).append((frame, self._in_scene(transform)))
        for name, found in keys.items():
            thing = self._object(name)
            placing.take(thing)
            placing.key(thing, found)
        last = self.frames(scene, len(self.motion), per_step)[0]
        if last > scene.frame_end:
            scene[_END] = [scene.frame_end, last]
            scene.frame_end = last
        scene.frame_set(scene.frame_current)

    def explode(self, context: "bpy.types.Context") -> None:
        """Moves the objects of the plan along their ways out, just so far that they are apart. Keyframes are cleared. Raises
        RuntimeError if there is no plan."""
        self._need_plan()
        clear(context)
        for name, shift in self.motion.exploded().items():
            if shift.any():
                thing = self._object(name)
                placing.take(thing)
                placing.place(thing, self._in_scene(matrix([*shift, 1, 0, 0, 0])))
        context.view_layer.update()

    def blocking(self) -> dict[str, str]:
        """By part, `captive` or `blocks`: see `sbdp.motion.blockers`. Empty if the plan is complete."""
        return blockers(self.plan.to_dict()) if self.plan is not None else {}

    def close(self) -> None:
        """Ends a running plan, and the connection."""
        if self.job is not None:
            self.job.cancel()
            self.job.join()
            self.job = None
        if self._live is not None:
            self._live.forget()

    def _need_plan(self) -> None:
        if self.motion is None:
            raise RuntimeError("there is no plan yet: plan first")

    def _object(self, name: str) -> "bpy.types.Object":
        for thing in bpy.data.objects:
            if thing.name_full == name:
                return thing
        raise RuntimeError(f"the object {name} is gone: plan again")

    def _in_scene(self, transform: numpy.ndarray) -> numpy.ndarray:
        """From the unit that was sent to Blender's."""
        scaled = transform.copy()
        scaled[:3, 3] /= self._factor
        return scaled


def _samples(leg: "sbdp.motion.Leg", start: int, per_step: int) -> list[tuple[float, float]]:
    """Frames with keyframes of a step, each with its share of the step: those of the waypoints, and where the parts turn all
    frames between, as Blender would interpolate location and rotation each for itself."""
    frames = {float(start): 0.0, float(start + per_step): 1.0}
    for waypoint, share in enumerate(leg.shares):
        at = start + float(share) * per_step
        frames[at] = float(share)
        if leg.turns(waypoint):
            before = start + float(leg.shares[waypoint - 1]) * per_step
            for frame in range(math.floor(before) + 1, math.ceil(at)):
                frames[float(frame)] = (frame - start) / per_step
    return sorted(frames.items())


def clear(context: "bpy.types.Context") -> list[str]:
    """Removes our keyframes and exploded views in all scenes, and puts all objects back; notes about those that were moved by
    hand meanwhile, which stay where they are."""
    edited = placing.put_back(placing.objects(), context.scene.frame_current_final)
    for scene in bpy.data.scenes:
        if _END in scene:
            before, ours = scene[_END]
            if scene.frame_end == ours:
                scene.frame_end = before
            del scene[_END]
    context.scene.frame_set(context.scene.frame_current)
    context.view_layer.update()
    return [f"{name} was moved by hand, and stays there" for name in edited]
