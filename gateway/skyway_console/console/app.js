// The console: asks who is there, follows the live picture, and shows the view that is open.

import {render} from "preact";
import {effect} from "@preact/signals";

import {refusedCalls} from "./api.js";
import {isClockAsked, startClock} from "./fleet_clock.js";
import {html} from "./html.js";
import {followPicture, forgetPicture} from "./live.js";
import {learnNames} from "./networks.js";
import {route} from "./routes.js";
import {loginProblem, offeredLogin, recogniseSession, session} from "./session.js";
import {followAlarms} from "./parts/alarm_sound.js";
import {Frame} from "./parts/frame.js";
import {LoginForm} from "./parts/login_form.js";
import {LoginQuestion} from "./parts/login_question.js";
import {AccountView} from "./views/account.js";
import {AlarmsView} from "./views/alarms.js";
import {CustomerView} from "./views/customer.js";
import {DeliveriesView} from "./views/deliveries.js";
import {HealthView} from "./views/health.js";
import {HomeView} from "./views/home.js";
import {MapView} from "./views/map.js";
import {ProviderView} from "./views/provider.js";
import {ReplayView} from "./views/replay.js";
import {ScheduleView} from "./views/schedule.js";
import {StatementsView} from "./views/statements.js";

// By the first part of the address: the view, its name, and the roles that have it.
const VIEWS = {
  home: {view: HomeView, name: "Home", roles: ["operator", "provider", "customer"]},
  map: {view: MapView, name: "Map", roles: ["operator", "provider", "customer"]},
  schedule: {view: ScheduleView, name: "Schedule", roles: ["operator", "provider"]},
  new: {view: CustomerView, name: "New delivery", roles: ["customer"]},
  deliveries: {view: DeliveriesView, name: "Deliveries", roles: ["operator", "customer"]},
  fleet: {view: ProviderView, name: "Fleet", roles: ["operator", "provider"]},
  statements: {view: StatementsView, name: "Statements", roles: ["operator", "provider", "customer"]},
  alarms: {view: AlarmsView, name: "Alarms", roles: ["operator", "provider"]},
  replay: {view: ReplayView, name: "Replay", roles: ["operator", "provider"]},
  health: {view: HealthView, name: "Health", roles: ["operator"]},
  account: {view: AccountView, name: "Keys", roles: ["operator", "provider", "customer"]},
};

const opening = html`<p class="opening">Opening the console…</p>`;

function Console() {
  if (session.value === undefined) return opening;
  if (session.value === null) return html`<${LoginForm} problem=${loginProblem.value} />`;
  if (offeredLogin.value) return html`<${LoginQuestion} code=${offeredLogin.value} />`;
  if (!isClockAsked.value) return opening;
  const views = Object.entries(VIEWS).filter(([, {roles}]) => roles.includes(session.value.role));
  const [name, ...parts] = route.value;
  const [open, {view}] = views.find(([each]) => each === name) ?? views[0];
  return html`<${Frame} views=${views} open=${open}><${view} parts=${parts} /></${Frame}>`;
}

// The live picture is followed as long as there is a session.
effect(() => {
  if (session.value) {
    startClock();
    followPicture();
    learnNames().catch(() => null);
  } else {
    forgetPicture();
  }
});

followAlarms();

// A call that is refused for want of a session leads back to the form.
effect(() => {
  if (refusedCalls.value > 0 && session.peek()) session.value = null;
});

await recogniseSession();
render(html`<${Console} />`, document.body);
