// Draws stations and all names that stand still on a canvas above the map. Names never overlap: first
// those of markers, then the stops of the open plan, stations by their pads, and places by their people.

import {addCanvas, circle, drawPicture, fitted, stroke, textWidth} from "./canvas.js";
import {colours} from "./colours.js";
import {LabelSpace, boxesAround} from "./label_space.js";
import {mercator, screenOf} from "./mercator.js";
import {STATION_HALF_PX, stationPicture, stationRadius} from "./station_pictures.js";

const FONT = "system-ui, sans-serif";
const OUTSIDE_PX = 60;
// Half of a marker's mark.
const MARK_PX = 8;
// The people of the smallest places that are named, by zoom: a third of them at each zoom more.
const leastPeople = (zoom) => 3_000_000 / 3 ** Math.max(0, zoom - 4);

export class StationLayer {
  constructor(map) {
    this.map = map;
    this.canvas = addCanvas(map, "station-layer");
    this.stations = [];
    this.byId = new Map();
    this.places = [];
    this.looks = new Map();
    this.stops = new Map();
    this.guests = new Set();
    this.markers = [];
    this.marked = null;
    // What the names leave free for the names of drones.
    this.space = new LabelSpace();
    map.on("move", () => this.draw());
    map.on("resize", () => this.draw());
  }

  remove() {
    this.canvas.remove();
  }

  // Stations in the order in which their names get a place.
  showNames(stations) {
    this.stations = [...stations].sort((one, other) => other.pads - one.pads || one.name.localeCompare(other.name))
      .map((station) => ({...station, at: mercator(station.position)}));
    this.byId = new Map(this.stations.map((station) => [station.stationId, station]));
    this.draw();
  }

  showPlaces(places) {
    this.places = places.map((place) => ({...place, at: mercator(place.position)}));
    this.draw();
  }

  // The features of features.js: how each station is.
  showLooks(features) {
    this.looks = new Map(features.map(({properties: {station_id: id, pads: state, of: pads, taken}}) =>
      [id, {state, pads, taken}]));
    this.draw();
  }

  // The stops of the open plan by their stations, with the words beside them.
  showStops(stops) {
    const text = JSON.stringify(stops);
    if (this.stopText === text) return;
    this.stopText = text;
    this.stops = new Map(stops.map(({stationId, text}) => [stationId, text]));
    this.draw();
  }

  // Names leave room for drones that stand beside these stations.
  keepFree(stationIds) {
    const text = [...new Set(stationIds)].sort().join(" ");
    if (this.guestText === text) return;
    this.guestText = text;
    this.guests = new Set(stationIds);
    this.draw();
  }

  // Markers on a map whose stations are not drawn, each with its name above its mark.
  keepMarkersFree(markers) {
    this.markers = markers;
    this.draw();
  }

  mark(stationId) {
    if (this.marked === stationId) return;
    this.marked = stationId;
    this.draw();
  }

  placeOf(stationId) {
    return this.byId.get(stationId)?.at;
  }

  draw() {
    const {context, width, height} = fitted(this.canvas, this.map);
    const paint = colours();
    const toScreen = screenOf(this.map);
    const zoom = this.map.getZoom();
    const isInside = ([x, y]) => x > -OUTSIDE_PX && y > -OUTSIDE_PX && x < width + OUTSIDE_PX
      && y < height + OUTSIDE_PX;
    this.space = new LabelSpace();
    const radius = stationRadius(zoom);
    const seen = this.stations.map((station) => ({...station, point: toScreen(station.at)}))
      .filter(({point}) => isInside(point));
    for (const {stationId, point: [x, y]} of seen) {
      this.space.take([x - radius, y - radius, x + radius, y + radius]);
      if (this.guests.has(stationId)) this.space.take([x, y - radius - 18, x + radius + 18, y]);
    }
    Object.assign(context, {textBaseline: "middle", lineJoin: "round", lineWidth: 3, strokeStyle: paint.halo});
    this.drawStationNames(context, seen, radius, paint);
    const named = new Set([...this.nameMarkers(), ...seen.map(({name}) => name)]);
    this.drawPlaces(context, {zoom, toScreen, isInside, named}, paint);
    for (const {stationId, point} of seen) this.drawStation(context, stationId, point, radius, paint);
  }

  drawStation(context, stationId, point, radius, paint) {
    const look = this.looks.get(stationId) ?? {state: "free", pads: 1, taken: 0};
    drawPicture(context, stationPicture(look, radius, paint), point, STATION_HALF_PX);
    if (stationId !== this.marked) return;
    circle(context, point, radius + 4);
    stroke(context, paint.selected, 2.5);
  }

  // Show the names of markers that have room; returns all names.
  nameMarkers() {
    const found = this.markers.map((marker) => {
      const {x, y} = this.map.project(marker.getLngLat());
      this.space.take([x - MARK_PX, y - MARK_PX, x + MARK_PX, y + MARK_PX]);
      return {x, y, name: marker.getElement().firstChild};
    });
    for (const {x, y, name: {offsetWidth: width, offsetHeight: height, classList}} of found) {
      const [above] = boxesAround([x, y], width, height, MARK_PX + 3);
      if (width) classList.toggle("covered", !this.space.takeFirst([above]));
    }
    return found.map(({name}) => name.textContent);
  }

  drawStationNames(context, seen, radius, paint) {
    const rank = ({stationId}) => (stationId === this.marked ? 0 : this.stops.has(stationId) ? 1 : 2);
    for (const station of [...seen].sort((one, other) => rank(one) - rank(other))) {
      const isAsked = rank(station) < 2;
      const stop = this.stops.get(station.stationId);
      context.font = `${isAsked ? "600 13px" : "12px"} ${FONT}`;
      context.fillStyle = paint.text;
      this.write(context, stop ? `${station.name} ${stop}` : station.name, station.point, radius + 4);
    }
  }

  drawPlaces(context, {zoom, toScreen, isInside, named}, paint) {
    const least = leastPeople(zoom);
    context.fillStyle = paint.place;
    for (const {name, people, at} of this.places) {
      if (people < least) return;
      const point = toScreen(at);
      if (!isInside(point) || named.has(name)) continue;
      context.font = `${people > 400_000 ? "600 14px" : people > 50_000 ? "12.5px" : "11px"} ${FONT}`;
      const half = textWidth(context, name) / 2;
      const [x, y] = point;
      if (!this.space.takeFirst([[x - half, y - 8, x + half, y + 8]])) continue;
      context.textAlign = "center";
      context.strokeText(name, x, y);
      context.fillText(name, x, y);
    }
  }

  write(context, text, point, distance) {
    const width = textWidth(context, text);
    // A name that the edge of the screen would cut stands on the other side, or nowhere.
    const right = this.map.getContainer().clientWidth;
    const whole = boxesAround(point, width, 15, distance).filter((each) => each[0] >= 0 && each[2] <= right);
    const box = this.space.takeFirst(whole);
    if (!box) return;
    context.textAlign = "left";
    const y = (box[1] + box[3]) / 2;
    context.strokeText(text, box[0], y);
    context.fillText(text, box[0], y);
  }
}
