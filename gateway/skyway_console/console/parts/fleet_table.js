// The drones of a provider, one line each: how it is, its charge, its home, and a menu.

import {useState} from "preact/hooks";

import {droneName} from "../drone_names.js";
import {html} from "../html.js";
import {picture} from "../live.js";
import {pathTo} from "../routes.js";
import {StateText, stateName} from "../state_words.js";
import {inWords, modelName, percent, stationName} from "../words.js";
import {DroneMenu} from "./drone_menu.js";
import {Icon} from "./icons.js";
import {ShareBar} from "./share_bar.js";

const LOW_CHARGE = 0.2;

const faultName = (fault) => inWords(typeof fault === "string" ? fault : fault.code);

const troubles = ({faults = [], maintenance}) =>
  [...faults.map(faultName), maintenance?.due_since_at && "Due for maintenance, gets no missions"].filter(Boolean);

// What a drone does beside its state; "" where the state says it.
const doesText = (state, activity) =>
  (!activity || activity === "IDLE" || activity === state ? "" : `, ${stateName("droneActivity", activity).toLowerCase()}`);

function DroneRow({drone, onMenu}) {
  const {drone_id: droneId, name, registration, model_id: model, home_station_id: home, state, activity, soc} = drone;
  const shown = droneName(droneId, name);
  const found = troubles(drone);
  return html`
    <tr data-drone=${droneId}>
      <td class="title"><a href=${pathTo("map", "drone", droneId)}>${shown}</a>${registration && html` <small>${registration}</small>`}</td>
      <td data-label="Model">${modelName(model)}</td>
      <td class="state" data-label="State"><${StateText} kind="drone" of=${state} />${doesText(state, activity)}</td>
      <td class="charge" data-label="Charge"><span>${percent(soc)}</span>
        <${ShareBar} share=${soc} kind=${soc < LOW_CHARGE ? "low" : "charge"} /></td>
      <td data-label="Home">${stationName(home)}</td>
      <td class="troubles" data-label="Trouble">${found.map((each) => html`<span class="tag URGENT">${each}</span> `)}</td>
      <td class="row-menu"><button class="quiet" aria-label=${`What to do with ${shown}`} aria-haspopup="dialog"
        onClick=${() => onMenu(droneId)}><${Icon} name="dots" /></button></td>
    </tr>`;
}

// A drone of the list as the live picture shows it now.
const upToDate = (drone) => ({...drone, ...picture.drones.value[drone.drone_id]});

const nameOf = ({name, drone_id: id}) => droneName(id, name);
const byName = (one, other) => nameOf(one).localeCompare(nameOf(other), [], {numeric: true});

export function FleetTable({drones, onChange, onToken}) {
  const [opened, open] = useState(null);
  const chosen = drones.find(({drone_id: id}) => id === opened);
  if (drones.length === 0) {
    return html`<p class="empty">No drone is registered yet. Register the first one below: its token lets it enrol.</p>`;
  }
  return html`
    <div class="table feeds-drones"><table class="as-cards" aria-label="Drones">
      <thead><tr><th>Drone</th><th>Model</th><th>State</th><th>Charge</th><th>Home</th><th>Trouble</th>
        <th><span class="unseen">Menu</span></th></tr></thead>
      <tbody>
        ${[...drones].sort(byName).map((drone) => html`
          <${DroneRow} key=${drone.drone_id} drone=${upToDate(drone)} onMenu=${open} />`)}
      </tbody>
    </table></div>
    ${chosen && html`<${DroneMenu} key=${opened} drone=${upToDate(chosen)} onClose=${() => open(null)} onChange=${onChange}
      onToken=${onToken} />`}`;
}
