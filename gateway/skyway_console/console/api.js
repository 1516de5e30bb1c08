// Calls of the gateway. The browser sends the session's cookie by itself.

import {signal} from "@preact/signals";

export const LOGIN = "/v1/sessions";

// Counts the calls that were refused because there is no session any more.
export const refusedCalls = signal(0);

// What waits for the API key itself, because a session may not do it: called with the key, or null.
export const keyWanted = signal(null);

// What the gateway answered instead of doing it, in a sentence; `problem` is its answer.
export class Refusal extends Error {
  constructor(status, problem) {
    super(problem.detail ?? problem.title ?? `The gateway answered ${status}.`);
    this.status = status;
    this.problem = problem;
  }
}

// The key that somebody types, or null. A question that waits already is given up.
const askForKey = () => new Promise((give) => {
  keyWanted.value?.(null);
  keyWanted.value = give;
});

// The answer of a call as JSON, or null where it has no content. Throws a Refusal.
export async function call(method, path, body, headers = {}) {
  let answer;
  try {
    answer = await fetch(path, {
      method,
      headers: {...(body === undefined ? {} : {"Content-Type": "application/json"}), ...headers},
      body: body === undefined ? undefined : JSON.stringify(body),
    });
  } catch {
    throw new Refusal(0, {title: "The gateway does not answer. Try again."});
  }
  if (answer.ok) return answer.status === 204 ? null : answer.json();
  // A key or a login that is refused says nothing of the session that this browser has.
  if (answer.status === 401 && path !== LOGIN && !headers.Authorization) refusedCalls.value += 1;
  const problem = await answer.json().catch(() => ({}));
  // The key is sent with this one call, and kept nowhere.
  const key = problem.code === "KEY_NEEDED" && (await askForKey());
  if (key) return call(method, path, body, {...headers, Authorization: `Bearer ${key}`});
  throw new Refusal(answer.status, problem);
}

export const get = (path) => call("GET", path);
export const post = (path, body, headers) => call("POST", path, body ?? {}, headers);

// All items of a list, page by page, up to `most`.
export async function all(path, most = 2_000) {
  const items = [];
  let cursor = null;
  do {
    const joint = path.includes("?") ? "&" : "?";
    const page = await get(`${path}${joint}limit=200${cursor ? `&cursor=${encodeURIComponent(cursor)}` : ""}`);
    items.push(...page.items);
    cursor = page.next_cursor;
  } while (cursor && items.length < most);
  return items;
}

export const part = encodeURIComponent;

// Saves a list as a CSV file: all its pages, with the names of the columns once.
export async function saveCsv(path, name) {
  const rows = [];
  for (let next = path; next;) {
    const answer = await fetch(next, {headers: {Accept: "text/csv"}});
    if (!answer.ok) throw new Refusal(answer.status, await answer.json().catch(() => ({})));
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
