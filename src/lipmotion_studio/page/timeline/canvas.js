// Canvases of the timeline.

/** Return the context of a canvas of `width` by `height` pixels of the page, cleared. */
export function cleared(canvas, width, height) {
  const ratio = Math.min(devicePixelRatio, 2), w = Math.round(width * ratio), h = Math.round(height * ratio);
  if (canvas.width !== w || canvas.height !== h) {
    canvas.width = w;
    canvas.height = h;
    canvas.style.height = `${height}px`;
    canvas.style.width = `${width}px`;
  }
  const pen = canvas.getContext("2d");
  pen.setTransform(ratio, 0, 0, ratio, 0, 0);
  pen.clearRect(0, 0, width, height);
  return pen;
}

let known = {};
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => { known = {}; });

/** The colours of the style sheet that is in force, each read once: to read one computes the styles of the page. */
export const colour = new Proxy({}, {
  get: (_, name) => (known[name] ||= getComputedStyle(document.documentElement).getPropertyValue(`--${String(name)}`).trim()),
});
