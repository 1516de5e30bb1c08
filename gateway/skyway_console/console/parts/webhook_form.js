// The form of a new webhook: where it points, and of which events it hears.

import {html} from "../html.js";
import {TYPES} from "./delivery_events.js";

export function WebhookForm({onMake}) {
  async function make(event) {
    event.preventDefault();
    const form = event.target;
    const values = new FormData(form);
    const types = values.getAll("type");
    const wanted = {url: values.get("url").trim(), ...(types.length ? {event_types: types} : {})};
    if (await onMake(wanted)) form.reset();
  }
  return html`
    <form class="fields" aria-label="New webhook" onSubmit=${make}>
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
