"""What the contract in README.md promises, of every converter that is shipped.

`python -m unittest discover clients/step/tests` wants OCP, which writes the files of the tests, and the programs on PATH.
`SBDP_STEP_CONVERTERS` names others. With `SBDP_SHARED` the corpus is converted, too.
"""

import json
import math
import os
import shutil
import struct
import subprocess
import sys
import tempfile
import time
import unittest
from array import array
from pathlib import Path

HERE = Path(__file__).resolve().parent
CONVERTERS = os.environ.get("SBDP_STEP_CONVERTERS", "sbdp-step-ocp sbdp-step-cascadio").split()
CORPUS_ENTRIES = ["gallery/caxif-as1-oc-214", "gallery/caxif-dm1-id-214", "gallery/caxif-s1-c5-214"]
# Shares. The smallest cylinder of the files has a radius of 2 mm: its volume misses four thirds of deflection over radius,
# 1.3e-3 of its volume at worst, half of it as the kernel works.
VOLUME, PLACE = 1e-3, 1e-3
DEFLECTION = 0.002
MILLIMETRES = {"mm": 1.0, "m": 1000.0, "in": 25.4}


IDENTITY = [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0]]


class Glb:
    """A GLB as a reader sees it: bodies in the frame of the scene, in the unit that its extras name."""

    def __init__(self, data):
        magic, version, length = struct.unpack_from("<4sII", data)
        assert (magic, version, length) == (b"glTF", 2, len(data)), "not a GLB"
        size = struct.unpack_from("<I", data, 12)[0]
        self.document = json.loads(data[20 : 20 + size])
        self.binary = data[28 + size :]
        self.bodies, self.seen = [], []
        for root in self.document["scenes"][0]["nodes"]:
            self.visit(root, IDENTITY, None)

    @staticmethod
    def below(above, node):
        """The pose of a node in the scene."""
        m = node.get("matrix", [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1])
        own = [[m[4 * c + r] for c in range(4)] for r in range(3)]
        return [[sum(above[r][k] * own[k][c] for k in range(3)) + (above[r][3] if c == 3 else 0) for c in range(4)] for r in range(3)]

    def visit(self, number, above, product):
        assert number not in self.seen, "a node in two places"
        self.seen.append(number)
        node = self.document["nodes"][number]
        here = self.below(above, node)
        extras = node.get("extras", {})
        own_product = extras.get("product", product and product[0]), extras.get("instance", product and product[1])
        if "mesh" in node:
            self.bodies.append((node["name"], *own_product, *self.measured(node["mesh"], here), node["mesh"]))
        for child in node.get("children", []):
            self.visit(child, here, own_product)

    def meshes(self):
        """The path of names and the OBJ text of every body."""

        def visit(number, above, path):
            node = self.document["nodes"][number]
            here, path = self.below(above, node), [*path, node["name"]]
            if "mesh" in node:
                points, indices = self.mesh(node["mesh"], here)
                faces = (f"f {a + 1} {b + 1} {c + 1}\n" for a, b, c in zip(indices[0::3], indices[1::3], indices[2::3]))
                yield "/".join(path), "".join([*(f"v {x!r} {y!r} {z!r}\n" for x, y, z in points), *faces])
            for child in node.get("children", []):
                yield from visit(child, here, path)

        for root in self.document["scenes"][0]["nodes"]:
            yield from visit(root, IDENTITY, [])

    def numbers(self, number, code, width):
        accessor = self.document["accessors"][number]
        view = self.document["bufferViews"][accessor["bufferView"]]
        start = view["byteOffset"]
        return array(code, self.binary[start : start + 4 * width * accessor["count"]])

    def mesh(self, number, pose):
        (primitive,) = self.document["meshes"][number]["primitives"]
        flat = self.numbers(primitive["attributes"]["POSITION"], "f", 3)
        points = [[sum(pose[r][k] * flat[at + k] for k in range(3)) + pose[r][3] for r in range(3)] for at in range(0, len(flat), 3)]
        return points, self.numbers(primitive["indices"], "I", 1)

    def measured(self, number, pose):
        points, indices = self.mesh(number, pose)
        edges, volume, moment = {}, 0.0, [0.0, 0.0, 0.0]
        origin = points[0]
        for at in range(0, len(indices), 3):
            corners = indices[at : at + 3]
            a, b, c = ([x - o for x, o in zip(points[i], origin)] for i in corners)
            part = (
                a[0] * (b[1] * c[2] - b[2] * c[1]) + a[1] * (b[2] * c[0] - b[0] * c[2]) + a[2] * (b[0] * c[1] - b[1] * c[0])
            ) / 6
            volume += part
            moment = [m + part * (x + y + z) / 4 for m, x, y, z in zip(moment, a, b, c)]
            for one, other in zip(corners, (corners[1], corners[2], corners[0])):
                edges[one, other] = edges.get((one, other), 0) + 1
        is_closed = all(edges.get((b, a)) == n for (a, b), n in edges.items())
        centroid = [m / volume + o for m, o in zip(moment, origin)] if volume > 0 else origin
        return volume, centroid, is_closed


