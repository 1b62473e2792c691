// One picture of the owner's that this browser keeps, with what belongs to it. IndexedDB: localStorage has no room.

const NAME = "uavapi-page", STORE = "pictures", KEY = "own";

/** What was kept; null for nothing, or where the browser keeps nothing. */
export async function keptPicture() {
  try {
    return await inStore("readonly", store => store.get(KEY)) ?? null;
  } catch {
    return null;
  }
}

/**
 * Keep {file, marks}; null forgets it.
 * @param {{file: Blob, marks: import("../plan/placing.js").Mark[]} | null} picture
 */
export const keepPicture = picture =>
  inStore("readwrite", store => (picture ? store.put(picture, KEY) : store.delete(KEY)));

/** The result of one request, when all of it is done. */
async function inStore(mode, ask) {
  const opening = indexedDB.open(NAME, 1);
  opening.onupgradeneeded = () => opening.result.createObjectStore(STORE);
  const database = await done(opening);
  try {
    const transaction = database.transaction(STORE, mode);
    const complete = new Promise((resolve, reject) => {
      transaction.oncomplete = resolve;
      transaction.onabort = () => reject(transaction.error);
    });
    const asked = await done(ask(transaction.objectStore(STORE)));
    await complete;
    return asked;
  } finally {
    database.close();
  }
}

const done = request => new Promise((resolve, reject) => {
  request.onsuccess = () => resolve(request.result);
  request.onerror = () => reject(request.error);
});
