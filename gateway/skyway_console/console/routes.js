// Which view is open: the part of the address after "#", such as #/deliveries/dlv_7.

import {signal} from "@preact/signals";

// An address that somebody has broken opens the first view, not a blank page.
function decoded(part) {
  try {
    return decodeURIComponent(part);
  } catch {
    return part;
  }
}

const read = () => location.hash.replace(/^#\/?/, "").split("/").map(decoded);

export const route = signal(read());

addEventListener("hashchange", () => (route.value = read()));

export const pathTo = (...parts) => `#/${parts.map(encodeURIComponent).join("/")}`;

export function openView(...parts) {
  location.hash = pathTo(...parts);
}
