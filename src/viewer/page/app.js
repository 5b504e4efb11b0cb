// Puts the page together.

import { Link } from "./link.js";
import { Marks } from "./marks.js";
import { Picture } from "./picture.js";
import { Replay } from "./replay.js";
import { Story } from "./story.js";
import { Targets } from "./targets.js";
import { Tuning } from "./tuning.js";

const at = (id) => document.getElementById(id);
// Milliseconds without a frame after which the page says so, and that rates are of.
const STALE = 2000;
const WINDOW = 2000;

const link = new Link();
const picture = new Picture(at("stage"));
const targets = new Targets(picture, link);
const marks = new Marks(picture, link, targets);
const story = new Story();
const tuning = new Tuning(link);
const replay = new Replay(link, story);
const parts = new Map();
// When pictures were shown, for their rate.
let shown = [];

picture.controls(at("layers"));
marks.onDraft = () => replay.stand();
targets.onRenew = (id) => marks.renew(id);

link.addEventListener("hello", ({ detail: { title, version, now, rows, values } }) => {
  document.title = title;
  at("title").textContent = title;
  at("footer").textContent = `long_term_tracker ${version}`;
  at("door").hidden = true;
  connected("live", true);
  picture.forget();
  story.begin(now);
  tuning.begin(rows, values);
  if (marks.isFrozen) marks.hold();
});

link.addEventListener("news", ({ detail }) => {
  const { now, previous, playback, samples = [], events = [], parts: told, values } = detail;
  story.clock(now);
  if (previous) story.beginRun(previous);
  if (playback) replay.show(playback);
  story.add(samples);
  for (const event of events) {
    story.tell(event);
    if (event.kind === "marked") marks.settle(event.rect);
    if (event.kind === "renamed") {
      targets.renamed(event.id, event.text);
      story.rename(event.id, event.text, event.at);
    }
    if (event.kind === "refused") marks.settle(event.rect, event.text);
  }
  if (told) {
    for (const part of told) parts.set(part.name, part);
    health();
  }
  if (values) tuning.take(values);
  figures();
});

link.addEventListener("picture", ({ detail }) => {
  picture.take(detail).catch((why) => banner(`A picture cannot be shown: ${why.message}`));
});

picture.addEventListener("shown", () => {
  at("empty").hidden = true;
  link.side = picture.side;
  shown.push(performance.now());
});

link.addEventListener("closed", () => connected("not connected", false));

link.addEventListener("refused", ({ detail: { why, asks_token: asksToken } }) => {
  at("door").hidden = !asksToken;
  if (asksToken) {
    at("door-error").textContent = sessionStorage.length ? why : "";
    at("token").focus();
  } else banner(`The tracker refuses this page: ${why}`);
});

at("door").onsubmit = (event) => {
  event.preventDefault();
  link.enter(at("token").value.trim());
};

setInterval(() => {
  figures();
  hint();
  story.plan();
}, 1000);

function connected(text, isLive) {
  const chip = at("connection");
  chip.textContent = text;
  chip.className = `chip ${isLive ? "live" : "off"}`;
}

function banner(text) {
  at("banner").textContent = text;
  at("banner").hidden = !text;
}

// Whether frames come, or else what the tracker waits for.
function hint() {
  if (!link.isIn || replay.playback) return banner("");
  const last = story.samples.at(-1)?.[0] ?? -Infinity;
  const isStale = story.now - last > STALE;
  const waiting = parts.get("waiting")?.message;
  const text = isStale ? waiting ?? "No image has come yet: the tracker waits for its camera." : "";
  banner(text);
  if (!picture.header) at("empty").textContent = text || "The first picture is on its way.";
}

function figures() {
  if (replay.playback) return;
  const recent = story.samples.filter(([when]) => when > story.now - WINDOW);
  shown = shown.filter((when) => when > performance.now() - WINDOW);
  if (!recent.length) return at("figures").replaceChildren();
  const rate = (count) => ((count * 1000) / WINDOW).toFixed(0);
  const latency = recent.reduce((sum, sample) => sum + sample[2], 0) / recent.length;
  const skipped = recent.reduce((sum, sample) => sum + sample[1], 0);
  const words = [[rate(recent.length), " frames/s · "], [latency.toFixed(1), " ms latency · "], [skipped, " skipped · shown "], [rate(shown.length), "/s"]];
  at("figures").replaceChildren(...words.flatMap(([value, unit]) => {
    const bold = document.createElement("b");
    bold.textContent = value;
    return [bold, unit];
  }));
}

function health() {
  const rows = [...parts.values()].filter(({ name }) => name !== "waiting").flatMap(({ name, level, message, values }) => {
    const dt = document.createElement("dt");
    dt.textContent = name;
    const dd = document.createElement("dd");
    const line = document.createElement("span");
    line.className = level ? "warn" : "";
    line.textContent = message;
    const more = document.createElement("small");
    more.textContent = values.map(([key, value]) => `${key} ${value}`).join(" · ");
    dd.append(line, more);
    return [dt, dd];
  });
  at("health").replaceChildren(...rows);
}

link.open();
