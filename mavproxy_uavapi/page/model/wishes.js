// Numbers of MAVLink messages that somebody wishes to see: which there are, and what they are in a pilot's units.

// MAVLink's units that nobody reads: what they are times how much.
const UNITS = {"mm": [1e-3, "m"], "cm": [1e-2, "m"], "dm": [0.1, "m"], "mm/s": [1e-3, "m/s"], "cm/s": [1e-2, "m/s"],
  "dm/s": [0.1, "m/s"], "degE7": [1e-7, "°"], "degE5": [1e-5, "°"], "cdeg": [1e-2, "°"], "deg": [1, "°"],
  "deg/s": [1, "°/s"], "rad": [180 / Math.PI, "°"], "rad/s": [180 / Math.PI, "°/s"],
  "mrad/s": [0.18 / Math.PI, "°/s"], "mV": [1e-3, "V"], "cV": [1e-2, "V"], "cA": [1e-2, "A"], "mA": [1e-3, "A"],
  "c%": [1e-2, "%"], "d%": [0.1, "%"], "degC": [1, "°C"], "cdegC": [1e-2, "°C"], "m/s/s": [1, "m/s²"],
  "us": [1e-6, "s"], "ms": [1e-3, "s"], "ns": [1e-9, "s"]};

const NAME = /^(\w+)(?:\[(\d+)\])?$/; // and a number in brackets

/**
 * A number of a message, to be plotted: "VFR_HUD.alt", or "BATTERY_STATUS[1].voltages[0]" of one device of several.
 * @typedef {object} Wish
 * @property {string} key
 * @property {string} label
 * @property {string} unit
 * @property {string} message
 * @property {number} component that sends it
 * @property {string} field
 * @property {number} index in the field's list; -1 for none
 * @property {string | null} instance the field that tells the device
 * @property {number} device
 * @property {number} factor
 */

/**
 * All numbers of the messages that come, as `/telemetry/messages` has them.
 * @returns {Wish[]}
 */
export function wishesOf(messages) {
  const names = Object.keys(messages).filter(name => NAME.test(name));
  const several = new Set(names.filter(name => name.endsWith("]")).map(name => partsOf(name)[0]));
  return names.filter(name => !several.has(name)).flatMap(name => wishesOfOne(name, messages[name]));
}

function wishesOfOne(name, {units, component, instance}) {
  const [message, device] = partsOf(name);
  return Object.entries(units).filter(([number]) => NAME.test(number)).map(([number, unit]) => {
    const [field, index] = partsOf(number), [factor, shown] = UNITS[unit] ?? [1, unit], key = `${name}.${number}`;
    return {key, label: key, unit: shown, message, component, field, index, instance, device, factor};
  });
}

/** The number that is wished for, in a message; null if it is not there, or the message is another one. */
export function numberIn(wish, {name, component, fields}) {
  if (name !== wish.message || component !== wish.component) return null;
  if (wish.instance && fields[wish.instance] !== wish.device) return null;
  const value = wish.index < 0 ? fields[wish.field] : fields[wish.field]?.[wish.index];
  return Number.isFinite(value) ? value * wish.factor : null;
}

/** A name and the number in its brackets; -1 for none. */
function partsOf(text) {
  const [, name, index = "-1"] = NAME.exec(text);
  return /** @type {[string, number]} */ ([name, Number(index)]);
}

/** Whether something is a wish: a browser may have kept anything. */
export const isWish = one => Boolean(one) && ["key", "label", "unit", "message", "field"]
  .every(name => typeof one[name] === "string") && /^\w+$/.test(one.message)
  && ["component", "index", "device", "factor"].every(name => Number.isFinite(one[name]));
