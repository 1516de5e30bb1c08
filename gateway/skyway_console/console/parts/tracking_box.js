// The link by which a recipient follows a delivery without a key: show, renew and withdraw it.

import {useEffect, useState} from "preact/hooks";

import {call, get} from "../api.js";
import {html} from "../html.js";
import {attempt, copy} from "./messages.js";
import {QrCode} from "./qr_code.js";
import {SureButton} from "./sure_button.js";

export function TrackingBox({path}) {
  // The link outlives a session, so it is shown to the key alone: undefined until somebody asks.
  const [url, setUrl] = useState(undefined);
  const link = `${path}/tracking-link`;
  useEffect(() => setUrl(undefined), [link]);
  const show = () => attempt(async () => setUrl((await get(link)).tracking_url));
  const renew = () => attempt(async () => setUrl((await call("POST", link)).tracking_url),
    "The new link works. The one before has ended.");
  const withdraw = () => attempt(async () => {
    await call("DELETE", link);
    setUrl(null);
  }, "The link has ended.");
  const sure = html`<${SureButton} verb="Withdraw" label="Withdraw the link" kind="" onSure=${withdraw} />`;
  return html`
    <section class="tracking" aria-label="Tracking link">
      <h2>Tracking link</h2>
      ${url ? html`
        <p>Everybody with <a href=${url} target="_blank" rel="noopener">this link</a> can follow the delivery.</p>
        <${QrCode} text=${url} label="The link as a QR code" />
        <div class="commands">
          ${navigator.clipboard && html`<button onClick=${() => copy(url, "The link is copied.")}>Copy the link</button>`}
          <button onClick=${renew}>Another link</button>
          ${sure}
        </div>` : url === undefined ? html`
        <p>Everybody with the link can follow the delivery without a key.</p>
        <div class="commands"><button onClick=${show}>Show the link</button>${sure}</div>` : html`
        <p>There is no link. Nobody can follow the delivery without a key.</p>
        <button onClick=${renew}>Make a link</button>`}
    </section>`;
}
