// The map of a request: clicks choose the pickup and the destinations.

import {effect} from "@preact/signals";
import {useEffect} from "preact/hooks";

import {closedThen} from "../closed.js";
import {picture} from "../live.js";
import {RequestMarks} from "../map/request_marks.js";
import {useFleetMap} from "../map/use_fleet_map.js";
import {choosePoint} from "./place_finder.js";
import {choose, draft, offeredWays} from "./request_draft.js";

export function RequestMap({network}) {
  const onClick = ({stationId, position}) => (stationId ? choose(stationId) : choosePoint(position, network));
  const {map, element, shown} = useFleetMap({onClick, isLive: true, network, begin: (made) => [
    effect(() => made.drones.show(picture.drones.value)),
  ]});
  useEffect(() => {
    if (!shown) return undefined;
    const marks = new RequestMarks(map.current);
    const stops = [
      effect(() => map.current.showStations(picture.stations.value, closedThen.value)),
      effect(() => marks.show(shown, draft.value, offeredWays.value)),
    ];
    return () => stops.forEach((stop) => stop());
  }, [shown]);
  return element("Map of the request: click the pickup, then the destinations");
}
