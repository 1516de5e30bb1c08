// A small map of a delivery's way: what was flown, what is ahead, and where the drone is.

import {html} from "../html.js";

const [WIDTH, HEIGHT, EDGE] = [320, 120, 18];

// Places of the map in the picture's own units; north is up.
function projection(places) {
  const narrowing = Math.cos((places[0][1] * Math.PI) / 180);
  // The short way around longitude 180.
  const eastOf = ([east]) => (east - 360 * Math.round((east - places[0][0]) / 360)) * narrowing;
  const [easts, norths] = [places.map(eastOf), places.map(([, north]) => north)];
  const [west, south] = [Math.min(...easts), Math.min(...norths)];
  const [wide, high] = [Math.max(...easts) - west, Math.max(...norths) - south];
  const scale = Math.min((WIDTH - 2 * EDGE) / (wide || 1e-6), (HEIGHT - 2 * EDGE) / (high || 1e-6), 1e5);
  const [left, top] = [(WIDTH - wide * scale) / 2, (HEIGHT - high * scale) / 2];
  return (place) => [left + (eastOf(place) - west) * scale, top + (south + high - place[1]) * scale];
}

const stepsOf = (mission) => Object.entries(mission.steps)
  .sort(([one], [other]) => one - other).map(([, step]) => step)
  .filter(({kind}) => ["FLY", "PICK_UP", "DELIVER"].includes(kind));

// From the first pickup on: the way of the packages.
function wayOf(mission) {
  const steps = stepsOf(mission);
  return steps.slice(Math.max(0, steps.findIndex(({kind}) => kind === "PICK_UP")));
}

export function WaySketch({mission, drone, label}) {
  const steps = wayOf(mission).filter(({position}) => position);
  if (steps.length === 0) return null;
  const places = [...steps.map(({position}) => position), ...(drone ? [drone.position] : [])];
  const at = projection(places);
  const line = (some) => some.map((place) => at(place).map((each) => each.toFixed(1)).join(",")).join(" ");
  const ended = steps.filter(({status}) => status === "ENDED").map(({position}) => position);
  const ahead = steps.filter(({status}) => status !== "ENDED").map(({position}) => position);
  const here = drone?.position ?? ended.at(-1) ?? steps[0].position;
  return html`
    <svg class="way" viewBox="0 0 ${WIDTH} ${HEIGHT}" role="img" aria-label=${label}>
      <polyline class="flown" points=${line([...ended, here])} />
      <polyline class="ahead" points=${line([here, ...ahead])} />
      ${steps.filter(({kind}) => kind !== "FLY").map(({kind, position}, number) => {
        const [x, y] = at(position);
        return html`<circle key=${number} class=${kind === "DELIVER" ? "aim" : "start"} cx=${x} cy=${y} r="6" />`;
      })}
      ${drone && html`<path class="drone" d="M0-10 8 8 0 4-8 8z"
        transform=${`translate(${at(here).join(" ")}) rotate(${drone.heading_deg ?? 0})`} />`}
    </svg>`;
}
