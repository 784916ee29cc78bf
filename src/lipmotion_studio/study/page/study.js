// The page of a rater: consent, instructions, one trial after another. An answer is kept here until the server has
// confirmed that it is stored, also over a reload.

import { Players, loadAhead } from "/media.js";

const part = (id) => document.getElementById(id);
const PARTS = ["welcome", "guide", "trial", "thanks"];
const KEYS = {
  paired: "Keys: space plays the videos, 1 or ← chooses the first, 2 or → the second, Enter goes on.",
  mos: "Keys: space plays the video, 1 to 5 answer the scales one after another, Enter goes on.",
};
const ORDINALS = ["First video", "Second video"];
let study, place, players, startedAt;
let token = location.hash.slice(1);

const later = (seconds) => new Promise((done) => {
  const timer = setTimeout(done, 1000 * seconds);
  addEventListener("online", () => { clearTimeout(timer); done(); }, { once: true });
});

const made = (tag, properties = {}, ...children) => {
  const element = Object.assign(document.createElement(tag), properties);
  element.append(...children);
  return element;
};

function tell(text, warning = false) {
  part("status").textContent = text;
  part("status").classList.toggle("warning", warning);
}

function show(name) {
  performance.mark("interactive");
  for (const other of PARTS) part(other).hidden = other !== name;
  part(`${name}-heading`).focus({ preventScroll: true });
  scrollTo(0, 0);
}

/** Ask the server until it answers; of a refusal the reply is returned. */
async function ask(address, content) {
  const headers = token ? { authorization: `Bearer ${token}` } : {};
  if (content) headers["content-type"] = "application/json";
  const request = { method: content ? "POST" : "GET", headers, body: content && JSON.stringify(content) };
  for (let wait = 1; ; wait = Math.min(2 * wait, 15)) {
    try {
      const reply = await fetch(address, { ...request, signal: AbortSignal.timeout(15000) });
      if (reply.status < 500 && reply.status !== 429 && reply.status !== 408) {
        return { status: reply.status, ...(await reply.json()) };
      }
    } catch { /* no connection: try again */ }
    tell(`No reply from the study. Nothing is lost; trying again in ${wait} s.`, true);
    await later(wait);
  }
}

const kept = {
  get name() { return `unsent ${token}`; },
  read() { try { return JSON.parse(localStorage.getItem(this.name)); } catch { return null; } },
  write(answer) { try { localStorage.setItem(this.name, JSON.stringify(answer)); } catch { /* no storage */ } },
  clear() { try { localStorage.removeItem(this.name); } catch { /* no storage */ } },
};

async function send(answer) {
  kept.write(answer);
  tell("Storing your answer …");
  const reply = await ask("/api/answers", answer);
  kept.clear();
  tell("");
  if (reply.status === 200) return enter(reply);
  return resume();  // answered in another window, or not accepted: show what the server expects
}

async function resume() {
  const reply = await ask("/api/state");
  if (reply.status !== 200) {
    token = "";
    tell("This link is not known. Ask the researcher, or take part anew.", true);
    return show("welcome");
  }
  const unsent = kept.read();
  if (unsent && unsent.trial >= reply.trial) return send(unsent);
  tell("");
  return enter(reply);
}

function enter(next) {
  place = next;
  part("rater").textContent = `You are ${place.rater}`;
  part("number").textContent = place.rater;
  part("link").href = part("link").textContent = `${location.origin}/#${token}`;
  if (place.trial >= place.trials) return show("thanks");
  if (place.trial === 0 && !startedAt) { // the first video is loaded while the instructions are read
    loadAhead(place.videos);
    return show("guide");
  }
  return showTrial();
}

function showTrial() {
  const shown = place;
  part("trial-heading").textContent = shown.practice ? `Practice: ${study.asks}` : study.asks;
  part("progress").max = shown.trials;
  part("progress").value = shown.trial;
  part("progress").setAttribute("aria-label", `Pages done: ${shown.trial} of ${shown.trials}`);
  part("note").hidden = !shown.note;
  part("note").textContent = shown.note;
  const names = shown.videos.length === 1 ? ["Video"] : ORDINALS;
  players = new Players(part("videos"), shown.videos, names, changed);
  part("questions").replaceChildren(...QUESTIONS[study.kind](shown));
  startedAt = performance.now();
  show("trial");
  changed();
  players.ready.then(() => { if (place === shown) loadAhead(shown.ahead); });
}

