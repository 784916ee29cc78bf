// The panel beside the face: what is selected, delivery, why, history.

import { make, replaced } from "../dom.js";
import { TEXT } from "../strings.js";
import { editTab } from "./edit_tab.js";
import { deliveryTab } from "./delivery_tab.js";
import { whyTab } from "./why_tab.js";
import { historyTab } from "./history_tab.js";

/** Each tab, and what it is made anew for: a panel that is made anew under the pointer loses a click. */
const TABS = {
  edit: { shown: editTab, follows: ["recording", "selected", "span"] }, delivery: { shown: deliveryTab, follows: ["recording"] },
  why: { shown: whyTab, follows: ["recording", "doubts"] }, history: { shown: historyTab, follows: ["recording", "other", "heads", "project"] },
};

export class Panel {
  /**
   * @param {HTMLElement} place
   * @param {import("../studio.js").Studio} studio
   */
  constructor(place, studio) {
    const { store } = studio, names = Object.keys(TABS);
    this.body = make("div", { className: "body", role: "tabpanel", tabIndex: 0, id: "panel-body" });
    const tabs = names.map((name) => make("button", { type: "button", role: "tab", id: `tab-${name}`, textContent: TEXT.tabs[name],
      "aria-controls": "panel-body", onclick: () => store.set({ tab: name }) }));
    const list = make("div", { className: "tabs", role: "tablist" }, ...tabs);
    list.addEventListener("keydown", (event) => {
      const step = { ArrowRight: 1, ArrowLeft: -1 }[event.key];
      if (!step) return;
      event.preventDefault();
      event.stopPropagation();
      const tab = names[(names.indexOf(store.tab) + step + names.length) % names.length];
      store.set({ tab });
      document.getElementById(`tab-${tab}`).focus();
    });
    place.append(list, this.body);
    store.on(["tab"], () => {
      tabs.forEach((tab, n) => {
        tab.setAttribute("aria-selected", names[n] === store.tab);
        tab.tabIndex = names[n] === store.tab ? 0 : -1;
      });
      this.body.setAttribute("aria-labelledby", `tab-${store.tab}`);
    });
    const show = () => replaced(this.body, ...TABS[store.tab].shown(studio));
    for (const [tab, { follows }] of Object.entries(TABS)) store.on(follows, () => { if (store.tab === tab) show(); });
    store.on(["tab"], show);
    store.on(["time_s"], () => {
      if (!store.playing) for (const each of this.body.querySelectorAll("[data-follows]")) each.follow?.();
    });
  }
}
