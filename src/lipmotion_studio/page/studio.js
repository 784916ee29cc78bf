// The studio: one page over the recordings of a project. What it shows comes from the server; what it changes are sentences.

import { showExport, showKeys } from "./dialogs.js";
import { WhenCalm } from "./calm.js";
import { bothButton, icon, iconButton, make, textButton } from "./dom.js";
import { Comparison } from "./compare/comparison.js";
import { Stage } from "./face/stage.js";
import { Weights } from "./face/weights.js";
import { addFiles } from "./files.js";
import { listen } from "./keys.js";
import { followOwn, showOwn } from "./own.js";
import { Panel } from "./panel/panel.js";
import { Queue } from "./queue/queue.js";
import { say } from "./sentences.js";
import { Refused, Server } from "./server.js";
import { ShownCurves } from "./shown_curves.js";
import { Player } from "./sound/player.js";
import { samplesOf } from "./sound/samples.js";
import { Store } from "./store.js";
import { OWN, TEXT, fill } from "./strings.js";
import { Timeline } from "./timeline/timeline.js";
import { Transport } from "./transport.js";

const PAGE_SIZE = 1000, POLL_MS = 300, DOUBTFUL = 0.7, MOST_DOUBTS = 12, CALM_MS = 5000, OWN_MS = 1000, NUDGE_MS = 250;
/** Of a recording that is not ready. */
const NOTHING = { words: [], phones: [], channels: [], steps: [], undo: 0, redo: 0 };

export class Studio {
  constructor() {
    this.server = new Server(location.hash.slice(1));
    this.store = new Store();
    this.player = new Player(this.store);
    this.settling = new WhenCalm(this.store, () => this.settle());
    /** @type {Promise<any>} */ this.edits = Promise.resolve();
    /** @type {string | null} */ this.typed = null; // words that were typed, until they are said
    this.isEarly = false; // whether something could not be read because the recording is being analysed
    this.left = false; // whether tabulators go on past the timeline
    this.askedAt = this.editedAt = 0; // when the edit was asked for whose motion is on its way, or is shown next
    this.build();
    listen(this);
  }

  build() {
    const { store } = this, part = (tag, id, properties = {}) => make(tag, { id, ...properties });
    const queue = part("nav", "queue", { "aria-label": TEXT.recordings }), face = part("section", "stage", { "aria-label": TEXT.face });
    const panel = part("aside", "panel", { "aria-label": TEXT.places.panel }), transport = part("div", "transport", { role: "toolbar", "aria-label": TEXT.play });
    const timeline = part("section", "timeline", { className: "timeline", "aria-label": TEXT.places.stage });
    this.message = part("p", "message", { role: "status" });
    this.state = part("p", "saved");
    this.title = part("h1", "title");
    this.cover = part("div", "cover", { hidden: true });
    const picker = make("input", { type: "file", multiple: true, accept: "audio/*,video/*,.txt", hidden: true, "aria-label": TEXT.open, onchange: () => this.add([...picker.files]) });
    const own = bothButton("person", OWN.open, () => showOwn(this), { id: "own" });
    const header = make("header", {}, iconButton("lines", TEXT.hideRecordings, () => document.body.classList.toggle("without-queue"), { id: "hide-lines" }), this.title,
      bothButton("plus", TEXT.open, () => picker.click(), { id: "open" }), picker, own,
      bothButton("out", TEXT.export, () => showExport(this), { id: "export" }), textButton("?", () => this.help(), { id: "help", title: TEXT.help, "aria-label": TEXT.help }));
    const places = make("nav", { id: "places", "aria-label": TEXT.show }, ...["lines", "stage", "panel"].map((name) => textButton(TEXT.places[name],
      () => this.showPlace(name), { id: `place-${name}` })));
    document.body.append(header, make("main", {}, queue, face, panel, transport, timeline, this.cover), make("footer", {}, this.message, this.state), places,
      make("datalist", { id: "phones-known" }));
    this.showPlace("stage");
    this.queue = new Queue(queue, this);
    this.weights = new Weights(this);
    this.curves = new ShownCurves(this);
    this.stage = new Stage(face, this);
    this.timeline = new Timeline(timeline, this);
    this.transport = new Transport(transport, this);
    this.comparison = new Comparison(this);
    this.panel = new Panel(panel, this);
    followOwn(own, this);
    store.on(["message"], () => {
      const { text, again } = store.message;
      this.message.replaceChildren(text, ...(again ? [" ", textButton(TEXT.makeAgain, again, { id: "make-again" })] : []));
      this.message.className = store.message.kind;
    });
    store.on(["saving", "unsaved", "recording"], () => {
      this.state.textContent = store.saving ? TEXT.saving : store.unsaved ? TEXT.notSaved : store.recording ? TEXT.saved : "";
    });
    store.on(["project", "recording"], () => {
      this.title.textContent = [store.project?.name, store.recording?.name].filter(Boolean).join(" / ") || TEXT.studio;
      document.title = store.recording ? `${store.recording.name} · ${TEXT.studio}` : TEXT.studio;
    });
    store.on(["recordings", "recording", "project", "progress"], () => this.coverUp());
    for (const name of ["dragenter", "dragover"]) addEventListener(name, (event) => { event.preventDefault(); document.body.classList.add("dropping"); });
    addEventListener("dragleave", (event) => { if (!event.relatedTarget) document.body.classList.remove("dropping"); });
    addEventListener("drop", async (event) => {
      event.preventDefault();
      document.body.classList.remove("dropping");
      this.add(event.dataTransfer);
    });
    addEventListener("beforeunload", (event) => { if (store.saving) event.preventDefault(); });
  }

