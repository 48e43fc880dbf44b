import assert from "node:assert/strict";
import { test } from "node:test";
import { arranged, nearest, overlap } from "./balloons.js";

const picture = { width: 900, height: 600 };
const name = (x, y) => ({ x, y, width: 70, height: 18 });

function apart(boxes) {
  const placed = boxes.filter(Boolean);
  placed.forEach((a, i) => {
    assert.ok(a.x >= 0 && a.y >= 0 && a.x + a.width <= picture.width && a.y + a.height <= picture.height, JSON.stringify(a));
    placed.slice(i + 1).forEach((b) => assert.ok(!overlap(a, b, 0), `${JSON.stringify(a)} ${JSON.stringify(b)}`));
  });
  return placed.length;
}

test("a name alone stands up to the right of its part", () => {
  const [box] = arranged([name(400, 300)], picture);
  assert.ok(box.x > 400 && box.y + box.height < 300 && box.x < 425 && box.y > 270, JSON.stringify(box));
});

test("names at one place are moved apart, and all are there", () => {
  const all = arranged(Array.from({ length: 12 }, () => name(400, 300)), picture);
  assert.equal(apart(all), 12);
});

test("names at the rim stay inside", () => {
  const rim = [name(0, 0), name(900, 0), name(0, 600), name(900, 600), name(899, 300)];
  assert.equal(apart(arranged(rim, picture)), 5);
});

test("of more names than fit the first ones are there", () => {
  const crowd = Array.from({ length: 2000 }, (_, i) => name(400 + (i % 7), 300 + (i % 5)));
  const all = arranged(crowd, picture);
  const count = apart(all);
  assert.ok(count > 12 && count < 2000, `${count}`);
  assert.ok(all[0] && all.at(-1) === null);
});

test("a leader ends at the name", () => {
  const box = { x: 10, y: 20, width: 30, height: 10 };
  assert.deepEqual(nearest(box, { x: 0, y: 100 }), { x: 10, y: 30 });
  assert.deepEqual(nearest(box, { x: 25, y: 0 }), { x: 25, y: 20 });
});
