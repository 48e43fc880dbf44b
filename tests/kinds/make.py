#!/usr/bin/env python3
"""Writes random members of kinds of mechanisms whose answer is known by construction.

usage: make.py OUT [--kinds keyhole,thread,...] [--cases 20] [--seed 1] [--beam N]     (needs numpy and manifold3d)

OUT/index.json lists them; OUT/kinds/ID/ holds one OBJ file per part and assembly.json, whose notes give the numbers
that were drawn. Lengths are millimetres, z is up. `planned` members come apart; `infeasible` ones never do.
The play of a fit is drawn between 0.02 and 0.3, evenly on a logarithmic scale.
With --beam, a fixed beam stands beside each, N times as long as the mechanism: the answer is the same.
"""
import argparse
import json
import math
import os

import numpy as np
from manifold3d import CrossSection, JoinType, Manifold

# Corners of a circle: its chords are 0.001 of the radius from it, less than half of the least play.
ROUND = 72


def box(low, high):
    low, high = np.array(low, float), np.array(high, float)
    return Manifold.cube((high - low).tolist()).translate(low.tolist())


def cylinder(radius, low, high, corners=ROUND):
    return Manifold.cylinder(high - low, radius, radius, corners).translate((0, 0, low))


def prism(section, low, high):
    return Manifold.extrude(section, high - low).translate((0, 0, low))


def sector(inner, outer, middle, half, low, high):
    """A piece of a ring: angles in radians."""
    count = max(2, math.ceil(2 * half * ROUND / math.tau) + 1)
    angles = np.linspace(middle - half, middle + half, count)
    arc = lambda radius, angles: [(radius * math.cos(a), radius * math.sin(a)) for a in angles]
    return prism(CrossSection([arc(outer, angles) + arc(inner, angles[::-1])]), low, high)


def play_of(rng):
    return float(np.exp(rng.uniform(math.log(0.02), math.log(0.3))))


def tilt_lid(rng, comes_apart):
    """A lid between walls, with a tongue under a lip: the far end is lifted, then the tongue pulled out."""
    length, width, thickness = rng.uniform(18, 40), rng.uniform(10, 25), rng.uniform(1.2, 3)
    tongue, play = rng.uniform(0.06, 0.12) * length, play_of(rng)
    # The far end is above the wall once the tongue has turned by thickness / length.
    height = 0.5 * thickness + thickness * tongue / length * (rng.uniform(1.8, 3) if comes_apart else 0.3)
    if comes_apart:
        # While the far end rises, the upper edge at the tongue moves back by more than the lid gets shorter.
        play = max(play, 0.35 * (1.5 * thickness - height) ** 2 / length)
    wall = 2.0
    outer = box([-tongue - wall - 1, -wall - play, -8], [length + wall + play, width + wall + play, thickness])
    room = box([0, -play, 0], [length + play, width + play, thickness + 1])
    inside = box([2, 2, -6], [length - 2, width - 2, 1])
    pocket = box([-tongue - play, -play, 0], [1, width + play, height])
    lid = box([play, 0, 0], [length, width, thickness]) + box([-tongue, 0, 0], [1, width, 0.5 * thickness])
    return [outer - room - inside - pocket, lid], dict(length=length, thickness=thickness, tongue=tongue, play=play, pocket=height)


def keyhole(rng, comes_apart):
    """A headed pin in a slot with a round hole somewhere along it."""
    neck, play, plate = rng.uniform(2, 4), play_of(rng), rng.uniform(1.5, 4)
    head = neck * rng.uniform(1.4, 2.2)
    length, at = rng.uniform(12, 30), rng.uniform(0.25, 1)
    hole = head + play if comes_apart else head * 0.95
    low, high = [-12, -12, 0], [length + 12, 12, plate]
    slot = box([0, -neck - play, -1], [length, neck + play, plate + 1])
    ends = [cylinder(neck + play, -1, plate + 1).translate((x, 0, 0)) for x in (0, length)]
    opening = cylinder(hole, -1, plate + 1).translate((at * length, 0, 0))
    cap = rng.uniform(1.5, 3)
    knob = head * rng.uniform(1.2, 1.6)
    pin = cylinder(neck, -0.5, plate + 0.5) + cylinder(head, -0.5 - cap, -0.1) + cylinder(knob, plate + 0.1, plate + 3)
    begin = rng.uniform(0, 0.1) * length
    return [box(low, high) - slot - ends[0] - ends[1] - opening, pin.translate((begin, 0, 0))], dict(neck=neck, head=head, hole=hole, at=at, length=length, play=play)


