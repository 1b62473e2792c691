// What this browser keeps between visits. It may refuse to, or have something else there: then there is nothing.

/** What was kept under a name, from JSON; null for nothing. */
export function kept(name) {
  try {
    return JSON.parse(localStorage.getItem(name));
  } catch {
    return null;
  }
}

/** Keep a value, or nothing; whether it is kept. */
export function keep(name, value) {
  try {
    if (value === null) localStorage.removeItem(name);
    else localStorage.setItem(name, JSON.stringify(value));
    return true;
  } catch {
    return false;
  }
}
