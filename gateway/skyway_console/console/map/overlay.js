// A source with layers of its own above a map, which stays when a change of the theme begins with an empty style.

import {collection} from "./geojson.js";
import {collectionNear} from "./longitudes.js";

// `layers` answers layers in the colours of the theme. The answer is a function that draws other features.
export function overlay(map, source, layers) {
  let drawn = collection([]);
  const put = () => {
    if (!map.getSource(source)) {
      map.addSource(source, {type: "geojson", data: drawn});
      layers().forEach((layer) => map.addLayer({...layer, source}));
    }
    map.getSource(source).setData(drawn);
  };
  map.on("style.load", put);
  return (features) => {
    drawn = collectionNear(collection(features));
    if (map.getSource(source)) put();
    return drawn;
  };
}
