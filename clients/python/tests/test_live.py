"""Assemblies that are edited between plans: what is sent, and that the plans are those of the edited assembly."""

import os
import signal
import time

import numpy
import pytest
import sbdp
from conftest import box, chain, start


def live_box(size=(1.0, 1.0, 1.0), where=(0.0, 0.0, 0.0)):
    vertices, triangles = box([0, 0, 0], size)
    return sbdp.LivePart(vertices, triangles, numpy.block([[numpy.eye(3), numpy.array(where)[:, None]], [0, 0, 0, 1]]))


def stack():
    return {"ground": live_box((4, 4, 1)), "middle": live_box(where=(1, 1, 1)), "top": live_box(where=(1, 1, 2))}


@pytest.fixture
def live(runtime_dir):
    made = sbdp.LiveAssembly("mm", connect=lambda: sbdp.connect(runtime_dir, reconnect=0.0))
    yield made
    made.forget()


def paths(plan):
    return [(step.parts, step.path.tolist()) for step in plan.steps]


def anew(client, parts):
    return client.plan(sbdp.assembly({name: part.mesh() for name, part in parts.items()}, units="mm")).result()


def test_only_what_changed_is_sent(live, client):
    parts = stack()
    job = live.plan(parts)
    assert job.result().status == "complete"
    assert str(job.change) == "sent: all 3 parts"

    job = live.plan(parts)
    job.join()
    assert str(job.change) == "nothing had changed, nothing was sent"

    parts["top"] = live_box(where=(1, 1, 2.5))
    job = live.plan(parts)
    assert job.result().to_dict()["initial"]["poses"]["top"][:3] == [0, 0, 0.5]
    assert (job.change.moved, job.change.replaced) == (("top",), ())

    parts["middle"] = live_box((1, 1, 1.5), (1, 1, 1))
    job = live.plan(parts)
    assert paths(job.result()) == paths(anew(client, parts))
    assert (job.change.moved, job.change.replaced) == (("top",), ("middle",))

    del parts["top"]
    parts["side"] = live_box(where=(2.5, 1, 1))
    job = live.plan(parts)
    plan = job.result()
    assert plan.to_dict()["initial"]["removed"] == ["top"]
    assert {part for step in plan.steps for part in step.parts} | set(plan.remaining) == set(parts)
    assert (job.change.added, job.change.removed) == (("side",), ("top",))
    assert str(job.change) == "sent: side added; top removed"

    # What is there again is moved back, and not sent.
    parts["top"] = live_box(where=(1, 1, 2.5))
    job = live.plan(parts)
    assert job.result().status == "complete"
    assert (job.change.moved, job.change.replaced, job.change.added, job.change.removed) == (("top",), (), (), ())


class Spy:
    """A client, and what goes through it."""

    def __init__(self, client):
        self.client, self.sent = client, []

    def revise(self, base, parts):
        self.sent.append([name for name, *_ in parts])
        return self.client.revise(base, parts)

    def __getattr__(self, name):
        return getattr(self.client, name)


def test_moved_parts_need_no_upload_and_new_shapes_one_of_their_own(runtime_dir, client):
    spies = []
    live = sbdp.LiveAssembly(connect=lambda: spies.append(Spy(sbdp.connect(runtime_dir))) or spies[-1])
    parts = {name: part._replace(vertices=part.vertices * 1.1) for name, part in stack().items()}
    live.plan(parts).result()
    uploads = client.metrics()["uploads"]
    parts["top"] = parts["top"]._replace(placement=live_box(where=(1, 1, 3)).placement)
    live.plan(parts).result()
    assert client.metrics()["uploads"] == uploads
    parts["middle"] = parts["middle"]._replace(vertices=parts["middle"].vertices * 0.9)
    live.plan(parts).result()
    assert client.metrics()["uploads"] == uploads + 1
    (spy,) = spies
    assert spy.sent == [["middle"]]
    live.forget()