  showPlace(name) {
    document.body.dataset.place = name;
    for (const button of document.querySelectorAll("#places button")) button.setAttribute("aria-pressed", String(button.id === `place-${name}`));
  }

  /** Say something in the status line; `again`: what its button does. */
  say(text, kind = "", again = null) { this.store.set({ message: { text, kind, again } }); }

  /** What was refused is shown until something succeeds. */
  succeed() { if (this.store.message.kind) this.say(""); }

  refuse(error) {
    if (error.name === "AbortError") return;
    if (error.isEarly) { // nobody asked for it: all is read again once the recording is ready
      this.isEarly = true;
      this.wake();
      return;
    }
    this.say(error.status === 401 ? TEXT.noToken : error.message, "bad");
    if (!(error instanceof Refused)) throw error;
  }

  async start() {
    try {
      await this.reloadList();
      const first = this.store.recordings.find(({ status }) => status === "ready") ?? this.store.recordings[0];
      if (first) await this.open(first.id);
    } catch (error) {
      this.refuse(error);
    }
    this.poll();
  }

  /** Read the recordings of the project, a page after another. */
  async reloadList() {
    let recordings = [], page = null;
    do {
      const before = page;
      page = await this.server.read(`project?from=${recordings.length}&count=${PAGE_SIZE}`);
      recordings = before && before.count !== page.count ? [] : [...recordings, ...page.lines]; // some have come or gone: from the first one on
    } while ((page.lines.length || !recordings.length) && recordings.length < page.count);
    if (!this.store.project) {
      document.getElementById("phones-known").replaceChildren(...page.forms.phones.map(({ name }) => make("option", { value: name })));
      this.store.set({ face: page.forms.faces.find(({ mesh }) => mesh)?.name ?? page.forms.faces[0]?.name });
    }
    this.store.set({ project: page, recordings });
  }

