"""The converter with cascadio (PyPI): a tenth of the size of OCP. It does not know solids and writes a mesh per instance.

Names of products come from the names of its meshes and from the text of the file; solids of a product are told apart by
connectedness, where that is as many as the file has.
"""

import json
import struct
from array import array

import cascadio

from . import Refusal
from .model import Mesh, Node, instance, outward, welded
from .part21 import instance_name

COMPONENTS = {5121: "B", 5123: "H", 5125: "I"}


def convert(path, text, structure, deflection, angle):
    """The roots of a file, the largest deviation of its triangles (mm), and warnings.

    `deflection` is in mm, `angle` in radians. cascadio does not tell what deviation it reached.
    """
    written = cascadio.load(text, file_type="step", tol_linear=deflection, tol_angular=angle, tol_relative=False)
    if not written:
        raise Refusal("the kernel cannot read the file: it is damaged or has no geometry")
    scene = Scene(written, structure)
    return scene.run(), deflection, scene.warnings


class Scene:
    """A GLB of cascadio: metres in 32 bits, the frame of the file, a node per use with the instance's name."""

    def __init__(self, written, structure):
        length = struct.unpack_from("<I", written, 12)[0]
        self.document = json.loads(written[20 : 20 + length])
        self.binary = memoryview(written)[28 + length :]
        self.structure = structure
        self.scale = 1.0 / structure.metres
        self.known, self.warnings = {}, []

    def run(self):
        scene = self.document["scenes"][self.document.get("scene", 0)]
        unused = list(self.structure.roots)
        return [self.node(number, self.root(number, unused), None) for number in scene.get("nodes", [])]

    def root(self, number, unused):
        """The product of a node at the top: that of its name, else the next."""
        name = self.document["nodes"][number].get("name", "")
        named = [root for root in unused if self.structure.products[root].name == name]
        found = (named or unused or [None])[0]
        if found is not None:
            unused.remove(found)
        return found

    def node(self, number, definition, use):
        """The node of an instance. `definition` is the number of its product in the file, if that is known."""
        given = self.document["nodes"][number]
        product = self.structure.products.get(definition)
        children = given.get("children", [])
        meshes = self.meshes(given["mesh"], product) if "mesh" in given else []
        name = product.name if product else self.mesh_name(given) or given.get("name") or "unnamed"
        if not children:
            if not meshes:
                self.warnings.append(f"`{name}` has no geometry; it is left out")
            return instance(name, use, self.matrix(given), meshes)
        node = Node(name, name, use, self.matrix(given), None, [Node(mesh.name, mesh=mesh) for mesh in meshes])
        for child, (below, name_here) in zip(children, self.uses(product, children)):
            node.children.append(self.node(child, below, name_here))
        return node

    def uses(self, product, children):
        """For each node below an assembly the product's number and the instance's name."""
        names = [self.document["nodes"][child].get("name", "") for child in children]
        uses = list(product.uses) if product else []
        if len(uses) != len(children):
            return [(None, instance_name(name)) for name in names]
        found = [next((u for u in uses if u[1] == name), None) for name in names]
        if None in found or len(set(names)) != len(names):
            found = uses
        return found

    def mesh_name(self, given):
        return self.document["meshes"][given["mesh"]].get("name", "") if "mesh" in given else ""

    def matrix(self, given):
        """Its 32 bits are rounded again in the file's unit: 0.075 m comes as 0.0750000003 and leaves as 75 mm."""
        matrix = given.get("matrix")
        if matrix is None:
            return None
        return [*matrix[:12], *array("f", (x * self.scale for x in matrix[12:15])), 1.0]

    def meshes(self, number, product):
        given = self.document["meshes"][number]
        name = product.name if product else given.get("name") or "unnamed"
        positions, triangles, colour = array("f"), array("I"), None
        for primitive in given["primitives"]:
            if primitive.get("mode", 4) != 4 or "indices" not in primitive:
                self.warnings.append(f"`{name}` has lines or points beside its faces; they are left out")
                continue
            first = len(positions) // 3
            positions.extend(x * self.scale for x in self.numbers(primitive["attributes"]["POSITION"], "f", 3))
            triangles.extend(first + t for t in self.numbers(primitive["indices"], None, 1))
            colour = colour or self.colour(primitive)
        if not triangles:
            return []
        whole = welded(name, positions, triangles, colour)
        return self.solids(whole, product)

    def numbers(self, accessor, code, width):
        accessor = self.document["accessors"][accessor]
        view = self.document["bufferViews"][accessor["bufferView"]]
        code = code or COMPONENTS[accessor["componentType"]]
        size = struct.calcsize(code)
        if view.get("byteStride", size * width) != size * width:
            raise Refusal("cascadio wrote interleaved numbers, which this program does not read")
        start = view.get("byteOffset", 0) + accessor.get("byteOffset", 0)
        return array(code, bytes(self.binary[start : start + accessor["count"] * width * size]))

    def colour(self, primitive):
        if "material" not in primitive:
            return None
        factor = self.document["materials"][primitive["material"]].get("pbrMetallicRoughness", {}).get("baseColorFactor")
        return tuple(round(x, 4) for x in factor) if factor else None

    def solids(self, mesh, product):
        """The solids of a mesh that has several."""
        count = product.solids if product else 1
        if product and not count:
            self.warnings.append(f"`{mesh.name}` has no solid: its faces become a part with open surface")
        if count < 2:
            return [outward(mesh) if count else mesh]
        if (key := mesh.content()) not in self.known:
            parts = [] if product.voids else connected(mesh)
            self.known[key] = [outward(part) for part in parts] if len(parts) == count else [mesh]
        if len(self.known[key]) != count:
            self.warnings.append(
                f"`{mesh.name}` has {count} solids that cascadio does not tell apart: they are one part; "
                "install cadquery-ocp-novtk to have a part for each"
            )
        return self.known[key]


def connected(mesh):
    """The connected pieces of a welded mesh, in the order of their first triangles."""
    parents = list(range(len(mesh.positions) // 3))

    def root(vertex):
        while parents[vertex] != vertex:
            parents[vertex] = vertex = parents[parents[vertex]]
        return vertex

    corners = list(zip(mesh.triangles[0::3], mesh.triangles[1::3], mesh.triangles[2::3]))
    for a, b, c in corners:
        parents[root(b)] = root(a)
        parents[root(c)] = root(a)
    pieces = {}
    for triangle in corners:
        pieces.setdefault(root(triangle[0]), []).append(triangle)
    return [piece(mesh, f"{mesh.name}/{number}", triangles) for number, triangles in enumerate(pieces.values(), 1)]


def piece(mesh, name, triangles):
    numbers, positions = {}, array("f")
    indices = array("I")
    for vertex in (v for triangle in triangles for v in triangle):
        if vertex not in numbers:
            numbers[vertex] = len(numbers)
            positions.extend(mesh.positions[3 * vertex : 3 * vertex + 3])
        indices.append(numbers[vertex])
    return Mesh(name, positions, indices, mesh.colour)
