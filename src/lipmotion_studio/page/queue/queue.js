// The queue of recordings: ten thousand scroll, because only what is seen is there.

import { choice, icon, inNextFrame, make, textButton } from "../dom.js";
import { clock } from "../timeline/sound_tracks.js";
import { TEXT, fill } from "../strings.js";

const ROW_PX = 30, BEYOND = 6, DOUBT_FULL = 1, AHEAD = 5;
const ORDERS = {
  order: null,
  doubt: (a, b) => (b.doubt ?? -1) - (a.doubt ?? -1),
  name: (a, b) => a.name.localeCompare(b.name, "en", { numeric: true }),
  marked: (a, b) => Number(a.mark !== "none") - Number(b.mark !== "none"),
};

/** Return a name without its ending. */
const shortName = (name) => name.replace(/\.[a-z0-9]{2,4}$/i, "");

/** Return what a recording was edited after: that it was approved, or exported; empty: it was not. */
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
    this.recordings = [];
    this.filter = make("input", { type: "search", placeholder: TEXT.filter, "aria-label": TEXT.filter, oninput: () => this.sort() });
    this.orders = choice(Object.entries(TEXT.sorts), this.order, (order) => { this.order = order; this.sort(); }, { "aria-label": TEXT.sort });
    this.rows = make("div", { className: "rows", role: "presentation" });
    this.view = make("div", { className: "view", role: "listbox", tabIndex: 0, "aria-label": TEXT.recordings }, this.rows);
    this.count = make("p", { className: "count", role: "status" });
    place.append(
      make("div", { className: "bar" }, make("h2", { textContent: TEXT.recordings }), this.orders),
      this.filter, this.view,
      make("div", { className: "bar marks" },
        textButton(TEXT.approve, () => studio.mark("approved"), { id: "approve" }), textButton(TEXT.redoRecording, () => studio.mark("redo"), { id: "redo-line" })),
      this.count,
    );
    this.draw = inNextFrame(() => this.drawNow());
    this.view.addEventListener("scroll", this.draw, { passive: true });
    this.view.addEventListener("click", (event) => {
      const row = event.target.closest(".line");
      if (row) studio.open(this.recordings[Number(row.dataset.place)].id);
    });
    this.view.addEventListener("keydown", (event) => {
      const steps = { ArrowDown: 1, ArrowUp: -1, PageDown: 10, PageUp: -10, Home: -Infinity, End: Infinity };
      if (!(event.key in steps) || event.ctrlKey || event.altKey) return;
      event.preventDefault();
      event.stopPropagation();
      this.step(steps[event.key]);
    });
    new ResizeObserver(this.draw).observe(this.view);
    this.store.on(["recordings"], () => this.sort());
    this.store.on(["recordingId"], () => { this.reveal(); this.draw(); });
    this.store.on(["recording"], () => { if (this.store.recording?.status === "ready") this.ahead(); });
  }

  sort() {
    const words = this.filter.value.toLowerCase().split(/\s+/).filter(Boolean);
    const texts = (recording) => `${recording.name} ${TEXT.states[recording.status]} ${TEXT.marks[recording.mark]} ${editedSince(recording)} ${recording.error ?? ""}`.toLowerCase();
    this.recordings = this.store.recordings.filter((recording) => words.every((word) => texts(recording).includes(word)));
    if (ORDERS[this.order]) this.recordings.sort(ORDERS[this.order]);
    const approved = this.store.recordings.filter(({ mark }) => mark === "approved").length;
    this.count.textContent = fill(TEXT.counted, { shown: this.recordings.length, count: this.store.recordings.length, approved });
    this.rows.style.height = `${this.recordings.length * ROW_PX}px`;
    this.draw();
  }

  place() { return this.recordings.findIndex(({ id }) => id === this.store.recordingId); }

  /** Open another recording, by its distance in the queue. */
  step(distance) {
    if (!this.recordings.length) return;
    const place = Math.min(Math.max(this.place() + distance, 0), this.recordings.length - 1);
    this.studio.open(this.recordings[place].id);
  }

  /** Queue the next recordings for analysis while this one is worked on. */
  ahead() {
    const place = this.place(), next = place < 0 ? [] : this.recordings.slice(place + 1, place + 1 + AHEAD).filter(({ status }) => status === "new");
    if (next.length) this.studio.queueAnalysis(next.map(({ id }) => id));
  }

  reveal() {
    const top = this.place() * ROW_PX, { scrollTop, clientHeight } = this.view;
    if (top >= 0 && (top < scrollTop || top > scrollTop + clientHeight - ROW_PX)) this.view.scrollTop = Math.max(top - clientHeight / 2, 0);
  }

  drawNow() {
    const { scrollTop, clientHeight } = this.view, first = Math.max(Math.floor(scrollTop / ROW_PX) - BEYOND, 0);
    const stop = Math.min(Math.ceil((scrollTop + clientHeight) / ROW_PX) + BEYOND, this.recordings.length), rows = [];
    for (let n = first; n < stop; n++) rows.push(this.row(this.recordings[n], n));
    this.rows.replaceChildren(...rows);
    if (document.getElementById(`line-${this.store.recordingId}`)) this.view.setAttribute("aria-activedescendant", `line-${this.store.recordingId}`);
    else this.view.removeAttribute("aria-activedescendant");
  }

  row(recording, place) {
    const doubt = make("span", { className: "doubt", title: recording.doubt === null ? "" : `doubt ${Math.round(100 * recording.doubt)} %` });
    doubt.style.setProperty("--share", String(Math.min((recording.doubt ?? 0) / DOUBT_FULL, 1)));
    const mark = make("span", { className: `mark ${recording.mark}`, title: TEXT.marks[recording.mark] });
    if (recording.mark !== "none") mark.append(icon(recording.mark === "approved" ? "check" : "again"));
    const since = editedSince(recording), shown = since ? `${recording.edits} *` : recording.edits || "";
    const edits = make("span", { className: shown ? "edits" : "", textContent: shown, title: [shown && `${recording.edits} edits`, since].filter(Boolean).join(", ") });
    const length = recording.duration_s ? clock(recording.duration_s, 0) : "";
    const row = make("div", { className: `line ${recording.status}`, id: `line-${recording.id}`, role: "option", title: recording.error || [recording.name, since].filter(Boolean).join(", "),
      "aria-selected": recording.id === this.store.recordingId, "aria-posinset": place + 1, "aria-setsize": this.recordings.length },
    make("span", { className: "state", title: TEXT.states[recording.status] }), make("span", { className: "name", textContent: shortName(recording.name) }),
    edits, doubt, make("span", { className: "length", textContent: length }), mark);
    row.dataset.place = String(place);
    row.style.transform = `translateY(${place * ROW_PX}px)`;
    return row;
  }
}
