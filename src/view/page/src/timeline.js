/**
 * Where parts are at a time. Pure: knows nothing of what is drawn.
 * @import { Scene, Step, Placement } from "./data.js"
 */

/** Seconds that a part which is out takes to fade. */
const FADE = 0.5;

/** @param {Step} step */
export const begins = (step) => step.times[0];

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
  return step < scene.steps.length ? begins(scene.steps[Math.max(step, 0)]) : scene.duration;
}

/**
 * Where a part is.
 * @param {Scene} scene
 * @param {number} part
 * @param {number} time
 * @returns {Placement}
 */
export function placementAt(scene, part, time) {
  const { step, start } = scene.parts[part];
  if (step === null || time <= begins(scene.steps[step])) return start;
  return between(scene.steps[step], time);
}

/**
 * @param {Step} step
 * @param {number} time
 * @returns {Placement}
 */
function between({ times, keys }, time) {
  const key = (i) => keys.subarray(i * 7, i * 7 + 7);
  let next = times.findIndex((t) => t > time);
  if (next < 0) return key(times.length - 1);
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
 * Whether a part stands in the assembly (or may still come out of it): of a disassembly until its step is over,
 * of an assembly from when it is over.
 * @param {Scene} scene
 * @param {number} part
 * @param {number} time
 */
export function stands(scene, part, time) {
  const { step, stays } = scene.parts[part];
  // What could not be put in waits for ever.
  if (step === null) return stays || scene.kind === "disassembly";
  const over = time >= scene.steps[step].ends;
  return scene.kind === "assembly" ? over : !over;
}

/**
 * Whether a part is under way.
 * @param {Scene} scene
 * @param {number} part
 * @param {number} time
 */
export function isMoving(scene, part, time) {
  const { step } = scene.parts[part];
  return step !== null && time > begins(scene.steps[step]) && time < scene.steps[step].ends;
}

/**
 * Whether a part of an assembly plan waits for its turn, or in vain.
 * @param {Scene} scene
 * @param {number} part
 * @param {number} time
 */
export function isWaiting(scene, part, time) {
  const { step, stays } = scene.parts[part];
  return step === null ? !stays : time <= begins(scene.steps[step]);
}

/**
 * How much of a part is seen, 0 to 1: what is out fades, what is not in yet is seen where it waits.
 * @param {Scene} scene
 * @param {number} part
 * @param {number} time
 */
export function visibility(scene, part, time) {
  const { step } = scene.parts[part];
  if (scene.kind === "assembly" || step === null) return 1;
  return Math.min(1, Math.max(0, 1 - (time - scene.steps[step].ends) / FADE));
}
