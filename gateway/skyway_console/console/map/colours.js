// The colours of the map, by the meanings of styles/tokens.css. They differ in lightness too, for
// people who do not see all colours. Land, water and names are quiet: drones are the brightest things.

const LIGHT = {
  water: "#c3dbe9", land: "#f5f4ef", urban: "#e6dfcf", river: "#a5c8de", state: "#cbc9c0", country: "#9d9c96",
  place: "#6d7378", edge: "#d5dbe1", segment: "#7d8fa1", ring: "#ffffff", rest: "#c6ced6",
  free: "#00805f", busy: "#d98200", full: "#d55e00", closed: "#5c6670", zone: "#cc3311",
  flown: "#7c8894", planned: "#0072b2", text: "#1d2733", halo: "#ffffff",
  drone: "#00559b", low: "#c9371c", idle: "#66727e", selected: "#aa4499", trail: "#0072b2",
};
const DARK = {
  water: "#0a141d", land: "#19232d", urban: "#2e3a47", river: "#24506f", state: "#2d3842", country: "#55616d",
  place: "#8d99a5", edge: "#34404c", segment: "#5f7182", ring: "#10171e", rest: "#3d4a57",
  free: "#3fd0a2", busy: "#f0a830", full: "#ff7a33", closed: "#8c97a2", zone: "#ff6655",
  flown: "#7d8996", planned: "#56b4e9", text: "#e6ebf0", halo: "#10171e",
  drone: "#8fd0ff", low: "#ff7a6a", idle: "#8e9aa6", selected: "#ee88dd", trail: "#56b4e9",
};

const darkTheme = matchMedia("(prefers-color-scheme: dark)");

export const isDark = () => darkTheme.matches;
export const colours = () => (isDark() ? DARK : LIGHT);
// The colour of an element: the browser changes it with the theme.
export const colourInBothThemes = (name) => `light-dark(${LIGHT[name]}, ${DARK[name]})`;
// Runs an action when the theme changes; the answer is a function that ends this.
export function onThemeChange(action) {
  darkTheme.addEventListener("change", action);
  return () => darkTheme.removeEventListener("change", action);
}
