// The map of the fleet: MapLibre for the ground and for lines, a canvas above it for stations and names,
// and one above that for the drones.

import {AttributionControl, Map as MapLibreMap, NavigationControl, setWorkerUrl} from "maplibre-gl";

import {droneName} from "../drone_names.js";
import {clockTime, stationName} from "../words.js";
import {learnAirframes} from "./airframes.js";
import {SOURCES_TEXT, placesOf, readGround} from "./base_map.js";
import {onThemeChange} from "./colours.js";
import {DroneLayer} from "./drone_layer.js";
import {
  alternativeLines, closureShapes, planLines, segmentLines, stationPoints, stationsOf, stopsAhead,
} from "./features.js";
import {collection, feature} from "./geojson.js";
import {groundColour, mapStyle, segmentsOf} from "./layers.js";
import {collectionNear, cornersOf, drawAround, near} from "./longitudes.js";
import {readOwnMap} from "./own_base_map.js";
import {StationLayer} from "./station_layer.js";

setWorkerUrl("/console/vendor/maplibre-gl-worker.mjs");

const FAR_OUT = {center: [-98, 30], zoom: 3};
const CLUSTER_ZOOMS = 2;
// What panels leave of the map (styles/map.css), and how far from an edge a mark is seen well.
const PHONE_PX = 700;
const PANEL_PX = 410;
const SHEET_SHARE = 0.42;
const EDGE_PX = 40;

export class FleetMap {
  // `onClick` is called with {droneId, stationId, position} of what was clicked. `isLive` says whether
  // drones fly on between their readings.
  constructor(container, onClick, {isLive = false} = {}) {
    this.map = new MapLibreMap({
      container, style: mapStyle(), ...FAR_OUT, attributionControl: false, fadeDuration: 0,
      dragRotate: false, pitchWithRotate: false,
    });
    this.map.addControl(new NavigationControl({showCompass: false}));
    this.map.touchZoomRotate.disableRotation();
    this.stations = new StationLayer(this.map);
    this.drones = new DroneLayer(this.map, this.stations, {isLive, nameOf: droneName});
    this.data = {};
    this.drawn = {};
    this.opened = null;
    this.isGone = false;
    this.hasGround = false;
    this.map.on("click", (event) => this.click(this.whatIsAt(event), onClick));
    this.map.on("mousemove", (event) => this.pointAt(this.drones.whatIsAt(event.point)));
    this.isReady = new Promise((resolve) => this.map.once("load", resolve));
    this.isReady.then(() => this.showGround());
    this.leaveTheme = onThemeChange(() => this.map.setStyle(mapStyle(this.ownMap, this.hasGround)));
    this.map.on("style.load", () => this.putAll());
    learnAirframes().then(() => this.drones.ask());
  }

  remove() {
    this.isGone = true;
    this.leaveTheme();
    this.drones.remove();
    this.stations.remove();
    this.map.remove();
  }

  whatIsAt({point, lngLat}) {
    return {...this.drones.whatIsAt(point), position: lngLat.wrap().toArray()};
  }

  click({cluster, ...found}, onClick) {
    if (!cluster) {
      onClick(found);
      return;
    }
    this.map.easeTo({center: this.map.unproject(cluster.point), zoom: this.map.getZoom() + CLUSTER_ZOOMS});
  }

  // Shows the segments of the station below the pointer, and the name of the drone.
  pointAt({droneId = null, stationId = null, cluster}) {
    this.map.getCanvas().style.cursor = droneId || stationId || cluster ? "pointer" : "";
    this.drones.hover(droneId);
    this.showSegmentsOf(stationId ?? this.opened);
  }

  // The station whose panel is open, or null.
  openStation(stationId) {
    this.opened = stationId;
    this.stations.mark(stationId);
    this.showSegmentsOf(stationId);
  }

  showSegmentsOf(stationId) {
    if (this.nearStation === stationId || !this.map.getLayer("segments-near")) return;
    this.nearStation = stationId;
    this.map.setFilter("segments-near", segmentsOf(stationId));
  }

