/**
 * Where parts are at a time. Pure: knows nothing of what is drawn.
 * @import { Scene, Part, Placement } from "./data.js"
 */

/** Seconds that a part to which nothing more is done takes to fade. */
const FADE = 0.25;

/**
 * The first step that is not over at a time; as many as there are steps, once all are.
 * @param {Scene} scene
 * @param {number} time
 */
export function stepAt(scene, time) {
  const at = scene.steps.findIndex((s) => time < s.ends);
  return at < 0 ? scene.steps.length : at;
}

/**
 * When a step begins; the end of all, for the number after the last.
 * @param {Scene} scene
 * @param {number} step
 */
export function timeOf(scene, step) {
  return step < scene.steps.length ? scene.steps[Math.max(step, 0)].begins : scene.duration;
}

/**
 * Where a part is.
 * @param {Scene} scene
 * @param {number} part
 * @param {number} time
 * @returns {Placement}
 */
export function placementAt(scene, part, time) {
  const { times, start } = scene.parts[part];
  return times.length === 0 || time <= times[0] ? start : between(scene.parts[part], time);
}

/**
 * How many of ascending times are not after a time.
 * @param {number[]} times
 * @param {number} time
 */
function passed(times, time) {
  let [low, high] = [0, times.length];
  while (low < high) {
    const middle = (low + high) >> 1;
    if (times[middle] <= time) low = middle + 1;
    else high = middle;
  }
  return low;
}

/**
 * @param {Part} part
 * @param {number} time not before its first
 * @returns {Placement}
 */
function between({ times, keys }, time) {
  const key = (i) => keys.subarray(i * 7, i * 7 + 7);
  const next = passed(times, time);
  if (next === times.length) return key(times.length - 1);
  const [a, b] = [key(next - 1), key(next)];
  const u = (time - times[next - 1]) / (times[next] - times[next - 1]);
  const at = [0, 1, 2].map((i) => a[i] + (b[i] - a[i]) * u);
  return [...at, ...slerp(a.subarray(3), b.subarray(3), u)];
}

/**
 * The rotation between two, as quaternions x, y, z, w; the short way.
 * @param {ArrayLike<number>} a
 * @param {ArrayLike<number>} b
 * @param {number} u
 */
export function slerp(a, b, u) {
  const dot = a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3];
  const angle = Math.acos(Math.min(1, Math.abs(dot)));
  const sin = Math.sin(angle);
  const [s, t] = sin < 1e-6 ? [1 - u, u] : [Math.sin((1 - u) * angle) / sin, Math.sin(u * angle) / sin];
  const sign = dot < 0 ? -1 : 1;
  return [0, 1, 2, 3].map((i) => s * a[i] + sign * t * b[i]);
}

/**
 * Whether a part stands in the assembly (or may still come out of it): of a disassembly until the step is over that
 * takes it out, of an assembly from when the step is over that puts it in.
 * @param {Scene} scene
 * @param {number} part
 * @param {number} time
 */
export function stands(scene, part, time) {
  const { crosses, stays } = scene.parts[part];
  // What could not be put in waits for ever.
  if (crosses === null) return stays || scene.kind === "disassembly";
  const over = time >= crosses;
  return scene.kind === "assembly" ? over : !over;
}

/**
 * Whether a part is under way.
 * @param {Scene} scene
 * @param {number} part
 * @param {number} time
 */
export function isMoving(scene, part, time) {
  const { steps } = scene.parts[part];
  return steps.some((step) => time > scene.steps[step].begins && time < scene.steps[step].ends);
}

/**
 * Whether a part of an assembly plan waits for its turn, or in vain. A group that is being put together does not.
 * @param {Scene} scene
 * @param {number} part
 * @param {number} time
 */
export function isWaiting(scene, part, time) {
  const { crosses, handled, stays } = scene.parts[part];
  return crosses === null ? !stays : time <= handled[0];
}

/**
 * How much of a part is seen, 0 to 1: what is out, and not taken apart any further, fades; what is not in yet is seen
 * where it waits.
 * @param {Scene} scene
 * @param {number} part
 * @param {number} time
 */
export function visibility(scene, part, time) {
  const { crosses, handled } = scene.parts[part];
  if (scene.kind === "assembly" || crosses === null) return 1;
  return Math.min(1, Math.max(0, 1 - (time - handled[1]) / FADE));
}
