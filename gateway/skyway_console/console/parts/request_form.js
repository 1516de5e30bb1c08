// The form of a request. All that a click on the map chooses can be chosen here by keyboard, too.

import {WORDS} from "../desk_words.js";
import {html} from "../html.js";
import {inWords, stationName} from "../words.js";
import {ContactFields} from "./contact_fields.js";
import {ChosenPlace, WalkLimit} from "./place_finder.js";
import {MOST_PACKAGES, OBJECTIVES, addPackage, beginAgain, change, changePackage, draft, removePackage}
  from "./request_draft.js";

const stationOptions = (stations, none) => html`
  <option value="">${none}</option>
  ${stations.map(({station_id, name}) => html`
    <option value=${station_id}>${name ?? stationName(station_id)}</option>`)}`;

function PackageRow({each, number, stations, isOnly}) {
  const set = (name) => ({target}) => changePackage(number, {[name]: target.value});
  return html`
    <fieldset class="package">
      <legend>Package ${number + 1}</legend>
      <label class="wide">To<select required value=${each.station_id}
        onChange=${({target}) => changePackage(number, {station_id: target.value, place: null})}>
        ${stationOptions(stations, "Choose a station")}
      </select></label>
      <${ChosenPlace} place=${each.place} />
      <label>Mass in kg<input required type="number" min="0.001" max="1000" step="any" inputmode="decimal"
        value=${each.mass_kg} onInput=${set("mass_kg")} /></label>
      <label>Id<input required maxlength="64" pattern="[A-Za-z0-9_\\-]+" value=${each.package_id}
        title="Letters, digits, _ and -" onInput=${set("package_id")} /></label>
      ${!isOnly && html`<button type="button" class="quiet small" aria-label=${`Remove package ${number + 1}`}
        onClick=${() => removePackage(number)}>✕</button>`}
    </fieldset>`;
}

const ProofChoice = ({each, number, isOnly}) => html`
  <label>${WORDS.proof.title}${isOnly ? "" : `, package ${number + 1}`}<select value=${each.proof}
    onChange=${({target}) => changePackage(number, {proof: target.value})}>
    ${Object.entries(WORDS.proof.methods).map(([method, text]) => html`<option value=${method}>${text}</option>`)}
  </select></label>`;

const changeTo = (name) => ({target}) => change({[name]: target.value});

const Amount = ({text, name, max}) => html`
  <label>${text}<input required type="number" min="0" max=${max} step="any" value=${draft.value[name]}
    onInput=${changeTo(name)} /></label>`;

const Choice = ({text, name}) => html`
  <label class="check"><input type="checkbox" checked=${draft.value[name]}
    onChange=${({target}) => change({[name]: target.checked})} /> ${text}</label>`;

function Wishes() {
  const {packages, objective, reference, latest, mayShare} = draft.value;
  return html`
    <div class="fields">
      ${packages.map((each, number) => html`<${ProofChoice} key=${number} each=${each} number=${number}
        isOnly=${packages.length === 1} />`)}
      <${WalkLimit} />
      <label>Best is the<select value=${objective} onChange=${changeTo("objective")}>
        ${OBJECTIVES.map((each) => html`<option value=${each}>${inWords(each)}</option>`)}
      </select></label>
      <label>Latest delivery, fleet time (optional)<input type="datetime-local" value=${latest}
        onInput=${changeTo("latest")} /></label>
      <${Amount} text="Promise an arrival time within, minutes" name="firmMinutes" max="60" />
      <${Amount} text="It may come later than promised by, minutes" name="laterMinutes" max="240" />
      <label>Reference (optional)<input maxlength="200" value=${reference} placeholder="order 1042"
        onInput=${changeTo("reference")} /></label>
      <${Choice} text="Keep the drones of the best offers for me until the offers end" name="isHeld" />
      <${Choice} text="Another provider may fly it, for the same price" name="mayChange" />
      <${Choice} text="Share the trip with packages of others, at a lower price (not with a latest delivery)" name="mayShare" />
      ${mayShare && html`<${Amount} text="Wait for others, minutes" name="waitMinutes" max="60" />
        <${Amount} text="Farthest other station where I can hand over, metres (only without an offer)" name="withinM" max="5000" />`}
    </div>`;
}

export function RequestForm({stations, isBusy, onAsk, onRequest}) {
  const {pickup, pickupPlace, packages, mayShare} = draft.value;
  const ask = (event) => {
    event.preventDefault();
    if (event.submitter?.value === "request") onRequest();
    else onAsk();
  };
  return html`
    <form class="request" aria-label="Request" onSubmit=${ask}>
      ${packages.map((each, number) => html`
        <${PackageRow} key=${number} each=${each} number=${number} stations=${stations}
          isOnly=${packages.length === 1} />`)}
      <button type="button" class="quiet add" disabled=${packages.length >= MOST_PACKAGES}
        onClick=${() => addPackage()}>Add a package</button>
      <label>Pickup<select required value=${pickup}
        onChange=${({target}) => change({pickup: target.value, pickupPlace: null})}>
        ${stationOptions(stations, "Choose a station")}
      </select></label>
      <${ChosenPlace} place=${pickupPlace} />
      <details class="more"><summary>${WORDS.contact.title}</summary><${ContactFields} /></details>
      <details class="more"><summary>${WORDS.request.more}</summary><${Wishes} /></details>
      <div class="commands">
        <button class="main" disabled=${isBusy}>${isBusy ? WORDS.request.asking : WORDS.request.ask}</button>
        ${mayShare && html`<button value="request" class="quiet" disabled=${isBusy}
          title="An offer keeps its own drone. Without one, your packages can join a trip of others.">
          Request it without an offer</button>`}
        <button type="button" class="quiet" onClick=${beginAgain}>Begin again</button>
      </div>
    </form>`;
}
