// The map: the network, what is closed, the drones, and the plan of the drone that is open.

import {effect} from "@preact/signals";
import {useEffect} from "preact/hooks";

import {closedThen} from "../closed.js";
import {html} from "../html.js";
import {picture} from "../live.js";
import {showPreviews} from "../map/preview_layer.js";
import {useFleetMap} from "../map/use_fleet_map.js";
import {openView} from "../routes.js";
import {useNetwork} from "../use_network.js";
import {DronePanel} from "../parts/drone_panel.js";
import {EmptyHint} from "../parts/empty_hint.js";
import {MapLegend} from "../parts/map_legend.js";
import {MapSearch} from "../parts/map_search.js";
import {say} from "../parts/messages.js";
import {StationPanel} from "../parts/station_panel.js";
import {ZonePanel, draftRing} from "../parts/zone_panel.js";

// How soon a network that somebody publishes can be chosen.
const NETWORKS_EVERY_MS = 5_000;

function openClicked({droneId, stationId, position}) {
  if (draftRing.value) draftRing.value = [...draftRing.value, position];
  else if (droneId) openView("map", "drone", droneId);
  else if (stationId) openView("map", "station", stationId);
}

function useOpened(map, opened, station) {
  useEffect(() => {
    map.current.drones.select(opened);
    const shown = picture.drones.peek()[opened];
    if (shown) map.current.reveal(shown.position);
    return effect(() => {
      const drone = picture.drones.value[opened];
      map.current.showPlan(picture.missions.value[drone?.mission_id], drone);
    });
  }, [opened]);
  useEffect(() => map.current.openStation(station), [station]);
}

export function MapView({parts: [kind, id]}) {
  const {network, problem} = useNetwork(NETWORKS_EVERY_MS);
  const {map, element, shown} = useFleetMap({onClick: openClicked, isLive: true, network, begin: (made) => [
    effect(() => made.drones.show(picture.drones.value, picture.missions.value)),
    effect(() => made.showDraft(draftRing.value ?? [])),
    showPreviews(made),
  ]});
  useOpened(map, kind === "drone" ? id : null, kind === "station" ? id : null);
  useEffect(() => effect(() => map.current.showStations(picture.stations.value, closedThen.value)), [shown]);
  useEffect(() => void (problem && !network && say(problem, "refused")), [problem]);
  const close = () => openView("map");
  return html`
    <div class="map-view">
      ${element("Map of the fleet")}
      <${MapLegend} />
      <${MapSearch} network=${network} />
      ${kind === undefined && html`<${EmptyHint} />`}
      ${kind === "drone" && html`<${DronePanel} key=${id} droneId=${id} onClose=${close} />`}
      ${kind === "station" && html`
        <${StationPanel} key=${id} stationId=${id} network=${network} onClose=${close} />`}
      ${kind === "zone" && html`
        <div class="crosshair" aria-hidden="true"></div>
        <${ZonePanel} centre=${() => map.current.centre()} onClose=${close} />`}
    </div>`;
}
