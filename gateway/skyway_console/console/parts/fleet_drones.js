// A provider's drones with their commands, and registering another one.

import {useState} from "preact/hooks";

import {all, part, post} from "../api.js";
import {html} from "../html.js";
import {useRead} from "../use_read.js";
import {dayText} from "../words.js";
import {DroneForm} from "./drone_form.js";
import {FleetTable} from "./fleet_table.js";
import {attempt} from "./messages.js";
import {SecretBox} from "./secret_box.js";

// The live picture shows what changes often.
const AGAIN_MS = 15_000;

export function FleetDrones({providerId}) {
  const path = `/v1/providers/${part(providerId)}/drones`;
  const {answer: drones, problem, again: read} = useRead(() => all(path), {key: path, everyMs: AGAIN_MS});
  const [token, setToken] = useState(null);
  const show = (name, {enrolment_token: text, expires_wall_at: until}) => setToken({name, text, until});

  async function register(wanted) {
    const isRegistered = await attempt(async () => {
      const made = await post(path, wanted);
      show(made.name ?? made.drone_id, made);
    }, "The drone is registered.");
    if (isRegistered) read();
    return isRegistered;
  }

  return html`
    ${problem && html`<p class="refused" role="alert">${problem}</p>`}
    ${drones === null ? html`<p>Reading…</p>` : html`
      <${FleetTable} drones=${drones} onChange=${read} onToken=${show} />`}
    ${token && html`<${SecretBox} title=${`Enrolment token of ${token.name}`} secrets=${[["Token", token.text]]}
      qrOf=${token.text} onClose=${() => setToken(null)}
      hint=${`It is shown only now. The drone exchanges it once for its own credentials${
        token.until ? `, until ${dayText(token.until)}` : ""}.`} />`}
    <h2>New drone</h2>
    <${DroneForm} providerId=${providerId} onRegister=${register} />`;
}
