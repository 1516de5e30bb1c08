// Names and values side by side; values that are not known are left out.

import {html} from "../html.js";

export const Facts = ({of}) => html`
  <dl class="facts">
    ${of.filter(([, value]) => value !== undefined && value !== null && value !== false)
      .map(([name, value]) => html`<dt>${name}</dt><dd>${value}</dd>`)}
  </dl>`;
