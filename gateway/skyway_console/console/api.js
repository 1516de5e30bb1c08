// Calls of the gateway. The browser sends the session's cookie by itself.

import {signal} from "@preact/signals";

export const LOGIN = "/v1/sessions";

// Counts the calls that were refused because there is no session any more.
export const refusedCalls = signal(0);

// What waits for the API key itself, because a session may not do it: called with the key, or null.
export const keyWanted = signal(null);

// How long an answer may take until it counts as lost.
const READ_WITHIN_MS = 60_000;
// What was not done because too much is asked is asked again this often, at most this much later.
const MOST_REPEATS = 3;
const LONGEST_PAUSE_S = 10;
const S_IN_MS = 1_000;
const MOST_OF_A_PAGE = 200;

const sentence = (text) => `${text.charAt(0).toUpperCase()}${text.slice(1)}${/[.!?]$/.test(text) ? "" : "."}`;

// What somebody can try after a refusal, by its status.
function whatToTry(status, retryAfterS) {
  if (status === 0) return "Check your connection and try again.";
  if (status === 401) return "Log in again.";
  if (status === 403) return "Ask an operator for a key that may do this.";
  if (status === 404) return "It may be gone: open the list again.";
  if (status === 409) return "Look at it again: somebody may have changed it.";
  if (status === 429) return `Try again in ${retryAfterS ?? "a few"} s.`;
  return status >= 500 ? "Try again in a minute. Your data is safe." : "";
}

// What the gateway answered instead of doing it, and what to try; `problem` is its answer.
export class Refusal extends Error {
  constructor(status, problem, retryAfterS = null) {
    const said = sentence(problem.detail ?? problem.title ?? `The gateway answered ${status}`);
    super(`${said} ${whatToTry(status, retryAfterS)}`.trim());
    this.status = status;
    this.problem = problem;
  }
}

const refused = (answer, problem) => new Refusal(answer.status, problem, answer.headers.get("Retry-After"));

// The key that somebody types, or null. A question that waits already is given up.
const askForKey = () => new Promise((give) => {
  keyWanted.value?.(null);
  keyWanted.value = give;
});

const pause = (seconds) => new Promise((go) => setTimeout(go, seconds * S_IN_MS));

// Whether the call may be sent once more: nothing was accepted, or its key says that it is the same.
const mayRepeat = (status, {code}, headers) =>
  code === "OVERLOADED" || (status === 503 && "Idempotency-Key" in headers);

// The answer of a call as JSON, or null where it has no content. Throws a Refusal.
export async function call(method, path, body, headers = {}, repeats = MOST_REPEATS) {
  let answer;
  try {
    answer = await fetch(path, {
      method,
      headers: {...(body === undefined ? {} : {"Content-Type": "application/json"}), ...headers},
      body: body === undefined ? undefined : JSON.stringify(body),
      signal: method === "GET" ? AbortSignal.timeout(READ_WITHIN_MS) : undefined,
    });
  } catch {
    throw new Refusal(0, {title: "The gateway does not answer."});
  }
  if (answer.ok) return answer.status === 204 ? null : answer.json();
  // A key or a login that is refused says nothing of the session that this browser has.
  if (answer.status === 401 && path !== LOGIN && !headers.Authorization) refusedCalls.value += 1;
  const problem = await answer.json().catch(() => ({}));
  // The key is sent with this one call, and kept nowhere.
  const key = problem.code === "KEY_NEEDED" && (await askForKey());
  if (key) return call(method, path, body, {...headers, Authorization: `Bearer ${key}`});
  if (repeats > 0 && mayRepeat(answer.status, problem, headers)) {
    await pause(Math.min(Number(answer.headers.get("Retry-After") ?? 1), LONGEST_PAUSE_S));
    return call(method, path, body, headers, repeats - 1);
  }
  throw refused(answer, problem);
}

export const get = (path) => call("GET", path);
export const post = (path, body, headers) => call("POST", path, body ?? {}, headers);

// The first items of a list, page by page, up to `most`, and whether there are more.
export async function firstOf(path, most) {
  let [items, cursor] = [[], null];
  do {
    const limit = Math.min(MOST_OF_A_PAGE, most - items.length);
    const joint = path.includes("?") ? "&" : "?";
    const page = await get(`${path}${joint}limit=${limit}${cursor ? `&cursor=${encodeURIComponent(cursor)}` : ""}`);
    [items, cursor] = [[...items, ...page.items], page.next_cursor];
  } while (cursor && items.length < most);
  return {items, hasMore: Boolean(cursor)};
}

export const all = async (path, most = 2_000) => (await firstOf(path, most)).items;

export const part = encodeURIComponent;

// Two moments, in ms, as the query of a call.
export const spanQuery = (from, to) => `from=${new Date(from).toISOString()}&to=${new Date(to).toISOString()}`;

// Saves a list as a CSV file: all its pages, with the names of the columns once.
export async function saveCsv(path, name) {
  const rows = [];
  for (let next = path; next;) {
    const answer = await fetch(next, {headers: {Accept: "text/csv"}});
    if (!answer.ok) throw refused(answer, await answer.json().catch(() => ({})));
    const text = await answer.text();
    rows.push(rows.length ? text.slice(text.indexOf("\r\n") + 2) : text);
    next = /<([^>]+)>; rel="next"/.exec(answer.headers.get("Link") ?? "")?.[1];
  }
  const link = document.createElement("a");
  link.href = URL.createObjectURL(new Blob(rows, {type: "text/csv"}));
  link.download = name;
  link.click();
  URL.revokeObjectURL(link.href);
}
