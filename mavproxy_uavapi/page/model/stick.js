// What a gamepad asks for: a velocity by body, while its dead-man button is held. Only pads whose layout is known.

const STILL = 0.12; // of a stick's way: one that is let go rests within it
const SHOULDERS = [4, 5]; // the dead-man buttons, in the layout that browsers call standard
const AHEAD = 60; // degrees by which the heading that is asked for may be ahead of the vehicle's
export const TURN = 60; // deg/s at a stick's end

/**
 * The first pad that is there and has the standard layout; null for none.
 * @param {readonly (Gamepad | null)[]} pads
 */
export const padOf = pads => pads.find(pad => pad?.connected && pad.mapping === "standard") ?? null;

/** @param {Gamepad | null} pad */
export const isHeld = pad => SHOULDERS.some(number => pad?.buttons[number]?.pressed);

/**
 * What the sticks ask for: m/s to the front, to the right, down; and deg/s of a turn to the right. The right one goes
 * to the front and sideways, the left one up and down, and turns.
 * @param {Gamepad} pad
 * @param {number} speed m/s at a stick's end; half of it up and down
 */
export function demandOf(pad, speed) {
  const [turn, down, right, back] = [0, 1, 2, 3].map(axis => lively(pad.axes[axis] ?? 0));
  return {front: round(-back * speed), right: round(right * speed), down: round(down * speed / 2), turn: turn * TURN};
}

/** From STILL on, and fine near the middle. */
function lively(way) {
  const beyond = Math.min(Math.max(Math.abs(way) - STILL, 0) / (1 - STILL), 1);
  return Math.sign(way) * beyond * beyond;
}

const round = value => Math.round(value * 20) / 20 || 0; // steps of 5 cm/s; no minus 0

/** The heading to point at, after a turn of so many degrees; never far ahead of where the vehicle points. */
export function turned(wanted, by, heading) {
  const ahead = (wanted + by - heading + 540) % 360 - 180;
  return (heading + Math.min(Math.max(ahead, -AHEAD), AHEAD) + 360) % 360;
}
