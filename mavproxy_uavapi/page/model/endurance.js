// How long a battery lasts at the pace of the last minutes in which it was used.

const SPAN = 600000; // ms that count
const LEAST = 60000; // ms, and percents, before anything is said
const DROP = 2;

export class Endurance {
  constructor() { this.forget(); }

  forget() { this.points = []; } // [ms, %], whenever the percentage has fallen

  /** Hear what is left, in %, at a time (ms). On the ground, or after another battery is put in, it begins anew. */
  take(at, left, isUsed) {
    const last = this.points.at(-1);
    if (!isUsed || left === null || left > (last?.[1] ?? left)) this.forget();
    if (isUsed && left !== null && left !== this.points.at(-1)?.[1]) this.points.push([at, left]);
    while (this.points.length && at - this.points[0][0] > SPAN) this.points.shift();
  }

  /** Minutes until it is empty; null while nobody can say. */
  minutes(at) {
    const [, first, ...more] = this.points, last = more.at(-1); // how long the first percent had lasted is not known
    if (!last || last[0] - first[0] < LEAST || first[1] - last[1] < DROP) return null;
    const pace = (first[1] - last[1]) / (last[0] - first[0]); // % in a ms
    return Math.max(last[1] / pace - (at - last[0]), 0) / 60000;
  }
}
