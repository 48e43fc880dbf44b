"""Meshes of callers, as arrays that are uploaded without a copy."""

from collections.abc import Iterable, Mapping
from typing import Any

import numpy

from . import _native

_LARGEST = numpy.iinfo(numpy.uint32).max


def _vertices(name, given):
    array = numpy.asarray(given)
    if array.dtype not in (numpy.float32, numpy.float64):
        if array.dtype.kind not in "fiu":
            raise ValueError(f"vertices of part `{name}`: numbers are wanted, not {array.dtype}")
        array = array.astype(numpy.float64)
    return numpy.require(array, array.dtype.newbyteorder("="), ["C", "A"])


def _triangles(name, given):
    array = numpy.asarray(given)
    if array.dtype != numpy.uint32:
        if array.dtype.kind not in "iu":
            raise ValueError(f"triangles of part `{name}`: whole numbers are wanted, not {array.dtype}")
        if array.size and (array.min() < 0 or array.max() > _LARGEST):
            raise ValueError(f"triangles of part `{name}`: an index is below 0 or above {_LARGEST}")
        array = array.astype(numpy.uint32)
    return numpy.require(array, array.dtype.newbyteorder("="), ["C", "A"])


def _part(name, mesh):
    if hasattr(mesh, "vertices") and hasattr(mesh, "faces"):
        mesh = (mesh.vertices, mesh.faces)
    vertices, triangles = mesh
    return name, _vertices(name, vertices), _triangles(name, triangles)


def assembly(
    parts: Mapping[str, Any] | Any, *, units: str | None = None, name: str = "", fixed: Iterable[str] = ()
) -> _native.Assembly:
    """An assembly of meshes, given at their assembled poses.

    `parts` are meshes by name: each `(vertices, triangles)`, of shapes (n, 3) and (m, 3), or an object with `vertices` and
    `faces`, as `trimesh.Trimesh`; or a `trimesh.Scene`. `units` is the unit of length, if known, as "mm". `fixed` are names
    of parts that may not move.

    Arrays of float64 or float32 and of uint32, contiguous and aligned, are not copied: they are read when they are
    uploaded, and must not be changed. Others are converted. Raises ValueError for arrays of other shapes, and
    `NoSuchPartError` for a fixed part that is not there.
    """
    if hasattr(parts, "geometry") and hasattr(parts, "graph"):
        parts = _of_scene(parts)
    if not isinstance(parts, Mapping):
        raise TypeError("parts: meshes by name are wanted, as {'bolt': (vertices, triangles)}")
    made = [_part(part, mesh) for part, mesh in parts.items()]
    return _native.Assembly(made, units, name, list(fixed))


def _of_scene(scene):
    meshes = {}
    for node in scene.graph.nodes_geometry:
        transform, geometry = scene.graph[node]
        mesh = scene.geometry[geometry].copy()
        mesh.apply_transform(transform)
        meshes[node] = mesh
    return meshes


def to_trimesh(assembly: _native.Assembly, part: str) -> Any:
    """A part of an assembly as `trimesh.Trimesh`. Needs the package trimesh."""
    import trimesh

    vertices, triangles = assembly.mesh(part)
    return trimesh.Trimesh(vertices, triangles, process=False)
