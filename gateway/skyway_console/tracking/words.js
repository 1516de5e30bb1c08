// Texts of the tracking page, in one place for those who translate them.

const packages = (count) => (count === 1 ? "Your package" : "Your next package");

export const WORDS = {
  title: (headline, shop) => `${headline} – ${shop ?? "your delivery"}`,
  stages: {REQUESTED: "Requested", PLANNED: "Planned", ON_THE_WAY: "On the way", DELIVERED: "Delivered"},
  zone: (zone) => `All times are in your time zone, ${zone}.`,

  landsIn: (span, count) => `${packages(count)} lands in ${span}`,
  landsAt: (moment, count) => `${packages(count)} lands at ${moment}`,
  landsNow: (count) => `${packages(count)} is about to land`,
  isHere: "The drone is here",
  waitsUntil: (station, until) => `It waits at ${station} until ${until}.`,
  deliveredAt: (moment) => `Delivered at ${moment}`,
  partly: "Delivered in part",
  cancelled: "This delivery was cancelled",
  failed: "Not delivered",
  requested: "Requested",
  waiting: "Waiting for a drone",

  likely: (until) => `Very likely by ${until}`,
  expected: (moment) => `Expected at ${moment}`,
  isExpected: (moment) => `It is expected at ${moment}.`,
  late: (promised) => `later than the promise, ${promised}`,
  earlier: (span) => `${span} earlier than promised. Enjoy!`,
  enjoy: "Enjoy!",

  scheduled: "A drone is booked nearer to the time of the pickup. This page then shows when it comes.",
  looking: "A drone is being chosen. This takes a moment.",
  busy: (span) => `All drones are busy. One is probably free in ${span}. This page goes on by itself.`,
  busyUnknown: "All drones are busy. Yours comes as soon as one is free. This page goes on by itself.",
  replanning: "The plan is being changed, because something on the way has changed. A new time follows.",
  overdue: (moment) => `Expected at ${moment}. It takes longer than planned.`,
  loading: "The drone is being loaded now.",
  loadsAt: (station, moment) => `The drone is loaded at ${station} at ${moment}.`,
  otherPickup: (station) => `The drone is loaded at ${station}.`,
  shared: "The drone carries packages of others too.",
  doing: {
    FLYING: (station) => `The drone flies to ${station}.`,
    RECHARGING: () => "The drone charges its battery on the way.",
    WAITING: () => "The drone waits at a station on the way.",
    DELIVERING: (station) => `The drone hands over at ${station}.`,
    OUT_OF_CONTACT: () => "The drone is out of contact for a moment. It flies its plan.",
  },
  ended: "The sender knows what happened and can send it again.",
  cancelledDetail: "Ask the sender if you still expect it.",

  to: (name, station) => `${name} to ${station}`,
  handedOver: (station, moment) => `Handed over at ${station}, ${moment}`,
  mass: (kg) => `Mass: ${kg} kg`,
  place: (place) => `Place: ${place}`,
  ends: {
    RETURNED: "Returned to the sender",
    RETURNING: "On its way back to the sender",
    STRANDED: "Left at a safe landing. The sender is notified and collects it.",
    CANCELLED: "Not delivered",
  },
  reasons: {
    RECIPIENT_ABSENT: "Nobody took it at the pad.",
    PROOF_MISSING: "Its hand-over was not confirmed in time.",
    CANCELLED: "The sender cancelled it.",
    CANCELLED_BY_OPERATOR: "The operator of the drones ended the flight.",
    OVERWEIGHT: "It was heavier than announced.",
  },
  otherReason: "The drone could not finish this flight.",
  absent: (station) => `If nobody is there, the drone waits a moment and then takes it to ${station}.`,
  pad: (station) => `Pick-up place: the pads of ${station}`,
  openMap: "Open in maps",
  howFar: "How far is it?",
  locating: "Looking where you are…",
  noPlace: "Your browser does not say where you are.",
  walk: (metres, direction, minutes) =>
    `About ${metres} to the ${direction} of you in a straight line, ${minutes} min on foot.`,
  isThere: "You are at the pad.",

  drone: "The drone",
  lastSeen: (moment) => `The drone was last seen at ${moment}.`,
  begin: "the page was opened",
  noConnection: (since) => `No connection since ${since}. The page goes on by itself.`,
  noAnswer: (since) => `The service does not answer since ${since}. The page goes on by itself.`,
  linkEnded: "This link has ended",
  askAgain: "Ask the sender for another one.",
};

const degrees = (value, positive, negative) =>
  `${Math.abs(value).toFixed(5)}° ${value < 0 ? negative : positive}`;

export const placeText = ([longitude, latitude]) =>
  `${degrees(latitude, "north", "south")}, ${degrees(longitude, "east", "west")}`;

export function distanceText(metres) {
  if (metres < 1_000) return `${Math.round(metres / 10) * 10} m`;
  return `${Number((metres / 1_000).toFixed(metres < 10_000 ? 1 : 0))} km`;
}
