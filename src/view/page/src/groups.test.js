import assert from "node:assert/strict";
import { test } from "node:test";
import { depth, putDown } from "./groups.js";

test("steps are as deep as the groups that they are in", () => {
  const scene = { steps: [{ of: null }, { of: 0 }, { of: 1 }, { of: null }] };
  assert.deepEqual([0, 1, 2, 3].map((step) => depth(scene, step)), [0, 1, 2, 0]);
});

test("a group is put down before it fades; one that never moved is there at the end", () => {
  const scene = { duration: 9, parts: [{ handled: [1, 4] }, { handled: [1, 4] }, { handled: null }] };
  assert.equal(putDown(scene, { parts: [0, 1] }), 4);
  assert.equal(putDown(scene, { parts: [2] }), 9);
});
