// A drone: what it does in one sentence, how it is, its plan, and the commands to its mission.

import {fleetNow, fleetRate, ticks} from "../fleet_clock.js";
import {droneName} from "../drone_names.js";
import {html} from "../html.js";
import {guestsOf, picture} from "../live.js";
import {isOld} from "../map/drone_motion.js";
import {kilometres} from "../map/mercator.js";
import {pathTo} from "../routes.js";
import {isOperator, session} from "../session.js";
import {StateText} from "../state_words.js";
import {clockTime, distanceText, faultName, inWords, momentText, percent, shortId, stationName} from "../words.js";
import {ChargeChart} from "./charge_chart.js";
import {Facts} from "./facts.js";
import {copy} from "./messages.js";
import {MissionCommands} from "./mission_commands.js";
import {Panel} from "./panel.js";
import {StepList} from "./step_list.js";

const DOES = {RECHARGING: "Recharges", WAITING: "Waits", LOADING: "Takes packages on board",
  DELIVERING: "Hands packages over", IDLE: "Stands"};

// What it does now, in one sentence.
function doesText({activity = "IDLE", station_id: stationId, next_landing: landing}, mission) {
  if (activity === "FLYING") {
    return landing
      ? `Flies to ${stationName(landing.station_id)}, lands at ${clockTime(landing.at)}, ${
        distanceText(landing.at)}.`
      : "Is in flight.";
  }
  const step = Object.values(mission?.steps ?? {}).find(({status}) => status !== "ENDED");
  const ends = step?.kind === "FLY" ? step.start_at : step?.end_at;
  const place = stationId ? ` at ${stationName(stationId)}` : "";
  const until = ends && Date.parse(ends) > fleetNow() ? ` until ${clockTime(ends)}` : "";
  return `${DOES[activity] ?? inWords(activity)}${place}${until}.`;
}

// Old readings are said: the drone may be elsewhere, and its mark on the map is faint.
const OldReading = ({drone}) => isOld(drone, fleetNow(), fleetRate()) && html`
  <p class="old-reading" role="status">No reading since ${momentText(drone.at)}: it may be elsewhere.</p>`;

function droneFacts(drone, mission) {
  const kmh = drone.activity === "FLYING" && speedKmh(drone, mission);
  return [
    ["State", drone.state && html`<${StateText} kind="drone" of=${drone.state} />`],
    ["Charge", drone.soc !== undefined && percent(drone.soc)],
    ["Planned speed", kmh && `${kmh} km/h`],
    ["Could land", drone.safe_landings?.length > 0 && drone.safe_landings.map(stationName).join(", ")],
    ["Must land", drone.must_land_at && distanceText(drone.must_land_at)],
    ["Faults", drone.faults?.length > 0 && drone.faults.map(faultName).join(", ")],
    ["Mission", mission && html`<${StateText} kind="mission" of=${mission.state} />${mission.is_held ? ", held" : ""}`],
    ["In doubt", mission?.doubt && inWords(mission.doubt)],
    ["Trouble", mission?.trouble && inWords(mission.trouble)],
    ["Last reading", drone.at && momentText(drone.at)],
  ];
}

// The ground speed of the flight that goes on, by its plan.
function speedKmh(drone, mission) {
  const flight = Object.values(mission?.steps ?? {})
    .find(({kind, status}) => kind === "FLY" && status !== "ENDED");
  if (!flight?.from_position) return null;
  const hours = (Date.parse(flight.end_at) - Date.parse(flight.start_at)) / 3_600_000;
  return hours > 0 ? Math.round(kilometres(flight.from_position, flight.position) / hours) : null;
}

// "the delivery to Kirby and Selma", where somebody waits for it.
function deliveryText({delivery_id: deliveryId, steps}) {
  const ends = Object.values(steps).filter(({kind}) => kind === "DELIVER");
  const stations = new Set(ends.map(({station_id: stationId}) => stationId));
  const {reference} = picture.deliveries.value[deliveryId] ?? {};
  if (reference) return `delivery ${reference}`;
  return stations.size
    ? `the delivery to ${[...stations].map(stationName).join(", ")}` : `delivery ${shortId(deliveryId)}`;
}

export function DronePanel({droneId, onClose}) {
  ticks.value; // read so that "in 5 min" is right each second
  const drone = picture.drones.value[droneId];
  const title = `Drone ${droneName(droneId)}`;
  if (!drone) {
    return html`<${Panel} title=${title} onClose=${onClose}><p>It is not in the picture.</p></${Panel}>`;
  }
  const mission = picture.missions.value[drone.mission_id];
  const flown = mission ? [mission, ...guestsOf(drone.mission_id)] : [];
  return html`
    <${Panel} title=${title} onClose=${onClose}>
      <p class="does">${doesText(drone, mission)}</p>
      <${OldReading} drone=${drone} />
      <${Facts} of=${droneFacts(drone, mission)} />
      ${mission && isOperator() && html`
        <${MissionCommands} missionId=${drone.mission_id} mission=${mission} />`}
      ${session.value.role !== "customer" && html`
        <${ChargeChart} droneId=${droneId} providerId=${drone.provider_id}
          missionId=${drone.mission_id} />`}
      ${flown.length > 1 && html`<p>A shared trip with packages of ${flown.length} deliveries.</p>`}
      ${flown.map((each) => html`
        <section key=${each.delivery_id}>
          <h3>Plan of <a href=${pathTo("deliveries", each.delivery_id)}>${deliveryText(each)}</a></h3>
          <${StepList} mission=${each} />
        </section>`)}
      <p class="panel-id"><code>${droneId}</code>
        ${" "}<button class="small" onClick=${() => copy(droneId, "The id is copied.")}>Copy id</button></p>
    </${Panel}>`;
}
