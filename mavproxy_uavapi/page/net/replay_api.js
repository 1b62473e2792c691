// The API of a page that shows a record: it reads the records and the map, and refuses whatever else it is asked.

import {Api, ApiError} from "./api.js";
import {t} from "../model/text.js";

// Some commands are a GET, too, and whoever makes a link chooses its text: only these, nothing that leads elsewhere.
const READ = /^\/(flights|tiles)(\/[\w-]+)*(\.\w+)?(\?[\w.=&-]*)?$/;

export class ReplayApi extends Api {
  /** Every call comes here. */
  async fetch(method, path, options) {
    if (method !== "GET" || !READ.test(path)) {
      throw new ApiError(0, {detail: t("this is a replay: nothing can be commanded")});
    }
    return super.fetch(method, path, options);
  }

  /**
   * Nothing is streamed into a replay.
   * @returns {Promise<Response>}
   */
  async open() { throw new ApiError(0, {detail: t("this is a replay: nothing is live")}); }
}
