/**
 * The sheet that is printed: the instructions with a picture each, drawn when the browser is about to print.
 * @import { Stage } from "./stage.js"
 */
import { byId, element } from "./dom.js";
import { timeOf } from "./timeline.js";

/** Pixels of a picture. */
const SIZE = [960, 640];

/** @param {Stage} stage */
export function printing(stage) {
  window.addEventListener("beforeprint", () => fill(stage));
  window.addEventListener("afterprint", () => byId("sheet").replaceChildren());
}

/** @param {Stage} stage */
function fill(stage) {
  const { scene } = stage;
  const step = ({ heading, numbers, words, steps }) => {
    const picture = element("img", { src: stage.snapshot(timeOf(scene, steps[0]), SIZE), alt: words });
    const line = element("p", {}, element("b", {}, numbers), ` ${words}.`);
    return [...(heading ? [element("h2", {}, heading)] : []), element("section", {}, line, picture)];
  };
  const title = element("h1", {}, document.title.replace(/ – sbdp$/, ""));
  const end = element("section", {}, element("p", {}, scene.verdict ?? ""), element("img", { src: stage.snapshot(scene.duration, SIZE), alt: "In the end" }));
  const steps = scene.instructions.flatMap(step);
  byId("sheet").replaceChildren(title, ...steps, ...(scene.status === "complete" ? [] : [end]));
}
