// One event stream for all tabs of a browser that have the same session: one tab holds the stream, and
// passes on what it hears. Browsers allow six connections to a host over HTTP/1.1.

// The tab with the stream says so often. Another tab takes over from one that stands still.
const ALIVE_MS = 2_000;
const SILENT_MS = 7_000;

// Pages without TLS have no locks: there each tab has its own stream.
const canShare = () => Boolean(globalThis.BroadcastChannel && navigator.locks);

export class SharedStream {
  // `open(pass)` opens the stream, passes on each message, and answers what closes it again. `whole()`
  // is the message that a tab needs first, or null. `hear(message)` gets each message.
  constructor(name, {open, whole, hear}) {
    Object.assign(this, {name, open, whole, hear});
    this.tab = crypto.getRandomValues(new Uint32Array(2)).join("-");
    this.closeStream = null;
    this.heardMs = performance.now();
    if (!canShare()) {
      this.lead();
      return;
    }
    this.channel = new BroadcastChannel(name);
    this.channel.onmessage = ({data}) => this.receive(data);
    this.timer = setInterval(() => this.beat(), ALIVE_MS);
    this.channel.postMessage({asks: this.tab});
    this.queue({});
  }

  // Wait for the stream, or take it from a tab that stands still.
  queue({steal}) {
    this.waiting = steal ? null : new AbortController();
    const options = steal ? {steal} : {signal: this.waiting.signal};
    navigator.locks.request(this.name, options, () => this.hold()).catch(() => {
      // Somebody has taken the stream, or this tab waits no longer.
      if (this.closeStream && !this.isGone) this.follow();
    });
  }

  hold() {
    if (this.isGone) return undefined;
    this.lead();
    return new Promise((letGo) => (this.letGo = letGo));
  }

  lead() {
    this.closeStream = this.open((message) => {
      this.hear(message);
      this.channel?.postMessage({message});
    });
  }

  follow() {
    this.closeStream();
    this.closeStream = null;
    this.heardMs = performance.now();
    this.channel.postMessage({asks: this.tab});
    this.queue({});
  }

  receive({asks, message, to}) {
    if (asks) {
      const whole = this.closeStream && this.whole();
      if (whole) this.channel.postMessage({message: whole, to: asks});
      return;
    }
    this.heardMs = performance.now();
    if (this.closeStream || !message || (to && to !== this.tab)) return;
    this.hear(message);
  }

  beat() {
    if (this.closeStream) this.channel.postMessage({});
    else if (performance.now() - this.heardMs > SILENT_MS) {
      this.heardMs = performance.now();
      this.waiting?.abort();
      this.queue({steal: true});
    }
  }

  leave() {
    this.isGone = true;
    clearInterval(this.timer);
    this.waiting?.abort();
    this.closeStream?.();
    this.letGo?.();
    this.channel?.close();
  }
}
