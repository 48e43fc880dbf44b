"""Latency of plans that the daemon remembers, beside the Rust client, and memory over many plans.

    python latency.py REPEAT ASSEMBLY [PLANS]

REPEAT is the example `repeat` of the Rust client. Both ask one daemon in turns of 500, five times each; the medians are those
of the best turn. Then PLANS (10,000) plans are asked for: resident memory after a tenth of them, and at the end."""

import subprocess
import sys
import tempfile
import time
from pathlib import Path

import sbdp
from conftest import start
from test_process import resident

TURNS, ROUNDS = 5, 500


def median_us(ask):
    times = []
    for _ in range(ROUNDS):
        started = time.perf_counter()
        ask()
        times.append(time.perf_counter() - started)
    return 1e6 * sorted(times)[ROUNDS // 2]


def main():
    repeat, path = sys.argv[1:3]
    plans = int(sys.argv[3]) if len(sys.argv) > 3 else 10_000
    folder = Path(tempfile.mkdtemp())
    with start(folder), sbdp.connect(folder / "run") as client:
        assembly = sbdp.load(path)
        stream = client.plan(assembly)
        steps = len(stream.result())

        def views():
            for step in client.plan(assembly, views=True):
                step.path

        asked = {
            "whole plans": lambda: client.plan(assembly).result(),
            "steps, copied": lambda: [step.path for step in client.plan(assembly)],
            "steps, views": views,
            "as JSON": lambda: client.plan(assembly).result().to_json(),
        }
        command = [repeat, folder / "run", assembly.handle.hex(), str(ROUNDS)]
        best = dict.fromkeys(["Rust", *asked], float("inf"))
        for _ in range(TURNS):
            there = subprocess.run(command, check=True, capture_output=True, text=True).stdout
            best["Rust"] = min(best["Rust"], float(there))
            for name, ask in asked.items():
                best[name] = min(best[name], median_us(ask))
        print(f"{path}: {steps} steps; medians in µs")
        for name, time_us in best.items():
            print(f"  {name:14} {time_us:7.1f}")
        limit = 1.5 * best["Rust"] + 10
        print(f"  whole plans may take 1.5 times the Rust client's and 10 µs: {limit:.1f}")
        ask = asked["whole plans"]
        for _ in range(plans // 10):
            ask()
        before = resident()
        for _ in range(plans - plans // 10):
            ask()
        print(f"resident: {before} kB after {plans // 10} plans, {resident()} kB after {plans}")


if __name__ == "__main__":
    main()