  // Moves the map if a place is below a panel or off the screen: panels are at the right, or below on a phone.
  reveal(position) {
    const {x, y} = this.map.project(near(position));
    const {clientWidth: width, clientHeight: height} = this.map.getContainer();
    const isPhone = width <= PHONE_PX;
    const [right, bottom] = isPhone
      ? [width - EDGE_PX, height * SHEET_SHARE] : [width - PANEL_PX, height - EDGE_PX];
    if (x > EDGE_PX && y > EDGE_PX && x < right && y < bottom) return;
    const offset = isPhone ? [0, (-height * (1 - SHEET_SHARE)) / 2] : [-PANEL_PX / 2, 0];
    this.map.panTo(near(position), {offset});
  }

  centre() {
    return this.map.getCenter().wrap().toArray();
  }

  showNetwork(network) {
    this.network = network;
    const stations = stationsOf(network);
    if (stations.length) drawAround(stations[0].geometry.coordinates[0]);
    this.stations.showNames(stations.map(({geometry, properties}) => ({
      stationId: properties.station_id,
      name: properties.name ?? stationName(properties.station_id),
      position: geometry.coordinates,
      pads: properties.pads,
    })));
    this.put("segments", segmentLines(network));
    const places = stations.map(({geometry}) => near(geometry.coordinates));
    const padding = this.map.getContainer().clientWidth <= PHONE_PX ? 36 : 60;
    if (places.length) this.map.fitBounds(cornersOf(places), {padding, duration: 0});
  }

  showStations(stations, closures) {
    if (!this.network) return;
    this.put("stations", stationPoints(this.network, stations, closures));
    this.stations.showLooks(this.data.stations.features);
    this.put("closures", closureShapes(this.network, closures));
  }

  showPlan(mission, drone) {
    this.put("plan", planLines(mission, drone));
    this.stations.showStops(stopsAhead(mission).map(({stationId, at}) => ({stationId, text: clockTime(at)})));
    if (this.network) this.put("alternatives", alternativeLines(this.network, drone));
  }

  showDraft(ring) {
    this.put("draft", collection(ring.length < 3 ? [] : [feature("Polygon", [[...ring, ring[0]]])]));
  }

  // What lies below the fleet comes after the fleet: the first picture does not wait for it.
  async showGround() {
    this.ownMap = await readOwnMap();
    if (this.isGone) return;
    const attribution = new AttributionControl({
      compact: true, ...(this.ownMap ? {} : {customAttribution: SOURCES_TEXT}),
    });
    this.map.addControl(attribution, "bottom-right");
    // It begins as a button: the panels need the place.
    this.map.getContainer().querySelector("details.maplibregl-ctrl-attrib")?.removeAttribute("open");
    this.map.getContainer().querySelector(".maplibregl-compact-show")?.classList.remove("maplibregl-compact-show");
    if (this.ownMap) {
      this.map.setStyle(mapStyle(this.ownMap));
      this.stations.showPlaces(placesOf(this.ownMap.places));
      return;
    }
    const {features, places} = await readGround();
    if (this.isGone) return;
    for (const [source, data] of Object.entries(features)) this.draw(source, data);
    this.stations.showPlaces(places);
    // The land first, then the sea around it.
    await this.map.once("idle");
    if (this.isGone) return;
    this.hasGround = true;
    this.map.setPaintProperty("background", "background-color", groundColour(true));
  }

  put(source, features) {
    const text = JSON.stringify(features);
    if (this.drawn[source] === text) return;
    this.drawn[source] = text;
    this.draw(source, collectionNear(features));
  }

  // Data is kept, because a change of the theme begins with empty sources. What is drawn already
  // is not drawn again: the whole map would be.
  draw(source, data) {
    this.data[source] = data;
    this.map.getSource(source)?.setData(data);
  }

  putAll() {
    for (const [source, data] of Object.entries(this.data)) this.map.getSource(source)?.setData(data);
    this.nearStation = undefined;
    this.showSegmentsOf(this.opened);
    this.stations.draw();
  }
}
