// Draws docs/images/for-web.png: moving.glb in three.js, in Chromium without a screen.
//
//     lipmotion animate examples/welcome.flac --transcript examples/welcome.txt -o moving.glb --rate 30
//     npm install three playwright-core        (in the folder from which this is run)
//     node scripts/page_web.mjs moving.glb docs/images/for-web.png
//
// CHROMIUM names the browser (default: /usr/bin/chromium).

import fs from "node:fs";
import http from "node:http";
import { createRequire } from "node:module";
import path from "node:path";

const { chromium } = createRequire(path.resolve("package.json"))("playwright-core");
const [character, picture] = process.argv.slice(2);
const TIMES_S = [0.62, 0.8, 1.37, 2.2], WIDTH = 300, HEIGHT = 340;
const PAGE = `<!doctype html><meta charset="utf-8"><body style="margin:0"><canvas width="${WIDTH * TIMES_S.length}" height="${HEIGHT}"></canvas>
<script type="importmap">{"imports": {"three": "/node_modules/three/build/three.module.js", "three/addons/": "/node_modules/three/examples/jsm/"}}</script>
<script type="module">
import * as THREE from "three";
import { GLTFLoader } from "three/addons/loaders/GLTFLoader.js";
const renderer = new THREE.WebGLRenderer({ canvas: document.querySelector("canvas"), antialias: true });
renderer.setScissorTest(true);
const scene = new THREE.Scene();
scene.background = new THREE.Color("#c8d3dd");
const { scene: head, animations } = await new GLTFLoader().loadAsync("/character.glb");
const sun = new THREE.DirectionalLight("#fff2e0", 2.2);
sun.position.set(-1, 1.2, 2);
scene.add(head, new THREE.HemisphereLight("#eef4ff", "#b08870", 2.2), sun);
const camera = new THREE.PerspectiveCamera(20, ${WIDTH / HEIGHT}, 0.01, 10);
camera.position.set(0.1, 0.05, 0.9);
camera.lookAt(0, 0.02, 0);
const mixer = new THREE.AnimationMixer(head);
mixer.clipAction(animations[0]).play();
requestAnimationFrame(() => {
  ${JSON.stringify(TIMES_S)}.forEach((time, number) => {
    mixer.setTime(time);
    renderer.setViewport(number * ${WIDTH}, 0, ${WIDTH}, ${HEIGHT});
    renderer.setScissor(number * ${WIDTH}, 0, ${WIDTH}, ${HEIGHT});
    renderer.render(scene, camera);
  });
  document.title = "drawn";
});
</script>`;
const KINDS = { ".js": "text/javascript", ".glb": "model/gltf-binary" };
const server = http.createServer((request, response) => {
  if (request.url === "/") return response.writeHead(200, { "content-type": "text/html" }).end(PAGE);
  const file = request.url === "/character.glb" ? character : `.${request.url}`;
  if (!fs.existsSync(file)) return response.writeHead(404).end();
  response.writeHead(200, { "content-type": KINDS[path.extname(file)] ?? "application/octet-stream" });
  fs.createReadStream(file).pipe(response);
}).listen(0);
const browser = await chromium.launch({
  executablePath: process.env.CHROMIUM ?? "/usr/bin/chromium",
  args: ["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--no-first-run", "--disable-background-networking"],
});
const page = await browser.newPage({ viewport: { width: WIDTH * TIMES_S.length, height: HEIGHT } });
page.on("pageerror", (error) => console.error(error.message));
await page.goto(`http://localhost:${server.address().port}/`);
await page.waitForFunction(() => document.title === "drawn", null, { timeout: 120_000 });
await page.screenshot({ path: picture });
await browser.close();
server.close();
