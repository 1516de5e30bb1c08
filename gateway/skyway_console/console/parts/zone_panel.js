// Closing an area: its corners are clicked on the map.

import {signal} from "@preact/signals";
import {useLayoutEffect} from "preact/hooks";

import {html} from "../html.js";
import {shownNetwork} from "../networks.js";
import {STOP_MOMENTS, askToClose} from "./closures.js";
import {Panel} from "./panel.js";

// The corners so far, [longitude, latitude] in degrees; null while nobody draws.
export const draftRing = signal(null);

const closed = (ring) => ({type: "Polygon", coordinates: [[...ring, ring[0]]]});

// `centre` answers the middle of the map, which the arrow keys move.
export function ZonePanel({centre, onClose}) {
  // Before the panel is seen: a click while it is there is a corner.
  useLayoutEffect(() => {
    draftRing.value = [];
    return () => (draftRing.value = null);
  }, []);
  const ring = draftRing.value ?? [];
  const order = () => ({network_id: shownNetwork.value, area: closed(ring)});
  const stop = () =>
    askToClose("Ground stop in this area", "/v1/ground-stops", order(), STOP_MOMENTS);
  const zone = () => askToClose("Close this area", "/v1/zones", order());
  return html`
    <${Panel} title="Close an area" onClose=${onClose}>
      <p>Click its corners on the map, or move the map and take its middle.
        ${" "}${ring.length} ${ring.length === 1 ? "corner" : "corners"}.</p>
      <div class="commands">
        <button onClick=${() => (draftRing.value = [...ring, centre()])}>Corner at the middle</button>
        <button disabled=${ring.length < 3} onClick=${zone}>Close to flights…</button>
        <button disabled=${ring.length < 3} onClick=${stop}>Forbid take-offs…</button>
        <button class="quiet" disabled=${ring.length === 0} onClick=${() => (draftRing.value = [])}>
          Begin again
        </button>
      </div>
    </${Panel}>`;
}
