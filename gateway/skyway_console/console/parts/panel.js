// A panel beside the map with a title and a button that closes it.

import {useEffect, useRef} from "preact/hooks";

import {html} from "../html.js";

// The element of a dialog that is open from the beginning.
export function useModal() {
  const element = useRef(null);
  useEffect(() => element.current.showModal(), []);
  return element;
}

export const Panel = ({title, label, kind = "", onClose, children}) => html`
  <section class="panel ${kind}" aria-label=${label ?? title}>
    <header>
      <h2>${title}</h2>
      <button class="quiet" onClick=${onClose} aria-label="Close the panel">✕</button>
    </header>
    ${children}
  </section>`;
