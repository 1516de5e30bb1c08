// What a command would change, for the map: lines where drones would fly, and the places that it is about.

import {signal} from "@preact/signals";

import {picture} from "./live.js";

const NOTHING = {lines: [], places: []};

// `lines` are pairs of positions, `places` have a position and a kind: "landing", "closed" or "drone".
export const preview = signal(NOTHING);

// Whether a map is open that draws it.
export const hasMap = signal(false);

export const isPreviewed = () => hasMap.value && preview.value.places.length > 0;

export const forgetPreview = () => (preview.value = NOTHING);

const positionOf = (stationId) => picture.stations.value[stationId]?.position;

const placed = (places) => places.filter(({position}) => position);

// Where the drone of a mission would land next; a drone that stands stays where it is.
export function previewLanding(droneId, stationId) {
  const [drone, landing] = [picture.drones.value[droneId]?.position, positionOf(stationId)];
  preview.value = {
    lines: drone && landing ? [[drone, landing]] : [],
    places: placed([{kind: "drone", position: drone}, {kind: "landing", position: landing}]),
  };
}

// What would be closed, and the drones that would get another plan.
export function previewClosure({station_id: station, from_id: from, to_id: to, affected_missions: missions}) {
  const ends = [from, to].map(positionOf);
  const closed = [...ends, positionOf(station)].map((position) => ({kind: "closed", position}));
  const drones = missions.map(({drone_id: drone}) => (
    {kind: "drone", position: picture.drones.value[drone]?.position}));
  preview.value = {lines: ends.every(Boolean) ? [ends] : [], places: placed([...closed, ...drones])};
}
