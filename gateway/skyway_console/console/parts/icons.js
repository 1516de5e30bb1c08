// Small pictures of views and commands, drawn in the colour of the text beside them.

import {html} from "../html.js";

const PATHS = {
  home: "M3 11 12 3l9 8M5 9.5V21h5v-6h4v6h5V9.5",
  map: "M9 4 3 6.5V20l6-2.5 6 2.5 6-2.5V4l-6 2.5zM9 4v13.5M15 6.5V20",
  new: "M12 4v16M4 12h16",
  deliveries: "M3.5 7.5 12 3l8.5 4.5v9L12 21l-8.5-4.5zM3.5 7.5 12 12l8.5-4.5M12 12v9",
  fleet: "M5 5a3 3 0 1 0 .1 0M19 5a3 3 0 1 0 .1 0M5 13a3 3 0 1 0 .1 0M19 13a3 3 0 1 0 .1 0M7 10l3 2h4l3-2M7 14l3-2M17 14l-3-2",
  alarms: "M6 17V11a6 6 0 0 1 12 0v6l2 2H4zM10 21h4",
  more: "M4 6h16M4 12h16M4 18h16",
  person: "M12 4a4 4 0 1 0 .1 0M4 21c1-5 4-7 8-7s7 2 8 7",
  dots: "M12 5v.1M12 12v.1M12 19v.1",
};

export const Icon = ({name}) => html`
  <svg class="icon" width="22" height="22" viewBox="0 0 24 24" aria-hidden="true" fill="none"
    stroke="currentColor" stroke-width="1.8" stroke-linecap="round" stroke-linejoin="round">
    <path d=${PATHS[name]} /></svg>`;
