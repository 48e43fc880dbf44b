/**
 * The picture: parts, camera, light. Draws only when something changed.
 * @import { Scene } from "./data.js"
 * @import { Selection } from "./selection.js"
 */
import {
  AxesHelper,
  Box3,
  BufferAttribute,
  BufferGeometry,
  Color,
  DirectionalLight,
  HemisphereLight,
  LineBasicMaterial,
  LineSegments,
  PerspectiveCamera,
  Raycaster,
  Scene as World,
  Vector2,
  Vector3,
  WebGLRenderer,
} from "three";
import { OrbitControls } from "three/addons/controls/OrbitControls.js";
import { Body, geometries } from "./meshes.js";
import { arrows } from "./arrows.js";
import { instructionOf } from "./steps-list.js";
import { isWaiting, placementAt, stepAt, visibility } from "./timeline.js";

/** Edges of parts that should have moved and could not. */
const STUCK_EDGE = "#3e0a46";
/** Of the parts that neither move nor are pointed out: how much of their colour is replaced by that of the ground. */
const PALE = 0.7;
/** Seconds in which the camera goes to another side; and milliseconds for which it stays where the viewer put it. */
const SWING = 0.7;
const GLOW = "#2c3a55";
const THROUGH = 0.22;
const BESIDE = 0.12;
/** What blocks a part often stands all around it. */
const BLOCKER = 0.45;
/** So much wider than the parts is the picture. */
const ROOM = 1.25;
/** In pictures wider than this (width over height) height is what matters. */
const WIDE = 1.4;
/** Milliseconds without a change after which all is still. */
const STILL = 250;

export class Stage {
  /**
   * @param {HTMLCanvasElement} canvas
   * @param {Scene} scene
   * @param {Selection} selection
   */
  constructor(canvas, scene, selection) {
    Object.assign(this, { canvas, scene, selection, time: 0, stale: true });
    const soft = isSoftware();
    this.renderer = new WebGLRenderer({ canvas, antialias: !soft });
    const ratio = Math.min(devicePixelRatio, 2);
    /** Pixels per CSS pixel while something moves, and once all is still. Without a graphics card smooth edges
     * take most of the time, so they wait. */
    this.ratio = soft ? { moving: 1, still: 2 } : { moving: ratio, still: ratio };
    this.renderer.setPixelRatio(this.ratio.moving);
    this.world = new World();
    this.stuck = [...new Set(scene.blocked.map((b) => b.part))].filter((p) => p !== null);
    const shapes = scene.meshes.map(geometries);
    this.bodies = scene.parts.map(
      (p, i) => new Body(p, scene.meshes[p.mesh], shapes[p.mesh], scene.palette[p.colour], i),
    );
    this.world.add(...this.bodies.map((b) => b.group));
    this.guides = guides(scene);
    this.world.add(this.guides);
    this.lit();
    this.radius = Math.max(...scene.parts.map((p) => reach(p)), 1e-9);
    this.arrows = arrows(scene, this.radius, "#0b3d91");
    for (const arrow of this.arrows.values()) this.world.add(arrow);
    this.free = new Map(scene.free_together.flatMap(({ parts }, k) => parts.map((p) => [p, k])));
    /** Whether the camera goes by itself to the side where something happens. */
    this.follows = true;
    this.theme();
    this.look();
    this.world.add(axes(scene, this.radius));
    this.controls.addEventListener("start", () => (this.swing = null));
    selection.addEventListener("change", () => this.invalidate());
    this.controls.addEventListener("change", () => (this.stale = true));
    new ResizeObserver(() => this.resize()).observe(canvas.parentElement);
  }

  /** Takes the colours of the page. */
  theme() {
    const style = getComputedStyle(document.documentElement);
    const colour = (name, otherwise) => new Color(style.getPropertyValue(name).trim() || otherwise);
    this.ground = colour("--ground", "#eef1f5");
    this.edge = colour("--edge", "#1b2330");
    this.world.background = this.ground;
    for (const { material } of [...this.arrows.values()].flatMap((group) => group.children)) material.color = colour("--arrow", "#0b3d91");
    this.invalidate();
  }

