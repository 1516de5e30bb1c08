// Notices that nobody sees the page for a while, and that it is seen again or that the machine stood
// still. A stream that ended meanwhile often looks open, because the browser does not notice it.

const SLEPT_MS = 5_000;
const HIDDEN_MS = 10_000;
const TICK_MS = 2_000;

let hiddenAt = null;
let tickedAt = Date.now();

// Calls `action` after each sleep.
export function onWake(action) {
  document.addEventListener("visibilitychange", () => {
    if (document.visibilityState === "hidden") {
      hiddenAt = Date.now();
      return;
    }
    const slept = hiddenAt !== null && Date.now() - hiddenAt > SLEPT_MS;
    [hiddenAt, tickedAt] = [null, Date.now()];
    if (slept) action();
  });
  setInterval(() => {
    // Browsers slow down the timers of a page that is hidden.
    const slept = document.visibilityState === "visible" && Date.now() - tickedAt > TICK_MS + SLEPT_MS;
    tickedAt = Date.now();
    if (slept) action();
  }, TICK_MS);
}

// Calls `action` when nobody has seen the page for ten seconds.
export function onHidden(action) {
  let timer = null;
  const wait = () => {
    clearTimeout(timer);
    if (document.visibilityState === "hidden") timer = setTimeout(action, HIDDEN_MS);
  };
  document.addEventListener("visibilitychange", wait);
  wait();
}
