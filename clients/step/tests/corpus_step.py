"""Writes assemblies of the shared corpus as STEP: every triangle of a mesh a plane face, equal parts one product.

`python corpus_step.py CORPUS FOLDER ID…` writes FOLDER/ID.step and FOLDER/expected.json, as `make_step.py` does. The meshes
stay where they are: nothing of the corpus is in the project.
"""

import json
import sys
from dataclasses import asdict
from pathlib import Path

import numpy
from OCP.BRepBuilderAPI import BRepBuilderAPI_MakeFace, BRepBuilderAPI_MakePolygon, BRepBuilderAPI_MakeSolid, BRepBuilderAPI_Sewing
from OCP.BRepGProp import BRepGProp
from OCP.GProp import GProp_GProps
from OCP.TopAbs import TopAbs_SHELL
from OCP.TopExp import TopExp_Explorer
from OCP.TopoDS import TopoDS
from OCP.gp import gp_Pnt, gp_Trsf

from make_step import Body, Document, Expected

# mm: coordinates in the corpus have five digits after the point.
SAME = 1e-4


def read_obj(file):
    vertices, triangles = [], []
    for line in file.read_text().splitlines():
        words = line.split()
        if words[:1] == ["v"]:
            vertices.append([float(x) for x in words[1:4]])
        elif words[:1] == ["f"]:
            triangles.append([int(x.split("/")[0]) - 1 for x in words[1:4]])
    return numpy.array(vertices), numpy.array(triangles)


def volume_and_centroid(vertices, triangles):
    corners = vertices[triangles] - vertices.mean(axis=0)
    volumes = numpy.einsum("ij,ij->i", corners[:, 0], numpy.cross(corners[:, 1], corners[:, 2])) / 6
    centroid = (corners.sum(axis=1) / 4 * volumes[:, None]).sum(axis=0) / volumes.sum() + vertices.mean(axis=0)
    return float(volumes.sum()), [float(x) for x in centroid]


def solid(vertices, triangles):
    points = [gp_Pnt(*v) for v in vertices.tolist()]
    sewing = BRepBuilderAPI_Sewing(1e-6)
    for a, b, c in triangles.tolist():
        wire = BRepBuilderAPI_MakePolygon(points[a], points[b], points[c], True)
        face = BRepBuilderAPI_MakeFace(wire.Wire(), True)
        if face.IsDone():
            sewing.Add(face.Face())
    sewing.Perform()
    explorer = TopExp_Explorer(sewing.SewedShape(), TopAbs_SHELL)
    shells = []
    while explorer.More():
        shells.append(TopoDS.Shell(explorer.Current()))
        explorer.Next()
    # Sewing may turn a surface inside out.
    made = with_shells(shells)
    properties = GProp_GProps()
    BRepGProp.VolumeProperties_s(made, properties)
    return made if properties.Mass() > 0 else with_shells([TopoDS.Shell(shell.Reversed()) for shell in shells])


def with_shells(shells):
    maker = BRepBuilderAPI_MakeSolid()
    for shell in shells:
        maker.Add(shell)
    return maker.Solid()


def motion(one, other):
    """The rigid motion that brings the vertices of one to those of another, if there is one."""
    if one.shape != other.shape:
        return None
    a, b = one - one.mean(axis=0), other - other.mean(axis=0)
    u, _, v = numpy.linalg.svd(a.T @ b)
    turn = v.T @ u.T
    if numpy.linalg.det(turn) < 0 or abs(a @ turn.T - b).max() > SAME:
        return None
    return turn, other.mean(axis=0) - turn @ one.mean(axis=0)


def placement(turn, shift):
    made = gp_Trsf()
    made.SetValues(*(x for row, s in zip(turn.tolist(), shift.tolist()) for x in (*row, s)))
    return made


def write(folder, out):
    """Writes the assembly in a folder of the corpus, and says what must be found in it."""
    described = json.loads((folder / "assembly.json").read_text())
    document, made, instances, bodies = Document(), [], [], []
    for part in described["parts"]:
        name = part["name"].split("#")[0]
        vertices, triangles = read_obj(folder / part["file"])
        volume, centroid = volume_and_centroid(vertices, triangles)
        # The first of equal products has the product's name in the corpus, all others a number.
        bodies.append(Body(part["name"], name, part["name"], volume, centroid))
        for known, their_vertices, key in made:
            if known == name and (found := motion(their_vertices, vertices)):
                break
        else:
            # Products of one name, but of different shape, are told apart by a key here alone.
            key, found = part["name"], (numpy.eye(3), numpy.zeros(3))
            document.part(key, solid(vertices, triangles), title=name)
            made.append((name, vertices, key))
        instances.append((key, part["name"], placement(*found)))
    document.assembly(folder.name, *instances)
    document.write(out / f"{folder.name}.step")
    return Expected(bodies=bodies, shared=len(made))


if __name__ == "__main__":
    corpus, out = Path(sys.argv[1]), Path(sys.argv[2])
    out.mkdir(parents=True, exist_ok=True)
    expected = {f"{Path(name).name}.step": asdict(write(corpus / name, out)) for name in sys.argv[3:]}
    (out / "expected.json").write_text(json.dumps(expected, indent=1))
