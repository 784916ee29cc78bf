// The other motion: a version that was kept, or that of the other model; and blind comparisons with it.

import { Refused } from "../server.js";
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
    this.store.on(["playing", "time_s"], () => this.heard());
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

  show(other) { this.store.set({ other, comparing: false, ...(other.by === this.store.other?.by && this.store.blind === null ? {} : { blind: null, heads: "one" }) }); }

  stop() { this.store.set({ other: null, comparing: false, heads: "one", blind: null }); }

  /** After an edit the other model moves the mouth by it, too; weights are of the face that is shown. */
  renew() {
    const { other, recording, face } = this.store;
    if (!other || recording?.status !== "ready") return;
    if (face !== other.face || (other.by === OTHER && recording.revision !== other.revision)) this.with(other.by);
  }

  /** Show both heads in a way, or, if they are, one. */
  toggle(heads) { this.store.set({ heads: this.store.heads === heads ? "one" : heads, comparing: false }); }

  /** Play the two, one after the other, in an order that is not told. */
  blind() {
    const order = Math.random() < 0.5 ? [false, true] : [true, false], { duration_s } = this.studio.player;
    const span = this.store.span ?? { start_s: 0, end_s: duration_s };
    this.store.set({ heads: "one", blind: { order, span, place: 0, asked: false, result: "" } });
    this.play(0, false);
  }

  /** Play the first or the second one, 0 or 1. */
  play(place, alone = true) {
    const { blind } = this.store;
    this.store.set({ blind: { ...blind, place, asked: alone || blind.asked }, comparing: blind.order[place] });
    this.studio.player.seek(blind.span.start_s);
    this.studio.player.play();
  }

  /** The end of the first is followed by the second; then it is asked. */
  heard() {
    const { blind, playing, time_s } = this.store;
    if (!blind || blind.result || blind.asked || playing || time_s < blind.span.end_s - 0.02) return;
    if (blind.place === 0) this.play(1, false);
    else this.store.set({ blind: { ...blind, asked: true } });
  }

  /** Whether the other motion may be another one: it is that of the other model, or of other edits. */
  get differs() {
    const { other, recording } = this.store;
    return other?.by === OTHER || recording?.versions.find(({ name }) => name === other?.by)?.digest !== recording?.edits_digest;
  }

  /** Keep which was better: 0, 1, or null: neither; and tell what was what. */
  async vote(place) {
    const { blind, blind: { order }, other, recording, recordingId } = this.store, names = order.map((isOther) => (isOther ? other.name : TEXT.now));
    const shown = order.map((isOther) => ({ by: isOther ? other.by : "" }));
    try {
      const { better, neither } = await this.studio.server.post(`lines/${recordingId}/votes`, { shown, better: place, revision: recording.revision });
      this.studio.player.stop();
      const result = fill(TEXT.blindResult, { a: names[0], b: names[1], now: better[order.indexOf(false)], other: better[order.indexOf(true)], neither, name: other.name });
      this.store.set({ blind: { ...blind, result }, comparing: false });
      this.studio.say(result);
    } catch (error) {
      if (error instanceof Refused && error.status === 409) await this.studio.reportConflict(recordingId, error.state, TEXT.blind, null);
      else this.studio.refuse(error);
    }
  }
}
