// The proofs of hand-overs: the PIN, the field for the PIN, the field for a signature, the picture.

import {line, made} from "./elements.js";

const MOST_TRIES = 5;
// The field for a signature in its own units, as the server draws it.
const [WIDTH, HEIGHT] = [1000, 400];
const MOST_POINTS = 2000;
const MOST_STROKES = 100;
// Points that are nearer to each other than this are drawn as one.
const NEAREST = 6;

const here = location.pathname.replace(/\/$/, "");
// What is shown: an unchanged proof is not drawn again, because somebody may be typing.
let shown = "";

export const awaited = (state) =>
  state.packages.find((one) => one.proof_until_at && !one.dropoff_proof?.given_at);

// Called each second. `given` is called when a proof was accepted or refused.
export function showProofs(section, state, given) {
  const asked = state.packages.filter((one) => one.dropoff_proof && !hasEnded(one));
  const now = JSON.stringify(asked.map(
    ({package_id, proof_until_at, dropoff_proof}) => [package_id, proof_until_at, dropoff_proof]));
  if (now === shown) return;
  const isTyping = section.contains(document.activeElement);
  shown = now;
  section.hidden = asked.length === 0;
  section.replaceChildren(...asked.map((one) => card(one, given)));
  if (isTyping) section.querySelector("input")?.focus();
}

const hasEnded = (one) =>
  !one.dropoff_proof.given_at && !["CREATED", "LOADED", "IN_TRANSIT"].includes(one.state);

function card(one, given) {
  const proof = one.dropoff_proof;
  const title = made("h2", {textContent: `Hand-over of ${one.package_id}`});
  return made("article", {}, title, ...(proof.given_at ? confirmed(one) : parts(one, given)));
}

function confirmed(one) {
  const lines = [line("The hand-over is confirmed.", "done")];
  if (one.dropoff_proof.picture) {
    const alt = one.dropoff_proof.method === "PHOTO" ? "Photo of the hand-over" : "Signature";
    const src = `${here}/packages/${one.package_id}/picture`;
    lines.push(made("img", {src, alt, className: "proof"}));
  }
  return lines;
}

function parts(one, given) {
  const {method, pin, wrong_pins: wrong} = one.dropoff_proof;
  const isThere = Boolean(one.proof_until_at);
  if (wrong >= MOST_TRIES) {
    return [line("Too many wrong PINs. Ask the sender to confirm the hand-over.", "bad")];
  }
  if (method === "PHOTO") return [line("The drone takes a photo of the hand-over.")];
  if (method === "SIGNATURE") {
    return isThere ? [signatureForm(one, given)] : [line("You sign here when the drone is there.")];
  }
  const told = [line("Your PIN:"), line(pin ?? "", "pin")];
  if (!isThere) return [...told, line("Type it here or at the drone, when the drone is there.")];
  const tries = wrong > 0 ? [line(`Wrong PIN. ${MOST_TRIES - wrong} tries are left.`, "bad")] : [];
  tries.forEach((each) => each.setAttribute("role", "alert"));
  return [...told, ...tries, pinForm(one, given)];
}

// A form whose button gives what `read` returns; null gives nothing.
function form(one, given, read, ...children) {
  const trouble = made("p", {className: "bad"});
  trouble.setAttribute("role", "alert");
  const button = made("button", {type: "submit", textContent: "Confirm the hand-over"});
  const whole = made("form", {}, ...children, trouble, button);
  whole.addEventListener("submit", async (event) => {
    event.preventDefault();
    const body = read();
    if (body === null) return;
    button.disabled = true;
    trouble.textContent = await refusal({package_id: one.package_id, ...body});
    button.disabled = false;
    given();
  });
  return whole;
}

async function refusal(body) {
  const answer = await fetch(`${here}/proof`, {
    method: "POST",
    headers: {"content-type": "application/json"},
    body: JSON.stringify(body),
  }).catch(() => null);
  if (!answer) return "No connection. Try again.";
  if (answer.ok || ("pin" in body && answer.status === 422)) return ""; // the tries are shown
  if (answer.status === 409) return "The drone does not wait any more.";
  return answer.status === 429 ? "Too many tries. Wait a moment." : "This was not accepted.";
}

function labelled(text, input) {
  return made("label", {}, made("span", {textContent: text}), input);
}

function pinForm(one, given) {
  const input = made("input", {
    inputMode: "numeric", autocomplete: "off", pattern: "[0-9]{1,8}", maxLength: 8, required: true,
    title: "up to 8 digits",
  });
  return form(one, given, () => ({pin: input.value}), labelled("Type the PIN", input));
}

function signatureForm(one, given) {
  const strokes = [];
  const canvas = made("canvas", {width: WIDTH, height: HEIGHT});
  canvas.setAttribute("role", "img");
  canvas.setAttribute("aria-label", "Field to sign in, with a finger or a pen");
  drawOn(canvas, strokes);
  const clear = made("button", {type: "button", textContent: "Clear", className: "quiet"});
  clear.addEventListener("click", () => {
    strokes.length = 0;
    canvas.getContext("2d").clearRect(0, 0, WIDTH, HEIGHT);
  });
  const name = made("input", {autocomplete: "name", maxLength: 100});
  const read = () => {
    if (name.value.trim()) return {signature: {name: name.value.trim()}};
    if (strokes.length > 0) return {signature: {strokes}};
    name.focus();
    return null;
  };
  const label = line("Sign here:");
  return form(one, given, read, label, canvas, clear, labelled("Or type your name", name));
}

function drawOn(canvas, strokes) {
  const pen = canvas.getContext("2d");
  Object.assign(pen, {lineWidth: 6, lineCap: "round", lineJoin: "round", strokeStyle: "#000"});
  let stroke = null;
  const pointOf = ({offsetX, offsetY}) => [
    Math.min(Math.max(Math.round((offsetX / canvas.clientWidth) * WIDTH), 0), WIDTH),
    Math.min(Math.max(Math.round((offsetY / canvas.clientHeight) * HEIGHT), 0), HEIGHT),
  ];
  const add = (point) => {
    const points = strokes.reduce((sum, each) => sum + each.length, 0);
    if (points >= MOST_POINTS) return;
    pen.beginPath();
    pen.moveTo(...(stroke.at(-1) ?? point));
    pen.lineTo(...point);
    pen.stroke();
    stroke.push(point);
  };
  canvas.addEventListener("pointerdown", (event) => {
    if (strokes.length >= MOST_STROKES) return;
    canvas.setPointerCapture(event.pointerId);
    const first = pointOf(event);
    stroke = [];
    add(first);
    if (stroke.length > 0) strokes.push(stroke);
  });
  canvas.addEventListener("pointermove", (event) => {
    if (stroke === null || stroke.length === 0) return;
    const [x, y] = pointOf(event);
    const [lastX, lastY] = stroke.at(-1);
    if (Math.hypot(x - lastX, y - lastY) >= NEAREST) add([x, y]);
  });
  for (const end of ["pointerup", "pointercancel"]) {
    canvas.addEventListener(end, () => { stroke = null; });
  }
}
