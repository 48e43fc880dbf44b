import assert from "node:assert/strict";
import { test } from "node:test";
import { partWord, partWords } from "./names.js";

test("names of digits alone are parts", () => {
  assert.equal(partWord("4"), "part 4");
  assert.equal(partWord("nut 4"), "nut 4");
  assert.equal(partWords(["4", "12"]), "parts 4, 12");
  assert.equal(partWords(["4", "lid"]), "part 4, lid");
  assert.equal(partWords([]), "");
});
