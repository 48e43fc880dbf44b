"""The converter with OCP (PyPI's cadquery-ocp-novtk): keeps names of products and instances, shared shapes and solids."""

from array import array

from OCP.BRep import BRep_Tool
from OCP.BRepMesh import BRepMesh_IncrementalMesh
from OCP.IFSelect import IFSelect_RetDone
from OCP.Quantity import Quantity_ColorRGBA
from OCP.STEPCAFControl import STEPCAFControl_Reader
from OCP.TCollection import TCollection_ExtendedString
from OCP.TDF import TDF_Label
from OCP.TDataStd import TDataStd_Name
from OCP.TDocStd import TDocStd_Document
from OCP.TopAbs import TopAbs_FACE, TopAbs_REVERSED, TopAbs_SOLID
from OCP.TopExp import TopExp_Explorer
from OCP.TopLoc import TopLoc_Location
from OCP.TopoDS import TopoDS
from OCP.XCAFDoc import XCAFDoc_ColorGen, XCAFDoc_ColorSurf, XCAFDoc_ColorTool, XCAFDoc_DocumentTool, XCAFDoc_ShapeTool
from OCP.collections import Sequence_TDF_Label

from . import Refusal
from .model import Node, instance, outward, welded
from .part21 import instance_name

KERNEL_UNIT = 1e-3  # metres: the kernel converts all lengths to mm


def convert(path, text, structure, deflection, angle):
    """The roots of a file, the largest deviation of its triangles (mm), and warnings.

    `deflection` is in mm, `angle` in radians.
    """
    reader = STEPCAFControl_Reader()
    reader.SetNameMode(True)
    reader.SetColorMode(True)
    if reader.ReadFile(str(path)) != IFSelect_RetDone:
        raise Refusal("the kernel cannot read the file: it is damaged")
    document = TDocStd_Document(TCollection_ExtendedString("BinXCAF"))
    if not reader.Transfer(document):
        raise Refusal("the kernel found nothing in the file that it can convert")
    return Walk(document, structure, deflection, angle).run()


def name_of(label):
    found = TDataStd_Name()
    return found.Get().ToExtString().strip() if label.FindAttribute(TDataStd_Name.GetID_s(), found) else ""


def labels(fill):
    sequence = Sequence_TDF_Label()
    fill(sequence)
    return list(sequence)


def faces_below(shape, avoided=None):
    explorer = TopExp_Explorer(shape, TopAbs_FACE, avoided) if avoided else TopExp_Explorer(shape, TopAbs_FACE)
    while explorer.More():
        yield TopoDS.Face(explorer.Current())
        explorer.Next()


def solids_in(shape):
    explorer = TopExp_Explorer(shape, TopAbs_SOLID)
    while explorer.More():
        yield explorer.Current()
        explorer.Next()


