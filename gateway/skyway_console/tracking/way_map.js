// Draws the way of a delivery: what was flown, what is to come, and the drones that carry it.

import {WORDS, distanceText} from "./words.js";

const SVG = "http://www.w3.org/2000/svg";
const WIDTH = 400;
const HEIGHT = 300;
const MARGIN = 44;
const METRES_PER_DEGREE = 111_195;
// A single place is shown with about a kilometre around it.
const LEAST_DEG = 0.01;
// The scale bar is so long at most, in units of the picture.
const BAR = 90;
// Names nearer to the side than this begin or end at their mark.
const SIDE = 90;
// A quadcopter from above, with its nose to the north.
const ARMS = "M-5 -5 L5 5 M5 -5 L-5 5";
const ROTORS = [[-6, -6], [6, -6], [-6, 6], [6, 6]];
const NOSE = "M0 -13 L3.5 -7 L-3.5 -7 Z";

function shape(name, attributes, ...children) {
  const made = document.createElementNS(SVG, name);
  for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
  made.append(...children);
  return made;
}

// From degrees to the picture: distances are right near the middle of the way.
function projection(positions) {
  // A way across longitude 180 goes on beyond it.
  const near = (longitude) => longitude + 360 * Math.round((positions[0][0] - longitude) / 360);
  const longitudes = positions.map(([longitude]) => near(longitude));
  const latitudes = positions.map(([, latitude]) => latitude);
  const [west, east] = [Math.min(...longitudes), Math.max(...longitudes)];
  const [south, north] = [Math.min(...latitudes), Math.max(...latitudes)];
  const narrowing = Math.cos(((south + north) / 2) * (Math.PI / 180));
  const scale = Math.min(
    (WIDTH - 2 * MARGIN) / Math.max((east - west) * narrowing, LEAST_DEG),
    (HEIGHT - 2 * MARGIN) / Math.max(north - south, LEAST_DEG),
  );
  const project = ([longitude, latitude]) => [
    WIDTH / 2 + (near(longitude) - (west + east) / 2) * narrowing * scale,
    HEIGHT / 2 - (latitude - (south + north) / 2) * scale,
  ];
  return {project, metres: METRES_PER_DEGREE / scale};
}

// The longest round distance that fits, in the lower corner that is free.
function scaleBar(metres, marks) {
  const most = BAR * metres;
  const power = 10 ** Math.floor(Math.log10(most));
  const long = [5, 2, 1].map((each) => each * power).find((each) => each <= most);
  const isTaken = marks.some(([x, y]) => x < 2 * BAR && y > HEIGHT / 2);
  const [left, y] = [isTaken ? WIDTH - 14 - long / metres : 14, HEIGHT - 14];
  return shape("g", {class: "scale"},
    shape("path", {d: `M${left} ${y - 4} V${y} H${left + long / metres} V${y - 4}`}),
    shape("text", {x: left, y: y - 9}, distanceText(long)));
}

const line = ([x1, y1], [x2, y2], name) => shape("line", {x1, y1, x2, y2, class: name});

// Names stand away from the way: above what is in the upper half of it, below the others.
function placeMarks(places, project, nameOf) {
  const middle = places.reduce((sum, {position}) => sum + project(position)[1], 0) / places.length;
  return places.flatMap(({station_id, position, role}) => {
    const [x, y] = project(position);
    if (role === "STOP") return [shape("circle", {cx: x, cy: y, r: 3, class: "stop"})];
    const mark = role === "PICKUP"
      ? [shape("rect", {x: x - 6, y: y - 6, width: 12, height: 12, rx: 3, class: "pickup"})]
      : [13, 7, 2.5].map((r, ring) => shape("circle", {cx: x, cy: y, r, class: `destination ring-${ring}`}));
    const anchor = x < SIDE ? "start" : x > WIDTH - SIDE ? "end" : "middle";
    const [across, above] = [{start: x - 12, end: x + 12, middle: x}[anchor], y > middle ? y + 30 : y - 20];
    return [...mark, shape("text", {x: across, y: above, "text-anchor": anchor}, nameOf(station_id))];
  });
}

function droneMark({isOld}) {
  return shape("g", {class: isOld ? "drone old" : "drone"},
    shape("circle", {r: 16, class: "halo"}),
    shape("g", {class: "body"},
      shape("path", {d: ARMS}), ...ROTORS.map(([cx, cy]) => shape("circle", {cx, cy, r: 3.6})),
      shape("path", {d: NOSE, class: "nose"})),
    shape("title", {}, WORDS.drone));
}

export class WayMap {
  #svg;
  #project = null;
  #marks = [];
  // The flight that is under way: what was flown of it, and what is to come.
  #current = null;

  constructor(svg) {
    this.#svg = svg;
    svg.setAttribute("viewBox", `0 0 ${WIDTH} ${HEIGHT}`);
  }

  // Draws everything; `drones` are {position, heading_deg, isOld}.
  draw({flights, places}, drones, nameOf) {
    const all = [...places.map(({position}) => position), ...drones.map(({position}) => position)];
    const {project, metres} = projection(all);
    this.#project = project;
    this.#current = null;
    this.#marks = drones.map(droneMark);
    this.#svg.replaceChildren(
      ...flights.flatMap((flight) => this.#lines(flight, drones)),
      ...placeMarks(places, project, nameOf),
      scaleBar(metres, places.map(({position}) => project(position))),
      ...this.#marks,
    );
    this.move(drones);
  }

  #lines({status, from_position, to_position}, drones) {
    const [from, to] = [this.#project(from_position), this.#project(to_position)];
    if (status === "FLOWN") return [line(from, to, "flown")];
    if (status === "PLANNED" || drones.length !== 1) return [line(from, to, "planned")];
    this.#current = [line(from, from, "flown"), line(from, to, "planned")];
    return this.#current;
  }

  // Moves the same drones to their present places.
  move(drones) {
    drones.forEach(({position, heading_deg: heading}, number) => {
      const [x, y] = this.#project(position);
      const mark = this.#marks[number];
      mark?.setAttribute("transform", `translate(${x} ${y})`);
      mark?.querySelector(".body").setAttribute("transform", `rotate(${heading ?? 0})`);
      this.#current?.[0].setAttribute("x2", x);
      this.#current?.[0].setAttribute("y2", y);
      this.#current?.[1].setAttribute("x1", x);
      this.#current?.[1].setAttribute("y1", y);
    });
  }
}
