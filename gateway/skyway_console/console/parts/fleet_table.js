// The drones of a provider: how each is, taking it out of service and back, another token.

import {part, post} from "../api.js";
import {droneName} from "../drone_names.js";
import {html} from "../html.js";
import {picture} from "../live.js";
import {pathTo} from "../routes.js";
import {inWords, percent, stationName} from "../words.js";
import {droneQuestions} from "./drone_questions.js";
import {attempt} from "./messages.js";
import {ShareBar} from "./share_bar.js";

const LOW_CHARGE = 0.2;

const faultName = (fault) => inWords(typeof fault === "string" ? fault : fault.code);

// What its flights have shown about a drone, against its model.
const learnedText = ({planned, flights}) =>
  `energy use ${percent(planned.still_air_factor)}, battery ${percent(planned.state_of_health)}, `
  + `charging ${percent(planned.charge_rate_factor)} of the model's, learned from ${flights} flights`;

function Commands({drone, onChange, onToken}) {
  const {drone_id: droneId, provider_id: provider, state, learned, maintenance} = drone;
  const path = `/v1/providers/${part(provider)}/drones/${part(droneId)}`;
  const name = droneName(droneId, drone.name);
  const questions = droneQuestions(path, name, onChange);
  const token = () => attempt(async () => onToken(name, await post(`${path}/enrolment-tokens`)));
  return html`
    <div class="commands">
      ${state === "MAINTENANCE"
        ? html`<button class="small" aria-label=${`Put ${name} back in service`}
            onClick=${questions.putBack}>Back in service</button>`
        : html`<button class="small" aria-label=${`Take ${name} into maintenance`}
            onClick=${questions.maintain}>
            Into maintenance</button>`}
      <button class="small" aria-label=${`Another enrolment token for ${name}`} onClick=${token}>
        Enrolment token</button>
      ${learned && html`<button class="small" aria-label=${`Forget what flights of ${name} have shown`}
        onClick=${questions.forget}>Forget</button>`}
      ${maintenance?.due_since_at && html`<button class="small" aria-label=${`The maintenance of ${name} was done`}
        onClick=${questions.wasMaintained}>Maintained</button>`}
    </div>`;
}

function DroneRow({drone, onChange, onToken}) {
  const {drone_id: droneId, name, registration, model_id: model, home_station_id: home} = drone;
  const {state, activity, soc, learned, maintenance, faults = []} = drone;
  return html`
    <tr data-drone=${droneId}>
      <td><a href=${pathTo("map", "drone", droneId)}>${droneName(droneId, name)}</a>
        <br /><small>${registration ?? ""}</small></td>
      <td>${model}<br /><small>home ${stationName(home)}</small>
        ${learned && html`<br /><small>${learnedText(learned)}</small>`}</td>
      <td class="state">${inWords(state)}${activity && activity !== "IDLE" ? html`
        <br /><small>${inWords(activity)}</small>` : ""}
        ${maintenance?.due_since_at && html`<br /><small class="late">due for maintenance, gets no missions</small>`}</td>
      <td>${percent(soc)}<${ShareBar} share=${soc} kind=${soc < LOW_CHARGE ? "low" : "charge"} /></td>
      <td class=${faults.length ? "late" : ""}>${faults.length ? faults.map(faultName).join(", ") : "none"}</td>
      <td><${Commands} drone=${drone} onChange=${onChange} onToken=${onToken} /></td>
    </tr>`;
}

// A drone of the list as the live picture shows it now.
const upToDate = (drone) => ({...drone, ...picture.drones.value[drone.drone_id]});

const nameOf = ({name, drone_id: id}) => droneName(id, name);
const byName = (one, other) => nameOf(one).localeCompare(nameOf(other), [], {numeric: true});

export const FleetTable = ({drones, onChange, onToken}) => html`
  <div class="table"><table aria-label="Drones">
    <thead><tr><th>Drone</th><th>Model</th><th>State</th><th>Charge</th><th>Faults</th><th>Commands</th></tr></thead>
    <tbody>
      ${[...drones].sort(byName).map((drone) => html`
        <${DroneRow} key=${drone.drone_id} drone=${upToDate(drone)} onChange=${onChange} onToken=${onToken} />`)}
      ${drones.length === 0 && html`<tr><td colspan="6">No drone is registered yet.</td></tr>`}
    </tbody>
  </table></div>`;
