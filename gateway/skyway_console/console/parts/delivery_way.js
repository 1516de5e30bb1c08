// The way of a delivery on a map, with the drones that fly it now.

import {effect} from "@preact/signals";
import {useEffect, useRef} from "preact/hooks";

import {html} from "../html.js";
import {picture} from "../live.js";
import {FleetMap} from "../map/fleet_map.js";
import {WayLayer} from "../map/way_layer.js";
import {openView} from "../routes.js";
import {useReadPath} from "../use_read.js";

const AGAIN_MS = 5_000;

const dronesOf = (track) => new Set(track.features
  .filter(({properties}) => properties.kind === "DRONE").map(({properties}) => properties.drone_id));

function useWayMap(container, track) {
  const shown = useRef(null);
  useEffect(() => {
    const made = new FleetMap(container.current, ({droneId}) => droneId && openView("map", "drone", droneId));
    // A page that scrolls keeps scrolling over the map: two fingers or Ctrl move the map.
    made.map.cooperativeGestures.enable();
    shown.current = {made, way: new WayLayer(made)};
    container.current.fleetMap = made;
    return () => made.remove();
  }, []);
  useEffect(() => {
    if (track === null) return undefined;
    const {made, way} = shown.current;
    let isGone = false;
    made.isReady.then(() => isGone || way.show(track));
    const ids = dronesOf(track);
    const stop = effect(() => made.drones.show(Object.fromEntries(
      Object.entries(picture.drones.value).filter(([id]) => ids.has(id)))));
    return () => {
      isGone = true;
      stop();
    };
  }, [track]);
}

export function DeliveryWay({path, isOver}) {
  const container = useRef(null);
  const {answer: track} = useReadPath(`${path}/track`, {changed: isOver, everyMs: isOver ? null : AGAIN_MS});
  useWayMap(container, track);
  const hasWay = track?.features.length > 0;
  return html`
    <div class="way-frame">
      <div class="map" ref=${container} role="application" aria-label="Map of the delivery's way"></div>
      ${track && !hasWay && html`<p class="way-hint">The way stands here when a plan is found.</p>`}
    </div>`;
}
