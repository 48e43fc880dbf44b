"""Where parts stand at a moment of a plan, and in an exploded view."""

from types import SimpleNamespace

import numpy
import pytest
import sbdp
from conftest import ASSEMBLIES, box
from sbdp.explosion import Leaving, exploded
from sbdp.motion import is_rigid, matrix, pose

STILL = [0, 0, 0, 1, 0, 0, 0]
# Two points of a quarter turn about z, and a half one about x.
HALF = numpy.sqrt(0.5)
QUARTER_Z = [3, 0, 1, HALF, 0, 0, HALF]
HALF_X = [0, 0, 5, 0, 1, 0, 0]


def step(number, parts, path, of=None, ends="out"):
    return SimpleNamespace(number=number, parts=tuple(parts), path=numpy.array(path, float), of=of, ends=ends)


def cubes(*corners):
    return {name: box(corner)[0] for name, corner in zip("abc", corners)}


def test_poses_and_matrices():
    random = numpy.random.default_rng(1)
    for _ in range(100):
        turn = random.normal(size=4)
        turn *= numpy.sign(turn[0]) / numpy.linalg.norm(turn)
        given = numpy.array([*random.normal(size=3), *turn])
        made = matrix(given)
        assert is_rigid(made)
        numpy.testing.assert_allclose(pose(made), given, atol=1e-12)
    assert pose(matrix(HALF_X)).tolist() == HALF_X
    assert not is_rigid(numpy.diag([2.0, 1, 1, 1])) and not is_rigid(numpy.diag([-1.0, 1, 1, 1]))


def test_the_middle_goes_along_a_line_while_the_part_turns():
    motion = sbdp.Motion([step(0, "a", [STILL, QUARTER_Z])], cubes([2, 0, 0]))
    assert motion.legs[0].shares.tolist() == [0, 1]
    halfway = motion.at(0.5)["a"]
    centre = numpy.array([2.5, 0.5, 0.5, 1])
    there = (centre + matrix(QUARTER_Z) @ centre) / 2
    numpy.testing.assert_allclose(halfway @ centre, there, atol=1e-12)
    # An eighth of a turn.
    numpy.testing.assert_allclose(halfway[:2, :2], [[HALF, -HALF], [HALF, HALF]], atol=1e-12)
    numpy.testing.assert_allclose(motion.at(1)["a"], matrix(QUARTER_Z), atol=1e-15)
    numpy.testing.assert_allclose(motion.at(0)["a"], numpy.eye(4), atol=0)


def test_both_signs_of_a_quaternion_are_one_rotation():
    other = [*QUARTER_Z[:3], *(-q for q in QUARTER_Z[3:])]
    one, two = (sbdp.Motion([step(0, "a", [STILL, end])], cubes([0, 0, 0])).at(0.3)["a"] for end in (QUARTER_Z, other))
    numpy.testing.assert_allclose(one, two, atol=1e-12)


def test_shares_follow_the_way():
    path = [STILL, [1, 0, 0, 1, 0, 0, 0], [1, 3, 0, 1, 0, 0, 0]]
    motion = sbdp.Motion([step(0, "a", path)], cubes([0, 0, 0]))
    assert motion.legs[0].shares.tolist() == [0, 0.25, 1]
    assert motion.at(0.625)["a"][:3, 3].tolist() == [1, 1.5, 0]
    # One that does not move, and one with waypoints in one place.
    for path in ([STILL], [STILL, STILL, STILL]):
        motion = sbdp.Motion([step(0, "a", path)], cubes([0, 0, 0]))
        for moment in (0, 0.1, 0.5, 1):
            numpy.testing.assert_allclose(motion.at(moment)["a"], numpy.eye(4), atol=0)


def test_what_was_left_aside_goes_on_from_there():
    steps = [step(0, "a", [STILL, QUARTER_Z], ends="aside"), step(1, "a", [STILL, HALF_X])]
    motion = sbdp.Motion(steps, cubes([2, 0, 0]))
    numpy.testing.assert_allclose(motion.at(2)["a"], matrix(HALF_X) @ matrix(QUARTER_Z), atol=1e-12)
    # The box as it stands then: about (3 − 0.5, 2.5, 1.5).
    numpy.testing.assert_allclose(motion.legs[1].centre, [2.5, 2.5, 1.5], atol=1e-12)


