// Reads an address again and again while a view shows it.

import {useEffect, useState} from "preact/hooks";

import {get} from "./api.js";

// `read` answers a promise. The last answer stays while a new one does not come. Nobody sees a hidden page,
// so nothing is read for it.
export function usePolled(read, everyMs, key) {
  const [found, setFound] = useState({key, answer: null, problem: ""});
  useEffect(() => {
    let isShown = true;
    const ask = () => document.visibilityState === "hidden" || read().then(
      (answer) => isShown && setFound({key, answer, problem: ""}),
      ({message}) => isShown && setFound((before) => ({...before, problem: message})));
    ask();
    const timer = setInterval(ask, everyMs);
    document.addEventListener("visibilitychange", ask);
    return () => {
      isShown = false;
      clearInterval(timer);
      document.removeEventListener("visibilitychange", ask);
    };
  }, [key]);
  return found.key === key ? found : {key, answer: null, problem: ""};
}

export const usePolledPath = (path, everyMs) => usePolled(() => get(path), everyMs, path);
