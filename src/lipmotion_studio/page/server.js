// Requests to the server of the studio. Every one carries the token of the page's address.

import { TEXT } from "./strings.js";
import { Curves } from "./curves.js";

const UNAVAILABLE = 503; // the recording is being analysed

/**
 * A refusal: `status` of HTTP, 0 where nothing answered; `state` of the recording, where the refusal has it; `isEarly`:
 * what was to be read is there once the recording has been analysed.
 */
export class Refused extends Error {
  constructor(status, message, state = null, isEarly = false) {
    super(message);
    this.status = status;
    this.state = state;
    this.isEarly = isEarly;
  }
}

export class Server {
  constructor(token) { [this.token, this.waiting] = [token, 0]; }

  /** Return the reply to a request; the page shows that it waits. Throws `Refused`. */
  async reply(path, request = {}) {
    let reply;
    document.body.classList.toggle("waiting", ++this.waiting);
    try {
      reply = await fetch(`/api/${path}`, { ...request, headers: { "x-lipmotion-token": this.token, ...request.headers } });
    } catch (error) {
      if (error.name === "AbortError") throw error;
      throw new Refused(0, TEXT.noReply);
    } finally {
      document.body.classList.toggle("waiting", --this.waiting);
    }
    if (reply.ok) return reply;
    const content = await reply.json().catch(() => ({}));
    throw new Refused(reply.status, content.error ?? `${reply.status} ${reply.statusText}`, content.state ?? null,
      reply.status === UNAVAILABLE && !request.method);
  }

  async read(path) { return (await this.reply(path)).json(); }

  async bytes(path) { return (await this.reply(path)).arrayBuffer(); }

  async picture(path) { return createImageBitmap(await (await this.reply(path)).blob()); }

  /** Send JSON, or bytes as they are. */
  async send(path, content = {}, more = {}) {
    const raw = content instanceof Blob;
    const headers = { "content-type": raw ? "application/octet-stream" : "application/json", ...more };
    return this.reply(path, { method: "POST", headers, body: raw ? content : JSON.stringify(content) });
  }

  async post(path, content, headers) { return (await this.send(path, content, headers)).json(); }

  /** Return curves: float32 frames by names, as the headers of the reply say. */
  async curves(path) { return curvesOf(await this.reply(path)); }

  /** Return weights, and the name of the mesh that they move. */
  async weights(path) {
    const reply = await this.reply(path);
    return { weights: await curvesOf(reply), mesh: decodeURIComponent(reply.headers.get("x-lipmotion-mesh") ?? "") };
  }
}

async function curvesOf(reply) {
  const names = JSON.parse(reply.headers.get("x-lipmotion-names") ?? "[]");
  const rate_hz = Number(reply.headers.get("x-lipmotion-rate"));
  const first = Number(reply.headers.get("x-lipmotion-first") ?? 0);
  return new Curves(names, rate_hz, new Float32Array(await reply.arrayBuffer()), first);
}
