// The list of targets, and what can be done to the one that is picked.

// Milliseconds until a target that is not there is let go of: its new name may be on the way.
const PATIENCE = 700;

export class Targets {
  constructor(picture, link) {
    Object.assign(this, { picture, link, rows: new Map() });
    this.list = document.getElementById("targets");
    picture.addEventListener("shown", () => this.show(picture.header.targets));
    document.getElementById("stop").onclick = () => this.ask({ stop: { id: null } });
    document.getElementById("restart").onclick = () => this.ask({ restart: {} });
    this.show([]);
  }

  // Tells where something was refused.
  ask(command) {
    return this.link.ask(command).catch((why) => this.say(why.message));
  }

  say(text) {
    document.getElementById("mode").textContent = text;
  }

  pick(id) {
    this.picture.picked = id;
    this.picture.draw();
    this.show(this.picture.header?.targets ?? []);
  }

  stop(id) {
    if (this.picture.picked === id) this.pick(null);
    return this.ask({ stop: { id } });
  }

  // A target was renamed: if it is picked it stays so.
  renamed(id, to) {
    if (this.picture.picked === id) this.pick(to);
  }

  // Lets go of a target that has not been there for a while.
  keepPicked(targets) {
    const { picked } = this.picture;
    if (picked === null || targets.some(({ id }) => id === picked)) this.missing = null;
    else if (performance.now() - (this.missing ??= performance.now()) > PATIENCE) this.picture.picked = this.missing = null;
  }

  show(targets) {
    this.keepPicked(targets);
    for (const [id, row] of this.rows) {
      if (!targets.some((target) => target.id === id)) {
        row.item.remove();
        this.rows.delete(id);
      }
    }
    for (const target of targets) this.fill(this.rows.get(target.id) ?? this.add(target.id), target);
    if (!this.none) {
      this.none = Object.assign(document.createElement("li"), { className: "quiet", textContent: "None is followed." });
      this.list.append(this.none);
    }
    this.none.hidden = targets.length > 0;
  }

  add(id) {
    const item = document.createElement("li");
    item.dataset.id = id;
    item.innerHTML = `
      <div class="row"><span class="dot"></span><button class="name"></button><small></small></div>
      <div class="deeds"><button class="stop">Stop</button><button class="anew">Mark anew</button>
      <form><input type="text" maxlength="64" aria-label="New name"><button>Rename</button></form></div>`;
    const find = (selector) => item.querySelector(selector);
    const row = { item, dot: find(".dot"), name: find(".name"), figures: find("small"), deeds: find(".deeds") };
    row.name.textContent = id;
    row.name.onclick = () => this.pick(this.picture.picked === id ? null : id);
    find(".stop").onclick = () => this.stop(id);
    find(".anew").onclick = () => this.onRenew(id);
    find("input").value = id;
    find("form").onsubmit = (event) => {
      event.preventDefault();
      const to = find("input").value.trim();
      if (to && to !== id) this.ask({ rename: { id, to } });
    };
    this.rows.set(id, row);
    this.list.append(item);
    return row;
  }

  fill({ item, dot, figures, deeds }, { id, state, confidence, response, rect, velocity, age, lost_for: lostFor }) {
    const isPicked = id === this.picture.picked;
    item.classList.toggle("picked", isPicked);
    deeds.hidden = !isPicked;
    dot.className = `dot ${state}`;
    const [w, h] = rect.slice(2).map(Math.round);
    const speed = Math.round(Math.hypot(...velocity));
    const since = state === "lost" ? `lost for ${lostFor}` : `age ${age}`;
    figures.textContent = `${state} ${confidence.toFixed(2)}` +
      (isPicked ? ` · response ${response.toFixed(2)} · ${w}×${h} px · ${speed} px/s · ${since}` : "");
  }
}