def test_a_group_is_taken_apart_as_it_stood():
    steps = [step(0, "ab", [STILL, QUARTER_Z]), step(1, "b", [STILL, HALF_X], of=0)]
    motion = sbdp.Motion(steps, cubes([0, 0, 0], [1, 0, 0], [5, 5, 5]))
    end = motion.at(2)
    numpy.testing.assert_allclose(end["a"], matrix(QUARTER_Z), atol=1e-12)
    numpy.testing.assert_allclose(end["b"], matrix(QUARTER_Z) @ matrix(HALF_X), atol=1e-12)
    numpy.testing.assert_allclose(end["c"], numpy.eye(4), atol=0)
    numpy.testing.assert_allclose(motion.legs[1].centre, [1.5, 0.5, 0.5], atol=1e-12)


def test_steps_that_contradict_each_other():
    for steps, words in (
        ([step(0, "a", [STILL]), step(1, "a", [STILL])], "it is in 0"),
        ([step(0, "z", [STILL])], "vertices are not given"),
        ([step(0, "a", [STILL], ends="in")], "play these backwards"),
    ):
        with pytest.raises(ValueError, match=words):
            sbdp.Motion(steps, cubes([0, 0, 0]))


@pytest.mark.parametrize("folder", sorted(p.name for p in ASSEMBLIES.iterdir() if any(p.glob("*.obj"))))
def test_plans_of_the_daemon(client, folder):
    assembly = sbdp.load(ASSEMBLIES / folder)
    plan = client.plan(assembly).result()
    motion = sbdp.Motion(plan.steps, {part: assembly.mesh(part)[0] for part in assembly.parts})
    assert len(motion) == len(plan)
    before = motion.at(0)
    for number in range(len(plan)):
        # Nothing jumps at the borders of steps.
        now = motion.at(number + 1e-12)
        for part in assembly.parts:
            numpy.testing.assert_allclose(now[part], before[part], atol=1e-6)
        before = motion.at(number + 1)
    moved = {part for step in plan.steps for part in step.parts}
    for part in assembly.parts:
        if part not in moved:
            assert before[part].tolist() == numpy.eye(4).tolist()
    shifts = motion.exploded()
    assert set(shifts) == set(assembly.parts)


def cube(corner, side=1.0):
    low = numpy.array(corner, dtype=float)
    return low, low + side


def test_exploded_parts_stop_behind_what_they_pass():
    # As the tests of src/view/explode.rs have it.
    boxes = {str(i): cube(corner) for i, corner in enumerate([[0, 0, 0], [0, 0, 1.2], [0, 0, 9], [5, 5, 5]])}
    boxes["moving"] = cube([0, 0, 0])
    way = numpy.array([[0.5, 0.5, 0.5], [0.5, 0.5, 99]])
    shifts = exploded(boxes, [Leaving(0, None, ("moving",), way)])
    numpy.testing.assert_allclose(shifts["moving"], [0, 0, 2.35], atol=1e-12)
    assert not any(shifts[name].any() for name in "0123")


def test_exploded_parts_of_a_group_go_with_it():
    boxes = {"ground": cube([0, 0, 0]), "lower": cube([0, 0, 1]), "upper": cube([0, 0, 2])}
    up = numpy.array([[0.5, 0.5, 2], [0.5, 0.5, 50]])
    aside = numpy.array([[0.5, 0.5, 2.5], [50, 0.5, 2.5]])
    shifts = exploded(boxes, [Leaving(0, None, ("lower", "upper"), up), Leaving(1, 0, ("upper",), aside)])
    assert shifts["lower"][2] > 0 and shifts["lower"][0] == 0
    assert shifts["upper"][2] == shifts["lower"][2] and shifts["upper"][0] > 1
