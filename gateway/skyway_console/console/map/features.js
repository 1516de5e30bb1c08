// GeoJSON for the map's sources, from the network and from the live picture.

import {collection, feature, line} from "./geojson.js";

export const stationsOf = (network) =>
  network.features.filter(({properties}) => properties.kind === "station");

// The places of stations by their ids.
export const placesOf = (network) => Object.fromEntries(stationsOf(network)
  .map(({geometry, properties}) => [properties.station_id, geometry.coordinates]));

export function segmentLines(network) {
  return collection(network.features
    .filter(({properties}) => properties.kind === "segment")
    .map(({geometry, properties}) => line(geometry.coordinates, {from: properties.from, to: properties.to})));
}

// What is closed now, by station: true for the station, or the numbers of its pads.
function closedStations(closures) {
  const closed = {};
  for (const {kind, station_id, pad} of Object.values(closures)) {
    if (kind === "STATION") closed[station_id] = true;
    if (kind === "PAD" && closed[station_id] !== true) {
      closed[station_id] = [...(closed[station_id] ?? []), pad];
    }
  }
  return closed;
}

// What a station is drawn as. The pads that are taken include those that are closed now; a station is
// congested if more drones have booked a pad than it has.
function padState(pads, live, closed) {
  if (closed === true || (pads > 0 && closed?.length >= pads)) return "closed";
  if (pads === 0) return "parking";
  const taken = live?.pads_taken ?? 0;
  if (taken >= pads) return "full";
  if (taken + (live?.queue ?? 0) > pads) return "congested";
  return taken > 0 ? "busy" : "free";
}

export function stationPoints(network, live, closures) {
  const closed = closedStations(closures);
  return collection(stationsOf(network).map(({geometry: {coordinates}, properties: {station_id: id, pads}}) => feature("Point", coordinates, {
    station_id: id, pads: padState(pads, live[id], closed[id]), of: pads, taken: live[id]?.pads_taken ?? 0,
  })));
}

// Zones and ground stops with an area, and closed segments.
export function closureShapes(network, closures) {
  const places = placesOf(network);
  return collection(Object.values(closures).flatMap(({rings, kind, station_id: from, to_station_id: to}) => {
    if (rings) return [feature("Polygon", rings)];
    return kind === "SEGMENT" && places[from] && places[to] ? [line([places[from], places[to]])] : [];
  }));
}

// From a drone in flight to the stations where it could land instead.
export function alternativeLines(network, drone) {
  const landings = drone?.safe_landings ?? [];
  return collection(stationsOf(network)
    .filter(({properties}) => landings.includes(properties.station_id))
    .map(({geometry}) => line([drone.position, geometry.coordinates])));
}

// The flights of a plan: the one under way is flown up to where the drone is.
export function planLines(mission, drone) {
  if (!mission) return collection([]);
  const flights = Object.values(mission.steps).filter(({kind}) => kind === "FLY");
  const underWay = flights.findIndex(({status}) => status !== "ENDED");
  return collection(flights.flatMap(({status, from_position, position}, number) => {
    const isUnderWay = number === underWay && drone?.activity === "FLYING";
    if (!isUnderWay) return [line([from_position, position], {status})];
    return [
      line([from_position, drone.position], {status: "ENDED"}),
      line([drone.position, position], {status: "PLANNED"}),
    ];
  }));
}

// Where a mission stops from now on, in order: [{stationId, position, at}]; each station once.
export function stopsAhead(mission) {
  const ahead = Object.values(mission?.steps ?? {}).filter(({status, kind, lands}) =>
    status !== "ENDED" && (kind === "DELIVER" || kind === "PICK_UP" || (kind === "FLY" && lands)));
  const stops = new Map();
  for (const {station_id: stationId, position, end_at: at, start_at: from, kind} of ahead) {
    if (!stops.has(stationId)) stops.set(stationId, {stationId, position, at: kind === "FLY" ? at : from});
  }
  return [...stops.values()];
}
