// Asks before something happens: shows what it would do, and does it only when that is confirmed.
// What cannot be shown cannot be confirmed.

import {signal} from "@preact/signals";
import {useEffect, useRef, useState} from "preact/hooks";

import {html} from "../html.js";
import {attempt} from "./messages.js";

// {title, preview, action, verb, done}: `preview` answers markup that shows the consequences.
const asked = signal(null);

export const confirm = (question) => (asked.value = question);

export function ConfirmDialog() {
  const question = asked.value;
  return question && html`<${Dialog} key=${question.title} ...${question} />`;
}

function Dialog({title, preview, action, verb, done}) {
  const element = useRef(null);
  const [consequences, setConsequences] = useState(null);
  const [isRefused, setRefused] = useState(false);
  const [isBusy, setBusy] = useState(false);
  useEffect(() => {
    element.current.showModal();
    preview().then(setConsequences, (refusal) => {
      setRefused(true);
      setConsequences(html`<p class="refused">${refusal.message}</p>`);
    });
  }, []);

  async function act(event) {
    event.preventDefault();
    setBusy(true);
    const reason = new FormData(event.target).get("reason").trim();
    if (await attempt(() => action(reason), done)) asked.value = null;
    setBusy(false);
  }

  return html`
    <dialog ref=${element} aria-labelledby="question" onClose=${() => (asked.value = null)}>
      <form onSubmit=${act}>
        <h2 id="question">${title}</h2>
        <div class="consequences" aria-live="polite">
          ${consequences ?? html`<p>Asking what it would change…</p>`}
        </div>
        <label for="reason">Reason, for the record</label>
        <input id="reason" name="reason" required maxlength="500" />
        <menu>
          <button type="button" class="quiet" onClick=${() => element.current.close()}>
            Do nothing
          </button>
          <button class="danger" disabled=${isBusy || isRefused || consequences === null}>${verb}</button>
        </menu>
      </form>
    </dialog>`;
}