  /** The instruction under way, where one is. */
  get instruction() {
    const { scene, selection, step } = this;
    return selection.explode > 0 || step === null ? null : (scene.instructions[instructionOf(scene, step)] ?? null);
  }

  /** The step under way or next, unless all are over. */
  get step() {
    const step = stepAt(this.scene, this.time);
    return step < this.scene.steps.length ? step : null;
  }

  /** The steps whose parts are in the strong colour: the one under way, or in a picture of an instruction all of it. */
  get active() {
    const { instruction, step } = this;
    if (step === null || this.selection.explode > 0) return [];
    return this.isWhole && instruction ? instruction.steps : [step];
  }

  /** Begins to go to the side from which the instruction is seen best. A viewer who turned the view is left alone until the
   * next instruction.
   * @param {boolean} [at_once] */
  turnTo(instruction, at_once = false) {
    const back = new Vector3().fromArray(instruction.view);
    const now = this.camera.position.clone().sub(this.controls.target);
    if (now.angleTo(back) < 1e-3) return;
    this.swing = { from: now.clone().normalize(), to: back, length: now.length(), u: 0 };
    if (at_once) this.swung(SWING);
  }

  /** Goes on with that.
   * @param {number} seconds */
  swung(seconds) {
    const { swing, controls } = this;
    if (!swing) return;
    swing.u = Math.min(1, swing.u + seconds / SWING);
    const eased = swing.u * swing.u * (3 - 2 * swing.u);
    // Around the direction up, so that the horizon stays level.
    const up = this.camera.up;
    const [a, b] = [swing.from, swing.to].map((d) => spherical(d, up));
    let around = b.around - a.around;
    if (Math.abs(around) > Math.PI) around -= Math.sign(around) * 2 * Math.PI;
    const at = { around: a.around + around * eased, height: a.height + (b.height - a.height) * eased };
    this.camera.position.copy(controls.target).addScaledVector(cartesian(at, up), swing.length);
    const done = swing.u >= 1;
    if (done) this.swing = null;
    this.pose();
    const { target, length } = this.frame();
    this.aim(target, length);
    if (!done) this.swing.length = length;
    this.invalidate();
  }

  lit() {
    this.world.add(new HemisphereLight("#ffffff", "#9aa3b2", 1.9));
    this.camera = new PerspectiveCamera(32, 1, 0.01, 100);
    const lamp = new DirectionalLight("#ffffff", 1.7);
    lamp.position.set(-0.6, 1, 0.8);
    this.camera.add(lamp);
    this.world.add(this.camera);
  }

  /** From the front, right and above, near enough to see all. */
  look() {
    const z = this.scene.up === "z";
    this.camera.up.fromArray(z ? [0, 0, 1] : [0, 1, 0]);
    this.camera.position.fromArray(z ? [0.75, -1, 0.62] : [0.75, 0.62, 1]);
    this.controls = new OrbitControls(this.camera, this.canvas);
    this.resize();
    this.fit();
  }

  /** Comes as near as all parts that are seen allow. */
  fit() {
    this.pose();
    const { target, length } = this.frame();
    this.aim(target, length);
  }

  /** Steps back as far as the exploded view needs; comes back when all is together again.
   * @param {number} amount 0 to 1 */
  explode(amount) {
    const { controls, camera } = this;
    this.swing = null;
    this.before ??= { target: controls.target.clone(), length: camera.position.distanceTo(controls.target) };
    this.pose();
    const { target, length } = amount > 0 ? this.frame() : this.before;
    this.aim(target, amount > 0 ? Math.max(length, this.before.length) : length);
    if (amount === 0) this.before = null;
  }

  /** Looks at a point from a distance, from the side where the camera is.
   * @param {Vector3} target
   * @param {number} length */
  aim(target, length) {
    const { camera, controls } = this;
    const offset = camera.position.clone().sub(controls.target).setLength(length);
    controls.target.copy(target);
    camera.position.copy(target).add(offset);
    camera.near = Math.min(length, this.radius) / 100;
    camera.far = length + this.radius * 40;
    camera.updateProjectionMatrix();
    controls.maxDistance = Math.max(this.radius * 30, length * 2);
    controls.update();
    this.stale = true;
  }

