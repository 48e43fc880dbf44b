import assert from "node:assert/strict";
import { test } from "node:test";
import { depth, shownAt } from "./groups.js";

test("steps are as deep as the groups that they are in", () => {
  const scene = { steps: [{ of: null }, { of: 0 }, { of: 1 }, { of: null }] };
  assert.deepEqual([0, 1, 2, 3].map((step) => depth(scene, step)), [0, 1, 2, 0]);
});

test("a group that is out is shown before it fades, others at the end", () => {
  const out = { crosses: 3, handled: [1, 4] };
  const aside = { crosses: null, handled: [1, 2] };
  const scene = { duration: 9, parts: [out, out, { crosses: null, handled: null }, aside] };
  assert.equal(shownAt(scene, { parts: [0, 1] }), 4);
  assert.equal(shownAt(scene, { parts: [2, 3] }), 9);
});
