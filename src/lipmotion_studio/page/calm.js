// Work that takes the server long and can wait: it is done once nobody has touched the page for a while, or listened.

const CALM_MS = 3000, TOUCHES = ["keydown", "pointerdown", "pointermove", "wheel"];

export class WhenCalm {
  /**
   * @param {import("./store.js").Store} store
   * @param {() => void} act
   */
  constructor(store, act) {
    this.store = store;
    this.act = act;
    this.wanted = false;
    for (const kind of TOUCHES) addEventListener(kind, () => this.again(), { capture: true, passive: true });
    store.on(["playing"], () => this.again());
  }

  want() {
    this.wanted = true;
    this.again();
  }

  drop() {
    this.wanted = false;
    this.again();
  }

  again() {
    clearTimeout(this.timer);
    if (!this.wanted || this.store.playing) return;
    this.timer = setTimeout(() => {
      this.wanted = false;
      this.act();
    }, CALM_MS);
  }
}
