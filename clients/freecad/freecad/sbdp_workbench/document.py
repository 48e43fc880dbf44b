"""Parts of a FreeCAD document: which objects they are, where they stand, and their meshes. Lengths are in mm.

A part is an object that can be moved by a placement of its own: a shape, a body of PartDesign, a mesh, a link, or an element
of a link array. Parts are found in App::Part, groups and link groups, however deep. A link is one part, also where it shows
several bodies: these have no placements of their own there.
"""

from collections import Counter
from dataclasses import dataclass, field

import FreeCAD
import numpy
import Part
from sbdp import LivePart

#: How far triangles may be from the surfaces, in mm; as of STEP files.
DEFLECTION = 0.01

# Properties of features that name what they are made of, as the operands of a cut. Others, as the support of an attachment or
# the edge that gives a direction, leave their object as it is.
_OPERANDS = ("Base", "Tool", "Tools", "Shapes", "Links", "Source", "Faces", "Sections", "Objects", "Group")
# Features that show a copy of their object, which stays a part.
_COPIES = ("Part::Mirroring", "PartDesign::SubShapeBinder", "PartDesign::ShapeBinder", "Part::Part2DObject", "PartDesign::Body")


@dataclass
class PartObject:
    """A part as the document has it."""

    name: str
    #: The object whose placement moves it, and in a link array the number of the element.
    object: "FreeCAD.DocumentObject"
    element: int | None
    #: The placement of what it is in.
    outer: "FreeCAD.Placement"
    #: The labels of the containers that it is in, and its own; the internal names.
    labels: tuple[str, ...] = ()
    path: tuple[str, ...] = ()

    @property
    def placement(self) -> "FreeCAD.Placement":
        """Where it stands in its container."""
        return self.object.Placement if self.element is None else self.object.PlacementList[self.element]

    @placement.setter
    def placement(self, placement: "FreeCAD.Placement") -> None:
        if self.element is None:
            self.object.Placement = placement
        else:
            self.object.PlacementList = {self.element: placement}

    @property
    def key(self) -> tuple[str, int | None]:
        """What no two parts of a document share."""
        return self.object.Name, self.element


@dataclass
class Parts:
    """The parts of a document, and what was left out with the reason."""

    parts: dict[str, PartObject] = field(default_factory=dict)
    left_out: list[str] = field(default_factory=list)


def find_parts(document: "FreeCAD.Document", selection: "list[tuple[str, ...]] | None" = None) -> Parts:
    """The visible parts of a document. `selection` has paths of internal names, from an object of the document itself down:
    only parts below (or around) one of these are taken."""
    consumed, found, result = _consumed(document), [], Parts()
    for child in _roots(document):
        _descend(child, FreeCAD.Placement(), (), (), consumed, found, result.left_out)
    if selection is not None:
        found = [part for part in found if any(_meet(part.path, path) for path in selection)]
    _name(found)
    result.parts = {part.name: part for part in found}
    return result


def _meet(one: tuple[str, ...], other: tuple[str, ...]) -> bool:
    shared = min(len(one), len(other))
    return shared > 0 and one[:shared] == other[:shared]


def _children(thing: "FreeCAD.DocumentObject") -> "list[FreeCAD.DocumentObject] | None":
    """What a container holds; None if it is none."""
    if thing.isDerivedFrom("App::Part") or thing.hasExtension("App::GroupExtension") and not _is_body(thing):
        return list(thing.Group)
    if thing.isDerivedFrom("App::LinkGroup"):
        return list(thing.ElementList)
    return None


def _is_body(thing: "FreeCAD.DocumentObject") -> bool:
    return thing.isDerivedFrom("PartDesign::Body")


def _roots(document: "FreeCAD.Document") -> "list[FreeCAD.DocumentObject]":
    inside = set()
    for thing in document.Objects:
        held = _children(thing) or (list(thing.Group) if _is_body(thing) else None)
        if held is None and thing.isDerivedFrom("App::Link"):
            held = list(thing.ElementList)
        inside.update(child.Name for child in held or () if child is not None)
    return [thing for thing in document.Objects if thing.Name not in inside]


def _consumed(document: "FreeCAD.Document") -> set[str]:
    """Objects that others are made of: the result is the part."""
    names = set()
    for thing in document.Objects:
        if not thing.isDerivedFrom("Part::Feature") or any(map(thing.isDerivedFrom, _COPIES)) or _is_draft(thing):
            continue
        for value in (getattr(thing, name) for name in _OPERANDS if name in thing.PropertiesList):
            for item in value if isinstance(value, list) else [value]:
                item = item[0] if isinstance(item, tuple) and item else item
                if isinstance(item, FreeCAD.DocumentObject):
                    names.add(item.Name)
    return names


def _is_draft(thing: "FreeCAD.DocumentObject") -> bool:
    """Clones and arrays, which hide their object where it is no part."""
    return type(getattr(thing, "Proxy", None)).__module__.startswith("draftobjects")


