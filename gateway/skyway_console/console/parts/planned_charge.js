// The charge that a mission's plan expects: where each step ends, and where charging begins.

const isKnown = (soc) => soc !== undefined && soc !== null;

const pointsOf = (beginS, steps) => steps.flatMap(({start_s: startS, end_s: endS, soc_start: from, soc_end: to}) => [
  ...(isKnown(from) ? [[beginS + startS, from]] : []),
  ...(isKnown(to) ? [[beginS + endS, to]] : []),
]);

// Pairs of a moment, in seconds, and a state of charge. The way home comes after the last hand-over.
export function plannedCharge({start_at: startAt, plan, home_plan: home, home_recharge: last}) {
  const begin = Date.parse(startAt) / 1_000;
  const served = begin + plan.delivery_time_s;
  return [
    ...pointsOf(begin, plan.steps),
    ...pointsOf(served, [...(home?.steps ?? []), ...(last ? [last] : [])]),
  ];
}
