// The colours of the map. They differ in lightness too, for people who do not see all colours.

const LIGHT = {
  background: "#eef1f4", county: "#d5dbe1", country: "#9aa5b1", segment: "#a9b5c2",
  free: "#0072b2", busy: "#e69f00", full: "#d55e00", closed: "#5c5c5c", zone: "#cc3311",
  flown: "#56616d", planned: "#0072b2", text: "#1d2733", halo: "#ffffff",
  drone: "#0b5394", low: "#d55e00", idle: "#6b7885", selected: "#aa4499",
};
const DARK = {
  background: "#12181f", county: "#232c36", country: "#46525f", segment: "#3c4957",
  free: "#56b4e9", busy: "#e69f00", full: "#ff7a33", closed: "#9a9a9a", zone: "#ff6655",
  flown: "#8b97a4", planned: "#56b4e9", text: "#e6ebf0", halo: "#12181f",
  drone: "#8fd0ff", low: "#ff7a33", idle: "#7f8b97", selected: "#ee88dd",
};

const darkTheme = matchMedia("(prefers-color-scheme: dark)");

export const colours = () => (darkTheme.matches ? DARK : LIGHT);
// The colour of an element: the browser changes it with the theme.
export const colourInBothThemes = (name) => `light-dark(${LIGHT[name]}, ${DARK[name]})`;
// Runs an action when the theme changes; the answer is a function that ends this.
export function onThemeChange(action) {
  darkTheme.addEventListener("change", action);
  return () => darkTheme.removeEventListener("change", action);
}
