// GeoJSON of features, for the sources of maps.

export const collection = (features) => ({type: "FeatureCollection", features});
export const feature = (type, coordinates, properties = {}) => (
  {type: "Feature", properties, geometry: {type, coordinates}});
export const line = (coordinates, properties) => feature("LineString", coordinates, properties);
