// The queue of lines: ten thousand scroll, because only what is seen is there.

import { choice, icon, inNextFrame, made, textButton } from "../dom.js";
import { clock } from "../timeline/sound_tracks.js";
import { TEXT, filled } from "../strings.js";

const ROW_PX = 30, BEYOND = 6, DOUBT_FULL = 1, AHEAD = 5;
const ORDERS = {
  order: null,
  doubt: (a, b) => (b.doubt ?? -1) - (a.doubt ?? -1),
  name: (a, b) => a.name.localeCompare(b.name, "en", { numeric: true }),
  marked: (a, b) => Number(a.mark !== "none") - Number(b.mark !== "none"),
};

/** Return a name without its ending. */
const shortName = (name) => name.replace(/\.[a-z0-9]{2,4}$/i, "");

/** Return what a line was edited after: that it was approved, or exported; empty: it was not. */
const editedSince = ({ mark, marked, edits_digest, exported }) => [mark === "approved" && marked && marked !== edits_digest && TEXT.editedSince.approved,
  exported === "changed" && TEXT.editedSince.exported].filter(Boolean).join(", ");

export class Queue {
  /**
   * @param {HTMLElement} place
   * @param {import("../studio.js").Studio} studio
   */
  constructor(place, studio) {
    this.studio = studio;
    this.store = studio.store;
    this.order = "order";
    this.lines = [];
    this.filter = made("input", { type: "search", placeholder: TEXT.filter, "aria-label": TEXT.filter, oninput: () => this.sort() });
    this.orders = choice(Object.entries(TEXT.sorts), this.order, (order) => { this.order = order; this.sort(); }, { "aria-label": TEXT.sort });
    this.rows = made("div", { className: "rows", role: "presentation" });
    this.view = made("div", { className: "view", role: "listbox", tabIndex: 0, "aria-label": TEXT.lines }, this.rows);
    this.count = made("p", { className: "count", role: "status" });
    place.append(
      made("div", { className: "bar" }, made("h2", { textContent: TEXT.lines }), this.orders),
      this.filter, this.view,
      made("div", { className: "bar marks" },
        textButton(TEXT.approve, () => studio.mark("approved"), { id: "approve" }), textButton(TEXT.redoLine, () => studio.mark("redo"), { id: "redo-line" })),
      this.count,
    );
    this.draw = inNextFrame(() => this.drawNow());
    this.view.addEventListener("scroll", this.draw, { passive: true });
    this.view.addEventListener("click", (event) => {
      const row = event.target.closest(".line");
      if (row) studio.open(this.lines[Number(row.dataset.place)].id);
    });
    this.view.addEventListener("keydown", (event) => {
      const steps = { ArrowDown: 1, ArrowUp: -1, PageDown: 10, PageUp: -10, Home: -Infinity, End: Infinity };
      if (!(event.key in steps) || event.ctrlKey || event.altKey) return;
      event.preventDefault();
      event.stopPropagation();
      this.step(steps[event.key]);
    });
    new ResizeObserver(this.draw).observe(this.view);
    this.store.on(["lines"], () => this.sort());
    this.store.on(["lineId"], () => { this.reveal(); this.draw(); });
    this.store.on(["line"], () => { if (this.store.line?.status === "ready") this.ahead(); });
  }

  sort() {
    const words = this.filter.value.toLowerCase().split(/\s+/).filter(Boolean);
    const texts = (line) => `${line.name} ${TEXT.states[line.status]} ${TEXT.marks[line.mark]} ${editedSince(line)} ${line.error ?? ""}`.toLowerCase();
    this.lines = this.store.lines.filter((line) => words.every((word) => texts(line).includes(word)));
    if (ORDERS[this.order]) this.lines.sort(ORDERS[this.order]);
    const approved = this.store.lines.filter(({ mark }) => mark === "approved").length;
    this.count.textContent = filled(TEXT.counted, { shown: this.lines.length, count: this.store.lines.length, approved });
    this.rows.style.height = `${this.lines.length * ROW_PX}px`;
    this.draw();
  }

  place() { return this.lines.findIndex(({ id }) => id === this.store.lineId); }

  /** Open another line, by its distance in the queue. */
  step(distance) {
    if (!this.lines.length) return;
    const place = Math.min(Math.max(this.place() + distance, 0), this.lines.length - 1);
    this.studio.open(this.lines[place].id);
  }

  /** Let the next lines be understood while this one is worked on. */
  ahead() {
    const place = this.place(), next = place < 0 ? [] : this.lines.slice(place + 1, place + 1 + AHEAD).filter(({ status }) => status === "new");
    if (next.length) this.studio.understand(next.map(({ id }) => id));
  }

  reveal() {
    const top = this.place() * ROW_PX, { scrollTop, clientHeight } = this.view;
    if (top >= 0 && (top < scrollTop || top > scrollTop + clientHeight - ROW_PX)) this.view.scrollTop = Math.max(top - clientHeight / 2, 0);
  }

  drawNow() {
    const { scrollTop, clientHeight } = this.view, first = Math.max(Math.floor(scrollTop / ROW_PX) - BEYOND, 0);
    const stop = Math.min(Math.ceil((scrollTop + clientHeight) / ROW_PX) + BEYOND, this.lines.length), rows = [];
    for (let n = first; n < stop; n++) rows.push(this.row(this.lines[n], n));
    this.rows.replaceChildren(...rows);
    if (document.getElementById(`line-${this.store.lineId}`)) this.view.setAttribute("aria-activedescendant", `line-${this.store.lineId}`);
    else this.view.removeAttribute("aria-activedescendant");
  }

  row(line, place) {
    const doubt = made("span", { className: "doubt", title: line.doubt === null ? "" : `doubt ${Math.round(100 * line.doubt)} %` });
    doubt.style.setProperty("--share", String(Math.min((line.doubt ?? 0) / DOUBT_FULL, 1)));
    const mark = made("span", { className: `mark ${line.mark}`, title: TEXT.marks[line.mark] });
    if (line.mark !== "none") mark.append(icon(line.mark === "approved" ? "check" : "again"));
    const since = editedSince(line), shown = since ? `${line.edits} *` : line.edits || "";
    const edits = made("span", { className: shown ? "edits" : "", textContent: shown, title: [shown && `${line.edits} edits`, since].filter(Boolean).join(", ") });
    const length = line.duration_s ? clock(line.duration_s, 0) : "";
    const row = made("div", { className: `line ${line.status}`, id: `line-${line.id}`, role: "option", title: line.error || [line.name, since].filter(Boolean).join(", "),
      "aria-selected": line.id === this.store.lineId, "aria-posinset": place + 1, "aria-setsize": this.lines.length },
    made("span", { className: "state", title: TEXT.states[line.status] }), made("span", { className: "name", textContent: shortName(line.name) }),
    edits, doubt, made("span", { className: "length", textContent: length }), mark);
    row.dataset.place = String(place);
    row.style.transform = `translateY(${place * ROW_PX}px)`;
    return row;
  }
}
