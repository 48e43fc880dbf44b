"""Plans out: streams, whole plans, views, sessions."""

import gc
import json

import numpy
import pytest
from conftest import ASSEMBLIES, box, chain, command_line, lattice

import sbdp

IDENTITY = [0, 0, 0, 1, 0, 0, 0]


def steps_of(stream):
    return [(step.number, step.parts, step.ends, step.path.tolist()) for step in stream]


def test_steps_come_as_arrays_with_names(client):
    assembly = sbdp.load(ASSEMBLIES / "pin-bolt-cover")
    stream = client.plan(assembly)
    seen = []
    for step in stream:
        assert step.number == len(seen)
        assert set(step.parts) <= set(assembly.parts)
        assert step.path.dtype == numpy.float64 and step.path.shape[1] == 7
        assert step.path[0].tolist() == IDENTITY
        assert step.path.flags.writeable and step.path is step.path
        assert all(before < step.number for before in step.requires)
        assert step.direction is None or abs(numpy.linalg.norm(step.direction) - 1) < 1e-9
        seen.append(step)
    assert stream.done and stream.status == "complete"
    assert list(stream) == []
    plan = stream.result()
    assert plan is stream.result()
    assert (plan.status, plan.reason, len(plan)) == ("complete", None, len(seen))
    assert [step.parts for step in plan.steps] == [step.parts for step in seen]
    moved = seen[0].parts[0]
    assert [step.number for step in plan.steps_of(moved)] == [0]
    assert set(plan.remaining) == set(assembly.parts) - {part for step in seen for part in step.parts}
    with pytest.raises(sbdp.NoSuchPartError, match="`none`"):
        plan.steps_of("none")


@pytest.mark.parametrize("folder", sorted(p.name for p in ASSEMBLIES.iterdir() if any(p.glob("*.obj"))))
@pytest.mark.parametrize("together", [False, True])
def test_json_is_what_the_command_line_writes(client, runtime_dir, folder, together):
    path = ASSEMBLIES / folder
    options = {"assembly": True} if together else {}
    assembly = sbdp.load(path)
    client.plan(assembly, **options).result()
    # From here on the daemon answers from memory, which is the same to the bit.
    there = command_line(runtime_dir, path, *(["--assembly"] if together else []))
    here = client.plan(assembly, **options).result()
    assert here.to_json().encode() == there
    assert here.to_dict() == json.loads(there)


def test_reports_and_orders_are_those_of_the_command_line(client, runtime_dir):
    path = ASSEMBLIES / "bolted-bracket-20"
    assembly = sbdp.load(path)
    words = ["--report", "stability,clearance,tools", "--up", "-z", "--friction", "0.3"]
    options = {"report": ["stability", "clearance", "tools"], "up": "-z", "friction": 0.3}
    for hands, more in ((None, []), (2, ["--hands", "2"])):
        asked = options | ({} if hands is None else {"hands": hands})
        here = client.plan(assembly, **asked).result().to_dict()
        there = json.loads(command_line(runtime_dir, path, *words, *more))
        assert here["steps"] == there["steps"] and here["initial"] == there["initial"]
        assert all(step["tools"] is not None and step["clearance"]["touching"] is not None for step in here["steps"])
        held = [sum(len(u["hold"][0]) for u in step["stability"]["unstable"]) for step in here["steps"]]
        assert max(held) > 1 if hands is None else max(held) == 1
    assert client.plan(assembly, hands=1, up="-z").result().status == "exhausted"
    for wrong in ({"report": "weather"}, {"hands": 0}):
        with pytest.raises(ValueError, match=next(iter(wrong))):
            client.plan(assembly, **wrong)
    with pytest.raises(sbdp.Error, match="friction"):
        client.plan(assembly, steady=True, friction=-1.0).result()


def test_options_mean_what_they_mean_on_the_command_line(client, runtime_dir):
    path = ASSEMBLIES / "pin-bolt-cover"
    assembly = sbdp.load(path, ignore=["nothing*"])
    part, other = assembly.parts[0], assembly.parts[1]
    for options, words in (
        ({"removed": other}, ["--removed", other]),
        ({"fixed": [part]}, ["--fixed", part]),
        ({"base": part, "actions": "paper"}, ["--base", part, "--actions", "paper"]),
        ({"keep": assembly.parts[1:3]}, ["--keep", other, "--keep", assembly.parts[2]]),
        ({"planner": "sbdp", "max_simulations": 50}, ["--planner", "sbdp", "--max-simulations", "50"]),
    ):
        client.plan(assembly, **options).result()
        there = command_line(runtime_dir, path, "--ignore", "nothing*", *words)
        assert client.plan(assembly, **options).result().to_json().encode() == there, words


def test_plans_of_arrays_have_no_source(client):
    plan = client.plan(lattice(2)).result().to_dict()
    assert "source" not in plan and plan["schema"] == "sbdp-plan/2" and len(plan["steps"]) == 7


