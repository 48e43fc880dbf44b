import assert from "node:assert/strict";
import { test } from "node:test";
import { Player } from "./player.js";
import { isMoving, isWaiting, placementAt, slerp, stands, stepAt, visibility } from "./timeline.js";

const still = [0, 0, 0, 0, 0, 0, 1];
const half = Math.SQRT1_2;

/** A cover that slides by 2 in a second, then a bolt that turns by a quarter in another. */
function scene(kind = "disassembly") {
  return {
    kind,
    duration: 2.2,
    steps: [step([1], 0, 1), step([2], 1.1, 2.1)],
    parts: [
      part([], null, null, []),
      part([0], 1, [0, 1], [0, 0.5, 1], [...still, 0, 0, 1, 0, 0, 0, 1, 0, 0, 2, 0, 0, 0, 1]),
      part([1], 2.1, [1.1, 2.1], [1.1, 2.1], [...still, 0, 0, 0, 0, 0, half, half]),
    ],
  };
}

/** Two parts leave together, the second goes aside within the group, and then out of it. */
function group(kind = "disassembly") {
  const at = (z) => [0, 0, z, 0, 0, 0, 1];
  const assembly = kind === "assembly";
  const second = [at(0), at(5), at(5), at(6), at(6), at(9)];
  return {
    kind,
    duration: 3.4,
    steps: assembly
      ? [step([2], 0, 1), step([2], 1.1, 2.1), step([1, 2], 2.2, 3.2)]
      : [step([1, 2], 0, 1), step([2], 1.1, 2.1), step([2], 2.2, 3.2)],
    parts: [
      part([], null, null, []),
      assembly
        ? part([2], 3.2, [0, 3.2], [2.2, 3.2], [...at(5), ...at(0)])
        : part([0], 1, [0, 3.2], [0, 1], [...at(0), ...at(5)]),
      part(
        [0, 1, 2],
        assembly ? 3.2 : 1,
        [0, 3.2],
        [0, 1, 1.1, 2.1, 2.2, 3.2],
        (assembly ? second.reverse() : second).flat(),
      ),
    ],
  };
}

const step = (parts, begins, ends) => ({ parts, begins, ends, after: [], words: "" });

const part = (steps, crosses, handled, times, keys = []) => ({
  steps,
  crosses,
  handled,
  times,
  keys: new Float32Array(keys),
  stays: steps.length === 0,
  start: keys.length ? keys.slice(0, 7) : still,
  assembled: still,
});

const close = (a, b) => a.forEach((x, i) => assert.ok(Math.abs(x - b[i]) < 1e-6, `${[...a]} is not ${b}`));

test("parts move on lines and turn the short way between keys", () => {
  const s = scene();
  close(placementAt(s, 0, 1.5), still);
  close(placementAt(s, 1, 0), still);
  close(placementAt(s, 1, 0.75), [0, 0, 1.5, 0, 0, 0, 1]);
  close(placementAt(s, 1, 9), [0, 0, 2, 0, 0, 0, 1]);
  close(placementAt(s, 2, 1.6).slice(3), [0, 0, Math.sin(Math.PI / 8), Math.cos(Math.PI / 8)]);
  close(slerp([0, 0, 0, 1], [0, 0, -half, -half], 1), [0, 0, half, half]);
});

test("what is out fades, and what is put in stays", () => {
  const s = scene();
  assert.deepEqual(
    [0, 0.9, 1, 2].map((t) => stands(s, 1, t)),
    [true, true, false, false],
  );
  assert.deepEqual(
    [0.5, 1.125, 2].map((t) => visibility(s, 1, t)),
    [1, 0.5, 0],
  );
  const together = scene("assembly");
  assert.deepEqual(
    [0, 0.9, 1, 2].map((t) => stands(together, 1, t)),
    [false, false, true, true],
  );
  assert.equal(visibility(together, 1, 2), 1);
  assert.equal(stands(together, 0, 0), true);
  together.parts[0].stays = false;
  assert.equal(stands(together, 0, 9), false, "what could not be put in waits for ever");
});

test("a part moves in each of its steps, and stands between them", () => {
  const s = group();
  const heights = [0, 0.5, 1, 1.05, 1.6, 2.15, 2.7, 3.3].map((t) => placementAt(s, 2, t)[2]);
  close(heights, [0, 2.5, 5, 5, 5.5, 6, 7.5, 9]);
  close(
    [0.5, 3].map((t) => placementAt(s, 1, t)[2]),
    [2.5, 5],
  );
  assert.deepEqual(
    [0.5, 1.05, 1.5, 2.15, 3, 3.3].map((t) => isMoving(s, 2, t)),
    [true, false, true, false, true, false],
  );
  assert.equal(isMoving(s, 1, 1.5), false);
});

test("a group stands out of the assembly and is seen until it is taken apart", () => {
  const s = group();
  for (const part of [1, 2]) {
    assert.deepEqual(
      [0.9, 1].map((t) => stands(s, part, t)),
      [true, false],
    );
    close(
      [1.05, 3.2, 3.325, 3.7].map((t) => visibility(s, part, t)),
      [1, 1, 0.5, 0],
    );
  }
  const together = group("assembly");
  for (const part of [1, 2]) {
    assert.deepEqual(
      [0, 0.1, 3].map((t) => isWaiting(together, part, t)),
      [true, false, false],
      "it is being put together",
    );
    assert.deepEqual(
      [3.1, 3.2].map((t) => stands(together, part, t)),
      [false, true],
    );
  }
});

test("the step at a time is the one that is not over", () => {
  assert.deepEqual(
    [0, 0.99, 1, 2, 2.1].map((t) => stepAt(scene(), t)),
    [0, 0, 1, 1, 2],
  );
});

test("the player steps on, back, and stops at the end", () => {
  const player = new Player(scene());
  player.next();
  assert.deepEqual([player.time, player.step], [1, 1]);
  player.next();
  player.previous();
  assert.equal(player.time, 1);
  player.previous();
  assert.equal(player.time, 0);
  player.playStep(0);
  for (let i = 0; i < 9; i += 1) player.tick(0.3);
  assert.deepEqual([player.time, player.playing], [1, false]);
  player.play();
  for (let i = 0; i < 9; i += 1) player.tick(0.3);
  assert.deepEqual([player.time, player.playing], [2.2, false]);
  player.play();
  assert.equal(player.time, 0, "from the end it begins anew");
});

test("without motion it goes from end to end", () => {
  const player = new Player(scene());
  player.stepwise = true;
  const times = [];
  player.play();
  for (let i = 0; i < 12; i += 1) {
    player.tick(0.5);
    times.push(player.time);
  }
  assert.deepEqual([...new Set(times)], [0, 1, 2.1, 2.2]);
});
