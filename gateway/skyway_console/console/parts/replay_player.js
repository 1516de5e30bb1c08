// The player of a replay: play and pause, speeds, a play head on a line with marks for events, and jumps to them.

import {html} from "../html.js";
import {clockTime, zoneName} from "../words.js";

const SPEEDS = [1, 10, 60, 300];
const STEP_MS = 10_000;
// A jump back from less than this after an event goes to the event before it.
const JUST_MS = 1_000;

// A moment as an input of the type "datetime-local" writes it, in the browser's own zone.
function localText(ms) {
  const date = new Date(ms);
  return new Date(ms - date.getTimezoneOffset() * 60_000).toISOString().slice(0, 16);
}

const SHAPES = {
  alarm: "M0 4 L7 18 L-7 18 Z", closure: "M-6 6 h12 v12 h-12 Z", landing: "M-2 6 h4 v12 h-4 Z",
  plan: "M0 4 l8 8 l-8 8 l-8 -8 Z",
};

export const exactTime = (ms) => new Date(ms).toLocaleTimeString([], {hourCycle: "h23"});

const Marks = ({events, span}) => html`
  <svg class="marks" aria-hidden="true">
    ${events.map(({id, kind, atMs}) => html`
      <svg key=${id} class="mark" x="${(100 * (atMs - span.from)) / (span.until - span.from)}%">
        <path class=${kind} d=${SHAPES[kind]} /></svg>`)}
  </svg>`;

function eventBefore(events, atMs) {
  return events.filter((each) => each.atMs < atMs - JUST_MS).at(-1);
}

const eventAfter = (events, atMs) => events.find((each) => each.atMs > atMs);

// What the keys do, wherever in the view somebody is, except where a control needs them itself.
export function keysOf({atMs, onAt, isPlaying, onPlay, events}) {
  const actions = {
    " ": () => onPlay(!isPlaying),
    ArrowLeft: () => onAt(atMs - STEP_MS),
    ArrowRight: () => onAt(atMs + STEP_MS),
    p: () => eventBefore(events, atMs) && onAt(eventBefore(events, atMs).atMs),
    n: () => eventAfter(events, atMs) && onAt(eventAfter(events, atMs).atMs),
  };
  return (event) => {
    const {target, key} = event;
    const isOwn = target.closest("input, select, textarea") || (key === " " && target.closest("button, a, summary"))
      || (key.startsWith("Arrow") && target.closest(".map"));
    if (!(key in actions) || isOwn || event.ctrlKey || event.metaKey || event.altKey) return;
    event.preventDefault();
    actions[key]();
  };
}

export function ReplayPlayer({span, onSpan, atMs, onAt, speed, onSpeed, isPlaying, onPlay, text, events, children}) {
  const [earlier, later] = [eventBefore(events, atMs), eventAfter(events, atMs)];
  const choose = ({target}) => {
    const from = new Date(target.value).getTime();
    if (!Number.isNaN(from)) onSpan(from);
  };
  const jump = (name, sign, event) => html`
    <button aria-label=${name} title=${event ? `${name}: ${event.text}` : name} disabled=${!event}
      onClick=${() => onAt(event.atMs)}>${sign}</button>`;
  return html`
    <div class="player">
      <div class="row">
        ${jump("Event before", "‹ Event", earlier)}
        <button class="main" onClick=${() => onPlay(!isPlaying)}>${isPlaying ? "Pause" : "Play"}</button>
        ${jump("Next event", "Event ›", later)}
      </div>
      <label>Speed <select value=${speed} onChange=${({target}) => onSpeed(Number(target.value))}>
        ${SPEEDS.map((each) => html`<option value=${each}>×${each}</option>`)}
      </select></label>
      <output><strong>${exactTime(atMs)}</strong> ${zoneName()}</output>
      <label>From <input type="datetime-local" value=${localText(span.from)} onChange=${choose} /></label>
      <span class="hint" role="status">${text}</span>
      ${children}
      <div class="head-line">
        <${Marks} events=${events} span=${span} />
        <input type="range" aria-label="Moment" aria-valuetext=${exactTime(atMs)} min=${span.from} max=${span.until}
          step="1000" value=${atMs} onInput=${({target}) => onAt(Number(target.value))} />
        <div class="ends"><span>${clockTime(span.from)}</span><span>${clockTime(span.until)}</span></div>
      </div>
    </div>`;
}