def test_what_is_wrong_with_a_question_is_said(client):
    assembly = lattice(2)
    for options, error, words in (
        ({"targets": "9"}, sbdp.NoSuchPartError, "`9`"),
        ({"planner": "a-star"}, ValueError, "sbdp-star"),
        ({"colour": 1}, TypeError, "colour"),
        ({"timeout": -1.0}, ValueError, "timeout"),
        ({"staging": "none"}, ValueError, "assembly=True"),
        ({"moved": {"0": [1, 2]}}, ValueError, "pose"),
        ({"moved": {"0": [0, 0, 0, 2, 0, 0, 0]}}, ValueError, "length 1"),
    ):
        with pytest.raises(error, match=words):
            client.plan(assembly, **options)
    # The daemon's own refusals come with the first step.
    with pytest.raises(sbdp.Error) as refused:
        client.plan(assembly, targets="0", fixed="0").result()
    assert refused.value.code in (6, 7)
    vertices, triangles = box((0, 0, 0))
    with pytest.raises(sbdp.GeometryError, match="`flat`"):
        client.upload(sbdp.assembly({"flat": (vertices * [1, 1, 0], triangles), "a": box((5, 5, 5))}))


def test_deadlines_and_cancelling_end_a_plan_with_what_is_there(client):
    assembly = lattice(6)
    late = client.plan(assembly, timeout=0.05, no_cache=True)
    try:
        assert late.result().status in ("timeout", "complete")
    except sbdp.ExpiredError:
        pass
    stream = client.plan(assembly, no_cache=True)
    next(stream)
    with pytest.raises(sbdp.StreamOpenError):
        client.plan(assembly)
    stream.cancel()
    plan = stream.result()
    assert plan.status in ("cancelled", "complete") and len(plan) >= 1


def test_closing_frees_client_and_daemon(client):
    assembly = lattice(6)
    with client.plan(assembly, no_cache=True) as stream:
        next(stream)
    assert stream.done and list(stream) == []
    with pytest.raises(ValueError, match="closed"):
        stream.result()
    # A loop that is left, too.
    for _ in client.plan(assembly, no_cache=True):
        break
    gc.collect()
    client.plan(lattice(2)).result()
    while client.metrics()["running"]:
        pass


def test_polling_misses_nothing(client):
    assembly = lattice(3)
    whole = steps_of(client.plan(assembly, no_cache=True))
    stream, polled, waited = client.plan(assembly, no_cache=True), [], 0
    while not stream.done:
        if (step := stream.poll()) is not None:
            polled.append(step)
        else:
            waited += 1
    assert steps_of(polled) == whole and waited
    stream = client.plan(chain(60), no_cache=True)
    with pytest.raises(TimeoutError):
        stream.result(timeout=0.0)
    assert not stream.done


def test_views_are_read_only_and_own_what_they_show(client):
    assembly = lattice(3)
    copies = steps_of(client.plan(assembly))
    seen = []
    stream = client.plan(assembly, views=True)
    for step in stream:
        seen.append((step.number, step.parts, step.ends, step.path.tolist()))
    assert seen == copies
    assert stream.summary["status"] == "complete" and stream.summary["steps"] == []

    stream = client.plan(assembly, views=True)
    first = next(stream)
    view = first.path
    assert not view.flags.writeable and not view.flags.owndata
    with pytest.raises(ValueError):
        view[0, 0] = 1.0
    with pytest.raises(ValueError):
        view.flags.writeable = True
    with pytest.raises(BufferError, match="copy what you keep"):
        next(stream)
    part = view[:, :3]
    del view
    with pytest.raises(BufferError):
        next(stream)
    kept = part.copy()
    del part
    second = next(stream)
    assert second.number == 1
    with pytest.raises(BufferError, match="ended"):
        first.path
    with pytest.raises(BufferError, match="views=True"):
        stream.result()
    # A view outlives its stream.
    view = second.path
    stream.close()
    del stream, second
    gc.collect()
    assert view.tolist() == copies[1][3] and kept.tolist() == [row[:3] for row in copies[0][3]]


def test_a_session_plans_what_is_left(client):
    assembly = lattice(2)
    session = client.session(assembly)
    plan = session.replan().result()
    out, stuck = plan.steps[0].parts[0], plan.steps[1].parts[0]
    session.performed(plan.steps[0])
    session.stuck(stuck)
    session.moved(plan.steps[2].parts[0], IDENTITY)
    rest = session.replan(timeout=60.0).result()
    expected = client.plan(assembly, removed=out, fixed=stuck, moved={plan.steps[2].parts[0]: IDENTITY})
    assert steps_of(rest.steps) == steps_of(expected)
    session.freed(stuck)
    session.executed(assembly.parts)
    assert len(session.replan().result()) == 0
    with pytest.raises(sbdp.NoSuchPartError):
        session.stuck("none")
    with pytest.raises(sbdp.UnsupportedError):
        client.session(assembly, assembly=True)


def test_pandas_gets_tables(client):
    pandas = pytest.importorskip("pandas")
    plan = client.plan(lattice(2)).result()
    steps, path = sbdp.steps_frame(plan), sbdp.path_frame(plan)
    assert isinstance(steps, pandas.DataFrame) and list(steps.index) == list(range(7))
    assert steps.loc[3, "parts"] == plan.steps[3].parts
    assert path.loc[2].to_numpy().tolist() == plan.steps[2].path.tolist()
