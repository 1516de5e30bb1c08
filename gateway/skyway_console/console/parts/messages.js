// Short messages at the edge of the page: what was done, and what was refused.

import {signal} from "@preact/signals";

import {html} from "../html.js";

const SHOWN_MS = 8_000;
const shown = signal([]);
let last = 0;

export function say(text, kind = "done") {
  const message = {id: (last += 1), text, kind};
  shown.value = [...shown.value, message];
  setTimeout(() => (shown.value = shown.value.filter(({id}) => id !== message.id)), SHOWN_MS);
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

export const Messages = () => html`
  <div class="messages" role="status" aria-live="polite">
    ${shown.value.map(({id, text, kind}) => html`<p key=${id} class=${kind}>${text}</p>`)}
  </div>`;
