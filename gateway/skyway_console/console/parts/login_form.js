// Asks for a key. The key is sent once, for a session or for one call; the page keeps it nowhere.

import {useState} from "preact/hooks";

import {keyWanted} from "../api.js";
import {html} from "../html.js";
import {beginSession} from "../session.js";
import {useModal} from "./panel.js";
import {useBusy} from "./use_busy.js";

export function LoginForm({problem}) {
  const [refused, setRefused] = useState(problem);
  const [isBusy, busy] = useBusy();

  async function login(event) {
    event.preventDefault();
    const key = new FormData(event.target).get("key").trim();
    await busy(() => beginSession(key).catch((refusal) => setRefused(refusal.message)));
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

// Asks for the key itself, for one call that a session may not make.
export function KeyDialog() {
  const give = keyWanted.value;
  return give && html`<${Dialog} give=${give} />`;
}

function Dialog({give}) {
  const element = useModal();
  function answer(key) {
    if (keyWanted.value === give) keyWanted.value = null;
    give(key);
  }
  function send(event) {
    event.preventDefault();
    answer(new FormData(event.target).get("key").trim());
  }
  return html`
    <dialog ref=${element} aria-labelledby="key-question" onClose=${() => answer(null)}>
      <form onSubmit=${send}>
        <h2 id="key-question">Your API key again</h2>
        <p>This gives something that lasts longer than your login. The key is sent with this one call, and is
          not kept.</p>
        <label for="key-itself">API key</label>
        <input id="key-itself" name="key" type="password" autocomplete="off" required autofocus
          placeholder="sk_…" />
        <menu>
          <button type="button" class="quiet" onClick=${() => element.current.close()}>Do nothing</button>
          <button class="main">Go on</button>
        </menu>
      </form>
    </dialog>`;
}