def polygon(rng):
    corners = int(rng.choice([3, 4, 6, 8, ROUND]))
    turn = rng.uniform(0, math.tau)
    points = [(math.cos(turn + math.tau * i / corners), math.sin(turn + math.tau * i / corners)) for i in range(corners)]
    return CrossSection([points]), corners


def window(rng, comes_apart):
    """A prism in a closed corridor, with a window of its own outline in the roof."""
    section, corners = polygon(rng)
    section = section.scale((rng.uniform(2, 4),) * 2)
    play, height, length = play_of(rng), rng.uniform(2, 6), rng.uniform(15, 40)
    low, high = np.array(section.bounds()[:2]), np.array(section.bounds()[2:])
    # The corridor is a little wider than the prism, so that it meets the window aside.
    wide = rng.uniform(0, 1.5)
    room = box([low[0] - play, low[1] - play, 0], [high[0] + length, high[1] + play + wide, height + play])
    walls = box([low[0] - 3, low[1] - 3, -2], [high[0] + length + 3, high[1] + 3 + wide, height + 3])
    outline = section.offset(play if comes_apart else -0.04 * (high[1] - low[1]), JoinType.Miter)
    at = (rng.uniform(0.15, 0.9) * length, rng.uniform(0, wide))
    roof = prism(outline, height - 1, height + 5).translate((*at, 0))
    return [walls - room - roof, prism(section, 0, height)], dict(corners=corners, play=play, at=list(at), length=length)


def loose(rng, comes_apart):
    """A ball or a cube that floats in a box with one hole."""
    size, play = rng.uniform(2, 4), rng.uniform(0.1, 1)
    room = [rng.uniform(2.5, 5) * size for _ in range(3)]
    is_ball = rng.random() < 0.5
    half = size + play if comes_apart else 0.95 * size
    body = Manifold.sphere(size, 32) if is_ball else box([-size] * 3, [size] * 3)
    hole = cylinder(half, 0, 100, 48) if is_ball else box([-half, -half, 0], [half, half, 100])
    shift = [rng.uniform(-1, 1) * max(0.0, room[i] - half) for i in range(2)]
    floats = [rng.uniform(-0.8, 0.8) * (room[i] - size) for i in range(3)]
    walls = box([-r - 2 for r in room], [r + 2 for r in room]) - box([-r for r in room], room)
    return [walls - hole.translate((*shift, 0)), body.translate(floats)], dict(ball=bool(is_ball), size=size, play=play, room=room)


def steps_per_turn(radius, play):
    """So many that the facets of a twisted hole take half of the play at most, and what has play is not stopped: their
    diagonals go two steps around the axis, and lie as far inside as an arc of two steps is high. A multiple of 6."""
    return 6 * max(12, math.ceil(math.tau / math.acos(1 - play / 2 / radius) / 6))


def thread(rng, comes_apart):
    """A nut on a bolt, one to three starts, right or left; captive with a second head above the nut."""
    starts, right, play = int(rng.integers(1, 4)), rng.random() < 0.5, play_of(rng)
    radius, pitch = rng.uniform(3, 6), rng.uniform(1, 2.5)
    lead, depth = starts * pitch, 0.4 * pitch
    around = steps_per_turn(radius + play, play)
    angles = np.arange(around) * math.tau / around
    ridge = 2 * np.abs((angles * starts / math.tau) % 1 - 0.5)
    outline = lambda extra: CrossSection([[((radius - depth * (1 - h) + extra) * math.cos(a), (radius - depth * (1 - h) + extra) * math.sin(a)) for a, h in zip(angles, ridge)]])
    turns = rng.uniform(1, 3)
    height = turns * lead

    def screw(section, low, high):
        steps = max(1, math.ceil((high - low) / lead * around))
        twist = (360 if right else -360) * (high - low) / lead
        begin = math.degrees((math.tau if right else -math.tau) * low / lead)
        return Manifold.extrude(section, high - low, steps, twist).rotate((0, 0, begin)).translate((0, 0, low))

    above = rng.uniform(0.2, 1.5) * lead
    bolt = screw(outline(0), -0.5, height + above) + cylinder(1.5 * radius, -3, -0.4, 6)
    if not comes_apart:
        bolt += cylinder(1.5 * radius, height + above - 0.1, height + above + 2)
    across = CrossSection([[(1.7 * radius * math.cos(math.tau * i / 6), 1.7 * radius * math.sin(math.tau * i / 6)) for i in range(6)]])
    nut = prism(across, 0.05, height) - screw(outline(play), -lead, height + lead)
    return [bolt, nut], dict(starts=starts, right=bool(right), play=play, radius=radius, pitch=pitch, turns=turns)


