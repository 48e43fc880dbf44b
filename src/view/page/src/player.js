/**
 * The clock: time, speed, and whether it runs.
 * @import { Scene } from "./data.js"
 */
import { stepAt, timeOf } from "./timeline.js";

/** Seconds per step where motion is not wanted. */
const STEPWISE = 1;

/** Fires `change` whenever time, speed or running changes. */
export class Player extends EventTarget {
  /** @param {Scene} scene */
  constructor(scene) {
    super();
    this.scene = scene;
    this.time = 0;
    this.speed = 1;
    this.playing = false;
    /** Where a single step that runs ends, if one does. */
    this.until = Infinity;
    /** Whether steps are shown by their ends alone, for those whom motion makes ill. */
    this.stepwise = false;
    this.waited = 0;
  }

  /** Seconds pass.
   * @param {number} seconds */
  tick(seconds) {
    if (!this.playing) return;
    const end = Math.min(this.until, this.scene.duration);
    this.time = Math.min(this.stepwise ? this.jumped(seconds) : this.time + seconds * this.speed, end);
    if (this.time >= end) this.playing = false;
    this.changed();
  }

  /** The end of the next step, once a second.
   * @param {number} seconds */
  jumped(seconds) {
    this.waited += seconds * this.speed;
    if (this.waited < STEPWISE) return this.time;
    this.waited = 0;
    const next = this.scene.steps[this.step];
    return next ? next.ends : this.scene.duration;
  }

  /** Goes on, or begins anew at the end. */
  play() {
    if (this.time >= this.scene.duration) this.time = 0;
    this.until = Infinity;
    this.playing = this.scene.duration > 0;
    this.changed();
  }

  pause() {
    this.playing = false;
    this.changed();
  }

  toggle() {
    if (this.playing) this.pause();
    else this.play();
  }

  /** Goes to a time and stops there.
   * @param {number} time */
  seek(time) {
    this.playing = false;
    this.time = Math.min(Math.max(time, 0), this.scene.duration);
    this.changed();
  }

  /** The step under way, or next.
   * @returns {number} */
  get step() {
    return stepAt(this.scene, this.time);
  }

  /** Plays one step and stops.
   * @param {number} step */
  playStep(step) {
    this.playSteps(step, step);
  }

  /** Plays steps in a row and stops.
   * @param {number} first
   * @param {number} last */
  playSteps(first, last) {
    if (first < 0 || last >= this.scene.steps.length) return;
    this.time = timeOf(this.scene, first);
    this.until = this.scene.steps[last].ends;
    this.playing = true;
    this.changed();
  }

  /** To the end of this step, or of the next where this one is over; without playing it. */
  next() {
    this.seek(this.step < this.scene.steps.length ? this.scene.steps[this.step].ends : this.scene.duration);
  }

  /** To the beginning of this step, or of the one before. */
  previous() {
    const { step, time, scene } = this;
    const begun = step < scene.steps.length && time > timeOf(scene, step);
    const to = begun ? step : step - 1;
    this.seek(to < 0 ? 0 : to === 0 ? 0 : scene.steps[to - 1].ends);
  }

  /** @param {number} speed */
  setSpeed(speed) {
    this.speed = speed;
    this.changed();
  }

  changed() {
    this.dispatchEvent(new Event("change"));
  }
}
