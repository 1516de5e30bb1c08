// The map of the fleet: MapLibre for what stands still, a canvas above it for the drones.

import {Map as MapLibreMap, NavigationControl, setWorkerUrl} from "maplibre-gl";

import {outlines} from "./base_map.js";
import {onThemeChange} from "./colours.js";
import {DroneLayer} from "./drone_layer.js";
import {alternativeLines, closureShapes, planLines, segmentLines, stationPoints, stationsOf} from "./features.js";
import {mapStyle} from "./layers.js";
import {readOwnStyle} from "./own_base_map.js";
import {stationName} from "../words.js";
import {collectionNear, drawAround, near} from "./longitudes.js";

setWorkerUrl("/console/vendor/maplibre-gl-worker.mjs");

const FAR_OUT = {center: [-98, 30], zoom: 3};

export class FleetMap {
  // `onClick` is called with {droneId, stationId, position} of what was clicked.
  constructor(container, onClick) {
    this.map = new MapLibreMap({
      container, style: mapStyle(), ...FAR_OUT, attributionControl: false, fadeDuration: 0,
      dragRotate: false, pitchWithRotate: false,
    });
    this.map.addControl(new NavigationControl({showCompass: false}));
    this.map.touchZoomRotate.disableRotation();
    this.drones = new DroneLayer(this.map);
    this.data = {};
    this.drawn = {};
    this.isGone = false;
    this.map.on("click", (event) => onClick(this.whatIsAt(event)));
    this.isReady = new Promise((resolve) => this.map.once("load", resolve));
    this.isReady.then(() => this.showGround());
    this.leaveTheme = onThemeChange(() => this.map.setStyle(mapStyle(this.ownStyle)));
    this.map.on("style.load", () => this.putAll());
  }

  remove() {
    this.isGone = true;
    this.leaveTheme();
    this.drones.remove();
    this.map.remove();
  }

  whatIsAt({point, lngLat}) {
    return {...this.drones.whatIsAt(point), position: lngLat.wrap().toArray()};
  }

  centre() {
    return this.map.getCenter().wrap().toArray();
  }

  showNetwork(network) {
    this.network = network;
    const stations = stationsOf(network);
    if (stations.length) drawAround(stations[0].geometry.coordinates[0]);
    this.drones.showNames(stations.map(({geometry, properties}, number) => ({
      stationId: properties.station_id,
      name: properties.name ?? stationName(properties.station_id),
      position: geometry.coordinates,
      isFirst: number % Math.ceil(stations.length / 12) === 0,
    })));
    this.put("segments", segmentLines(network));
    const places = stations.map(({geometry}) => near(geometry.coordinates));
    if (places.length) this.map.fitBounds(around(places), {padding: 60, duration: 0});
  }

  showStations(stations, closures) {
    if (!this.network) return;
    this.put("stations", stationPoints(this.network, stations, closures));
    this.put("closures", closureShapes(this.network, closures));
  }

  showPlan(mission, drone) {
    this.put("plan", planLines(mission, drone));
    if (this.network) this.put("alternatives", alternativeLines(this.network, drone));
  }

  showDraft(ring) {
    const features = ring.length < 3 ? [] : [{
      type: "Feature", properties: {},
      geometry: {type: "Polygon", coordinates: [[...ring, ring[0]]]},
    }];
    this.put("draft", {type: "FeatureCollection", features});
  }

  // What lies below the fleet comes after the fleet: the first picture does not wait for it.
  async showGround() {
    this.ownStyle = await readOwnStyle();
    if (this.isGone) return;
    if (this.ownStyle) {
      this.map.setStyle(mapStyle(this.ownStyle));
      return;
    }
    for (const [source, name] of [["countries", "countries"], ["counties", "us-counties"]]) {
      const lines = await outlines(name);
      if (this.isGone) return;
      this.draw(source, lines);
    }
  }

  put(source, features) {
    this.draw(source, collectionNear(features));
  }

  // Data is kept, because a change of the theme begins with empty sources. What is drawn already
  // is not drawn again: the whole map would be.
  draw(source, data) {
    const text = JSON.stringify(data);
    if (this.drawn[source] === text) return;
    this.drawn[source] = text;
    this.data[source] = data;
    this.map.getSource(source)?.setData(data);
  }

  putAll() {
    for (const [source, data] of Object.entries(this.data)) this.map.getSource(source)?.setData(data);
  }
}

function around(places) {
  const longitudes = places.map(([longitude]) => longitude);
  const latitudes = places.map(([, latitude]) => latitude);
  return [[Math.min(...longitudes), Math.min(...latitudes)],
    [Math.max(...longitudes), Math.max(...latitudes)]];
}
