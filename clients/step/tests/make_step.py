"""Writes the STEP files of the tests, with OCP: `python make_step.py FOLDER`. Nothing in them is of anybody else.

Every file comes with what a converter must find in it: `FOLDER/expected.json`, by file name (see `Expected`).
"""

import json
import math
import re
import sys
from collections import Counter
from dataclasses import asdict, dataclass, field
from pathlib import Path

from OCP.BRepAlgoAPI import BRepAlgoAPI_Cut, BRepAlgoAPI_Fuse
from OCP.BRepBuilderAPI import BRepBuilderAPI_MakePolygon, BRepBuilderAPI_MakeFace, BRepBuilderAPI_Transform
from OCP.BRepGProp import BRepGProp
from OCP.BRepPrimAPI import BRepPrimAPI_MakeBox, BRepPrimAPI_MakeCylinder, BRepPrimAPI_MakePrism
from OCP.BRep import BRep_Builder
from OCP.GProp import GProp_GProps
from OCP.IFSelect import IFSelect_RetDone
from OCP.Interface import Interface_Static
from OCP.Quantity import Quantity_Color, Quantity_TOC_RGB
from OCP.STEPCAFControl import STEPCAFControl_Writer
from OCP.STEPControl import STEPControl_AsIs
from OCP.TCollection import TCollection_ExtendedString
from OCP.TDataStd import TDataStd_Name
from OCP.TDocStd import TDocStd_Document
from OCP.TopLoc import TopLoc_Location
from OCP.TopoDS import TopoDS_Compound
from OCP.XCAFDoc import XCAFDoc_ColorGen, XCAFDoc_DocumentTool
from OCP.gp import gp_Ax1, gp_Ax2, gp_Dir, gp_Pnt, gp_Trsf, gp_Vec


@dataclass
class Body:
    """A part that a converter must find."""

    name: str
    product: str
    instance: str
    volume: float  # mm³, of the exact solid
    centroid: list  # mm, in the frame of the file


@dataclass
class Expected:
    """What a converter must find in a file, or how it must refuse it."""

    unit: str = "mm"
    bodies: list = field(default_factory=list)
    warnings: list = field(default_factory=list)  # words, each of which must be in a warning
    refusal: list = field(default_factory=list)  # words, all of which must be in the reason; empty: converted
    shared: int = 0  # distinct meshes


def volume_and_centroid(shape):
    properties = GProp_GProps()
    BRepGProp.VolumeProperties_s(shape, properties)
    centre = properties.CentreOfMass()
    return properties.Mass(), [centre.X(), centre.Y(), centre.Z()]


def placed(x=0.0, y=0.0, z=0.0, axis=None, angle=0.0):
    """A turn by an angle (degrees) about an axis through the origin, then a shift."""
    turn = gp_Trsf()
    if axis:
        turn.SetRotation(gp_Ax1(gp_Pnt(0, 0, 0), gp_Dir(*axis)), math.radians(angle))
    shift = gp_Trsf()
    shift.SetTranslation(gp_Vec(x, y, z))
    return shift.Multiplied(turn)


def cylinder(radius, height, x=0.0, y=0.0, z=0.0, along=(0, 0, 1)):
    return BRepPrimAPI_MakeCylinder(gp_Ax2(gp_Pnt(x, y, z), gp_Dir(*along)), radius, height).Shape()


def box(size, corner=(0.0, 0.0, 0.0)):
    return BRepPrimAPI_MakeBox(gp_Pnt(*corner), *size).Shape()


def hexagon(across_flats, height, z=0.0):
    polygon = BRepBuilderAPI_MakePolygon()
    for corner in range(6):
        angle = math.radians(60 * corner)
        radius = across_flats / math.sqrt(3)
        polygon.Add(gp_Pnt(radius * math.cos(angle), radius * math.sin(angle), z))
    polygon.Close()
    return BRepPrimAPI_MakePrism(BRepBuilderAPI_MakeFace(polygon.Wire()).Face(), gp_Vec(0, 0, height)).Shape()


def cut(shape, *tools):
    for tool in tools:
        shape = BRepAlgoAPI_Cut(shape, tool).Shape()
    return shape


