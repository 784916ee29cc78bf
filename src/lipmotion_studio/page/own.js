// One's own voice and face: what they are made of, how far the work is, and what came of it.

import { choice, labelled, made, replaced, textButton } from "./dom.js";
import { dialog } from "./dialogs.js";
import { OWN, TEXT, filled } from "./strings.js";

const FOLDER = "folder", LINES = "lines", MINUTE_S = 60;
const percent = (share) => `${Math.round(100 * share)} %`;
const figure = (value) => (value === null || value === undefined ? "–" : value.toFixed(2));
const left = (left_s) => (left_s === null ? "" : left_s === 0 ? OWN.leftLonger : left_s < MINUTE_S ? filled(OWN.leftSeconds, { count: left_s })
  : filled(OWN.leftMinutes, { count: Math.round(left_s / MINUTE_S) }));
const paragraph = (textContent, more = {}) => made("p", { textContent, ...more });

/**
 * The button of the page's head: it says how far the work is.
 * @param {any} button
 * @param {import("./studio.js").Studio} studio
 */
export function followOwn(button, studio) {
  studio.store.on(["training"], () => {
    const { state, share } = studio.store.training ?? {}, text = state === "working" ? filled(OWN.openWorking, { share: percent(share) }) : OWN.open;
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
    this.told = null; // what the server said last
    this.source = null; // what is learned from: the folder, or lines
    this.chosen = null; // numbers of lines that are ticked; null: all
    this.state = "";
    this.job = made("section", { id: "own-job" });
    this.status = made("p", { role: "status", className: "hint" });
    this.form = made("section", { id: "own-form" });
    this.used = made("section", { id: "own-used" });
  }

  async show() {
    this.shown = dialog(OWN.title, paragraph(OWN.about, { className: "hint" }), this.job, this.status, this.form, this.used);
    this.shown.classList.add("own");
    this.studio.store.on(["training", "lines"], () => { if (this.shown.isConnected) this.follow(); });
    await this.read();
  }

  /** Take over how far the work is; read all again where it began or ended, or where there are other lines. */
  follow() {
    const now = this.studio.store.training, { lines } = this.studio.store;
    if (!this.told) return undefined;
    if ((now.state ?? "") !== this.state || lines.length !== this.lines) return this.read();
    if (this.told.job) this.told.job = { ...this.told.job, ...now };
    return this.showProgress();
  }

  async read() { await this.ask(() => this.studio.server.read("training")); }

  /** Ask the server for something, and show what it says. */
  async ask(act) {
    this.lines = this.studio.store.lines.length;
    try {
      this.told = await act();
      this.status.textContent = "";
      this.status.className = "hint";
    } catch (error) {
      this.status.textContent = error.message;
      this.status.className = "bad";
      if (error.status !== 409) return;
      this.told = await this.studio.server.read("training"); // another window was first
    }
    this.state = this.told.job?.state ?? "";
    this.studio.wake();
    this.showJob();
    this.showForm();
    this.showUsed();
  }

  send(path, content = {}) { return this.ask(() => this.studio.server.told(path, content)); }

  showJob() {
    const { job, damage, restorable } = this.told;
    if (damage) {
      return replaced(this.job, paragraph(damage, { className: "warning" }),
        restorable ? textButton(TEXT.restore, () => this.send("training/restore"), { id: "own-restore" }) : null);
    }
    if (!job) return replaced(this.job);
    const title = made("h3", { textContent: filled(OWN.states[job.state], { what: OWN.kinds[job.kind], name: job.name }) });
    if (job.state === "working") {
      this.bar = made("progress", { max: 1, "aria-label": OWN.progress });
      this.stage = made("p", { className: "hint" });
      replaced(this.job, title, this.bar, this.stage,
        made("div", { className: "row" }, textButton(OWN.stop, () => this.send("training/stop"), { id: "own-stop" })), this.noted = made("div"), ...this.earlier());
      this.notedCount = 0;
      return this.showProgress();
    }
    const again = textButton(OWN.again, () => this.send("training/again"), { id: "own-again", className: "main" });
    return replaced(this.job, title, job.error ? paragraph(job.error, { className: "warning" }) : null,
      ...(job.report ? this.report(job) : [made("div", { className: "row" }, again)]), ...this.notes(job), ...this.earlier());
  }

  /** What was made before, and its report. */
  earlier() {
    return this.told.earlier.map((job) => made("details", {}, made("summary", { textContent: filled(OWN.states.done, { what: OWN.kinds[job.kind], name: job.name }) }),
      ...this.report(job).filter(Boolean), ...this.notes(job)));
  }

  showProgress() {
    const { job } = this.told;
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
    const told = [...job.skipped.map(({ name, reason }) => filled(OWN.skipped, { name, reason })), ...job.warnings];
    if (!told.length) return [];
    return [made("details", { open: told.length < 4 }, made("summary", { textContent: filled(OWN.notes, { count: told.length }) }),
      ...told.map((text) => paragraph(text, { className: "warning" })))];
  }

  report({ kind, report, file, name }) {
    const rows = kind === "voice"
      ? [[OWN.facts.learned, filled(OWN.learned, report)], [OWN.facts.kept, String(report.kept_back)], [OWN.facts.skipped, String(report.skipped)]]
      : Object.entries(report.facts).filter(([, value]) => value);
    const facts = made("dl", {}, ...[...rows, [OWN.facts.file, file]].flatMap(([label, value]) => [made("dt", { textContent: label }), made("dd", { textContent: value })]));
    if (kind !== "voice") return [facts, made("div", { className: "row" }, textButton(OWN.show, () => this.showFace(name), { id: "own-show", className: "main" }))];
    const used = this.told.voices.some((voice) => voice.used && voice.name === name);
    const figures = report.figures ? made("table", {},
      made("thead", {}, made("tr", {}, ...OWN.columns.map((textContent) => made("th", { scope: "col", textContent })))),
      made("tbody", {}, ...report.figures.map(({ condition, opening, acc }) => made("tr", {},
        made("th", { scope: "row", textContent: OWN.conditions[condition] ?? condition }), made("td", { textContent: figure(opening) }), made("td", { textContent: figure(acc) })))))
      : paragraph(OWN.unmeasured, { className: "hint" });
    return [facts, figures,
      report.table ? made("details", {}, made("summary", { textContent: OWN.inFull }), made("pre", { tabIndex: 0, textContent: report.table })) : null,
      made("div", { className: "row" }, textButton(used ? OWN.isUsed : OWN.use, () => this.use(name), { id: "own-use", className: "main", disabled: used }))];
  }

  async showFace(face) {
    await this.studio.listed();
    this.studio.store.set({ face, mesh: "" });
    this.shown.close();
  }

  async use(voice) {
    await this.send("voice", { voice, revision: this.told.revision });
    const { lineId } = this.studio.store;
    await this.studio.listed();
    if (lineId) await this.studio.open(lineId, true);
  }

  showForm() {
    const { videos, count, recordings, options, kinds, job } = this.told, working = job?.state === "working";
    if (!videos.length && !recordings) return replaced(this.form, made("h3", { textContent: OWN.newOne }), paragraph(OWN.noRecordings, { className: "hint" }), this.adding());
    if (!this.source || (this.source === LINES && !videos.length)) this.source = recordings ? FOLDER : LINES;
    const sources = [...(recordings ? [[FOLDER, filled(OWN.folder, { name: recordings })]] : []), ...(videos.length ? [[LINES, OWN.lines]] : [])];
    const ticks = videos.map(({ id, name }) => made("label", { className: "tick" },
      made("input", { type: "checkbox", value: id, checked: !this.chosen || this.chosen.has(id), onchange: () => { this.chosen = new Set(ticked()); } }), name));
    const ticked = () => ticks.map(({ firstChild }) => firstChild).filter(({ checked }) => checked).map(({ value }) => Number(value));
    const list = made("div", { className: "ticks", role: "group", tabIndex: 0, "aria-label": OWN.lines, hidden: this.source !== LINES }, ...ticks,
      count > videos.length ? paragraph(filled(OWN.more, { count: count - videos.length }), { className: "hint" }) : "");
    const name = made("input", { id: "own-name", value: this.name ?? "", maxLength: 60, placeholder: OWN.namePlaceholder, oninput: () => { this.name = name.value; } });
    const fields = options.map((option) => [option, this.field(option)]);
    const begin = (kind) => textButton(OWN.begin[kind], () => {
      const lines = this.source === LINES ? ticked() : [];
      if (this.source === LINES && !lines.length) { this.status.textContent = OWN.noneTicked; this.status.className = "bad"; return undefined; }
      const given = Object.fromEntries(fields.map(([option, field]) => [option.name, option.kind === "bool" ? field.checked : field.value]));
      return this.send("training", { kind, name: name.value, lines, options: kind === "voice" ? given : {} });
    }, { id: `own-${kind}`, className: "main", disabled: working });
    return replaced(this.form, made("h3", { textContent: OWN.newOne }),
      made("div", { className: "row" }, labelled(OWN.name, name), labelled(OWN.source, choice(sources, this.source, (source) => {
        this.source = source;
        list.hidden = source !== LINES;
      }, { id: "own-source" }))), list, this.adding(),
      made("details", {}, made("summary", { textContent: OWN.optionsTitle }), ...fields.map(([option, field]) => (option.kind === "bool"
        ? made("label", { className: "tick" }, field, OWN.options[option.name] ?? option.name) : labelled(OWN.options[option.name] ?? option.name, field)))),
      made("div", { className: "row" }, ...kinds.map(begin)));
  }

  adding() { return made("div", { className: "row" }, textButton(OWN.add, () => document.getElementById("open").click(), { id: "own-add" })); }

  field({ name, kind, usual, choices }) {
    if (kind === "bool") return made("input", { type: "checkbox", id: `own-${name}`, checked: usual });
    return choices.length ? choice(choices.map((each) => [each, OWN.engines[each] ?? each]), usual, () => {}, { id: `own-${name}` }) : made("input", { id: `own-${name}`, value: usual });
  }

  showUsed() {
    const { voices, faces } = this.told, used = voices.find((voice) => voice.used)?.name ?? "";
    replaced(this.used, made("h3", { textContent: OWN.usedTitle }),
      labelled(OWN.voice, choice(voices.map(({ name }) => [name, name || OWN.shipped]), used, (name) => this.use(name), { id: "own-choice" })),
      paragraph(OWN.usedHint, { className: "hint" }), faces.length ? paragraph(filled(OWN.faces, { files: faces.join(", ") }), { className: "hint" }) : null);
  }
}