def _descend(thing, outer, labels, path, consumed, found, left_out) -> None:
    if not thing.Visibility or thing.Name in consumed:
        return
    labels, path = (*labels, thing.Label), (*path, thing.Name)
    children = _children(thing)
    if children is not None:
        inner = outer * thing.Placement if hasattr(thing, "Placement") else outer
        for child in children:
            if child is not None:
                _descend(child, inner, labels, path, consumed, found, left_out)
    elif thing.isDerivedFrom("App::Link") and thing.ElementCount > 0:
        inner = outer * thing.Placement
        if thing.ShowElement:
            for child in thing.ElementList:
                _descend(child, inner, labels, path, consumed, found, left_out)
        else:
            for number in range(thing.ElementCount):
                own = (*labels[:-1], f"{thing.Label} {number + 1}")
                found.append(PartObject(own[-1], thing, number, inner, own, (*path, str(number))))
    elif hasattr(thing, "Placement"):
        reason = _why_not(thing)
        if reason is None:
            found.append(PartObject(thing.Label, thing, None, outer, labels, path))
        elif reason:
            left_out.append(f"{thing.Label} is left out: {reason}")


def _why_not(thing) -> str | None:
    """Why an object is no part; empty where nobody would take it for one; None if it is one."""
    if thing.isDerivedFrom("Mesh::Feature"):
        return None if thing.Mesh.CountFacets else "the mesh has no triangles"
    if thing.isDerivedFrom("App::Origin") or thing.isDerivedFrom("App::OriginFeature"):
        return ""
    linked = thing.getLinkedObject(True)
    if linked is not None and linked.Name != thing.Name and linked.isDerivedFrom("Mesh::Feature"):
        return "links to meshes are not read; copy the mesh"
    shape = Part.getShape(thing)
    if shape.isNull() or not shape.Faces:
        # Sketches, axes, lights.
        return ""
    return None if shape.Solids else "it is a surface without volume"


def _name(found: list[PartObject]) -> None:
    """Gives each part a name of its own: its label, with those of the containers where labels are equal, at last with the
    internal name."""
    for depth in range(1, max((len(part.labels) for part in found), default=0) + 1):
        twice = Counter(part.name for part in found)
        for part in found:
            if twice[part.name] > 1:
                part.name = "/".join(part.labels[-depth:])
    twice = Counter(part.name for part in found)
    for part in found:
        if twice[part.name] > 1:
            part.name = f"{part.name} ({part.path[-1]})"


class Tessellation:
    """Meshes of parts at a deflection in mm. Shapes that did not change are not meshed again."""

    def __init__(self, deflection: float = DEFLECTION) -> None:
        self.deflection = deflection
        self._known: dict[tuple[str, int | None], tuple] = {}

    def live_parts(self, parts: Parts) -> dict[str, LivePart]:
        """The parts with their meshes and places. Raises ValueError where an object has no mesh, by name."""
        return {name: self._live(part) for name, part in parts.parts.items()}

    def _live(self, part: PartObject) -> LivePart:
        placement = part.outer * part.placement
        vertices, triangles = self._mesh(part)
        if not len(triangles):
            raise ValueError(f"`{part.name}` gives no triangles: check its geometry (Part > Check Geometry)")
        return LivePart(vertices, triangles, as_matrix(placement))

    def _mesh(self, part: PartObject) -> tuple[numpy.ndarray, numpy.ndarray]:
        if part.object.isDerivedFrom("Mesh::Feature"):
            mesh = part.object.Mesh.copy()
            mesh.Placement = FreeCAD.Placement()
            points, facets = mesh.Topology
            return _arrays(points, facets)
        shape = _own_shape(part)
        known = self._known.get(part.key)
        if known and known[0].isPartner(shape) and known[0].Placement == shape.Placement and known[1] == self.deflection:
            return known[2]
        # Without the triangles that the view made, which follow other settings.
        mesh = _arrays(*shape.copy(True, False).tessellate(self.deflection))
        self._known[part.key] = shape, self.deflection, mesh
        return mesh


def _own_shape(part: PartObject) -> "Part.Shape":
    """The shape of a part in its own frame: without its placement, with those of what it links to."""
    if part.element is None:
        return Part.getShape(part.object, transform=False)
    moved = Part.getShape(part.object, f"{part.element}.", transform=False)
    moved.Placement = part.placement.inverse() * moved.Placement
    return moved


def _arrays(points, facets) -> tuple[numpy.ndarray, numpy.ndarray]:
    vertices = numpy.array([(p.x, p.y, p.z) for p in points], dtype=float).reshape(-1, 3)
    return vertices, numpy.array(facets, dtype=numpy.uint32).reshape(-1, 3)


def as_matrix(placement: "FreeCAD.Placement") -> numpy.ndarray:
    """A placement as a 4 × 4 matrix."""
    return numpy.array(placement.Matrix.A, dtype=float).reshape(4, 4)


def as_placement(pose) -> "FreeCAD.Placement":
    """The placement of a pose [x, y, z, qw, qx, qy, qz]."""
    x, y, z, w, i, j, k = map(float, pose)
    return FreeCAD.Placement(FreeCAD.Vector(x, y, z), FreeCAD.Rotation(i, j, k, w))
