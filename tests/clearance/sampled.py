#!/usr/bin/env python3
"""Compares `sbdp clearance` with distances that another library measures (Manifold's min_gap) at poses along the way.

usage: sampled.py BINARY OUT [ASSEMBLY...] [--poses 60] [--steps 12]     (needs numpy and manifold3d)

ASSEMBLY is a folder with one OBJ file per part, units alike; without any, those of tests/assemblies that have just these.
Of each plan, steps spread over it are measured: at poses spread over the way, and where `sbdp clearance` says that it is
narrowest. No distance may be below the bound, and the narrowest one has to be what was said. Parts that are not closed
are left out, and said so.
"""
import argparse
import json
import subprocess
import sys
from pathlib import Path

import numpy as np
from manifold3d import Manifold, Mesh

# Coordinates are in single precision there: lengths are off by so much of the assembly's size.
ROUNDING = 1e-6


def solid(file):
    vertices, triangles = [], []
    for line in file.read_text().splitlines():
        words = line.split()
        if words[:1] == ["v"]:
            vertices.append([float(x) for x in words[1:4]])
        elif words[:1] == ["f"]:
            corners = [int(w.split("/")[0]) - 1 for w in words[1:]]
            triangles += [[corners[0], a, b] for a, b in zip(corners[1:], corners[2:])]
    mesh = Mesh(vert_properties=np.array(vertices, np.float32), tri_verts=np.array(triangles, np.uint32))
    mesh.merge()
    made = Manifold(mesh)
    return None if made.is_empty() else made


def matrix(waypoint):
    x, y, z, qw, qx, qy, qz = waypoint
    rotation = np.array([
        [1 - 2 * (qy * qy + qz * qz), 2 * (qx * qy - qz * qw), 2 * (qx * qz + qy * qw)],
        [2 * (qx * qy + qz * qw), 1 - 2 * (qx * qx + qz * qz), 2 * (qy * qz - qx * qw)],
        [2 * (qx * qz - qy * qw), 2 * (qy * qz + qx * qw), 1 - 2 * (qx * qx + qy * qy)],
    ])
    return np.column_stack([rotation, [x, y, z]])


def between(a, b, centre, share):
    """The centre moves on a line, the rotation slerps."""
    p, q = np.array(a[3:]), np.array(b[3:])
    q = q if p @ q >= 0 else -q
    angle = np.arccos(min(1.0, float(p @ q)))
    if angle < 1e-9:
        turned = q
    else:
        turned = (np.sin((1 - share) * angle) * p + np.sin(share * angle) * q) / np.sin(angle)
    at = lambda w: matrix(w) @ np.append(centre, 1.0)
    there = (1 - share) * at(a) + share * at(b)
    rotation = matrix([0, 0, 0, *turned])[:, :3]
    return np.column_stack([rotation, there - rotation @ centre])


def measured(binary, folder, out, options):
    """How many steps of an assembly were measured, and what is wrong."""
    plan_file = out / f"{folder.name}.json"
    command = [binary, "plan", folder, "--embedded", "--no-cache", "-q", "--json", plan_file]
    subprocess.run(command, check=False)
    plan = json.loads(plan_file.read_text())
    found = json.loads(subprocess.run([binary, "clearance", plan_file, "--json", "-"], capture_output=True, check=True).stdout)
    assert len(found["steps"]) == len(plan["steps"])
    solids = {part: solid(folder / f"{part}.obj") for part in plan["parts"]}
    for part in [part for part, made in solids.items() if made is None]:
        print(f"{folder.name}: {part} is not closed, left out")
    boxes = [s.bounding_box() for s in solids.values() if s]
    size = max(max(b[k + 3] for b in boxes) - min(b[k] for b in boxes) for k in range(3))
    standing = set(plan["parts"]) - set(plan["initial"]["removed"])
    wrong, steps = [], 0
    every = max(1, len(plan["steps"]) // options.steps)
    for step, clearance in zip(plan["steps"], found["steps"]):
        if step["ends"] != "out":
            sys.exit(f"{folder.name} has parts moved aside: not for this check")
        # Groups are taken apart elsewhere.
        if step["of"] is not None:
            continue
        standing -= set(step["parts"])
        closest = clearance["closest"]
        others = [p for p in standing if p not in clearance["touching"] and solids[p]]
        moving = [solids[p] for p in step["parts"] if solids[p]]
        if clearance["step"] % every or closest is None or not moving:
            continue
        steps += 1
        boxes = np.array([m.bounding_box() for m in moving])
        centre = (boxes[:, :3].min(axis=0) + boxes[:, 3:].max(axis=0)) / 2
        path = step["path"]
        pose = lambda segment, share: between(path[segment], path[min(segment + 1, len(path) - 1)], centre, share)

        def gap(motion):
            """The least distance, as far as it is below twice what was said."""
            reach = 2 * closest["distance"] + 100 * ROUNDING * size
            return min(m.transform(motion).min_gap(solids[o], reach) for m in moving for o in others)

        segments = len(path) - 1
        spread = [k / options.poses * segments for k in range(options.poses)]
        least = min([gap(pose(int(at), at - int(at))) for at in spread], default=np.inf)
        there = gap(pose(closest["segment"], closest["share"]))
        name = f"{folder.name} step {clearance['step']} ({', '.join(step['parts'])})"
        if least < closest["at_least"] - ROUNDING * size:
            wrong.append(f"{name}: bound {closest['at_least']}, but {least} was measured")
        if not closest["at_least"] - ROUNDING * size <= there <= closest["distance"] + ROUNDING * size:
            wrong.append(f"{name}: {closest['distance']} was said, but {there} is measured there")
        if closest["at_least"] < 0.9 * closest["distance"]:
            print(f"{name}: the bound {closest['at_least']} is far below {closest['distance']}")
    return steps, wrong


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("binary", type=Path)
    parser.add_argument("out", type=Path)
    parser.add_argument("assembly", type=Path, nargs="*")
    parser.add_argument("--poses", type=int, default=60)
    parser.add_argument("--steps", type=int, default=12)
    options = parser.parse_args()
    own = Path(__file__).resolve().parent.parent / "assemblies"
    names = ["bolt-washer-plate", "bolted-bracket-20", "l-slot", "pin-bolt-cover", "threaded-bolt-and-nut"]
    options.out.mkdir(parents=True, exist_ok=True)
    steps, wrong = 0, []
    for folder in options.assembly or [own / name for name in names]:
        count, found = measured(options.binary.resolve(), folder, options.out, options)
        steps, wrong = steps + count, wrong + found
        print(f"{folder.name}: {count} steps measured, {len(found)} wrong", flush=True)
    print("\n".join(wrong) if wrong else f"{steps} steps, none wrong")
    sys.exit(1 if wrong or steps == 0 else 0)


if __name__ == "__main__":
    main()
