// A tier of spans with labels: words, or phones, whose borders can be dragged.

import { make, onDrag } from "../dom.js";
import { say } from "../sentences.js";
import { TEXT, fill } from "../strings.js";

const LEAST_PX = 3, LABEL_PX = 6, NARROW_PX = 13, LEAST_BORDER_PX = 3, LEAST_PHONE_S = 0.01, SURE = 0.5;

/** A finger needs more room; a border leaves half of a short phone to the phone. */
const BORDER_PX = matchMedia("(pointer: coarse)").matches ? 19 : 9;

export class Tier {
  /** @param {"words" | "phones"} name */
  constructor(timeline, name) {
    this.timeline = timeline;
    this.store = timeline.store;
    this.name = name;
    this.kind = name === "words" ? "word" : "phone";
    this.shown = new Map(); // elements by place
    this.borders = new Map();
    this.settled = Promise.resolve(); // when what was dragged before is on the server
    this.dragged = null; // a border on its way: the phone before it, its time, and the time that the server has
    this.whole = make("div", { className: "whole" }); // from the beginning of the recording: scrolling moves this alone
    this.element = make("div", { className: `track tier ${name}`, role: "group", "aria-label": TEXT[name] }, this.whole);
  }

  /** Spans as they are shown: with the border that is dragged. */
  spans() {
    const spans = this.store.recording?.[this.name] ?? [];
    if (this.dragged === null || this.name !== "phones") return spans;
    const { before, time_s } = this.dragged;
    return spans.map((span, n) => (n === before ? { ...span, end_s: time_s } : n === before + 1 ? { ...span, start_s: time_s } : span));
  }

  draw() {
    const { timeline, store: { selected } } = this, spans = this.spans(), seen = new Set(), seenBorders = new Set();
    const first = firstAfter(spans, timeline.start_s), { end_s, px_s, left_px } = timeline;
    const scrolled = this.of?.spans === spans && this.of.px_s === px_s && this.of.selected === selected;
    this.of = { spans, px_s, selected };
    this.whole.style.transform = `translateX(${-left_px}px)`;
    for (let n = first; n < spans.length && spans[n].start_s < end_s; n++) {
      const span = spans[n], wide = (span.end_s - span.start_s) * px_s;
      if (wide < LEAST_PX && this.dragged?.before !== n) continue;
      seen.add(n);
      if (!scrolled || !this.shown.has(n)) this.drawSpan(n, span, wide, selected);
      if (this.name !== "phones" || n + 1 >= spans.length) continue;
      const across = Math.min(BORDER_PX, wide / 2, ((spans[n + 1].end_s - spans[n + 1].start_s) * px_s) / 2);
      if (across < LEAST_BORDER_PX && this.dragged?.before !== n) continue;
      seenBorders.add(n);
      if (scrolled && this.borders.has(n)) continue;
      const border = this.border(n);
      border.style.width = `${across}px`;
      border.style.transform = `translateX(${span.end_s * px_s - across / 2}px)`;
    }
    for (const [kept, known] of [[seen, this.shown], [seenBorders, this.borders]]) {
      for (const [n, element] of known) {
        if (kept.has(n)) continue;
        element.remove();
        known.delete(n);
      }
    }
  }

  drawSpan(n, span, wide, selected) {
    const button = this.button(n), isSelected = selected?.kind === this.kind && selected.index === n;
    const label = wide >= LABEL_PX ? span.label : "";
    if (button.textContent !== label) button.textContent = label;
    button.style.transform = `translateX(${span.start_s * this.timeline.px_s}px)`;
    button.style.width = `${wide}px`;
    button.classList.toggle("selected", isSelected);
    button.classList.toggle("narrow", wide < NARROW_PX);
    button.classList.toggle("silent", span.label === "sil" || span.label === "sp");
    button.classList.toggle("doubtful", span.confidence !== null && span.confidence < SURE);
    button.classList.toggle("edited", Boolean(span.edited));
    button.setAttribute("aria-pressed", isSelected);
    const values = { number: n + 1, label: span.label, start: span.start_s.toFixed(3), end: span.end_s.toFixed(3) };
    const sure = span.confidence === null || span.confidence === undefined ? "" : `, ${fill(TEXT.sure, { share: Math.round(100 * span.confidence) })}`;
    const name = fill(TEXT[`${this.kind}Label`], values) + sure + (span.edited ? `, ${TEXT.edited}` : "");
    if (button.title !== name) {
      button.title = name;
      button.setAttribute("aria-label", name);
    }
  }

