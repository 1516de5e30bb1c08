// The tracking page: shows the state of a delivery, and follows it while it is under way.

import {awaited, showProofs} from "./proofs.js";
import {drawWay} from "./way_map.js";
import {WORDS, placeText} from "./words.js";

const STAGES = [
  ["REQUESTED", "Requested"],
  ["PLANNED", "Planned"],
  ["ON_THE_WAY", "On the way"],
  ["DELIVERED", "Delivered"],
];
// A drone this near, in seconds of fleet time, is arriving.
const ARRIVING_S = 120;
// A delivery that is later than expected by so much, in seconds of fleet time, is overdue.
const OVERDUE_S = 120;
const LOOK_AGAIN_MS = 60_000;
// What was refused or not answered is tried again after this time.
const AGAIN_MS = 5_000;

const here = location.pathname.replace(/\/$/, "");
const element = (id) => document.getElementById(id);

let state = null;
let readAt = 0;
// What the stream says of the drones, or null while the state is newer.
let drones = null;
let stream = null;
let followAgainAt = 0;
let again = null;
let isEnded = false;

// A station without a name is shown by the words of its id.
const nameOf = (stationId) => state.station_names[stationId] ??
  stationId.split(/[-_]/).map((word) => word.charAt(0).toUpperCase() + word.slice(1)).join(" ");
const fleetNow = () => Date.parse(state.now) + (Date.now() - readAt) * state.rate;
const clockTime = (moment) =>
  new Date(moment).toLocaleTimeString([], {hour: "2-digit", minute: "2-digit"});
const secondsTo = (moment) => (Date.parse(moment) - fleetNow()) / 1000;

function paragraph(text, name = "") {
  const made = document.createElement("p");
  made.textContent = text;
  made.className = name;
  return made;
}

// The next package that is still to come.
function nextPackage() {
  return state.packages
    .filter(({delivered_at, eta_at}) => !delivered_at && eta_at)
    .sort((one, other) => Date.parse(one.eta_at) - Date.parse(other.eta_at))[0];
}

const isOverdue = (next) => secondsTo(next.eta_at) < -OVERDUE_S;

function isArriving(next) {
  return state.stage === "ON_THE_WAY" && !isOverdue(next) && secondsTo(next.eta_at) <= ARRIVING_S;
}

const withoutTime = () => (state.stage === "ON_THE_WAY" ? "On the way" : "Planned");

function headline(next) {
  switch (state.stage) {
    case "DELIVERED": return "Delivered";
    case "PARTLY_DELIVERED": return "Delivered in part";
    case "ENDED": return state.state === "CANCELLED" ? "Cancelled" : "Not delivered";
    case "REQUESTED": return state.is_waiting ? "Waiting for a drone" : "Requested";
    default:
      if (awaited(state)) return "The drone is here";
      if (next === undefined || state.is_replanning || isOverdue(next)) return withoutTime();
      return isArriving(next) ? "Arriving" : `Arrives at ${clockTime(next.eta_at)}`;
  }
}

function detail(next) {
  if (state.is_over || next === undefined) return "";
  const waiting = awaited(state);
  if (waiting) {
    return `It waits at ${nameOf(waiting.station_id)} until ${clockTime(waiting.proof_until_at)}.`;
  }
  if (state.is_replanning) return "The plan is being changed. A new time follows.";
  if (isOverdue(next)) return `Expected at ${clockTime(next.eta_at)}. It takes longer than planned.`;
  const [from, until] = [clockTime(next.eta_at), clockTime(next.eta_until_at)];
  const minutes = Math.max(0, Math.round(secondsTo(next.eta_at) / 60));
  const range = from === until ? "" : `Between ${from} and ${until}. `;
  const shared = state.is_shared ? " The drone carries packages of others too." : "";
  const pickup = state.stage !== "ON_THE_WAY" && state.other_pickup_id
    ? ` The drone is loaded at ${nameOf(state.other_pickup_id)}.` : "";
  return `${range}${minutes} min to ${nameOf(next.station_id)}.${shared}${pickup}`;
}

function showStages() {
  const reached = {LOADING: "PLANNED", PARTLY_DELIVERED: "DELIVERED"}[state.stage] ?? state.stage;
  const place = STAGES.findIndex(([stage]) => stage === reached);
  element("stages").hidden = place < 0;
  element("stages").replaceChildren(...STAGES.map(([, name], number) => {
    const item = document.createElement("li");
    item.textContent = name;
    item.className = number < place || reached === "DELIVERED" ? "past" : number === place ? "now" : "";
    if (number === place) item.setAttribute("aria-current", "step");
    return item;
  }));
}

// What the drone measured at the hand-over.
function measured({proof_mass_kg: massKg, proof_position: position}) {
  return [
    ...(typeof massKg === "number" ? [`Mass: ${Number(massKg.toFixed(3))} kg`] : []),
    ...(position ? [`Place: ${placeText(position)}`] : []),
  ];
}

// The pad where a package comes down. The page does not know where its recipient lives.
function padLines({station_id: stationId}) {
  const position = state.places.find((each) => each.station_id === stationId)?.position;
  if (!position) return [];
  const [longitude, latitude] = position;
  const link = document.createElement("a");
  link.href = `geo:${latitude},${longitude}`;
  link.textContent = WORDS.openMap;
  link.className = "way";
  return [paragraph(WORDS.pad(nameOf(stationId), placeText(position))), link];
}

