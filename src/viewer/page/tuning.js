// The table of parameters: each with its control, what it does, its default, and the answer to a change.

import { offer } from "./replay.js";

// Milliseconds from one change by a slider to the next that is sent.
const PACE = 150;
// A slider whose default lies low in its range has that share of its way below the default.
const BELOW = 0.33;
const STEPS = 1000;
// The group of what is there for comparison alone.
const ABLATION = "for comparison with the papers";

export class Tuning {
  constructor(link) {
    this.link = link;
    this.groups = document.getElementById("groups");
    this.undoing = document.getElementById("undo");
    this.search = document.getElementById("search");
    this.only = document.getElementById("only-changed");
    this.fields = new Map();
    // Changes that were made here: name and the value before.
    this.done = [];
    this.search.oninput = () => this.filter();
    this.only.onchange = () => this.filter();
    this.undoing.onclick = () => this.undo();
    document.getElementById("save").onclick = () => this.save();
  }

  // Shows the table; `values` are in the order of the rows.
  begin(rows, values) {
    this.fields.clear();
    const groups = new Map();
    for (const row of rows) {
      const name = row.tier === "ablation" ? ABLATION : groupOf(row.name);
      groups.set(name, [...(groups.get(name) ?? []), row]);
    }
    // Those of the tracker that runs come before those of the others.
    const algorithm = values[rows.findIndex(({ name }) => name === "algorithm")];
    const others = rows.find(({ name }) => name === "algorithm").choices.filter((other) => other !== algorithm);
    const rank = ([name]) =>
      name === ABLATION ? 4 : name === "general" ? 0 : name.startsWith(`${algorithm}.`) ? 1 : others.includes(name.split(".")[0]) ? 3 : 2;
    const sorted = [...groups].sort((a, b) => rank(a) - rank(b));
    this.groups.replaceChildren(...sorted.map(([name, own]) => this.group(name, own)));
    this.order = rows.map((row) => this.fields.get(row.name));
    this.take(values);
    this.filter();
  }

  group(name, rows) {
    const details = document.createElement("details");
    const summary = document.createElement("summary");
    const count = document.createElement("small");
    summary.append(`${name} `, count);
    details.append(summary);
    for (const row of rows) {
      const field = new Field(row, (value) => this.set(row.name, value));
      field.details = details;
      this.fields.set(row.name, field);
      details.append(field.element);
    }
    details.count = count;
    return details;
  }

  // Values that hold now.
  take(values) {
    this.order.forEach((field, i) => field.show(values[i]));
    this.count();
  }

  count() {
    const changed = [...this.fields.values()].filter((field) => field.isChanged);
    document.getElementById("changed").textContent = changed.length ? `${changed.length} changed` : "";
    for (const details of this.groups.children) {
      const own = changed.filter((field) => field.details === details).length;
      details.count.textContent = own ? `${own} changed` : "";
    }
  }

  async set(name, value, isUndo) {
    const field = this.fields.get(name);
    const before = field.value;
    try {
      await this.link.ask({ set: { name, value } });
      field.tell("");
      if (!isUndo) {
        const last = this.done.at(-1);
        // The steps of one slide are taken back together.
        if (last?.name !== name || performance.now() - last.at > 1000) this.done.push({ name, before, at: performance.now() });
        else last.at = performance.now();
      }
    } catch (why) {
      field.tell(why.message);
      field.show(before);
    }
    this.undoing.disabled = !this.done.length;
  }

  undo() {
    const last = this.done.pop();
    this.undoing.disabled = !this.done.length;
    if (last) this.set(last.name, last.before, true);
  }

  filter() {
    const wanted = this.search.value.trim().toLowerCase().split(/\s+/).filter(Boolean);
    const isFiltered = wanted.length > 0 || this.only.checked;
    for (const details of this.groups.children) {
      let shown = 0;
      for (const field of this.fields.values()) {
        if (field.details !== details) continue;
        const isShown = wanted.every((word) => field.words.includes(word)) && (!this.only.checked || field.isChanged);
        field.element.hidden = !isShown;
        shown += isShown;
      }
      details.hidden = shown === 0;
      if (isFiltered) details.open = true;
    }
  }

  async save() {
    const told = document.getElementById("saved");
    try {
      const file = await this.link.ask({ save: {} });
      offer(file, "tracker.yaml", "application/yaml");
      told.textContent = "Saved what differs from the defaults. The node reads it with --params-file tracker.yaml.";
    } catch (why) {
      told.textContent = why.message;
    }
  }
}

