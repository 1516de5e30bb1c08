// How many packages each drone carries now, by the ended steps of what it flies.

// Missions that fly as guests of another are counted with it. The answer is by the host's mission id.
export function packagesAboard(missions) {
  const aboard = new Map();
  for (const [missionId, mission] of Object.entries(missions)) {
    const host = mission.flown_as ?? missionId;
    aboard.set(host, (aboard.get(host) ?? 0) + carried(mission));
  }
  return aboard;
}

// Kept by the mission, which is another object whenever it changes.
const known = new WeakMap();

function carried(mission) {
  if (known.has(mission)) return known.get(mission);
  let count = 0;
  for (const {kind, status, package_ids: packages} of Object.values(mission.steps ?? {})) {
    if (status !== "ENDED") continue;
    if (kind === "PICK_UP") count += packages?.length ?? 0;
    if (kind === "DELIVER") count -= packages?.length ?? 0;
  }
  known.set(mission, Math.max(0, count));
  return known.get(mission);
}