function packageLines(one) {
  if (one.delivered_at) {
    const where = nameOf(one.proof_station_id ?? one.station_id);
    return [
      paragraph(`Handed over at ${where}, ${clockTime(one.delivered_at)}`, "done"),
      ...measured(one).map((text) => paragraph(text)),
    ];
  }
  const ends = {
    RETURNED: "Returned to the sender",
    RETURNING: "On its way back",
    STRANDED: "Left at a safe landing. The sender is notified.",
    CANCELLED: "Not delivered",
  };
  if (one.state in ends) return [paragraph(ends[one.state], "bad")];
  const lines = [];
  if (one.eta_at) {
    const isLate = one.due_at && Date.parse(one.eta_at) - Date.parse(one.due_at) > 60_000;
    const late = isLate ? `, promised by ${clockTime(one.due_at)}` : "";
    lines.push(paragraph(`Expected ${clockTime(one.eta_at)}${late}`, isLate ? "late" : ""));
  }
  lines.push(...padLines(one));
  lines.push(paragraph(
    `If nobody is there, the drone waits a moment and then takes it to ${nameOf(one.alternative_id)}.`,
  ));
  return lines;
}

function showPackages() {
  element("packages").replaceChildren(...state.packages.map((one) => {
    const card = document.createElement("article");
    const title = document.createElement("h2");
    title.textContent = `${one.package_id} to ${nameOf(one.station_id)}`;
    card.append(title, ...packageLines(one));
    return card;
  }));
}

function setText(id, text) {
  // An unchanged text is not announced again to people who listen.
  if (element(id).textContent !== text) element(id).textContent = text;
}

function showShop({name, colour, text_colour: textColour}) {
  element("shop").hidden = name === null;
  setText("shop", name ?? "");
  element("shop").style.backgroundColor = colour ?? "";
  element("shop").style.color = textColour ?? "";
}

function show() {
  const next = nextPackage();
  setText("headline", headline(next));
  setText("detail", detail(next));
  showShop(state.shop);
  document.title = WORDS.title(headline(next), state.shop.name);
  showStages();
  showProofs(element("proofs"), state, look);
  showPackages();
  const flying = drones === null ? state.drones : Object.values(drones);
  drawWay(element("map"), state, state.is_over ? [] : flying, nameOf);
}

function showConnection(text) {
  element("connection").hidden = text === "";
  setText("connection", text);
}

function showEnd() {
  stream?.close();
  state = null;
  isEnded = true;
  setText("headline", "This link has ended");
  setText("detail", "Ask the sender for another one.");
  for (const id of ["stages", "proofs", "map", "packages"]) element(id).hidden = true;
}

function showTrouble(text) {
  showConnection(text);
  again = setTimeout(look, AGAIN_MS);
}

async function look() {
  clearTimeout(again);
  if (isEnded) return;
  let answer;
  try {
    answer = await fetch(`${here}/state`);
  } catch {
    showTrouble("No connection. The page goes on by itself.");
    return;
  }
  if (answer.status === 404) {
    showEnd();
    return;
  }
  if (!answer.ok) {
    showTrouble("The service does not answer just now. The page goes on by itself.");
    return;
  }
  state = await answer.json();
  readAt = Date.now();
  // A stream that does not run knows less than this state.
  if (stream?.readyState !== EventSource.OPEN) drones = null;
  showConnection("");
  show();
  if (state.is_over) stream?.close();
  else if (!isFollowing() && Date.now() >= followAgainAt) follow();
}

// Merge patches (RFC 7396) keep a document of deliveries and drones up to date.
function merged(target, patch) {
  if (typeof patch !== "object" || patch === null || Array.isArray(patch)) return patch;
  const result = typeof target === "object" && target !== null ? {...target} : {};
  for (const [name, value] of Object.entries(patch)) {
    if (value === null) delete result[name];
    else result[name] = merged(result[name], value);
  }
  return result;
}

function isFollowing() {
  return stream !== null && stream.readyState !== EventSource.CLOSED;
}

function follow() {
  let picture = {};
  followAgainAt = Date.now() + AGAIN_MS;
  stream = new EventSource(`${here}/events`);
  const take = (document) => {
    const before = JSON.stringify(picture.deliveries);
    picture = document;
    drones = picture.drones ?? {};
    if (JSON.stringify(picture.deliveries) !== before) look();
    else if (state) show();
  };
  stream.addEventListener("snapshot", ({data}) => take(JSON.parse(data)));
  stream.addEventListener("change", ({data}) => take(merged(picture, JSON.parse(data))));
  stream.addEventListener("error", () => {
    if (stream.readyState !== EventSource.CLOSED) return; // the browser connects again by itself
    look();
    setTimeout(look, AGAIN_MS);
  });
}

// While the page slept its stream may have ended, and looks open: nothing has told the browser.
document.addEventListener("visibilitychange", () => {
  if (document.visibilityState !== "visible") return;
  stream?.close();
  followAgainAt = 0;
  look();
});
setInterval(() => state && !state.is_over && show(), 1_000);
setInterval(() => document.visibilityState === "visible" && !state?.is_over && look(), LOOK_AGAIN_MS);
look();
