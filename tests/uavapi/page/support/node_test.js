// What our tests use of node:test, where they run in a browser.

const tests = [];

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
        await work();
      } catch (error) {
        failed.push(`${file}: ${name}: ${error.stack ?? error}`);
      }
    }
  }
  return {count, failed};
};
