// The states of the API in plain words: a short name, and a sentence that says what it means.

import {html} from "./html.js";
import {inWords} from "./words.js";

const STATES = {
  delivery: {
    SCHEDULED: ["Scheduled", "It is booked for later. A drone is chosen when its time comes near."],
    REQUESTED: ["Requested", "It waits for a drone that can fly it."],
    PLANNED: ["Planned", "A drone has the plan and comes to the pickup."],
    DISPATCHED: ["On the way to the pickup", "The drone has accepted the plan and has set off."],
    LOADING: ["Loading", "The drone is at the pickup and takes the packages on board."],
    IN_PROGRESS: ["On the way", "The drone carries the packages."],
    COMPLETED: ["Delivered", "All packages were handed over."],
    PARTIALLY_COMPLETED: ["Partly delivered", "Some packages were handed over, others were not."],
    CANCELLED: ["Cancelled", "Somebody has cancelled it."],
    FAILED: ["Failed", "No package was handed over."],
    REJECTED: ["Rejected", "No provider can fly it as it was requested."],
  },
  deliveryActivity: {
    FLYING: ["flying", "The drone is in the air."],
    WAITING: ["waiting", "The drone waits, for example for a free pad."],
    RECHARGING: ["recharging", "The drone recharges on a pad on its way."],
    DELIVERING: ["handing over", "The drone hands a package over."],
    OUT_OF_CONTACT: ["out of contact", "The drone has not reported for a while. It flies on by its plan."],
  },
  package: {
    CREATED: ["At the pickup", "The package waits to be picked up."],
    LOADED: ["On board", "The package is on board of the drone."],
    IN_TRANSIT: ["On the way", "The drone carries the package."],
    DELIVERED: ["Delivered", "The package was handed over."],
    RETURNING: ["Coming back", "The drone brings the package back."],
    RETURNED: ["Came back", "The package came back to a station."],
    STRANDED: ["Stranded", "The package is where the drone had to land."],
    CANCELLED: ["Cancelled", "The package is not delivered any more."],
  },
  drone: {
    REGISTERED: ["Registered", "It has not enrolled or reported yet."],
    AVAILABLE: ["Available", "It is ready for a mission."],
    RESERVED: ["Reserved", "It has a mission that has not begun."],
    ON_MISSION: ["On mission", "It flies a mission."],
    RECHARGING: ["Recharging", "It stands on a pad and recharges."],
    OFFLINE: ["Offline", "It does not report. Look at its power and its connection."],
    MAINTENANCE: ["Maintenance", "Its provider has taken it out of service."],
    GROUNDED: ["Grounded", "It must not fly: it has a fault, or it came down outside of a station."],
  },
  droneActivity: {
    IDLE: ["Idle", "It stands still and does nothing."],
    LOADING: ["Loading", "It takes packages on board."],
    FLYING: ["Flying", "It is in the air."],
    WAITING: ["Waiting", "It waits, for example for a free pad."],
    RECHARGING: ["Recharging", "It recharges on a pad."],
    DELIVERING: ["Handing over", "It hands a package over."],
    DOWN: ["Down", "It came down and cannot fly on by itself. Somebody must go there."],
  },
  mission: {
    QUEUED: ["Queued", "It is planned after the drone's present mission."],
    BOOKED: ["Booked", "Drone and pads are reserved. The drone has not answered yet."],
    ACCEPTED: ["Accepted", "The drone has accepted the plan."],
    ACTIVE: ["Active", "The drone flies it."],
    COMPLETED: ["Completed", "The drone has done all its steps."],
    ABORTED: ["Aborted", "It ended before all its steps were done."],
    CANCELLED: ["Cancelled", "Somebody has cancelled it."],
    REFUSED: ["Refused", "The drone has not accepted the plan."],
  },
  alarmLevel: {
    WARNING: ["Warning", "Look at it today."],
    URGENT: ["Urgent", "Look at it soon: a delivery or a drone is in trouble."],
    CRITICAL: ["Critical", "Somebody must act now."],
  },
  alarm: {
    OPEN: ["Open", "Nobody has acknowledged it, and it is not over."],
    ACKNOWLEDGED: ["Acknowledged", "An operator has seen it, or it is over."],
  },
};

// The states of deliveries that change no more.
export const isOver = (state) =>
  ["COMPLETED", "PARTIALLY_COMPLETED", "CANCELLED", "FAILED", "REJECTED"].includes(state);

// The states of a kind in the order of a life: all that the API has.
export const statesOf = (kind) => Object.keys(STATES[kind]);

// A state that a newer gateway has still reads as words.
export const stateName = (kind, state) => STATES[kind][state]?.[0] ?? inWords(state);
export const stateHint = (kind, state) => STATES[kind][state]?.[1] ?? "";

export const StateText = ({kind, of: state}) =>
  html`<span class="state-text" title=${stateHint(kind, state)}>${stateName(kind, state)}</span>`;

// "On the way, flying".
export const DeliveryStateText = ({state, activity}) => html`
  <${StateText} kind="delivery" of=${state} />${
    activity && html`, <${StateText} kind="deliveryActivity" of=${activity} />`}`;
