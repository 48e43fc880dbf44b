/**
 * The list of parts, and of those that are stuck with what blocks them.
 * @import { Scene } from "./data.js"
 * @import { Selection } from "./selection.js"
 */
import { byId, element } from "./dom.js";
import { partWord, partWords } from "./names.js";

/**
 * @param {Scene} scene
 * @param {Selection} selection
 */
export function partsList(scene, selection) {
  const stuck = new Set(scene.blocked.map((b) => b.part));
  const rows = scene.parts.map((part, i) => {
    const swatch = element("span", {
      class: "swatch",
      style: `background:${scene.palette[part.colour]}`,
      "aria-hidden": true,
    });
    const notes = [part.fixed && "fixed", stuck.has(i) && "stuck", part.steps.length === 0 && part.stays && "stays"].filter(
      Boolean,
    );
    const note = notes.length ? element("span", { class: "after" }, notes.join(", ")) : "";
    return element(
      "button",
      { type: "button", "aria-pressed": "false", onclick: () => selection.pick(selection.part === i ? null : i) },
      swatch,
      part.name,
      note,
    );
  });
  const waiting = byId("waiting");
  waiting.closest("p").hidden = scene.kind !== "assembly";
  waiting.addEventListener("change", () => selection.setWaiting(waiting.checked));
  byId("parts").append(...rows.map((row) => element("li", {}, row)));
  selection.addEventListener("change", () => {
    rows.forEach((row, i) => {
      const pressed = String(selection.part === i);
      if (row.getAttribute("aria-pressed") !== pressed) row.setAttribute("aria-pressed", pressed);
      row.classList.toggle("off", selection.hidden.has(i));
    });
  });
}

/**
 * What did not come out. Empty where all did.
 * @param {Scene} scene
 * @param {Selection} selection
 * @param {() => void} look called when one was chosen: to the state in which it is stuck
 */
export function stuckList(scene, selection, look) {
  const banner = byId("verdict");
  banner.hidden = scene.status === "complete";
  if (banner.hidden) return;
  const parts = [...new Set(scene.blocked.map((b) => b.part))].filter((p) => p !== null);
  const verdict = scene.verdict ? ` – ${scene.verdict}` : "";
  byId("reason").append(element("strong", {}, `Not complete: ${scene.status}`), verdict);
  const rows = parts.map((part) => {
    const blocked = scene.blocked.filter((b) => b.part === part);
    const by = new Set(blocked.flatMap((b) => b.by));
    const told = kept(scene, blocked);
    const point = () => {
      look();
      selection.pick(part, by);
    };
    const name = element("span", { class: "stuck" }, `${partWord(scene.parts[part].name)} is stuck`);
    return element("button", { type: "button", onclick: point }, name, element("span", { class: "after" }, told));
  });
  byId("stuck").append(...rows.map((row) => element("li", {}, row)));
}

/** Straight ways are told one by one, ways with turns counted: they are many, and mostly kept by the same.
 * @param {Scene} scene
 * @param {{by: number[], action: string}[]} blocked */
function kept(scene, blocked) {
  const straight = blocked.filter((b) => !/[+-]r|~/.test(b.action));
  const way = ({ action, by }) => {
    const names = partWords(by.map((p) => scene.parts[p].name));
    return `${action === "any" ? "whichever way" : action}: kept by ${names}`;
  };
  const turns = blocked.length - straight.length;
  return straight.map(way).join("; ") + (turns ? `; and ${turns} ways with turns` : "");
}
