/**
 * The bar below the picture: play, pause, step, scrub, speed, explode.
 * @import { Player } from "./player.js"
 * @import { Selection } from "./selection.js"
 * @import { Stage } from "./stage.js"
 */
import { byId } from "./dom.js";

/**
 * @param {Player} player
 * @param {Selection} selection
 * @param {Stage} stage
 */
export function controls(player, selection, stage) {
  const { scene } = player;
  const [play, scrub, explode, speed] = ["play", "scrub", "explode", "speed"].map(byId);
  scrub.max = String(scene.duration);
  const on = (id, act) => byId(id).addEventListener("click", act);
  on("play", () => player.toggle());
  on("previous", () => player.previous());
  on("next", () => player.next());
  on("play-step", () => player.playStep(player.step));
  on("fit", () => stage.fit());
  on("isolate", () => selection.isolate());
  on("hide", () => selection.toggleHidden());
  on("through", () => selection.toggleThrough());
  on("show-all", () => selection.showAll());
  on("follow", () => {
    stage.follows = !stage.follows;
    byId("follow").setAttribute("aria-pressed", String(stage.follows));
  });
  on("keys", () => byId("help").showModal());
  scrub.addEventListener("input", () => player.seek(Number(scrub.value)));
  speed.addEventListener("change", () => player.setSpeed(Number(speed.value)));
  explode.addEventListener("input", () => exploded(Number(explode.value), player, selection, stage));
  player.addEventListener("change", () => {
    const label = player.playing ? "Pause" : "Play";
    if (play.textContent !== label) play.textContent = label;
    scrub.value = String(player.time);
    tell(player);
  });
  selection.addEventListener("change", () => {
    explode.value = String(selection.explode);
    picked(scene, selection);
  });
  tell(player);
  picked(scene, selection);
}

/**
 * Shows the exploded view, in which time stands still.
 * @param {number} amount 0 to 1
 */
export function exploded(amount, player, selection, stage) {
  if (player.playing) player.pause();
  selection.setExplode(amount);
  stage.explode(amount);
}

/** The step in words; screen readers read it out where it changes. */
function tell(player) {
  const { scene, step } = player;
  const count = scene.steps.length;
  const now = step < count ? `Step ${step + 1} of ${count}: ${scene.steps[step].words}` : ended(scene);
  const line = byId("now");
  if (line.textContent !== now) line.textContent = now;
  byId("scrub").setAttribute("aria-valuetext", now);
}

function ended(scene) {
  const done = { disassembly: "apart", assembly: "together" }[scene.kind];
  return scene.status === "complete" ? `All is ${done}` : `No further: ${scene.status}`;
}

function picked(scene, selection) {
  const { part } = selection;
  byId("picked").textContent = part === null ? "No part picked" : scene.parts[part].name;
  for (const id of ["isolate", "hide", "through"]) byId(id).disabled = part === null;
  const pressed = (id, set) => byId(id).setAttribute("aria-pressed", String(part !== null && set.has(part)));
  pressed("hide", selection.hidden);
  pressed("through", selection.through);
}
