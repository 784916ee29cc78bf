// A head on a canvas that speaks what `lipmotion live --to window` streams; also for pages of one's own.

import { Curves } from "../curves.js";
import { Head } from "../face/head.js";
import { Playback } from "./playback.js";

/** Names of the quaternion that turns the head. */
const TURN = ["x", "y", "z", "w"].map((axis) => `head.rotation.${axis}`);
const AGAIN_MS = 1000, COUNTED_MS = 1000;

export class LiveFace {
  /**
   * @param {HTMLCanvasElement} canvas
   * @param {string} host  of the server, with its port
   * @param {() => void} changed  is called when `state` has changed, and about once a second
   * Throws where there is no WebGL.
   */
  constructor(canvas, host, changed = () => {}) {
    this.head = new Head(canvas, document.createElement("canvas"));
    this.host = host;
    this.changed = changed;
    this.playback = new Playback();
    this.drawn_ms = []; // when pictures were drawn
    this.drawing = false;
    this.state = { isConnected: false, waits: false, isMicrophone: false, delay_ms: null, frames_s: 0 };
    this.draw = this.draw.bind(this);
    new ResizeObserver(() => this.head.draw()).observe(canvas);
  }

  /** Show the head, and connect: again and again where the connection is lost. */
  async begin() {
    const reply = await fetch(`//${this.host}/head.glb`);
    if (!reply.ok) throw new Error(`${reply.status} ${reply.statusText}`);
    await this.head.load(await reply.arrayBuffer());
    const names = [...new Set(this.head.meshes.flatMap((mesh) => Object.keys(mesh.morphTargetDictionary))), ...TURN];
    this.playback.rest = names.map((name) => Number(name === TURN.at(-1)));
    this.weights = new Curves(names, 50, Float32Array.from(this.playback.rest));
    this.connect();
  }

  connect() {
    this.socket = new WebSocket(`${location.protocol === "https:" ? "wss" : "ws"}://${this.host}/`);
    this.socket.binaryType = "arraybuffer";
    this.socket.onmessage = ({ data }) => (typeof data === "string" ? this.read(JSON.parse(data)) : this.hear(data));
    this.socket.onclose = () => {
      this.tell({ isConnected: false, waits: false });
      setTimeout(() => this.connect(), AGAIN_MS);
    };
  }

  read(message) {
    if (message.weights) {
      this.playback.take({ time_s: message.time_s, values: this.weights.names.map((name) => message.weights[name] ?? 0) });
      this.wake();
      return;
    }
    this.playback.begin(message);
    this.tell({ isConnected: true, waits: message.waits, isMicrophone: message.is_microphone });
  }

  hear(bytes) { this.playback.hear(new DataView(bytes).getFloat64(0, true), new Int16Array(bytes, 8)); }

  /** Say that the stream may begin. */
  ready() {
    this.socket.send("ready");
    this.tell({ waits: false });
  }

  tell(change) {
    Object.assign(this.state, change);
    this.changed();
  }

  wake() {
    if (this.drawing) return;
    this.drawing = true;
    this.drawn_ms = [];
    this.told_ms = performance.now();
    requestAnimationFrame(this.draw);
  }

  draw() {
    const now_ms = performance.now();
    this.drawing = this.playback.read(this.weights.values);
    this.head.pose(this.weights, 0);
    this.drawn_ms.push(now_ms);
    if (now_ms - this.told_ms > COUNTED_MS || !this.drawing) {
      const behind_s = this.drawing ? this.playback.behind_s : null, seconds = (now_ms - this.told_ms) / 1000;
      this.tell({ delay_ms: behind_s === null ? null : 1000 * behind_s, frames_s: this.drawing ? this.drawn_ms.length / seconds : 0 });
      this.drawn_ms = [];
      this.told_ms = now_ms;
    }
    if (this.drawing) requestAnimationFrame(this.draw);
  }
}
