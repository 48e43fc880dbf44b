"""The daemon's death, threads, forks, signals, memory, and packages that are not there."""

import os
import signal
import subprocess
import sys
import threading
import time
import traceback
from pathlib import Path

import pytest
from conftest import ASSEMBLIES, chain, lattice

import sbdp


def test_without_a_daemon_the_error_says_to_start_one(place):
    with pytest.raises(sbdp.NoDaemonError, match="`sbdpd`"):
        sbdp.connect(place / "run")


def test_a_daemon_is_started_where_none_runs_and_left_running(place):
    program = "import sbdp, sys; print(sbdp.connect(sys.argv[1], start=True).pid)"
    environment = {**os.environ, "SBDP_CACHE_DIR": str(place / "cache")}
    command = [sys.executable, "-c", program, str(place / "run")]
    pid = int(subprocess.run(command, env=environment, check=True, capture_output=True).stdout)
    try:
        with sbdp.connect(place / "run", start=True) as client:
            assert client.pid == pid
            assert client.plan(lattice(2)).result().status == "complete"
    finally:
        os.kill(pid, signal.SIGTERM)


def test_a_daemon_that_is_killed_is_an_error(own_daemon):
    daemon, runtime_dir = own_daemon
    client = sbdp.connect(runtime_dir, reconnect=0.0)
    stream = client.plan(chain(60), no_cache=True)
    while stream.progress is None:
        stream.poll(0.01)
    os.kill(daemon.pid, signal.SIGKILL)
    with pytest.raises(sbdp.NoDaemonError, match="went away before it had answered: restart `sbdpd`"):
        stream.result()
    assert stream.done
    with pytest.raises(sbdp.NoDaemonError):
        client.metrics()


def test_a_daemon_that_is_restarted_is_followed(own_daemon, place):
    from conftest import start

    daemon, runtime_dir = own_daemon
    assembly = lattice(5)
    client = sbdp.connect(runtime_dir)
    whole = [step.parts for step in client.plan(assembly, no_cache=True)]
    stream = client.plan(assembly, no_cache=True)
    next(stream)
    os.kill(daemon.pid, signal.SIGKILL)
    daemon.stop()
    with start(place):
        plan = stream.result()
        assert [step.parts for step in plan.steps] == whole
        assert (stream.restarts, client.restarts) == (1, 1)


def test_threads_run_while_a_plan_is_waited_for(client):
    stream, counted, done = client.plan(chain(60), no_cache=True, timeout=1.0), [0], threading.Event()

    def count():
        while not done.is_set():
            counted[0] += 1
            time.sleep(0.001)

    thread = threading.Thread(target=count)
    thread.start()
    stream.result()
    done.set()
    thread.join()
    assert counted[0] > 100


def test_threads_share_a_client(client):
    assembly, errors = lattice(3), []
    expected = client.pid

    def ask():
        try:
            for _ in range(100):
                assert client.metrics()["pid"] == expected
                assert client.knows(assembly)
        except BaseException as error:
            errors.append(error)

    client.upload(assembly)
    threads = [threading.Thread(target=ask) for _ in range(3)]
    for thread in threads:
        thread.start()
    plans = [len(client.plan(assembly).result()) for _ in range(100)]
    for thread in threads:
        thread.join()
    assert not errors and set(plans) == {26}


def interrupted(runtime_dir, program):
    """Seconds from Ctrl-C to the end of a program that waits; it says `ready` before."""
    # A shell has processes in the background ignore it, and Python leaves that so.
    program = "import signal; signal.signal(signal.SIGINT, signal.default_int_handler)\n" + program
    command = [sys.executable, "-c", program, str(runtime_dir), str(Path(__file__).parent)]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    # One that does not hear would wait for ever.
    stuck = threading.Timer(60, process.kill)
    stuck.start()
    assert process.stdout.readline() == "ready\n"
    time.sleep(0.3)
    sent = time.clock_gettime(time.CLOCK_MONOTONIC)
    process.send_signal(signal.SIGINT)
    caught = process.stdout.readline()
    assert process.wait() == 0 and caught
    stuck.cancel()
    return float(caught) - sent


