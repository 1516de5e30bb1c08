// How moments, charge, money and ids are written.

import {fleetNow, ticks} from "./fleet_clock.js";
import {stationNames} from "./networks.js";

export const clockTime = (moment) =>
  new Date(moment).toLocaleTimeString([], {hour: "2-digit", minute: "2-digit", hourCycle: "h23"});

// The zone of all times, such as "CET": it is that of the browser, and changes with summer time.
export function zoneName(moment = fleetNow()) {
  const parts = new Intl.DateTimeFormat([], {timeZoneName: "short"}).formatToParts(new Date(moment));
  return parts.find(({type}) => type === "timeZoneName").value;
}

// The day and the month, and the year too if it is another one.
function dateText(date, now) {
  const year = date.getFullYear() === now.getFullYear() ? {} : {year: "numeric"};
  return date.toLocaleDateString([], {day: "numeric", month: "short", ...year});
}

// A time of today, or a day and a time.
export function momentText(moment) {
  const [date, now] = [new Date(moment), new Date(fleetNow())];
  const isToday = date.toDateString() === now.toDateString();
  return isToday ? clockTime(date) : `${dateText(date, now)}, ${clockTime(date)}`;
}

// The same with the zone, for sentences and for what is shown when the pointer rests.
export const zonedText = (moment) => `${momentText(moment)} ${zoneName(moment)}`;

// A day with its year and a time, for moments of wall time.
export const dayText = (moment) => new Date(moment).toLocaleString([], {
  year: "numeric", month: "short", day: "numeric", hour: "2-digit", minute: "2-digit", hourCycle: "h23",
});

export function durationText(seconds) {
  const whole = Math.round(Math.abs(seconds));
  if (whole < 90) return `${whole} s`;
  const minutes = Math.round(whole / 60);
  if (minutes < 90) return `${minutes} min`;
  return `${Math.floor(minutes / 60)} h ${String(minutes % 60).padStart(2, "0")} min`;
}

// "in 5 min", "3 min ago". What shows it is drawn again each second, so it stays true.
export function distanceText(moment) {
  ticks.value;
  const seconds = (Date.parse(moment) - fleetNow()) / 1000;
  return seconds >= 0 ? `in ${durationText(seconds)}` : `${durationText(seconds)} ago`;
}

export const percent = (share) => `${Math.round(share * 100)} %`;

// Amounts are in the smallest unit of their currency: cents, but whole yen.
export function money({amount, currency}) {
  const format = new Intl.NumberFormat([], {style: "currency", currency});
  return format.format(amount / 10 ** format.resolvedOptions().maximumFractionDigits);
}

// An energy margin that follows from an accepted risk, and what it is for; "" if the margin is a constant.
export function marginText({risk} = {}) {
  if (!risk) return "";
  const way = risk.from ? ` on the flight from ${stationName(risk.from)} to ${stationName(risk.to)}` : "";
  const share = `${Number((risk.reserve_risk * 100).toPrecision(2))} % of landings`;
  const kept = risk.limited_by === "MOST" ? `the largest margin, but more than ${share} may be` : `at most ${share} are`;
  return `${percent(risk.flight_margin)} more energy${way}: ${kept} below the reserve`;
}

// The ends of ids differ, their beginnings hardly do.
export const shortId = (id) => (id.length > 12 ? `…${id.slice(-6)}` : id);

// A place of the API: a station, or a point without a name.
export const placeName = ({station_id: station}) => (station ? stationName(station) : "a place on the map");

// A fault of a drone has a code, or is one.
export const faultName = (fault) => inWords(fault.code ?? fault);

// The words of its id, until its network's content is here, or where it has no name.
export const stationName = (id) => stationNames.value.get(id) ?? wordsOfId(id);

export const wordsOfId = (id) =>
  id.split(/[-_]/).map(capital).join(" ");

// "dji-matrice-300-rtk" is "DJI Matrice 300 RTK": short words without a digit are abbreviations.
export const modelName = (id) => wordsOfId(id).split(" ")
  .map((word) => (/^[a-z]{1,3}$/i.test(word) ? word.toUpperCase() : word)).join(" ");

export const capital = (text) => text.charAt(0).toUpperCase() + text.slice(1);

export const inWords = (name) => capital(String(name).toLowerCase().replaceAll("_", " "));
