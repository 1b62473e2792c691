/** Whether two values are the same, as JSON has them. */
export const same = (a, b) => JSON.stringify(a) === JSON.stringify(b);