def compound(*shapes):
    result, builder = TopoDS_Compound(), BRep_Builder()
    builder.MakeCompound(result)
    for shape in shapes:
        builder.Add(result, shape)
    return result


class Document:
    """An assembly in the making. A product is a label, given a shape or made of instances of others."""

    def __init__(self):
        self.document = TDocStd_Document(TCollection_ExtendedString("BinXCAF"))
        self.shapes = XCAFDoc_DocumentTool.ShapeTool_s(self.document.Main())
        self.colours = XCAFDoc_DocumentTool.ColorTool_s(self.document.Main())
        self.products = {}  # name -> (label, bodies or None, children)

    def part(self, name, *solids, colour=None, title=None):
        """A product with one solid or several. `title` is its name in the file, if not the key that it has here."""
        shape = solids[0] if len(solids) == 1 else compound(*solids)
        label = self.shapes.AddShape(shape, False)
        TDataStd_Name.Set_s(label, TCollection_ExtendedString(title or name, True))
        if colour:
            self.colours.SetColor(label, Quantity_Color(*colour, Quantity_TOC_RGB), XCAFDoc_ColorGen)
        self.products[name] = (label, solids, [])
        return name

    def assembly(self, name, *instances):
        """Instances: (product, its name here, placement)."""
        label = self.shapes.NewShape()
        TDataStd_Name.Set_s(label, TCollection_ExtendedString(name, True))
        for product, instance, placement in instances:
            component = self.shapes.AddComponent(label, self.products[product][0], TopLoc_Location(placement))
            TDataStd_Name.Set_s(component, TCollection_ExtendedString(instance, True))
        self.products[name] = (label, None, instances)
        return name

    def bodies(self, root, placement=None, instance=""):
        """The parts below a product, in the order of the tree."""
        placement = placement or gp_Trsf()
        _, solids, children = self.products[root]
        if solids is None:
            uses = Counter(product for product, _, _ in children)
            found = []
            for product, name, own in children:
                below = self.bodies(product, placement.Multiplied(own), name)
                if uses[product] > 1 and self.products[product][1] and len(below) == 1:
                    below[0].name = name
                found += below
            return found
        found = []
        for number, solid in enumerate(solids, 1):
            volume, centroid = volume_and_centroid(BRepBuilderAPI_Transform(solid, placement, True).Shape())
            name = root if len(solids) == 1 else f"{root}/{number}"
            found.append(Body(name, root, instance, volume, centroid))
        return found

    def write(self, file, unit="MM", schema="AP214IS", several_files=None):
        """`several_files`: the prefix of the files of the products, which `file` then refers to."""
        self.shapes.UpdateAssemblies()
        Interface_Static.SetCVal_s("write.step.unit", unit)
        Interface_Static.SetCVal_s("write.step.schema", schema)
        writer = STEPCAFControl_Writer()
        writer.SetNameMode(True)
        writer.SetColorMode(True)
        done = writer.Transfer(self.document, STEPControl_AsIs, several_files)
        if not done or writer.Write(str(file)) != IFSelect_RetDone:
            raise RuntimeError(f"cannot write {file}")


def nut():
    return cut(hexagon(15, 3), cylinder(5, 5, z=-1))


def bolt():
    return BRepAlgoAPI_Fuse(cylinder(7.5, 4, z=30), cylinder(5, 34, z=-4)).Shape()


