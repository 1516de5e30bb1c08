// Texts of the customer's and the provider's desk, in one place for those who translate them.

import {durationText, percent} from "./words.js";

export const WORDS = {
  places: {
    title: "Find a place",
    query: "Station, address, plus code or coordinates",
    example: "San Marcos, or 29.8833,-97.9414",
    stations: "Stations",
    deliverTo: (station) => `Deliver to ${station}`,
    walk: "Farthest station, metres",
    find: "Find",
    nothing: "No station of this network is near such a place.",
    pickUp: "Pick up here",
    deliver: "Deliver here",
    point: "A point on the map",
    served: (station, metres) => `${station}, ${metres} m in a straight line`,
    uses: (isPickup, walk) => `${isPickup ? "Pickup" : "Hand-over"} at ${walk}`,
    chosen: (label, walk) => `${label}: ${walk}`,
  },
  request: {
    title: "Where shall it go?",
    hint: "Type a place, choose a station, or click the map: the pickup first, then each destination.",
    more: "More wishes",
    ask: "Ask for offers",
    asking: "Asking…",
    orderAnyway: "Order it all the same",
  },
  offers: {
    title: (count) => (count === 1 ? "One offer for you" : `${count} offers for you`),
    none: "Nobody can fly this",
    busy: "All drones are busy just now",
    wait: (span) =>
      `The first one is probably free in ${span}. Order it all the same: the next free drone flies it.`,
    waitUnknown: "Order it all the same: the next free drone flies it.",
    holds: (span) => `The best one is first. They hold for another ${span}. The map shows their ways.`,
    over: "These offers have ended. Ask for new ones.",
    gone: "That offer is gone: its drone flies for somebody else, or the offer was too old. Here is what can be had now.",
    likely: (moment) => `Very likely by ${moment}`,
    expected: (moment) => `Expected at ${moment}`,
    pickup: (moment, station) => `Pickup ${moment}${station ? ` at ${station}` : ""}`,
    shared: (price) => `${price} if shared`,
    held: "Kept for you",
    best: "Best",
    take: "Take the offer",
    takeOf: (name) => `Take the offer of ${name}`,
    more: "Way, energy and terms",
  },
  exchanges: {
    title: "Exchanges of deliveries",
    rule: "Other providers may fly deliveries that wait for our drones, and our drones fly theirs. The provider that flies gets the agreed price.",
    saved: (agrees) => (agrees ? "Deliveries are exchanged from now on, in networks that allow it."
      : "No delivery is exchanged from now on. What has come stays with you."),
    today: (came, left, isMore) => `${isMore ? "At least: " : ""}${came} came and ${left} left today (UTC).`,
    directions: {CAME: "Came", LEFT: "Left"},
    when: "When",
    delivery: "Delivery",
    what: "What happened",
    why: "Why",
  },
  contact: {
    title: "Who takes the packages (optional)",
    name: "Name of the recipient",
    phone: "Phone",
    phoneForm: "With + and the code of the country, such as +15125550100",
    email: "E-mail",
    instructions: "Instructions",
  },
  proof: {
    title: "Proof of the hand-over",
    methods: {"": "None", PIN: "PIN", PHOTO: "Photo", SIGNATURE: "Signature"},
    of: (packageId) => `Hand-over of ${packageId}`,
    method: "Method",
    pin: "PIN for the recipient",
    wrong: "Wrong PINs",
    state: "State",
    later: "asked for when the drone is there",
    awaited: (until) => `the drone waits for it until ${until}`,
    given: (at, by) => `given ${at}, by the ${by}`,
    ended: "not given",
    picture: (packageId) => `Picture of the hand-over of ${packageId}`,
    confirm: "My customer has it",
    confirmed: "The hand-over is confirmed.",
  },
  keys: {
    mode: "Live or test",
    live: "Live",
    test: "Test",
    newTest: "New test key",
    about: "With a test key a developer tries everything: the sandbox plays its deliveries, no drone moves, and nothing is paid. "
      + "The console asks for your API key before it makes one. At the terminal: skyway sandbox.",
    name: "Name (optional)",
    make: "Make the test key",
  },
  earned: {
    by: "Earnings of the month by",
    day: "Day",
    drone: "Drone",
    route: "Route",
    csv: "Earnings as CSV",
    archived: "archived",
    counted: "Deliveries",
    amount: "Earned",
  },
  statements: {
    month: "Month (UTC)",
    none: "No lines in this month.",
    open: "The month is open: its sums may still change.",
    closed: (day) => `Closed on ${day}: it does not change any more.`,
    counted: (deliveries, lines) => `${deliveries} deliveries, ${lines} lines of the ledger.`,
    print: "Page to print",
    csv: "Statements as CSV",
    linesCsv: "Lines as CSV",
    lines: "Lines",
    more: "There are more lines: save them as CSV.",
    pays: (party) => `${party} pays`,
    gets: (party) => `${party} gets`,
  },
};

// What a customer gets back by the terms of an offer, one sentence each.
export function termsText({cancellation, late}) {
  const {until_loaded: loaded, in_flight: flying} = cancellation;
  const first = loaded === 0 ? "free until loaded" : `${percent(loaded)} of the price once booked`;
  const steps = late.map(({after_min: minutes, share}) =>
    `${percent(share)} if more than ${durationText(60 * minutes)} late`);
  return [`Cancellation: ${first}, ${percent(flying)} after that.`,
    steps.length ? `Back: ${steps.join(", ")}.` : "Nothing back for lateness."];
}
