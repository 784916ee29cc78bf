// Videos of a page: one plays at a time, each is counted when it has played to its end.

const loaded = new Map();

/** Load videos of the next page while this one is shown. */
export function loadAhead(addresses) {
  for (const address of loaded.keys()) if (!addresses.includes(address)) loaded.delete(address);
  for (const address of addresses) if (!loaded.has(address)) loaded.set(address, videoOf(address));
}

function videoOf(address) {
  const video = document.createElement("video");
  video.preload = "auto";
  video.playsInline = true;
  video.disablePictureInPicture = true;
  video.src = address;
  return video;
}

export class Players {
  /** Show the videos in an element; `changed` is called whenever one has played or cannot be played. */
  constructor(place, addresses, names, changed) {
    this.changed = changed;
    this.list = addresses.map((address, n) => this.make(address, names[n]));
    place.replaceChildren(...this.list.map((player) => player.figure));
    place.classList.toggle("single", addresses.length === 1);
  }

  get plays() { return this.list.map((player) => player.plays); }

  get allPlayed() { return this.list.every((player) => player.plays > 0); }

  get ready() {
    return Promise.all(this.list.map(({ video }) => video.readyState >= 4 || new Promise((done) => {
      video.addEventListener("canplaythrough", done, { once: true });
      video.addEventListener("error", done, { once: true });
    })));
  }

  make(address, name) {
    // The same video may be on a page twice: only one of them can be the one that was loaded ahead.
    const video = loaded.get(address) ?? videoOf(address);
    loaded.delete(address);
    const figure = document.createElement("figure");
    const caption = document.createElement("figcaption");
    const button = document.createElement("button");
    const played = document.createElement("span");
    const player = { figure, video, button, played, name, plays: 0, follow: false };
    video.setAttribute("aria-label", name);
    button.type = "button";
    played.className = "played";
    caption.append(button, played);
    figure.append(video, caption);
    button.addEventListener("click", () => (video.paused ? this.play(player) : this.stop(player)));
    video.addEventListener("click", () => this.play(player));
    video.addEventListener("ratechange", () => { if (video.playbackRate !== 1) video.playbackRate = 1; });
    video.addEventListener("ended", () => this.end(player));
    video.addEventListener("error", () => this.changed(`${name} cannot be loaded. Check your connection and load the page again.`));
    this.draw(player);
    return player;
  }

  /** Play what has not been played to its end; if all have, play all again. */
  playOn() {
    if (this.list.some(({ video }) => !video.paused)) return;
    const first = this.list.find((player) => player.plays === 0) ?? this.list[0];
    this.play(first, true);
  }

  async play(player, follow = false) {
    for (const other of this.list) if (other !== player) this.stop(other);
    player.follow = follow;
    player.video.currentTime = 0;
    try {
      await player.video.play();
    } catch (error) {
      if (error.name === "NotSupportedError") this.changed(`${player.name} cannot be played by this browser.`);
    }
    this.draw(player);
  }

  stop(player) {
    player.video.pause();
    player.follow = false;
    this.draw(player);
  }

  end(player) {
    player.plays += 1;
    this.draw(player);
    this.changed();
    const following = this.list[this.list.indexOf(player) + 1];
    if (player.follow && following) this.play(following, true);
  }

  draw({ figure, video, button, played, name, plays }) {
    const playing = !video.paused && !video.ended;
    figure.classList.toggle("playing", playing);
    button.textContent = playing ? "Stop" : plays ? "Play again" : "Play";
    button.setAttribute("aria-label", `${button.textContent}: ${name}`);
    played.textContent = plays ? `played ${plays === 1 ? "once" : `${plays} times`}` : "not played yet";
  }
}
