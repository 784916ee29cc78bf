// What is selected, and what can be done to it.

import { choice, following, labelled, make, row, section, textButton } from "../dom.js";
import { placed, say } from "../sentences.js";
import { TEXT, fill } from "../strings.js";

const MOST_GAIN = 2;
/** Moods that have no strength. */
const PLAIN = ["neutral", "plain"];

/** Return what the tab shows. */
export function editTab(studio) {
  const { recording, selected, span } = studio.store;
  if (!recording?.phones.length) return [];
  return [
    selected?.kind === "phone" && recording.phones[selected.index] && phonePart(studio, selected.index),
    selected?.kind === "word" && recording.words[selected.index] && wordPart(studio, selected.index),
    selected?.kind === "curve" && curvePart(studio, selected.channel),
    span && spanPart(studio, span),
    !selected && !span && make("p", { className: "hint", textContent: TEXT.nothingSelected }),
    moodPart(studio, span),
    !selected && transcriptPart(studio),
  ].filter(Boolean);
}

const phoneChoices = ({ forms }) => forms.phones.map(({ name }) => [name, TEXT.examples[name] ? `${name} – ${TEXT.examples[name]}` : name]);

function timeField(id, value, name, onchange) {
  return labelled(name, make("input", { id, type: "number", step: "0.01", min: "0", value: value.toFixed(3), onchange: (event) => onchange(Number(event.target.value)) }));
}

function phonePart(studio, index) {
  const { recording, project } = studio.store, phone = recording.phones[index], number = index + 1;
  const labels = phoneChoices(project);
  const label = choice(labels, phone.label, (to) => studio.relabel("phone", index, to), { id: "phone-label", "aria-label": TEXT.phone });
  const sure = phone.confidence === null || phone.confidence === undefined ? ""
    : make("span", { className: "sure", textContent: fill(TEXT.sure, { share: Math.round(100 * phone.confidence) }) });
  return section(`${TEXT.phone} ${number}`,
    row(label, sure),
    row(timeField("phone-from", phone.start_s, TEXT.from, (time_s) => studio.edit([say.begins(number, time_s)])),
      timeField("phone-to", phone.end_s, TEXT.to, (time_s) => studio.edit([say.ends(number, time_s)]))),
    row(textButton(TEXT.split, () => studio.split(index), { id: "phone-split" }),
      textButton(TEXT.mergeNext, () => studio.merge(index), { id: "phone-merge", disabled: number === recording.phones.length }),
      textButton(TEXT.remove, () => studio.removePhone(index), { id: "phone-remove", disabled: recording.phones.length < 2 })),
  );
}

function wordPart(studio, index) {
  const { recording } = studio.store, word = recording.words[index];
  const field = make("input", { id: "word-label", value: word.label, autocapitalize: "none", spellcheck: false, "aria-label": TEXT.word });
  const offers = make("div", { className: "offers", id: "offers", role: "group", "aria-label": TEXT.pronunciations });
  const phones = make("input", { id: "word-phones", spellcheck: false, autocapitalize: "none" });
  const spoken = spokenAs(recording, index).join(" ");
  phones.value = spoken;
  let waiting = 0, seen = {};
  const offer = async () => { seen = await offerPronunciations(studio, field.value.trim().toLowerCase(), offers, phones); };
  field.addEventListener("input", () => {
    clearTimeout(waiting);
    waiting = setTimeout(offer, 200);
    phones.value = field.value.trim().toLowerCase() === word.label ? spoken : "";
  });
  field.addEventListener("keydown", (event) => { if (event.key === "Enter") apply(); });
  const apply = () => {
    const label = field.value.trim().toLowerCase(), said = phones.value.trim();
    return said && said !== spoken ? studio.edit([say.wordSaid(index + 1, label, said.split(/\s+/))]) : studio.relabel("word", index, label);
  };
  offer();
  return section(`${TEXT.word} ${index + 1}`,
    row(field, textButton(TEXT.change, apply, { id: "word-change" })), offers,
    row(labelled(TEXT.said, phones), textButton(TEXT.keep, async () => {
      const kept = field.value.trim().toLowerCase();
      if (seen.asked !== kept) await offer();
      await studio.keepPronunciation(kept, phones.value.trim().split(/\s+/), seen);
      offer();
    }, { id: "word-keep" })));
}

/** Offer the pronunciations of a word that are known; return the word, and what the server said of it. */
async function offerPronunciations(studio, word, place, phones) {
  let found = {};
  try {
    if (word) found = await studio.server.read(`lexicon?word=${encodeURIComponent(word)}`);
  } catch (error) {
    place.replaceChildren(make("p", { className: "hint", textContent: error.message }));
    return {};
  }
  place.replaceChildren(
    found.known === false ? make("p", { className: "hint", textContent: TEXT.noPronunciation }) : "",
    ...(found.pronunciations ?? []).map((said) => textButton(said.join(" "), () => { phones.value = said.join(" "); }, { className: "offer" })));
  return { ...found, asked: word };
}

