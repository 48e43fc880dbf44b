/**
 * Arrows along the ways of the parts that move, as Rust drew them in its pictures.
 * @import { Scene } from "./data.js"
 */
import { CatmullRomCurve3, ConeGeometry, CurvePath, Group, LineCurve3, Mesh, MeshBasicMaterial, TubeGeometry, Vector3 } from "three";

/** Shares of the assembly's radius: half the width of a shaft, length and half the width of a head. */
const SHAFT = 0.011;
const HEAD = [0.085, 0.04];
/** Sides of shafts and heads. */
const SIDES = 12;

/**
 * One object per step that has arrows.
 * @param {Scene} scene
 * @param {number} radius of the assembly
 * @param {string} colour
 * @returns {Map<number, Group>}
 */
export function arrows(scene, radius, colour) {
  // Over all that is there: an arrow begins within its part.
  const material = new MeshBasicMaterial({ color: colour, depthTest: false, transparent: true });
  const byStep = new Map();
  for (const { step, points } of scene.instructions.flatMap((i) => i.arrows)) {
    if (!byStep.has(step)) byStep.set(step, new Group());
    byStep.get(step).add(...arrow(points, radius, material));
  }
  for (const group of byStep.values()) group.visible = false;
  return byStep;
}

function arrow(points, radius, material) {
  const at = points.map((p) => new Vector3().fromArray(p));
  const tip = at.at(-1);
  const length = HEAD[0] * radius;
  let before = at.length - 2;
  while (before > 0 && at[before].distanceTo(tip) < length) before -= 1;
  const along = tip.clone().sub(at[Math.max(before, 0)]).normalize();
  const base = tip.clone().addScaledVector(along, -length);
  const head = new Mesh(new ConeGeometry(HEAD[1] * radius, length, SIDES * 2), material);
  head.quaternion.setFromUnitVectors(new Vector3(0, 1, 0), along);
  head.position.copy(tip).addScaledVector(along, -length / 2);
  const way = [...at.slice(0, before + 1), base];
  const path = new CurvePath();
  for (let i = 1; i < way.length; i += 1) if (way[i].distanceTo(way[i - 1]) > 1e-9 * radius) path.add(new LineCurve3(way[i - 1], way[i]));
  const meshes = [head];
  if (path.curves.length) {
    const curve = path.curves.length > 12 ? new CatmullRomCurve3(way) : path;
    meshes.push(new Mesh(new TubeGeometry(curve, path.curves.length === 1 ? 1 : 96, SHAFT * radius, SIDES), material));
  }
  for (const mesh of meshes) mesh.renderOrder = 2;
  return meshes;
}
