// A station: its pads with what is booked on them, and closing the station or a pad.

import {part} from "../api.js";
import {closureTimes, hasBegun} from "../closed.js";
import {ticks} from "../fleet_clock.js";
import {html} from "../html.js";
import {picture} from "../live.js";
import {stationsOf} from "../map/features.js";
import {isOperator} from "../session.js";
import {useReadPath} from "../use_read.js";
import {momentText, shortId, stationName} from "../words.js";
import {askToClose, askToOpen, closureName} from "./closures.js";
import {Facts} from "./facts.js";
import {Panel} from "./panel.js";

const AGAIN_MS = 5_000;

function Pad({stationId, pad, entries}) {
  const path = `/v1/stations/${part(stationId)}/pads/${pad}/outages`;
  const close = () => askToClose(`Close pad ${pad} of ${stationName(stationId)}`, path);
  return html`
    <li>
      <strong>Pad ${pad}</strong>
      ${isOperator() && html`<button class="small" onClick=${close}>Close pad ${pad}</button>`}
      <ul class="bookings">
        ${entries.slice(0, 4).map(({start_at, end_at, mission_id}) => html`
          <li>${momentText(start_at)} to ${momentText(end_at)}
            ${mission_id && ` · mission ${shortId(mission_id)}`}</li>`)}
        ${entries.length === 0 && html`<li>Nothing is booked.</li>`}
        ${entries.length > 4 && html`<li>and ${entries.length - 4} more</li>`}
      </ul>
    </li>`;
}

function OpenClosures({stationId}) {
  ticks.value; // read so that a closure begins by itself
  const closures = Object.entries(picture.closures.value)
    .filter(([, closure]) => closure.station_id === stationId);
  return closures.map(([closureId, closure]) => html`
    <p class="closure" key=${closureId}>${closureName(closure)}${" "}
      ${hasBegun(closure) ? "is" : "will be"} closed ${closureTimes(closure)}${
      closure.reason ? `: ${closure.reason}` : "."}
      ${isOperator() && html`
        <button class="small" onClick=${() => askToOpen(closureId, closure)}>Open again</button>`}
    </p>`);
}

// The segments that begin at a station. A closure of one holds in its direction only.
function Segments({stationId, network}) {
  const ends = (network?.features ?? [])
    .filter(({properties: {kind, from}}) => kind === "segment" && from === stationId)
    .map(({properties: {to}}) => to).sort();
  const close = (to) => askToClose(`Close the segment ${stationName(stationId)} – ${stationName(to)}`,
    `/v1/segments/${part(stationId)}/${part(to)}/closures`);
  return ends.length > 0 && html`
    <details>
      <summary>Segments from here</summary>
      <ul class="pads">
        ${ends.map((to) => html`
          <li key=${to}>to ${stationName(to)}${" "}
            <button class="small" aria-label=${`Close the segment to ${stationName(to)}`}
              onClick=${() => close(to)}>Close</button></li>`)}
      </ul>
    </details>`;
}

export function StationPanel({stationId, network, onClose}) {
  const {answer: schedule} = useReadPath(`/v1/stations/${part(stationId)}/schedule`, {everyMs: AGAIN_MS});
  const live = picture.stations.value[stationId];
  const known = network && stationsOf(network)
    .find(({properties}) => properties.station_id === stationId)?.properties;
  const path = `/v1/stations/${part(stationId)}/closures`;
  const close = () => askToClose(`Close ${stationName(stationId)}`, path);
  return html`
    <${Panel} title=${known?.name ?? stationName(stationId)} label="Station" onClose=${onClose}>
      <${Facts} of=${[
        ["Pads", live?.pads ?? known?.pads],
        ["Taken now", live?.pads_taken ?? 0],
        ["Drones that wait", live?.queue > 0 && live.queue],
        ["Free at", live?.next_free_at && momentText(live.next_free_at)],
      ]} />
      <${OpenClosures} stationId=${stationId} />
      ${isOperator() && html`
        <button onClick=${close}>Close the station</button>
        <${Segments} stationId=${stationId} network=${network} />`}
      <ul class="pads">
        ${(schedule?.pads ?? []).map(({pad, entries}) => html`
          <${Pad} key=${pad} stationId=${stationId} pad=${pad} entries=${entries} />`)}
      </ul>
    </${Panel}>`;
}
