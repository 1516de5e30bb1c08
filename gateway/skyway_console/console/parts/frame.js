// What stands around every view: names of the views, who is there, and how old the picture is.

import {useRef} from "preact/hooks";

import {freshness, staleClasses, staleTexts} from "../freshness.js";
import {ticks} from "../fleet_clock.js";
import {html} from "../html.js";
import {openAlarms} from "../live.js";
import {pathTo} from "../routes.js";
import {endSession, personName, session} from "../session.js";
import {ClockText} from "./clock_text.js";
import {ConfirmDialog} from "./confirm_dialog.js";
import {Icon} from "./icons.js";
import {KeyDialog} from "./login_form.js";
import {Messages} from "./messages.js";

const LEVELS = {opening: "Connecting…", open: "Live", partly: "Partly old", lost: "No connection"};

// What a thumb reaches on a phone, by role. All other views are in the menu there.
const NEAR = {
  operator: ["home", "map", "deliveries", "alarms"],
  provider: ["home", "map", "fleet", "alarms"],
  customer: ["home", "new", "deliveries", "map"],
};
// What stands in the menu on a wide screen too.
const IN_MENU = ["account"];

const Mark = () => html`
  <svg class="mark" width="24" height="24" viewBox="0 0 24 24" aria-hidden="true">
    <circle cx="12" cy="12" r="12" /><path d="M5.5 13.5 18 6l-4.5 12.5-2.6-4.6z" /></svg>`;

const Connection = () => html`
  <span class="connection ${freshness.value}" role="status">${LEVELS[freshness.value]}</span>`;

function StaleBanner() {
  if (!["partly", "lost"].includes(freshness.value)) return null;
  ticks.value; // read so that the moment of the picture is right
  return html`<div class="stale-banner" role="alert">${staleTexts().map((each) => html`<p>${each}</p>`)}</div>`;
}

function AlarmCount() {
  const count = openAlarms.value.length;
  return count > 0 && html`<span class="count" title="open alarms">${count > 99 ? "99+" : count}</span>`;
}

const Links = ({views, open, hasIcons}) => views.map(([each, {name}]) => html`
  <a key=${each} href=${pathTo(each)} aria-current=${each === open ? "page" : undefined}>
    ${hasIcons && html`<${Icon} name=${each} />`}<span>${name}</span>${each === "alarms" && html`<${AlarmCount} />`}
  </a>`);

// A menu below the person's name on a wide screen, and a sheet above the bottom of a phone.
function Menu({views, near, open}) {
  const element = useRef(null);
  return html`
    <div id="menu" class="menu" popover ref=${element} onClick=${() => element.current.hidePopover()}>
      <p class="who">${personName(session.value)}<small>Logged in as ${session.value.role}</small></p>
      ${views.map((entry) => html`
        <div key=${entry[0]} class=${near.includes(entry[0]) ? "nowhere" : IN_MENU.includes(entry[0]) ? "" : "on-phones"}>
          <${Links} views=${[entry]} open=${open} /></div>`)}
      <button class="quiet" onClick=${endSession}>Log out</button>
    </div>`;
}

export function Frame({views, open, children}) {
  const near = NEAR[session.value.role];
  const nearViews = near.map((name) => views.find(([each]) => each === name));
  const isInMenu = !near.includes(open);
  return html`
    <a class="skip" href="#view">Skip to the view</a>
    <header class="frame">
      <a class="brand" href=${pathTo("home")}><${Mark} />Skyway</a>
      <nav class="wide-only" aria-label="Views">
        <${Links} views=${views.filter(([each]) => !IN_MENU.includes(each))} open=${open} />
      </nav>
      <${Connection} />
      <${ClockText} />
      <button class="quiet person wide-only" popovertarget="menu"><${Icon} name="person" />${personName(session.value)}</button>
    </header>
    <${StaleBanner} />
    <main id="view" tabindex="-1" class=${staleClasses.value}>${children}</main>
    <nav class="bottom" aria-label="Views">
      <${Links} views=${nearViews} open=${open} hasIcons=${true} />
      <button class="quiet" popovertarget="menu" aria-current=${isInMenu ? "page" : undefined}>
        <${Icon} name="more" /><span>More</span></button>
    </nav>
    <${Menu} views=${views} near=${near} open=${open} />
    <${ConfirmDialog} />
    <${KeyDialog} />
    <${Messages} />`;
}
