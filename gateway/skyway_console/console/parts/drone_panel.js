// A drone: how it is, what it flies, its charge against the plan, and the commands to its mission.

import {ticks} from "../fleet_clock.js";
import {droneName} from "../drone_names.js";
import {html} from "../html.js";
import {guestsOf, picture} from "../live.js";
import {pathTo} from "../routes.js";
import {isOperator, session} from "../session.js";
import {distanceText, inWords, momentText, percent, shortId, stationName} from "../words.js";
import {ChargeChart} from "./charge_chart.js";
import {Facts} from "./facts.js";
import {MissionCommands} from "./mission_commands.js";
import {Panel} from "./panel.js";
import {StepList} from "./step_list.js";

function droneFacts(drone, mission) {
  const {next_landing: landing} = drone;
  return [
    ["State", drone.state && inWords(drone.state)],
    ["Does", drone.activity && inWords(drone.activity)],
    ["Charge", drone.soc !== undefined && percent(drone.soc)],
    ["At", drone.station_id && stationName(drone.station_id)],
    ["Lands next", landing && `${stationName(landing.station_id)}, ${distanceText(landing.at)}`],
    ["Could land", drone.safe_landings?.length > 0 && drone.safe_landings.map(stationName).join(", ")],
    ["Must land", drone.must_land_at && distanceText(drone.must_land_at)],
    ["Faults", drone.faults?.length > 0 && drone.faults.map(faultText).join(", ")],
    ["Mission", mission && `${inWords(mission.state)}${mission.is_held ? ", held" : ""}`],
    ["In doubt", mission?.doubt && inWords(mission.doubt)],
    ["Trouble", mission?.trouble && inWords(mission.trouble)],
    ["Last reading", drone.at && momentText(drone.at)],
  ];
}

const faultText = (fault) => (typeof fault === "string" ? inWords(fault) : inWords(fault.code));

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
      <${Facts} of=${droneFacts(drone, mission)} />
      ${mission && isOperator() && html`
        <${MissionCommands} missionId=${drone.mission_id} mission=${mission} />`}
      ${session.value.role !== "customer" && html`
        <${ChargeChart} droneId=${droneId} providerId=${drone.provider_id}
          missionId=${drone.mission_id} />`}
      ${flown.length > 1 && html`<p>A shared trip with packages of ${flown.length} deliveries.</p>`}
      ${flown.map((each) => html`
        <section key=${each.delivery_id}>
          <h3>Plan of <a href=${pathTo("deliveries", each.delivery_id)}>delivery
            ${" "}${shortId(each.delivery_id)}</a></h3>
          <${StepList} mission=${each} />
        </section>`)}
    </${Panel}>`;
}
