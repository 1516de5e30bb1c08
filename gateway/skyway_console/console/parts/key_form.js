// The forms of a new API key, for whom, its name, its end, and what it allows, and of a test key.

import {WORDS} from "../desk_words.js";
import {html} from "../html.js";
import {inWords} from "../words.js";
import {given, sending} from "./sent_form.js";

const ROLES = ["customer", "provider", "operator"];

// All scopes of the API; a key without a choice may do all that its role may do.
export const SCOPES = ["account:read", "account:write", "audit:read", "deliveries:read", "deliveries:write",
  "fleet:read", "fleet:write", "keys:read", "keys:write", "live:read", "missions:read", "missions:write",
  "network:read", "network:write", "operations:read", "operations:write", "quotes:write", "statements:read",
  "statements:write", "webhooks:read", "webhooks:write"];

const keyOf = ({role, subject, name, ends}, values) => given({
  role, subject_id: subject, name, expires_wall_at: ends && new Date(ends).toISOString(), scopes: values.getAll("scope"),
});

export function KeyForm({onMake}) {
  return html`
    <form class="fields" aria-label="New key" onSubmit=${sending(keyOf, onMake)}>
      <label>Role<select name="role">
        ${ROLES.map((each) => html`<option value=${each}>${inWords(each)}</option>`)}
      </select></label>
      <label>For: a customer's or operator's name, or a provider's id
        <input name="subject" required maxlength="64" pattern="[A-Za-z0-9_\\-]+"
          title="Letters, digits, _ and -" /></label>
      <label>Name (optional)<input name="name" maxlength="100" placeholder="laptop" /></label>
      <label>Ends (optional)<input name="ends" type="datetime-local" /></label>
      <details>
        <summary>Allow only some calls</summary>
        <fieldset class="choices"><legend>Scopes; without a choice the key may do all that its role may</legend>
          ${SCOPES.map((each) => html`
            <label class="check"><input type="checkbox" name="scope" value=${each} /> ${each}</label>`)}
        </fieldset>
      </details>
      <div class="commands"><button class="main">Make the key</button></div>
    </form>`;
}

export function TestKeyForm({onMake}) {
  return html`
    <form class="fields" aria-label=${WORDS.keys.newTest}
      onSubmit=${sending(({name}) => ({livemode: false, ...given({name})}), onMake)}>
      <label>${WORDS.keys.name}<input name="name" maxlength="100" placeholder="ci" /></label>
      <div class="commands"><button class="main">${WORDS.keys.make}</button></div>
    </form>`;
}
