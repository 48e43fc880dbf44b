/**
 * The list of steps, those within a group further in, with the parts that must have moved before each; a click goes there.
 * @import { Player } from "./player.js"
 * @import { Selection } from "./selection.js"
 */
import { byId, element } from "./dom.js";
import { depth } from "./groups.js";
import { partWords } from "./names.js";

/**
 * @param {Player} player
 * @param {Selection} selection
 */
export function stepsList(player, selection) {
  const { scene } = player;
  const items = scene.steps.map((step, i) => {
    const goes = step.parts.length > 1 ? "go" : "goes";
    const verb = scene.kind === "assembly" ? `${goes} in after` : "after";
    const names = partWords(step.after.map((p) => scene.parts[p].name));
    const after = names ? element("span", { class: "after" }, `${verb} ${names}`) : "";
    const go = () => {
      // Those of a group stand out as they move.
      selection.pick(step.parts.length === 1 ? step.parts[0] : null);
      player.playStep(i);
    };
    return element("button", { type: "button", onclick: go }, element("span", {}, step.words), after);
  });
  byId("steps").append(...items.map((button, i) => element("li", { style: `--depth:${depth(scene, i)}` }, button)));
  let current = -1;
  const mark = () => {
    const step = player.step;
    if (step === current) return;
    items[current]?.removeAttribute("aria-current");
    items[step]?.setAttribute("aria-current", "step");
    items[step]?.scrollIntoView({ block: "nearest" });
    current = step;
  };
  player.addEventListener("change", mark);
  mark();
}
