// Drones that are near each other on a small map, as one count.

import {circle, fill, stroke, writeCentred} from "./canvas.js";

const CELL_PX = 54;

// From [{droneId, point}] to [{droneIds, point}]: those of one cell, at the middle of them.
export function clustersOf(seen) {
  const cells = new Map();
  for (const {droneId, point: [x, y]} of seen) {
    const key = `${Math.floor(x / CELL_PX)} ${Math.floor(y / CELL_PX)}`;
    const cell = cells.get(key) ?? {droneIds: [], sum: [0, 0]};
    cell.droneIds.push(droneId);
    cell.sum = [cell.sum[0] + x, cell.sum[1] + y];
    cells.set(key, cell);
  }
  return [...cells.values()].map(({droneIds, sum}) => ({
    droneIds, point: sum.map((each) => each / droneIds.length),
  }));
}

export function drawCluster(context, {droneIds, point: [x, y]}, paint) {
  const radius = Math.min(24, 11 + 3 * Math.log10(droneIds.length) * 1.6);
  circle(context, [x, y], radius);
  stroke(context, paint.halo, 3);
  fill(context, paint.drone);
  writeCentred(context, droneIds.length, [x, y], "700 12px", paint.halo);
}
