// Scripts on the vehicle's computer: upload, run, follow the log, stop.

import {CommandPanel} from "../base/command_panel.js";
import {element, labelled} from "../base/dom.js";
import {readEvents} from "../net/stream.js";
import "../base/hold_button.js";
import {t} from "../model/text.js";

const EVERY = 2000; // ms from one look to the next while the tab is open
const LINES = 400; // of a log

export class ScriptList extends CommandPanel {
  build() {
    this.rows = element("ol", {class: "scripts"});
    this.file = element("input", {type: "file", accept: ".py,.sh", on: {change: () => this.upload()}});
    this.log = element("pre", {class: "log", tabIndex: 0, hidden: true, "aria-label": t("log")});
    this.append(this.rows, labelled(t("upload a script"), this.file), this.answer, this.log);
    this.addEventListener("opened", () => this.look());
    setInterval(() => { if (!this.hidden && !document.hidden) this.look(); }, EVERY);
  }

  async look() {
    try {
      const [listed, running] = [await this.context.api.get("/mission/list-scripts"),
        await this.context.api.get("/mission/running-scripts")];
      const busy = new Map(running.scripts.map(run => [run.script, run]));
      this.show([...listed.scripts, ...listed.shell_scripts], busy);
    } catch (error) {
      this.say(error.message, "bad");
    }
  }

  show(names, busy) {
    const key = JSON.stringify([names, [...busy.keys()]]);
    if (key === this.shown) return;
    this.shown = key;
    const rows = names.map(name => {
      const act = busy.has(name)
        ? element("button", {type: "button", class: "stop small", on: {click: () => this.stop(name)}}, t("Stop"))
        : element("hold-button", {label: t("Run"), on: {confirmed: () => this.run(name)}});
      const small = (label, click) => element("button", {type: "button", class: "small", on: {click}}, label);
      const first = small(t("Try it first"), () => this.rehearse({script_name: name}));
      const log = small(t("Log"), () => this.follow(name));
      return element("li", {class: busy.has(name) ? "running" : ""}, element("b", {}, name),
        element("span", {class: "state"}, busy.has(name) ? t("runs") : ""), first, act, log);
    });
    this.rows.replaceChildren(...(rows.length ? rows
      : [element("li", {class: "empty"}, t("No script was uploaded yet."))]));
  }

  async upload() {
    const [file] = this.file.files, form = new FormData();
    if (!file) return;
    form.append("file", file);
    this.file.value = "";
    await this.tell(() => this.context.api.call("POST", "/mission/upload-script", {body: form}),
      t("{name} is uploaded", {name: file.name}));
  }

  async run(name) {
    await this.tell(() => this.context.api.call("POST", "/mission/execute-script", {json: {script_name: name}}),
      t("{name}: started", {name}));
    this.follow(name);
  }

  stop(name) {
    const stop = () => this.context.api.urgent("/mission/stop-script", {script_name: name});
    return this.tell(stop, t("{name}: stopped", {name}));
  }

  async tell(work, done) {
    try {
      await work();
      this.say(done, "good");
    } catch (error) {
      this.say(error.message, "bad");
    }
    this.look();
  }

  /** Show the log of a script's newest run, and go on while it runs. */
  async follow(name) {
    this.following?.abort();
    const stop = this.following = new AbortController();
    this.log.hidden = false;
    this.log.replaceChildren();
    try {
      const response = await this.context.api.open(`/mission/scripts/${encodeURIComponent(name)}/log?follow=1`,
        stop.signal);
      await readEvents(response, event => this.line(event));
    } catch (error) {
      if (!stop.signal.aborted) this.say(error.message, "bad");
    }
  }

  line(event) {
    const end = event.line === undefined;
    const text = end ? `— ${t("ended, exit status {status}", {status: event.exit_status ?? "?"})}` : event.line;
    this.log.append(element("span", {}, `${text.replace(/\n$/, "")}\n`));
    while (this.log.children.length > LINES) this.log.firstChild.remove();
    this.log.scrollTop = this.log.scrollHeight;
  }
}

customElements.define("script-list", ScriptList);
