/**
 * What the viewer chose about parts: the one picked out, those hidden, isolated or seen through, and how far the
 * whole is exploded.
 */

/** Fires `change`. */
export class Selection extends EventTarget {
  /** @param {number} count of parts */
  constructor(count) {
    super();
    this.count = count;
    /** @type {number | null} */
    this.part = null;
    /** @type {Set<number>} parts pointed out beside it, as what blocks it */
    this.others = new Set();
    /** @type {Set<number>} parts that belong together, pointed out instead */
    this.group = new Set();
    /** @type {Set<number>} */
    this.hidden = new Set();
    /** @type {Set<number>} */
    this.through = new Set();
    this.explode = 0;
    /** Whether parts that wait to be put in are shown. */
    this.waiting = true;
  }

  /**
   * Picks a part out, or none.
   * @param {number | null} part
   * @param {Iterable<number>} others
   */
  pick(part, others = []) {
    this.part = part;
    this.others = new Set(others);
    this.group = new Set();
    this.changed();
  }

  /**
   * Points out parts that belong together.
   * @param {Iterable<number>} parts
   */
  pickGroup(parts) {
    this.part = null;
    this.others = new Set();
    this.group = new Set(parts);
    this.changed();
  }

  /** Hides the picked part, or shows it again. */
  toggleHidden() {
    this.toggle(this.hidden);
  }

  /** Makes the picked part transparent, or solid again. */
  toggleThrough() {
    this.toggle(this.through);
  }

  /** Hides all but the picked part and what is pointed out with it. */
  isolate() {
    if (this.part === null) return;
    const kept = (p) => p === this.part || this.others.has(p);
    this.hidden = new Set(Array.from({ length: this.count }, (_, p) => p).filter((p) => !kept(p)));
    this.changed();
  }

  /** All parts visible and solid. */
  showAll() {
    this.hidden.clear();
    this.through.clear();
    this.changed();
  }

  /** @param {number} amount 0 to 1 */
  setExplode(amount) {
    this.explode = amount;
    this.changed();
  }

  /** @param {boolean} shown */
  setWaiting(shown) {
    this.waiting = shown;
    this.changed();
  }

  /** @param {Set<number>} set */
  toggle(set) {
    if (this.part === null) return;
    if (!set.delete(this.part)) set.add(this.part);
    this.changed();
  }

  changed() {
    this.dispatchEvent(new Event("change"));
  }
}
