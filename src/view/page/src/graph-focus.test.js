import assert from "node:assert/strict";
import { test } from "node:test";
import { MOST, compact, focus } from "./graph-focus.js";
import { Selection } from "./selection.js";

/** A plate (0) that holds bolts, a pin (last but one) beside, and a lid (last) on all. */
function scene(bolts, blocked = []) {
  const names = ["plate", ...Array.from({ length: bolts }, (_, i) => `bolt ${i + 1}`), "pin", "lid"];
  const lid = names.length - 1;
  const parts = names.map((name, i) => ({ name, crosses: i === lid ? 1 : null, stays: true, steps: i === lid ? [0] : [], fixed: false }));
  const steps = [{ parts: [lid], begins: 0, ends: 1, of: null }];
  return { kind: "disassembly", parts, steps, blocked, duration: 1 };
}

function graph(bolts) {
  const edges = Array.from({ length: bolts }, (_, i) => [0, i + 1]);
  edges.push([1, bolts + 2]);
  const places = [[0, 5], ...Array.from({ length: bolts }, (_, i) => [i, 3]), [9, 3], [0, 0]];
  return { direction: "+z", rows: 6, columns: bolts, places, edges };
}

test("the step that comes next is shown with what it blocks, and nothing else", () => {
  const { parts, words } = focus(scene(5), graph(5), 0, new Selection(8));
  assert.deepEqual(parts, [7, 1]);
  assert.match(words, /lid/);
});

test("a picked part is shown with its neighbours that still stand", () => {
  const selection = new Selection(8);
  selection.pick(1);
  assert.deepEqual(focus(scene(5), graph(5), 0, selection).parts, [1, 7, 0]);
  assert.deepEqual(focus(scene(5), graph(5), 1, selection).parts, [1, 0]);
});

test("in the end what is stuck is shown with what blocks it", () => {
  const stuck = [{ part: 2, by: [0], action: "+z" }];
  assert.deepEqual(focus(scene(5, stuck), graph(5), 1, new Selection(8)).parts, [2, 0]);
});

test("of many neighbours some are left out, which is said", () => {
  const selection = new Selection(63);
  selection.pick(0);
  const { parts, words } = focus(scene(60), graph(60), 0, selection);
  assert.equal(parts.length, MOST);
  assert.match(words, new RegExp(`${61 - MOST} more parts`));
});

test("few parts stand close together, in rows as before", () => {
  const { places, rows, columns } = compact(graph(5), [0, 1, 2, 3, 7], 2);
  assert.deepEqual([rows, columns], [4, 2]);
  assert.equal(places.get(7)[1], 0);
  assert.deepEqual([1, 2, 3].map((p) => places.get(p)[1]), [1, 1, 2]);
  assert.equal(places.get(0)[1], 3);
  assert.equal(new Set([...places.values()].map(String)).size, 5);
  for (const count of [4, 5, 6, 7, 8, 9]) {
    const bolts = Array.from({ length: count }, (_, i) => i + 1);
    const { places } = compact(graph(count), bolts, 3);
    const of = (row) => [...places.values()].filter(([, r]) => r === row).map(([column]) => column);
    for (let row = 1; of(row).length > 0; row += 1) {
      assert.ok(of(row).every((column) => !of(row - 1).includes(column)), `${count} bolts: ${[...places.values()].join(" ")}`);
    }
  }
});
