// Whether the page is as narrow as a phone: then cards stand where a wide page has tables and charts.

import {signal} from "@preact/signals";

const query = matchMedia("(max-width: 640px)");

export const isNarrow = signal(query.matches);

query.addEventListener("change", () => (isNarrow.value = query.matches));
