// How moments and spans are written: 24 hours, in the zone of who reads the page.

const DAY_MS = 86_400_000;

const hours = (ms) => new Date(ms).toLocaleTimeString([], {hour: "2-digit", minute: "2-digit", hourCycle: "h23"});

// A time of today, or a day and a time.
export function clockTime(moment, now) {
  const ms = Date.parse(moment);
  const isNear = Math.abs(ms - now) < DAY_MS / 2;
  const day = new Date(ms).toLocaleDateString([], {weekday: "short", day: "numeric", month: "short"});
  return isNear ? hours(ms) : `${day}, ${hours(ms)}`;
}

export function spanText(seconds) {
  const minutes = Math.max(1, Math.round(seconds / 60));
  if (minutes < 90) return `${minutes} min`;
  return `${Math.floor(minutes / 60)} h ${String(minutes % 60).padStart(2, "0")} min`;
}

// The zone's place, such as "Europe/Berlin", with its distance from UTC.
export function zoneText(now) {
  const {timeZone} = Intl.DateTimeFormat().resolvedOptions();
  const parts = new Intl.DateTimeFormat("en", {timeZoneName: "shortOffset"}).formatToParts(now);
  const offset = parts.find(({type}) => type === "timeZoneName").value.replace("GMT", "UTC");
  return timeZone === offset ? timeZone : `${timeZone.replaceAll("_", " ")} (${offset})`;
}
