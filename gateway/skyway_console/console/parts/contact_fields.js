// Who takes the packages of a request, and what to know at the hand-over.

import {WORDS} from "../desk_words.js";
import {html} from "../html.js";
import {change, draft} from "./request_draft.js";

export function ContactFields() {
  const {contact} = draft.value;
  const set = (name) => ({target}) => change({contact: {...contact, [name]: target.value}});
  const needsName = contact.phone !== "" || contact.email !== "";
  return html`
    <fieldset class="contact">
      <legend class="unseen">${WORDS.contact.title}</legend>
      <label>${WORDS.contact.name}<input maxlength="100" autocomplete="off" required=${needsName}
        value=${contact.name} onInput=${set("name")} /></label>
      <label>${WORDS.contact.phone}<input type="tel" maxlength="16" pattern="[+][1-9][0-9]{6,14}" autocomplete="off"
        title=${WORDS.contact.phoneForm} placeholder="+15125550100" value=${contact.phone} onInput=${set("phone")} /></label>
      <label>${WORDS.contact.email}<input type="email" maxlength="254" autocomplete="off"
        value=${contact.email} onInput=${set("email")} /></label>
      <label class="wide">${WORDS.contact.instructions}<textarea rows="2" maxlength="500"
        value=${contact.instructions} onInput=${set("instructions")}></textarea></label>
    </fieldset>`;
}
