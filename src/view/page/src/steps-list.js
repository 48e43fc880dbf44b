/**
 * The list of instructions: steps in a row that do the same with equal parts are one row, those within a group further in. A
 * click plays them.
 * @import { Player } from "./player.js"
 * @import { Selection } from "./selection.js"
 */
import { byId, element } from "./dom.js";
import { depth } from "./groups.js";

/**
 * @param {Player} player
 * @param {Selection} selection
 */
export function stepsList(player, selection) {
  const { scene } = player;
  const rows = scene.instructions.map(({ numbers, words, steps }) => {
    const go = () => {
      selection.pick(null);
      player.playSteps(steps[0], steps.at(-1));
    };
    return element(
      "button",
      { type: "button", onclick: go },
      element("span", { class: "number" }, numbers),
      element("span", {}, words),
    );
  });
  const items = scene.instructions.flatMap(({ heading, steps }, i) => [
    ...(heading ? [element("li", { class: "heading" }, heading)] : []),
    element("li", { style: `--depth:${depth(scene, steps[0])}` }, rows[i]),
  ]);
  byId("steps").append(...items);
  let current = -1;
  const mark = () => {
    const row = instructionOf(scene, player.step);
    if (row === current) return;
    rows[current]?.removeAttribute("aria-current");
    rows[row]?.setAttribute("aria-current", "step");
    rows[row]?.scrollIntoView({ block: "nearest" });
    current = row;
  };
  player.addEventListener("change", mark);
  mark();
}

/** The place of the instruction that has a step; -1 for none.
 * @param {import("./data.js").Scene} scene
 * @param {number} step */
export function instructionOf(scene, step) {
  return scene.instructions.findIndex(({ steps }) => steps.includes(step));
}