function scale(title, asks, name, values, words, wide = false) {
  const choices = values.map((value, n) => made("label", {},
    made("input", { type: "radio", name, value }), made("span", { textContent: wide ? words[n] : value }),
    ...(wide ? [] : [made("small", { textContent: words[n] })])));
  const text = asks ? [made("p", { textContent: asks })] : [];
  return made("fieldset", {}, made("legend", { textContent: title }), ...text,
    made("div", { className: wide ? "choices wide" : "choices" }, ...choices));
}

const QUESTIONS = {
  paired: () => [scale("The lips match better in the", "", "value0", ["first", "second"], ORDINALS, true)],
  mos: (shown) => shown.scales.map(({ title, asks }, n) =>
    scale(title, asks, `value${n}`, shown.points.map((_, point) => String(point + 1)), shown.points)),
};

const groups = () => [...part("questions").querySelectorAll("fieldset")];
const values = () => groups().map((group) => group.querySelector(":checked")?.value);

function changed(problem) {
  const open = players.allPlayed;
  for (const input of part("questions").querySelectorAll("input")) input.disabled = !open;
  const done = open && values().every(Boolean);
  part("next").disabled = !done;
  const each = place.videos.length === 1 ? "the video" : "all videos";
  tell(problem ?? (done ? "Go on when you are ready." : open ? "You can answer now." : `Play ${each} to the end before you answer.`), Boolean(problem));
}

function submit(event) {
  event.preventDefault();
  if (part("next").disabled) return;
  part("next").disabled = true;
  for (const player of players.list) players.stop(player);
  send({ trial: place.trial, values: values(), plays: players.plays, seconds: (performance.now() - startedAt) / 1000 });
}

function choose(number) {
  const group = groups().find((each) => !each.querySelector(":checked")) ?? groups().at(-1);
  const input = group.querySelectorAll("input")[number - 1];
  if (!input || input.disabled) return false;
  input.click();
  input.focus();
  return true;
}

function key(event) {
  if (part("trial").hidden || event.ctrlKey || event.altKey || event.metaKey) return;
  const on = event.target.closest("button, input, a");
  const arrows = { ArrowLeft: 1, ArrowRight: 2 };
  let used = false;
  if (event.key === " " && on?.tagName !== "BUTTON" && on?.tagName !== "A") {
    players.playOn();
    used = true;
  } else if (/^[1-5]$/.test(event.key)) {
    used = choose(Number(event.key));
  } else if (event.key in arrows && study.kind === "paired" && !on) {
    used = choose(arrows[event.key]);
  } else if (event.key === "Enter" && (!on || on.tagName === "INPUT")) {
    part("answers").requestSubmit();
    used = true;
  }
  if (used) event.preventDefault();
}

function paragraphs(lines) {
  return lines.map((textContent) => made("p", { textContent }));
}

async function join() {
  part("agree").disabled = true;
  const reply = await ask("/api/raters", { agrees: true });
  part("agree").disabled = false;
  if (reply.status !== 201) return tell(`The study cannot let you in: ${reply.error}`, true);
  token = reply.token;
  history.replaceState(null, "", `#${token}`);
  tell("");
  return enter(reply);
}

async function begin() {
  study = await ask("/api/study");
  tell("");
  document.title = part("title").textContent = study.title;
  part("consent").replaceChildren(...paragraphs(study.consent));
  part("instructions").replaceChildren(...paragraphs(study.instructions));
  part("keys").textContent = KEYS[study.kind];
  part("agree").addEventListener("click", join);
  part("begin").addEventListener("click", showTrial);
  part("answers").addEventListener("submit", submit);
  part("questions").addEventListener("change", () => changed());
  document.addEventListener("keydown", key);
  return token ? resume() : show("welcome");
}

begin();