def bayonet(rng, comes_apart):
    """Lugs in a groove, with slots to the top: turned to the slots, then pulled. The groove goes all round or ends there."""
    lugs, play = int(rng.integers(1, 5)), play_of(rng)
    inner, height = rng.uniform(4, 7), rng.uniform(1.5, 3)
    outer = inner + rng.uniform(1.5, 3)
    spread = math.tau / lugs
    half = rng.uniform(0.06, 0.15) * spread
    turn = rng.uniform(2.6 * half, min(spread - 2.6 * half, 3)) * rng.choice([-1, 1])
    is_round = rng.random() < 0.5
    gap = play / outer
    socket = cylinder(outer + 3, -4, height + 5)
    socket -= cylinder(inner + play, -2, height + 6)
    pin = cylinder(inner, -1.5, height + 10)
    for lug in range(lugs):
        at = lug * spread
        pin += sector(0.5 * inner, outer, at, half, 0, height)
        slot_half = half + gap if comes_apart else 0.9 * half
        socket -= sector(0.5 * inner, outer + play, at + turn, slot_half, -play, height + 6)
        if not is_round:
            reach = half + abs(turn) / 2 + gap
            socket -= sector(0.5 * inner, outer + play, at + turn / 2, reach, -play, height + play)
    if is_round:
        socket -= cylinder(outer + play, -play, height + play)
    return [socket, pin], dict(lugs=lugs, play=play, inner=inner, outer=outer, half=half, turn=turn, all_round=bool(is_round))


def flats(rng, comes_apart):
    """A shaft with two flats in a bearing with a slot, a head at each end: it turns until they are along the slot."""
    play, radius = play_of(rng), rng.uniform(3, 5)
    slot = radius * rng.uniform(0.7, 1.4)
    turned = rng.uniform(0.5, 2.6) * rng.choice([-1, 1])
    across = slot - 2 * play if comes_apart else slot + rng.uniform(0.3, 0.8)
    bearing = box([-9, -9, 0], [9, 9, 6]) - cylinder(radius + play, -1, 7) - box([0, -slot / 2, -1], [10, slot / 2, 7])
    shaft = cylinder(radius, -2, 8) ^ box([-9, -across / 2, -3], [9, across / 2, 9])
    shaft = shaft.rotate((0, 0, math.degrees(turned)))
    shaft += cylinder(1.3 * radius, 6 + play, 8) + cylinder(1.3 * radius, -2, -play)
    return [bearing, shaft], dict(play=play, radius=radius, slot=slot, across=across, turned=turned)


def corkscrew(rng, comes_apart):
    """A helical wire in a block; captive with a foot below the block."""
    play, wire, radius = play_of(rng), rng.uniform(0.6, 1.2), rng.uniform(2.5, 4)
    lead, turns, right = rng.uniform(5, 9), rng.uniform(0.8, 2.5), rng.random() < 0.5
    height = turns * lead

    def helix(thick, low, high):
        sides = max(24, math.ceil(math.pi / math.acos(1 - play / 4 / thick)))
        section = CrossSection.circle(thick, sides).translate((radius, 0))
        twist = (360 if right else -360) * (high - low) / lead
        begin = math.degrees((math.tau if right else -math.tau) * low / lead)
        steps = math.ceil((high - low) / lead * steps_per_turn(radius + thick, play))
        return Manifold.extrude(section, high - low, steps, twist).rotate((0, 0, begin)).translate((0, 0, low))

    grip = cylinder(1.5 * radius, height + 1, height + 4)
    screw = helix(wire, 0, height + 2) + grip
    below = -1.0
    block = box([-8, -8, -3], [8, 8, height]) - helix(wire + play, below, height + 1)
    if not comes_apart:
        block = box([-8, -8, 0], [8, 8, height]) - helix(wire + play, -1, height + 1)
        screw += helix(wire, -1, 0.5) + cylinder(1.5 * radius, -3, -0.5)
    return [block, screw], dict(play=play, wire=wire, radius=radius, lead=lead, turns=turns, right=bool(right))


def rivet(rng, comes_apart):
    """Two plates on a rivet; one that comes apart has a head small enough for the holes."""
    neck, play, heights = rng.uniform(2, 4), play_of(rng), rng.uniform(1, 4, 2)
    top = heights.sum()
    slack = rng.uniform(0, 0.5)
    head = neck * rng.uniform(1.3, 1.8)
    other = neck if comes_apart else neck * rng.uniform(1.15, 1.8)
    plates = []
    for low, high in ((0, heights[0]), (heights[0], top)):
        half = rng.uniform(1.8, 3) * neck
        plates.append(box([-half, -half, low], [half, half, high]) - cylinder(neck + play, low - 1, high + 1))
    pin = cylinder(neck, -0.5, top + 0.5) + cylinder(head, -2, 0) + cylinder(other, top + slack, top + slack + 2)
    return [*plates, pin], dict(neck=neck, play=play, head=head, other=other, slack=slack)


