/**
 * Which parts of a blocking graph matter for what is looked at: the picked parts, the step under way or next, or what is
 * stuck, with the parts that block them and that they block; and where these few are drawn.
 * @import { Graph, Scene } from "./data.js"
 * @import { Selection } from "./selection.js"
 */
import { partWords } from "./names.js";
import { stands, stepAt } from "./timeline.js";

/** More parts than this are no overview any more. At half, the neighbours of a plate with bolts are cut off. */
export const MOST = 24;

/**
 * @param {Scene} scene
 * @param {Graph} graph
 * @param {number} time
 * @param {Selection} selection
 * @returns {{parts: number[], words: string}} the parts, and what they are
 */
export function focus(scene, graph, time, selection) {
  const { about, beside = [], subject } = looked(scene, time, selection);
  const there = (p) => stands(scene, p, time);
  const near = graph.edges.filter((edge) => edge.every(there));
  const blockers = near.filter(([p]) => about.includes(p)).map(([, by]) => by);
  const blocked = near.filter(([, by]) => about.includes(by)).map(([p]) => p);
  const all = [...new Set([...about, ...beside, ...blockers, ...blocked])];
  const parts = all.slice(0, MOST);
  const more = all.length - parts.length;
  const words = `Shown: ${subject}, with the parts that arrows join to it${more ? `; ${more} more parts are not shown` : ""}.`;
  return { parts, words };
}

/** What is looked at, what is pointed out beside it, and its name. */
function looked(scene, time, { part, others, group }) {
  const names = (parts) => (parts.length > 3 ? `${parts.length} parts` : partWords(parts.map((p) => scene.parts[p].name)));
  if (part !== null) return { about: [part], beside: others, subject: names([part]) };
  if (group.size > 0) return { about: [...group], subject: names([...group]) };
  const step = stepAt(scene, time);
  if (step < scene.steps.length) return { about: scene.steps[step].parts, subject: names(scene.steps[step].parts) };
  const stuck = [...new Set(scene.blocked.map((b) => b.part))].filter((p) => p !== null);
  if (stuck.length > 0) return { about: stuck, subject: `what is stuck (${names(stuck)})` };
  const left = [...scene.parts.keys()].filter((p) => stands(scene, p, time));
  return { about: left, subject: "what is left" };
}

/**
 * Some parts of a graph closer together: rows keep their order, those without parts go, and none is wider than `widest`.
 * @param {Graph} graph
 * @param {number[]} parts
 * @param {number} widest
 * @returns {{places: Map<number, [number, number]>, rows: number, columns: number}}
 */
export function compact(graph, parts, widest) {
  const byRow = new Map();
  for (const part of parts) {
    const [, row] = graph.places[part];
    byRow.set(row, [...(byRow.get(row) ?? []), part]);
  }
  const rows = [...byRow.keys()].sort((a, b) => a - b).flatMap((row) => {
    const side = byRow.get(row).sort((a, b) => graph.places[a][0] - graph.places[b][0]);
    const pieces = Math.ceil(side.length / widest);
    const piece = (k) => side.slice(Math.ceil((k * side.length) / pieces), Math.ceil(((k + 1) * side.length) / pieces));
    // Boxes stand below the gaps of the piece above: an arrow that passes behind a box would seem to come from it.
    const isHalf = (k) => piece(k).length % 2 === 0;
    return Array.from({ length: pieces }, (_, k) => {
      const shift = isHalf(k) === (isHalf(0) !== (k % 2 === 1)) ? 0 : 0.5;
      return piece(k).map((part, i) => [part, i - (piece(k).length - 1) / 2 + shift]);
    });
  });
  const places = new Map(rows.flatMap((side, row) => side.map(([part, column]) => [part, [column, row]])));
  const reach = Math.max(0, ...rows.flat().map(([, column]) => Math.abs(column)));
  return { places, rows: rows.length, columns: 2 * reach + 1 };
}