  /** Ask for what the server does by itself, more often while a recording is made. */
  async poll() {
    let pause_ms = CALM_MS;
    try {
      const { lines: recordings, revision, training } = await this.server.read("progress");
      if (this.store.message.text === TEXT.noReply) this.succeed();
      this.store.set({ training });
      const before = this.store.recordings.map(({ id, status }) => `${id} ${status}`).join();
      if (recordings.length || revision !== this.store.project?.revision) {
        const states = new Map(recordings.map((recording) => [recording.id, recording]));
        const changed = this.store.recordings.some(({ id, status }) => states.has(id) && states.get(id).status !== status);
        if (changed || revision !== this.store.project?.revision) await this.reloadList();
        this.store.set({ progress: states.get(this.store.recordingId) ?? null });
        if (recordings.some(({ status }) => status === "waiting" || status === "working")) pause_ms = POLL_MS;
      }
      if (training.state === "working") pause_ms = Math.min(pause_ms, OWN_MS);
      const open = this.store.recordings.find(({ id }) => id === this.store.recordingId);
      const isDue = open && this.store.recording && (open.status !== this.store.recording.status || (this.isEarly && open.status === "ready"));
      if (isDue && before) await this.open(open.id, true);
    } catch (error) {
      if (error instanceof Refused) this.refuse(error);
      else throw error;
    }
    clearTimeout(this.polling);
    this.polling = setTimeout(() => this.poll(), pause_ms);
  }

  /** Ask soon, and often. */
  wake() {
    clearTimeout(this.polling);
    this.polling = setTimeout(() => this.poll(), POLL_MS);
  }

  /** Show another recording. */
  async open(id, again = false) {
    if (id === this.store.recordingId && !again) return;
    if (!again) {
      this.typed = null;
      this.say("");
    }
    this.isEarly = false;
    this.player.stop();
    this.weights.forget();
    this.store.set({ recordingId: id, recording: null, sound: null, motion: null, deviation: null, confidence: null, weights: null, other: null, comparing: false, heads: "one", doubts: [], selected: null, span: null, time_s: 0, progress: null });
    try {
      const recording = { ...NOTHING, ...(await this.server.read(`lines/${id}`)) };
      if (id !== this.store.recordingId) return;
      if (recording.status !== "ready") this.wake();
      this.settleLater(recording);
      this.store.set({ recording });
      const sound = this.server.bytes(`lines/${id}/sound.wav`).then((buffer) => {
        if (id !== this.store.recordingId) return;
        this.player.load(buffer);
        this.store.set({ sound: samplesOf(buffer) });
      });
      await Promise.all([sound, recording.status === "ready" && this.reloadCurves(id, null)]);
    } catch (error) {
      if (id === this.store.recordingId) this.refuse(error);
    }
  }

  /** Read curves of a recording again; `changed`: only this stretch of them, null: all. The weights of the face follow. */
  async reloadCurves(id, changed) {
    const following = this.weights.change(changed);
    await this.curves.change(id, changed);
    if (id !== this.store.recordingId) return;
    this.loadDoubts(id);
    if (!changed) await following;
  }

  async loadDoubts(id) {
    const doubts = await this.server.read(`lines/${id}/doubts`).catch(() => []), { phones } = this.store.recording ?? { phones: [] };
    if (id !== this.store.recordingId) return;
    const spans = doubts.filter(({ confidence }) => confidence < DOUBTFUL).slice(0, MOST_DOUBTS).map(({ time_s, confidence, phone }) => {
      const place = phones.findIndex(({ end_s }) => end_s > time_s), { start_s = time_s, end_s = time_s } = phones[place] ?? {};
      return { start_s, end_s, confidence, place, text: fill(TEXT.doubtOf, { phone: phones[place]?.label ?? phone, share: Math.round(100 * confidence) }) };
    });
    this.store.set({ doubts: spans });
  }

  /** Choose which curves are shown. */
  async showCurves(channels) {
    this.store.set({ channels });
    try {
      if (this.store.recording?.status === "ready") await this.curves.fill(this.store.recordingId);
    } catch (error) {
      this.refuse(error);
    }
  }

