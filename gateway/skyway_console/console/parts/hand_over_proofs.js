// The proofs of hand-overs: what is asked for, the PIN, whether it is given, and the picture.

import {post} from "../api.js";
import {WORDS} from "../desk_words.js";
import {fleetNow} from "../fleet_clock.js";
import {html} from "../html.js";
import {session} from "../session.js";
import {inWords, momentText} from "../words.js";
import {Facts} from "./facts.js";
import {attempt} from "./messages.js";
import {SureButton} from "./sure_button.js";

const UNDER_WAY = ["CREATED", "LOADED", "IN_TRANSIT"];

// A wait that has ended stays in the delivery.
const isAwaited = ({state, proof_wait: wait, dropoff_proof: proof}) =>
  wait && !proof.given_at && ["LOADED", "IN_TRANSIT"].includes(state) && Date.parse(wait.until_at) >= fleetNow();

function stateText(each) {
  const {given, awaited, later, ended} = WORDS.proof;
  const {given_at: at, given_by: by} = each.dropoff_proof;
  if (at) return given(momentText(at), inWords(by).toLowerCase());
  if (isAwaited(each)) return awaited(momentText(each.proof_wait.until_at));
  return UNDER_WAY.includes(each.state) && !each.proof_wait ? later : ended;
}

function HandOver({each, path, onGiven}) {
  const {package_id: packageId, dropoff_proof: proof} = each;
  const at = `${path}/packages/${packageId}/proof`;
  const confirm = async () => {
    if (await attempt(() => post(at), WORDS.proof.confirmed)) onGiven();
  };
  const mayConfirm = isAwaited(each) && session.value.role === "customer";
  return html`
    <article class="card" aria-label=${WORDS.proof.of(packageId)}>
      <h3>${WORDS.proof.of(packageId)}</h3>
      <${Facts} of=${[
        [WORDS.proof.method, WORDS.proof.methods[proof.method]],
        [WORDS.proof.pin, proof.pin],
        [WORDS.proof.wrong, proof.wrong_pins || null],
        [WORDS.proof.state, stateText(each)],
      ]} />
      ${proof.picture && html`<img class="proof" src=${`${at}/picture`} alt=${WORDS.proof.picture(packageId)} />`}
      ${mayConfirm && html`<${SureButton} verb=${WORDS.proof.confirm} kind=""
        label=${`${WORDS.proof.confirm}: ${packageId}`} onSure=${confirm} />`}
    </article>`;
}

export function HandOverProofs({packages, path, onGiven}) {
  const proven = packages.filter((each) => each.dropoff_proof);
  return proven.length > 0 && html`
    <h2>${WORDS.proof.title}</h2>
    <div class="statements">${proven.map((each) => html`
      <${HandOver} key=${each.package_id} each=${each} path=${path} onGiven=${onGiven} />`)}</div>`;
}
