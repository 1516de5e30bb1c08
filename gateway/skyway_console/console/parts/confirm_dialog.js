// Asks before something happens: shows what it would do, and does it only when that is confirmed.
// What cannot be shown cannot be confirmed.

import {signal} from "@preact/signals";
import {useEffect, useState} from "preact/hooks";

import {html} from "../html.js";
import {forgetPreview, isPreviewed} from "../preview.js";
import {attempt, say} from "./messages.js";
import {useModal} from "./panel.js";
import {useBusy} from "./use_busy.js";

const MOMENTS = {from_at: "From, fleet time (optional)", until: "Until, fleet time (optional)"};

// {title, meaning, verb, preview, action, done, undo, reason, moments}: `meaning` is a sentence of what
// the command does, `preview` answers markup that shows its consequences, `reason` is "required", "optional",
// "note" or "none", `moments` are the names of moments that people may choose. Preview and action get these
// moments, and the action gets the reason too. `undo` has an `action`, which gets the answer of the
// command, and `done`, which says what is undone.
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
    forgetPreview();
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

const REASONS = {
  required: "Reason, for the record", optional: "Reason, for the record (optional)", note: "Note for others (optional)",
};

const Reason = ({kind}) => kind !== "none" && html`
  <label for="reason">${REASONS[kind]}</label>
  <input id="reason" name="reason" required=${kind === "required"} maxlength="500" />`;

// Says what was done, and offers to undo it where that can be undone.
async function perform(action, done, undo) {
  let answer;
  const isDone = await attempt(async () => (answer = await action()));
  const again = undo && (() => attempt(() => undo.action(answer), undo.done));
  if (isDone) say(done, "done", again);
  return isDone;
}

const nothingElse = async () => "";

function Dialog({title, meaning, preview = nothingElse, action, verb, done, undo, reason = "required", moments: names = []}) {
  const element = useModal();
  const [moments, setMoments] = useState({});
  const [isBusy, busy] = useBusy();
  const {consequences, isRefused} = useConsequences(preview, moments);
  useEffect(() => forgetPreview, []);

  async function act(event) {
    event.preventDefault();
    const given = new FormData(event.target).get("reason")?.trim();
    if (await busy(() => perform(() => action(given, moments), done, undo))) asked.value = null;
  }

  return html`
    <dialog ref=${element} class=${isPreviewed() ? "beside" : ""} aria-labelledby="question"
      onClose=${() => (asked.value = null)}>
      <form onSubmit=${act}>
        <h2 id="question">${title}</h2>
        ${meaning && html`<p class="meaning">${meaning}</p>`}
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
