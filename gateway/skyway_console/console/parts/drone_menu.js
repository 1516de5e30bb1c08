// What a provider can do with a drone, each with a sentence that says what happens then.

import {useEffect, useRef} from "preact/hooks";

import {call, part, post} from "../api.js";
import {droneName} from "../drone_names.js";
import {html} from "../html.js";
import {pathTo} from "../routes.js";
import {percent} from "../words.js";
import {attempt} from "./messages.js";
import {SureButton} from "./sure_button.js";

// What its flights have shown about a drone, against its model.
const learnedText = ({planned, flights}) =>
  `${flights} flights have shown: energy use ${percent(planned.still_air_factor)}, battery `
  + `${percent(planned.state_of_health)}, charging ${percent(planned.charge_rate_factor)} of the model's.`;

const Choice = ({text, children}) => html`<li><p>${text}</p>${children}</li>`;

function Service({name, state, put}) {
  if (state === "MAINTENANCE") {
    return html`<${Choice} text="It can get missions again.">
      <button aria-label=${`Put ${name} back in service`}
        onClick=${() => put("AVAILABLE", `${name} is back in service.`)}>Back in service</button></${Choice}>`;
  }
  return html`<${Choice} text="It gets no more missions until you put it back in service.">
    <button aria-label=${`Take ${name} into maintenance`}
      onClick=${() => put("MAINTENANCE", `${name} is in maintenance and gets no missions.`)}>Into maintenance</button>
  </${Choice}>`;
}

function Choices({drone, name, onDone, onToken}) {
  const {drone_id: droneId, provider_id: provider, state, learned, maintenance} = drone;
  const path = `/v1/providers/${part(provider)}/drones/${part(droneId)}`;
  const act = (action, done) => attempt(action, done).then((isDone) => isDone && onDone());
  const token = () => act(async () => onToken(name, await post(`${path}/enrolment-tokens`)));
  const forget = () => act(() => call("DELETE", `${path}/learned-values`),
    `${name} counts as its model says until it has flown again.`);
  const maintained = () => act(() => post(`${path}/maintenance`),
    `The maintenance of ${name} is recorded; its counters begin again.`);
  return html`
    <ul class="choices-list">
      <${Service} name=${name} state=${state}
        put=${(wanted, done) => act(() => call("PATCH", path, {state: wanted}), done)} />
      ${maintenance?.due_since_at && html`<${Choice} text="It is due for maintenance and gets no missions until then.">
        <${SureButton} verb="Maintained" label=${`The maintenance of ${name} was done`} kind="" onSure=${maintained} /></${Choice}>`}
      <${Choice} text="A new drone computer exchanges the token once for its own credentials.">
        <button aria-label=${`Another enrolment token for ${name}`} onClick=${token}>Enrolment token</button></${Choice}>
      ${learned && html`<${Choice} text=${`${learnedText(learned)} Forget it after a repair or a new battery.`}>
        <${SureButton} verb="Forget" label=${`Forget what flights of ${name} have shown`} kind="" onSure=${forget} /></${Choice}>`}
    </ul>`;
}

// `onClose` is called when the menu is closed, and `onChange` after something was done.
export function DroneMenu({drone, onClose, onChange, onToken}) {
  const element = useRef(null);
  useEffect(() => element.current.showModal(), []);
  const name = droneName(drone.drone_id, drone.name);
  const done = () => {
    element.current?.close();
    onChange();
  };
  const closeOutside = ({target}) => target === element.current && element.current.close();
  return html`
    <dialog class="sheet" ref=${element} aria-labelledby="drone-menu" onClose=${onClose} onClick=${closeOutside}>
      <header><h2 id="drone-menu">${name}</h2>
        <button class="quiet" aria-label="Close the menu" onClick=${() => element.current.close()}>✕</button></header>
      <p><a href=${pathTo("map", "drone", drone.drone_id)}>See it on the map</a></p>
      <${Choices} drone=${drone} name=${name} onDone=${done} onToken=${onToken} />
      <p class="hint">Id ${drone.drone_id}</p>
    </dialog>`;
}
