// What our tests use of node:test, where they run in a browser.

const LONGEST = 20000; // ms
const tests = [];
const late = () => new Promise((_, reject) => setTimeout(() => reject(new Error("it does not end")), LONGEST));

export const test = (name, work) => { tests.push({name, work}); };

/** Load test files, run what they have one after the other, and tell what failed. */
globalThis.runTests = async files => {
  const failed = [];
  let count = 0;
  for (const file of files) {
    tests.length = 0;
    await import(file);
    for (const {name, work} of [...tests]) {
      count += 1;
      try {
        await Promise.race([work(), late()]);
      } catch (error) {
        failed.push(`${file}: ${name}: ${error.stack ?? error}`);
      }
    }
  }
  return {count, failed};
};
