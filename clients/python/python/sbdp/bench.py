"""Benchmarks over many processes or machines: ``python -m sbdp.bench --out OUT [--ray ADDRESS | --workers N] DIR…``.

The runs are those of ``sbdp bench units``, one line of JSON each. A queue hands them out one by one, to processes of this
machine or to the workers of a Ray cluster; each is run by ``sbdp bench run-unit``, and its record is appended to
``OUT/results.jsonl`` as soon as it is there. A run whose worker is lost, or that gave no record, is tried once more; the
others do not notice. What has a record in OUT is not run again: the same command goes on where it stopped. At the end
``sbdp bench report`` writes the tables.
"""

from __future__ import annotations

import argparse
import fcntl
import json
import os
import shutil
import subprocess
import sys
import sysconfig
from collections import deque
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from pathlib import Path
from typing import Any, Callable, Iterator, Protocol

#: Times that a unit is run: once more where a worker was lost. At 1 a lost worker leaves a gap, and more than 2 only
#: repeat what fails for a reason of its own.
TRIES = 2
#: As of an interrupted benchmark of the command line.
LEFT = 5


class NoRecord(Exception):
    """A run without a record; the message says why."""


def run_unit(program: str, line: str) -> str:
    """Runs one line of ``sbdp bench units``; the line of its record."""
    ran = subprocess.run([program, "bench", "run-unit"], input=line + "\n", capture_output=True, text=True, check=False)
    if ran.returncode != 0:
        said = ran.stderr.strip().splitlines()
        raise NoRecord(said[-1] if said else f"ended with {ran.returncode}")
    return ran.stdout.strip()


class Workers(Protocol):
    """Something that runs units side by side."""

    def start(self, line: str) -> Any:
        """Starts a unit. Returns a token for it."""

    def ended(self, running: list[Any]) -> tuple[Any, Callable[[], str]]:
        """Waits for one of the running units. Returns its token, and its record (or what it raises)."""

    def free(self, running: int) -> bool:
        """Whether one more can run beside those that run, given their number."""


class LocalWorkers:
    """Processes of this machine."""

    def __init__(self, program: str, count: int) -> None:
        self.program, self.count = program, count
        self.pool = ThreadPoolExecutor(count)

    def start(self, line: str) -> Future[str]:
        return self.pool.submit(run_unit, self.program, line)

    def ended(self, running: list[Future[str]]) -> tuple[Future[str], Callable[[], str]]:
        first = next(iter(wait(running, return_when=FIRST_COMPLETED).done))
        return first, first.result

    def free(self, running: int) -> bool:
        return running < self.count


