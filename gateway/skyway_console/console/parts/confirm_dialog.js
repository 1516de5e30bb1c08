// Asks before something happens: shows what it would do, and does it only when that is confirmed.
// What cannot be shown cannot be confirmed.

import {signal} from "@preact/signals";
import {useEffect, useRef, useState} from "preact/hooks";

import {html} from "../html.js";
import {attempt} from "./messages.js";

const MOMENTS = {from_at: "From, fleet time (optional)", until: "Until, fleet time (optional)"};

// {title, verb, preview, action, done, reason, moments}: `preview` answers markup that shows the
// consequences, `reason` is "required", "optional" or "none", `moments` are the names of moments that
// people may choose. Preview and action get these moments, and the action gets the reason too.
const asked = signal(null);

export const confirm = (question) => (asked.value = question);

export function ConfirmDialog() {
  const question = asked.value;
  return question && html`<${Dialog} key=${question.title} ...${question} />`;
}

// The consequences of what is chosen now; the answer to an earlier question is not shown.
function useConsequences(preview, moments) {
  const [consequences, setConsequences] = useState(null);
  const [isRefused, setRefused] = useState(false);
  useEffect(() => {
    let isOld = false;
    const show = (shown, refused) => isOld || (setConsequences(shown), setRefused(refused));
    show(null, false);
    preview(moments).then(
      (shown) => show(shown, false),
      (refusal) => show(html`<p class="refused">${refusal.message}</p>`, true));
    return () => (isOld = true);
  }, [moments]);
  return {consequences, isRefused};
}

const Moments = ({names, moments, onChange}) => names.length > 0 && html`
  <div class="moments">
    ${names.map((name) => html`
      <label>${MOMENTS[name]}<input type="datetime-local"
        onChange=${({target: {value}}) => onChange({
          ...moments, [name]: value ? new Date(value).toISOString() : undefined,
        })} /></label>`)}
  </div>`;

const Reason = ({kind}) => kind !== "none" && html`
  <label for="reason">Reason, for the record${kind === "optional" && " (optional)"}</label>
  <input id="reason" name="reason" required=${kind === "required"} maxlength="500" />`;

function Dialog({title, preview, action, verb, done, reason = "required", moments: names = []}) {
  const element = useRef(null);
  const [moments, setMoments] = useState({});
  const [isBusy, setBusy] = useState(false);
  const {consequences, isRefused} = useConsequences(preview, moments);
  useEffect(() => element.current.showModal(), []);

  async function act(event) {
    event.preventDefault();
    setBusy(true);
    const given = new FormData(event.target).get("reason")?.trim();
    if (await attempt(() => action(given, moments), done)) asked.value = null;
    setBusy(false);
  }

  return html`
    <dialog ref=${element} aria-labelledby="question" onClose=${() => (asked.value = null)}>
      <form onSubmit=${act}>
        <h2 id="question">${title}</h2>
        <${Moments} names=${names} moments=${moments} onChange=${setMoments} />
        <div class="consequences" aria-live="polite">
          ${consequences ?? html`<p>Asking what it would change…</p>`}
        </div>
        <${Reason} kind=${reason} />
        <menu>
          <button type="button" class="quiet" onClick=${() => element.current.close()}>
            Do nothing
          </button>
          <button class="danger" disabled=${isBusy || isRefused || consequences === null}>${verb}</button>
        </menu>
      </form>
    </dialog>`;
}