def bracket_assembly():
    """As `as1`: a plate, two brackets with three bolts and nuts each, a rod with two nuts; 18 parts of 5 products."""
    d = Document()
    holes = [(0, 0), (22, -13), (22, 13)]
    d.part("nut", nut(), colour=(0.8, 0.1, 0.1))
    d.part("bolt", bolt())
    foot, wall = box((50, 100, 10)), box((10, 100, 60))
    corner = BRepAlgoAPI_Fuse(foot, wall).Shape()
    drilled = [cylinder(5, 20, 20 + dx, 50 + dy, -5) for dx, dy in holes]
    d.part("l-bracket", cut(corner, *drilled, cylinder(5, 20, -5, 50, 40, (1, 0, 0))), colour=(0.2, 0.4, 0.9))
    left = [cylinder(5, 40, 25 + dx, 75 + dy, -10) for dx, dy in holes]
    right = [cylinder(5, 40, 155 - dx, 75 - dy, -10) for dx, dy in holes]
    d.part("plate", cut(box((180, 150, 20)), *left, *right))
    d.part("rod", cylinder(5, 200))
    d.assembly("nut-bolt-assembly", ("bolt", "bolt_1", placed()), ("nut", "nut_1", placed(z=-3)))
    bolts = [("nut-bolt-assembly", f"nut-bolt-assembly_{k}", placed(20 + dx, 50 + dy, -20)) for k, (dx, dy) in enumerate(holes, 1)]
    d.assembly("l-bracket-assembly", ("l-bracket", "l-bracket_1", placed()), *bolts)
    d.assembly("rod-assembly", ("rod", "rod_1", placed()), ("nut", "nut_2", placed(z=7)), ("nut", "nut_3", placed(z=190)))
    d.assembly(
        "as1",
        ("rod-assembly", "rod-assembly_1", placed(-10, 75, 60, (0, 1, 0), 90)),
        ("l-bracket-assembly", "l-bracket-assembly_1", placed(5, 25, 20)),
        ("plate", "plate_1", placed()),
        ("l-bracket-assembly", "l-bracket-assembly_2", placed(175, 125, 20, (0, 0, 1), 180)),
    )
    return d, "as1"


def pin_in_plate():
    """A pin with a radial play of 0.05 in a plate."""
    d = Document()
    d.part("plate", cut(box((40, 40, 10), (-20, -20, 0)), cylinder(5.05, 20, z=-5)))
    d.part("pin", cylinder(5, 30, z=-10))
    d.assembly("pin in plate", ("plate", "plate:1", placed()), ("pin", "pin:1", placed()))
    return d, "pin in plate"


def several_solids():
    """A product with three solids, used twice, and one solid with a void."""
    d = Document()
    d.part("Lager Ø8 „tief“", box((4, 4, 4)), box((4, 4, 4), (10, 0, 0)), cylinder(2, 8, 20, 2, 0))
    hollow = cut(box((10, 10, 10), (0, 20, 0)), box((4, 4, 4), (3, 23, 3)))
    d.part("hollow", hollow)
    d.assembly("set", ("Lager Ø8 „tief“", "a", placed()), ("Lager Ø8 „tief“", "b", placed(z=30, axis=(1, 1, 0), angle=40)), ("hollow", "", placed()))
    return d, "set"


def surfaces_beside():
    """A product of one face alone, one without anything, and a solid."""
    d = Document()
    face = BRepBuilderAPI_MakePolygon(gp_Pnt(0, 0, 20), gp_Pnt(9, 0, 20), gp_Pnt(9, 9, 20), gp_Pnt(0, 9, 20), True)
    d.part("block", box((10, 10, 10)))
    d.part("sheet", BRepBuilderAPI_MakeFace(face.Wire()).Face())
    d.part("nothing", compound())
    d.assembly("odd", ("block", "block", placed()), ("sheet", "sheet", placed()), ("nothing", "nothing", placed()))
    return d, "odd"


def described(document, root, **more):
    bodies = document.bodies(root)
    shared = sum(len(solids) for _, solids, _ in document.products.values() if solids)
    return Expected(bodies=bodies, **({"shared": shared} | more))


