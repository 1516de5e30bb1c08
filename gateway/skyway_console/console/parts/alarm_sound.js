// A short tone when an alarm comes, if somebody has switched it on.

import {effect} from "@preact/signals";

import {alarmSound, openAlarms} from "../live.js";

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

export const followAlarms = () => effect(() => {
  const ids = openAlarms.value.map(({alarm_id}) => alarm_id);
  if (alarmSound.peek() && ids.some((id) => !known.has(id))) playTone();
  known = new Set(ids);
});
