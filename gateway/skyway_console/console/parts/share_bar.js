// A bar as long as a share of the longest one.

import {html} from "../html.js";

export const ShareBar = ({share, kind = ""}) => html`
  <svg class="share-bar ${kind}" width="100%" height="8" aria-hidden="true">
    <rect class="whole" width="100%" height="8" rx="4" />
    <rect class="share" width=${`${Math.max(1, Math.min(100, share * 100))}%`} height="8" rx="4" />
  </svg>`;
