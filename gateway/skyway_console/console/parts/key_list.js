// API keys: operators list, make and delete them, and customers their test keys; each holder gets the next key of the own one.

import {useState} from "preact/hooks";

import {all, call, part, post} from "../api.js";
import {WORDS} from "../desk_words.js";
import {html} from "../html.js";
import {isOperator} from "../session.js";
import {useRead} from "../use_read.js";
import {dayText, inWords} from "../words.js";
import {KeyForm, TestKeyForm} from "./key_form.js";
import {attempt} from "./messages.js";
import {SecretBox} from "./secret_box.js";
import {SureButton} from "./sure_button.js";
import {Table, unseen} from "./table.js";

function secretsOf({key, mqtt}) {
  return [["Key", key], ...(mqtt ? [["Broker user", mqtt.user_name], ["Broker password", mqtt.password]] : [])];
}

const COLUMNS = [
  ["Name", ({key_id, name}) => html`${name && html`${name}<br />`}<small>${key_id}</small>`, "title"],
  ["For", ({subject_id, role}) => html`${subject_id}<br /><small>${inWords(role)}</small>`],
  [WORDS.keys.mode, ({livemode}) => (livemode ? WORDS.keys.live : html`<span class="tag">${WORDS.keys.test}</span>`)],
  ["Allows", ({scopes}) => (scopes ? scopes.join(", ") : "all of its role")],
  ["Made", ({created_wall_at: at}) => dayText(at)],
  ["Ends", ({expires_wall_at: at}) => (at ? dayText(at) : "never")],
];

export function KeyList() {
  const {answer: keys, problem, again: read} = useRead(() => all("/v1/keys"));
  const [made, setMade] = useState(null);

  async function make(wanted) {
    const isMade = await attempt(async () => setMade(await post("/v1/keys", wanted)));
    if (isMade) read();
    return isMade;
  }
  async function remove({key_id}) {
    if (await attempt(() => call("DELETE", `/v1/keys/${part(key_id)}`), "The key is deleted.")) read();
  }

  const deleting = [unseen("Delete"), (each) => (isOperator() || !each.livemode) && html`
    <${SureButton} verb="Delete" label=${`Delete key ${each.name ?? each.key_id}`} onSure=${() => remove(each)} />`];
  return html`
    <h2>Keys</h2>
    ${problem && html`<p class="refused" role="alert">${problem}</p>`}
    <${Table} label="Keys" items=${keys ?? []} columns=${[...COLUMNS, deleting]} row=${({key_id: key}) => ({key})} />
    ${made && html`<${SecretBox} title="The new key" secrets=${secretsOf(made)} onClose=${() => setMade(null)}
      hint="It is shown only now. Nobody can read it again." />`}
    ${isOperator() ? html`<h2>New key</h2><${KeyForm} onMake=${make} />`
      : html`<h2>${WORDS.keys.newTest}</h2><p>${WORDS.keys.about}</p><${TestKeyForm} onMake=${make} />`}`;
}

export function OwnKey() {
  const [next, setNext] = useState(null);
  const rotate = () => attempt(async () => setNext(await post("/v1/keys/rotations")));
  return html`
    <h2>Your key</h2>
    <p>The next key allows what your key allows. Your present key ends when the next one is first used,
      at the latest after a day; so does this session.</p>
    ${next
      ? html`<${SecretBox} title="The next key" secrets=${secretsOf(next)} onClose=${() => setNext(null)}
          hint="It is shown only now. Nobody can read it again." />`
      : html`<${SureButton} verb="Get the next key" label="Get the next key" kind="" onSure=${rotate} />`}`;
}
