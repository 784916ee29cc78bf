// Of the page of the window, whose clock a test moves.

/** From now on the clock stands, and it is noted when which sound is to be played, in samples. */
function hold() {
  const { playback } = live, { schedule } = playback, held_s = playback.clock_s;
  document.querySelector("canvas").style.display = "none"; // nothing more is drawn: processors would take seconds for it
  Object.defineProperty(playback, "clock_s", { value: held_s, writable: true });
  window.heard = []; // the global object of Marionette is not the page's
  playback.schedule = (begin_s, samples) => {
    heard.push((begin_s + playback.anchor_s - playback.shift_s) * playback.rate_hz);
    schedule.call(playback, begin_s, samples);
  };
}

/** Return which weight the jaw has at times of the stream, seconds. */
function weightsAt(steps) {
  const { playback, head } = live;
  const mesh = head.meshes.find((each) => "jawOpen" in each.morphTargetDictionary);
  return steps.map((step_s) => {
    playback.clock_s += step_s - playback.time_s;
    live.draw();
    return mesh.morphTargetInfluences[mesh.morphTargetDictionary.jawOpen];
  });
}
