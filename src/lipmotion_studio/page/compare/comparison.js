// The other motion: a version that was kept, or that of the other model.

import { TEXT, fill } from "../strings.js";

/** What the server calls the model that the project's is compared with. */
export const OTHER = "other";

export class Comparison {
  /** @param {import("../studio.js").Studio} studio */
  constructor(studio) {
    this.studio = studio;
    this.store = studio.store;
    this.store.on(["recording", "face"], () => this.renew());
    this.store.on(["channels"], () => this.fill());
  }

  /** Keep the edits as they are, and compare with them from now on. */
  async keep() {
    if (!await this.studio.request("versions", {}, "")) return;
    const { recording } = this.store, version = recording?.versions?.find(({ digest }) => digest === recording.edits_digest);
    if (version) await this.with(version.name);
  }

  /** Keep a version no longer. */
  async forget(name) {
    if (this.store.other?.by === name) this.stop();
    await this.studio.request("versions/forget", { version: name }, "");
  }

  /** What a motion is called, by what the server calls it. */
  name(by) {
    const { recording, project } = this.store, version = recording.versions.find(({ name }) => name === by);
    return version ? fill(TEXT.versionNamed, version) : fill(TEXT.modelNamed, { name: project.forms.against });
  }

  /** Compare with a version, or with the motion that the other model makes of the same edits. */
  async with(by) {
    const { store, studio: { server, curves, curves: { names } } } = this, { recordingId, recording: { revision }, face } = store;
    const isMesh = store.project.forms.faces.find(({ name }) => name === face)?.mesh;
    try {
      const [motion, moved] = await Promise.all([curves.read(recordingId, "motion", names, null, by),
        isMesh && server.weights(`lines/${recordingId}/weights?by=${by}&face=${encodeURIComponent(face)}`)]);
      if (recordingId !== store.recordingId || face !== store.face) return;
      this.show({ by, revision, face, name: this.name(by), motion, names, weights: moved ? moved.weights : null });
      await this.fill();
    } catch (error) {
      this.studio.refuse(error);
    }
  }

  /** Read the other motion's curves that are shown by now and are not here. */
  async fill() {
    const { store, store: { other, recordingId }, studio, studio: { curves } } = this;
    if (!other || !store.recording || String(other.names) === String(curves.names)) return;
    const { names } = curves;
    try {
      const motion = await curves.completed(recordingId, "motion", other.motion, other.by);
      if (other === store.other) store.set({ other: { ...other, motion, names } });
      await this.fill();
    } catch (error) {
      studio.refuse(error);
    }
  }

  show(other) { this.store.set({ other, comparing: false, ...(other.by === this.store.other?.by ? {} : { heads: "one" }) }); }

  stop() { this.store.set({ other: null, comparing: false, heads: "one" }); }

  /** After an edit the other model moves the mouth by it, too; weights are of the face that is shown. */
  renew() {
    const { other, recording, face } = this.store;
    if (!other || recording?.status !== "ready") return;
    if (face !== other.face || (other.by === OTHER && recording.revision !== other.revision)) this.with(other.by);
  }

  /** Show both heads in a way, or, if they are, one. */
  toggle(heads) { this.store.set({ heads: this.store.heads === heads ? "one" : heads, comparing: false }); }
}
