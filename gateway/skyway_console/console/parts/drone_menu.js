// What a provider can do with a drone, each with a sentence that says what happens then.

import {part, post} from "../api.js";
import {droneName} from "../drone_names.js";
import {html} from "../html.js";
import {pathTo} from "../routes.js";
import {percent} from "../words.js";
import {droneQuestions} from "./drone_questions.js";
import {attempt} from "./messages.js";
import {useModal} from "./panel.js";

// What its flights have shown about a drone, against its model.
const learnedText = ({planned, flights}) =>
  `${flights} flights have shown: energy use ${percent(planned.still_air_factor)}, battery `
  + `${percent(planned.state_of_health)}, charging ${percent(planned.charge_rate_factor)} of the model's.`;

const Choice = ({text, verb, label, onChoose}) => html`
  <li><p>${text}</p><button aria-label=${label} onClick=${onChoose}>${verb}</button></li>`;

// `onChosen` is called before a question is asked or a token is made, and `onChange` after something was done.
function Choices({drone, name, onChosen, onChange, onToken}) {
  const {drone_id: droneId, provider_id: provider, state, learned, maintenance} = drone;
  const path = `/v1/providers/${part(provider)}/drones/${part(droneId)}`;
  const questions = droneQuestions(path, name, onChange);
  const chosen = (action) => () => {
    onChosen();
    action();
  };
  const token = () => attempt(async () => onToken(name, await post(`${path}/enrolment-tokens`)));
  const service = state === "MAINTENANCE"
    ? html`<${Choice} text="It can get missions again." verb="Back in service" label=${`Put ${name} back in service`}
        onChoose=${chosen(questions.putBack)} />`
    : html`<${Choice} text="It gets no more missions until you put it back in service." verb="Into maintenance"
        label=${`Take ${name} into maintenance`} onChoose=${chosen(questions.maintain)} />`;
  return html`
    <ul class="choices-list">
      ${service}
      ${maintenance?.due_since_at && html`<${Choice} text="It is due for maintenance and gets no missions until then."
        verb="Maintained" label=${`The maintenance of ${name} was done`} onChoose=${chosen(questions.wasMaintained)} />`}
      <${Choice} text="A new drone computer exchanges the token once for its own credentials."
        verb="Enrolment token" label=${`Another enrolment token for ${name}`} onChoose=${chosen(token)} />
      ${learned && html`<${Choice} text=${`${learnedText(learned)} Forget it after a repair or a new battery.`}
        verb="Forget" label=${`Forget what flights of ${name} have shown`} onChoose=${chosen(questions.forget)} />`}
    </ul>`;
}

// `onClose` is called when the menu is closed, and `onChange` after something was done.
export function DroneMenu({drone, onClose, onChange, onToken}) {
  const element = useModal();
  const name = droneName(drone.drone_id, drone.name);
  const close = () => element.current.close();
  const closeOutside = ({target}) => target === element.current && close();
  return html`
    <dialog class="sheet" ref=${element} aria-labelledby="drone-menu" onClose=${onClose} onClick=${closeOutside}>
      <header><h2 id="drone-menu">${name}</h2>
        <button class="quiet" aria-label="Close the menu" onClick=${close}>✕</button></header>
      <p><a href=${pathTo("map", "drone", drone.drone_id)}>See it on the map</a></p>
      <${Choices} drone=${drone} name=${name} onChosen=${close} onChange=${onChange} onToken=${onToken} />
      <p class="hint">Id ${drone.drone_id}</p>
    </dialog>`;
}
