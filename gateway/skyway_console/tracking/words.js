// Texts of the tracking page, in one place for those who translate them.

export const WORDS = {
  title: (headline, shop) => `${headline} – ${shop ?? "your delivery"}`,
  pad: (station, place) => `Pick-up place: ${station}, ${place}`,
  openMap: "Show the way in a map app",
};

const degrees = (value, positive, negative) =>
  `${Math.abs(value).toFixed(5)}° ${value < 0 ? negative : positive}`;

export const placeText = ([longitude, latitude]) =>
  `${degrees(latitude, "north", "south")}, ${degrees(longitude, "east", "west")}`;
