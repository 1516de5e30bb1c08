// A secret that is shown this once: as text that one key press copies, and as a QR code if asked.

import {html} from "../html.js";
import {copy} from "./messages.js";
import {QrCode} from "./qr_code.js";

// `secrets` are pairs of a name and a text.
export const SecretBox = ({title, hint, secrets, qrOf, onClose}) => html`
  <section class="secret" aria-label=${title} role="status">
    <h3>${title}</h3>
    <p class="hint">${hint}</p>
    ${secrets.map(([name, text]) => html`
      <label>${name}<span class="row">
        <input readonly value=${text} aria-label=${name} onFocus=${({target}) => target.select()} />
        ${navigator.clipboard && html`
          <button type="button" onClick=${() => copy(text, "It is copied.")} aria-label=${`Copy ${name}`}>Copy</button>`}
      </span></label>`)}
    ${qrOf && html`<${QrCode} text=${qrOf} label=${`${title} as a QR code`} />`}
    <button type="button" onClick=${onClose}>I have kept it</button>
  </section>`;
