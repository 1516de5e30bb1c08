// The map of a request: clicks choose the pickup and the destinations.

import {effect} from "@preact/signals";
import {useEffect, useRef} from "preact/hooks";

import {closedThen} from "../closed.js";
import {html} from "../html.js";
import {picture} from "../live.js";
import {FleetMap} from "../map/fleet_map.js";
import {RequestMarks} from "../map/request_marks.js";
import {choosePoint} from "./place_finder.js";
import {choose, draft, offeredWays} from "./request_draft.js";

export function RequestMap({network}) {
  const container = useRef(null);
  useEffect(() => {
    const map = new FleetMap(container.current, ({stationId, position}) =>
      (stationId ? choose(stationId) : choosePoint(position, network)), {isLive: true});
    const marks = new RequestMarks(map);
    // Stories in tests look for the place of a station on the screen.
    container.current.fleetMap = map;
    const stops = [effect(() => map.drones.show(picture.drones.value))];
    let isGone = false;
    map.isReady.then(() => {
      if (isGone) return;
      map.showNetwork(network);
      stops.push(
        effect(() => map.showStations(picture.stations.value, closedThen.value)),
        effect(() => marks.show(network, draft.value, offeredWays.value)),
      );
    });
    return () => {
      isGone = true;
      stops.forEach((stop) => stop());
      map.remove();
    };
  }, [network]);
  return html`
    <div class="map" ref=${container} role="application"
      aria-label="Map of the request: click the pickup, then the destinations"></div>`;
}
