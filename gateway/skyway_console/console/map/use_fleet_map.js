// A map of the fleet in a view: made with the view, and removed with it.

import {useEffect, useRef, useState} from "preact/hooks";

import {html} from "../html.js";
import {FleetMap} from "./fleet_map.js";

// `begin(map)` answers functions that end what it began. The answer is the map, a function that makes its
// element, and the network that is on it, or null.
export function useFleetMap({onClick, isLive = false, network = null, begin = () => []}) {
  const [container, map, click] = [useRef(null), useRef(null), useRef(onClick)];
  const [shown, setShown] = useState(null);
  click.current = onClick;
  useEffect(() => {
    const made = new FleetMap(container.current, (found) => click.current(found), {isLive});
    map.current = made;
    // Stories in tests look at the map.
    container.current.fleetMap = made;
    const ends = begin(made);
    return () => {
      ends.forEach((end) => end());
      made.remove();
    };
  }, []);
  useEffect(() => {
    let isOld = false;
    if (network) {
      map.current.isReady.then(() => {
        if (isOld) return;
        map.current.showNetwork(network);
        setShown(network);
      });
    }
    return () => (isOld = true);
  }, [network]);
  const element = (label) => html`<div class="map" ref=${container} role="application" aria-label=${label}></div>`;
  return {map, element, shown};
}
