// The base map without a network: outlines of countries and of US counties, as lines.

// The lines of a TopoJSON file: each arc is a row of small steps on a grid.
export function arcLines({arcs, transform: {scale, translate}}) {
  const lines = arcs.map((arc) => {
    let [x, y] = [0, 0];
    return arc.map(([dx, dy]) => {
      [x, y] = [x + dx, y + dy];
      return [x * scale[0] + translate[0], y * scale[1] + translate[1]];
    });
  });
  return {type: "Feature", properties: {}, geometry: {type: "MultiLineString", coordinates: lines}};
}

export async function outlines(name) {
  const answer = await fetch(`/console/vendor/${name}.json`);
  return arcLines(await answer.json());
}
