// An event stream that is opened again after a refusal.

const AGAIN_MS = 2_000;

// `listen(stream)` adds its listeners to each stream, and `mayOpen()` promises whether there may be another one. The
// answer closes the stream.
export function followStream(url, listen, mayOpen = async () => true) {
  let stream = null;
  let again = null;
  const open = () => {
    stream = new EventSource(url);
    listen(stream);
    stream.addEventListener("error", () => {
      clearTimeout(again);
      again = setTimeout(askAgain, AGAIN_MS);
    });
  };
  async function askAgain() {
    const own = stream;
    const may = await mayOpen();
    // The browser connects again by itself, except after a refusal.
    if (may && own === stream && own?.readyState === EventSource.CLOSED) open();
  }
  open();
  return () => {
    clearTimeout(again);
    stream.close();
    stream = null;
  };
}
