"""Meshes in: from files and from arrays."""

import numpy
import pytest
from conftest import ASSEMBLIES, box

import sbdp


def test_files_are_read_with_names_and_meshes():
    assembly = sbdp.load(ASSEMBLIES / "pin-bolt-cover")
    assert list(assembly.parts) == sorted(assembly.parts)
    assert len(assembly) == len(assembly.parts) == 4
    vertices, triangles = assembly.mesh(assembly.parts[0])
    assert vertices.dtype == numpy.float64 and vertices.shape[1] == 3
    assert triangles.dtype == numpy.uint32 and triangles.max() < len(vertices)
    assert len(assembly.handle) == 32


def test_what_cannot_be_read_is_refused_with_its_name(tmp_path):
    with pytest.raises(sbdp.GeometryError, match="no such file") as refused:
        sbdp.load(tmp_path / "none")
    assert refused.value.code == 5
    (tmp_path / "bad.obj").write_text("v 1 2\n")
    with pytest.raises(sbdp.GeometryError, match="bad.obj"):
        sbdp.load(tmp_path / "bad.obj")
    with pytest.raises(ValueError, match="objects, bodies, none"):
        sbdp.load(ASSEMBLIES / "l-slot", split="half")
    with pytest.raises(ValueError, match="deflection"):
        sbdp.load(ASSEMBLIES / "l-slot", deflection=-1.0)


def test_names_are_left_out_by_patterns():
    whole = sbdp.load(ASSEMBLIES / "bolted-bracket-20")
    without = sbdp.load(ASSEMBLIES / "bolted-bracket-20", ignore=[whole.parts[0]])
    assert set(without.parts) == set(whole.parts[1:])
    assert any("ignored" in note for note in without.notes)


def test_arrays_make_the_same_assembly_as_files():
    files = sbdp.load(ASSEMBLIES / "pin-bolt-cover")
    meshes = {part: files.mesh(part) for part in reversed(files.parts)}
    arrays = sbdp.assembly(meshes, units=files.units, fixed=files.fixed)
    assert arrays.parts == files.parts
    assert arrays.handle == files.handle


def test_single_precision_is_the_widened_content():
    vertices, triangles = box((0.1, 0.2, 0.3))
    narrow = vertices.astype(numpy.float32)
    one = sbdp.assembly({"a": (narrow, triangles)})
    two = sbdp.assembly({"a": (narrow.astype(numpy.float64), triangles)})
    assert one.handle == two.handle
    assert one.handle != sbdp.assembly({"a": (vertices, triangles)}).handle


def test_other_arrays_are_converted():
    vertices, triangles = box((0, 0, 0))
    strided = numpy.zeros((16, 3))
    strided[::2] = vertices
    expected = sbdp.assembly({"a": (vertices, triangles)}).handle
    for other in (
        (strided[::2], triangles),
        (numpy.asfortranarray(vertices), triangles.astype(numpy.int64)),
        (vertices.astype(">f8"), triangles.tolist()),
        (vertices.astype(int), triangles),
    ):
        assert sbdp.assembly({"a": other}).handle == expected


def test_an_array_is_kept_as_long_as_its_assembly():
    import gc
    import sys

    vertices, triangles = box((0, 0, 0))
    before = sys.getrefcount(vertices)
    assembly = sbdp.assembly({"a": (vertices, triangles)})
    assert sys.getrefcount(vertices) == before + 1
    with pytest.raises(ValueError, match="referenc"):
        vertices.resize((100, 3))
    del assembly
    gc.collect()
    assert sys.getrefcount(vertices) == before


def test_arrays_that_are_no_mesh_are_refused_with_the_part():
    vertices, triangles = box((0, 0, 0))
    for bad, words in (
        ((vertices[:, :2], triangles), r"vertices of part `a`.*\(n, 3\)"),
        ((vertices, triangles[:, :2]), r"triangles of part `a`.*\(n, 3\)"),
        ((vertices.ravel(), triangles), "vertices of part `a`"),
        ((vertices, triangles.astype(float)), "triangles of part `a`.*whole numbers"),
        ((vertices, triangles.astype(int) - 1), "triangles of part `a`.*below 0"),
        ((vertices.astype(str), triangles), "vertices of part `a`.*numbers"),
    ):
        with pytest.raises(ValueError, match=words):
            sbdp.assembly({"a": bad})
    with pytest.raises(TypeError, match="by name"):
        sbdp.assembly([(vertices, triangles)])
    with pytest.raises(sbdp.NoSuchPartError, match="`b`"):
        sbdp.assembly({"a": (vertices, triangles)}, fixed=["b"])


def test_what_has_vertices_and_faces_is_a_mesh():
    class Mesh:
        vertices, faces = box((0, 0, 0))

    assert sbdp.assembly({"a": Mesh}).handle == sbdp.assembly({"a": box((0, 0, 0))}).handle


def test_trimesh_gives_and_takes_meshes():
    trimesh = pytest.importorskip("trimesh")
    scene = trimesh.Scene()
    upper = trimesh.transformations.translation_matrix([0, 0, 1])
    scene.add_geometry(trimesh.creation.box(), node_name="lower")
    scene.add_geometry(trimesh.creation.box(), node_name="upper", transform=upper)
    assembly = sbdp.assembly(scene, units="mm")
    assert assembly.parts == ("lower", "upper")
    assert sbdp.to_trimesh(assembly, "upper").bounds.tolist() == [[-0.5, -0.5, 0.5], [0.5, 0.5, 1.5]]
