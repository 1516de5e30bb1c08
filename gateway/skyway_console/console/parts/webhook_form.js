// The form of a new webhook: where it points, and of which events it hears.

import {html} from "../html.js";
import {TYPES} from "./delivery_events.js";
import {given, sending} from "./sent_form.js";

const webhookOf = ({url}, values) => ({url, ...given({event_types: values.getAll("type")})});

export function WebhookForm({onMake}) {
  return html`
    <form class="fields" aria-label="New webhook" onSubmit=${sending(webhookOf, onMake)}>
      <label>URL<input name="url" type="url" required maxlength="2000"
        placeholder="https://shop.example/skyway" /></label>
      <details>
        <summary>Only some events</summary>
        <fieldset class="choices"><legend>Events; without a choice all of them</legend>
          ${TYPES.map((each) => html`
            <label class="check"><input type="checkbox" name="type" value=${each} /> ${each}</label>`)}
        </fieldset>
      </details>
      <div class="commands"><button class="main">Add the webhook</button></div>
    </form>`;
}
