// Asks for a key. The key is sent once, for a session; the page keeps it nowhere.

import {useState} from "preact/hooks";

import {html} from "../html.js";
import {beginSession} from "../session.js";

export function LoginForm({problem}) {
  const [refused, setRefused] = useState(problem);
  const [isBusy, setBusy] = useState(false);

  async function login(event) {
    event.preventDefault();
    setBusy(true);
    const key = new FormData(event.target).get("key").trim();
    await beginSession(key).catch((refusal) => setRefused(refusal.message));
    setBusy(false);
  }

  return html`
    <main class="login">
      <h1>Skyway</h1>
      <form onSubmit=${login}>
        <label for="key">API key of an operator, a provider or a customer</label>
        <input id="key" name="key" type="password" autocomplete="off" required autofocus
          placeholder="sk_…" />
        <button disabled=${isBusy}>Log in</button>
      </form>
      ${refused && html`<p class="refused" role="alert">${refused}</p>`}
      <p class="hint">A running <code>skyway up</code> prints a link that logs in, and so does
        <code>skyway console</code>.</p>
    </main>`;
}
