// A customer's webhooks: their state and attempts, a test, another secret, and adding one.

import {useState} from "preact/hooks";

import {all, call, part, post} from "../api.js";
import {html} from "../html.js";
import {useRead} from "../use_read.js";
import {inWords} from "../words.js";
import {attempt, say} from "./messages.js";
import {SecretBox} from "./secret_box.js";
import {SureButton} from "./sure_button.js";
import {WebhookAttempts} from "./webhook_attempts.js";
import {WebhookForm} from "./webhook_form.js";

async function test(path) {
  const {outcome, status, detail} = await post(`${path}/test`);
  if (outcome === "DELIVERED") say(`The test event was answered with ${status}.`);
  else say(`The test event did not arrive: ${detail ?? `it was answered with ${status}`}`, "refused");
}

function Webhook({webhook, isOpen, onOpen, onChange, onSecret}) {
  const {webhook_id, url, event_types: types, state, disabled_reason: reason} = webhook;
  const path = `/v1/webhooks/${part(webhook_id)}`;
  const then = async (action, done) => (await attempt(action, done)) && onChange();
  return html`
    <tr>
      <td class="title">${url}<br /><small>${webhook_id}</small></td>
      <td data-label="Events">${types ? types.join(", ") : "all"}</td>
      <td data-label="State">${inWords(state)}${reason && html`<br /><small>${reason}</small>`}</td>
      <td class="wide-cell"><div class="commands">
        <button class="small" aria-expanded=${isOpen} onClick=${onOpen}>Attempts</button>
        <button class="small" onClick=${() => attempt(() => test(path))}>Test</button>
        ${state === "DISABLED" && html`<button class="small"
          onClick=${() => then(() => call("PATCH", path, {state: "ACTIVE"}), "It is notified again.")}>
          Enable</button>`}
        <button class="small" onClick=${() =>
          attempt(async () => onSecret(await post(`${path}/secret-rotations`)))}>New secret</button>
        <${SureButton} verb="Delete" label=${`Delete the webhook of ${url}`}
          onSure=${() => then(() => call("DELETE", path), "The webhook is deleted.")} />
      </div></td>
    </tr>
    ${isOpen && html`<tr><td colspan="4"><${WebhookAttempts} path=${path} /></td></tr>`}`;
}

export function WebhookList() {
  const {answer: webhooks, problem, again: read} = useRead(() => all("/v1/webhooks"));
  const [open, setOpen] = useState(null);
  const [issued, setIssued] = useState(null);

  async function make(wanted) {
    const isMade = await attempt(async () => setIssued(await post("/v1/webhooks", wanted)));
    if (isMade) read();
    return isMade;
  }

  return html`
    <h2>Webhooks</h2>
    ${problem && html`<p class="refused" role="alert">${problem}</p>`}
    <div class="table"><table class="as-cards" aria-label="Webhooks">
      <thead><tr><th>URL</th><th>Events</th><th>State</th><th>Commands</th></tr></thead>
      <tbody>
        ${webhooks?.map((each) => html`
          <${Webhook} key=${each.webhook_id} webhook=${each} isOpen=${open === each.webhook_id}
            onOpen=${() => setOpen(open === each.webhook_id ? null : each.webhook_id)}
            onChange=${read} onSecret=${setIssued} />`)}
        ${webhooks?.length === 0 && html`<tr><td colspan="4">No webhook. Add one below: your shop hears of each delivery by itself then.</td></tr>`}
      </tbody>
    </table></div>
    ${issued && html`<${SecretBox} title="The signing secret" secrets=${[["Secret", issued.secret]]}
      hint="It is shown only now. It proves that a notification comes from here."
      onClose=${() => setIssued(null)} />`}
    <h2>New webhook</h2>
    <${WebhookForm} onMake=${make} />`;
}