  /** Goes around what it looks at, and nearer or further.
   * @param {number} right radians
   * @param {number} up radians; it stops short of the pole
   * @param {number} nearer factor of the distance */
  turn(right, up, nearer = 1) {
    const { camera, controls } = this;
    const offset = camera.position.clone().sub(controls.target);
    const side = new Vector3().crossVectors(camera.up, offset).normalize();
    const polar = offset.angleTo(camera.up);
    offset.applyAxisAngle(side, Math.min(Math.max(polar - up, 0.05), Math.PI - 0.05) - polar);
    offset.applyAxisAngle(camera.up, right);
    camera.position.copy(controls.target).add(offset);
    this.aim(controls.target.clone(), offset.length() * nearer);
  }

  /** Where to look, and from how far, so that the boxes of all parts that are seen are in the picture. */
  frame() {
    const corners = this.bodies.flatMap(({ group }, i) =>
      group.visible ? boxAt(group.position, this.scene.parts[i].size) : [],
    );
    const target = new Box3().setFromPoints(corners).getCenter(new Vector3());
    if (corners.length === 0) target.set(0, 0, 0);
    const back = this.camera.position.clone().sub(this.controls.target).normalize();
    const right = new Vector3().crossVectors(this.camera.up, back).normalize();
    const up = new Vector3().crossVectors(back, right);
    const high = Math.tan((this.camera.fov / 2) * (Math.PI / 180)) / ROOM;
    const wide = high * this.camera.aspect;
    const needed = corners.map((corner) => {
      const at = corner.sub(target);
      return at.dot(back) + Math.max(Math.abs(at.dot(right)) / wide, Math.abs(at.dot(up)) / high);
    });
    return { target, length: Math.max(this.radius / 10, ...needed) };
  }

  /** Takes the size that the page gives it. In a narrower picture as much is seen, from further away. */
  resize() {
    const { clientWidth: width, clientHeight: height } = this.canvas.parentElement;
    if (!width || !height) return;
    this.renderer.setSize(width, height, false);
    const { camera, controls } = this;
    const before = Math.min(camera.aspect, WIDE);
    camera.aspect = width / height;
    const further = before / Math.min(camera.aspect, WIDE);
    this.aim(controls.target.clone(), camera.position.distanceTo(controls.target) * further);
    this.invalidate();
  }

  /** @param {number} time */
  at(time) {
    this.time = time;
    const { instruction } = this;
    if (instruction && instruction !== this.shown && this.follows) this.turnTo(instruction, this.still || this.shown === undefined);
    this.shown = instruction;
    this.invalidate();
  }

  invalidate() {
    this.stale = true;
    this.moved = true;
  }

  /** Draws if something changed; whether it did. */
  draw() {
    if (!this.stale) return false;
    if (this.moved) this.pose();
    this.sharpen(this.ratio.moving);
    this.renderer.render(this.world, this.camera);
    this.stale = this.moved = false;
    this.drawn = performance.now();
    this.afterDraw?.();
    return true;
  }

  /**
   * A picture of the instruction at a time, on white paper, as a data URI. What is shown does not change.
   * @param {number} time
   * @param {number[]} size pixels
   */
  snapshot(time, [width, height]) {
    const { camera, controls, renderer, selection } = this;
    const before = { position: camera.position.clone(), target: controls.target.clone(), aspect: camera.aspect, explode: selection.explode };
    const shown = { time: this.time, ground: this.ground, edge: this.edge, swing: this.swing, isWhole: false };
    Object.assign(this, { time, ground: new Color("#ffffff"), edge: new Color("#1b2330"), swing: null, isWhole: true });
    this.world.background = this.ground;
    selection.explode = 0;
    renderer.setPixelRatio(1);
    renderer.setSize(width, height, false);
    camera.aspect = width / height;
    const { instruction } = this;
    if (instruction) this.turnTo(instruction, true);
    this.pose();
    const { target, length } = this.frame();
    this.aim(target, length);
    renderer.render(this.world, camera);
    const picture = this.canvas.toDataURL("image/png");
    Object.assign(this, shown);
    this.world.background = this.ground;
    selection.explode = before.explode;
    camera.aspect = before.aspect;
    controls.target.copy(before.target);
    camera.position.copy(before.position);
    renderer.setPixelRatio(this.ratio.moving);
    this.resize();
    this.aim(before.target, before.position.distanceTo(before.target));
    this.invalidate();
    return picture;
  }

