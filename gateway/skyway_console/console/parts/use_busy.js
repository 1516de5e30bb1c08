// Whether something that somebody has begun is still going on, for buttons that wait for it.

import {useState} from "preact/hooks";

// `busy(action)` runs it and answers what it answers.
export function useBusy() {
  const [isBusy, setBusy] = useState(false);
  const busy = async (action) => {
    setBusy(true);
    try {
      return await action();
    } finally {
      setBusy(false);
    }
  };
  return [isBusy, busy];
}
