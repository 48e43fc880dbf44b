#!/usr/bin/env python3
"""Compares `sbdp statics` with an independent solver on random stacks of boxes.

usage: stacks.py SBDP OUT [--cases 200] [--seed 1] [--friction 0.3]     (needs numpy and scipy)

Each case is a ground and a few boxes, each of which stands on one or two others, some leaning over. All are upright, so
their contacts are rectangles that are computed here from the coordinates alone. `sbdp plan` takes the stack apart; for
every state of the plan scipy's HiGHS says whether forces exist at the corners of these rectangles, within pyramids in the
friction cones, that hold all boxes. Exits with 1 if any verdict differs that is not at its limit: where boxes grown or
shrunk by a thousandth give both answers.
"""
import argparse
import json
import math
import os
import random
import subprocess
import sys

import numpy as np
from scipy.optimize import linprog

SIDES = 16


def overlap(a, b):
    low, high = max(a[0], b[0]), min(a[1], b[1])
    return (low, high) if high - low > 1e-9 else None


def contacts(boxes, names, slack=0.0):
    """(upper, lower, point) of all corners at which a box rests on another, with edges moved in by `slack`."""
    for a in names:
        for b in names:
            upper, lower = boxes[a], boxes[b]
            if a != b and abs(upper[2][0] - lower[2][1]) < 1e-9:
                x, y = overlap(upper[0], lower[0]), overlap(upper[1], lower[1])
                if x and y:
                    for u in (x[0] + slack, x[1] - slack):
                        for v in (y[0] + slack, y[1] - slack):
                            yield a, b, np.array([u, v, upper[2][0]])


def stands(boxes, names, friction, slack=0.0):
    """Whether forces exist that hold all boxes but the ground."""
    free = [name for name in names if name != "ground"]
    if not free:
        return True
    row = {name: 6 * i for i, name in enumerate(free)}
    centre = {name: np.array([sum(side) / 2 for side in boxes[name]]) for name in free}
    columns = []
    for upper, lower, point in contacts(boxes, names, slack):
        for k in range(SIDES):
            angle = math.tau * k / SIDES
            force = np.array([friction * math.cos(angle), friction * math.sin(angle), 1.0])
            column = np.zeros(6 * len(free))
            for name, sign in ((upper, 1.0), (lower, -1.0)):
                if name in row:
                    i = row[name]
                    column[i : i + 3] = sign * force
                    column[i + 3 : i + 6] = sign * np.cross(point - centre[name], force)
            columns.append(column)
    if not columns:
        return False
    weight = np.zeros(6 * len(free))
    for name in free:
        weight[row[name] + 2] = math.prod(high - low for low, high in boxes[name])
    scale = np.abs(weight).max()
    answer = linprog(np.zeros(len(columns)), A_eq=np.array(columns).T, b_eq=weight / scale, bounds=(0, None), method="highs")
    return answer.status == 0


def stack(rng):
    boxes = {"ground": [(-200.0, 200.0), (-200.0, 200.0), (-20.0, 0.0)]}
    for i in range(rng.randint(2, 8)):
        size = [rng.uniform(20, 90), rng.uniform(20, 60), rng.uniform(8, 40)]
        for _ in range(100):
            on = boxes[rng.choice(list(boxes))]
            place = [(side[0] + side[1]) / 2 + rng.gauss(0, 0.25) * (side[1] - side[0]) for side in on[:2]]
            if on is boxes["ground"]:
                place = [rng.uniform(-60, 60), rng.uniform(-60, 60)]
            low = [place[0] - size[0] / 2, place[1] - size[1] / 2, on[2][1]]
            box = [(round(low[k], 3), round(low[k] + size[k], 3)) for k in range(3)]
            apart = lambda other: any(min(a[1], b[1]) - max(a[0], b[0]) < 1e-9 for a, b in zip(box, other))
            # Beside others at a distance: sides that touch would be contacts, too.
            aside = lambda other: any(min(a[1], b[1]) - max(a[0], b[0]) < -3 for a, b in zip(box[:2], other[:2]))
            above = lambda other: abs(box[2][0] - other[2][1]) < 1e-9 or abs(other[2][0] - box[2][1]) < 1e-9
            if all(apart(other) and (above(other) or aside(other) or gap(box, other)) for other in boxes.values()):
                boxes[f"box-{i}"] = box
                break
    return boxes


def gap(box, other):
    """Whether two boxes are far from each other in height."""
    return min(box[2][1], other[2][1]) - max(box[2][0], other[2][0]) < -3


def obj(box):
    corners = [[box[axis][i >> axis & 1] for axis in range(3)] for i in range(8)]
    faces = [(1, 3, 4, 2), (5, 6, 8, 7), (1, 2, 6, 5), (3, 7, 8, 4), (1, 5, 7, 3), (2, 4, 8, 6)]
    lines = [f"v {x} {y} {z}" for x, y, z in corners]
    return "\n".join(lines + [f"f {a} {b} {c}\nf {a} {c} {d}" for a, b, c, d in faces]) + "\n"


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("sbdp")
    parser.add_argument("out")
    parser.add_argument("--cases", type=int, default=200)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--friction", type=float, default=0.3)
    a = parser.parse_args()
    rng = random.Random(a.seed)
    counts = {"stands": 0, "falls": 0, "at the limit": 0}
    wrong = 0
    for case in range(a.cases):
        boxes = stack(rng)
        folder = os.path.join(a.out, f"stack-{case}")
        os.makedirs(folder, exist_ok=True)
        for old in os.listdir(folder):
            os.remove(os.path.join(folder, old))
        for name, box in boxes.items():
            with open(os.path.join(folder, f"{name}.obj"), "w") as file:
                file.write(obj(box))
        plan, states = os.path.join(a.out, f"{case}.plan.json"), os.path.join(a.out, f"{case}.json")
        quiet = ["--embedded", "--no-cache", "-q"]
        subprocess.run([a.sbdp, "plan", folder, "--base", "ground", "--json", plan, *quiet], check=True)
        asked = [a.sbdp, "statics", plan, "--json", states, "--friction", str(a.friction), "--gap", "0.01"]
        subprocess.run(asked, check=True, stdout=subprocess.DEVNULL)
        for state in json.load(open(states))["states"]:
            names = state["standing"]
            found = not state["unstable"] and not state["unknown"]
            expected = stands(boxes, names, a.friction)
            size = min(high - low for name in names for low, high in boxes[name])
            nearly = {stands(boxes, names, a.friction, slack) for slack in (1e-3 * size, -1e-3 * size)}
            if len(nearly) > 1:
                counts["at the limit"] += 1
            elif found != expected:
                wrong += 1
                print(f"stack {case}, after {state['after']}: sbdp says {'stands' if found else 'falls'}: {state}")
            else:
                counts["stands" if found else "falls"] += 1
    print(f"{a.cases} stacks: {', '.join(f'{count} {name}' for name, count in counts.items())}, {wrong} wrong")
    sys.exit(1 if wrong else 0)


if __name__ == "__main__":
    main()
