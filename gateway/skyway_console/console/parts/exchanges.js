// Whether a provider exchanges deliveries with others, and which came to it or left it.

import {call, get, part} from "../api.js";
import {WORDS} from "../desk_words.js";
import {fleetNow} from "../fleet_clock.js";
import {html} from "../html.js";
import {useRead} from "../use_read.js";
import {momentText, shortId} from "../words.js";
import {attempt} from "./messages.js";
import {Table} from "./table.js";

const TEXTS = WORDS.exchanges;
const AGAIN_MS = 10_000;
const MOST_SHOWN = 200;

const isToday = ({at}) => at.slice(0, 10) === new Date(fleetNow()).toISOString().slice(0, 10);

const COLUMNS = [
  [TEXTS.when, ({at}) => momentText(at), "title"],
  [TEXTS.delivery, ({delivery_id: id}) => html`<span title=${id}>${shortId(id)}</span>`],
  [TEXTS.what, ({direction}) => TEXTS.directions[direction]],
  [TEXTS.why, ({reason}) => reason, "wide-cell"],
];

export function Exchanges({providerId}) {
  const path = `/v1/providers/${part(providerId)}`;
  const read = () => Promise.all([get(path), get(`${path}/exchanges?limit=${MOST_SHOWN}`)]);
  const {answer, problem, again} = useRead(read, {key: path, everyMs: AGAIN_MS});
  if (!answer) return html`<p class="refused">${problem}</p>`;
  const [{exchanges_deliveries: agrees}, {items, next_cursor: more}] = answer;
  const today = items.filter(isToday);
  const count = (direction) => today.filter((each) => each.direction === direction).length;
  const agree = async ({target: {checked}}) => {
    await attempt(() => call("PATCH", path, {exchanges_deliveries: checked}), TEXTS.saved(checked));
    again();
  };
  return html`
    <form class="fields" aria-label=${TEXTS.title}><label class="check">
      <input type="checkbox" checked=${agrees} onChange=${agree} />${TEXTS.rule}</label></form>
    <p>${TEXTS.today(count("CAME"), count("LEFT"), more && today.length === items.length)}</p>
    ${items.length > 0 && html`<${Table} label=${TEXTS.title} items=${items} columns=${COLUMNS}
      row=${(each) => ({key: each.at + each.delivery_id})} />`}`;
}
