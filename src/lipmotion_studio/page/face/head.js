// A character in WebGL, moved by the weights that files get.

import {
  AmbientLight, Box3, Color, DirectionalLight, GLTFLoader, HemisphereLight, PerspectiveCamera, Scene, Vector3, WebGLRenderer,
} from "../vendor/three/three.js";

/** Frames that come slower than this are drawn coarser while the face moves, and sharp when it rests. */
const SLOW_MS = 40, REST_MS = 200, COARSE = 0.5;
const TURN_PER_PX = 0.008, KEY_TURN = 0.12, FIELD_DEG = 22;
/** Turn, tilt, distance in heights of the face, and height of what is looked at (0 chin, 1 crown). */
const VIEWS = {
  front: [0, 0.04, 1.3, 0.58], turned: [0.6, 0.05, 1.3, 0.58], side: [1.45, 0.03, 1.3, 0.58], mouth: [0.12, 0.03, 0.56, 0.25],
};

export class Head {
  /**
   * @param {HTMLCanvasElement} canvas
   * @param {HTMLCanvasElement} ghost  lies over it, for the other of two heads
   * Throws where there is no WebGL.
   */
  constructor(canvas, ghost) {
    this.canvas = canvas;
    this.ghost = ghost;
    this.renderer = new WebGLRenderer({ canvas, antialias: true, alpha: true });
    this.scene = new Scene();
    this.camera = new PerspectiveCamera(FIELD_DEG, 1, 0.01, 100);
    this.character = null;
    this.meshes = [];
    this.shown_s = 0;
    this.drawn_ms = this.pace_ms = 0;
    const key = new DirectionalLight("#fff1e0", 2.1), rim = new DirectionalLight("#cfe0ff", 0.7);
    key.position.set(-1, 1.2, 2);
    rim.position.set(2, 0.5, -1);
    this.scene.add(new HemisphereLight("#eef4ff", "#b08870", 1.9), new AmbientLight(new Color("#fff"), 0.15), key, rim);
    [this.turn, this.tilt, this.distance, this.height] = VIEWS.front;
  }

  /** Show another character. `buffer`: a .glb. Throws where it cannot be read. */
  async load(buffer) {
    const { scene } = await new GLTFLoader().parseAsync(buffer, "");
    if (this.character) this.scene.remove(this.character);
    this.character = scene;
    this.meshes = [];
    scene.traverse((node) => {
      node.frustumCulled = false;
      if (node.morphTargetDictionary) this.meshes.push(node);
    });
    this.scene.add(scene);
    const box = new Box3();
    (this.meshes[0] ?? scene).updateWorldMatrix(true, true);
    for (const mesh of this.meshes.length ? this.meshes : [scene]) box.expandByObject(mesh, true);
    this.box = box;
    this.columns = this.turned = null;
    this.draw();
  }

  /**
   * Show weights at a time.
   * @param {import("../curves.js").Curves | null} weights
   * @param {import("../curves.js").Curves | null} other  is shown beside them, at the right
   * @param {boolean} over  is shown as a ghost over them instead
   */
  pose(weights, time_s, other = null, over = false) {
    const before = this.pair ?? this.ghostly;
    this.shown_s = time_s;
    this.pair = other && !over ? [weights, other] : null;
    this.ghostly = other && over ? [other, weights] : null;
    this.ghost.hidden = !this.ghostly;
    if (!this.character) return;
    const stood = String(this.numbers());
    this.move(weights, time_s);
    if (before || this.pair || this.ghostly || stood !== String(this.numbers())) this.draw();
  }

  /** Move the character. */
  move(weights, time_s) {
    if (weights?.names !== this.named) {
      this.named = weights?.names;
      this.columns = this.turned = null;
    }
    this.turned ??= this.turnedNodes(weights);
    this.columns ??= this.meshes.map((mesh) => Object.entries(mesh.morphTargetDictionary)
      .map(([name, place]) => [place, weights ? weights.column(name) : -1]).filter(([, column]) => column >= 0));
    this.meshes.forEach((mesh, n) => {
      if (!weights) mesh.morphTargetInfluences.fill(0);
      for (const [place, column] of this.columns[n]) mesh.morphTargetInfluences[place] = weights.at(time_s, column);
    });
    for (const [node, columns] of this.turned) node.quaternion.set(...columns.map((column) => weights.at(time_s, column))).normalize();
  }

