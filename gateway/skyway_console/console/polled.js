// Reads an address again and again while a view shows it.

import {useEffect, useRef, useState} from "preact/hooks";

import {get} from "./api.js";

// `read` answers a promise. The last answer stays while a new one does not come. Nobody sees a hidden page,
// so nothing is read for it. `again` reads out of turn, after something was changed.
export function usePolled(read, everyMs, key) {
  const [found, setFound] = useState({key, answer: null, problem: ""});
  const again = useRef(null);
  useEffect(() => {
    let isShown = true;
    const ask = () => document.visibilityState === "hidden" || read().then(
      (answer) => isShown && setFound({key, answer, problem: ""}),
      ({message}) => isShown && setFound((before) => ({...before, problem: message})));
    again.current = ask;
    ask();
    const timer = setInterval(ask, everyMs);
    document.addEventListener("visibilitychange", ask);
    return () => {
      isShown = false;
      clearInterval(timer);
      document.removeEventListener("visibilitychange", ask);
    };
  }, [key]);
  const shown = found.key === key ? found : {answer: null, problem: ""};
  return {...shown, again: () => again.current()};
}

export const usePolledPath = (path, everyMs) => usePolled(() => get(path), everyMs, path);
