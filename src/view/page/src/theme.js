/**
 * The light and the dark scheme: as the system has it, until the viewer chooses.
 * @import { Stage } from "./stage.js"
 */
import { byId } from "./dom.js";

/** @param {Stage} stage */
export function theme(stage) {
  const root = document.documentElement;
  const system = matchMedia("(prefers-color-scheme: dark)");
  const set = (dark) => {
    root.dataset.theme = dark ? "dark" : "light";
    byId("dark").setAttribute("aria-pressed", String(dark));
    stage.theme();
  };
  byId("dark").addEventListener("click", () => set(root.dataset.theme !== "dark"));
  system.addEventListener("change", () => set(system.matches));
  set(system.matches);
}