  button(n) {
    if (!this.shown.has(n)) {
      const button = make("button", { type: "button", className: this.kind, tabIndex: -1 });
      button.dataset.index = n;
      button.addEventListener("click", (event) => {
        if (event.shiftKey && this.store.span) return this.timeline.studio.extendTo(this.kind, n);
        this.timeline.studio.choose(this.kind, n);
      });
      button.addEventListener("dblclick", () => this.type(n));
      this.shown.set(n, button);
      this.whole.append(button);
    }
    return this.shown.get(n);
  }

  border(n) {
    if (!this.borders.has(n)) {
      const border = make("div", { className: "border" });
      border.dataset.before = n;
      this.borders.set(n, border);
      this.whole.append(border);
      onDrag(border, {
        start: (event) => { this.offset = event.clientX - this.timeline.x(this.store.recording.phones[n].end_s); },
        move: (event) => this.drag(n, (event.clientX - this.offset + this.timeline.left_px) / this.timeline.px_s),
        end: (event) => {
          if (this.dragged && !this.dragged.dropped) return this.drop();
          return this.timeline.studio.choose("phone", this.timeline.timeOf(event) < this.store.recording.phones[n].end_s ? n : n + 1);
        },
        cancel: () => this.cancel(),
      });
    }
    return this.borders.get(n);
  }

  /** Show a border elsewhere, between the phones beside it, and let the face follow. */
  drag(before, time_s) {
    const { phones } = this.store.recording, least = phones[before].start_s + LEAST_PHONE_S, most = phones[before + 1].end_s - LEAST_PHONE_S;
    if (this.dragged?.before !== before || this.dragged.dropped) {
      this.drop();
      this.dragged = { before, time_s: null, sent_s: null, loop: null, earlier: Promise.all([this.settled, this.timeline.studio.edits]), dropped: false };
    }
    this.dragged.time_s = Number(Math.min(Math.max(time_s, least), most).toFixed(3));
    this.borders.get(before)?.classList.add("dragged");
    this.timeline.studio.player.seek(this.dragged.time_s);
    this.timeline.draw();
    this.sent(this.dragged);
  }

  /** Send where a border is until the server has it there: each edit takes the place of the one before. */
  sent(dragged) {
    const send = async () => {
      await dragged.earlier;
      while (dragged.time_s !== dragged.sent_s) {
        const { before, time_s } = dragged;
        if (!await this.timeline.studio.dragBorder([say.ends(before + 1, time_s)], dragged.sent_s === null ? 0 : 1)) break;
        dragged.sent_s = time_s;
      }
    };
    dragged.loop ??= send().finally(() => { dragged.loop = null; });
    return dragged.loop;
  }

  /** The border stays where it is. */
  drop() {
    const { dragged } = this;
    if (!dragged || dragged.dropped) return;
    dragged.dropped = true;
    this.settled = this.sent(dragged).then(() => this.leave(dragged));
  }

  /** The border goes back to where it was. */
  cancel() {
    const { dragged } = this;
    if (!dragged || dragged.dropped) return;
    dragged.dropped = true;
    dragged.time_s = dragged.sent_s; // no more is sent
    this.leave(dragged);
    this.settled = this.sent(dragged).then(() => dragged.sent_s !== null && this.timeline.studio.dragBorder([], 1));
  }

  leave(dragged) {
    this.borders.get(dragged.before)?.classList.remove("dragged");
    if (this.dragged === dragged) this.dragged = null;
    this.timeline.draw();
  }

  /** Type over a label: Enter makes the edit, Escape leaves. */
  type(n) {
    const span = this.store.recording?.[this.name][n], button = this.shown.get(n);
    if (!span || !button) return;
    const field = make("input", {
      className: "over", value: span.label, "aria-label": button.title, autocapitalize: "none", spellcheck: false,
      ...(this.kind === "phone" ? { list: "phones-known" } : {}),
    });
    field.style.left = `${Math.min(Math.max(this.timeline.x(span.start_s) - 4, 0), this.timeline.width - 96)}px`;
    let left = false;
    const leave = (label) => {
      if (left) return;
      left = true;
      field.remove();
      this.timeline.scroller.focus({ preventScroll: true });
      if (label && label !== span.label) this.timeline.studio.relabel(this.kind, n, label);
    };
    field.addEventListener("keydown", (event) => {
      event.stopPropagation();
      if (event.key === "Enter") leave(field.value.trim().toLowerCase());
      if (event.key === "Escape") leave("");
    });
    field.addEventListener("blur", () => leave(""));
    this.element.append(field);
    field.focus();
    field.select();
  }
}

/** Return the place of the first span that ends after a time. */
export function firstAfter(spans, time_s) {
  let low = 0, high = spans.length;
  while (low < high) {
    const middle = (low + high) >> 1;
    if (spans[middle].end_s > time_s) high = middle;
    else low = middle + 1;
  }
  return low;
}
