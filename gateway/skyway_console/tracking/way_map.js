// Draws the way of a delivery: what was flown, what is to come, and the drones that carry it.

const SVG = "http://www.w3.org/2000/svg";
const WIDTH = 400;
const HEIGHT = 300;
const MARGIN = 44;

function shape(name, attributes, text) {
  const made = document.createElementNS(SVG, name);
  for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
  if (text !== undefined) made.textContent = text;
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
    (WIDTH - 2 * MARGIN) / Math.max((east - west) * narrowing, 1e-4),
    (HEIGHT - 2 * MARGIN) / Math.max(north - south, 1e-4),
  );
  return ([longitude, latitude]) => [
    WIDTH / 2 + (near(longitude) - (west + east) / 2) * narrowing * scale,
    HEIGHT / 2 - (latitude - (south + north) / 2) * scale,
  ];
}

function flightLines(flights, drones, project) {
  return flights.flatMap(({status, from_position, to_position}) => {
    const line = (from, to, name) => {
      const [[x1, y1], [x2, y2]] = [project(from), project(to)];
      return shape("line", {x1, y1, x2, y2, class: name});
    };
    if (status === "FLOWN") return [line(from_position, to_position, "flown")];
    if (status === "PLANNED" || drones.length !== 1) {
      return [line(from_position, to_position, "planned")];
    }
    const here = drones[0].position;
    return [line(from_position, here, "flown"), line(here, to_position, "planned")];
  });
}

function placeMarks(places, project, nameOf) {
  return places.flatMap(({station_id, position, role}) => {
    const [x, y] = project(position);
    if (role === "STOP") return [shape("circle", {cx: x, cy: y, r: 3, class: "stop"})];
    const mark = role === "PICKUP"
      ? shape("rect", {x: x - 6, y: y - 6, width: 12, height: 12, rx: 2, class: "pickup"})
      : shape("circle", {cx: x, cy: y, r: 7, class: "destination"});
    const label = shape("text", {x, y: y - 12, "text-anchor": "middle"}, nameOf(station_id));
    return [mark, label];
  });
}

function droneMark({position, heading_deg}, project) {
  const [x, y] = project(position);
  const turn = `translate(${x} ${y}) rotate(${heading_deg ?? 0})`;
  const mark = shape("path", {d: "M0 -11 L8 9 L0 4 L-8 9 Z", class: "drone", transform: turn});
  mark.append(shape("title", {}, "The drone"));
  return mark;
}

export function drawWay(svg, {flights, places}, drones, nameOf) {
  const positions = [...places.map(({position}) => position), ...drones.map(({position}) => position)];
  svg.toggleAttribute("hidden", places.length === 0);
  if (places.length === 0) return;
  const project = projection(positions);
  svg.setAttribute("viewBox", `0 0 ${WIDTH} ${HEIGHT}`);
  svg.replaceChildren(
    ...flightLines(flights, drones, project),
    ...placeMarks(places, project, nameOf),
    ...drones.map((drone) => droneMark(drone, project)),
  );
}
