// Why the mouth is as it is at the playhead, and the moments that are in doubt.

import { following, make, row, section, textButton } from "../dom.js";
import { TEXT, fill } from "../strings.js";

const SETTLED_MS = 120, FACTS = ["word", "phone", "unit", "state", "experts", "confidence"];

const percent = (share) => `${Math.round(100 * share)} %`;
const shownFact = (name, value) => (name === "experts" ? value.map((each) => `${each.name} ${percent(each.share)}`).join(", ")
  : name === "confidence" ? percent(value) : String(value));

export function whyTab(studio) {
  const { store } = studio;
  if (!store.recording?.phones.length) return [];
  const facts = make("div", { id: "why" });
  let waiting = 0;
  const shown = following(section(TEXT.why.replace("{time}", "…"), facts), (part) => {
    clearTimeout(waiting);
    waiting = setTimeout(() => tell(studio, part, facts), facts.childElementCount ? SETTLED_MS : 0);
  });
  return [shown, section(TEXT.doubts,
    row(textButton(TEXT.previousDoubt, () => studio.jump(-1), { id: "previous-doubt" }), textButton(TEXT.nextDoubt, () => studio.jump(1), { id: "next-doubt" })),
    store.doubts.length ? make("ol", { className: "list" }, ...store.doubts.map((doubt) => make("li", {},
      textButton(`${doubt.start_s.toFixed(2)} s  ${doubt.text}`, () => studio.goTo(doubt))))) : make("p", { className: "hint", textContent: TEXT.noDoubts }))];
}

async function tell(studio, shown, facts) {
  const { recordingId, time_s } = studio.store;
  try {
    const why = await studio.server.read(`lines/${recordingId}/why?time=${time_s.toFixed(3)}`);
    if (studio.store.time_s !== time_s) return;
    shown.firstChild.textContent = fill(TEXT.why, { time: time_s.toFixed(2) });
    facts.replaceChildren(
      make("dl", {}, ...FACTS.filter((name) => ![undefined, null, ""].includes(why[name]) && why[name].length !== 0).flatMap((name) => [
        make("dt", { textContent: TEXT.facts[name] }), make("dd", { textContent: shownFact(name, why[name]) })])),
      make("details", { open: facts.querySelector("details")?.open ?? false }, make("summary", { textContent: TEXT.inFull }), make("p", { textContent: why.text ?? "" })));
  } catch (error) {
    facts.replaceChildren(make("p", { className: "hint", textContent: error.message }));
  }
}
