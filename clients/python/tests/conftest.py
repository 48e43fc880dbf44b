"""A daemon of its own for the tests, with its own memory and folders."""

import os
import subprocess
import tempfile
from pathlib import Path

import numpy
import pytest

import sbdp

ASSEMBLIES = Path(os.environ.get("SBDP_TEST_ASSEMBLIES", Path(__file__).parents[3] / "tests/assemblies"))


def start(folder):
    """A daemon that remembers nothing of other runs."""
    os.environ["SBDP_CACHE_DIR"] = str(folder / "cache")
    return sbdp.Daemon(folder / "run", arguments=["--root", str(folder / "iox")])


@pytest.fixture(scope="session")
def runtime_dir():
    with tempfile.TemporaryDirectory() as folder, start(Path(folder)):
        yield Path(folder) / "run"


@pytest.fixture
def place():
    """A folder with a short path: sockets lie in it."""
    with tempfile.TemporaryDirectory() as folder:
        yield Path(folder)


@pytest.fixture
def client(runtime_dir):
    with sbdp.connect(runtime_dir, reconnect=0.0) as client:
        yield client


@pytest.fixture
def own_daemon(place):
    """One that a test may kill: (daemon, runtime folder)."""
    daemon = start(place)
    try:
        yield daemon, place / "run"
    finally:
        daemon.stop()


def box(corner, size=(1.0, 1.0, 1.0)):
    """A box as vertices, float64, and triangles, uint32."""
    corners = numpy.array([[i & 1, i >> 1 & 1, i >> 2] for i in range(8)], dtype=float)
    triangles = [[0, 2, 3], [0, 3, 1], [4, 5, 7], [4, 7, 6], [0, 1, 5], [0, 5, 4]]
    triangles += [[2, 6, 7], [2, 7, 3], [0, 4, 6], [0, 6, 2], [1, 3, 7], [1, 7, 5]]
    return corners * size + corner, numpy.array(triangles, dtype=numpy.uint32)


def lattice(n):
    """n × n × n boxes, each touching its neighbours."""
    cells = [(x, y, z) for x in range(n) for y in range(n) for z in range(n)]
    return sbdp.assembly({str(i): box(cell) for i, cell in enumerate(cells)}, units="mm")


def chain(links):
    """Rings through each other, cut open by less than they are thick: nothing but a long search shows that the chain does
    not come apart."""
    around, across = 24, 12
    i, j = (grid.ravel() for grid in numpy.meshgrid(range(around), range(across), indexing="ij"))
    turn, roll = 2 * numpy.pi * i / around, 2 * numpy.pi * j / across
    radius = 5 + 1.5 * numpy.cos(roll)
    x, side, off = radius * numpy.cos(turn), radius * numpy.sin(turn), 1.5 * numpy.sin(roll)
    i, j = i[: -across], j[: -across]
    a, b = across * i + j, across * (i + 1) + j
    c, d = across * (i + 1) + (j + 1) % across, across * i + (j + 1) % across
    faces = [numpy.stack([a, b, c], 1), numpy.stack([a, c, d], 1)]
    fan = numpy.array([[0, n + 1, n] for n in range(1, across - 1)])
    faces += [fan, (around - 1) * across + fan[:, ::-1]]
    triangles = numpy.concatenate(faces).astype(numpy.uint32)

    def link(number):
        y, z = (side, off) if number % 2 == 0 else (-off, side)
        return numpy.stack([x + 6.75 * number, y, z], 1), triangles

    return sbdp.assembly({str(number): link(number) for number in range(links)})


def command_line(runtime_dir, *arguments):
    """What `sbdp plan … --json -` writes, through the daemon of these tests."""
    environment = {**os.environ, "SBDP_RUNTIME_DIR": str(runtime_dir)}
    command = [os.environ["SBDP"], "plan", *map(str, arguments), "--daemon", "--json", "-"]
    return subprocess.run(command, env=environment, check=False, capture_output=True).stdout