class Walk:
    """Goes through the products of a document, and tessellates each once."""

    def __init__(self, document, structure, deflection, angle):
        self.shapes = XCAFDoc_DocumentTool.ShapeTool_s(document.Main())
        self.deflection, self.angle = deflection, angle
        self.scale = KERNEL_UNIT / structure.metres
        self.known, self.warnings, self.reached = {}, [], deflection

    def run(self):
        free = labels(self.shapes.GetFreeShapes)
        return [self.node(label, None, None) for label in free], self.reached, self.warnings

    def node(self, label, instance_of, matrix):
        """The node of a product, as it stands in the product above."""
        name = name_of(label) or "unnamed"
        if not XCAFDoc_ShapeTool.IsAssembly_s(label):
            return instance(name, instance_of, matrix, self.meshes(label, name))
        node = Node(name, name, instance_of, matrix)
        for component in labels(lambda sequence: XCAFDoc_ShapeTool.GetComponents_s(label, sequence)):
            product = TDF_Label()
            if not XCAFDoc_ShapeTool.GetReferredShape_s(component, product):
                self.warnings.append(f"`{name}` uses something that is not in the file; it is left out")
                continue
            place = self.matrix(XCAFDoc_ShapeTool.GetLocation_s(component))
            node.children.append(self.node(product, instance_name(name_of(component)), place))
        return node

    def matrix(self, location):
        if location.IsIdentity():
            return None
        transformation = location.Transformation()
        columns = [[transformation.Value(row, column) for row in (1, 2, 3)] for column in (1, 2, 3, 4)]
        columns[3] = [x * self.scale for x in columns[3]]
        return [x for column, last in zip(columns, (0.0, 0.0, 0.0, 1.0)) for x in (*column, last)]

    def meshes(self, label, name):
        """The meshes of a part, one for each solid; made once for each product."""
        key = label.Tag(), name
        if key not in self.known:
            self.known[key] = self.tessellated(label, name)
        return self.known[key]

    def tessellated(self, label, name):
        shape = XCAFDoc_ShapeTool.GetShape_s(label)
        if shape is None or shape.IsNull():
            self.warnings.append(f"`{name}` has no geometry; it is left out")
            return []
        BRepMesh_IncrementalMesh(shape, self.deflection, False, self.angle, True)
        bodies = list(solids_in(shape))
        loose = list(faces_below(shape, TopAbs_SOLID))
        if bodies and loose:
            self.warnings.append(f"`{name}` has {count(len(loose), 'face')} outside its solids; left out")
        elif loose:
            self.warnings.append(f"`{name}` has no solid: its {count(len(loose), 'face')} become a part with open surface")
        elif not bodies:
            self.warnings.append(f"`{name}` has no geometry; it is left out")
        groups = [list(faces_below(body)) for body in bodies] if bodies else [loose] if loose else []
        colours = [self.colour(label, body) for body in bodies] or [self.colour(label, shape)]
        found = []
        for number, (faces, colour) in enumerate(zip(groups, colours), 1):
            title = name if len(groups) == 1 else f"{name}/{number}"
            if mesh := self.mesh(title, faces, colour):
                found.append(outward(mesh) if bodies else mesh)
            else:
                self.warnings.append(f"`{title}` could not be tessellated; it is left out")
        return found

    def mesh(self, name, faces, colour):
        positions, triangles, failed = array("f"), array("I"), 0
        for face in faces:
            location = TopLoc_Location()
            triangulation = BRep_Tool.Triangulation_s(face, location)
            if triangulation is None:
                failed += 1
                continue
            self.reached = max(self.reached, triangulation.Deflection())
            first = len(positions) // 3 - 1
            transformation = None if location.IsIdentity() else location.Transformation()
            for number in range(1, triangulation.NbNodes() + 1):
                point = triangulation.Node(number)
                if transformation:
                    point = point.Transformed(transformation)
                positions.extend((point.X() * self.scale, point.Y() * self.scale, point.Z() * self.scale))
            is_reversed = face.Orientation() == TopAbs_REVERSED
            for number in range(1, triangulation.NbTriangles() + 1):
                a, b, c = triangulation.Triangle(number).Get()
                triangles.extend((first + a, first + (c if is_reversed else b), first + (b if is_reversed else c)))
        if failed:
            self.warnings.append(f"{count(failed, 'face')} of `{name}` could not be tessellated: its surface has holes there")
        return welded(name, positions, triangles, colour) if triangles else None

    def colour(self, label, body):
        """That of the solid, else of its product."""
        found = Quantity_ColorRGBA()
        sub = TDF_Label()
        places = [sub] if self.shapes.FindSubShape(label, body, sub) else []
        for place in [*places, label]:
            for kind in (XCAFDoc_ColorSurf, XCAFDoc_ColorGen):
                if XCAFDoc_ColorTool.GetColor_s(place, kind, found):
                    rgb = found.GetRGB()
                    return tuple(round(x, 4) for x in (rgb.Red(), rgb.Green(), rgb.Blue(), found.Alpha()))
        return None


def count(number, noun):
    return f"{number} {noun}" if number == 1 else f"{number} {noun}s"