  /** Make edits; one after another, each with the revision that the one before left. Returns whether they were made. */
  edit(steps) { return this.request("edits", { steps }, fill(TEXT.changed, { what: steps.join(", ") })); }

  /** Where a dragged border is: each edit takes the place of the one before; all others wait for the last one. */
  dragBorder(steps, instead) {
    return this.sending(this.sendChange(this.store.recordingId, "edits", { steps, ...(instead ? { instead } : {}) }, fill(TEXT.changed, { what: steps[0] ?? "" })));
  }

  undo() { return this.stepEdits("undo", TEXT.undone, TEXT.nothingToUndo); }

  redo() { return this.stepEdits("redo", TEXT.redone, TEXT.nothingToRedo); }

  /** Go back to a version that was kept; the edits as they are are kept, too. */
  restoreVersion({ name, number }) { return this.request("versions/back", { version: name }, fill(TEXT.wentBack, { number })); }

  stepEdits(kind, done, nothing) {
    const { recording, saving } = this.store;
    if (recording?.status !== "ready") return this.say(TEXT.notOpen);
    return recording[kind] || saving ? this.request(kind, {}, done) : this.say(nothing);
  }

  async realign(text) {
    const { span } = this.store;
    this.typed = text;
    if (await this.request("transcript", { text, ...(span ?? {}) }, TEXT.aligned)) this.typed = null;
  }

  /** After edits of a long recording, which moved the mouth around them alone, make the full motion. */
  settleLater({ settled }) {
    if (settled === false) this.settling.want();
    else this.settling.drop();
  }

  settle() {
    const id = this.store.recordingId;
    this.edits = this.edits.then(() => this.sendChange(id, "settle", {}, "")).catch(() => {});
  }

  request(kind, content, done) {
    this.settling.drop();
    const id = this.store.recordingId;
    return this.inTurn(() => this.sendChange(id, kind, content, done));
  }

  /** Do something after the changes before it, which leave another revision. */
  inTurn(act) {
    const { phones } = this.timeline;
    phones.drop();
    const reply = this.sending(Promise.all([phones.settled, this.edits]).then(act));
    this.edits = reply.catch(() => {});
    return reply;
  }

  /** Show that something is being saved until it is. */
  sending(reply) {
    this.store.set({ saving: this.store.saving + 1 });
    return reply.finally(() => this.store.set({ saving: this.store.saving - 1 }));
  }

  async sendChange(id, kind, content, done) {
    if (id !== this.store.recordingId || !this.store.recording) return false;
    const asked_ms = performance.now();
    try {
      const state = await this.server.post(`lines/${id}/${kind}`, { revision: this.store.recording.revision, ...content });
      if (id !== this.store.recordingId) return true;
      if (state.status && state.status !== "ready") return this.open(id, true);
      this.take(state);
      const guessed = (state.guessed ?? []).map(({ word, phones }) => `${word} (${phones.join(" ")})`).join(", ");
      this.succeed();
      if (guessed || done) this.say(guessed ? fill(TEXT.guessed, { words: guessed }) : done);
      this.store.set({ unsaved: false });
      if (state.changed) {
        this.askedAt = asked_ms;
        await this.reloadCurves(id, state.changed);
      }
      return true;
    } catch (error) {
      if (error instanceof Refused && error.status === 409) {
        const what = (content.steps ?? [content.text ?? kind]).join(", ");
        await this.reportConflict(id, error.state, what, () => this.request(kind, { ...content, ...(content.instead ? { instead: 0 } : {}) }, done));
      } else {
        if (error.status === 0) this.store.set({ unsaved: true });
        this.refuse(error);
      }
      return false;
    }
  }

  /** Somebody else was first: show the recording as it is now, say what was not made, and offer to make it. */
  async reportConflict(id, state, what, again) {
    if (id !== this.store.recordingId) return;
    if (state?.status === "ready") {
      this.take(state);
      await this.reloadCurves(id, null);
    } else await this.open(id, true);
    await this.reloadList();
    this.say(fill(TEXT.elsewhere, { what }), "bad", again);
  }

