// What providers earned in a month by day, drone or route.

import {useState} from "preact/hooks";

import {all, part, saveCsv} from "../api.js";
import {WORDS} from "../desk_words.js";
import {droneName} from "../drone_names.js";
import {html} from "../html.js";
import {pathTo} from "../routes.js";
import {useRead} from "../use_read.js";
import {money, stationName} from "../words.js";
import {attempt} from "./messages.js";
import {Table} from "./table.js";

const TEXTS = WORDS.earned;
const stationText = (id) => (id ? stationName(id) : TEXTS.archived);

const NAMES = {
  day: ({day}) => day,
  drone: ({drone_id: id}) => (id ? html`<a href=${pathTo("map", "drone", id)}>${droneName(id)}</a>` : TEXTS.archived),
  route: ({from_station_id: from, to_station_id: to}) => `${stationText(from)} – ${stationText(to)}`,
};

export function Earned({month}) {
  const [by, setBy] = useState("day");
  const path = `/v1/statements/earnings?by=${by}&month=${part(month)}`;
  const {answer: found, problem} = useRead(async () => ({by, items: await all(path)}), {changed: path});
  return html`
    <div class="fields"><label>${TEXTS.by}<select value=${by} onChange=${({target}) => setBy(target.value)}>
      ${Object.keys(NAMES).map((each) => html`<option value=${each}>${TEXTS[each]}</option>`)}
    </select></label></div>
    <div class="commands"><button onClick=${() => attempt(() => saveCsv(`${path}&limit=200`, `earnings-${by}-${month}.csv`))}>
      ${TEXTS.csv}</button></div>
    ${problem && html`<p class="refused" role="alert">${problem}</p>`}
    ${found && html`<${Table} label=${TEXTS.by} items=${found.items} columns=${[
      [TEXTS[found.by], NAMES[found.by], "title"],
      [TEXTS.counted, ({deliveries}) => deliveries, "number"], [TEXTS.amount, money, "number"],
    ]} />`}`;
}
