// The networks that the gateway knows; a network's content is asked for once.

import {signal} from "@preact/signals";

import {get, part} from "./api.js";

export const networks = signal(null);

const contents = new Map();

export async function listNetworks() {
  networks.value = (await get("/v1/networks")).items;
  return networks.value;
}

export function networkContent(networkId) {
  if (!contents.has(networkId)) contents.set(networkId, get(`/v1/networks/${part(networkId)}`));
  return contents.get(networkId);
}