  /** Take a new state of the open recording. */
  take(recording) {
    const { selected, recordings, span, recording: before } = this.store, list = selected && recording[`${selected.kind}s`];
    const was = selected && before?.[`${selected.kind}s`]?.[selected.index], is = list?.[selected.index];
    const follows = was && is && span && span.start_s === was.start_s && span.end_s === was.end_s;
    const listed = recordings.map((each) => (each.id === recording.id ? { ...each, edits: recording.steps.length, edits_digest: recording.edits_digest, revision: recording.revision,
      exported: each.exported === "yes" && each.edits_digest !== recording.edits_digest ? "changed" : each.exported } : each));
    this.settleLater(recording);
    this.store.set({ recording, recordings: listed, ...(list && !is ? { selected: null } : {}),
      ...(follows ? { span: { start_s: is.start_s, end_s: is.end_s } } : {}) });
  }

  /** The face that is drawn next is that after the last edit. */
  faceComes() {
    this.editedAt = this.askedAt;
    this.askedAt = 0;
  }

  /** The face has been drawn: how long after the edit is kept with the measures of the page. */
  measureDelay() {
    if (!this.editedAt) return;
    performance.measure("edit to face", { start: this.editedAt, end: performance.now() });
    this.editedAt = 0;
  }

  /** Select a phone or a word, and its time. */
  choose(kind, index) {
    this.left = false;
    const span = this.store.recording?.[`${kind}s`][index];
    if (!span) return;
    this.store.set({ selected: { kind, index }, span: { start_s: span.start_s, end_s: span.end_s }, tab: this.store.tab === "why" ? "why" : "edit" });
    if (!this.store.playing) this.player.seek(span.start_s);
    this.timeline.reveal(span.start_s, span.end_s);
  }

  extendTo(kind, index) {
    const span = this.store.recording[`${kind}s`][index], now = this.store.span;
    this.store.set({ span: { start_s: Math.min(span.start_s, now.start_s), end_s: Math.max(span.end_s, now.end_s) } });
  }

  chooseCurve(channel, pin_s = null) { this.store.set({ selected: { kind: "curve", index: this.store.channels.indexOf(channel), channel, pin_s }, tab: "edit" }); }

  /** Take out the selected pin, or else the selected phone. */
  remove() {
    const { selected } = this.store;
    if (selected?.kind !== "curve" || selected.pin_s === null) return this.withPhone((index) => this.removePhone(index));
    return this.edit([say.unpin(selected.channel, selected.pin_s)]);
  }

  /** The next or previous phone or word, by the key of tabulators; past the last one the focus goes on. */
  tab(event) {
    const target = /** @type {HTMLElement} */ (event.target), { recording, selected, time_s } = this.store;
    if (!recording?.phones?.length || !target.closest(".timeline") || (this.left && !selected)) return;
    const kind = selected?.kind === "word" ? "word" : "phone", spans = recording[`${kind}s`];
    const here = selected?.kind === kind ? selected.index + (event.shiftKey ? -1 : 1) : Math.max(spans.findIndex(({ end_s }) => end_s > time_s), 0);
    if (here < 0 || here >= spans.length) return;
    event.preventDefault();
    this.choose(kind, here);
    this.timeline.scroller.focus({ preventScroll: true });
  }

  changeTier(up) {
    const { recording, selected } = this.store;
    if (!recording) return;
    const holds = (span, { start_s, end_s }) => span.start_s <= (start_s + end_s) / 2 && span.end_s > (start_s + end_s) / 2;
    if (up && selected?.kind === "phone") this.choose("word", recording.words.findIndex((word) => holds(word, recording.phones[selected.index])));
    if (!up && selected?.kind === "word") this.choose("phone", recording.phones.findIndex((phone) => holds(recording.words[selected.index], phone)));
  }

