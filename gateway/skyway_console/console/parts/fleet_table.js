// The drones of a provider, one line each: how it is, its charge, its home, and a menu.

import {useState} from "preact/hooks";

import {droneName} from "../drone_names.js";
import {html} from "../html.js";
import {picture} from "../live.js";
import {pathTo} from "../routes.js";
import {StateText, stateName} from "../state_words.js";
import {faultName, modelName, percent, stationName} from "../words.js";
import {DroneMenu} from "./drone_menu.js";
import {Icon} from "./icons.js";
import {ShareBar} from "./share_bar.js";
import {Table, unseen} from "./table.js";

const LOW_CHARGE = 0.2;

const troubles = ({faults = [], maintenance}) =>
  [...faults.map(faultName), maintenance?.due_since_at && "Due for maintenance, gets no missions"].filter(Boolean);

// What a drone does beside its state; "" where the state says it.
const doesText = (state, activity) =>
  (!activity || activity === "IDLE" || activity === state ? "" : `, ${stateName("droneActivity", activity).toLowerCase()}`);

const nameOf = ({name, drone_id: id}) => droneName(id, name);
const byName = (one, other) => nameOf(one).localeCompare(nameOf(other), [], {numeric: true});

const COLUMNS = [
  ["Drone", (drone) => html`<a href=${pathTo("map", "drone", drone.drone_id)}>${nameOf(drone)}</a>${
    drone.registration && html` <small>${drone.registration}</small>`}`, "title"],
  ["Model", ({model_id: model}) => modelName(model)],
  ["State", ({state, activity}) => html`<${StateText} kind="drone" of=${state} />${doesText(state, activity)}`, "state"],
  ["Charge", ({soc}) => html`<span>${percent(soc)}</span>
    <${ShareBar} share=${soc} kind=${soc < LOW_CHARGE ? "low" : "charge"} />`, "charge"],
  ["Home", ({home_station_id: home}) => stationName(home)],
  ["Trouble", (drone) => troubles(drone).map((each) => html`<span class="tag URGENT">${each}</span> `), "troubles"],
];

// A drone of the list as the live picture shows it now.
const upToDate = (drone) => ({...drone, ...picture.drones.value[drone.drone_id]});

export function FleetTable({drones, onChange, onToken}) {
  const [opened, open] = useState(null);
  const menu = [unseen("Menu"), (drone) => html`<button class="quiet" aria-label=${`What to do with ${nameOf(drone)}`}
    aria-haspopup="dialog" onClick=${() => open(drone.drone_id)}><${Icon} name="dots" /></button>`, "row-menu"];
  const chosen = drones.find(({drone_id: id}) => id === opened);
  if (drones.length === 0) {
    return html`<p class="empty">No drone is registered yet. Register the first one below: its token lets it enrol.</p>`;
  }
  return html`
    <${Table} label="Drones" feeds="feeds-drones" items=${[...drones].sort(byName).map(upToDate)} columns=${[...COLUMNS, menu]}
      row=${({drone_id: id}) => ({key: id, "data-drone": id})} />
    ${chosen && html`<${DroneMenu} key=${opened} drone=${upToDate(chosen)} onClose=${() => open(null)} onChange=${onChange}
      onToken=${onToken} />`}`;
}