WAITING = {
    "next": "for step in client.plan(long, no_cache=True): pass",
    "result": "client.plan(long, no_cache=True).result()",
    "metrics": "client.metrics()",
    "upload": "client.upload(lattice(2))",
}


@pytest.mark.parametrize("what", WAITING)
def test_an_interrupt_is_heard_in_every_wait(own_daemon, what):
    daemon, runtime_dir = own_daemon
    program = f"""
import os, signal, sys, time, threading
sys.path.append(sys.argv[2])
import sbdp
from conftest import chain, lattice
client = sbdp.connect(sys.argv[1])
long = chain(60)
client.upload(long)
# The signal is for all threads: one that waits elsewhere must not keep it.
threading.Thread(target=time.sleep, args=(3,), daemon=True).start()
# A daemon that hangs answers nothing.
os.kill(client.pid, signal.SIGSTOP)
print("ready", flush=True)
try:
    {WAITING[what]}
except KeyboardInterrupt:
    print(time.clock_gettime(time.CLOCK_MONOTONIC), flush=True)
"""
    try:
        took = interrupted(runtime_dir, program)
    finally:
        os.kill(daemon.pid, signal.SIGCONT)
    print(f"{what}: {1000 * took:.1f} ms")


def test_a_handler_of_the_caller_is_called_and_its_error_raised(client):
    class Late(Exception):
        pass

    def late(*_):
        raise Late

    before = signal.signal(signal.SIGALRM, late)
    try:
        stream = client.plan(chain(60), no_cache=True)
        signal.setitimer(signal.ITIMER_REAL, 0.1)
        with pytest.raises(Late):
            stream.result()
        assert not stream.done
        stream.close()
    finally:
        signal.signal(signal.SIGALRM, before)


def test_a_forked_child_is_refused_and_takes_nothing_along(client):
    assembly = lattice(3)
    stream = client.plan(assembly, no_cache=True)
    first = next(stream)
    child = os.fork()
    if child == 0:
        code = 1
        try:
            refused = 0
            for ask in (client.metrics, lambda: client.plan(assembly), lambda: next(stream)):
                try:
                    ask()
                except sbdp.ForkedError:
                    refused += 1
            del first, stream
            client.close()
            code = 0 if refused == 3 else 2
        except BaseException:
            traceback.print_exc()
        finally:
            os._exit(code)
    assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 0
    assert len(stream.result()) == 26
    assert client.metrics()["pid"] == client.pid
    # The child may connect for itself.
    assert client.plan(assembly).result().status == "complete"


def resident():
    for line in Path("/proc/self/status").read_text().splitlines():
        if line.startswith("VmRSS"):
            return int(line.split()[1])


def test_memory_is_flat_over_many_plans(client):
    assembly = sbdp.load(ASSEMBLIES / "pin-bolt-cover")
    for views in (False, True):

        def plans(count):
            for _ in range(count):
                stream = client.plan(assembly, views=views)
                if views:
                    for step in stream:
                        step.path.sum()
                else:
                    stream.result().to_json()

        plans(500)
        before = resident()
        plans(5000)
        after = resident()
        print(f"views={views}: {before} kB after 500 plans, {after} kB after 5,500")
        assert after - before < 1024


def test_neither_pandas_nor_trimesh_is_needed():
    hidden = "import sys; sys.modules['pandas'] = sys.modules['trimesh'] = None; import sbdp; print(sbdp.__version__)"
    subprocess.run([sys.executable, "-c", hidden], check=True)


def test_every_name_has_a_type():
    import ast

    stub = ast.parse((Path(sbdp.__file__).parent / "_native.pyi").read_text())
    classes = {node.name: node for node in stub.body if isinstance(node, ast.ClassDef)}
    for name in ("Assembly", "Client", "Plan", "PlanStream", "Session", "Step"):
        typed = {node.name for node in classes[name].body if isinstance(node, ast.FunctionDef)}
        there = {member for member in vars(getattr(sbdp, name)) if not member.startswith("_")}
        assert there <= typed, (name, there - typed)
        assert typed - {"__init__", "__enter__", "__exit__", "__next__", "__len__"} <= there, name
    assert (Path(sbdp.__file__).parent / "py.typed").exists()