  type() {
    const { selected } = this.store;
    if (!selected || selected.kind === "curve") return this.focusOn("curve-value");
    const span = this.store.recording[`${selected.kind}s`][selected.index];
    this.timeline.reveal(span.start_s, span.end_s);
    this.timeline.drawNow();
    this.timeline[`${selected.kind}s`].type(selected.index);
  }

  relabel(kind, index, label) { return this.edit([kind === "word" ? say.word(index + 1, label) : say.phone(index + 1, label)]); }

  withPhone(act) {
    const { selected } = this.store;
    if (selected?.kind === "phone") act(selected.index);
    else this.say(TEXT.needsPhone, "bad");
  }

  /** Split a phone at the playhead, or else in its middle: the second half can then be made another one. */
  async split(index) {
    const { start_s, end_s } = this.store.recording.phones[index], { time_s } = this.store;
    const inside = time_s > start_s + 0.01 && time_s < end_s - 0.01;
    if (await this.edit([say.split(index + 1, inside ? time_s : (start_s + end_s) / 2)])) this.choose("phone", index + 1);
  }

  async merge(index) {
    if (await this.edit([say.remove(index + 2)])) this.choose("phone", index);
  }

  async removePhone(index) {
    if (await this.edit([say.remove(index + 1)])) this.choose("phone", Math.max(index - 1, 0));
  }

  /** Lock the selection, or hold the pose of its beginning. */
  over(sentence) {
    const { span } = this.store;
    if (!span) return this.say(TEXT.needsSpan, "bad");
    return this.edit([sentence(span.start_s, span.end_s)]);
  }

  /** Move a border of the selected phone by frames; presses in quick succession are one edit. */
  nudge(side, frames) {
    this.withPhone((index) => {
      const tier = this.timeline.phones, before = side === "end" ? index : index - 1;
      if (before < 0 || before + 1 >= this.store.recording.phones.length) return;
      const from_s = tier.dragged?.before === before ? tier.dragged.time_s : this.store.recording.phones[before].end_s;
      tier.drag(before, from_s + frames / this.store.recording.rate_hz);
      clearTimeout(this.nudging);
      this.nudging = setTimeout(() => tier.drop(), NUDGE_MS);
    });
  }

  /** The time of the frame at the playhead. */
  get frameTime() {
    const rate = this.store.recording?.rate_hz ?? 100;
    return Math.round(this.store.time_s * rate) / rate;
  }

  step(frames) {
    this.player.stop();
    this.player.seek(this.frameTime + frames / (this.store.recording?.rate_hz ?? 100));
    this.timeline.reveal(this.store.time_s);
  }

  markSpan(isStart) {
    const { span, time_s } = this.store, end_s = span && span.end_s > time_s ? span.end_s : this.player.duration_s;
    if (isStart) return this.store.set({ span: { start_s: time_s, end_s } });
    return this.store.set({ span: { start_s: span && span.start_s < time_s ? span.start_s : 0, end_s: time_s } });
  }

  /** Leave a field for the timeline; there, clear the selection; then tabulators go on to what follows the timeline. */
  leave() {
    if (document.activeElement instanceof HTMLElement && document.activeElement !== this.timeline.scroller) return this.timeline.scroller.focus({ preventScroll: true });
    this.left = !this.store.selected;
    return this.store.set({ selected: null, span: null, tool: "select" });
  }

  goTo({ start_s, end_s, place }) {
    this.timeline.reveal(start_s, end_s);
    if (place >= 0) return this.choose("phone", place);
    return this.player.seek(start_s);
  }

  /** Go to the next doubt in time, or the previous one. */
  jump(direction) {
    const doubts = [...this.store.doubts].sort((a, b) => direction * (a.start_s - b.start_s)), { time_s } = this.store;
    const next = doubts.find(({ start_s }) => direction * (start_s - time_s) > 1e-3) ?? doubts[0];
    if (next) this.goTo(next);
    else this.say(TEXT.noDoubts);
  }

