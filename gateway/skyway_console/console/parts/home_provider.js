// A provider's day: its drones, what they earn, and which maintenance comes next.

import {all, get, part} from "../api.js";
import {fleetNow} from "../fleet_clock.js";
import {droneName} from "../drone_names.js";
import {html} from "../html.js";
import {openAlarms, picture} from "../live.js";
import {pathTo} from "../routes.js";
import {session} from "../session.js";
import {useRead, useReadPath} from "../use_read.js";
import {money} from "../words.js";
import {Bars} from "./home_charts.js";
import {AlarmsTile, DronesTile, PromisesTile, WorkTile, useDeliveriesToday} from "./home_fleet.js";
import {ShareBar} from "./share_bar.js";
import {Tile} from "./tile.js";

const AGAIN_MS = 60_000;
const DAY_MS = 86_400_000;
const DAYS = 14;
const NEXT_SHOWN = 4;

const dayOf = (ms) => new Date(ms).toISOString().slice(0, 10);

function EarnedTile({path}) {
  const {answer} = useReadPath(`${path}/earnings`, {everyMs: AGAIN_MS});
  if (!answer) return null;
  const {currency, by_day: days} = answer;
  if (currency === null) {
    return html`<${Tile} title="Earned today" figure="0" href=${pathTo("fleet", "earnings")}>
      <p>No mission is settled yet. A mission pays when it ends.</p></${Tile}>`;
  }
  const amounts = Array.from({length: DAYS}, (_, number) => {
    const day = dayOf(fleetNow() - (DAYS - 1 - number) * DAY_MS);
    const amount = days.filter((each) => each.day === day && each.currency === currency)
      .reduce((sum, each) => sum + each.amount, 0);
    return {name: day, value: amount, text: money({amount, currency})};
  });
  return html`
    <${Tile} title="Earned today" figure=${amounts.at(-1).text} unit="since midnight UTC" kind="large"
      href=${pathTo("fleet", "earnings")}>
      <${Bars} label="Earnings of the last days" bars=${amounts} />
    </${Tile}>`;
}

// How much of its time until maintenance each drone has used, the most used first.
async function readMaintenance(path) {
  const [drones, rules] = await Promise.all([all(`${path}/drones`), get(`${path}/maintenance-rules`)]);
  const byModel = Object.fromEntries(rules.items.map((each) => [each.model_id, each]));
  return drones.map(({drone_id: id, name, model_id: model, maintenance}) => {
    const {every_flight_hours: hours, every_cycles: cycles} = byModel[model] ?? {};
    const shares = [hours && maintenance.flight_hours / hours, cycles && maintenance.cycles / cycles].filter(Boolean);
    const left = hours ? `${Math.max(0, hours - maintenance.flight_hours).toFixed(0)} flight hours left` : "counted by charges";
    return {id, name, share: shares.length ? Math.max(...shares) : null, isDue: maintenance.due_since_at !== null, left};
  }).filter(({share, isDue}) => share !== null || isDue).sort((one, other) => other.share - one.share);
}

function MaintenanceTile({path}) {
  const {answer} = useRead(() => readMaintenance(path), {key: path, everyMs: AGAIN_MS});
  if (!answer) return null;
  const due = answer.filter(({isDue}) => isDue).length;
  return html`
    <${Tile} title="Next maintenance" figure=${due} unit=${due === 1 ? "drone is due" : "drones are due"}
      kind=${due ? "warn" : ""} href=${pathTo("fleet")}>
      ${answer.length === 0 && html`<p>No model has a rule for its maintenance. Set one with${" "}
        <code>PUT /v1/providers/…/maintenance-rules</code>.</p>`}
      <ul class="lines">${answer.slice(0, NEXT_SHOWN).map(({id, name, share, isDue, left}) => html`
        <li key=${id}><a href=${pathTo("map", "drone", id)}>${droneName(id, name)}</a>
          ${" "}<small>${isDue ? "due now: it gets no missions" : left}</small>
          <${ShareBar} share=${share ?? 1} kind=${isDue ? "low" : "charge"} /></li>`)}</ul>
    </${Tile}>`;
}

function Headline() {
  const drones = Object.values(picture.drones.value);
  const flying = drones.filter(({state}) => state === "ON_MISSION").length;
  const away = drones.filter(({state}) => state === "OFFLINE" || state === "GROUNDED").length;
  const urgent = openAlarms.value.filter(({level}) => level !== "WARNING").length;
  const isFine = away + urgent === 0;
  const text = isFine ? `${flying} of ${drones.length} drones are on a mission, and none is in trouble.`
    : [away && `${away} of ${drones.length} drones cannot fly.`, urgent && `Urgent alarms: ${urgent}.`].filter(Boolean).join(" ");
  return html`<header class="headline ${isFine ? "fine" : "warn"}">
    <h1>${isFine ? "Your fleet is well" : "Your fleet needs you"}</h1><p>${text}</p></header>`;
}

export function ProviderHome() {
  const path = `/v1/providers/${part(session.value.subject_id)}`;
  const today = useDeliveriesToday();
  return html`
    <${Headline} />
    <div class="tiles">
      <${EarnedTile} path=${path} />
      <${DronesTile} />
      <${PromisesTile} today=${today} />
      <${AlarmsTile} />
      <${MaintenanceTile} path=${path} />
      <${WorkTile} />
    </div>`;
}
