"""A controller's loop: plans, does one step after the other with a robot that is a stub, and plans again within a deadline
when a part is stuck: python controller.py [RUNTIME_DIR]. Without a runtime directory, it starts a daemon of its own."""

import random
import statistics
import sys
import tempfile
import time

import numpy
import sbdp

SIDE = 3  # Cubes along each axis.
DEADLINE = 0.5  # Seconds for each plan: what is known by then is done.

CUBE = numpy.array([[corner >> axis & 1 for axis in range(3)] for corner in range(8)], dtype=numpy.float64)
FACES = [[0, 2, 3], [0, 3, 1], [4, 5, 7], [4, 7, 6], [0, 1, 5], [0, 5, 4]]
FACES += [[2, 6, 7], [2, 7, 3], [0, 4, 6], [0, 6, 2], [1, 3, 7], [1, 7, 5]]


class StubRobot:
    """A robot from which a part does not come off now and then. The seed makes runs alike."""

    def __init__(self) -> None:
        self._random = random.Random(7)

    def perform(self, step: sbdp.Step) -> bool:
        return self._random.random() >= 0.15


def block() -> sbdp.Assembly:
    """A block of cubes with faces that touch."""
    triangles = numpy.array(FACES, dtype=numpy.uint32)
    places = [(place % SIDE, place // SIDE % SIDE, place // SIDE // SIDE) for place in range(SIDE**3)]
    return sbdp.assembly({f"cube-{i}": (CUBE + place, triangles) for i, place in enumerate(places)}, units="m")


def run(client: sbdp.Client) -> None:
    session = client.session(block())
    robot = StubRobot()
    stuck: list[str] = []
    latencies: list[float] = []
    done = 0
    while True:
        began = time.perf_counter()
        plan = session.replan(timeout=DEADLINE).result()
        latencies.append(1e3 * (time.perf_counter() - began))
        print(f"planned {len(plan)} steps in {latencies[-1]:.2f} ms")
        failed = None
        for step in plan.steps:
            if not robot.perform(step):
                failed = step
                break
            session.performed(step)
            done += 1
        if failed is not None:
            for part in failed.parts:
                print(f"{part} is stuck")
                session.stuck(part)
                stuck.append(part)
        elif plan.status == "timeout":
            continue
        elif stuck:
            # All others are out: somebody has loosened what was stuck.
            for part in stuck:
                session.freed(part)
            stuck.clear()
        else:
            print(f"{done} steps done, {len(plan.remaining)} parts stay")
            break
    print(f"{len(latencies)} plans: median {statistics.median(latencies):.2f} ms, longest {max(latencies):.2f} ms")


if len(sys.argv) > 1:
    with sbdp.connect(sys.argv[1]) as client:
        run(client)
else:
    with tempfile.TemporaryDirectory() as runtime_dir:
        with sbdp.Daemon(runtime_dir, quiet=True), sbdp.connect(runtime_dir) as client:
            run(client)
