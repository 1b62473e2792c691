// Colours for drawing: those of the theme from the style sheet, and one for each vehicle.

const OF_VEHICLES = ["#1f7ae0", "#d9680f", "#119a5f", "#a83fd0", "#d12f55", "#0b93a3", "#7b8a10", "#6d4dff",
  "#8a5a2b", "#c2318f"];
const NAMES = ["map", "grid", "grid-strong", "ink", "dim", "accent", "ok", "warn", "bad", "surface", "sky", "earth"];

/** A vehicle's own colour, the same on both themes. */
export const colourOf = system => OF_VEHICLES[system % OF_VEHICLES.length];

let theme = null;

/** The theme's colours by name. */
export function colours() {
  if (theme === null) {
    const style = getComputedStyle(document.documentElement);
    theme = Object.fromEntries(NAMES.map(name => [name, style.getPropertyValue(`--${name}`).trim()]));
  }
  return theme;
}

/** Read them again: the theme has changed. */
export function forgetColours() { theme = null; }
