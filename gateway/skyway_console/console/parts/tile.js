// A tile of a home page: a title, one large figure with a word beside it, and what explains it.

import {html} from "../html.js";

export const Tile = ({title, figure, unit, kind = "", href, feeds = "", children}) => html`
  <section class="tile ${kind} ${feeds}">
    <h2>${href ? html`<a href=${href}>${title}</a>` : title}</h2>
    ${figure !== undefined && html`<p class="figure">${figure} ${unit && html`<small>${unit}</small>`}</p>`}
    ${children}
  </section>`;
