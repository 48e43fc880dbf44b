/**
 * The blocking graph of the state on show, for one direction: the parts that matter for what is looked at, or all. Rust computed and arranged those of the assembled
 * state; that of any later state is what remains of them without the parts that are gone.
 * @import { Player } from "./player.js"
 * @import { Selection } from "./selection.js"
 */
import { byId, element, svg } from "./dom.js";
import { compact, focus } from "./graph-focus.js";
import { stands, stepAt } from "./timeline.js";

const COLUMN = 96;
const ROW = 62;
const BOX = [84, 24];
const MOST_LETTERS = 12;
/** Pixels beside all boxes, and boxes side by side where the panel is narrower. */
const MARGIN = 16;
const NARROWEST = 3;

/**
 * @param {Player} player
 * @param {Selection} selection
 */
export function graphPanel(player, selection) {
  const { scene } = player;
  const chosen = byId("direction");
  chosen.append(...scene.graphs.map((g, i) => element("option", { value: i }, g.direction)));
  const everything = byId("all-parts");
  const frame = byId("graph");
  let drawing = null;
  let drawn = "";
  const draw = () => {
    const graph = scene.graphs[Number(chosen.value)];
    if (!graph) return;
    const all = [...scene.parts.keys()];
    const { parts, words } = everything.checked ? { parts: all, words: "Shown: all parts." } : focus(scene, graph, player.time, selection);
    const widest = Math.max(NARROWEST, Math.floor((frame.clientWidth - MARGIN) / COLUMN));
    // The same parts keep their drawing, so that the keyboard's focus stays in it.
    const wanted = [chosen.value, everything.checked, widest, ...parts].join();
    if (wanted !== drawn) {
      drawn = wanted;
      drawing = new Drawing(scene, graph, selection, everything.checked ? whole(graph) : compact(graph, parts, widest));
      frame.replaceChildren(drawing.root);
      frame.scrollLeft = (frame.scrollWidth - frame.clientWidth) / 2;
    }
    byId("shown").textContent = words;
    byId("free").textContent = drawing.update(player.time);
  };
  chosen.addEventListener("change", draw);
  everything.addEventListener("change", draw);
  const wide = byId("enlarge");
  wide.addEventListener("click", () => {
    const is = document.querySelector("main").classList.toggle("wide");
    wide.setAttribute("aria-pressed", String(is));
    draw();
  });
  // Only what is shown has a width, and can be scrolled to its middle.
  byId("tab-graph").addEventListener("click", () => {
    drawn = "";
    draw();
  });
  let shown = "";
  const update = () => {
    const { part, others, group } = selection;
    const state = scene.parts.map((_, i) => (stands(scene, i, player.time) ? 1 : 0)).join("");
    const now = [state, stepAt(scene, player.time), part, ...others, "", ...group].join();
    if (now === shown) return;
    shown = now;
    draw();
  };
  player.addEventListener("change", update);
  selection.addEventListener("change", update);
  draw();
}

/** All parts of a graph, where Rust placed them. */
function whole({ places, rows, columns }) {
  return { places: new Map(places.entries()), rows, columns };
}

/** One direction's graph of some parts, drawn once and then marked. */
class Drawing {
  constructor(scene, graph, selection, layout) {
    Object.assign(this, { scene, graph, selection, layout });
    this.nodes = new Map([...layout.places.keys()].map((part) => [part, this.node(scene.parts[part], part)]));
    const shown = graph.edges.filter((edge) => edge.every((part) => layout.places.has(part)));
    const mutual = (p, b) => shown.some(([q, c]) => q === b && c === p);
    // What blocks each other has one line with two heads.
    this.edges = shown.filter(([p, b]) => !mutual(p, b) || p < b);
    this.lines = this.edges.map(([p, b]) => this.arrow(p, b, mutual(p, b)));
    const width = Math.max(layout.columns, 1) * COLUMN + MARGIN;
    const height = layout.rows * ROW + 30;
    const head = svg(
      "marker",
      {
        id: "head",
        viewBox: "0 0 10 10",
        refX: 9,
        refY: 5,
        markerWidth: 9,
        markerHeight: 9,
        markerUnits: "userSpaceOnUse",
        orient: "auto-start-reverse",
      },
      svg("path", { d: "M0 0L10 5L0 10z" }),
    );
    const label = `Blocking graph for ${graph.direction}`;
    this.root = svg(
      "svg",
      { width, height, viewBox: `${-width / 2} -30 ${width} ${height}`, role: "group", "aria-label": label },
      svg("defs", {}, head),
      ...this.lines,
      ...this.nodes.values(),
    );
  }

  place(part) {
    const [column, row] = this.layout.places.get(part);
    return [column * COLUMN, row * ROW + BOX[1] / 2];
  }

  node(part, i) {
    const [x, y] = this.place(i);
    const pick = () => this.selection.pick(this.selection.part === i ? null : i);
    const name = part.name.length > MOST_LETTERS ? `${part.name.slice(0, MOST_LETTERS - 1)}…` : part.name;
    const onkeydown = (event) => {
      if (event.key !== "Enter" && event.key !== " ") return;
      event.preventDefault();
      event.stopPropagation();
      pick();
    };
    return svg(
      "g",
      { class: "node", tabindex: 0, role: "button", "aria-label": part.name, onclick: pick, onkeydown },
      svg("title", {}, part.name),
      svg("rect", { x: x - BOX[0] / 2, y: y - BOX[1] / 2, width: BOX[0], height: BOX[1], rx: 5 }),
      svg("text", { x, y: y + 4 }, name),
    );
  }

  arrow(from, to, mutual) {
    const [[x0, y0], [x1, y1]] = [this.place(from), this.place(to)];
    const half = BOX[1] / 2;
    const up = Math.sign(y1 - y0);
    const lift = y0 - half - 16 - Math.abs(x0 - x1) * 0.06;
    const d =
      up === 0
        ? `M${x0} ${y0 - half}C${x0} ${lift} ${x1} ${lift} ${x1} ${y1 - half}`
        : `M${x0} ${y0 + up * half}C${x0} ${y0 + (y1 - y0) * 0.45} ${x1} ${y1 - (y1 - y0) * 0.45} ${x1} ${y1 - up * half}`;
    return svg("path", { class: "edge", d, "marker-end": "url(#head)", "marker-start": mutual && "url(#head)" });
  }

  /** Marks what is gone, free and picked at a time; a line that tells it.
   * @param {number} time */
  update(time) {
    const { scene, graph, selection } = this;
    const there = scene.parts.map((_, i) => stands(scene, i, time));
    const held = new Set(graph.edges.filter(([p, b]) => there[p] && there[b]).map(([p]) => p));
    this.nodes.forEach((node, i) => {
      node.setAttribute(
        "class",
        `node ${there[i] ? (held.has(i) ? "held" : "free") : "gone"} ${selection.part === i ? "picked" : ""}`,
      );
    });
    this.lines.forEach((line, k) => {
      const [p, b] = this.edges[k];
      const near = selection.part === p || selection.part === b;
      line.setAttribute("class", `edge ${there[p] && there[b] ? "" : "gone"} ${near ? "picked" : ""}`);
    });
    this.root.classList.toggle("focus", selection.part !== null);
    const count = there.filter(Boolean).length;
    return `${count - held.size} of the ${count} parts that stand are not blocked.`;
  }
}
