// All that is drawn lies within half a turn of one meridian: else a segment across longitude 180 would
// be drawn around the world.

let meridian = 0;

export const drawAround = (longitude) => (meridian = longitude);

export const near = ([longitude, latitude]) =>
  [longitude + 360 * Math.round((meridian - longitude) / 360), latitude];

const allNear = (coordinates) =>
  (typeof coordinates[0] === "number" ? near(coordinates) : coordinates.map(allNear));

export const collectionNear = ({features, ...rest}) => ({...rest,
  features: features.map(({geometry, ...feature}) => (
    {...feature, geometry: {...geometry, coordinates: allNear(geometry.coordinates)}})),
});

// The corners in the southwest and the northeast of some places, [longitude, latitude] in degrees.
export const cornersOf = (places) => [Math.min, Math.max].map((end) =>
  [0, 1].map((axis) => end(...places.map((place) => place[axis]))));
