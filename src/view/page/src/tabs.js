import { byId } from "./dom.js";

/** Tabs by the pattern of the ARIA practices: arrows go from one to the next, all others are not in the tab order. */
export function tabs() {
  const all = [...byId("tabs").querySelectorAll("[role=tab]")];
  const show = (tab) => {
    for (const other of all) {
      const is = other === tab;
      other.setAttribute("aria-selected", String(is));
      other.tabIndex = is ? 0 : -1;
      byId(other.getAttribute("aria-controls")).hidden = !is;
    }
  };
  all.forEach((tab, i) => {
    tab.addEventListener("click", () => show(tab));
    tab.addEventListener("keydown", (event) => {
      const by = { ArrowRight: 1, ArrowLeft: -1 }[event.key];
      if (!by) return;
      event.stopPropagation();
      const next = all[(i + by + all.length) % all.length];
      show(next);
      next.focus();
    });
  });
  show(all[0]);
}
