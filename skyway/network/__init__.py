"""The skyway network: stations with pads, directed segments between them, zones above them.

- `network`, `parts`, `views`: a network and its stations, segments and zones as objects.
- `columns`: the same as arrays, a row for each station and segment.
- `geojson`, `geojson_text`, `nx`: in and out as GeoJSON and as NetworkX graphs.
- `feature_columns`, `station_columns`, `line_columns`, `column_fields`: the fast reader.
- `geojson_features`, `fields`: the reader that names each fault.
- `bundled`, `gazetteer`, `synthetic`: the Texas corridor, its places, and made-up cities.
- `opening_hours`, `pad_power`, `pad_connectors`: properties of stations that the planner reads.
- `zones`, `near_pairs`, `great_circle`, `components`: geometry and reachability.
- `geojson_schema`: the JSON schema that the REST documents show.
"""
