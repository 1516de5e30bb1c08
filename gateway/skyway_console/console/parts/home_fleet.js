// Tiles that operators and providers share: drones by state, their work today, alarms, kept promises.

import {fleetNow} from "../fleet_clock.js";
import {droneName} from "../drone_names.js";
import {html} from "../html.js";
import {openAlarms, picture} from "../live.js";
import {pathTo} from "../routes.js";
import {StateText, stateHint, stateName, statesOf} from "../state_words.js";
import {useReadPath} from "../use_read.js";
import {distanceText, durationText, inWords, percent} from "../words.js";
import {SplitBar, hoursOfToday} from "./home_charts.js";
import {Tile} from "./tile.js";

const AGAIN_MS = 30_000;
const ALARMS_SHOWN = 4;
const LEVELS = ["CRITICAL", "URGENT", "WARNING"];

const DRONE_KINDS = {
  AVAILABLE: "fine", ON_MISSION: "accent", RESERVED: "accent faint", RECHARGING: "quiet", OFFLINE: "warn",
  GROUNDED: "danger", MAINTENANCE: "quiet faint", REGISTERED: "quiet faint",
};

const fromMidnight = () => new Date(hoursOfToday(fleetNow())[0]).toISOString();

// What the deliveries of today add up to; null before the first answer.
export const useDeliveriesToday = () =>
  useReadPath(`/v1/stats/deliveries?bucket=hour&from=${fromMidnight()}`, {everyMs: AGAIN_MS}).answer;

export function DronesTile({kind}) {
  const drones = Object.values(picture.drones.value);
  const counts = statesOf("drone").map((state) => ({
    name: stateName("drone", state).toLowerCase(), hint: stateHint("drone", state), kind: DRONE_KINDS[state],
    count: drones.filter((each) => each.state === state).length,
  }));
  // A drone that has never reported has no charge yet.
  const charges = drones.map(({soc}) => soc).filter((soc) => soc !== undefined);
  const charge = charges.reduce((sum, soc) => sum + soc, 0) / charges.length;
  return html`
    <${Tile} title="Drones" figure=${drones.length} unit=${charges.length > 0 && `with ${percent(charge)} charge on average`}
      href=${pathTo("fleet")} kind=${kind} feeds="feeds-drones">
      ${drones.length === 0 ? html`<p>No drone is registered. Register one at
        ${" "}<a href=${pathTo("fleet")}>Fleet</a>.</p>` : html`<${SplitBar} label="Drones by state" parts=${counts} />`}
    </${Tile}>`;
}

export function WorkTile() {
  const {answer} = useReadPath(`/v1/stats/drones?limit=1&from=${fromMidnight()}`, {everyMs: AGAIN_MS});
  if (!answer) return null;
  const {flying_s: flying, recharging_s: recharging, missions, utilisation} = answer.total;
  return html`
    <${Tile} title="Flights today" figure=${durationText(flying)} unit="in the air" feeds="feeds-missions">
      <p>${missions} ${missions === 1 ? "mission" : "missions"}. Drones recharged for ${durationText(recharging)}${
        utilisation === null ? "." : ` and were busy for ${percent(utilisation)} of the time.`}</p>
    </${Tile}>`;
}

const shareText = (share) => (share === null ? "–" : percent(share));

export function PromisesTile({today}) {
  if (!today) return null;
  const {on_time_share: onTime, p90_share: kept, packages_delivered: packages, packages_with_p90: promised} = today;
  const isLow = onTime !== null && onTime < 0.9;
  return html`
    <${Tile} title="On time today" figure=${shareText(onTime)} kind=${isLow ? "warn" : ""}
      unit=${`of ${packages} ${packages === 1 ? "package" : "packages"}`} feeds="feeds-deliveries">
      <p>${kept === null ? "No package with a P90 was delivered today."
        : `${percent(kept)} of ${promised} packages came by their P90. 88 to 92 % is as it should be.`}</p>
    </${Tile}>`;
}

const alarmLine = ({alarm_id: id, level, code, drone_id: drone, at}) => html`
  <li key=${id}><span class="tag ${level}"><${StateText} kind="alarmLevel" of=${level} /></span>
    ${" "}${inWords(code)}${drone ? html`, <a href=${pathTo("map", "drone", drone)}>${droneName(drone)}</a>` : ""}
    ${" "}<small>${distanceText(at)}</small></li>`;

export function AlarmsTile() {
  const open = openAlarms.value;
  const counted = LEVELS.map((level) => ({
    name: stateName("alarmLevel", level).toLowerCase(), hint: stateHint("alarmLevel", level),
    kind: {CRITICAL: "danger", URGENT: "warn", WARNING: "quiet"}[level],
    count: open.filter((each) => each.level === level).length,
  }));
  const first = [...open].sort((one, other) => LEVELS.indexOf(one.level) - LEVELS.indexOf(other.level));
  return html`
    <${Tile} title="Alarms" figure=${open.length} unit="open" href=${pathTo("alarms")} feeds="feeds-missions"
      kind=${`large ${counted[0].count ? "danger" : counted[1].count ? "warn" : ""}`}>
      ${open.length === 0 ? html`<p>No alarm is open. You need not do anything.</p>` : html`
        <${SplitBar} label="Open alarms by urgency" parts=${counted} />
        <ul class="lines">${first.slice(0, ALARMS_SHOWN).map(alarmLine)}</ul>`}
    </${Tile}>`;
}
