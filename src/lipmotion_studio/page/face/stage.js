// The place of the face: a character in WebGL, or pictures of a drawn face, or a video of a span.

import { choice, make, onDrag, replaced, textButton } from "../dom.js";
import { TEXT, fill } from "../strings.js";
import { Film } from "./film.js";
import { Head } from "./head.js";
import { Recorded } from "./recorded.js";

export class Stage {
  /**
   * @param {HTMLElement} place
   * @param {import("../studio.js").Studio} studio
   */
  constructor(place, studio) {
    this.studio = studio;
    this.store = studio.store;
    /** @type {Head | null} */ this.head = null;
    this.isWebgl = true;
    this.loaded = ""; // name of the character in WebGL
    this.asked = false; // a picture is on its way
    this.wanted = false; // and another one is wanted
    this.solid = make("canvas", { className: "head", tabIndex: 0, role: "img", "aria-label": TEXT.faceLabel });
    this.ghost = make("canvas", { className: "ghost", hidden: true, "aria-hidden": "true" });
    this.drawn = make("canvas", { className: "drawn", width: 640, height: 640, hidden: true, role: "img", "aria-label": TEXT.faceLabel });
    this.note = make("p", { className: "note", hidden: true });
    this.views = make("div", { className: "views", role: "group", "aria-label": TEXT.show },
      ...Object.entries(TEXT.views).map(([name, text]) => textButton(text, () => this.head?.look(name))));
    this.faces = make("div", { className: "faces" });
    this.recorded = new Recorded(place, studio);
    place.append(this.solid, this.ghost, this.drawn);
    this.film = new Film(place, this);
    this.sides = make("div", { className: "sides", hidden: true });
    place.append(this.note, this.sides, make("div", { className: "over" }, this.views, this.faces, this.recorded.button, this.film.button));
    onDrag(this.solid, {
      start: (event) => { this.from = [event.clientX, event.clientY]; },
      move: (event) => {
        this.head?.turnBy(event.clientX - this.from[0], event.clientY - this.from[1]);
        this.from = [event.clientX, event.clientY];
      },
      end: () => {},
    });
    this.solid.addEventListener("wheel", (event) => {
      event.preventDefault();
      this.head?.nearer(Math.exp(event.deltaY / 600));
    }, { passive: false });
    this.solid.addEventListener("keydown", (event) => {
      if (event.ctrlKey || event.altKey || event.shiftKey || !this.head?.press(event.key)) return;
      event.preventDefault();
      event.stopPropagation();
    });
    new ResizeObserver(() => this.head?.draw()).observe(this.solid);
    this.store.on(["project", "face"], () => this.offer());
    this.store.on(["face", "project", "mesh"], () => this.change());
    this.store.on(["weights", "time_s", "recording", "other", "comparing", "heads"], () => this.show());
  }

  get form() { return this.store.project?.forms.faces.find(({ name }) => name === this.store.face); }

  get isSolid() { return Boolean(this.form?.mesh) && this.isWebgl; }

  offer() {
    const faces = this.store.project?.forms.faces ?? [];
    this.faces.replaceChildren(choice(faces.map(({ name, title }) => [name, title ?? name]), this.store.face,
      (face) => this.store.set({ face, mesh: "" }), { "aria-label": TEXT.face, id: "face" }));
  }

  async change() {
    if (!this.store.project) return;
    if (this.isSolid && this.head === null) {
      try {
        this.head = new Head(this.solid, this.ghost);
      } catch {
        this.isWebgl = false;
        this.say(TEXT.noWebgl);
        const other = this.store.project.forms.faces.find(({ mesh }) => !mesh);
        if (other) this.store.set({ face: other.name, mesh: "" });
      }
    }
    this.solid.hidden = this.views.hidden = !this.isSolid;
    this.drawn.hidden = this.isSolid || Boolean(this.form?.filmed);
    const mesh = this.store.mesh || this.store.face;
    if (this.isSolid && this.loaded !== mesh) {
      this.loaded = mesh;
      try {
        await this.head.load(await this.studio.server.bytes(`faces/${encodeURIComponent(mesh)}.glb`));
        this.say("");
      } catch (error) {
        this.say(fill(TEXT.noFace, { reason: error.message }));
      }
    }
    this.show();
    this.loadedFor ??= this.store.face;
    if (this.isSolid && this.loadedFor !== this.store.face) {
      this.loadedFor = this.store.face;
      this.store.set({ weights: null });
      this.studio.weights.change(null);
    }
  }

  say(text) {
    this.note.textContent = text;
    this.note.hidden = !text;
  }

  show() {
    const { weights, other, comparing, heads, time_s, recording } = this.store;
    this.sides.hidden = !(this.isSolid && heads === "sides" && other?.weights);
    if (!this.sides.hidden) replaced(this.sides, ...[TEXT.now, other.name].map((textContent) => make("div", {}, make("span", { textContent }))));
    if (this.isSolid && this.head) {
      if (weights && !this.studio.weights.known(time_s)) return; // the pose before stays until it is known
      this.head.pose(comparing && other?.weights ? other.weights : weights, time_s, heads === "one" ? null : other?.weights, heads === "over");
      this.studio.measureDelay();
    } else if (recording && !this.drawn.hidden) this.picture();
  }

  /** Draw the picture of the time; while one is on its way, only the newest other one is asked for. */
  async picture() {
    if (this.asked) { this.wanted = true; return; }
    this.asked = true;
    const { recordingId, time_s, face, other, comparing } = this.store, by = comparing && other ? other.by : "";
    try {
      const picture = await this.studio.server.picture(`lines/${recordingId}/picture?time=${time_s.toFixed(3)}&face=${encodeURIComponent(face)}&by=${by}`);
      this.drawn.width = picture.width;
      this.drawn.height = picture.height;
      this.drawn.getContext("2d").drawImage(picture, 0, 0);
      this.say("");
      this.studio.measureDelay();
    } catch (error) {
      this.say(fill(TEXT.noFace, { reason: error.message }));
    }
    this.asked = false;
    if (this.wanted) {
      this.wanted = false;
      this.picture();
    }
  }
}
