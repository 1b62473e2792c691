// The API of a page that shows a record: it reads, and refuses whatever is no reading.

import {Api, ApiError} from "./api.js";

export class ReplayApi extends Api {
  /** Every call ends here; nothing but a GET goes out. */
  async asked(path, options) {
    const {method = "GET"} = options;
    if (method !== "GET") throw new ApiError(0, {detail: "this is a replay: nothing can be commanded"});
    return super.asked(path, options);
  }
}
