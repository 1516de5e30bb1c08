// Short messages at the edge of the page: what was done and how to undo it, and what was refused.

import {signal} from "@preact/signals";

import {html} from "../html.js";

const SHOWN_MS = 8_000;
const UNDO_MS = 15_000;
const shown = signal([]);
let last = 0;

const forget = (gone) => (shown.value = shown.value.filter(({id}) => id !== gone));

// `undo` is called when somebody thinks again. A refusal stays until it is closed or something else is said.
export function say(text, kind = "done", undo = null) {
  const id = (last += 1);
  shown.value = [...shown.value.filter((each) => each.kind !== "refused"), {id, text, kind, undo}];
  if (kind !== "refused") setTimeout(() => forget(id), undo ? UNDO_MS : SHOWN_MS);
}

// Runs an action, and shows why it failed if it does; whether it succeeded.
export async function attempt(action, done) {
  try {
    await action();
  } catch (problem) {
    say(problem.message, "refused");
    return false;
  }
  if (done) say(done);
  return true;
}

export const copy = (text, done) => attempt(() => navigator.clipboard.writeText(text), done);

const Close = ({id}) => html` <button class="undo" onClick=${() => forget(id)}>Close</button>`;

function Undo({id, undo}) {
  const act = () => {
    forget(id);
    undo();
  };
  return html` <button class="undo" onClick=${act}>Undo</button>`;
}

export const Messages = () => html`
  <div class="messages" role="status" aria-live="polite">
    ${shown.value.map(({id, text, kind, undo}) => html`
      <p key=${id} class=${kind}>${text}${undo && html`<${Undo} id=${id} undo=${undo} />`}
        ${kind === "refused" && html`<${Close} id=${id} />`}</p>`)}
  </div>`;
