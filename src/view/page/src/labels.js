/**
 * Names in the picture: balloons at the parts that move or are picked (or at all), and the name under the pointer.
 * @import { Stage } from "./stage.js"
 */
import { Vector3 } from "three";
import { byId, element } from "./dom.js";

/** More balloons than this hide the picture. */
const MOST = 24;

/** @param {Stage} stage */
export function labels(stage) {
  const { scene, selection, canvas } = stage;
  const layer = byId("labels");
  const hover = element("div", { class: "label hover", hidden: true });
  const balloons = scene.parts.map((part) => element("div", { class: "label", hidden: true }, part.name));
  layer.append(...balloons, hover);
  const all = byId("names");
  all.addEventListener("click", () => {
    all.setAttribute("aria-pressed", String(all.getAttribute("aria-pressed") !== "true"));
    stage.invalidate();
  });
  const place = () => {
    const { step } = stage;
    const isAll = all.getAttribute("aria-pressed") === "true";
    const moving = step === null || selection.explode > 0 ? [] : scene.steps[step].parts;
    const wanted = isAll ? scene.parts.map((_, i) => i) : [...new Set([...moving, ...(selection.part === null ? [] : [selection.part])])];
    const shown = new Set(wanted.filter((i) => stage.bodies[i].group.visible).slice(0, isAll ? Infinity : MOST));
    const { clientWidth: width, clientHeight: height } = canvas;
    balloons.forEach((balloon, i) => {
      balloon.hidden = !shown.has(i);
      if (balloon.hidden) return;
      const at = new Vector3().copy(stage.bodies[i].group.position).project(stage.camera);
      balloon.style.transform = `translate(${((at.x + 1) / 2) * width}px, ${((1 - at.y) / 2) * height}px) translate(10px, -130%)`;
      balloon.classList.toggle("moving", moving.includes(i));
    });
  };
  stage.afterDraw = place;
  canvas.addEventListener("pointermove", (event) => {
    if (event.buttons || event.pointerType === "touch") return (hover.hidden = true);
    const part = stage.pick(event.clientX, event.clientY);
    hover.hidden = part === null;
    if (part === null) return;
    hover.textContent = scene.parts[part].name;
    const box = canvas.getBoundingClientRect();
    hover.style.transform = `translate(${event.clientX - box.left + 14}px, ${event.clientY - box.top + 14}px)`;
  });
  canvas.addEventListener("pointerleave", () => (hover.hidden = true));
}
