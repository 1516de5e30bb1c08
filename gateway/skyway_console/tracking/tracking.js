// The tracking page: shows the state of a delivery, and follows it while it is under way.

import {merged} from "/console/merge_patch.js";

import {made} from "./elements.js";
import {Glide} from "./glide.js";
import {clockTime, zoneText} from "./moments.js";
import {showPackages} from "./packages.js";
import {showProofs} from "./proofs.js";
import {said} from "./said.js";
import {WayMap} from "./way_map.js";
import {WORDS} from "./words.js";

// What the stages of the state are on the page.
const SHOWN_AS = {LOADING: "PLANNED", PARTLY_DELIVERED: "DELIVERED"};
const LOOK_AGAIN_MS = 60_000;
// What was refused or not answered is tried again after this time.
const AGAIN_MS = 5_000;
// A drone that was not seen for so long is shown as old, seconds of wall time and of fleet time.
const OLD_WALL_S = 20;
const OLD_FLEET_S = 60;

const here = location.pathname.replace(/\/$/, "");
const element = (id) => document.getElementById(id);
const glide = new Glide();
const map = new WayMap(element("map"));

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

function setText(id, text) {
  // An unchanged text is not announced again to people who listen.
  if (element(id).textContent !== text) element(id).textContent = text;
}

// When each stage was reached or is expected; a stage without a moment has no time.
function stageMoments() {
  const {requested_at: requested, loaded_at: loaded, packages} = state;
  const ends = packages.map(({delivered_at: at, eta_at: eta}) => at ?? eta).filter(Boolean).sort();
  return {REQUESTED: requested, ON_THE_WAY: loaded, DELIVERED: ends.at(-1)};
}

function showStages() {
  const reached = SHOWN_AS[state.stage] ?? state.stage;
  const place = Object.keys(WORDS.stages).indexOf(reached);
  const moments = stageMoments();
  element("stages").hidden = place < 0;
  element("stages").replaceChildren(...Object.entries(WORDS.stages).map(([stage, name], number) => {
    const item = made("li", {}, name);
    if (moments[stage]) item.append(made("time", {textContent: clockTime(moments[stage], fleetNow())}));
    item.className = number < place || reached === "DELIVERED" ? "past" : number === place ? "now" : "";
    if (number === place) item.setAttribute("aria-current", "step");
    return item;
  }));
}

function showShop({name, colour, text_colour: textColour}) {
  element("shop").hidden = name === null;
  setText("shop", name ?? "");
  element("shop").style.backgroundColor = colour ?? "";
  element("shop").style.color = textColour ?? "";
}

const isOld = ({at}) => at && fleetNow() - Date.parse(at) > 1_000 * Math.max(OLD_FLEET_S, OLD_WALL_S * state.rate);

const flying = () => glide.shown(Date.now()).map((drone) => ({...drone, isOld: isOld(drone)}));

function showWay() {
  glide.report(state.is_over ? {} : drones ?? {...state.drones}, Date.now());
  const shown = flying();
  element("way").hidden = state.places.length === 0;
  if (state.places.length > 0) map.draw(state, shown, nameOf);
  const old = shown.find((drone) => drone.isOld);
  setText("seen", old ? WORDS.lastSeen(clockTime(old.at, fleetNow())) : "");
}

function show() {
  const {headline, promise, detail, isLate} = said(state, fleetNow(), nameOf);
  setText("headline", headline);
  setText("promise", promise);
  setText("detail", detail);
  // What is announced changes with the stage, not each minute.
  setText("news", state.is_over ? headline : `${WORDS.stages[SHOWN_AS[state.stage] ?? state.stage]}. ${promise}`);
  setText("zone", WORDS.zone(zoneText(fleetNow())));
  element("hero").className = state.stage === "DELIVERED" ? "done" : state.is_over ? "bad" : isLate ? "late" : "";
  showShop(state.shop);
  document.title = WORDS.title(headline, state.shop.name);
  showStages();
  showProofs(element("proofs"), state, look);
  showPackages(element("packages"), state, {nameOf, now: fleetNow(), changed: show});
  showWay();
}

function showConnection(text) {
  element("connection").hidden = text === "";
  setText("connection", text);
}

function showEnd() {
  stream?.close();
  state = null;
  isEnded = true;
  setText("headline", WORDS.linkEnded);
  setText("promise", "");
  setText("detail", WORDS.askAgain);
  for (const id of ["stages", "proofs", "way", "packages", "zone"]) element(id).hidden = true;
}

function showTrouble(text) {
  showConnection(text(state ? clockTime(state.now, fleetNow()) : WORDS.begin));
  again = setTimeout(look, AGAIN_MS);
}

async function look() {
  clearTimeout(again);
  if (isEnded) return;
  const answer = await fetch(`${here}/state`).catch(() => null);
  if (answer?.status === 404) {
    showEnd();
    return;
  }
  if (!answer?.ok) {
    showTrouble(answer ? WORDS.noAnswer : WORDS.noConnection);
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

// Between two pictures the drones glide on. Browsers ask for no frames of a hidden page.
function move() {
  if (state && !state.is_over && state.places.length > 0) map.move(flying());
  requestAnimationFrame(move);
}

// While the page slept its stream may have ended, and looks open: nothing has told the browser.
document.addEventListener("visibilitychange", () => {
  if (document.visibilityState !== "visible") return;
  stream?.close();
  followAgainAt = 0;
  look();
});
requestAnimationFrame(move);
setInterval(() => state && !state.is_over && show(), 1_000);
setInterval(() => document.visibilityState === "visible" && !state?.is_over && look(), LOOK_AGAIN_MS);
look();
