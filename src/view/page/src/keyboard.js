/**
 * Keys for what the buttons do. Keys that an element takes itself are left to it.
 * @import { Player } from "./player.js"
 * @import { Selection } from "./selection.js"
 * @import { Stage } from "./stage.js"
 */
import { exploded } from "./controls.js";
import { byId } from "./dom.js";

/** Radians of a turn of the view, and how much nearer a step leads. */
const TURN = Math.PI / 12;
const NEARER = 1.2;

/**
 * @param {Player} player
 * @param {Selection} selection
 * @param {Stage} stage
 */
export function keyboard(player, selection, stage) {
  const keys = {
    " ": () => player.toggle(),
    ArrowRight: () => player.next(),
    ArrowLeft: () => player.previous(),
    Home: () => player.seek(0),
    End: () => player.seek(player.scene.duration),
    Enter: () => player.playStep(player.step),
    e: () => exploded(selection.explode > 0 ? 0 : 1, player, selection, stage),
    i: () => selection.isolate(),
    h: () => selection.toggleHidden(),
    t: () => selection.toggleThrough(),
    a: () => selection.showAll(),
    f: () => stage.fit(),
    Escape: () => selection.pick(null),
    "?": () => byId("help").showModal(),
    "+": () => stage.turn(0, 0, 1 / NEARER),
    "-": () => stage.turn(0, 0, NEARER),
  };
  const shifted = {
    ArrowRight: () => stage.turn(TURN, 0),
    ArrowLeft: () => stage.turn(-TURN, 0),
    ArrowUp: () => stage.turn(0, TURN),
    ArrowDown: () => stage.turn(0, -TURN),
  };
  document.addEventListener("keydown", (event) => {
    const act =
      (event.shiftKey && shifted[event.key]) || keys[event.key.length === 1 ? event.key.toLowerCase() : event.key];
    if (!act || event.ctrlKey || event.metaKey || event.altKey || taken(event)) return;
    event.preventDefault();
    act();
  });
}

/** Whether the element with the focus has a use for the key. */
function taken({ target, key }) {
  if (byId("help").open || target.closest("select, textarea")) return true;
  if (target.closest("input")) return key.startsWith("Arrow") || key === "Home" || key === "End";
  return (key === " " || key === "Enter") && target.closest("button, summary, a, [role=button]") !== null;
}
