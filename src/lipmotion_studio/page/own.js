// One's own voice and face: what they are made of, how far the work is, and what came of it.

import { choice, labelled, make, replaced, textButton } from "./dom.js";
import { dialog } from "./dialogs.js";
import { OWN, TEXT, fill } from "./strings.js";

const FOLDER = "folder", LINES = "lines", MINUTE_S = 60;
const percent = (share) => `${Math.round(100 * share)} %`;
const figure = (value) => (value === null || value === undefined ? "–" : value.toFixed(2));
const left = (left_s) => (left_s === null ? "" : left_s === 0 ? OWN.leftLonger : left_s < MINUTE_S ? fill(OWN.leftSeconds, { count: left_s })
  : fill(OWN.leftMinutes, { count: Math.round(left_s / MINUTE_S) }));
const paragraph = (textContent, more = {}) => make("p", { textContent, ...more });

/**
 * The button of the page's head: it says how far the work is.
 * @param {any} button
 * @param {import("./studio.js").Studio} studio
 */
export function followOwn(button, studio) {
  studio.store.on(["training"], () => {
    const { state, share } = studio.store.training ?? {}, text = state === "working" ? fill(OWN.openWorking, { share: percent(share) }) : OWN.open;
    button.title = text;
    button.setAttribute("aria-label", text);
    button.querySelector("span").textContent = text;
  });
}

/** @param {import("./studio.js").Studio} studio */
export function showOwn(studio) { new Own(studio).show(); }

class Own {
  constructor(studio) {
    this.studio = studio;
    this.training = null; // what the server replied last
    this.source = null; // what is learned from: the folder, or recordings
    this.chosen = null; // numbers of recordings that are ticked; null: all
    this.state = "";
    this.job = make("section", { id: "own-job" });
    this.status = make("p", { role: "status", className: "hint" });
    this.form = make("section", { id: "own-form" });
    this.used = make("section", { id: "own-used" });
  }

  async show() {
    this.shown = dialog(OWN.title, paragraph(OWN.about, { className: "hint" }), this.job, this.status, this.form, this.used);
    this.shown.classList.add("own");
    this.studio.store.on(["training", "recordings"], () => { if (this.shown.isConnected) this.follow(); });
    await this.read();
  }

  /** Take over how far the work is; read all again where it began or ended, or where there are other recordings. */
  follow() {
    const now = this.studio.store.training, { recordings } = this.studio.store;
    if (!this.training) return undefined;
    if ((now.state ?? "") !== this.state || recordings.length !== this.recordings) return this.read();
    if (this.training.job) this.training.job = { ...this.training.job, ...now };
    return this.showProgress();
  }

  async read() { await this.ask(() => this.studio.server.read("training")); }

  /** Ask the server for something, and show what it says. */
  async ask(act) {
    this.recordings = this.studio.store.recordings.length;
    try {
      this.training = await act();
      this.status.textContent = "";
      this.status.className = "hint";
    } catch (error) {
      this.status.textContent = error.message;
      this.status.className = "bad";
      if (error.status !== 409) return;
      this.training = await this.studio.server.read("training"); // another window was first
    }
    this.state = this.training.job?.state ?? "";
    this.studio.wake();
    this.showJob();
    this.showForm();
    this.showUsed();
  }

  send(path, content = {}) { return this.ask(() => this.studio.server.post(path, content)); }

  showJob() {
    const { job } = this.training;
    if (!job) return replaced(this.job);
    const title = make("h3", { textContent: fill(OWN.states[job.state], { what: OWN.kinds[job.kind], name: job.name }) });
    if (job.state === "working") {
      this.bar = make("progress", { max: 1, "aria-label": OWN.progress });
      this.stage = make("p", { className: "hint" });
      replaced(this.job, title, this.bar, this.stage,
        make("div", { className: "row" }, textButton(OWN.stop, () => this.send("training/stop"), { id: "own-stop" })), this.noted = make("div"));
      this.notedCount = 0;
      return this.showProgress();
    }
    const again = textButton(OWN.again, () => this.send("training/again"), { id: "own-again", className: "main" });
    return replaced(this.job, title, job.error ? paragraph(job.error, { className: "warning" }) : null,
      ...(job.report ? this.report(job) : [make("div", { className: "row" }, again)]), ...this.notes(job));
  }

  showProgress() {
    const { job } = this.training;
    if (job?.state !== "working" || !this.bar) return;
    this.bar.value = job.share;
    this.stage.textContent = [percent(job.share), job.stage, left(job.left_s)].filter(Boolean).join(" · ");
    const count = job.skipped.length + job.warnings.length;
    if (count === this.notedCount) return;
    this.notedCount = count;
    replaced(this.noted, ...this.notes(job));
  }

  /** What was warned of, and which recordings are not used. */
  notes(job) {
    const notes = [...job.skipped.map(({ name, reason }) => fill(OWN.skipped, { name, reason })), ...job.warnings];
    if (!notes.length) return [];
    return [make("details", { open: notes.length < 4 }, make("summary", { textContent: fill(OWN.notes, { count: notes.length }) }),
      ...notes.map((text) => paragraph(text, { className: "warning" })))];
  }

