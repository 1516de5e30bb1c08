// Who uses the console: a session begins with a key, or with a link that logs in once.

import {signal} from "@preact/signals";

import {LOGIN, call, get} from "./api.js";
import {wordsOfId} from "./words.js";

// undefined while the gateway was not asked, null without a session.
export const session = signal(undefined);

// The code of a login link that waits for an answer, because somebody is logged in already.
export const offeredLogin = signal(null);

// Why a login link was refused.
export const loginProblem = signal("");

const LOGIN_LINK = /^#login=([\w-]+)$/;

export async function recogniseSession() {
  const code = readLoginCode();
  session.value = await get("/v1/sessions/current").catch(() => null);
  if (code) await openLoginLink(code);
}

// The code in the address, which leaves the address bar and the history.
function readLoginCode() {
  const [, code] = LOGIN_LINK.exec(location.hash) ?? [];
  if (code) history.replaceState(null, "", location.pathname);
  return code;
}

// Somebody else's link may not replace a session unseen: what is entered then would be theirs.
async function openLoginLink(code) {
  if (session.value) offeredLogin.value = code;
  else await login(code).catch((refusal) => (loginProblem.value = refusal.message));
}

const login = async (code) => (session.value = await call("POST", LOGIN, {code}));

// Nothing that was read for the session before stays in the page.
export async function replaceSession(code) {
  await login(code);
  location.reload();
}

// A link that is opened where the console is open changes only the address.
addEventListener("hashchange", () => {
  const code = readLoginCode();
  if (code) openLoginLink(code);
});

export async function beginSession(key) {
  session.value = await call("POST", LOGIN, undefined, {Authorization: `Bearer ${key}`});
}

export async function endSession() {
  await call("DELETE", "/v1/sessions/current").catch(() => null);
  session.value = null;
}

// The name of somebody. The ids of providers are not for reading.
export const personName = ({subject_id: id, role}) => (role === "provider" ? "Provider" : wordsOfId(id));

export const isOperator = () => session.value?.role === "operator";
