// The name and the colour of a customer's shop on its tracking pages.

import {useEffect, useState} from "preact/hooks";

import {call, get} from "../api.js";
import {html} from "../html.js";
import {attempt} from "./messages.js";

const PATH = "/v1/branding";
const FIRST_COLOUR = "#0b6bcb";

export function BrandingForm() {
  const [branding, setBranding] = useState(null);
  useEffect(() => {
    attempt(async () => setBranding(await get(PATH)));
  }, []);
  if (!branding) return "";
  const {name, colour} = branding;
  const change = (members) => setBranding({...branding, ...members});
  const save = (event) => {
    event.preventDefault();
    const wanted = {name: name?.trim() || null, colour};
    attempt(async () => setBranding(await call("PUT", PATH, wanted)), "Your tracking pages show this now.");
  };
  return html`
    <h2>Your shop on tracking pages</h2>
    <form class="fields" aria-label="Your shop on tracking pages" onSubmit=${save}>
      <label>Name (optional)<input maxlength="60" value=${name ?? ""} onInput=${({target}) => change({name: target.value})} /></label>
      <label class="check"><input type="checkbox" checked=${colour !== null}
        onChange=${({target}) => change({colour: target.checked ? FIRST_COLOUR : null})} />
        An own colour behind the name</label>
      ${colour !== null && html`<label>Colour<input type="color" value=${colour}
        onInput=${({target}) => change({colour: target.value})} /></label>`}
      <div class="commands"><button class="main">Save</button></div>
    </form>`;
}
