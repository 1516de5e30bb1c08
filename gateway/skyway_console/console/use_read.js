// Reads what a view shows.

import {useEffect, useRef, useState} from "preact/hooks";

import {get} from "./api.js";

// `read` answers a promise. It is called when the view opens, when `changed` changes, and every `everyMs` if that is
// given. The last answer stays while a new one does not come; with another `key` it answers something else.
// `again` reads out of turn, after something was changed.
export function useRead(read, {key = "", changed = "", everyMs = null} = {}) {
  const [found, setFound] = useState({turn: 0, key, answer: null, problem: ""});
  const turns = useRef(0);
  const again = useRef(null);
  useEffect(() => {
    const ask = () => {
      const turn = (turns.current += 1);
      // An answer is shown unless the answer to a later question is.
      const show = (next) => setFound((before) => (turn < before.turn ? before
        : {turn, key, answer: before.key === key ? before.answer : null, problem: "", ...next}));
      read().then((answer) => show({answer}), ({message}) => show({problem: message}));
    };
    again.current = ask;
    ask();
    if (everyMs === null) return undefined;
    // Nobody sees a hidden page, so nothing is read for it.
    const look = () => document.visibilityState === "hidden" || ask();
    const timer = setInterval(look, everyMs);
    document.addEventListener("visibilitychange", look);
    return () => {
      clearInterval(timer);
      document.removeEventListener("visibilitychange", look);
    };
  }, [key, changed]);
  const shown = found.key === key ? found : {answer: null, problem: ""};
  return {...shown, again: () => again.current()};
}

export const useReadPath = (path, options) => useRead(() => get(path), {key: path, ...options});
