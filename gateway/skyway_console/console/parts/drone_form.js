// The form that registers a drone; the answer holds the token with which it enrols.

import {all} from "../api.js";
import {html} from "../html.js";
import {allStationIds} from "../networks.js";
import {useRead} from "../use_read.js";
import {modelName, stationName} from "../words.js";
import {given, sending} from "./sent_form.js";

async function readChoices(providerId) {
  const [models, stations] = await Promise.all([all("/v1/drone-models"), allStationIds()]);
  const usable = models.filter(({provider_id}) => [null, providerId].includes(provider_id));
  return {models: usable.map(({model_id}) => model_id), stations};
}

const droneOf = ({model, home, name, registration}) =>
  given({model_id: model, home_station_id: home, name, registration});

export function DroneForm({providerId, onRegister}) {
  const {answer} = useRead(() => readChoices(providerId), {key: providerId});
  const choices = answer ?? {models: [], stations: []};
  return html`
    <form class="fields" aria-label="New drone" onSubmit=${sending(droneOf, onRegister)}>
      <label>Model<select name="model" required>
        ${choices.models.map((each) => html`<option value=${each}>${modelName(each)}</option>`)}
      </select></label>
      <label>Home station<select name="home" required>
        <option value="">Choose a station</option>
        ${choices.stations.map((each) => html`<option value=${each}>${stationName(each)}</option>`)}
      </select></label>
      <label>Name (optional)<input name="name" maxlength="200" /></label>
      <label>Registration mark (optional)<input name="registration" maxlength="64" placeholder="N123SK" /></label>
      <div class="commands"><button class="main">Register the drone</button></div>
    </form>`;
}