  focusOn(id) {
    this.store.set({ tab: "edit" });
    queueMicrotask(() => document.getElementById(id)?.focus());
  }

  /** Queue recordings for analysis, after those that wait already. */
  async queueAnalysis(lines) {
    try {
      await this.server.post("understand", { lines });
      this.succeed();
      await this.reloadList();
      this.wake();
    } catch (error) {
      this.refuse(error);
    }
  }

  mark(mark) {
    const { recordingId } = this.store;
    return this.inTurn(async () => {
      const { recordings, recording } = this.store, row = recordings.find(({ id }) => id === recordingId), seen = recording?.id === recordingId ? recording : row;
      if (!row) return;
      try {
        const changed = await this.server.post(`lines/${recordingId}/mark`, { mark: row.mark === mark ? "none" : mark, revision: seen.revision });
        if (seen === this.store.recording) seen.revision = changed.revision; // nothing else of it has changed: nothing is drawn anew
        this.store.set({ recordings: this.store.recordings.map((each) => (each.id === recordingId ? changed : each)) });
        this.succeed();
      } catch (error) {
        if (error instanceof Refused && error.status === 409) await this.reportConflict(recordingId, null, TEXT.marks[mark], () => this.mark(mark));
        else this.refuse(error);
      }
    });
  }

  async keepPronunciation(word, phones, { revision }) {
    try {
      await this.server.post("lexicon", { word, phones, revision });
      this.say(fill(TEXT.kept, { word, phones: phones.join(" ") }));
    } catch (error) {
      this.refuse(error);
    }
  }

  async add(dropped) {
    try {
      const first = await addFiles(dropped, this), { message } = this.store;
      await this.reloadList();
      const opened = first && this.open(first.id);
      this.store.set({ message }); // what was not added is shown with the new recording, too
      await opened;
    } catch (error) {
      this.refuse(error);
    }
  }

  /** Ask for something that a recording may be open after. */
  async tryAgain(id, path, content) {
    try {
      await this.server.post(path, content);
      await this.reloadList();
      await this.open(id, true);
    } catch (error) {
      this.refuse(error);
    }
  }

  help() { showKeys(); }

  /** What covers the face and the timeline while there is nothing to show there. */
  coverUp() {
    const { project, recordings, recording, recordingId, progress } = this.store, { cover } = this;
    const listed = recordings.find(({ id }) => id === recordingId), status = recording?.status ?? listed?.status;
    cover.hidden = !project || Boolean(recordings.length && (status === "ready" || !status));
    if (cover.hidden) return;
    if (!recordings.length) {
      cover.replaceChildren(icon("plus"), make("h2", { textContent: TEXT.empty }), make("p", { textContent: TEXT.emptyHint }),
        textButton(TEXT.open, () => document.getElementById("open").click(), { className: "main" }));
    } else if (status === "failed") {
      cover.replaceChildren(make("h2", { textContent: TEXT.failed }), make("p", { className: "bad", textContent: recording?.error ?? listed?.error ?? "" }),
        textButton(TEXT.tryAgain, () => this.tryAgain(recordingId, "understand", { lines: [recordingId] })),
        ...(recording?.restorable ? [textButton(TEXT.restore, () => this.tryAgain(recordingId, `lines/${recordingId}/restore`, { revision: recording.revision }), { id: "restore" })] : []));
    } else {
      const work = progress ?? recording?.progress ?? {};
      cover.replaceChildren(make("h2", { textContent: work.stage ? fill(TEXT.working, { what: work.stage }) : TEXT.waiting }),
        make("progress", { value: work.share ?? 0, max: 1, "aria-label": TEXT.states.working }));
    }
  }
}

const studio = new Studio();
Object.assign(globalThis, { studio }); // for the console, and for tests
studio.start();
