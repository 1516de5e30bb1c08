// Who uses the console: a session begins with a key, or with a link that logs in once.

import {signal} from "@preact/signals";

import {call, get} from "./api.js";

// undefined while the gateway was not asked, null without a session.
export const session = signal(undefined);

const LOGIN_LINK = /^#login=([\w-]+)$/;

export async function recogniseSession() {
  const [, code] = LOGIN_LINK.exec(location.hash) ?? [];
  try {
    if (code) {
      // The code is used up: it leaves the address bar and the history.
      history.replaceState(null, "", location.pathname);
      session.value = await call("POST", "/v1/sessions", {code});
    } else {
      session.value = await get("/v1/sessions/current");
    }
  } catch (refusal) {
    session.value = null;
    if (code) throw refusal;
  }
}

export async function beginSession(key) {
  session.value = await call("POST", "/v1/sessions", undefined, {Authorization: `Bearer ${key}`});
}

export async function endSession() {
  await call("DELETE", "/v1/sessions/current").catch(() => null);
  session.value = null;
}

export const isOperator = () => session.value?.role === "operator";