  /** Draws once more with smooth edges, where nothing changed for a while. */
  refine() {
    if (this.renderer.getPixelRatio() === this.ratio.still || performance.now() - this.drawn < STILL) return;
    this.sharpen(this.ratio.still);
    this.renderer.render(this.world, this.camera);
  }

  /** @param {number} ratio */
  sharpen(ratio) {
    if (this.renderer.getPixelRatio() !== ratio) this.renderer.setPixelRatio(ratio);
  }

  pose() {
    const { explode } = this.selection;
    this.bodies.forEach((body, i) => {
      const part = this.scene.parts[i];
      if (explode > 0) {
        const [x, y, z, ...turn] = part.assembled;
        const [dx, dy, dz] = part.exploded;
        body.place([x + dx * explode, y + dy * explode, z + dz * explode, ...turn]);
      } else {
        body.place(placementAt(this.scene, i, this.time));
      }
      this.dress(body, i);
    });
    const { active } = this;
    for (const [of, arrow] of this.arrows) arrow.visible = active.includes(of);
    this.guides.visible = explode > 0;
    if (explode > 0) this.stretch(explode);
  }

  /** How a part looks, by what was chosen.
   * @param {Body} look
   * @param {number} part */
  dress(look, part) {
    const { selection, scene } = this;
    const picked = selection.part === part || selection.group.has(part);
    const pointed = picked || selection.others.has(part);
    let opacity = selection.explode > 0 ? 1 : visibility(scene, part, this.time);
    const waits = selection.explode === 0 && scene.kind === "assembly" && isWaiting(scene, part, this.time);
    const { step, instruction } = this;
    const body = step === null || selection.explode > 0 || pointing(selection) ? null : scene.steps[step].body;
    // Other bodies: what is out already, what waits.
    if (body && scene.steps[step].of !== null && !body.includes(part)) opacity *= BESIDE;
    if (selection.hidden.has(part) || (waits && !selection.waiting)) opacity = 0;
    else if (selection.through.has(part)) opacity *= THROUGH;
    else if (selection.others.has(part)) opacity *= BLOCKER;
    else if (selection.others.size + selection.group.size > 0 && !pointed) opacity *= BESIDE;
    else if (!pointing(selection) && instruction?.hiding.includes(part)) opacity *= THROUGH;
    look.fade(opacity);
    const moving = this.active.some((step) => scene.steps[step].parts.includes(part));
    const isHeld = selection.explode === 0 && step !== null && scene.steps[step].held.includes(part);
    look.outline(moving || isHeld || picked);
    const own = scene.palette[scene.parts[part].colour];
    const isStuck = this.stuck.includes(part) && (selection.others.size === 0 || picked);
    const isEnd = step === null || scene.duration === 0;
    if (moving) look.paint(scene.colours.moving, "#000000", "#5a1e00");
    else if (isHeld) look.paint(scene.colours.held, picked ? GLOW : "#000000", "#4a0012");
    else if (isEnd && this.free.has(part)) {
      const { free } = scene.colours;
      look.paint(free[this.free.get(part) % free.length], picked ? GLOW : "#000000", STUCK_EDGE);
    } else if (isEnd && isStuck) {
      const { stuck } = scene.colours;
      look.paint(stuck[this.stuck.indexOf(part) % stuck.length], pointed ? GLOW : "#000000", STUCK_EDGE);
    } else {
      // All colours are shown exploded, in the end, and of what is pointed out.
      const pale = selection.explode > 0 || isEnd || pointed ? 0 : PALE;
      const glow = picked ? GLOW : selection.others.has(part) ? "#332a10" : "#000000";
      look.paint(new Color(own).lerp(this.ground, pale), glow, pointed ? "#000000" : this.edge);
    }
  }