def make(folder):
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    expected = {}

    document, root = bracket_assembly()
    for name, schema in [("as1.step", "AP214IS"), ("as1-ap203.stp", "AP203"), ("as1-ap242.step", "AP242DIS")]:
        document.write(folder / name, schema=schema)
        expected[name] = described(document, root)
    document.write(folder / "as1-inch.STEP", unit="INCH")
    expected["as1-inch.STEP"] = described(document, root, unit="in")
    document.write(folder / "as1-metre.step", unit="M")
    expected["as1-metre.step"] = described(document, root, unit="m")

    document, root = pin_in_plate()
    document.write(folder / "pin-in-plate.step")
    expected["pin-in-plate.step"] = described(document, root)

    document, root = several_solids()
    document.write(folder / "several-solids.step")
    expected["several-solids.step"] = described(document, root)

    document, root = surfaces_beside()
    document.write(folder / "surfaces.step")
    block = described(document, root).bodies[0]
    expected["surfaces.step"] = Expected(bodies=[block], warnings=["sheet", "nothing"], shared=2)

    one = Document()
    one.part("Teil", box((3, 4, 5)))
    one.write(folder / "one-part.step")
    expected["one-part.step"] = described(one, "Teil")

    document, root = bracket_assembly()
    document.write(folder / "external.step", several_files="external-")
    expected["external.step"] = Expected(refusal=["external", "external-", "one file"])

    text = (folder / "as1.step").read_bytes()
    (folder / "truncated.step").write_bytes(text[: len(text) // 2])
    expected["truncated.step"] = Expected(refusal=["END-ISO-10303-21"])
    (folder / "empty.step").write_bytes(b"")
    expected["empty.step"] = Expected(refusal=["empty"])
    (folder / "header-only.step").write_bytes(b"ISO-10303-21;\nHEADER;\nENDSEC;\nDATA;\nENDSEC;\nEND-ISO-10303-21;\n")
    expected["header-only.step"] = Expected(refusal=["no product"])
    (folder / "mesh.step").write_bytes(b"v 0 0 0\nv 1 0 0\n")
    expected["mesh.step"] = Expected(refusal=["ISO-10303-21"])
    (folder / "cyclic.step").write_bytes(cyclic(text))
    expected["cyclic.step"] = Expected(refusal=["itself"])
    (folder / "instances.step").write_bytes(multiplied())
    expected["instances.step"] = Expected(refusal=["instances"])
    (folder / "damaged.step").write_bytes(text.replace(b"MANIFOLD_SOLID_BREP", b"MANIFOLD_SOLID_BROP"))
    expected["damaged.step"] = Expected(refusal=["no solid"])

    (folder / "expected.json").write_text(json.dumps({k: asdict(v) for k, v in expected.items()}, indent=1, ensure_ascii=False))


def cyclic(text):
    """The file with its first sub-assembly used in itself."""
    uses = re.findall(rb"#(\d+) = NEXT_ASSEMBLY_USAGE_OCCURRENCE\(([^;]*),(#\d+),(#\d+),\$\);", text.replace(b"\n", b""))
    number, words, parent, child = uses[0]
    text = text.replace(b"\r", b"")
    pattern = re.compile(rb"(#" + number + rb" = NEXT_ASSEMBLY_USAGE_OCCURRENCE\([^;]*,)" + parent + rb"(\s*,\s*)" + child, re.S)
    return pattern.sub(rb"\g<1>" + child + rb"\g<2>" + child, text, count=1)


def multiplied():
    """Ten levels of assemblies, each with ten of the next: ten thousand million instances in 20 kB."""
    lines = ["ISO-10303-21;", "HEADER;", "FILE_DESCRIPTION((''),'2;1');", "FILE_NAME('','',(''),(''),'','','');",
             "FILE_SCHEMA(('AUTOMOTIVE_DESIGN'));", "ENDSEC;", "DATA;", "#1=APPLICATION_CONTEXT('');",
             "#2=PRODUCT_CONTEXT('',#1,'mechanical');", "#3=PRODUCT_DEFINITION_CONTEXT('part definition',#1,'design');"]
    for level in range(11):
        at = 100 + 10 * level
        lines += [f"#{at}=PRODUCT('level{level}','level{level}','',(#2));",
                  f"#{at + 1}=PRODUCT_DEFINITION_FORMATION('','',#{at});",
                  f"#{at + 2}=PRODUCT_DEFINITION('design','',#{at + 1},#3);"]
    number = 1000
    for level in range(10):
        for k in range(10):
            lines.append(f"#{number}=NEXT_ASSEMBLY_USAGE_OCCURRENCE('{number}','','',#{102 + 10 * level},#{112 + 10 * level},$);")
            number += 1
    return ("\n".join(lines + ["ENDSEC;", "END-ISO-10303-21;", ""])).encode()


if __name__ == "__main__":
    make(sys.argv[1])
