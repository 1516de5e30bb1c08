// The form that registers a drone; the answer holds the token with which it enrols.

import {all} from "../api.js";
import {html} from "../html.js";
import {stationsOf} from "../map/features.js";
import {listNetworks, networkContent} from "../networks.js";
import {useRead} from "../use_read.js";
import {modelName, stationName} from "../words.js";

async function readChoices(providerId) {
  const [models, networks] = await Promise.all([all("/v1/drone-models"), listNetworks()]);
  const contents = await Promise.all(networks.map(({network_id}) => networkContent(network_id)));
  const stations = contents.flatMap(stationsOf).map(({properties}) => properties.station_id).sort();
  const usable = models.filter(({provider_id}) => [null, providerId].includes(provider_id));
  return {models: usable.map(({model_id}) => model_id), stations};
}

function droneOf(form) {
  const values = new FormData(form);
  const text = (name) => values.get(name).trim();
  return {
    model_id: text("model"),
    home_station_id: text("home"),
    ...(text("name") ? {name: text("name")} : {}),
    ...(text("registration") ? {registration: text("registration")} : {}),
  };
}

export function DroneForm({providerId, onRegister}) {
  const {answer} = useRead(() => readChoices(providerId), {key: providerId});
  const choices = answer ?? {models: [], stations: []};
  async function register(event) {
    event.preventDefault();
    const form = event.target;
    if (await onRegister(droneOf(form))) form.reset();
  }
  return html`
    <form class="fields" aria-label="New drone" onSubmit=${register}>
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