  /** Guide lines reach from where parts stand assembled to where they are shown.
   * @param {number} amount */
  stretch(amount) {
    const ends = this.guides.geometry.getAttribute("position");
    this.guides.userData.parts.forEach((part, k) => {
      const { assembled, exploded } = this.scene.parts[part];
      const shown = this.bodies[part].group.visible ? amount : 0;
      ends.setXYZ(2 * k + 1, ...[0, 1, 2].map((a) => assembled[a] + exploded[a] * shown));
    });
    ends.needsUpdate = true;
  }

  /**
   * The part under a point of the window, if one is.
   * @param {number} x
   * @param {number} y
   */
  pick(x, y) {
    const box = this.canvas.getBoundingClientRect();
    const point = new Vector2(((x - box.left) / box.width) * 2 - 1, 1 - ((y - box.top) / box.height) * 2);
    const ray = new Raycaster();
    ray.setFromCamera(point, this.camera);
    const solid = this.bodies.filter((b) => b.group.visible && b.opacity > BESIDE).map((b) => b.surface);
    return ray.intersectObjects(solid, false)[0]?.object.userData.part ?? null;
  }
}

/** Whether the viewer has something pointed out. */
function pointing({ part, others, group }) {
  return part !== null || others.size + group.size > 0;
}

/** A direction as angles around the direction up and above the horizon. */
function spherical(d, up) {
  const [x, y, z] = up.z ? [d.x, d.y, d.z] : [d.x, -d.z, d.y];
  return { around: Math.atan2(y, x), height: Math.asin(Math.min(1, Math.max(-1, z))) };
}

function cartesian({ around, height }, up) {
  const [x, y, z] = [Math.cos(around) * Math.cos(height), Math.sin(around) * Math.cos(height), Math.sin(height)];
  return up.z ? new Vector3(x, y, z) : new Vector3(x, z, -y);
}

/** The axes of the input's frame, from a corner of the assembly's box: red x, green y, blue z. */
function axes(scene, radius) {
  const low = [0, 1, 2].map((a) => Math.min(...scene.parts.map((p) => p.assembled[a] - p.size[a] / 2)));
  const helper = new AxesHelper(radius * 0.3);
  helper.position.fromArray(low.map((x) => x - radius * 0.08));
  return helper;
}

/** Whether pictures are drawn without a graphics card. */
function isSoftware() {
  const gl = document.createElement("canvas").getContext("webgl2");
  const info = gl?.getExtension("WEBGL_debug_renderer_info");
  const name = info ? gl.getParameter(info.UNMASKED_RENDERER_WEBGL) : "";
  gl?.getExtension("WEBGL_lose_context")?.loseContext();
  return /swiftshader|llvmpipe|software/i.test(name);
}

/** The corners of a box about a point.
 * @param {Vector3} at
 * @param {number[]} size */
function boxAt(at, size) {
  const half = (k) => size.map((s, a) => (k & (1 << a) ? s : -s) / 2);
  return Array.from({ length: 8 }, (_, k) => new Vector3().fromArray(half(k)).add(at));
}

/** How far from the middle of all a part's box reaches. */
function reach({ assembled, size }) {
  return Math.hypot(...assembled.slice(0, 3)) + Math.hypot(...size) / 2;
}

/** @param {Scene} scene */
function guides(scene) {
  const parts = scene.parts.flatMap((p, i) => (p.exploded.some((x) => x !== 0) ? [i] : []));
  const ends = new Float32Array(parts.flatMap((i) => [...scene.parts[i].assembled.slice(0, 3), 0, 0, 0]));
  const geometry = new BufferGeometry().setAttribute("position", new BufferAttribute(ends, 3));
  const lines = new LineSegments(
    geometry,
    new LineBasicMaterial({ color: "#3d5a99", transparent: true, opacity: 0.7 }),
  );
  lines.frustumCulled = false;
  lines.userData.parts = parts;
  return lines;
}
