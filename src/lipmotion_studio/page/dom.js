// Elements, made in code.

/**
 * Return a new element. Names with a dash, and `role`, are attributes; all others are properties.
 * @param {string} tag
 * @param {Record<string, any>} [properties]
 * @param {...(Node | string)} children
 * @returns {any}
 */
export function make(tag, properties = {}, ...children) {
  const element = document.createElement(tag);
  for (const [name, value] of Object.entries(properties)) {
    if (name.includes("-") || name === "role" || name === "list") element.setAttribute(name, String(value));
    else element[name] = value;
  }
  element.append(...children);
  return element;
}

const ICONS = {
  play: "M5 3l10 6-10 6z",
  pause: "M4 3h4v12H4zM10 3h4v12h-4z",
  loop: "M4 7h8V4l4 4-4 4V9H6v3H4zM14 13H6v3l-4-4 1.5-1.500M14 11v2",
  undo: "M7 3L3 7l4 4V8.200h4a2.600 2.600 0 010 5.200H7v1.800h4a4.400 4.400 0 000-8.800H7z",
  redo: "M11 3l4 4-4 4V8.200H7a2.600 2.600 0 000 5.200h4v1.800H7a4.400 4.400 0 010-8.800h4z",
  plus: "M8 3h2v5h5v2h-5v5H8v-5H3V8h5z",
  minus: "M3 8h12v2H3z",
  fit: "M2 4h1.600v10H2zM14.400 4H16v10h-1.600zM4.500 9L8 6v2.200h2V6l3.500 3L10 12V9.800H8V12z",
  select: "M5 2l9 8-4 .5 2.300 4.600-1.800.9-2.200-4.600L5 14z",
  draw: "M12.500 2.500l3 3-8.500 8.500-4 1 1-4zM11 4l3 3",
  lines: "M2 4h14v1.800H2zM2 8.100h14v1.800H2zM2 12.200h14V14H2z",
  check: "M3 9.500L4.500 8 7.500 11l6-6.500L15 6l-7.500 8z",
  again: "M9 3a6 6 0 105.800 7.500H13A4.300 4.300 0 119 4.700c1.200 0 2.200.5 3 1.200L10 8h5.500V2.500L13.200 4.700A6 6 0 009 3z",
  curve: "M2 12c3 0 3-8 7-8s4 8 7 8v-1.800c-2.500 0-3-8-7-8S4.500 10.200 2 10.200z",
  out: "M9 2l4.500 4.500-1.300 1.300L10 5.600V12H8V5.600L5.800 7.800 4.500 6.500zM2 11h1.800v3.200h10.400V11H16v5H2z",
  person: "M9 2a3.500 3.500 0 110 7 3.500 3.500 0 010-7zM2 16c0-4 3-6 7-6s7 2 7 6z",
  camera: "M2 5h9.500v8H2zM12.500 8.200L16 5.500v7L12.500 9.800z",
  remove: "M4.500 3.300L9 7.800l4.500-4.500 1.200 1.200L10.200 9l4.500 4.500-1.200 1.200L9 10.200l-4.500 4.500-1.200-1.200L7.800 9 3.300 4.500z",
  film: "M2 4h14v10H2zM4 6v1.500h1.500V6zm0 4.500V12h1.500v-1.500zM12.500 6v1.500H14V6zm0 4.500V12H14v-1.500z",
};

/** Return an icon, which says nothing by itself: its button has a name. */
export function icon(name) {
  const space = "http://www.w3.org/2000/svg";
  const picture = document.createElementNS(space, "svg");
  const path = document.createElementNS(space, "path");
  picture.setAttribute("viewBox", "0 0 18 18");
  picture.setAttribute("aria-hidden", "true");
  path.setAttribute("d", ICONS[name]);
  picture.append(path);
  return picture;
}

/** Return a button with an icon; its name is said, and shown when one points at it. */
export const iconButton = (name, title, onclick, properties = {}) => make(
  "button", { type: "button", className: "icon", title, "aria-label": title, onclick, ...properties }, icon(name));

/** Return a button with an icon and a text, which a narrow page leaves out. */
export const bothButton = (name, text, onclick, properties = {}) => make(
  "button", { type: "button", className: "both", title: text, "aria-label": text, onclick, ...properties }, icon(name), make("span", { textContent: text }));

/** Return a button with a text. */
export const textButton = (text, onclick, properties = {}) => make(
  "button", { type: "button", textContent: text, onclick, ...properties });

/** Return a field under its label. */
export function labelled(text, field, ...after) {
  return make("label", { className: "field" }, make("span", { textContent: text }), field, ...after);
}

/** Return a choice among values, by their shown texts. */
export function choice(values, chosen, onchange, properties = {}) {
  const select = make("select", { onchange: () => onchange(select.value), ...properties },
    ...values.map(([value, text]) => make("option", { value, textContent: text, selected: value === chosen })));
  return select;
}

/** Replace what is in a place; who types there goes on in the field of the same id. */
export function replaced(place, ...children) {
  const focused = place.contains(document.activeElement) ? document.activeElement : null;
  place.replaceChildren(...children.filter(Boolean));
  if (focused?.id) document.getElementById(focused.id)?.focus({ preventScroll: true });
}

/**
 * Follow a pointer from where it goes down to where it goes up; Escape gives up.
 * @param {any} element
 * @param {{start: (event: PointerEvent) => any, move: (event: PointerEvent) => void,
 *   end: (event: PointerEvent) => void, cancel?: () => void}} acts  start: false refuses
 */
export function onDrag(element, acts) {
  element.addEventListener("pointerdown", (down) => {
    if (down.button !== 0 || acts.start(down) === false) return;
    const over = new AbortController();
    const { signal } = over;
    const given = () => { over.abort(); acts.cancel?.(); };
    element.setPointerCapture?.(down.pointerId);
    element.addEventListener("pointermove", (event) => { if (event.pointerId === down.pointerId) acts.move(event); }, { signal });
    element.addEventListener("pointerup", (event) => {
      if (event.pointerId !== down.pointerId) return;
      over.abort();
      acts.end(event);
    }, { signal });
    element.addEventListener("pointercancel", given, { signal });
    addEventListener("keydown", (event) => {
      if (event.key !== "Escape") return;
      event.stopPropagation();
      given();
    }, { signal, capture: true });
  });
}

/** Return a function that runs `act` once in the next frame, however often it is called before. */
export function inNextFrame(act) {
  let waiting = 0;
  return () => { waiting ||= requestAnimationFrame(() => { waiting = 0; act(); }); };
}

/** A part of a panel under a heading. */
export const section = (title, ...children) => make("section", {}, title && make("h2", { textContent: title }), ...children.filter(Boolean));

export const row = (...children) => make("div", { className: "row" }, ...children.filter(Boolean));

/** Element that shows something at the playhead: `follow` runs when it moves, and now. */
export function following(element, follow) {
  element.dataset.follows = "";
  element.follow = () => follow(element);
  follow(element);
  return element;
}
