// A button that asks once more before something is gone.

import {useEffect, useRef, useState} from "preact/hooks";

import {html} from "../html.js";

export function SureButton({verb, label, onSure, kind = "small"}) {
  const [isAsking, setAsking] = useState(false);
  const yes = useRef(null);
  useEffect(() => yes.current?.focus(), [isAsking]);
  if (!isAsking) {
    return html`<button type="button" class=${kind} aria-label=${label} onClick=${() => setAsking(true)}>
      ${verb}</button>`;
  }
  const act = () => {
    setAsking(false);
    onSure();
  };
  return html`
    <span class="sure" role="group" aria-label=${`${label}?`}>
      <button type="button" class="${kind} danger" ref=${yes} onClick=${act}>Yes, ${verb.toLowerCase()}</button>
      <button type="button" class=${kind} onClick=${() => setAsking(false)}>No</button>
    </span>`;
}
