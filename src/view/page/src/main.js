/** Puts the page together. */
import { controls } from "./controls.js";
import { decode } from "./data.js";
import { byId } from "./dom.js";
import { groupLists } from "./groups.js";
import { graphPanel } from "./graph-panel.js";
import { keyboard } from "./keyboard.js";
import { labels } from "./labels.js";
import { partsList, stuckList } from "./parts-list.js";
import { Player } from "./player.js";
import { printing } from "./print.js";
import { Selection } from "./selection.js";
import { Stage } from "./stage.js";
import { stepsList } from "./steps-list.js";
import { tabs } from "./tabs.js";
import { theme } from "./theme.js";

/** A longer pause between two pictures is none that the viewer saw. */
const LONGEST_TICK = 0.25;
/** A pointer that moves further than this (CSS pixels) turns the view and picks nothing. */
const CLICK = 5;

function start() {
  const scene = decode(byId("scene").textContent);
  const player = new Player(scene);
  const still = matchMedia("(prefers-reduced-motion: reduce)");
  player.stepwise = still.matches;
  const selection = new Selection(scene.parts.length);
  const stage = new Stage(byId("canvas"), scene, selection);
  stage.still = still.matches;
  still.addEventListener("change", () => (player.stepwise = stage.still = still.matches));
  theme(stage);
  labels(stage);
  printing(stage);
  tabs();
  controls(player, selection, stage);
  stepsList(player, selection);
  partsList(scene, selection);
  stuckList(scene, selection, () => player.seek(scene.duration));
  groupLists(scene, selection, (time) => player.seek(time));
  graphPanel(player, selection);
  keyboard(player, selection, stage);
  picking(byId("canvas"), stage, selection);
  player.addEventListener("change", () => {
    if (selection.explode > 0 && player.time !== stage.time) {
      selection.setExplode(0);
      stage.explode(0);
    }
    stage.at(player.time);
  });
  stage.at(player.time);
  run(player, stage);
  // For tests, and for pages that embed this one.
  Object.assign(window, { sbdp: { scene, player, selection, stage } });
}

/** Draws whenever the browser does, if there is something new. */
function run(player, stage) {
  let before = performance.now();
  const frame = (now) => {
    const seconds = Math.min((now - before) / 1000, LONGEST_TICK);
    player.tick(seconds);
    stage.swung(seconds);
    before = now;
    if (!stage.draw()) stage.refine();
    else if (!document.documentElement.dataset.drawn) {
      document.documentElement.dataset.drawn = "true";
      performance.mark("first-frame");
    }
    requestAnimationFrame(frame);
  };
  requestAnimationFrame(frame);
}

/** A click on a part picks it out, one beside all parts none. */
function picking(canvas, stage, selection) {
  let down = null;
  canvas.addEventListener("pointerdown", (event) => (down = [event.clientX, event.clientY]));
  canvas.addEventListener("pointerup", (event) => {
    const far = down && Math.hypot(event.clientX - down[0], event.clientY - down[1]);
    if (far !== null && far < CLICK) selection.pick(stage.pick(event.clientX, event.clientY));
    down = null;
  });
}

try {
  start();
} catch (error) {
  const line = byId("now");
  line.textContent = `This browser cannot show the scene (${error.message}). WebGL 2 is needed.`;
  throw error;
}
