"""The programs `sbdp-step`, `sbdp-step-ocp` and `sbdp-step-cascadio`. README.md has their contract."""

import argparse
import importlib.metadata
import importlib.util
import json
import math
import os
import sys
from pathlib import Path

from . import Refusal, __version__, part21
from .model import glb, products

OCP, CASCADIO = "cadquery-ocp-novtk", "cascadio"
REFUSED, UNUSABLE = 3, 4
INSTALL = 'install one with `pip install cadquery-ocp-novtk` (keeps all names) or `pip install cascadio` (smaller)'


def either():
    """OCP if it is installed, else cascadio."""
    found = next((name for name in (OCP, CASCADIO) if version(name)), None)
    run(found)


def ocp():
    run(OCP)


def cascadio():
    run(CASCADIO)


def version(package):
    try:
        return importlib.metadata.version(package)
    except importlib.metadata.PackageNotFoundError:
        return None


def identity(package):
    """What the output depends on, beside the arguments; the kernel is not loaded for it."""
    return f"sbdp-step {__version__} ({package} {version(package)})"


def positive(text):
    number = float(text)
    if not (math.isfinite(number) and number > 0):
        raise argparse.ArgumentTypeError("must be a positive number")
    return number


def run(package):
    if package is None or version(package) is None:
        fail(UNUSABLE, f"no kernel: {package or 'neither of the two'} is not installed; {INSTALL}")
    parser = argparse.ArgumentParser(description="Converts a STEP file to GLB, for sbdp. One JSON line on stdout says what was found.")
    parser.add_argument("input", metavar="IN", type=Path)
    parser.add_argument("output", metavar="OUT.glb", type=Path)
    parser.add_argument("--deflection", metavar="D", type=positive, required=True, help="mm: how far triangles may be from the surface")
    parser.add_argument("--angle", metavar="A", type=positive, required=True, help="radians: the angle between neighbouring triangles of a curve")
    parser.add_argument("--version", action="version", version=identity(package))
    given = parser.parse_args()
    report = os.fdopen(os.dup(1), "w", encoding="utf-8")
    # The kernels print to stdout.
    os.dup2(2, 1)
    try:
        line = convert(package, given)
    except Refusal as refusal:
        fail(REFUSED, refusal)
    except ImportError as error:
        fail(UNUSABLE, f"{package} cannot be loaded: {error}; install it again")
    except MemoryError:
        fail(REFUSED, "the memory that the converter may use is not enough for this file")
    except OSError as error:
        fail(UNUSABLE, error)
    except Exception as error:  # What the kernel throws has no common type; its own words are all there is.
        fail(REFUSED, f"the kernel failed: {type(error).__name__}: {error}".split("\n")[0])
    report.write(json.dumps(line, ensure_ascii=False) + "\n")
    report.flush()
    leave(0)


def convert(package, given):
    text = given.input.read_bytes()
    structure = part21.read(text)
    if package == OCP:
        from .with_ocp import convert as converted
    else:
        from .with_cascadio import convert as converted
    roots, reached, warnings = converted(given.input, text, structure, given.deflection, given.angle)
    found = products(roots)
    if not found:
        raise Refusal("there is no solid and no face in the file that could be tessellated")
    bytes_ = glb(roots, structure.unit)
    given.output.write_bytes(bytes_)
    return {
        "sbdp-step": 1,
        "converter": identity(package),
        "unit": structure.unit,
        "deflection": reached,
        "products": found,
        "warnings": [*structure.warnings, *dict.fromkeys(warnings)],
    }


def fail(code, reason):
    """The last line on stderr says why."""
    print(reason, file=sys.stderr, flush=True)
    leave(code)


def leave(code):
    """Ends without the kernel's destructors, which take long and crash at times."""
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(code)
