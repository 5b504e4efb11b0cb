// The controls of a recording, where the page shows one.

const SPEEDS = [[0.25, "¼×"], [0.5, "½×"], [1, "1×"], [2, "2×"], [4, "4×"], [0, "fastest"]];

export class Replay {
  constructor(link, story) {
    Object.assign(this, { link, story, playback: null });
    this.bar = document.getElementById("replay");
    this.slider = document.getElementById("place");
    const button = (id, deed) => (document.getElementById(id).onclick = deed);
    button("play", () => this.play(!this.playback.is_playing));
    button("back", () => this.jump(this.playback.frame - 1));
    button("forth", () => this.jump(this.playback.frame + 1));
    button("again", () => this.ask("again"));
    button("rows", () => this.ask("rows").then((file) => offer(file, "tracks.csv", "text/csv")));
    button("bag", () => this.ask("bag").then(() => this.say("The bag is written.")));
    this.slider.oninput = () => this.jump(Number(this.slider.value));
    const speeds = document.getElementById("speed");
    for (const [speed, words] of SPEEDS) speeds.append(new Option(words, speed));
    speeds.onchange = () => this.ask({ speed: Number(speeds.value) });
    story.onPick = (frame) => this.jump(frame);
    document.addEventListener("keydown", (event) => this.key(event));
  }

  ask(deed) {
    const asked = this.link.ask({ replay: deed });
    asked.catch((why) => this.say(why.message));
    return asked;
  }

  say(text) {
    document.getElementById("replay-told").textContent = text;
  }

  play(isPlaying) {
    this.ask({ play: isPlaying });
  }

  jump(frame) {
    const last = (this.playback.frames ?? Infinity) - 1;
    this.ask({ jump: Math.min(Math.max(frame, 0), last) });
  }

  // Where the recording stands now.
  show(playback) {
    this.playback = playback;
    const { frame, frames, ran, is_playing: isPlaying, speed, has_bag: hasBag, run } = playback;
    this.bar.hidden = false;
    for (const id of ["freeze", "restart", "condition"]) document.getElementById(id).hidden = true;
    document.querySelector("#story h2").textContent = "The recording";
    document.getElementById("play").textContent = isPlaying ? "Pause" : "Play";
    document.getElementById("speed").value = speed;
    document.getElementById("bag").disabled = !hasBag;
    document.getElementById("bag").title = hasBag ? "Write the bag that --bag names" : "Start with --bag FILE.mcap";
    this.slider.max = (frames ?? ran) - 1;
    if (document.activeElement !== this.slider || isPlaying) this.slider.value = frame;
    document.getElementById("frames").textContent = `frame ${frame + 1} of ${frames ?? "?"} · run ${run}`;
    this.story.replay(frame, frames ?? ran);
  }

  // While a box is drawn the recording stands still.
  stand() {
    if (this.playback) this.play(false);
  }

  key(event) {
    if (!this.playback || event.ctrlKey || event.metaKey || event.altKey) return;
    if (event.target.matches("input, select, textarea")) return;
    if (event.key === " " && !event.target.matches("button, summary, a")) this.play(!this.playback.is_playing);
    else if (event.key === ".") this.jump(this.playback.frame + 1);
    else if (event.key === ",") this.jump(this.playback.frame - 1);
    else return;
    event.preventDefault();
  }
}

// Gives the text to the user as a file.
export function offer(text, name, type) {
  const a = document.createElement("a");
  a.href = URL.createObjectURL(new Blob([text], { type }));
  a.download = name;
  a.click();
  setTimeout(() => URL.revokeObjectURL(a.href), 1000);
}