// One parameter.
class Field {
  constructor(row, onChange) {
    Object.assign(this, { row, onChange });
    this.words = `${row.name} ${row.description}`.toLowerCase();
    const element = document.createElement("div");
    element.className = "parameter";
    element.dataset.name = row.name;
    const id = `p-${row.name}`;
    const head = document.createElement("div");
    head.className = "head";
    const label = Object.assign(document.createElement("label"), { htmlFor: id, textContent: row.name });
    this.reset = Object.assign(document.createElement("button"), { className: "reset", textContent: `default ${words(row.default)}` });
    this.reset.onclick = () => this.onChange(row.default);
    head.append(label, this.reset);
    this.control = document.createElement("div");
    this.control.className = "control";
    this.input = this.make(id);
    const about = document.createElement("p");
    about.textContent = `${row.description}${row.range ? ` ${words(row.range[0])} to ${words(row.range[1])}.` : ""}` +
      ` A change ${row.change}.`;
    this.error = Object.assign(document.createElement("p"), { className: "error" });
    this.error.setAttribute("role", "alert");
    this.error.hidden = true;
    element.append(head, this.control, this.error, about);
    this.element = element;
    for (const input of this.control.querySelectorAll("input, select")) input.disabled = row.fixed;
  }

  make(id) {
    const { row, control } = this;
    const input = document.createElement(row.choices.length ? "select" : "input");
    input.id = id;
    if (row.choices.length) {
      for (const choice of row.choices) input.append(new Option(choice, choice));
      input.onchange = () => this.onChange(input.value);
    } else if (row.kind === "bool") {
      input.type = "checkbox";
      input.role = "switch";
      input.onchange = () => this.onChange(input.checked);
    } else if (row.range) {
      Object.assign(input, { type: "number", min: row.range[0], max: row.range[1], step: row.kind === "integer" ? 1 : "any" });
      input.onchange = () => this.number(input.value);
      this.slider = this.slide(id);
      control.append(this.slider);
    } else {
      input.type = "text";
      input.onchange = () => this.text(input.value);
    }
    control.append(input);
    if (row.unit) control.append(Object.assign(document.createElement("span"), { className: "note", textContent: row.unit }));
    return input;
  }

  // A slider over the range, bent where the default lies low in it, so that values like it can be reached.
  slide(id) {
    const { row } = this;
    const [low, high] = row.range;
    const share = (row.default - low) / (high - low);
    this.bend = share > 0 && share < BELOW ? Math.min(Math.log(share) / Math.log(BELOW), 12) : 1;
    const slider = Object.assign(document.createElement("input"), { type: "range", min: 0, max: STEPS, step: 1 });
    slider.setAttribute("aria-label", `${row.name} slider`);
    slider.dataset.of = id;
    let timer = null;
    slider.oninput = () => {
      const exact = low + (high - low) * (slider.value / STEPS) ** this.bend;
      const value = row.kind === "integer" ? Math.round(exact) : rounded(exact, high - low);
      this.input.value = value;
      this.wanted = value;
      timer ??= setTimeout(() => {
        timer = null;
        this.onChange(this.wanted);
      }, PACE);
    };
    return slider;
  }

  number(text) {
    const value = Number(text);
    if (text === "" || !Number.isFinite(value)) return this.tell(`"${text}" is no number`);
    this.onChange(value);
  }

  // Text as it is, lists as JSON.
  text(text) {
    if (this.row.kind === "string") return this.onChange(text);
    try {
      this.onChange(JSON.parse(text));
    } catch {
      this.tell(`"${text}" is no list: write it as [1, 2]`);
    }
  }

  get isChanged() {
    return words(this.value) !== words(this.row.default);
  }

  show(value) {
    this.value = value;
    const { input, slider, row } = this;
    const isBusy = document.activeElement === input || document.activeElement === slider;
    if (row.kind === "bool") input.checked = value;
    else if (!isBusy) input.value = row.choices.length || row.kind === "string" || row.range ? value : JSON.stringify(value);
    if (slider && !isBusy) {
      const [low, high] = row.range;
      slider.value = STEPS * ((value - low) / (high - low)) ** (1 / this.bend);
    }
    this.element.classList.toggle("is-changed", this.isChanged);
    this.reset.hidden = row.fixed || !this.isChanged;
  }

  tell(why) {
    this.error.textContent = why;
    this.error.hidden = !why;
  }
}

function groupOf(name) {
  const parts = name.split(".");
  return parts.length === 1 ? "general" : parts.slice(0, -1).join(".");
}

function words(value) {
  return typeof value === "string" ? value || "empty" : JSON.stringify(value);
}

// As few digits as the range asks for.
function rounded(value, span) {
  const digits = Math.max(0, 3 - Math.floor(Math.log10(span)));
  return Number(value.toFixed(Math.min(digits + (value < span / 100 ? 3 : 0), 12)));
}