/** Return the phones of a word: those that the server counts to it. */
function spokenAs({ words, phones }, index) {
  const { start_s, end_s } = words[index];
  return phones.filter((phone) => phone.start_s >= start_s - 1e-6 && phone.end_s <= end_s + 1e-6).map(({ label }) => label);
}

function curvePart(studio, channel) {
  const { store } = studio;
  const field = following(make("input", { id: "curve-value", type: "number", step: "0.01", "aria-label": TEXT.value }), (shown) => {
    const curves = store.curvesOf(channel);
    if (curves && document.activeElement !== shown) shown.value = curves.at(store.time_s, curves.column(channel)).toFixed(3);
  });
  const pin = () => studio.edit([say.pin(channel, Number(field.value), studio.frameTime)]);
  field.addEventListener("keydown", (event) => { if (event.key === "Enter") pin(); });
  return section(`${TEXT.curve} ${channel}`, row(labelled(TEXT.value, field), textButton(TEXT.pin, pin, { id: "curve-pin" })));
}

function spanPart(studio, { start_s, end_s }) {
  const { store } = studio, { selected, recording, project } = store;
  const channel = selected?.kind === "curve" ? selected.channel : "";
  const shown = make("output", { textContent: "1.00" });
  const factor = make("input", { id: "gain", type: "range", min: "0", max: String(MOST_GAIN), step: "0.05", value: "1", "aria-label": TEXT.gain,
    oninput: () => { shown.textContent = Number(factor.value).toFixed(2); } });
  const phone = choice(phoneChoices(project), "ah", () => {}, { id: "insert-phone", "aria-label": TEXT.insertPhone });
  const insert = () => studio.edit([say.insert(phone.value, start_s, end_s)]);
  phone.addEventListener("keydown", (event) => {
    if (event.key !== "Enter") return;
    event.preventDefault();
    insert();
  });
  const locked = placed(recording.steps).locks.find((lock) => lock.start_s < end_s && lock.end_s > start_s);
  return section(`${TEXT.span} ${start_s.toFixed(2)} – ${end_s.toFixed(2)} s`,
    row(labelled(`${TEXT.gain}: ${channel || TEXT.wholeMouth}`, factor, shown),
      textButton(TEXT.apply, () => studio.edit([say.gain(channel, Number(factor.value), start_s, end_s)]), { id: "gain-apply" })),
    row(locked ? textButton(TEXT.unlock, () => studio.edit([say.unlock(locked.start_s, locked.end_s)]), { id: "unlock" })
      : textButton(TEXT.lock, () => studio.over(say.lock), { id: "lock", title: TEXT.lockOf }),
    textButton(TEXT.hold, () => studio.over(say.hold), { id: "hold", title: TEXT.holdOf }),
    phone, textButton(TEXT.insert, insert, { id: "insert" })));
}

/** A mood of the selection, after which the one before is back; without a selection, from the playhead on. */
function moodPart(studio, span) {
  const { project } = studio.store, strength = make("input", { id: "mood-strength", type: "range", min: "0.1", max: "1", step: "0.1", value: "0.7", "aria-label": TEXT.strength });
  const known = ["neutral", ...project.forms.moods, "plain", ...project.forms.manners].map((each) => [each, each]);
  const moods = choice(known, "happy", () => {}, { id: "mood", "aria-label": TEXT.mood });
  const set = () => {
    const { recording, time_s } = studio.store, mood = PLAIN.includes(moods.value) ? moods.value : `${moods.value}:${strength.value}`;
    if (!span) return studio.edit([say.mood(mood, time_s)]);
    const isManner = (name) => ["plain", ...project.forms.manners].includes(name.split(":")[0]), kind = isManner(mood);
    const before = placed(recording.steps).moods.findLast((each) => each.time_s <= span.end_s && isManner(each.mood) === kind)?.mood ?? (kind ? "plain" : "neutral");
    return studio.edit([say.mood(mood, span.start_s), say.mood(before, span.end_s)]);
  };
  return section(span ? TEXT.moodOver : TEXT.moodAt, row(moods, strength, textButton(TEXT.apply, set, { id: "mood-set" })));
}

function transcriptPart(studio) {
  const { recording } = studio.store, words = (!recording.steps.length && recording.transcript) || recording.words.map(({ label }) => label).join(" ");
  const field = make("textarea", { id: "transcript", rows: 3, value: studio.typed ?? words, "aria-label": TEXT.transcript });
  const misfits = (recording.misfits ?? []).map((text) => make("p", { className: "bad", role: "alert", textContent: text }));
  const warnings = (recording.warnings ?? []).map((text) => make("p", { className: "hint", textContent: fill(TEXT.wouldHelp, { what: text }) }));
  return section(TEXT.transcript, ...misfits, ...warnings, field, row(textButton(TEXT.align, () => studio.realign(field.value), { id: "align" })));
}
