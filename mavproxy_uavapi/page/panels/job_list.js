// The verbs in flight and the last ones that ended; a running one can be aborted.

import {Panel} from "../base/panel.js";
import {oldText} from "../model/freshness.js";
import {element, setAttribute, setText} from "../base/dom.js";
import {resultWords, sentenceOf, verbWords} from "../model/words.js";
import {apiWord, figures, t} from "../model/text.js";

const SHOWN = 25;

export class JobList extends Panel {
  build() {
    this.rows = new Map();
    this.list = element("ol", {class: "jobs"});
    this.empty = element("p", {class: "empty"}, t("Nothing was asked of a vehicle yet."));
    this.append(this.empty, this.list);
  }

  render(at) {
    const all = [...this.context.fleet.jobs.values()];
    // what runs can be aborted
    const jobs = all.filter((job, n) => job.state === "running" || n >= all.length - SHOWN);
    this.empty.hidden = jobs.length > 0;
    for (const [number, row] of this.rows) {
      if (jobs.some(job => job.job === number)) continue;
      row.remove();
      this.rows.delete(number);
    }
    for (const job of jobs) this.show(job, at);
  }

  show(job, at) {
    let row = this.rows.get(job.job);
    if (!row) {
      row = element("li");
      row.what = element("b");
      row.state = element("span", {class: "state"});
      row.abort = element("button", {type: "button", class: "stop small", "data-needs": "fly",
        on: {click: () => this.abort(job.job)}},
        t("Abort"));
      row.age = element("span", {class: "age"});
      row.append(element("div", {class: "row"}, row.what, row.abort), row.state, " ", row.age);
      this.rows.set(job.job, row);
      this.list.prepend(row);
    }
    setText(row.what, `${job.job} · ${t("vehicle {id}", {id: job.system})} · ${verbWords(job.verb)}`);
    setText(row.state, stateOf(job));
    const runs = job.state === "running", old = runs && !this.isLive(job, at); // how one ended does not age
    setText(row.age, old ? oldText(at - job.at) : "");
    setAttribute(row, "class", old ? `${job.state} old` : job.state);
    row.abort.hidden = !runs;
    setAttribute(row.abort, "aria-label", t("abort job {job}", {job: job.job}));
  }

  isLive(job, at) {
    return !this.context.stream.trouble(at) && Boolean(this.context.fleet.vehicles.get(job.system)?.isAlive(at));
  }

  async abort(number) {
    try {
      await this.context.api.urgently("DELETE", `/jobs/${number}`);
    } catch (error) {
      setText(this.rows.get(number).state, error.message);
    }
  }
}

function stateOf(job) {
  if (job.state === "succeeded") return resultWords(job.result, ` (${figures(job.seconds.toFixed(1))} s)`);
  if (job.state === "failed") return sentenceOf(job);
  const {distance_to_go: far, altitude, item, items, stage} = job.progress;
  const parts = [stage ? apiWord("stage", stage) : "",
    item === undefined ? "" : t("item {item} of {items}", {item, items}),
    far === undefined ? "" : t("{far} m to go", {far: figures(far.toFixed(1))}),
    altitude === undefined ? "" : t("{height} m high", {height: figures(altitude.toFixed(1))})];
  return parts.filter(Boolean).join(", ") || t("under way");
}

customElements.define("job-list", JobList);
