"""Objects of a scene as parts: which ones, where they stand, and their meshes as the modifiers leave them."""

from dataclasses import dataclass, field

import bpy
import numpy
from sbdp import LivePart

# Metres by the name of the unit.
_UNITS = {"mm": 1e-3, "cm": 1e-2, "m": 1.0, "in": 0.0254, "ft": 0.3048}
# Blender has the scale in single precision.
_CLOSE = 1e-6
# Properties of modifiers that name another object.
_OTHERS = ("object", "target", "auxiliary_target", "mirror_object", "offset_object", "start_position_object", "origin")


@dataclass(frozen=True)
class Units:
    """The unit that lengths are sent in, if the scene has one, and how many of it a Blender unit is."""

    name: str | None
    factor: float


@dataclass
class Parts:
    """Parts by the full names of their objects, and what was left out with the reason."""

    parts: dict[str, LivePart] = field(default_factory=dict)
    left_out: list[str] = field(default_factory=list)


def units(scene: "bpy.types.Scene") -> Units:
    """Of a scene. Its unit scale says how many metres a Blender unit is; where that is no usual unit, metres are sent."""
    settings = scene.unit_settings
    if settings.system == "NONE":
        return Units(None, 1.0)
    scale = settings.scale_length
    for name, metres in _UNITS.items():
        if abs(scale / metres - 1) < _CLOSE:
            return Units(name, 1.0)
    return Units("m", scale)


def find_parts(context: "bpy.types.Context", only_selected: bool) -> Parts:
    """The visible mesh objects of the view layer, or the selected ones of these. Raises ValueError, with a line for each,
    where one cannot be moved as the plan will have it."""
    result, found = Parts(), []
    for thing in context.view_layer.objects:
        if not thing.visible_get() or only_selected and not thing.select_get():
            continue
        if thing.type == "MESH":
            found.append(thing)
        elif thing.type == "EMPTY" and thing.instance_type == "COLLECTION":
            result.left_out.append(f"{thing.name} is left out: it shows a collection; use Object > Apply > Make Instances Real")
        elif thing.type in ("CURVE", "SURFACE", "META", "FONT", "CURVES"):
            result.left_out.append(f"{thing.name} is left out: it is no mesh; use Object > Convert > Mesh")
    depsgraph = context.evaluated_depsgraph_get()
    scale = numpy.diag([units(context.scene).factor] * 3 + [1.0])
    for thing in found:
        vertices, triangles = _mesh(thing.evaluated_get(depsgraph))
        if not len(triangles):
            result.left_out.append(f"{thing.name} is left out: it has no faces")
        elif _is_flat(vertices):
            result.left_out.append(f"{thing.name} is left out: it is flat")
        else:
            result.parts[thing.name_full] = LivePart(vertices, triangles, scale @ numpy.array(thing.matrix_world))
    moving = [thing for thing in found if thing.name_full in result.parts]
    refused = [reason for thing in moving for reason in _refusals(thing, result.parts)]
    if refused:
        raise ValueError("\n".join(refused))
    return result


def _mesh(evaluated: "bpy.types.Object") -> tuple[numpy.ndarray, numpy.ndarray]:
    mesh = evaluated.to_mesh()
    try:
        mesh.calc_loop_triangles()
        vertices = numpy.empty(3 * len(mesh.vertices), dtype=numpy.float32)
        mesh.vertices.foreach_get("co", vertices)
        triangles = numpy.empty(3 * len(mesh.loop_triangles), dtype=numpy.int32)
        mesh.loop_triangles.foreach_get("vertices", triangles)
        return vertices.reshape(-1, 3), triangles.reshape(-1, 3).astype(numpy.uint32)
    finally:
        evaluated.to_mesh_clear()


def _is_flat(vertices: numpy.ndarray) -> bool:
    extents = numpy.linalg.svd(vertices.astype(float) - vertices.mean(axis=0), compute_uv=False)
    return bool(extents[2] <= _CLOSE * extents[0])


def _refusals(thing: "bpy.types.Object", parts: dict) -> list[str]:
    """Why an object cannot be moved as a plan will have it, where it cannot."""
    reasons = []
    if thing.library is not None:
        reasons.append("is linked from a library: make it local (Object > Relations > Make Local)")
    if any(not constraint.mute for constraint in thing.constraints):
        reasons.append("has constraints: apply them, or mute them")
    if thing.rigid_body is not None:
        reasons.append("has a rigid body, which moves it: remove that")
    drivers = thing.animation_data.drivers if thing.animation_data else ()
    if any(driver.data_path.startswith(("location", "rotation", "scale")) for driver in drivers):
        reasons.append("has drivers of its place: remove them")
    turned = any(thing.delta_rotation_euler) or tuple(thing.delta_rotation_quaternion) != (1, 0, 0, 0)
    if any(thing.delta_location) or turned:
        reasons.append("has delta transforms: set delta location and delta rotation to 0")
    for modifier in thing.modifiers:
        others = {getattr(modifier, name, None) for name in _OTHERS} - {None, thing}
        moving = sorted(other.name for other in others if other.name_full in parts)
        if moving:
            reasons.append(f"has a modifier that follows {', '.join(moving)}, which moves: apply the modifier {modifier.name}")
    reasons += _parent_refusals(thing, parts)
    return [f"{thing.name} {reason}" for reason in reasons]


def _parent_refusals(thing: "bpy.types.Object", parts: dict) -> list[str]:
    if thing.parent is None:
        return []
    if thing.parent_type != "OBJECT":
        return [f"is a child of a bone or a vertex of {thing.parent.name}: use Object > Parent > Clear and Keep Transformation"]
    parent = thing.parent
    while parent is not None:
        if parent.name_full in parts:
            keep = "use Object > Parent > Clear and Keep Transformation, or join both"
            return [f"is a child of {parent.name}, which is a part of its own: {keep}"]
        data = parent.animation_data
        if data and (data.action or data.drivers or data.nla_tracks) or any(not c.mute for c in parent.constraints):
            return [f"is a child of {parent.name}, which moves by itself: use Object > Parent > Clear and Keep Transformation"]
        parent = parent.parent
    if not is_even(outer(thing)):
        return [f"is a child of {thing.parent.name}, whose scale is uneven: apply its scale (Object > Apply > Scale)"]
    return []


def outer(thing: "bpy.types.Object") -> numpy.ndarray:
    """The matrix from the frame that location and rotation of an object are in to that of the scene."""
    if thing.parent is None:
        return numpy.eye(4)
    return numpy.array(thing.parent.matrix_world) @ numpy.array(thing.matrix_parent_inverse)


def is_even(matrix: numpy.ndarray) -> bool:
    """Whether a matrix scales all directions alike; it may mirror."""
    square = matrix[:3, :3] @ matrix[:3, :3].T
    scale = numpy.trace(square) / 3
    return bool(scale > 0 and numpy.abs(square / scale - numpy.eye(3)).max() < 10 * _CLOSE)