def snap_hook(rng, comes_apart):
    """Two legs with barbs through a hole of a plate: rigid, so captive; without barbs it comes out."""
    wide, deep, plate, play = rng.uniform(8, 14), rng.uniform(4, 8), rng.uniform(2, 4), play_of(rng)
    leg = rng.uniform(1.2, 2)
    barb = 0 if comes_apart else rng.uniform(0.15, 0.25) * wide
    hole = box([-wide / 2 - play, -deep / 2 - play, -1], [wide / 2 + play, deep / 2 + play, plate + 1])
    frame = box([-wide, -deep, 0], [wide, deep, plate]) - hole
    body = box([-0.75 * wide, -0.75 * deep, plate], [0.75 * wide, 0.75 * deep, plate + 3])
    for side in (-1, 1):
        x = sorted([side * wide / 2, side * (wide / 2 - leg)])
        body += box([x[0], -deep / 2, -2], [x[1], deep / 2, plate + 1])
        if barb:
            tip = sorted([side * (wide / 2 + barb), side * (wide / 2 - leg)])
            body += box([tip[0], -deep / 2, -2], [tip[1], deep / 2, -0.05])
    return [frame, body], dict(wide=wide, plate=plate, play=play, barb=barb)


KINDS = [tilt_lid, keyhole, window, loose, thread, bayonet, flats, corkscrew, rivet, snap_hook]
# Of these kinds, mostly captive members are drawn; of the others, one in four.
MOSTLY_CAPTIVE = {rivet, snap_hook}


def write(folder, parts, about):
    os.makedirs(folder, exist_ok=True)
    for number, part in enumerate(parts):
        mesh = part.to_mesh()
        with open(os.path.join(folder, f"{number}.obj"), "w") as out:
            out.writelines("v %.9g %.9g %.9g\n" % tuple(v) for v in mesh.vert_properties[:, :3])
            out.writelines("f %d %d %d\n" % tuple(f + 1) for f in mesh.tri_verts)
    with open(os.path.join(folder, "assembly.json"), "w") as out:
        json.dump(about, out, indent=1)


def beam(parts, times):
    """A beam beside some parts, `times` as long as they are."""
    low, high = (np.array([part.bounding_box() for part in parts]).reshape(-1, 2, 3)[:, i] for i in (0, 1))
    low, high = low.min(axis=0), high.max(axis=0)
    length = float((high - low).max())
    begin = high[1] + 0.5 * length
    return box([low[0], begin, low[2]], [low[0] + times * length, begin + length, low[2] + length])


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out")
    parser.add_argument("--kinds", default=",".join(kind.__name__ for kind in KINDS))
    parser.add_argument("--cases", type=int, default=20)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--beam", type=float, help="how many times as long as the mechanism the beam beside it is")
    options = parser.parse_args()
    known = {kind.__name__: kind for kind in KINDS}
    wanted = options.kinds.split(",")
    unknown = [name for name in wanted if name not in known]
    if unknown:
        parser.error(f"no kind is called {unknown[0]!r}; there are {', '.join(known)}")
    index = []
    for name in wanted:
        kind = known[name]
        for case in range(options.cases):
            rng = np.random.default_rng([options.seed, case, *name.encode()])
            comes_apart = case % 4 == 0 if kind in MOSTLY_CAPTIVE else case % 4 != 3
            parts, drawn = kind(rng, comes_apart)
            pieces = [len(part.decompose()) for part in parts]
            if pieces != [1] * len(parts):
                raise SystemExit(f"{name} {case}: a part falls into {max(pieces)} pieces: {drawn}")
            if options.beam:
                parts.append(beam(parts, options.beam))
            expect = "planned" if comes_apart else "infeasible"
            row = dict(set="kinds", id=f"{name}_{case:02}", parts=len(parts), expect=expect, kind=name)
            about = dict(name=row["id"], units="mm", expect=expect, notes=kind.__doc__, drawn=drawn)
            if options.beam:
                about["fixed"] = [str(len(parts) - 1)]
            write(os.path.join(options.out, "kinds", row["id"]), parts, about)
            index.append(row)
    with open(os.path.join(options.out, "index.json"), "w") as out:
        json.dump(index, out, indent=1)
    print(f"{len(index)} assemblies in {options.out}")


if __name__ == "__main__":
    main()
