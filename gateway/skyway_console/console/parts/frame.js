// What stands around every view: names of the views, who is there, and whether changes arrive.

import {html} from "../html.js";
import {connection, openAlarms, picture} from "../live.js";
import {pathTo} from "../routes.js";
import {endSession, session} from "../session.js";
import {ClockText} from "./clock_text.js";
import {ConfirmDialog} from "./confirm_dialog.js";
import {KeyDialog} from "./login_form.js";
import {Messages} from "./messages.js";

const CONNECTIONS = {
  opening: "Connecting…",
  open: "Live",
  lost: "No connection. The console goes on by itself.",
};

function silentServices() {
  return Object.entries(picture.services.value)
    .filter(([, {is_answering}]) => !is_answering)
    .map(([name]) => name);
}

function Connection() {
  const silent = silentServices();
  const state = connection.value === "open" && silent.length ? "partly" : connection.value;
  const text = state === "partly"
    ? `No answer from ${silent.join(" and ")}: that part stands still.`
    : CONNECTIONS[state];
  return html`<span class="connection ${state}" role="status">${text}</span>`;
}

function AlarmCount() {
  const count = openAlarms.value.length;
  return count > 0 && html`<span class="count" title="open alarms">${count}</span>`;
}

export function Frame({views, open, children}) {
  return html`
    <a class="skip" href="#view">Skip to the view</a>
    <header class="frame">
      <strong class="brand">Skyway</strong>
      <nav aria-label="Views">
        ${views.map(([each, {name}]) => html`
          <a href=${pathTo(each)} aria-current=${each === open ? "page" : undefined}>
            ${name}${each === "alarms" && html`<${AlarmCount} />`}
          </a>`)}
      </nav>
      <${Connection} />
      <${ClockText} />
      <span class="who">${session.value.subject_id} (${session.value.role})</span>
      <button class="quiet" onClick=${endSession}>Log out</button>
    </header>
    <main id="view" tabindex="-1">${children}</main>
    <${ConfirmDialog} />
    <${KeyDialog} />
    <${Messages} />`;
}