  /** All that moves, as numbers. */
  numbers() { return [...this.meshes.flatMap((mesh) => mesh.morphTargetInfluences), ...(this.turned ?? []).flatMap(([node]) => node.quaternion.toArray())]; }

  /** Nodes that turn, with the columns of their quaternions: `head.rotation.x` to `.w`. */
  turnedNodes(weights) {
    const names = new Set((weights?.names ?? []).map((name) => /^(.+)\.rotation\.x$/.exec(name)?.[1]).filter(Boolean));
    return [...names].map((name) => [this.character.getObjectByName(name), ["x", "y", "z", "w"].map((axis) => weights.column(`${name}.rotation.${axis}`))])
      .filter(([node, columns]) => node && !columns.includes(-1));
  }

  look(view) {
    [this.turn, this.tilt, this.distance, this.height] = VIEWS[view];
    this.draw();
  }

  /** Turn the view by pixels of a pointer. */
  turnBy(x, y) {
    this.turn -= x * TURN_PER_PX;
    this.tilt = Math.min(Math.max(this.tilt + y * TURN_PER_PX, -1), 1);
    this.draw();
  }

  nearer(factor) {
    this.distance = Math.min(Math.max(this.distance * factor, 0.2), 4);
    this.draw();
  }

  /** Turn by an arrow key; return whether it was one. */
  press(key) {
    const turns = { ArrowLeft: [1, 0], ArrowRight: [-1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] };
    if (!turns[key]) return false;
    this.turnBy((turns[key][0] * KEY_TURN) / TURN_PER_PX, (turns[key][1] * KEY_TURN) / TURN_PER_PX);
    return true;
  }

  /** Share of the pixels' number across, by how fast pictures follow one another. */
  sharpness() {
    const now_ms = performance.now(), since_ms = now_ms - this.drawn_ms;
    this.drawn_ms = now_ms;
    clearTimeout(this.resting);
    if (since_ms > REST_MS) {
      this.pace_ms = 0;
      return 1;
    }
    this.pace_ms = 0.8 * this.pace_ms + 0.2 * since_ms;
    this.coarse = this.pace_ms > (this.coarse ? SLOW_MS / 2 : SLOW_MS);
    if (!this.coarse) return 1;
    this.resting = setTimeout(() => this.draw(), REST_MS + 50);
    return COARSE;
  }

  draw() {
    const { canvas, renderer, camera, box } = this, width = canvas.clientWidth, height = canvas.clientHeight;
    if (!box || !width || !height) return;
    const ratio = Math.min(devicePixelRatio, 2) * this.sharpness();
    if (canvas.width !== Math.floor(width * ratio) || canvas.height !== Math.floor(height * ratio)) {
      renderer.setPixelRatio(ratio);
      renderer.setSize(width, height, false);
    }
    const size = box.getSize(new Vector3()), middle = box.getCenter(new Vector3());
    middle.y = box.min.y + this.height * size.y;
    const part = width / (this.pair ? 2 : 1), across = Math.max(size.y, size.x / Math.min(part / height, 1)) * 1.12 * this.distance;
    const away = across / (2 * Math.tan((FIELD_DEG * Math.PI) / 360));
    camera.aspect = part / height;
    camera.updateProjectionMatrix();
    const near = Math.cos(this.tilt) * away;
    camera.position.set(middle.x + Math.sin(this.turn) * near, middle.y + Math.sin(this.tilt) * away, middle.z + Math.cos(this.turn) * near);
    camera.lookAt(middle);
    renderer.setScissorTest(Boolean(this.pair));
    if (this.ghostly) return this.drawGhost();
    (this.pair ?? [null]).forEach((weights, n) => {
      if (weights) this.move(weights, this.shown_s);
      renderer.setViewport(n * part, 0, part, height);
      renderer.setScissor(n * part, 0, part, height);
      renderer.render(this.scene, camera);
    });
  }

  /** Draw the other head on the ghost's canvas, which lies over this one, and then this one. */
  drawGhost() {
    const { canvas, ghost, renderer } = this, [other, weights] = this.ghostly;
    renderer.setViewport(0, 0, canvas.clientWidth, canvas.clientHeight);
    this.move(other, this.shown_s);
    renderer.render(this.scene, this.camera);
    ghost.width = canvas.width; // this clears it, too
    ghost.height = canvas.height;
    ghost.getContext("2d").drawImage(canvas, 0, 0);
    this.move(weights, this.shown_s);
    renderer.render(this.scene, this.camera);
  }
}
