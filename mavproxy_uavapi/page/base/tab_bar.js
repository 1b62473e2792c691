// Tabs over panels, as ARIA describes them: arrow keys move between the tabs.

import {Panel} from "./panel.js";
import {element, setAttribute} from "./dom.js";

const SEEN = 160; // px of a panel that show what it is

export class TabBar extends Panel {
  build() {
    this.setAttribute("role", "tablist");
    this.panels = [...this.parentElement.querySelectorAll("[data-tab]")].filter(one => one instanceof Panel);
    this.tabs = this.panels.map((panel, index) => {
      const id = `tab-${index}`;
      Object.assign(panel, {id: `panel-${index}`});
      const roles = {"role": "tabpanel", "aria-labelledby": id, "tabindex": "0"};
      for (const [name, value] of Object.entries(roles)) panel.setAttribute(name, value);
      const tab = element("button", {type: "button", id, role: "tab", "aria-controls": panel.id,
        on: {click: () => this.pick(index)}}, panel.dataset.tab);
      this.append(tab);
      return tab;
    });
    this.addEventListener("keydown", event => this.keyDown(event));
    this.open(0);
  }

  get current() { return this.panels[this.index]; }

  open(index) {
    this.index = index;
    this.tabs.forEach((tab, n) => {
      setAttribute(tab, "aria-selected", String(n === index));
      tab.tabIndex = n === index ? 0 : -1;
      this.panels[n].hidden = n !== index;
    });
    this.context.painter.touch();
    this.dispatchEvent(new Event("switched"));
    this.current.dispatchEvent(new Event("opened"));
  }

  /** Open the one that was clicked; where it begins below the window's edge, it is scrolled to. */
  pick(index) {
    this.open(index);
    if (this.getBoundingClientRect().bottom > innerHeight - SEEN) this.scrollIntoView();
  }

  keyDown(event) {
    const move = {ArrowRight: 1, ArrowLeft: -1}[event.key];
    if (!move) return;
    const shown = this.tabs.map((tab, n) => (tab.hidden ? -1 : n)).filter(n => n >= 0);
    const next = shown[(shown.indexOf(this.index) + move + shown.length) % shown.length];
    this.open(next);
    this.tabs[next].focus();
  }

  /** Show or hide the tab of a panel. */
  offer(panel, offered) {
    const index = this.panels.indexOf(panel);
    if (this.tabs[index].hidden !== offered) return;
    this.tabs[index].hidden = !offered;
    panel.dispatchEvent(new CustomEvent("offered", {detail: offered}));
    if (!offered && this.index === index) this.open(0);
  }
}

customElements.define("tab-bar", TabBar);
