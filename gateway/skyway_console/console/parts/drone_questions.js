// What is asked before a drone is taken out of service and back, or before what is known about it is reset.

import {call, post} from "../api.js";
import {confirm} from "./confirm_dialog.js";

// `path` is that of the drone in the API; `onChange` runs after each change.
export function droneQuestions(path, name, onChange) {
  const then = async (answer) => {
    await answer;
    onChange();
  };
  const put = (state) => then(call("PATCH", path, {state}));
  const back = `${name} is back in service.`;
  const ask = (verb, meaning, action, done, undo) => () =>
    confirm({title: `${verb}: drone ${name}`, verb, meaning, reason: "none", action, done, undo});
  return {
    maintain: ask("Into maintenance", "The drone gets no missions until somebody puts it back in service.",
      () => put("MAINTENANCE"), `${name} is in maintenance and gets no missions.`,
      {action: () => put("AVAILABLE"), done: back}),
    putBack: ask("Back in service", "The drone gets missions again, as soon as it is connected.",
      () => put("AVAILABLE"), back, {action: () => put("MAINTENANCE"), done: `${name} is in maintenance again.`}),
    forget: ask("Forget", "What its flights have shown about its energy use and its battery is forgotten. It is planned "
      + "as its model says until it has flown again. This cannot be undone.",
    () => then(call("DELETE", `${path}/learned-values`)), `${name} counts as its model says until it has flown again.`),
    wasMaintained: ask("Maintained", "Its hours and cycles since the last maintenance begin at 0 again, and it gets "
      + "missions again. This cannot be undone.",
    () => then(post(`${path}/maintenance`)), `The maintenance of ${name} is recorded; its counters begin again.`),
  };
}
