// Moves drones smoothly: each glides from where it was shown to where it was reported last.

// A glide takes as long as the report before was away, within these bounds, milliseconds.
const SHORTEST_MS = 200;
const LONGEST_MS = 5_000;

const isStill = matchMedia("(prefers-reduced-motion: reduce)");

export class Glide {
  #drones = new Map();

  // What the gateway says of the drones, by their ids; others are gone.
  report(drones, nowMs) {
    for (const id of this.#drones.keys()) if (!(id in drones)) this.#drones.delete(id);
    for (const [id, drone] of Object.entries(drones)) {
      const before = this.#drones.get(id);
      if (before && String(before.drone.position) === String(drone.position)) {
        before.drone = drone;
        continue;
      }
      const from = before && !isStill.matches ? this.#placeOf(before, nowMs) : drone.position;
      const lastsMs = before ? Math.min(Math.max(nowMs - before.beganMs, SHORTEST_MS), LONGEST_MS) : 0;
      this.#drones.set(id, {drone, from, beganMs: nowMs, lastsMs});
    }
  }

  // The drones with the positions to show now.
  shown(nowMs) {
    return [...this.#drones.values()].map((each) => ({...each.drone, position: this.#placeOf(each, nowMs)}));
  }

  #placeOf({drone, from, beganMs, lastsMs}, nowMs) {
    const share = lastsMs > 0 ? Math.min((nowMs - beganMs) / lastsMs, 1) : 1;
    return from.map((start, axis) => start + (drone.position[axis] - start) * share);
  }
}
