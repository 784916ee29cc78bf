// The page of `lipmotion live --to window`.

import { make, onDrag, textButton } from "../dom.js";
import { LiveFace } from "./live_face.js";

const TEXT = {
  title: "lipmotion live",
  face: "The face. Drag, or press arrow keys, to turn it.",
  start: "Start",
  sound: "Sound",
  loading: "The head is being made …",
  live: "Live",
  waiting: "Ready",
  lost: "No connection. It is tried again every second.",
  noWebgl: "This browser shows no 3D (WebGL), which the head needs.",
  noHead: "The head could not be loaded ({reason}). Load the page again.",
  delay: "Delay {ms} ms",
  frames: "{count} frames/s",
};

const canvas = make("canvas", { tabIndex: 0, role: "img", "aria-label": TEXT.face });
const state = make("p", { id: "state", role: "status", textContent: TEXT.loading });
const delay = make("span", { id: "delay" }), frames = make("span", { id: "frames" });
const sound = textButton(TEXT.sound, () => hear(!live.playback.isHeard), { id: "sound", "aria-pressed": "false" });
const start = textButton(TEXT.start, async () => {
  await hear(true);
  live.ready();
}, { id: "start", hidden: true });
document.body.append(
  make("header", {}, make("h1", { textContent: TEXT.title }), sound), make("main", {}, canvas, start), make("footer", {}, state, delay, frames));

/** Let sound be heard, or not; return whether it is. */
async function hear(isWanted) {
  const isHeard = await live.playback.listen(isWanted);
  sound.setAttribute("aria-pressed", String(isHeard));
  return isHeard;
}

function show() {
  const { isConnected, waits, delay_ms, frames_s } = live.state;
  state.textContent = isConnected ? (frames_s ? TEXT.live : TEXT.waiting) : TEXT.lost;
  state.classList.toggle("bad", !isConnected);
  delay.textContent = delay_ms === null ? "" : TEXT.delay.replace("{ms}", String(Math.round(delay_ms)));
  frames.textContent = TEXT.frames.replace("{count}", String(Math.round(frames_s)));
  if (!isConnected) tried = false; // the next stream may begin at once, too
  start.hidden = !waits || trying;
  if (waits && !tried) begin();
}

/** Begin at once where nobody must click first: browsers that allow sound, and a microphone, whose sound would come back. */
async function begin() {
  tried = trying = true;
  const mayBegin = live.state.isMicrophone || await hear(true);
  trying = false;
  if (mayBegin) live.ready();
  else show();
}

let live = null, tried = false, trying = false;
try {
  live = new LiveFace(canvas, location.host, show);
} catch {
  state.textContent = TEXT.noWebgl;
}
if (live) {
  globalThis.live = live; // for tests
  let from = [0, 0];
  onDrag(canvas, {
    start: (event) => { from = [event.clientX, event.clientY]; },
    move: (event) => {
      live.head.turnBy(event.clientX - from[0], event.clientY - from[1]);
      from = [event.clientX, event.clientY];
    },
    end: () => {},
  });
  canvas.addEventListener("keydown", (event) => { if (live.head.press(event.key)) event.preventDefault(); });
  live.begin().catch((error) => { state.textContent = TEXT.noHead.replace("{reason}", error.message); });
}
