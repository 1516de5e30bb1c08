// The loading desk: drones that wait for their packages; a person weighs them and confirms.

import {useState} from "preact/hooks";

import {all, part, post} from "../api.js";
import {droneName} from "../drone_names.js";
import {html} from "../html.js";
import {picture} from "../live.js";
import {stateName} from "../state_words.js";
import {useRead} from "../use_read.js";
import {momentText, shortId, stationName} from "../words.js";
import {attempt, say} from "./messages.js";

const AGAIN_MS = 2_000;
const OVER = ["COMPLETED", "ABORTED", "CANCELLED", "REFUSED"];

const isWaiting = (providerId) => ({provider_id: provider, state}) => provider === providerId && !OVER.includes(state);

// Where the packages are taken on board, and how much they weigh together by the request.
function pickupOf({plan: {steps}}) {
  const number = steps.findIndex(({kind}) => kind === "PICK_UP");
  const flight = steps.slice(number).find(({kind}) => kind === "FLY");
  return {stationId: steps[number]?.station_id, loadKg: flight?.load_kg};
}

// Whether the drone stands at the pickup and takes packages. Loading can be confirmed then only.
const isReady = (drone, stationId) => drone?.activity === "LOADING" && drone.station_id === stationId;

function whereText(drone, stationId) {
  if (isReady(drone, stationId)) return "The drone waits there.";
  return `The drone does not wait there yet${drone?.activity ? `: ${stateName("droneActivity", drone.activity).toLowerCase()}` : ""}.`;
}

async function confirmLoading(missionId, packages) {
  const {outcome, detail} = await post(`/v1/missions/${part(missionId)}/loading`, {packages});
  if (outcome === "CONFIRMED") say("Loading is confirmed. The drone takes off once its plan holds with these masses.");
  else say(`The mission has ended: ${detail}`, "refused");
}

function Mass({packageId}) {
  const [isMissing, setMissing] = useState(false);
  return html`
    <fieldset class="weighed">
      <legend>${packageId}</legend>
      <label>Measured mass in kg<input name=${packageId} type="number" min="0.001" max="1000" step="any" required
        aria-label=${`Measured mass of ${packageId} in kg`} disabled=${isMissing} /></label>
      <label class="check"><input type="checkbox" checked=${isMissing}
        aria-label=${`${packageId} is not here`}
        onChange=${({target}) => setMissing(target.checked)} /> It is not here</label>
    </fieldset>`;
}

function Waiting({mission, onDone}) {
  const {mission_id: missionId, drone_id: droneId, start_at: start} = mission;
  const packageIds = mission.packages.map(({package_id}) => package_id).sort();
  const {stationId, loadKg} = pickupOf(mission);
  const drone = picture.drones.value[droneId];
  async function confirm(event) {
    event.preventDefault();
    // A disabled field is not part of the form's data: that package is missing.
    const masses = [...new FormData(event.target)].map(([package_id, mass]) =>
      ({package_id, mass_kg: Number(mass)}));
    await attempt(() => confirmLoading(missionId, masses));
    onDone();
  }
  return html`
    <li>
      <form class="fields desk" aria-label=${`Load ${droneName(droneId)}`} onSubmit=${confirm}>
        <h3>${droneName(droneId)} at ${stationId ? stationName(stationId) : "its pickup"}</h3>
        <p class="hint">Mission ${shortId(missionId)}, since ${momentText(start)}. ${whereText(drone, stationId)}
          ${loadKg === undefined ? "" : ` By the request ${Number(loadKg.toFixed(3))} kg in all.`}</p>
        ${packageIds.map((each) => html`<${Mass} key=${each} packageId=${each} />`)}
        <div class="commands"><button class="main" disabled=${!isReady(drone, stationId)}>Confirm loading</button></div>
      </form>
    </li>`;
}

export function LoadingDesk({providerId}) {
  const {answer, problem, again} = useRead(() => all("/v1/missions?loading=AWAITED"), {everyMs: AGAIN_MS});
  const missions = answer?.filter(isWaiting(providerId));
  return html`
    ${problem && html`<p class="refused">${problem}</p>`}
    ${missions?.length === 0 && html`<p class="empty">No drone waits for its packages. Drones wait here if their provider
      confirms loading by hand.</p>`}
    <ul class="cards" aria-label="Drones that wait">
      ${(missions ?? []).map((mission) => html`
        <${Waiting} key=${mission.mission_id} mission=${mission} onDone=${again} />`)}
    </ul>`;
}
