/**
 * Names in the picture: balloons at the parts that move or are picked (or at all), and the name under the pointer.
 * @import { Stage } from "./stage.js"
 */
import { Vector3 } from "three";
import { arranged, nearest } from "./balloons.js";
import { byId, element, svg } from "./dom.js";

/** More balloons than this hide the picture. */
const MOST = 24;

/** @param {Stage} stage */
export function labels(stage) {
  const { scene, selection, canvas } = stage;
  const layer = byId("labels");
  const hover = element("div", { class: "label hover", hidden: true });
  const left = element("div", { class: "label left-out", hidden: true });
  const balloons = scene.parts.map((part) => element("div", { class: "label", hidden: true }, part.name));
  const leaders = svg("svg", { class: "leaders" });
  layer.append(leaders, ...balloons, left, hover);
  /** Sizes of the names, measured when each is shown first. */
  const sizes = new Map();
  const size = (part) => {
    if (!sizes.has(part)) sizes.set(part, { width: balloons[part].offsetWidth, height: balloons[part].offsetHeight });
    return sizes.get(part);
  };
  const all = byId("names");
  all.addEventListener("click", () => {
    all.setAttribute("aria-pressed", String(all.getAttribute("aria-pressed") !== "true"));
    stage.invalidate();
  });
  const place = () => {
    const { step } = stage;
    const isAll = all.getAttribute("aria-pressed") === "true";
    const moving = step === null || selection.explode > 0 ? [] : scene.steps[step].parts;
    const first = [...moving, ...(selection.part === null ? [] : [selection.part])];
    const wanted = [...new Set([...first, ...(isAll ? scene.parts.keys() : [])])];
    const { clientWidth: width, clientHeight: height } = canvas;
    const shown = wanted
      .filter((i) => stage.bodies[i].group.visible)
      .slice(0, isAll ? Infinity : MOST)
      .map((part) => ({ part, ...onCanvas(stage, part, width, height) }))
      .filter(({ x, y, isAhead }) => isAhead && x >= 0 && y >= 0 && x <= width && y <= height);
    // Those that were left out before have to be measured, too.
    const named = new Set(shown.map(({ part }) => part));
    balloons.forEach((balloon, i) => (balloon.hidden = !named.has(i)));
    const boxes = arranged(shown.map(({ part, x, y }) => ({ x, y, ...size(part) })), { width, height });
    leaders.replaceChildren(...shown.flatMap((at, k) => (boxes[k] ? leader(at, boxes[k]) : [])));
    shown.forEach(({ part }, k) => {
      const box = boxes[k];
      balloons[part].hidden = !box;
      if (box) balloons[part].style.transform = `translate(${box.x}px, ${box.y}px)`;
      balloons[part].classList.toggle("moving", moving.includes(part));
    });
    const missing = boxes.filter((box) => !box).length;
    left.hidden = missing === 0;
    left.textContent = `${missing} more ${missing === 1 ? "name does" : "names do"} not fit`;
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

/** Where the middle of a part is drawn, in CSS pixels, and whether it is before the viewer. */
function onCanvas(stage, part, width, height) {
  const at = new Vector3().copy(stage.bodies[part].group.position).project(stage.camera);
  return { x: ((at.x + 1) / 2) * width, y: ((1 - at.y) / 2) * height, isAhead: at.z < 1 };
}

/** A line from the middle of a part to its name. */
function leader(part, box) {
  const end = nearest(box, part);
  return [svg("line", { x1: part.x, y1: part.y, x2: end.x, y2: end.y }), svg("circle", { cx: part.x, cy: part.y, r: 2 })];
}
