// A short tone when an alarm comes, if somebody has switched it on.

import {effect, signal} from "@preact/signals";

import {openAlarms} from "../live.js";

export const alarmSound = signal(false);

let known = new Set();

function playTone() {
  const audio = new AudioContext();
  const tone = audio.createOscillator();
  tone.frequency.value = 660;
  tone.connect(audio.destination);
  tone.start();
  tone.stop(audio.currentTime + 0.25);
  tone.addEventListener("ended", () => audio.close());
}

effect(() => {
  const ids = openAlarms.value.map(({alarm_id}) => alarm_id);
  if (alarmSound.peek() && ids.some((id) => !known.has(id))) playTone();
  known = new Set(ids);
});
