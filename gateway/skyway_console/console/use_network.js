// The content of the network that is shown, in each view that has a map.

import {listNetworks, networkContent, shownNetwork} from "./networks.js";
import {useRead} from "./use_read.js";

// The list of networks is read again every `everyMs`, if that is given.
export function useNetwork(everyMs = null) {
  const networkId = shownNetwork.value;
  const listed = useRead(listNetworks, {everyMs});
  const {answer: network, problem} = useRead(
    async () => (networkId === null ? null : networkContent(networkId)), {changed: networkId});
  return {network, problem: problem || listed.problem};
}
