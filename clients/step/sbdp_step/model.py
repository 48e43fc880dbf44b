"""What a converter makes of a file, and how it is written as GLB."""

import json
import struct
from array import array
from collections import Counter
from dataclasses import dataclass, field
from typing import Optional

IDENTITY = [1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0]


@dataclass
class Mesh:
    """Triangles of one solid, in its product's frame and the file's unit; counter-clockwise from outside."""

    name: str
    positions: array  # 'f', three per vertex
    triangles: array  # 'I', three per triangle
    colour: Optional[tuple] = None  # linear RGBA

    def content(self):
        return (self.name, self.colour, self.positions.tobytes(), self.triangles.tobytes())


def welded(name, positions, triangles, colour):
    """The mesh with equal vertices of neighbouring faces merged."""
    numbers, target, kept = {}, [], array("f")
    for at in range(0, len(positions), 3):
        point = (positions[at], positions[at + 1], positions[at + 2])
        number = numbers.setdefault(point, len(numbers))
        if number * 3 == len(kept):
            kept.extend(point)
        target.append(number)
    return Mesh(name, kept, array("I", [target[t] for t in triangles]), colour)


def outward(mesh):
    """The mesh of a solid, turned if it is inside out: the kernel reads some solids so, though none is infinite."""
    p, t = mesh.positions, mesh.triangles
    if not t:
        return mesh
    ox, oy, oz = p[0], p[1], p[2]
    volume = 0.0
    for at in range(0, len(t), 3):
        a, b, c = 3 * t[at], 3 * t[at + 1], 3 * t[at + 2]
        ax, ay, az = p[a] - ox, p[a + 1] - oy, p[a + 2] - oz
        bx, by, bz = p[b] - ox, p[b + 1] - oy, p[b + 2] - oz
        cx, cy, cz = p[c] - ox, p[c + 1] - oy, p[c + 2] - oz
        volume += ax * (by * cz - bz * cy) + ay * (bz * cx - bx * cz) + az * (bx * cy - by * cx)
    if volume >= 0:
        return mesh
    turned = array("I", t)
    turned[1::3], turned[2::3] = t[2::3], t[1::3]
    return Mesh(mesh.name, p, turned, mesh.colour)


@dataclass
class Node:
    """An instance of a product, or one of its solids."""

    name: str
    product: Optional[str] = None
    instance: Optional[str] = None
    matrix: Optional[list] = None  # 16 numbers, column by column, in the file's unit; None: identity
    mesh: Optional[Mesh] = None
    children: list = field(default_factory=list)

    def has_mesh(self):
        return bool(self.mesh) or any(child.has_mesh() for child in self.children)


def instance(name, instance_name, matrix, meshes):
    """The node of a part: with its mesh, or with a node for each of its solids."""
    node = Node(name, name, instance_name, matrix)
    if len(meshes) == 1:
        node.mesh = meshes[0]
    else:
        node.children = [Node(mesh.name, mesh=mesh) for mesh in meshes]
    return node


class Writer:
    """Collects buffers, meshes and nodes; equal meshes are written once."""

    def __init__(self):
        self.buffer = bytearray()
        self.views, self.accessors, self.meshes, self.nodes, self.materials = [], [], [], [], []
        self.known_meshes, self.known_materials = {}, {}

    def accessor(self, numbers, component, kind, target, **more):
        offset = len(self.buffer)
        self.buffer += numbers.tobytes()
        self.views.append({"buffer": 0, "byteOffset": offset, "byteLength": len(self.buffer) - offset, "target": target})
        count = len(numbers) // (3 if kind == "VEC3" else 1)
        self.accessors.append({"bufferView": len(self.views) - 1, "componentType": component, "count": count, "type": kind, **more})
        return len(self.accessors) - 1

    def mesh(self, mesh):
        content = mesh.content()
        if content not in self.known_meshes:
            bounds = {name: [pick(mesh.positions[axis::3]) for axis in range(3)] for name, pick in (("min", min), ("max", max))}
            primitive = {
                "attributes": {"POSITION": self.accessor(mesh.positions, 5126, "VEC3", 34962, **bounds)},
                "indices": self.accessor(mesh.triangles, 5125, "SCALAR", 34963),
            }
            if mesh.colour:
                primitive["material"] = self.material(mesh.colour)
            self.meshes.append({"name": mesh.name, "primitives": [primitive]})
            self.known_meshes[content] = len(self.meshes) - 1
        return self.known_meshes[content]

    def material(self, colour):
        if colour not in self.known_materials:
            self.materials.append({"pbrMetallicRoughness": {"baseColorFactor": list(colour), "metallicFactor": 0.0}})
            self.known_materials[colour] = len(self.materials) - 1
        return self.known_materials[colour]

    def node(self, node, name):
        at = len(self.nodes)
        self.nodes.append({"name": name})
        written = self.nodes[at]
        extras = {key: value for key, value in (("product", node.product), ("instance", node.instance)) if value}
        if extras:
            written["extras"] = extras
        if node.matrix and node.matrix != IDENTITY:
            written["matrix"] = node.matrix
        if node.mesh:
            written["mesh"] = self.mesh(node.mesh)
        if children := [child for child in node.children if child.has_mesh()]:
            written["children"] = [self.node(child, name) for child, name in told_apart(children)]
        return at


def told_apart(siblings):
    """The names of nodes below one node: the product's, or where several have it the instance's, if these differ."""
    products, instances = Counter(node.name for node in siblings), Counter(node.instance for node in siblings)
    for node in siblings:
        is_better = node.instance and instances[node.instance] == 1 and node.instance not in products.keys() - {node.name}
        yield node, node.instance if products[node.name] > 1 and is_better else node.name


def glb(roots, unit):
    """The bytes of a GLB whose lengths are in the file's unit."""
    writer = Writer()
    tops = [writer.node(root, name) for root, name in told_apart([root for root in roots if root.has_mesh()])]
    document = {
        "asset": {"version": "2.0", "generator": "sbdp-step", "extras": {"unit": unit, "up": "z"}},
        "scene": 0,
        "scenes": [{"nodes": tops}],
        "nodes": writer.nodes,
        "meshes": writer.meshes,
        "accessors": writer.accessors,
        "bufferViews": writer.views,
        "buffers": [{"byteLength": len(writer.buffer)}],
    }
    if writer.materials:
        document["materials"] = writer.materials
    text = json.dumps(document, ensure_ascii=False, separators=(",", ":")).encode()
    text += b" " * (-len(text) % 4)
    buffer = bytes(writer.buffer) + b"\0" * (-len(writer.buffer) % 4)
    chunks = struct.pack("<I4s", len(text), b"JSON") + text + struct.pack("<I4s", len(buffer), b"BIN\0") + buffer
    return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks


def products(roots):
    """Every product that has a mesh, with the number of its instances and of its solids, for the report."""
    counts = {}

    def visit(node):
        solids = 1 if node.mesh else sum(1 for child in node.children if child.mesh and not child.product)
        if node.product and solids:
            entry = counts.setdefault(node.product, {"name": node.product, "instances": 0, "solids": solids})
            entry["instances"] += 1
        for child in node.children:
            if child.product:
                visit(child)

    for root in roots:
        visit(root)
    return sorted(counts.values(), key=lambda entry: entry["name"])
