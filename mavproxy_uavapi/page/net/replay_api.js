// The API of a page that shows a record: it reads, and refuses whatever is no reading.

import {Api, ApiError} from "./api.js";

export class ReplayApi extends Api {
  /** Every call with a method comes here; nothing but a GET goes out. */
  async fetch(method, path, options) {
    if (method !== "GET") throw new ApiError(0, {detail: "this is a replay: nothing can be commanded"});
    return super.fetch(method, path, options);
  }
}
