// Notices that the page slept: nobody saw it for a while, or the machine stood still. A stream that
// ended meanwhile often looks open, because nothing has told the browser.

const SLEPT_MS = 5_000;
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
