// The networks that the gateway knows, and the one that is shown. Its content is asked for once.

import {computed, signal} from "@preact/signals";

import {get, part} from "./api.js";
import {stationsOf} from "./map/features.js";

// null while they were not asked for.
export const networks = signal(null);

const chosen = signal(null);

export const shownNetwork = computed(() => chosen.value ?? networks.value?.[0]?.network_id ?? null);

export const showNetwork = (networkId) => (chosen.value = networkId);

const contents = new Map();

// The names that people gave to stations, by their ids, of the networks whose content was asked for.
export const stationNames = signal(new Map());

function keepNames({features}) {
  const named = features.map(({properties}) => [properties.station_id, properties.name]);
  stationNames.value = new Map([...stationNames.value, ...named.filter(([, name]) => name)]);
}

// Every view writes names; most of them ask for no network themselves.
export async function learnNames() {
  await listNetworks();
  if (shownNetwork.value) await networkContent(shownNetwork.value);
}

export async function listNetworks() {
  networks.value = (await get("/v1/networks")).items;
  return networks.value;
}

export function networkContent(networkId) {
  if (!contents.has(networkId)) {
    const content = get(`/v1/networks/${part(networkId)}`);
    contents.set(networkId, content);
    content.then(keepNames, () => contents.delete(networkId));
  }
  return contents.get(networkId);
}

// The ids of the stations of all networks, in order.
export async function allStationIds() {
  const contents = await Promise.all((await listNetworks()).map(({network_id: id}) => networkContent(id)));
  return contents.flatMap(stationsOf).map(({properties}) => properties.station_id).sort();
}
