// What our tests use of node:assert/strict, where they run in a browser.

const isDeep = value => typeof value === "object" && value !== null;

function equal(a, b) {
  if (!isDeep(a) || !isDeep(b)) return Object.is(a, b);
  const keys = Object.keys(a);
  return Object.getPrototypeOf(a) === Object.getPrototypeOf(b) && keys.length === Object.keys(b).length
    && keys.every(key => Object.hasOwn(b, key) && equal(a[key], b[key]));
}

function ok(value, message = `${value} is not true`) { if (!value) throw new Error(message); }

const deepEqual = (a, b) => ok(equal(a, b), `${JSON.stringify(a)} is not ${JSON.stringify(b)}`);

export default {ok, deepEqual, equal: (a, b) => ok(Object.is(a, b), `${a} is not ${b}`)};
