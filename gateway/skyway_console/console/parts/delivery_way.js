// The way of a delivery on a map, with the drones that fly it now.

import {effect} from "@preact/signals";
import {useEffect, useRef} from "preact/hooks";

import {html} from "../html.js";
import {picture} from "../live.js";
import {useFleetMap} from "../map/use_fleet_map.js";
import {WayLayer} from "../map/way_layer.js";
import {openView} from "../routes.js";
import {useReadPath} from "../use_read.js";

const AGAIN_MS = 5_000;

const dronesOf = (track) => new Set(track.features
  .filter(({properties}) => properties.kind === "DRONE").map(({properties}) => properties.drone_id));

const openDrone = ({droneId}) => droneId && openView("map", "drone", droneId);

function useWayMap(track) {
  const way = useRef(null);
  const {map, element} = useFleetMap({onClick: openDrone, begin: (made) => {
    // A page that scrolls keeps scrolling over the map: two fingers or Ctrl move the map.
    made.map.cooperativeGestures.enable();
    way.current = new WayLayer(made);
    return [];
  }});
  useEffect(() => {
    if (track === null) return undefined;
    let isGone = false;
    map.current.isReady.then(() => isGone || way.current.show(track));
    const ids = dronesOf(track);
    const stop = effect(() => map.current.drones.show(Object.fromEntries(
      Object.entries(picture.drones.value).filter(([id]) => ids.has(id)))));
    return () => {
      isGone = true;
      stop();
    };
  }, [track]);
  return element("Map of the delivery's way");
}

export function DeliveryWay({path, isOver}) {
  const {answer: track} = useReadPath(`${path}/track`, {changed: isOver, everyMs: isOver ? null : AGAIN_MS});
  const map = useWayMap(track);
  const hasWay = track?.features.length > 0;
  return html`
    <div class="way-frame">
      ${map}
      ${track && !hasWay && html`<p class="way-hint">The way stands here when a plan is found.</p>`}
    </div>`;
}
