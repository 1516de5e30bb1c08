// Asks whether a login link may replace the session that this browser has.

import {html} from "../html.js";
import {offeredLogin, personName, replaceSession, session} from "../session.js";
import {attempt} from "./messages.js";

export function LoginQuestion({code}) {
  const answer = async (isAccepted) => {
    if (isAccepted) await attempt(() => replaceSession(code));
    offeredLogin.value = null;
  };
  return html`
    <main class="login">
      <h1>Skyway</h1>
      <p>You are logged in as <strong>${personName(session.value)}</strong>. The link that you opened logs this
        browser in again, perhaps as somebody else.</p>
      <p>Use it only if you asked for it. Otherwise somebody could read what you enter from now on.</p>
      <menu>
        <button autofocus onClick=${() => answer(false)}>Stay logged in</button>
        <button class="quiet" onClick=${() => answer(true)}>Use the link</button>
      </menu>
    </main>`;
}
