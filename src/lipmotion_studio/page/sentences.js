// The sentences that edits are (docs/edit.md), and what sentences say that has a place in time.

const rounded = (value) => String(Number(value.toFixed(4)));
const seconds = (value) => String(Number(value.toFixed(3)));

/** Sentences. Phones and words are numbered from 1. */
export const say = {
  word: (number, word) => `word ${number} is ${word}`,
  wordSaid: (number, word, phones) => `word ${number} is ${word} said ${phones.join(" ")}`,
  phone: (number, phone) => `phone ${number} is ${phone}`,
  begins: (number, time_s) => `phone ${number} begins ${seconds(time_s)}`,
  ends: (number, time_s) => `phone ${number} ends ${seconds(time_s)}`,
  split: (number, time_s) => `split phone ${number} at ${seconds(time_s)}`,
  remove: (number) => `remove phone ${number}`,
  insert: (phone, start_s, end_s) => `insert ${phone} from ${seconds(start_s)} to ${seconds(end_s)}`,
  pin: (channel, value, time_s, slope = null) => `pin ${channel} ${rounded(value)} at ${seconds(time_s)}${slope === null ? "" : ` slope ${rounded(slope)}`}`,
  unpin: (channel, time_s) => `unpin ${channel} at ${seconds(time_s)}`,
  gain: (channel, factor, start_s, end_s) => `gain ${channel ? `${channel} ` : ""}${rounded(factor)} from ${seconds(start_s)} to ${seconds(end_s)}`,
  draw: (channel, values, start_s, end_s) => `draw ${channel} ${values.map(rounded).join(" ")} from ${seconds(start_s)} to ${seconds(end_s)}`,
  hold: (start_s, end_s) => `hold from ${seconds(start_s)} to ${seconds(end_s)}`,
  lock: (start_s, end_s) => `lock from ${seconds(start_s)} to ${seconds(end_s)}`,
  unlock: (start_s, end_s) => `unlock from ${seconds(start_s)} to ${seconds(end_s)}`,
  mood: (mood, time_s) => `mood ${mood} at ${seconds(time_s)}`,
  set: (name, value) => `set ${name} ${value}`,
};

const NUMBER = "([-+\\d.e]+)";
const FORMS = {
  pin: new RegExp(`^pin (\\S+) ${NUMBER} at ${NUMBER}(?: slope ${NUMBER})?$`),
  unpin: new RegExp(`^unpin (\\S+) at ${NUMBER}$`),
  gain: new RegExp(`^gain (?:(\\S+) )?${NUMBER} from ${NUMBER} to ${NUMBER}$`),
  draw: new RegExp(`^draw (\\S+) (.+) from ${NUMBER} to ${NUMBER}$`),
  hold: new RegExp(`^hold from ${NUMBER} to ${NUMBER}$`),
  lock: new RegExp(`^lock from ${NUMBER} to ${NUMBER}$`),
  unlock: new RegExp(`^unlock from ${NUMBER} to ${NUMBER}$`),
  mood: new RegExp(`^mood (\\S+) at ${NUMBER}$`),
  set: /^set (\S+) (\S+)$/,
};

/**
 * Return what sentences say that has a place in time, and the values that are set.
 * @param {string[]} steps
 */
export function placed(steps) {
  const found = { pins: [], gains: [], drawn: [], holds: [], locks: [], moods: [], set: {} };
  const read = {
    pin: ([, channel, value, time_s, slope]) => found.pins.push({ channel, value: +value, time_s: +time_s, slope: slope === undefined ? null : +slope }),
    unpin: ([, channel, time_s]) => { found.pins = found.pins.filter((pin) => pin.channel !== channel || Math.abs(pin.time_s - time_s) >= 0.005); },
    gain: ([, channel, factor, start_s, end_s]) => found.gains.push({ channel: channel ?? "", factor: +factor, start_s: +start_s, end_s: +end_s }),
    draw: ([, channel, , start_s, end_s]) => found.drawn.push({ channel, start_s: +start_s, end_s: +end_s }),
    hold: ([, start_s, end_s]) => found.holds.push({ start_s: +start_s, end_s: +end_s }),
    lock: ([, start_s, end_s]) => found.locks.push({ start_s: +start_s, end_s: +end_s }),
    unlock: ([, start_s, end_s]) => {
      const place = found.locks.findLastIndex((lock) => lock.start_s === +start_s && lock.end_s === +end_s);
      if (place >= 0) found.locks.splice(place, 1);
    },
    mood: ([, mood, time_s]) => found.moods.push({ mood, time_s: +time_s }),
    set: ([, name, value]) => { found.set[name] = value; },
  };
  for (const step of steps) {
    for (const [kind, form] of Object.entries(FORMS)) {
      const parts = form.exec(step);
      if (parts) read[kind](parts);
    }
  }
  found.moods.sort((a, b) => a.time_s - b.time_s);
  return found;
}
