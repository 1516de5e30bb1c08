// Which view is open: the part of the address after "#", such as #/deliveries/dlv_7.

import {signal} from "@preact/signals";

const read = () => location.hash.replace(/^#\/?/, "").split("/").map(decodeURIComponent);

export const route = signal(read());

addEventListener("hashchange", () => (route.value = read()));

export const pathTo = (...parts) => `#/${parts.map(encodeURIComponent).join("/")}`;

export function openView(...parts) {
  location.hash = pathTo(...parts);
}
