// A section with a title that folds. What is in it is made when it is opened for the first time.

import {useState} from "preact/hooks";

import {html} from "../html.js";
import {isNarrow} from "../narrow.js";

// `isOpen` is how it begins on a wide page; on a phone it begins folded, unless `isFirst`.
export function Fold({title, isOpen = true, isFirst = false, children}) {
  const [begins] = useState(isFirst || (isOpen && !isNarrow.peek()));
  const [wasOpened, setOpened] = useState(begins);
  const onToggle = ({target}) => target.open && setOpened(true);
  return html`
    <details class="fold" open=${begins} onToggle=${onToggle}>
      <summary><h2>${title}</h2></summary>
      ${wasOpened && html`<div>${children}</div>`}
    </details>`;
}