  report({ kind, report, file, name }) {
    const rows = kind === "voice"
      ? [[OWN.facts.learned, fill(OWN.learned, report)], [OWN.facts.kept, String(report.kept_back)], [OWN.facts.skipped, String(report.skipped)]]
      : Object.entries(report.facts).filter(([, value]) => value);
    const facts = make("dl", {}, ...[...rows, [OWN.facts.file, file]].flatMap(([label, value]) => [make("dt", { textContent: label }), make("dd", { textContent: value })]));
    if (kind !== "voice") return [facts, make("div", { className: "row" }, textButton(OWN.show, () => this.showFace(name), { id: "own-show", className: "main" }))];
    const used = this.training.voices.some((voice) => voice.used && voice.name === name);
    const figures = report.figures ? make("table", {},
      make("thead", {}, make("tr", {}, ...OWN.columns.map((textContent) => make("th", { scope: "col", textContent })))),
      make("tbody", {}, ...report.figures.map(({ condition, opening, acc }) => make("tr", {},
        make("th", { scope: "row", textContent: OWN.conditions[condition] ?? condition }), make("td", { textContent: figure(opening) }), make("td", { textContent: figure(acc) })))))
      : paragraph(OWN.unmeasured, { className: "hint" });
    return [facts, figures,
      report.table ? make("details", {}, make("summary", { textContent: OWN.inFull }), make("pre", { tabIndex: 0, textContent: report.table })) : null,
      make("div", { className: "row" }, textButton(used ? OWN.isUsed : OWN.use, () => this.use(name), { id: "own-use", className: "main", disabled: used }))];
  }

  async showFace(face) {
    await this.studio.reloadList();
    this.studio.store.set({ face, mesh: "" });
    this.shown.close();
  }

  async use(voice) {
    await this.send("voice", { voice, revision: this.training.revision });
    const { recordingId } = this.studio.store;
    await this.studio.reloadList();
    if (recordingId) await this.studio.open(recordingId, true);
  }

  showForm() {
    const { videos, count, recordings, options, kinds, job } = this.training, working = job?.state === "working";
    if (!videos.length && !recordings) return replaced(this.form, make("h3", { textContent: OWN.newOne }), paragraph(OWN.noRecordings, { className: "hint" }), this.adding());
    if (!this.source || (this.source === LINES && !videos.length)) this.source = recordings ? FOLDER : LINES;
    const sources = [...(recordings ? [[FOLDER, fill(OWN.folder, { name: recordings })]] : []), ...(videos.length ? [[LINES, OWN.videos]] : [])];
    const ticks = videos.map(({ id, name }) => make("label", { className: "tick" },
      make("input", { type: "checkbox", value: id, checked: !this.chosen || this.chosen.has(id), onchange: () => { this.chosen = new Set(ticked()); } }), name));
    const ticked = () => ticks.map(({ firstChild }) => firstChild).filter(({ checked }) => checked).map(({ value }) => Number(value));
    const list = make("div", { className: "ticks", role: "group", tabIndex: 0, "aria-label": OWN.videos, hidden: this.source !== LINES }, ...ticks,
      count > videos.length ? paragraph(fill(OWN.more, { count: count - videos.length }), { className: "hint" }) : "");
    const name = make("input", { id: "own-name", value: this.name ?? "", maxLength: 60, placeholder: OWN.namePlaceholder, oninput: () => { this.name = name.value; } });
    const fields = options.map((option) => [option, this.field(option)]);
    const begin = (kind) => textButton(OWN.begin[kind], () => {
      const lines = this.source === LINES ? ticked() : [];
      if (this.source === LINES && !lines.length) { this.status.textContent = OWN.noneTicked; this.status.className = "bad"; return undefined; }
      const given = Object.fromEntries(fields.map(([option, field]) => [option.name, option.kind === "bool" ? field.checked : field.value]));
      return this.send("training", { kind, name: name.value, lines, options: kind === "voice" ? given : {} });
    }, { id: `own-${kind}`, className: "main", disabled: working });
    return replaced(this.form, make("h3", { textContent: OWN.newOne }),
      make("div", { className: "row" }, labelled(OWN.name, name), labelled(OWN.source, choice(sources, this.source, (source) => {
        this.source = source;
        list.hidden = source !== LINES;
      }, { id: "own-source" }))), list, this.adding(),
      make("details", {}, make("summary", { textContent: OWN.optionsTitle }), ...fields.map(([option, field]) => (option.kind === "bool"
        ? make("label", { className: "tick" }, field, OWN.options[option.name] ?? option.name) : labelled(OWN.options[option.name] ?? option.name, field)))),
      make("div", { className: "row" }, ...kinds.map(begin)));
  }

  adding() { return make("div", { className: "row" }, textButton(OWN.add, () => document.getElementById("open").click(), { id: "own-add" })); }

  field({ name, kind, usual, choices }) {
    if (kind === "bool") return make("input", { type: "checkbox", id: `own-${name}`, checked: usual });
    return choices.length ? choice(choices.map((each) => [each, OWN.engines[each] ?? each]), usual, () => {}, { id: `own-${name}` }) : make("input", { id: `own-${name}`, value: usual });
  }

  showUsed() {
    const { voices, faces } = this.training, used = voices.find((voice) => voice.used)?.name ?? "";
    replaced(this.used, make("h3", { textContent: OWN.usedTitle }),
      labelled(OWN.voice, choice(voices.map(({ name }) => [name, name || OWN.shipped]), used, (name) => this.use(name), { id: "own-choice" })),
      paragraph(OWN.usedHint, { className: "hint" }), faces.length ? paragraph(fill(OWN.faces, { files: faces.join(", ") }), { className: "hint" }) : null);
  }
}
