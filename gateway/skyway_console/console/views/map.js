// The map: the network, what is closed, the drones, and the plan of the drone that is open.

import {effect} from "@preact/signals";
import {useEffect, useRef, useState} from "preact/hooks";

import {closedThen} from "../closed.js";
import {html} from "../html.js";
import {picture} from "../live.js";
import {FleetMap} from "../map/fleet_map.js";
import {showPreviews} from "../map/preview_layer.js";
import {listNetworks, networkContent, shownNetwork} from "../networks.js";
import {openView} from "../routes.js";
import {DronePanel} from "../parts/drone_panel.js";
import {EmptyHint} from "../parts/empty_hint.js";
import {MapLegend} from "../parts/map_legend.js";
import {MapSearch} from "../parts/map_search.js";
import {attempt} from "../parts/messages.js";
import {StationPanel} from "../parts/station_panel.js";
import {ZonePanel, draftRing} from "../parts/zone_panel.js";

// How soon a network that somebody publishes can be chosen.
const NETWORKS_EVERY_MS = 5_000;

function openClicked({droneId, stationId, position}) {
  if (draftRing.value) draftRing.value = [...draftRing.value, position];
  else if (droneId) openView("map", "drone", droneId);
  else if (stationId) openView("map", "station", stationId);
}

function useFleetMap(container, opened, station) {
  const map = useRef(null);
  useEffect(() => {
    const made = new FleetMap(container.current, openClicked, {isLive: true});
    map.current = made;
    const stops = [
      effect(() => made.drones.show(picture.drones.value, picture.missions.value)),
      effect(() => made.showStations(picture.stations.value, closedThen.value)),
      effect(() => made.showDraft(draftRing.value ?? [])),
      showPreviews(made),
    ];
    // Stories in tests count the frames that were drawn.
    container.current.fleetMap = made;
    return () => {
      stops.forEach((stop) => stop());
      made.remove();
    };
  }, []);
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
  return map;
}

// The content of the shown network, which is on the map then.
function useNetwork(map) {
  const [network, setNetwork] = useState(null);
  const networkId = shownNetwork.value;
  useEffect(() => {
    attempt(listNetworks);
    const timer = setInterval(() => listNetworks().catch(() => null), NETWORKS_EVERY_MS);
    return () => clearInterval(timer);
  }, []);
  useEffect(() => {
    if (networkId === null) return;
    attempt(async () => {
      const content = await networkContent(networkId);
      setNetwork(content);
      await map.current.isReady;
      map.current.showNetwork(content);
      map.current.showStations(picture.stations.value, closedThen.value);
    });
  }, [networkId]);
  return network;
}

export function MapView({parts: [kind, id]}) {
  const container = useRef(null);
  const map = useFleetMap(container, kind === "drone" ? id : null, kind === "station" ? id : null);
  const network = useNetwork(map);
  const close = () => openView("map");
  return html`
    <div class="map-view">
      <div class="map" ref=${container} role="application" aria-label="Map of the fleet"></div>
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