class RayWorkers:
    """Workers of a Ray cluster. The program and the assemblies are at the same places on all its machines."""

    def __init__(self, program: str, address: str, processors: float) -> None:
        import ray

        self.ray, self.processors = ray, processors
        ray.init(address=address, log_to_driver=False)
        # Ray's own retries would run a unit more often than `TRIES`.
        self.function = ray.remote(num_cpus=processors, max_retries=0)(run_unit)
        self.program = program

    def start(self, line: str) -> Any:
        return self.function.remote(self.program, line)

    def ended(self, running: list[Any]) -> tuple[Any, Callable[[], str]]:
        first = self.ray.wait(running, num_returns=1)[0][0]
        return first, lambda: self.ray.get(first)

    def free(self, running: int) -> bool:
        # Machines may join and leave.
        return running < max(1, self.ray.cluster_resources().get("CPU", 1) // self.processors)


def key(line: str) -> tuple[Any, ...]:
    """What no two runs of a benchmark share."""
    run = json.loads(line)
    return run["assembly"], run["rotation"], run["planner"], run["engine"]


def run_all(units: list[str], workers: Workers, recorded: Callable[[str], None]) -> dict[str, str]:
    """Runs units; those that have no record in the end, with the reason. ``recorded`` takes each record at once."""
    to_do, running = deque((line, 1) for line in units), {}
    missing: dict[str, str] = {}
    while to_do or running:
        while to_do and workers.free(len(running)):
            line, turn = to_do.popleft()
            running[workers.start(line)] = line, turn
        over, record = workers.ended(list(running))
        line, turn = running.pop(over)
        try:
            recorded(record())
        except KeyboardInterrupt:
            raise
        except Exception as error:  # noqa: BLE001 - whatever a worker may die of
            if turn < TRIES:
                to_do.append((line, turn + 1))
            else:
                missing[line] = str(error).strip().splitlines()[-1]
    return missing


class Results:
    """The results file of a benchmark, as ``sbdp bench`` writes it."""

    def __init__(self, folder: Path) -> None:
        folder.mkdir(parents=True, exist_ok=True)
        self.file = open(folder / "results.jsonl", "a+", encoding="utf-8")
        try:
            fcntl.flock(self.file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise SystemExit(f"{self.file.name}: another benchmark is writing it") from None
        self.file.seek(0)
        text = self.file.read()
        # A line that was not written to its end is no record.
        whole = text[: text.rfind("\n") + 1]
        self.file.truncate(len(whole.encode()))
        self.known = {key(line) for line in whole.splitlines()}

    def append(self, record: str) -> None:
        self.file.write(record + "\n")
        self.file.flush()


def _program(given: str | None) -> str:
    beside = Path(sysconfig.get_path("scripts")) / "sbdp"
    found = given or (str(beside) if beside.exists() else shutil.which("sbdp"))
    if not found or not os.access(found, os.X_OK):
        raise SystemExit(f"{found or 'sbdp'}: no such program; give it by --sbdp")
    return os.path.realpath(found)


def _units(program: str, arguments: list[str]) -> Iterator[str]:
    listed = subprocess.run([program, "bench", "units", *arguments], stdout=subprocess.PIPE, text=True, check=False)
    if listed.returncode != 0:
        raise SystemExit(listed.returncode)
    yield from listed.stdout.splitlines()


def main(arguments: list[str] | None = None) -> int:
    """The command; other arguments than its own are those of ``sbdp bench units``."""
    parser = argparse.ArgumentParser(prog="python -m sbdp.bench", description=__doc__.split("\n\n", 1)[0])
    parser.add_argument("--out", type=Path, required=True, help="where results and tables go; goes on there")
    parser.add_argument("--sbdp", help="the program, at the same place on all machines [default: beside Python, else on PATH]")
    where = parser.add_mutually_exclusive_group()
    where.add_argument("--workers", type=int, default=1, help="runs at a time, on this machine")
    where.add_argument("--ray", metavar="ADDRESS", help="a Ray cluster, as `auto` or `ray://HOST:10001`; `local` starts one")
    parser.add_argument("--processors", type=float, default=1, help="that a run takes of a Ray cluster")
    own, others = parser.parse_known_args(arguments)
    if own.workers < 1 or own.processors <= 0:
        parser.error("--workers and --processors are at least 1 and more than 0")

    program = _program(own.sbdp)
    units = list(_units(program, others))
    results = Results(own.out)
    left = [line for line in units if key(line) not in results.known]
    workers = RayWorkers(program, own.ray, own.processors) if own.ray else LocalWorkers(program, own.workers)
    done = len(units) - len(left)

    def recorded(record: str) -> None:
        nonlocal done
        results.append(record)
        done += 1
        run = json.loads(record)
        print(f"{done}/{len(units)}: {run['assembly']} {run['planner']} {run['engine']}: {run['status']}", file=sys.stderr)

    missing = run_all(left, workers, recorded)
    results.file.close()
    for line, reason in missing.items():
        print(f"no record of {' '.join(map(str, key(line)))}: {reason}", file=sys.stderr)
    if len(missing) < len(units):
        subprocess.run([program, "bench", "report", str(own.out)], check=True)
    return LEFT if missing else 0


if __name__ == "__main__":
    sys.exit(main())