def test_scaled_and_mirrored_parts(live):
    parts = stack()
    placement = parts["top"].placement
    live.plan(parts).result()
    parts["top"] = parts["top"]._replace(placement=placement @ numpy.diag([-1.0, 1, 1, 1]))
    job = live.plan(parts)
    job.result()
    # It is another shape, though its box is much the same.
    assert job.change.replaced == ("top",)
    vertices, triangles = parts["top"].mesh()
    corners = vertices[triangles] - vertices.mean(axis=0)
    assert numpy.linalg.det(corners).sum() / 6 == pytest.approx(1)


def test_a_revision_is_planned_like_an_upload(client):
    first = sbdp.assembly({"a": box([0, 0, 0]), "b": box([0, 0, 1])}, units="mm")
    client.upload(first)
    taller = box([0, 0, 1], (1, 1, 2))
    revised = client.revise(first, [("b", *taller), ("c", *box([0, 0, 3]))])
    assert revised.parts == ("a", "b", "c") and revised.units == "mm"
    numpy.testing.assert_array_equal(revised.mesh("b")[0], taller[0])
    whole = sbdp.assembly({"a": box([0, 0, 0]), "b": taller, "c": box([0, 0, 3])}, units="mm")
    assert paths(client.plan(revised).result()) == paths(client.plan(whole).result())
    assert client.knows(revised) and revised.handle != whole.handle
    # And of a revision, another one.
    again = client.revise(revised, [("a", *box([0, 0, -1], (1, 1, 2)))])
    assert client.plan(again).result().status == "complete"
    with pytest.raises(sbdp.UnknownHandleError):
        client.revise(sbdp.assembly({"x": box([7, 7, 7])}), [("x", *taller)])
    with pytest.raises(sbdp.GeometryError, match="flat"):
        client.revise(first, [("flat", *box([0, 0, 0], (1, 1, 0)))])


def test_a_daemon_that_was_started_anew_gets_all_again(place):
    daemons = [start(place)]
    live = sbdp.LiveAssembly(connect=lambda: sbdp.connect(place / "run", reconnect=0.0))
    try:
        parts = stack()
        live.plan(parts).result()
        daemons[0].stop()
        job = live.plan(parts)
        with pytest.raises(sbdp.NoDaemonError):
            job.result()
        daemons.append(start(place))
        job = live.plan(parts)
        assert job.result().status == "complete"
        assert job.change.whole
    finally:
        live.forget()
        for daemon in daemons:
            daemon.stop()


def test_a_daemon_is_started_where_none_runs(place, monkeypatch):
    monkeypatch.setenv("SBDP_RUNTIME_DIR", str(place / "run"))
    monkeypatch.setenv("SBDP_CACHE_DIR", str(place / "cache"))
    live = sbdp.LiveAssembly()
    with pytest.raises(sbdp.NoDaemonError):
        sbdp.connect()
    try:
        assert live.plan(stack()).result().status == "complete"
    finally:
        live.forget()
        with sbdp.connect() as client:
            os.kill(client.pid, signal.SIGTERM)


def test_the_program_is_found_where_pip_puts_it(place, monkeypatch):
    monkeypatch.delenv("SBDPD", raising=False)
    # `pip install --target`: the package and the programs are in one folder.
    (place / "sbdp").mkdir()
    (place / "bin").mkdir()
    program = place / "bin" / "sbdpd"
    program.write_text("")
    program.chmod(0o755)
    monkeypatch.setattr(sbdp.daemon, "__file__", str(place / "sbdp" / "daemon.py"))
    assert sbdp.daemon.program() == str(program)


def test_a_part_that_is_refused_is_named_and_nothing_of_it_is_kept(live):
    parts = stack()
    live.plan(parts).result()
    parts["middle"] = live_box((1, 1, 0), (1, 1, 1))
    with pytest.raises(sbdp.GeometryError, match="middle"):
        live.plan(parts).result()
    assert not live.was_sent
    assert live.plan(stack()).result().status == "complete"
    with pytest.raises(ValueError, match="no part"):
        live.plan({}).result()


def test_cancelling(live):
    assembly = chain(6)
    parts = {name: sbdp.LivePart(*assembly.mesh(name), numpy.eye(4)) for name in assembly.parts}
    job = live.plan(parts)
    while job.progress is None and job.is_alive():
        time.sleep(0.01)
    assert job.is_alive()
    job.cancel()
    assert job.result().status == "cancelled"
    assert live.plan(stack()).result().status == "complete"