class Conformance:
    """The contract's tests; a class for each converter has them."""

    converter = ""

    @classmethod
    def setUpClass(cls):
        beside = Path(sys.executable).parent / cls.converter
        cls.program = str(beside) if beside.exists() else shutil.which(cls.converter)
        assert cls.program, f"{cls.converter} is not installed"
        cls.folder = Path(tempfile.mkdtemp(prefix="sbdp-step-"))
        quiet = {"stdout": subprocess.DEVNULL}
        subprocess.run([sys.executable, HERE / "make_step.py", cls.folder / "own"], check=True, **quiet)
        if shared := os.environ.get("SBDP_SHARED"):
            corpus = Path(shared) / "corpus"
            subprocess.run([sys.executable, HERE / "corpus_step.py", corpus, cls.folder / "corpus", *CORPUS_ENTRIES], check=True, **quiet)

    @classmethod
    def tearDownClass(cls):
        shutil.rmtree(cls.folder)

    def run_on(self, file, *more):
        out = self.folder / "out.glb"
        out.unlink(missing_ok=True)
        began = time.monotonic()
        command = [self.program, file, out, "--deflection", str(DEFLECTION), "--angle", "0.5", *more]
        done = subprocess.run(command, capture_output=True, text=True, timeout=300)
        return done, out, time.monotonic() - began

    def converted(self, file):
        done, out, seconds = self.run_on(file)
        self.assertEqual(done.returncode, 0, f"{file.name}: {done.stderr}")
        lines = done.stdout.splitlines()
        self.assertEqual(len(lines), 1, "one line on stdout")
        megabytes = file.stat().st_size / 1e6
        print(f"  {self.converter} {file.name}: {megabytes:.2f} MB, {seconds:.2f} s, {seconds / megabytes:.2f} s/MB")
        return json.loads(lines[0]), Glb(out.read_bytes())

    def check(self, folder):
        expected = json.loads((folder / "expected.json").read_text())
        for name, wanted in expected.items():
            with self.subTest(file=name):
                if wanted["refusal"]:
                    self.refused(folder / name, wanted["refusal"])
                else:
                    self.as_expected(folder / name, wanted)

    def refused(self, file, words):
        done, out, seconds = self.run_on(file)
        self.assertEqual(done.returncode, 3, done.stderr)
        self.assertEqual(done.stdout, "")
        self.assertFalse(out.exists())
        reason = done.stderr.splitlines()[-1]
        for word in words:
            self.assertIn(word, reason)
        self.assertLess(seconds, 20)

    def as_expected(self, file, wanted):
        report, scene = self.converted(file)
        self.assertEqual(report["sbdp-step"], 1)
        self.assertEqual(report["unit"], wanted["unit"])
        self.assertLessEqual(report["deflection"], 2 * DEFLECTION)
        self.assertEqual(scene.document["asset"]["extras"], {"unit": wanted["unit"], "up": "z"})
        self.assertEqual(len(scene.document["meshes"]), wanted["shared"], "equal parts share a mesh")
        for words in wanted["warnings"]:
            self.assertTrue(any(words in w for w in report["warnings"]), f"{words}: {report['warnings']}")
        if not wanted["warnings"]:
            self.assertEqual(report["warnings"], [])
        bodies = [b for b in scene.bodies if b[5]]
        self.assertEqual(len(bodies), len(wanted["bodies"]), "closed bodies")
        left, unit = list(bodies), MILLIMETRES[wanted["unit"]]
        for want in wanted["bodies"]:
            size = want["volume"] ** (1 / 3)
            off = lambda body: math.dist([x * unit for x in body[4]], want["centroid"])
            same = [b for b in left if b[0] == want["name"] and b[1] == want["product"]]
            self.assertTrue(same, f"{want['name']}: {sorted(b[0] for b in left)}")
            body = min(same, key=off)
            self.assertLess(off(body), PLACE * size, want["name"])
            self.assertLess(abs(body[3] * unit**3 / want["volume"] - 1), VOLUME, want["name"])
            self.assertEqual(body[2] or "", want["instance"] or "", want["name"])
            left.remove(body)
        counts = {p["name"]: p["instances"] * p["solids"] for p in report["products"]}
        for product in {b["product"] for b in wanted["bodies"]}:
            self.assertEqual(counts[product], sum(b["product"] == product for b in wanted["bodies"]))

    def test_own_files(self):
        self.check(self.folder / "own")

    def test_corpus(self):
        if not os.environ.get("SBDP_SHARED"):
            self.skipTest("SBDP_SHARED is not set")
        self.check(self.folder / "corpus")

    def test_same_bytes_again(self):
        file = self.folder / "own" / "as1.step"
        first = self.run_on(file)[1].read_bytes()
        self.assertEqual(first, self.run_on(file)[1].read_bytes())

    def test_version_and_usage(self):
        done = subprocess.run([self.program, "--version"], capture_output=True, text=True, timeout=60)
        self.assertEqual((done.returncode, len(done.stdout.splitlines())), (0, 1))
        done, out, _ = self.run_on(self.folder / "own" / "as1.step", "--deflection", "-1")
        self.assertEqual((done.returncode, out.exists()), (2, False))
        done, out, _ = self.run_on(self.folder / "own" / "is-not-there.step")
        self.assertEqual((done.returncode, out.exists()), (4, False))
        self.assertIn("is-not-there.step", done.stderr.splitlines()[-1])


for _converter in CONVERTERS:
    _name = f"Test_{Path(_converter).name}".replace("-", "_")
    globals()[_name] = type(_name, (Conformance, unittest.TestCase), {"converter": _converter})

if __name__ == "__main__":
    unittest.main()
