"""Moves objects by keyframes or at once, and puts them back.

What is needed for that is kept with each object, in the custom property `sbdp_home`, so that a saved file can be cleared,
too: location, rotation and action as they were, and, if it was moved at once, to where.
"""

from collections.abc import Iterable

import bpy
import numpy
from mathutils import Quaternion
from sbdp.motion import matrix, pose

from .parts import outer

HOME = "sbdp_home"
_PATHS = {"location": 3, "rotation_quaternion": 4}
_ROTATIONS = ("rotation_euler", "rotation_quaternion", "rotation_axis_angle")
# Share of the distance from the origin, or 1, by which a place may differ from the one that was set, which is rounded to
# single precision. At half, rounding may look like an edit; at ten times as much, nudges are not noticed.
_SAME = 1e-5

Keys = list[tuple[float, numpy.ndarray]]


def objects() -> "list[bpy.types.Object]":
    """Objects that were moved."""
    return [thing for thing in bpy.data.objects if HOME in thing]


def take(thing: "bpy.types.Object") -> None:
    """Remembers where an object is, and frees it from its action."""
    if HOME in thing:
        raise RuntimeError(f"{thing.name} is moved already")
    home = {"rotation_mode": thing.rotation_mode, "location": list(thing.location), "action": "", "kept": False}
    home |= {name: list(getattr(thing, name)) for name in _ROTATIONS}
    data = thing.animation_data
    if data is not None and data.action is not None:
        home |= {"action": data.action.name, "kept": data.action.use_fake_user}
        # An action that no object has is not saved.
        data.action.use_fake_user = True
        data.action = None
    turn = _quaternion(thing)
    thing[HOME] = {**home, "turn": turn.tolist()}
    thing.rotation_mode = "QUATERNION"
    thing.rotation_quaternion = turn


def place(thing: "bpy.types.Object", transform: numpy.ndarray) -> None:
    """Moves an object at once, by a rigid transform in the frame of the scene, from where it was taken."""
    location, turn = _basis(thing, transform)
    thing.location, thing.rotation_quaternion = location, turn
    thing[HOME]["shown"] = [*thing.location, *thing.rotation_quaternion]


def key(thing: "bpy.types.Object", keys: Keys) -> None:
    """Gives an object keyframes: (frame, rigid transform in the frame of the scene from where it was taken), in order. In
    between, the location is interpolated along a line."""
    frames, values = [], []
    for frame, transform in keys:
        location, turn = _basis(thing, transform)
        # Quaternions of both signs are the same rotation; interpolated, they must be on one side.
        if values and numpy.dot(values[-1][3:], turn) < 0:
            turn = -turn
        frames.append(frame)
        values.append([*location, *turn])
    action = bpy.data.actions.new(f"Disassembly {thing.name}")
    (thing.animation_data or thing.animation_data_create()).action = action
    column = 0
    for path, count in _PATHS.items():
        for index in range(count):
            curve = action.fcurves.new(path, index=index, action_group="Disassembly")
            curve.keyframe_points.add(len(frames))
            curve.keyframe_points.foreach_set("co", numpy.column_stack([frames, [v[column] for v in values]]).ravel())
            for point in curve.keyframe_points:
                point.interpolation = "LINEAR"
            curve.update()
            column += 1
    thing[HOME]["keyed"] = action.name


def put_back(things: "Iterable[bpy.types.Object]", frame: float) -> list[str]:
    """Removes our keyframes, and puts objects back to where they were. One that somebody moved meanwhile stays where it is
    now, at the frame `frame`; their names."""
    edited = []
    for thing in list(things):
        home = thing[HOME].to_dict()
        now = [*thing.location, *_quaternion(thing)]
        moved = not _same(now, _expected(thing, home, frame))
        _remove_keys(thing, home)
        thing.rotation_mode = home["rotation_mode"]
        for name in _ROTATIONS:
            setattr(thing, name, home[name])
        thing.location = home["location"]
        if moved:
            edited.append(thing.name)
            thing.location = now[:3]
            _turn(thing, now[3:])
        action = bpy.data.actions.get(home["action"]) if home["action"] else None
        if action is not None:
            action.use_fake_user = home["kept"]
            # Where somebody keyed something else meanwhile, that stays.
            if thing.animation_data.action is None:
                thing.animation_data.action = action
        del thing[HOME]
    return edited


def _remove_keys(thing, home: dict) -> None:
    action = bpy.data.actions.get(home.get("keyed", ""))
    if action is None:
        return
    for curve in list(action.fcurves):
        if curve.data_path in _PATHS:
            action.fcurves.remove(curve)
    # Whatever somebody else keyed in it stays.
    if not action.fcurves:
        if thing.animation_data is not None and thing.animation_data.action == action:
            thing.animation_data.action = None
        if action.users == 0:
            bpy.data.actions.remove(action)


def _expected(thing, home: dict, frame: float) -> list[float] | None:
    """Where an object is if nobody else moved it."""
    if "shown" in home:
        return home["shown"]
    action = bpy.data.actions.get(home.get("keyed", ""))
    if action is None:
        return None
    curves = [action.fcurves.find(path, index=index) for path, count in _PATHS.items() for index in range(count)]
    return None if None in curves else [curve.evaluate(frame) for curve in curves]


def _same(now: list[float], expected: list[float] | None) -> bool:
    if expected is None:
        return True
    now, expected = numpy.array(now), numpy.array(expected)
    far = numpy.abs(now[:3] - expected[:3]).max() / max(1.0, numpy.abs(expected[:3]).max())
    here, there = now[3:] / numpy.linalg.norm(now[3:]), expected[3:] / numpy.linalg.norm(expected[3:])
    turned = min(numpy.abs(here - there).max(), numpy.abs(here + there).max())
    return bool(max(far, turned) <= _SAME)


def _quaternion(thing) -> numpy.ndarray:
    if thing.rotation_mode == "QUATERNION":
        turn = thing.rotation_quaternion.normalized()
    elif thing.rotation_mode == "AXIS_ANGLE":
        angle, *axis = thing.rotation_axis_angle
        turn = Quaternion(axis, angle)
    else:
        turn = thing.rotation_euler.to_quaternion()
    return numpy.array(turn)


def _turn(thing, quaternion: numpy.ndarray) -> None:
    """Sets the rotation in whatever way the object has it."""
    turn = Quaternion(quaternion)
    if thing.rotation_mode == "QUATERNION":
        thing.rotation_quaternion = turn
    elif thing.rotation_mode == "AXIS_ANGLE":
        axis, angle = turn.to_axis_angle()
        thing.rotation_axis_angle = (angle, *axis)
    else:
        thing.rotation_euler = turn.to_euler(thing.rotation_mode, thing.rotation_euler)


def _basis(thing, transform: numpy.ndarray) -> tuple[numpy.ndarray, numpy.ndarray]:
    """Location and rotation of an object that a rigid transform brings from where it was taken. They are left of its scale,
    which stays as it is, mirrored or not."""
    home = thing[HOME]
    around = outer(thing)
    inner = numpy.linalg.inv(around) @ transform @ around
    placed = pose(inner @ matrix([*home["location"], *home["turn"]]))
    return placed[:3], placed[3:]
