/**
 * Groups of parts that belong together: those that were not taken apart, below the steps, and those that can begin to
 * move, in the verdict. A click shows the group, where it was put down or where it stands.
 * @import { Group, Scene } from "./data.js"
 * @import { Selection } from "./selection.js"
 */
import { byId, element } from "./dom.js";

/**
 * @param {Scene} scene
 * @param {Selection} selection
 * @param {(time: number) => void} seek
 */
export function groupLists(scene, selection, seek) {
  const row = (group) => {
    const show = () => {
      seek(shownAt(scene, group));
      selection.pickGroup(group.parts);
    };
    return element("li", {}, element("button", { type: "button", onclick: show }, group.words));
  };
  byId("kept").append(...scene.kept_together.map(row));
  byId("free-groups").append(...scene.free_together.map(row));
}

/** The last time at which all of a group is seen: what is out fades when nothing more is done to it.
 * @param {Scene} scene
 * @param {Group} group */
export function shownAt(scene, group) {
  const ends = group.parts.map((p) => scene.parts[p]).map((p) => (p.crosses === null ? scene.duration : p.handled[1]));
  return Math.min(...ends);
}

/** In how many groups a step is.
 * @param {Scene} scene
 * @param {number} step */
export function depth(scene, step) {
  const { of } = scene.steps[step];
  return of === null ? 0 : 1 + depth(scene, of);
}
